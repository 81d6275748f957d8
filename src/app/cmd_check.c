// SPDX-License-Identifier: MIT
// bergtow check: validates a case and prints the numbers that follow from it. For a study: cmd_check_study.c.
#include <math.h>

#include "app/cmd_check.h"
#include "case/case_base.h"

typedef struct {
    bt_cmd_case file;
    double scale; ///< length ratio of the twin to print, 0 = none
    bool json;
} options;

// A number, or a fraction as in 1/30.
static double parse_scale(const struct argp_state *state, const char *text)
{
    char *end;
    double up = strtod(text, &end), down = 1;
    if (end != text && *end == '/') {
        const char *rest = end + 1;
        down = strtod(rest, &end);
        if (end == rest) end = (char *)"?";
    }
    const double ratio = up / down;
    if (end == text || *end || !isfinite(up) || !isfinite(down) || !(ratio >= 1e-4 && ratio <= 1e4))
        argp_error(state, "--scale %s: give a length ratio from 1e-4 to 1e4, as in 30 or 1/30", text);
    return ratio;
}

static error_t parse(int key, char *arg, struct argp_state *state)
{
    options *opt = state->input;
    switch (key) {
    case ARGP_KEY_INIT: state->child_inputs[0] = &opt->file; return 0;
    case 'l': opt->scale = parse_scale(state, arg); return 0;
    case 'j': opt->json = true; return 0;
    case ARGP_KEY_END:
        if (opt->json && opt->scale > 0)
            argp_error(state, "--json and --scale: the twin is a case file, not JSON; give only one of them");
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}
static const struct argp_option check_options[] = {
    {"json", 'j', NULL, 0, "print the numbers of a case as JSON", 0},
    {"scale", 'l', "L", 0, "print the Froude-scaled twin with all lengths times L as a case file instead", 0},
    {0},
};
static const struct argp check_argp = {.options = check_options,
                                       .parser = parse,
                                       .args_doc = "CASE.yml|STUDY.yml",
                                       .children = bt_cmd_with_case,
                                       .doc =
                                           "Validate a case and print the numbers that follow from it; or a study, "
                                           "with the case of each of its conditions. Nothing is computed or written."};

static bt_status print_numbers(const options *opt, const bt_case *input, bt_field *field, bt_errors *err)
{
    const bt_comm *comm = bt_comm_world();
    bt_check_ice ice, run;
    bt_lead_stats lead = {0};
    const bt_status status = bt_check_ready(input, comm, field, &ice, &run, &lead, err);
    if (status != BT_OK) return status;
    bt_errors warnings = {0};
    bt_check_warn(input, field, &ice, &warnings);
    bt_check_print(&(bt_checked){opt->file.path, input, field, comm, &ice, &run, &lead, &warnings}, opt->json);
    bt_errors_free(&warnings);
    return BT_OK;
}

static bt_status print_twin(bt_case *input, double ratio, bt_errors *err)
{
    const bt_status status = bt_case_scale(input, ratio, err);
    if (status != BT_OK) return status;
    char *text = bt_case_scaled_text(input, ratio);
    if (text) fputs(text, stdout);
    free(text);
    return BT_OK;
}

static bt_status check_study(const options *opt, bt_errors *err)
{
    if (!(opt->scale > 0) && !opt->json) return bt_check_study(&opt->file, bt_comm_world()->size, err);
    return bt_fail(err, BT_ERR_USAGE,
                   opt->json
                       ? "%s: is a study, but --json is for a case; check its base case, with --set for the varied keys"
                       : "%s: is a study, but --scale is for a case; scale its base case, and give that as `base`",
                   opt->file.path);
}

int bt_cmd_check(int argc, char **argv)
{
    options opt = {0};
    bt_cmd_parse(&check_argp, argc, argv, &opt);
    bt_case input;
    bt_field field;
    bt_errors err = {0};
    if (bt_case_kind_of(opt.file.path) == BT_FILE_STUDY) {
        const bt_status status = check_study(&opt, &err);
        free(opt.file.set);
        return bt_cmd_end(&bt_comm_alone, status, &err);
    }
    bt_field_init(&field);
    bt_status status = bt_case_read(&input, opt.file.path, opt.file.set, opt.file.n_set, &err);
    if (status == BT_OK && opt.scale > 0) status = print_twin(&input, opt.scale, &err);
    else if (status == BT_OK) status = print_numbers(&opt, &input, &field, &err);
    bt_field_free(&field);
    bt_case_free(&input);
    free(opt.file.set);
    return bt_cmd_end(&bt_comm_alone, status, &err);
}
