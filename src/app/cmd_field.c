// SPDX-License-Identifier: MIT
// bergtow field: write the ice field of a case to a file that a case can read back: HDF5 with ice.field, GeoJSON with
// ice.outlines; or as fixed floes, with base.
#include "bergtow/field.h"
#include "app/cmd.h"
#include "base/checksum.h"
#include "case/case_check.h"
#include "case/case_derived.h"
#include "case/cost.h"

#include <string.h>
#include <strings.h>

typedef struct {
    bt_cmd_case file;
    const char *output;
    bool force;
} options;

enum { KEY_FORCE = 256 };

static bool ends_in(const char *path, const char *one, const char *other)
{
    const char *dot = strrchr(path, '.');
    return dot && (!strcasecmp(dot, one) || !strcasecmp(dot, other));
}

static bool is_outlines(const char *path) { return ends_in(path, ".geojson", ".json"); }
static bool is_fixed(const char *path) { return ends_in(path, ".yml", ".yaml"); }

/// Does the name promise a format that is not written here? Without an ending it is HDF5.
static bool is_other(const char *path)
{
    const char *slash = strrchr(path, '/');
    return strchr(slash ? slash : path, '.') && !ends_in(path, ".h5", ".hdf5") && !is_outlines(path) && !is_fixed(path);
}

static error_t parse(int key, char *arg, struct argp_state *state)
{
    options *opt = state->input;
    switch (key) {
    case ARGP_KEY_INIT: state->child_inputs[0] = &opt->file; return 0;
    case 'o': opt->output = arg; return 0;
    case KEY_FORCE: opt->force = true; return 0;
    case ARGP_KEY_END:
        if (!opt->output || !*opt->output)
            argp_error(state, "no output file given; name one with -o FIELD.h5, FIELD.geojson or COAST.yml");
        else if (is_other(opt->output))
            argp_error(state, "-o %s: the name must end in .h5, .geojson or .yml, which decides what is written",
                       opt->output);
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option field_options[] = {
    {"output", 'o', "FILE", 0,
     "file to write: HDF5 (FIELD.h5), outlines on the map (FIELD.geojson, in degrees if the case, its outlines or its "
     "field file give longitude and latitude, otherwise in metres east and north), or fixed floes, for example a coast "
     "from a map (COAST.yml)",
     0},
    {"force", KEY_FORCE, NULL, 0, "replace any file of that name", 0},
    {0},
};
static const struct argp field_argp = {.options = field_options,
                                       .parser = parse,
                                       .args_doc = "CASE.yml",
                                       .children = bt_cmd_with_case,
                                       .doc = "Make the ice field of a case, or read it from its ice.outlines, and "
                                              "write it; another case reads it with ice.field or ice.outlines, or "
                                              "includes it as fixed floes with base."};

int bt_cmd_field(int argc, char **argv)
{
    options opt = {0};
    bt_cmd_parse(&field_argp, argc, argv, &opt);
    bt_case input;
    bt_field field;
    bt_errors err = {0};
    bt_field_init(&field);
    bt_status status = bt_case_read(&input, opt.file.path, opt.file.set, opt.file.n_set, &err);
    // Reading a field file to write a field file would only copy it.
    const bool outlines = is_outlines(opt.output), fixed = is_fixed(opt.output);
    if (status == BT_OK && input.ice.field && !outlines && !fixed)
        status = bt_fail(&err, BT_ERR_CASE,
            "%s: ice.field: the case reads its field from %s; remove the key to make one, or write outlines "
            "with -o FIELD.geojson",
            opt.file.path, input.ice.field);
    const bool ours =
        outlines ? bt_field_outlines_ours(opt.output)
        : fixed  ? bt_field_fixed_ours(opt.output)
                 : bt_checksum_there(opt.output, BT_CHECKSUM_FIELD);
    if (status == BT_OK) status = bt_cmd_may_write(opt.output, opt.file.path, ours, opt.force, &err);
    double start = bt_clock();
    if (status == BT_OK)
        status = bt_cost_fits(&input, bt_case_floes_made(&input), &bt_comm_alone, bt_cost_machine(), &err);
    if (status == BT_OK) status = bt_field_load(&input, &field, &err);
    if (status == BT_OK)
        status = outlines ? bt_field_write_outlines(&field, &input, opt.output, &err)
                 : fixed  ? bt_field_write_fixed(&field, &input, opt.output, &err)
                          : bt_field_write(&field, &input, opt.output, &err);
    bt_errors warnings = {0};
    if (status == BT_OK) {
        const double took = bt_clock() - start;
        if (input.lead.mode != BT_LEAD_NONE)
            bt_errors_add(&warnings,
                          "lead.mode: %s: the file holds the ice without the lead; a run that reads the file opens the "
                          "lead",
                          input.lead.mode == BT_LEAD_CHANNEL ? "channel" : "managed");
        input.lead.mode = BT_LEAD_NONE; // no floe of this field is a piece: sizes are as drawn
        const bt_field_sizes sizes = bt_field_sizes_of(&input, &field);
        printf("%s: %d floes, concentration %.4f of %.6g m2, mean diameter %.4g m, %s in %.2f s\n", opt.output, field.n,
               field.concentration, field.ice_area, sizes.mean, bt_case_reads_field(&input) ? "read" : "made", took);
        if (field.strip > 0)
            printf("  cut from a larger extent: floes within %.4g m of the cut, or across it, belong to this region "
                   "only\n", field.strip);
        bt_outline_warn(&field.outlines, &input, &warnings);
        bt_field_size_warn(&input, &sizes, &warnings);
        bt_case_warn_large(&input, &warnings);
    }
    for (size_t i = 0; i < warnings.n; i++) printf("  warning: %s\n", warnings.text[i]);
    bt_errors_free(&warnings);
    bt_field_free(&field);
    bt_case_free(&input);
    free(opt.file.set);
    return bt_cmd_end(&bt_comm_alone, status, &err);
}
