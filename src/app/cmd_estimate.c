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

typedef struct {
    bt_cmd_case file;
    bool json;
} options;

static error_t parse(int key, char *arg, struct argp_state *state)
{
    (void)arg;
    options *opt = state->input;
    switch (key) {
    case ARGP_KEY_INIT: state->child_inputs[0] = &opt->file; return 0;
    case 'j': opt->json = true; return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option estimate_options[] = {
    {"json", 'j', NULL, 0, "print JSON, with curves over the concentration", 0},
    {0},
};
static const struct argp estimate_argp = {.options = estimate_options,
                                          .parser = parse,
                                          .args_doc = "CASE.yml",
                                          .children = bt_cmd_with_case,
                                          .doc = "Print estimates of the resistance of broken ice for the body, ice "
                                                 "and speed of a case: by Lichey & Hellmer 2001, by three closures of "
                                                 "Marchenko et al. 2010, in the dilute limit, and by a regression of "
                                                 "ships in pack ice. Print the drag of open water, too. Nothing is "
                                                 "simulated."};

static void print_table(const options *opt, const bt_case *input, const bt_estimate_input *in)
{
    printf("%s: estimates, nothing simulated\n", opt->file.path);
    printf("ice                  concentration %.4g, thickness %.4g m, floe radius %.4g m (means weighted by area), "
           "density %.4g kg/m3\n",
           in->concentration, in->thickness, in->floe_radius, in->ice_density);
    printf("body                 %.4g m across the tow%s, %.4g m/s through the ice%s\n", in->width,
           input->tow.n_waypoints > 1 ? " on the first leg" : "", in->along,
           input->tow.n_programme > 0 ? " at most" : "");
    printf("ice strength         P = %.4g N/m, captures a berg from P_s = %.4g N/m (length scale %g)\n",
           bt_estimate_strength(in), in->p_s, in->length_scale);
    printf("kappa, phi           %g (%g to %g), %g\n\n", input->estimate.kappa, input->estimate.kappa_low,
           input->estimate.kappa_high, input->estimate.phi_j);
    bt_estimates_print(in, NAN, "", true);
}

/// Ice drifts with wind and water as it does at the start, where neither changes; else with the water, and so does
/// loose ice between walls, which begins at rest.
static void order_speeds(const bt_case *input, const bt_field *field, bt_estimate_input *in)
{
    bt_estimate_input ordered;
    double ice[2], body[2];
    const bool walls = input->domain.ends == BT_BOUND_WALL || input->domain.sides == BT_BOUND_WALL;
    if (bt_environment_changes(input) || (walls && in->concentration < BT_BOUND_CONCENTRATION - BT_MADE_OFF)) return;
    const bt_floe_means floe = bt_setup_mean_floe(input, field);
    bt_setup_drift(input, floe.size, floe.thickness, in->concentration, ice, body);
    bt_estimate_ordered(input, ice, &ordered);
    in->speed = ordered.speed;
    in->along = in->ordered = ordered.along;
}

int bt_cmd_estimate(int argc, char **argv)
{
    options opt = {0};
    bt_cmd_parse(&estimate_argp, argc, argv, &opt);
    bt_case input;
    bt_field field;
    bt_errors err = {0};
    bt_field_init(&field);
    bt_status status = bt_case_read(&input, opt.file.path, opt.file.set, opt.file.n_set, &err);
    if (status == BT_OK && bt_case_reads_field(&input)) status = bt_field_load(&input, &field, &err);
    if (status == BT_OK && input.tow.mode == BT_TOW_NONE)
        status = bt_fail(&err, BT_ERR_CASE,
            "%s: %s, but the estimates are of the force on a towed body; %s", opt.file.path,
            input.body.shape == BT_BODY_ABSENT ? "body.shape: none" : "tow.mode: none",
            input.body.shape == BT_BODY_ABSENT ? "give it a body and a tow" : "set tow.mode and tow.speed");
    if (status == BT_OK) {
        bt_estimate_input in;
        bt_estimate_conditions(&input, &in);
        if (field.n > 0) {
            in.concentration = field.concentration;
            bt_estimate_field(&field, &in.thickness, &in.floe_radius);
        }
        order_speeds(&input, &field, &in);
        if (opt.json) {
            bt_json json = {0};
            bt_json_open(&json, NULL, '{');
            bt_json_string(&json, "title", input.run.title);
            bt_estimates_json(&json, "estimates", &in, NAN);
            bt_estimate_labels_json(&json, "estimate_labels", &in);
            bt_json_close(&json, '}');
            fputs(json.text, stdout);
            bt_json_free(&json);
        } else {
            print_table(&opt, &input, &in);
        }
    }
    bt_field_free(&field);
    bt_case_free(&input);
    free(opt.file.set);
    return bt_cmd_end(&bt_comm_alone, status, &err);
}
