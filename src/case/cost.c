// SPDX-License-Identifier: MIT
// Cost of a run, estimated before it starts.
#include "case/cost.h"

#include <unistd.h>

#include "bergtow/shape.h"
#include "bergtow/stats.h"
#include "case/case_check.h"
#include "base/elementary.h"
#include "base/largest.h"

static const double BYTES_PER_FLOE = 2048, FIELD_BYTES_PER_FLOE = 200, BYTES_PER_STEP = 8 * BT_COST_COLUMNS,
                    BYTES_PER_PART = 450, BASE_BYTES = 30e6;
// The history doubles as it grows. HDF5 keeps some memory for each entry of the series and each frame, up to a bound.
static const double GROWN = 1.25, BYTES_PER_ENTRY = 810, MAX_ENTRY_BYTES = 110e6, BYTES_PER_FRAME = 140e3,
                    MAX_FRAME_BYTES = 60e6;
// on rank 0 while it writes a checkpoint: contacts in transit, and a column of the bodies
static const double CHECKPOINT_BYTES_PER_FLOE = 300;
// on rank 0 while it makes the ice, before there is a run: cells of the tessellation, the world that shakes the floes
static const double MAKING_BYTES_PER_FLOE = 3500;

// --- disk ------------------------------------------------------------------------------------------------------------

// Of result.h5 without data; of a frame: its group and nine datasets (xdmf.h); of the index of a deflated dataset.
static const double RESULT_BASE = 350e3, FRAME_BASE = 4880, INDEX = 2600, LEAST_PACKED = 8192;
// Shares left by shuffle and deflate: of poses, of corners, and of speeds and forces, which are 0 for most floes.
static const double POSE_LEFT = 0.9, CORNER_LEFT = 0.79, STILL_LEFT = 0.25;
static const double OTHERS_FRAME = 960; // towed body and walls: 80 corners, poses, speeds
static const double IMPACT_ROWS = 256, IMPACT_COLUMNS = 13, SERIES_CHUNK = 256;
static const double CHECKPOINT_BASE = 135e3, CHECKPOINT_FLOE = 180, CHECKPOINT_CORNER = 13;
static const double TEXTS = 38e3, XDMF_FRAME = 4440, XDMF_LINE = 880;
static const double VORONOI_CORNERS = 5.6;

static const double RAFTING = 1.8; // time of a step, floes that raft / rigid floes

static double entries_of(const bt_case *input)
{
    return ceil((double)bt_case_steps(input) / bt_max(1, (double)input->output.sample_every));
}

double bt_cost_floe_step(const bt_case *input, double concentration)
{
    const double x = bt_min(0.95, bt_max(0, concentration)), law = input->ice.rafting_kappa > 0 ? RAFTING : 1;
    if (x < 0.5) return law * 0.4e-6 * bt_pow(2, (x - 0.2) / 0.3);
    if (x < 0.8) return law * 0.8e-6 * bt_pow(2.75, (x - 0.5) / 0.3);
    return law * 2.2e-6 * bt_pow(2.1, (x - 0.8) / 0.15);
}

// --- time ------------------------------------------------------------------------------------------------------------

// Time of any step; of an entry of the series, with its share of the flushes; of a frame, and of a floe in it; of the
// start, s.
static const double STEP = 8e-6, ENTRY = 17e-6, FRAME = 1e-3, FRAME_FLOE = 1.6e-6, START = 0.1;
// Time in each step of a convex part of a floe, and of a pair of parts of two floes near each other, s.
static const double PART = 0.05e-6, PAIR = 6e-9;

double bt_cost_making(const bt_case *input, double floes)
{
    if (!bt_case_makes_ice(input)) return 0;
    const double x = input->ice.concentration;
    const double loose = bt_min(1, bt_max(0, (0.9 - x) / 0.3)); // 1 up to 60 %, 0 from 90 % on
    const double shape = input->ice.shape == BT_ICE_RECTANGLES ? 0.75 : 1;
    // Regular polygons grow between shakes: the longer, the nearer they come to what fits, and longest if they give up.
    const double growth = input->ice.shape == BT_ICE_POLYGONS ? 0.2 + 0.1 / (0.9 - bt_min(x, 0.89)) : 0;
    return 1e-3 * (shape * (0.09 + 0.02 * input->ice.shake * (0.4 + 0.6 * loose)) + growth) * floes;
}

