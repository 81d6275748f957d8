// SPDX-License-Identifier: MIT
// bergtow check: validates a case and prints the numbers that follow from it. Of a study: cmd_check_study.c.
//
// Time step rule [Yulmetov & Løset 2017]: Δt about the duration of a collision (0.1 s in a basin, at most 5 s at full
// scale) and much smaller than body size / relative speed. "Much smaller" is taken as a tenth here (assumed).
#include "force/environment.h"
#include "bergtow/field.h"
#include "field/lead.h"
#include "case/rope.h"
#include "run/setup.h"
#include "bergtow/shape.h"
#include "case/arch.h"
#include "case/case_base.h"
#include "case/case_tow.h"
#include "case/case_derived.h"
#include "app/cmd.h"
#include "app/cmd_check.h"
#include "case/cost.h"
#include "contact/law.h"
#include "estimate/packing.h"
#include "base/elementary.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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
static const struct argp_child children[] = {{.argp = &bt_cmd_case_argp}, {0}};
static const struct argp check_argp = {.options = check_options,
                                       .parser = parse,
                                       .args_doc = "CASE.yml|STUDY.yml",
                                       .children = children,
                                       .doc =
                                           "Validate a case and print the numbers that follow from it; or a study, "
                                           "with the case of each of its conditions. Nothing is computed or written."};

static void print_ice(const bt_case *input, const bt_field *field, const bt_check_ice *ice)
{
    if (input->ice.field) printf("ice area             %.6g m2, of the field file\n", field->ice_area);
    else
        printf("ice region           %g x %g m\n", input->ice.x_max - input->ice.x_min,
               input->ice.y_max - input->ice.y_min);
    printf("concentration        %.4g\n", ice->concentration);
    const bool read = bt_case_reads_field(input);
    printf("floes                %s%.0f%s\n", read ? "" : "about ", ice->count,
           input->ice.field ? " (read from the field file)"
           : read       ? " (read from the outlines)"
                        : "");
    if (ice->count < 1) return;
    printf("mean floe            size %.4g m, thickness %.4g m, mass about %.4g kg\n", ice->size, ice->thickness,
           input->ice.density * ice->thickness * BT_PI / 4 * ice->size * ice->size);
}

/// 0 for what rounding has left of it, m.
static double whole(double x) { return fabs(x) < 1e-9 ? 0 : x; }

static void print_line(const bt_case *input)
{
    const bool thrust = input->tow.mode == BT_TOW_THRUST;
    const bt_rope rope = bt_rope_named(input->tow.line.type, input->tow.line.diameter);
    printf("line                 %s, %d x %.4g m, EA %.4g N, damping %.4g N s/m, breaking load %s%.4g N%s\n",
           rope.name, (int)input->tow.line.branches, input->tow.line_length, input->tow.line_stiffness,
           input->tow.line_damping, input->tow.line.breaking_load > 0 ? "" : "none: ", input->tow.line.breaking_load,
           input->tow.line.breaking_load > 0 ? "" : " = never breaks");
    if (input->tow.line.branches > 1)
        printf("line, second branch  %.4g m, EA %.4g N, breaking load %s%.4g N%s\n", input->tow.branch2.length,
               input->tow.branch2.stiffness, input->tow.branch2.breaking_load > 0 ? "" : "none: ",
               input->tow.branch2.breaking_load, input->tow.branch2.breaking_load > 0 ? "" : " = never breaks");
    printf("line, fastened       at (%.4g, %.4g) m", whole(input->tow.hull_x), whole(input->tow.hull_y));
    if (input->tow.line.branches > 1)
        printf(" and (%.4g, %.4g) m", whole(input->tow.branch2.hull_x), whole(input->tow.branch2.hull_y));
    printf(" from the centroid of the waterline, along the body's own x and y\n");
    if (input->tow.line.type != BT_ROPE_NUMBERS)
        printf("line, named          diameter %.4g mm, %.4g kg/m, new EA %.4g N and breaking load %.4g N (%s)%s\n",
               1e3 * input->tow.line.diameter, rope.mass, rope.stiffness, rope.breaking, rope.source,
               input->tow.line.weight > 0 ? "" : "; weight and sag are not simulated");
    if (input->tow.line.weight > 0)
        printf("line, weight         %.4g N/m in water, an elastic catenary; it starts with a pull of %.4g N\n",
               input->tow.line.weight, BT_START_PULL * input->tow.line.weight * input->tow.line_length);
    printf("line, start          period of the body on the line %.3g s, ramp %.4g s, at least %g periods: %s\n",
           bt_case_line_period(input), bt_case_steepest_ramp(input), BT_RAMP_PERIODS,
           bt_case_start_is_slow(input) ? "ok" : "TOO SHORT: the start jerks the line");
    if (!thrust) return;
    // of a current that changes the mean over the run
    double current[2];
    bt_environment_mean(input, true, current);
    const double through = input->tow.speed - current[0] * bt_cos(input->tow.direction) -
                           current[1] * bt_sin(input->tow.direction),
                 r = bt_min(bt_max(through, 0) / input->tow.vessel.free_speed, 1);
    printf("vessel               bollard pull %.4g N, free-running %.4g m/s; net pull left for the line at %.4g m/s "
           "through the water: %.4g N\n",
           input->tow.vessel.bollard_pull, input->tow.vessel.free_speed, through,
           input->tow.vessel.bollard_pull * (1 - r * r));
}

