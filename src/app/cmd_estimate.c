// SPDX-License-Identifier: MIT
// bergtow estimate: the published estimates of the resistance for a case, without simulating it.
#include "bergtow/estimate.h"
#include "bergtow/field.h"
#include "case/arch.h"
#include "case/case_derived.h"
#include "app/cmd.h"
#include "force/environment.h"
#include "output/estimate_text.h"
#include "run/setup.h"

#include <stdio.h>
#include <stdlib.h>

typedef struct {
    bt_cmd_case file;
    bool json;
} options;

static error_t parse(int key, char *arg, struct argp_state *state)
{
    (void)arg;
    options *o = state->input;
    switch (key) {
    case ARGP_KEY_INIT: state->child_inputs[0] = &o->file; return 0;
    case 'j': o->json = true; return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option estimate_options[] = {
    {"json", 'j', NULL, 0, "print JSON, with curves over the concentration", 0},
    {0},
};
static const struct argp_child children[] = {{.argp = &bt_cmd_case_argp}, {0}};
static const struct argp estimate_argp = {.options = estimate_options,
                                          .parser = parse,
                                          .args_doc = "CASE.yml",
                                          .children = children,
                                          .doc = "Print the resistance of broken ice by Lichey & Hellmer 2001, by "
                                                 "three closures of Marchenko et al. 2010, in the dilute "
                                                 "limit and by a regression of ships in pack ice, and the drag of open "
                                                 "water, for the body, ice and speed of a case. Nothing is simulated."};

static void print_table(const options *o, const bt_case *c, const bt_estimate_input *in)
{
    printf("%s: estimates, nothing simulated\n", o->file.path);
    printf("ice                  concentration %.4g, thickness %.4g m, floe radius %.4g m (means weighted with area), "
           "density %.4g kg/m3\n",
           in->concentration, in->thickness, in->floe_radius, in->ice_density);
    printf("body                 %.4g m across the tow%s, %.4g m/s through the ice%s\n", in->width,
           c->tow.n_waypoints > 1 ? " on the first leg" : "", in->along,
           c->tow.n_programme > 0 ? " at most" : "");
    printf("ice strength         P = %.4g N/m, captures a berg from P_s = %.4g N/m (length scale %g)\n",
           bt_estimate_strength(in), in->p_s, in->length_scale);
    printf("kappa, phi           %g (%g to %g), %g\n\n", c->estimate.kappa, c->estimate.kappa_low,
           c->estimate.kappa_high, c->estimate.phi_j);
    bt_estimates_print(in, NAN, "", true);
}

/// Ice drifts with wind and water as it does at the start, where neither changes; else with the water, and so does
/// loose ice between walls, which begins at rest.
static void order_speeds(const bt_case *c, bt_estimate_input *in)
{
    bt_estimate_input ordered;
    double ice[2], body[2];
    const bool walls = c->domain.ends == BT_BOUND_WALL || c->domain.sides == BT_BOUND_WALL;
    if (bt_environment_changes(c) || (walls && in->concentration < BT_BOUND_CONCENTRATION - BT_MADE_OFF)) return;
    bt_setup_drift(c, 2 * in->floe_radius, in->thickness, in->concentration, ice, body);
    bt_estimate_ordered(c, ice, &ordered);
    in->speed = ordered.speed;
    in->along = in->ordered = ordered.along;
}

int bt_cmd_estimate(int argc, char **argv)
{
    options o = {0};
    bt_cmd_parse(&estimate_argp, argc, argv, &o);
    bt_case c;
    bt_field f;
    bt_errors err = {0};
    bt_field_init(&f);
    bt_status status = bt_case_read(&c, o.file.path, o.file.set, o.file.n_set, &err);
    if (status == BT_OK && bt_case_reads_field(&c)) status = bt_field_load(&c, &f, &err);
    if (status == BT_OK && c.tow.mode == BT_TOW_NONE) {
        bt_errors_add(&err, "%s: %s, and the estimates are of the force on a towed body; %s", o.file.path,
                      c.body.shape == BT_BODY_ABSENT ? "body.shape: none" : "tow.mode: none",
                      c.body.shape == BT_BODY_ABSENT ? "give it a body and a tow" : "set tow.mode and tow.speed");
        status = BT_ERR_CASE;
    }
    if (status == BT_OK) {
        bt_estimate_input in;
        bt_estimate_conditions(&c, &in);
        if (f.n > 0) {
            in.concentration = f.concentration;
            bt_estimate_field(&f, &in.thickness, &in.floe_radius);
        }
        order_speeds(&c, &in);
        if (o.json) {
            bt_json j = {0};
            bt_json_open(&j, NULL, '{');
            bt_json_string(&j, "title", c.run.title);
            bt_estimates_json(&j, "estimates", &in, NAN);
            bt_estimate_labels_json(&j, "estimate_labels", &in);
            bt_json_close(&j, '}');
            fputs(j.text, stdout);
            bt_json_free(&j);
        } else {
            print_table(&o, &c, &in);
        }
    }
    bt_field_free(&f);
    bt_case_free(&c);
    free(o.file.set);
    return bt_cmd_end(&bt_comm_alone, status, &err);
}
