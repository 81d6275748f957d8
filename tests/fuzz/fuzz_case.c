// SPDX-License-Identifier: MIT
// Any bytes as a case file. What is accepted must survive being written and read again, bit for bit.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bergtow/case.h"
#include "bergtow/estimate.h"
#include "bergtow/field.h"
#include "field/lead.h"
#include "run/setup.h"
#include "contact/cell_contacts.h"
#include "bergtow/world.h"
#include "partition/domain.h"
#include "case/case_derived.h"
#include "fuzz.h"

/// Files that a case names are left alone: what they hold is not part of the input.
static bool names_files(const bt_case *c)
{
    return c->ice.field || c->ice.outlines || c->water.current_table || c->air.wind_table;
}

static void read_again(const bt_case *c)
{
    char *text = bt_case_resolved(c);
    bt_fuzz_file f = bt_fuzz_open((const uint8_t *)text, strlen(text));
    bt_case d;
    bt_errors err = {0};
    const bt_status status = bt_case_read(&d, f.path, NULL, 0, &err);
    if (status != BT_OK) bt_errors_print(&err);
    bt_fuzz_check(status == BT_OK, "the resolved case is refused");
    char *twice = bt_case_resolved(&d);
    bt_fuzz_check(!strcmp(text, twice), "the resolved case reads back to another one");
    free(twice);
    free(text);
    bt_case_free(&d);
    bt_fuzz_reported(status, &err);
    bt_fuzz_close(&f);
}

void bt_fuzz_case(const uint8_t *data, size_t n)
{
    bt_fuzz_file f = bt_fuzz_open(data, n);
    bt_case c;
    bt_errors err = {0};
    const bt_status status = bt_case_read(&c, f.path, NULL, 0, &err);
    bt_fuzz_reported(status, &err);
    if (status == BT_OK) {
        bt_estimate_input in;
        bt_estimate_conditions(&c, &in);
        read_again(&c);
    }
    bt_case_free(&c);
    bt_fuzz_close(&f);
}

static void run_a_little(const bt_case *c, const bt_field *f, bt_errors *err)
{
    bt_world *w = NULL;
    bt_roster roster = {0};
    const bt_status status = bt_setup_world(c, f, &w, &roster, err);
    if (status == BT_OK) {
        bt_domain_create(w, &bt_comm_alone);
        bt_cells_begin(w);
        const int64_t n = bt_case_steps(c);
        for (int i = 0; i < 3 && i < n; i++) bt_world_step(w);
        for (bt_idx i = 0; i < w->bodies.n; i++)
            bt_fuzz_check(isfinite(w->bodies.pose[i].x) && isfinite(w->bodies.pose[i].y),
                          "a pose is not finite after three steps");
    }
    bt_fuzz_reported(status, err);
    bt_roster_free(&roster);
    bt_world_free(w);
}

void bt_fuzz_setup(const uint8_t *data, size_t n) { bt_fuzz_begin_run(data, n, NULL, 0); }

void bt_fuzz_begin_run(const uint8_t *data, size_t n, const char *const *set, int n_set)
{
    bt_fuzz_file file = bt_fuzz_open(data, n);
    bt_case c;
    bt_errors err = {0};
    bt_status status = bt_case_read(&c, file.path, set, n_set, &err);
    bt_fuzz_reported(status, &err);
    if (status == BT_OK && !names_files(&c) && bt_case_floes_made(&c) < 60 && c.n_floes < 20) {
        // Few sweeps and little shaking, so that many inputs are tried.
        c.ice.shake = bt_min(c.ice.shake, 0.5);
        if (c.solver.max_sweeps > 20) c.solver.max_sweeps = 20;
        if (c.solver.position_sweeps > 20) c.solver.position_sweeps = 20;
        bt_field f;
        bt_field_init(&f);
        status = bt_field_generate(&c, &f, &err);
        bt_fuzz_reported(status, &err);
        bt_lead_stats lead;
        if (status == BT_OK) {
            status = bt_lead_open(&c, &f, &lead, &err);
            bt_fuzz_reported(status, &err);
        }
        if (status == BT_OK && f.n < 1000) run_a_little(&c, &f, &err);
        bt_field_free(&f);
    }
    bt_case_free(&c);
    bt_fuzz_close(&file);
}