static void print_outlines(const bt_outline_counts *counts)
{
    if (counts->read)
        printf("outlines             %" PRId64 " read, %" PRId64 " turned round, %" PRId64
               " double or collinear vertices dropped\n",
               counts->read, counts->turned, counts->dropped);
    if (counts->read) printf("coordinates          %s\n", counts->crs);
    if (counts->read && isfinite(counts->east))
        printf("origin               %.10g m east, %.10g m north at x = y = 0\n", counts->east, counts->north);
    if (counts->rounded)
        printf("not convex           %" PRId64 " floes by rounding alone: %" PRId64
               " corners left out, which adds %.3g m2\n",
               counts->rounded, counts->rounded_corners, counts->rounded_area);
    if (counts->read && isfinite(counts->lon))
        printf("origin               %.6f deg E, %.6f deg N at x = y = 0\n", counts->lon * 180 / BT_PI,
               counts->lat * 180 / BT_PI);
    if (counts->hulled)
        printf("not convex           %" PRId64 " floes replaced by their hulls, which adds %.4g m2\n", counts->hulled,
               counts->hull_area);
    if (counts->split)
        printf("not convex           %" PRId64 " floes in %" PRId64 " convex parts\n", counts->split, counts->parts);
}

static void print_body(const bt_case *input)
{
    double v[2 * BT_MAX_VERTICES];
    int n = bt_case_waterline(input, v);
    if (!n) {
        printf("body                 none\n");
        return;
    }
    bt_moments moments = bt_shape_moments(n, v);
    double ahead = input->tow.direction - input->body.yaw, across = bt_shape_width(n, v, bt_cos(ahead), bt_sin(ahead)),
           along = bt_shape_width(n, v, -bt_sin(ahead), bt_cos(ahead));
    double mass = bt_case_body_mass(input), displaced = input->water.density * moments.area * input->body.draft;
    printf("body                 %.4g m along the tow, %.4g m across, waterline %.4g m2, draft %.4g m, sail %.4g m\n",
           along, across, moments.area, input->body.draft, input->body.sail);
    printf("body mass            %.4g kg, %.4g kg with added mass; displaced water %.4g kg (ratio %.3f)\n", mass,
           mass * (1 + input->body.added_mass), displaced, mass / displaced);
    double speed = input->tow.speed;
    if (input->tow.mode == BT_TOW_NONE) {
        printf("tow                  none, free drift\n");
        return;
    }
    static const char *const modes[] = {
        [BT_TOW_NONE] = "none", [BT_TOW_SPEED] = "speed", [BT_TOW_LINE] = "line", [BT_TOW_THRUST] = "thrust"};
    printf("tow                  %s, %.4g m/s, %.4g m in all, Froude number %.3g\n", modes[input->tow.mode], speed,
           bt_case_tow_distance(input, input->run.duration), speed / sqrt(BT_GRAVITY * along));
    if (input->tow.mode == BT_TOW_LINE || input->tow.mode == BT_TOW_THRUST) print_line(input);
}

/// What the contact laws of the case mean for the mean floe.
static void print_laws(const bt_case *input, const bt_check_ice *ice)
{
    for (int law = 0; ice->count >= 1 && law < BT_LAWS; law++) {
        char *line = bt_laws[law]->check ? bt_laws[law]->check(input, ice->thickness, ice->size) : NULL;
        if (line) fputs(line, stdout);
        free(line);
    }
    if (ice->count < 1 || !(input->ice.splitting.toughness > 0)) return;
    const bt_check_split split = bt_check_split_of(input, ice);
    printf("splitting            a mean floe, as a square, splits under %.4g N at three points, and %.4g N on each "
           "side of a wedge; pieces at least %.3g m wide (toughness and strength are not calibrated)\n",
           split.three_point, split.opening, input->ice.splitting.least_size);
}

