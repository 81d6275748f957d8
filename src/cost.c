// SPDX-License-Identifier: MIT
// What a run costs, before it is made.
#include "cost.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "bergtow/record.h"
#include "case_check.h"
#include "largest.h"

static const double BYTES_PER_FLOE = 2048, FIELD_BYTES_PER_FLOE = 200, BYTES_PER_STEP = 64, BASE_BYTES = 20e6;
static const double BYTES_PER_FLOE_FRAME = 100; // pose, force and speed 40 B, outline in single precision 8 B a vertex

double bt_cost_floe_step(double concentration)
{
    const double x = bt_min(0.95, bt_max(0, concentration));
    return x < 0.5 ? 0.5e-6 * pow(4, (x - 0.2) / 0.3) : 2e-6 * pow(7.5, (x - 0.5) / 0.3);
}

double bt_cost_seconds(const bt_case *c)
{
    const double floes = bt_case_expected_floes(c) + c->n_floes + 1;
    return floes * (double)bt_case_steps(c) * bt_cost_floe_step(c->ice.concentration);
}

double bt_cost_memory(const bt_case *c, double n_floes, int size, int ranks_here)
{
    return (BASE_BYTES + n_floes * (BYTES_PER_FLOE / size + FIELD_BYTES_PER_FLOE)) * ranks_here + BYTES_PER_STEP * (double)bt_case_steps(c);
}

double bt_cost_result(const bt_case *c, double n_floes)
{
    const double frames = c->output.frame_interval > 0 ? c->run.duration / c->output.frame_interval + 1 : 0;
    const double entries = (double)bt_case_steps(c) / bt_max(1, (double)c->output.sample_every);
    return frames * n_floes * BYTES_PER_FLOE_FRAME + 8 * entries * (bt_n_series_fields + (c->output.panels ? 3 * (double)c->impact.panels : 0));
}

/// A run that would take longer than anybody waits, or fill any disk.
void bt_case_check_cost(const bt_check *k)
{
    const bt_case *c = bt_check_case(k);
    if (!bt_check_sound(k, "run.dt run.duration domain.length domain.width ice.concentration ice.size ice.size_law ice.size_min ice.size_max ice.size_spread ice.x_min ice.x_max "
                           "ice.y_min ice.y_max output.frame_interval output.sample_every output.panels impact.panels")) return;
    const double n = bt_case_expected_floes(c) + c->n_floes, work = bt_cost_seconds(c), result = bt_cost_result(c, n);
    if (work > BT_MOST_CORE_SECONDS)
        bt_check_fault(k, "run.duration", "about %.2g floes for %.2g steps need some %.2g s of one core, at most %g are begun; shorten the run, lengthen run.dt, or take larger floes or a smaller region",
                       n, (double)bt_case_steps(c), work, BT_MOST_CORE_SECONDS);
    if (result > BT_MOST_RESULT_BYTES)
        bt_check_fault(k, "output.frame_interval", "frames and series of about %.2g bytes, at most %g are written; lengthen output.frame_interval, or raise output.sample_every", result, BT_MOST_RESULT_BYTES);
}

double bt_cost_machine(void)
{
    double bytes = (double)sysconf(_SC_PHYS_PAGES) * (double)sysconf(_SC_PAGESIZE);
    static const char *const files[] = {"/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"}; // cgroup v2 ("max": none), v1
    for (int i = 0; i < 2; i++) {
        char text[64];
        FILE *f = fopen(files[i], "r");
        const double group = f && fgets(text, sizeof text, f) ? strtod(text, NULL) : 0;
        if (group > 0) bytes = bt_min(bytes, group);
        if (f) fclose(f);
    }
    return bytes;
}

bt_status bt_cost_fits(const bt_case *c, double n_floes, const bt_comm *comm, double machine, bt_errors *err)
{
    const double need = bt_cost_memory(c, n_floes, comm->size, comm->ranks_here);
    if (need <= machine) return BT_OK;
    bt_errors_add(err, "%s: about %.3g floes and %.3g steps need some %.3g GB of memory, and this machine has %.3g GB; take larger floes (ice.size), a smaller region, fewer steps (run.duration), "
                  "or more machines (mpirun)", c->path ? c->path : "case", n_floes, (double)bt_case_steps(c), need / 1e9, machine / 1e9);
    return BT_ERR_CASE;
}
