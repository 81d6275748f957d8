// SPDX-License-Identifier: MIT
// What a run costs, before it is made: time, memory, disk.
#ifndef BERGTOW_COST_H
#define BERGTOW_COST_H

#include "bergtow/case.h"
#include "case/case_faults.h"
#include "bergtow/comm.h"
#include "bergtow/field.h"

/// What the layers above write, for the estimate of their size; each is held to it where it is defined.
enum {
    BT_COST_SERIES = 81,      ///< series of a run
    BT_COST_COLUMNS = 25,     ///< of them kept in memory from every step
    BT_COST_PANEL_BYTES = 32, ///< a block of the loads of one panel
};

/// Seconds a floe and step on one core, measured on cases/basin and cases/studies/concentration.yml (AMD EPYC, 2026):
/// 0.4, 0.8, 2.2 and 4.6 µs at 20, 50, 80 and 95 %. Between them the logarithm is linear. Of floes that raft
/// (cases/route/uniform.yml) 1.8 times as much. A pack so large that most floes rest costs less, a closed one that jams
/// more: the order of magnitude, no more.
double bt_cost_floe_step(const bt_case *input, double concentration);

/// The ice of a run.
typedef struct bt_cost_ice {
    double floes, concentration;
    double split, parts; ///< floes that are not convex, and convex parts that they are made of
} bt_cost_ice;

/// Processor time of the making of so many floes, s; 0 for ice that is read. Measured in November 2026 on 100 to 30,000
/// floes of all shapes and laws: 0.09 ms a floe, and 0.02 ms (0.008 ms from 90 % on) for each mean gap of ice.shake;
/// three quarters of that for rectangles, twice for polygons, which grow in stages.
double bt_cost_making(const bt_case *input, double floes);

/// Processor time of the steps of a run and of what they leave, s: 8 µs a step, bt_cost_floe_step a floe, 17 µs an
/// entry of the series, 1 ms and 1.6 µs a floe a frame, which is packed; 0.1 s to start and to end; of floes that are
/// not convex 0.05 µs a part, and the pairs of parts of two floes, of which a floe has more neighbours the denser the
/// ice is. Measured on runs of 1 to 260,000 steps, and on outlines of 12 to 120 corners in 3 to 80 parts.
double bt_cost_stepping(const bt_case *input, const bt_cost_ice *ice);

/// Both, of a case whose ice is made or given by hand.
double bt_cost_seconds(const bt_case *input);

/// Memory of a node with ranks_here of `size` ranks, B: 30 MB of the program and its libraries, 2 kB a floe (body
/// arrays about 0.5 kB, contacts and lists about 1.5 kB in dense ice) and 0.45 kB a part of floes that are not convex,
/// shared by the ranks, 0.2 kB a floe on each for the field at time zero; on one of them 0.3 kB a floe for the time of
/// a checkpoint, what the summary keeps of every step, and what HDF5 keeps of each entry and frame.
double bt_cost_memory(const bt_case *input, double n_floes, double parts, int size, int ranks_here);

/// Corners of all floes: of the field where one was read (field->n > 0, or `field` NULL), else as many as n floes of
/// the shape have in the mean (5.6 of Voronoi cells, as counted in the cases of cases/), and those given by hand.
double bt_cost_corners(const bt_case *input, const bt_field *field, double n);

/// Frames of a run: the start, the first step at or after each multiple of the interval, the end; one a step at most.
double bt_cost_frames(const bt_case *input);

/// What a run leaves on disk, B.
typedef struct bt_cost_disk {
    double result;      ///< result.h5: series, frames, outlines
    double checkpoints; ///< the last one, or two
    double texts;       ///< frames.xdmf, summary.json, case.resolved.yml
    /// all of it while it runs: result.part.h5, and result.h5 and a checkpoint before and after they are replaced
    double most;
} bt_cost_disk;

/// Lengths of the datasets that src/output/frames.c, src/output/record.c and src/base/snapshot_file.c write, with what
/// HDF5 takes for each, and shares that deflate leaves, as measured in November 2026 on the cases of cases/: one rank
/// stores frames compressed, several do not. Within 20 % of what was left there: tests/cli/test_disk.py.
bt_cost_disk bt_cost_disk_of(const bt_case *input, double n_floes, double corners, int ranks);
static inline double bt_cost_left(const bt_cost_disk *disk) { return disk->result + disk->checkpoints + disk->texts; }

/// Of a member of an ensemble, whose checkpoints are taken away, with its row in ensemble.h5.
double bt_cost_member(const bt_case *input, const bt_cost_disk *disk);

/// Memory of this machine, or less where the control group of this process has less, B.
double bt_cost_machine(void);

/// Refuse a case of n_floes that needs more memory than a machine has, or more disk than any run may take. Errors:
/// BT_ERR_CASE.
bt_status bt_cost_fits(const bt_case *input, double n_floes, const bt_comm *comm, double machine, bt_errors *err);

/// Work and output of the run against the limits of size, of a case that is sound so far.
void bt_case_check_cost(const bt_check *check);

#endif