static void print_window(const bt_case *input, const bt_check_ice *ice)
{
    if (input->domain.ends != BT_BOUND_MOVING) return;
    bt_track track = ice->count < 1 ? (bt_track){0}
                                    : bt_setup_track(input, ice->size, ice->thickness, ice->concentration);
    printf("moving window        the body keeps %.4g m from its front and %.4g m from its rear; the tow is %.3g "
           "windows of ice long\n",
           input->domain.ahead, input->domain.length - input->domain.ahead, bt_track_laps(input, &track));
    bt_setup_track_free(&track);
}

/// With a field that was read as it will be; of a field that is still to be made, the strip.
static void print_lead(const bt_case *input, const bt_lead_stats *lead)
{
    if (input->lead.mode == BT_LEAD_NONE) return;
    printf("lead                 %s, %.4g m wide, %.4g m long, %.4g m2 of strip",
           input->lead.mode == BT_LEAD_CHANNEL ? "channel" : "managed", input->lead.width, input->lead.length,
           input->lead.width * input->lead.length);
    if (input->lead.mode == BT_LEAD_MANAGED) printf(", pieces of at most %.4g m", input->lead.floe_size);
    printf("\n");
    if (bt_case_reads_field(input)) bt_lead_stats_print(lead);
}

static void print_environment(const bt_case *input)
{
    static const char *const names[] = {"wind", "current"};
    for (int water = 1; water >= 0; water--) {
        double v[2];
        bt_environment_at(input, water, 0, v);
        const double most = bt_case_fastest_flow(input, water);
        const bt_table *table = water ? &input->water.table : &input->air.table;
        if (most == 0) continue;
        printf("%-20s (%.4g, %.4g) m/s at the start", names[water], v[0], v[1]);
        if (table->n > 0)
            printf(", table of %" PRId64 " rows to %g s, at most %.4g m/s", table->n, table->row[3 * (table->n - 1)],
                   most);
        else if (water && input->water.tide.major > 0)
            printf(", tide of %.4g m/s in %.4g h", input->water.tide.major, input->water.tide.period / 3600);
        printf("\n");
    }
}

/// What ice and a free body begin with, where water, wind or slope move them.
static void print_drift(const bt_case *input, const bt_check_ice *ice)
{
    double v[2][2];
    bt_setup_drift(input, ice->size, ice->thickness, ice->concentration, v[0], v[1]);
    static const char *const names[] = {"free drift, mean floe", "free drift, body"};
    for (int k = ice->count < 1; k < 2; k++)
        if (bt_hypot(v[k][0], v[k][1]) > 0) printf("%-20s (%.4g, %.4g) m/s at the start\n", names[k], v[k][0], v[k][1]);
}

static void print_step(const bt_case *input, const bt_check_ice *ice)
{
    double speed = bt_case_reference_speed(input), dt = input->run.dt;
    printf("steps                %" PRId64 " of %g s = %g s\n", bt_case_steps(input), dt, input->run.duration);
    printf("reference speed      %.4g m/s, contact law solved to %.3g m/s\n", speed, speed * input->solver.tolerance);
    const bt_check_step step = bt_check_step_of(input, ice);
    printf("time step, contact   %g s, at most %g s, the duration of a collision %s: %s\n", dt, step.longest,
           input->domain.frame == BT_FRAME_BASIN ? "in a basin" : "at full scale", bt_check_verdict(step.contact));
    if (ice->count < 1) return;
    printf("time step, floes     moves %.3g %s a step, at most 0.1 (%.3g s to pass one): %s\n", step.passed,
           step.pieces ? "pieces of the lead" : "floe sizes", step.size / step.speed, bt_check_verdict(step.floes));
    if (input->ice.splitting.toughness > 0)
        printf("time step, splits    moves %.3g of the least width of a piece a step; from some 0.2 on (assumed) "
               "pieces may overlap\n", dt * step.speed / input->ice.splitting.least_size);
}

static const char *bytes(double b, char out[32])
{
    snprintf(out, 32,
             b < 999.5e6   ? "%.3g MB"
             : b < 999.5e9 ? "%.3g GB"
                           : "%.3g TB",
             b < 999.5e6   ? b / 1e6
             : b < 999.5e9 ? b / 1e9
                           : b / 1e12);
    return out;
}