double bt_cost_stepping(const bt_case *input, const bt_cost_ice *ice)
{
    const double parts = PART * ice->parts +
                         (ice->split > 0 ? PAIR * ice->concentration * ice->parts * ice->parts / ice->split : 0);
    return START +
           (double)bt_case_steps(input) * (STEP + ice->floes * bt_cost_floe_step(input, ice->concentration) + parts) +
           ENTRY * entries_of(input) + bt_cost_frames(input) * (FRAME + FRAME_FLOE * ice->floes);
}

double bt_cost_seconds(const bt_case *input)
{
    const bt_cost_ice ice = {.floes = bt_case_expected_floes(input) + input->n_floes + 1,
                             .concentration = input->ice.concentration};
    return bt_cost_making(input, bt_case_floes_made(input)) + bt_cost_stepping(input, &ice);
}

// --- memory ----------------------------------------------------------------------------------------------------------

/// Memory that the summary uses for the steps, B, also in a checkpoint: the history, and the loads by panel (panel.h).
static double steps_kept(const bt_case *input)
{
    const bool panels = input->body.shape != BT_BODY_ABSENT && input->impact.conversion != BT_IMPACT_NONE;
    const double steps = (double)bt_case_steps(input),
                 blocks = steps / (double)bt_stats_start_step(bt_case_steps(input));
    return BYTES_PER_STEP * steps + (panels ? BT_COST_PANEL_BYTES * blocks * (double)input->impact.panels : 0);
}

double bt_cost_memory(const bt_case *input, double n_floes, double parts, int size, int ranks_here)
{
    const double run = (BASE_BYTES + (BYTES_PER_FLOE * n_floes + BYTES_PER_PART * parts) / size +
                        FIELD_BYTES_PER_FLOE * n_floes) * ranks_here +
                       CHECKPOINT_BYTES_PER_FLOE * n_floes + GROWN * steps_kept(input) +
                       bt_min(MAX_ENTRY_BYTES, BYTES_PER_ENTRY * entries_of(input)) +
                       bt_min(MAX_FRAME_BYTES, BYTES_PER_FRAME * bt_cost_frames(input));
    return bt_max(run, BASE_BYTES * ranks_here + MAKING_BYTES_PER_FLOE * bt_case_floes_made(input));
}

double bt_cost_corners(const bt_case *input, const bt_field *field, double n)
{
    const double each = input->ice.shape == BT_ICE_RECTANGLES ? 4
                        : input->ice.shape == BT_ICE_POLYGONS ? (double)input->ice.sides
                                                              : VORONOI_CORNERS;
    double v[2 * BT_MAX_VERTICES],
        corners = field && field->n > 0 ? (double)field->offsets[field->n] : each * bt_max(0, n - input->n_floes);
    for (bt_idx i = 0; i < input->n_floes; i++) corners += bt_case_floe_outline(&input->floes[i], v);
    return corners;
}

/// Bytes of a dataset that each frame has for itself.
static double of_frame(double bytes, double left, bool packed)
{
    return packed && bytes > LEAST_PACKED ? bytes * left + INDEX : bytes;
}

double bt_cost_frames(const bt_case *input)
{
    if (input->output.frame_interval < 0) return 0;
    const double steps = (double)bt_case_steps(input),
                 due = input->output.frame_interval > 0 ? input->run.duration / input->output.frame_interval : 0,
                 whole = floor(due * (1 + 1e-12));
    return 1 + bt_min(steps, due - whole > 1e-9 * due ? whole + 1 : whole);
}

bt_cost_disk bt_cost_disk_of(const bt_case *input, double n, double corners, int ranks)
{
    const bool packed = ranks == 1, line = input->tow.mode == BT_TOW_LINE || input->tow.mode == BT_TOW_THRUST;
    const double frames = bt_cost_frames(input);
    const double pose = packed ? POSE_LEFT : 1, still = packed ? STILL_LEFT : 1;
    const double frame = n * (24 * pose + 32 * still) + of_frame(8 * corners, CORNER_LEFT, packed) +
                         2 * of_frame(4 * n, STILL_LEFT, packed) + 2 * of_frame(12 * n, STILL_LEFT, packed) +
                         FRAME_BASE + OTHERS_FRAME;
    const double outlines = 28 * n + 16 * corners + 4 * (corners + 2 * n);
    const double entries = ceil(entries_of(input) / SERIES_CHUNK) * SERIES_CHUNK,
                 columns = BT_COST_SERIES + (input->output.panels ? 3 * (double)input->impact.panels : 0);
    const double checkpoint = CHECKPOINT_BASE + CHECKPOINT_FLOE * n + CHECKPOINT_CORNER * corners + steps_kept(input);
    const bool on_the_way =
        (input->output.checkpoint_steps > 0 && input->output.checkpoint_steps < bt_case_steps(input)) ||
        (input->output.checkpoint_wall > 0 &&
         bt_cost_stepping(input, &(bt_cost_ice){.floes = n, .concentration = input->ice.concentration}) >
             input->output.checkpoint_wall);
    bt_cost_disk disk = {.result = RESULT_BASE + outlines + frames * frame + 8 * entries * columns +
                                   8 * IMPACT_ROWS * IMPACT_COLUMNS,
                         .checkpoints = on_the_way ? 2 * checkpoint : checkpoint,
                         .texts = TEXTS + frames * (XDMF_FRAME + (line ? XDMF_LINE : 0))};
    disk.most = bt_cost_left(&disk) + (on_the_way ? 2 * disk.result + checkpoint : checkpoint);
    return disk;
}

