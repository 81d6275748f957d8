// SPDX-License-Identifier: MIT
// The numbers of `bergtow check` as JSON, for scripts.
#include <math.h>
#include <stdio.h>

#include "app/cmd_check.h"
#include "bergtow/comm.h"
#include "base/json.h"
#include "case/arch.h"
#include "case/case_tow.h"
#include "case/cost.h"
#include "case/warning.h"

static void write_domain(bt_json *j, const bt_case *c, const bt_check_ice *n)
{
    const bt_arch a = bt_arch_of(c, n->concentration, n->count < 1 ? 0 : n->size);
    bt_json_open(j, "domain", '{');
    bt_json_number(j, "length_m", c->domain.length);
    bt_json_number(j, "width_m", c->domain.width);
    bt_json_string(j, "across", a.key);
    bt_json_string(j, "sides", a.sides);
    bt_json_number(j, "body_widths", a.bodies);
    bt_json_number(j, "body_widths_needed", a.needed);
    bt_json_bool(j, "load_unbounded", a.unbounded);
    bt_json_close(j, '}');
}

static void write_ice(bt_json *j, const bt_case *c, const bt_check_ice *n)
{
    const bool splits = n->count >= 1 && c->ice.splitting.toughness > 0;
    const bt_check_split s = splits ? bt_check_split_of(c, n) : (bt_check_split){NAN, NAN};
    bt_json_open(j, "ice", '{');
    bt_json_number(j, "floes", round(n->count));
    bt_json_number(j, "concentration", n->concentration);
    bt_json_number(j, "mean_size_m", n->count < 1 ? NAN : n->size);
    bt_json_number(j, "mean_thickness_m", n->count < 1 ? NAN : n->thickness);
    bt_json_number(j, "split_three_point_n", s.three_point);
    bt_json_number(j, "split_opening_n", s.opening);
    bt_json_close(j, '}');
}

static void write_run(bt_json *j, const bt_case *c, const bt_check_ice *n)
{
    const bt_check_step s = bt_check_step_of(c, n);
    bt_json_open(j, "run", '{');
    bt_json_number(j, "duration_s", c->run.duration);
    bt_json_number(j, "dt_s", c->run.dt);
    bt_json_int(j, "n_steps", bt_case_steps(c));
    bt_json_number(j, "tow_distance_m", c->tow.mode == BT_TOW_NONE ? 0 : bt_case_tow_distance(c, c->run.duration));
    bt_json_bool(j, "dt_resolves_collisions", s.contact);
    bt_json_bool(j, "dt_resolves_floes", n->count < 1 || s.floes);
    bt_json_close(j, '}');
}

static void write_cost(bt_json *j, const bt_case *c, const bt_comm *comm, const bt_check_ice *run)
{
    const bt_cost_disk d = bt_cost_disk_of(c, run->count, run->corners, comm->size);
    bt_json_open(j, "cost", '{');
    bt_json_number(j, "memory_b", bt_cost_memory(c, run->count, run->parts, comm->size, comm->ranks_here));
    bt_json_number(j, "frames", bt_cost_frames(c));
    bt_json_number(j, "disk_b", bt_cost_left(&d));
    bt_json_number(j, "disk_while_running_b", d.most);
    bt_json_number(j, "core_time_s", bt_check_seconds(c, run));
    bt_json_number(j, "making_of_ice_s", bt_cost_making(c, run->made));
    bt_json_close(j, '}');
}

void bt_check_print_json(const char *path, const bt_case *c, const bt_comm *comm, const bt_check_ice *n,
                         const bt_check_ice *run, const bt_errors *warnings)
{
    bt_json j = {0};
    bt_json_open(&j, NULL, '{');
    bt_json_string(&j, "case", path);
    bt_json_string(&j, "title", c->run.title);
    bt_warnings_json(&j, "warnings", warnings);
    write_domain(&j, c, n);
    write_ice(&j, c, n);
    write_run(&j, c, run);
    bt_check_write_defaults(&j, c);
    write_cost(&j, c, comm, run);
    bt_json_close(&j, '}');
    fputs(j.text, stdout);
    bt_json_free(&j);
}
