// SPDX-License-Identifier: MIT
// Cost of a run, estimated before it starts: time, memory, disk.
#ifndef BERGTOW_COST_H
#define BERGTOW_COST_H

#include "bergtow/case.h"
#include "case/case_faults.h"
#include "bergtow/comm.h"
#include "bergtow/field.h"

/// Sizes of what the layers above write, for the estimates; each is asserted where it is defined.
enum {
    BT_COST_SERIES = 81,      ///< series of a run
    BT_COST_COLUMNS = 25,     ///< of these, kept in memory for every step
    BT_COST_PANEL_BYTES = 32, ///< bytes of a block of the loads of one panel
};

/// Seconds for a floe and a step on one core, measured on cases/basin and cases/studies/concentration.yml (AMD EPYC,
/// 2026): 0.4, 0.8, 2.2 and 4.6 µs at 20, 50, 80 and 95 %, with the logarithm linear in between; 1.8 times as much for
/// floes that raft (cases/route/uniform.yml). A pack so large that most floes rest costs less, a closed one that jams
/// costs more: the value is an order of magnitude.
double bt_cost_floe_step(const bt_case *input, double concentration);

/// The ice of a run.
typedef struct bt_cost_ice {
    double floes, concentration;
    double split, parts; ///< floes that are not convex, and the convex parts that they consist of
} bt_cost_ice;

/// Processor time to make so many floes, s; 0 for ice that is read. Measured in November 2026 on 100 to 30,000 floes of
/// all shapes and laws: 0.09 ms a floe, and 0.02 ms (0.008 ms from 90 % on) for each mean gap of ice.shake; three
/// quarters of that for rectangles, twice as much for polygons, which grow in stages.
double bt_cost_making(const bt_case *input, double floes);

/// Processor time of the steps of a run and of its output, s: 8 µs a step, bt_cost_floe_step a floe and step, 17 µs an
/// entry of the series, 1 ms and 1.6 µs a floe for each frame, compression included; 0.1 s to start and end. Floes that
/// are not convex add 0.05 µs a part and step, and the pairs of parts of neighbouring floes, more of them in denser
/// ice. Measured on runs of 1 to 260,000 steps, and on outlines of 12 to 120 corners in 3 to 80 parts.
double bt_cost_stepping(const bt_case *input, const bt_cost_ice *ice);

/// Both times together, of a case whose ice is made or given by hand.
double bt_cost_seconds(const bt_case *input);

/// Memory of a node with ranks_here of `size` ranks, B. Each rank: 30 MB for the program and its libraries, 0.2 kB a
/// floe for the field at time zero, and its part of 2 kB a floe (body arrays about 0.5 kB, contacts and lists about 1.5
/// kB in dense ice) and 0.45 kB a part of floes that are not convex. One of them in addition: 0.3 kB a floe during a
/// checkpoint, what the summary keeps of every step, and what HDF5 keeps of each entry and frame.
double bt_cost_memory(const bt_case *input, double n_floes, double parts, int size, int ranks_here);

/// Corners of n floes: of a field that has floes, else (`field` may be NULL) for each floe made the mean number of its
/// shape (5.6 for Voronoi cells, as counted in the cases of cases/); and those of the floes given by hand.
double bt_cost_corners(const bt_case *input, const bt_field *field, double n);

/// Frames of a run: the start, the first step at or after each multiple of the interval, the end; one a step at most.
double bt_cost_frames(const bt_case *input);

/// Disk space of a run, B.
typedef struct bt_cost_disk {
    double result;      ///< result.h5: series, frames, outlines
    double checkpoints; ///< the last one, or the last two
    double texts;       ///< frames.xdmf, summary.json, case.resolved.yml
    /// most at any time: result.part.h5, and result.h5 and a checkpoint before and after they are replaced
    double most;
} bt_cost_disk;

/// Lengths of the datasets that src/output/frames.c, src/output/record.c and src/base/snapshot_file.c write, with the
/// space HDF5 takes for each and the shares left by deflate, as measured in November 2026 on the cases of cases/. One
/// rank stores frames compressed, several do not. Within 20 % of the files of those cases: tests/cli/test_disk.py.
bt_cost_disk bt_cost_disk_of(const bt_case *input, double n_floes, double corners, int ranks);
static inline double bt_cost_left(const bt_cost_disk *disk) { return disk->result + disk->checkpoints + disk->texts; }

/// Disk space of a member of an ensemble, whose checkpoints are removed, with its row in ensemble.h5, B.
double bt_cost_member(const bt_case *input, const bt_cost_disk *disk);

/// Memory of this machine, or of the control group of this process if that has less, B.
double bt_cost_machine(void);

/// Refuse a case of n_floes that needs more memory than a machine has, or more disk than any run may take. Errors:
/// BT_ERR_CASE.
bt_status bt_cost_fits(const bt_case *input, double n_floes, const bt_comm *comm, double machine, bt_errors *err);

/// Check work and output of the run against the limits of size; the case must be sound so far.
void bt_case_check_cost(const bt_check *check);

#endif