double bt_cost_member(const bt_case *input, const bt_cost_disk *disk)
{
    const double row = 3 * 8 * entries_of(input) + 8 * 300; // three series, and 300 numbers of the summary
    return disk->result + disk->texts + row;
}

/// Refuse a run that would take longer than anybody waits, or fill any disk.
void bt_case_check_cost(const bt_check *check)
{
    const bt_case *input = check->c;
    if (!bt_check_sound(check, "run.dt run.duration domain.length domain.width ice.concentration ice.size ice.size_law "
                               "ice.size_min ice.size_max ice.size_spread ice.x_min ice.x_max "
                               "ice.y_min ice.y_max output.frame_interval output.sample_every output.panels "
                               "impact.panels"))
        return;
    const double n = bt_case_expected_floes(input) + input->n_floes, work = bt_cost_seconds(input),
                 result = bt_cost_disk_of(input, n, bt_cost_corners(input, NULL, n), 2).result;
    if (work > BT_MAX_CORE_SECONDS)
        bt_check_fault(check, "run.duration",
                       "about %.2g floes for %.2g steps need about %.2g s on one core, more than the limit of %g s; "
                       "shorten the run, lengthen run.dt, or use larger floes or a smaller region",
                       n, (double)bt_case_steps(input), work, BT_MAX_CORE_SECONDS);
    if (result > BT_MAX_RESULT_BYTES)
        bt_check_fault(check, "output.frame_interval",
                       "frames and series take about %.2g bytes, more than the limit of %g bytes; lengthen "
                       "output.frame_interval, or raise output.sample_every",
                       result, BT_MAX_RESULT_BYTES);
}

double bt_cost_machine(void)
{
    double bytes = (double)sysconf(_SC_PHYS_PAGES) * (double)sysconf(_SC_PAGESIZE);
    // cgroup v2 ("max": no limit), v1
    static const char *const files[] = {"/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"};
    for (int i = 0; i < 2; i++) {
        char text[64];
        FILE *f = fopen(files[i], "r");
        const double group = f && fgets(text, sizeof text, f) ? strtod(text, NULL) : 0;
        if (group > 0) bytes = bt_min(bytes, group);
        if (f) fclose(f);
    }
    return bytes;
}

bt_status bt_cost_fits(const bt_case *input, double n_floes, const bt_comm *comm, double machine, bt_errors *err)
{
    const double need = bt_cost_memory(input, n_floes, 0, comm->size, comm->ranks_here),
                 result = bt_cost_disk_of(input, n_floes, bt_cost_corners(input, NULL, n_floes), 2).result;
    if (result > BT_MAX_RESULT_BYTES) { // a field that was read; with other ice the case is refused
        return bt_fail(err, BT_ERR_CASE,
                       "%s: output.frame_interval: frames and series of %.3g floes take about %.2g bytes, more than "
                       "the limit of %g bytes; lengthen it, or raise output.sample_every",
                       bt_case_name(input), n_floes, result, BT_MAX_RESULT_BYTES);
    }
    if (need <= machine) return BT_OK;
    return bt_fail(err, BT_ERR_CASE,
        "%s: about %.3g floes and %.3g steps need about %.3g GB of memory, but this machine has %.3g GB; use larger "
        "floes (ice.size), a smaller region, fewer steps (run.duration), or more machines (mpirun)",
        bt_case_name(input), n_floes, (double)bt_case_steps(input), need / 1e9, machine / 1e9);
}