/// ice: the ice of the run, with its lead.
static void print_cost(const bt_case *input, const bt_comm *comm, const bt_check_ice *ice)
{
    const double per_step = bt_cost_floe_step(input, ice->concentration), seconds = bt_check_seconds(input, ice);
    const bt_cost_disk disk = bt_cost_disk_of(input, ice->count, ice->corners, comm->size),
                       several = bt_cost_disk_of(input, ice->count, ice->corners, 2);
    char a[32], b[32], e[32];
    const double memory = bt_cost_memory(input, ice->count, ice->parts, comm->size, comm->ranks_here);
    printf("memory               about %s\n", bytes(memory, a));
    printf("frames               %.0f\n", bt_cost_frames(input));
    printf("disk                 about %s, up to %s while it runs", bytes(bt_cost_left(&disk), a), bytes(disk.most, b));
    if (comm->size == 1) printf("; %s from several ranks, which do not compress", bytes(bt_cost_left(&several), e));
    printf("\nwall time            rough estimate %.2g s on one core (%.2g us a floe and step at this concentration",
           seconds, 1e6 * per_step);
    const double making = bt_cost_making(input, ice->made);
    if (making > 0) printf("; the making of ice %.2g s of it", making);
    printf("%s)\n", input->ice.splitting.toughness > 0 ? "; without the time that splits and their pieces take" : "");
}

static const char *warned(size_t n, char out[64])
{
    out[0] = '\0';
    if (n) snprintf(out, 64, ", with %zu warning%s", n, bt_plural((int64_t)n));
    return out;
}

static void print_warnings(const char *path, const bt_errors *err)
{
    char text[64];
    for (size_t i = 0; i < err->n; i++) printf("warning              %s\n", err->text[i]);
    if (err->n) printf("%s: valid%s\n", path, warned(err->n, text));
}

static void print_width(const bt_case *input, const bt_check_ice *ice)
{
    const bt_arch arch = bt_arch_of(input, ice->concentration, ice->count < 1 ? 0 : ice->size);
    printf("%-20s ", strcmp(arch.key, "domain.width") ? "domain length" : "domain width");
    if (isfinite(arch.bodies)) printf("%.3g body widths, ", arch.bodies);
    if (isfinite(arch.floes)) printf("%.3g floe sizes, ", arch.floes);
    printf("%s: arches of %s %s", arch.sides, bt_arch_floes(&arch), arch.possible ? "POSSIBLE" : "not expected");
    printf("%s\n", arch.unbounded ? ", load without an upper bound" : "");
}

static void print_packing(const bt_case *input, const bt_check_ice *ice)
{
    const bt_packing packing = bt_packing_of(input, ice->concentration);
    if (packing.time == 0)
        printf("wall ahead           the ice is packed (%g) up to it from the start\n", packing.packed);
    else if (isfinite(packing.time))
        printf("wall ahead           reached by packed ice (%g) at about %.3g s, after %.3g m of tow (estimate)\n",
               packing.packed, packing.time, packing.way);
}

static void print_text(const char *path, const bt_case *input, const bt_field *field, const bt_comm *comm,
                       const bt_check_ice *ice, const bt_check_ice *run, const bt_lead_stats *lead,
                       const bt_errors *warnings)
{
    char text[64];
    printf("%s: valid%s\n", path, warned(warnings->n, text));
    if (input->run.title) printf("title                %s\n", input->run.title);
    printf("domain               %g x %g m\n", input->domain.length, input->domain.width);
    print_ice(input, field, ice);
    print_laws(input, ice);
    print_outlines(&field->outlines);
    print_body(input);
    print_width(input, ice);
    print_packing(input, ice);
    print_window(input, ice);
    print_environment(input);
    print_drift(input, run);
    print_lead(input, lead);
    bt_check_print_defaults(input);
    print_step(input, ice);
    print_cost(input, comm, run);
    print_warnings(path, warnings);
}

static bt_status print_numbers(const options *opt, const bt_case *input, bt_field *field, bt_errors *err)
{
    const bt_comm *comm = bt_comm_world();
    bt_check_ice ice, run;
    bt_lead_stats lead = {0};
    const bt_status status = bt_check_ready(input, comm, field, &ice, &run, &lead, err);
    if (status != BT_OK) return status;
    bt_errors warnings = {0};
    bt_check_warn(input, field, &ice, &warnings);
    if (opt->json) bt_check_print_json(opt->file.path, input, comm, &ice, &run, &warnings);
    else print_text(opt->file.path, input, field, comm, &ice, &run, &lead, &warnings);
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
                       ? "%s: is a study, and --json is for a case; check its base case, with --set for what varies"
                       : "%s: is a study, and --scale is for a case; scale its base case, and give that as `base`",
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
