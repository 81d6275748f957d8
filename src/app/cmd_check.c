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
    options *o = state->input;
    switch (key) {
    case ARGP_KEY_INIT: state->child_inputs[0] = &o->file; return 0;
    case 'l': o->scale = parse_scale(state, arg); return 0;
    case 'j': o->json = true; return 0;
    case ARGP_KEY_END:
        if (o->json && o->scale > 0) argp_error(state, "--json and --scale: the twin is a case file; give one of them");
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

static void print_ice(const bt_case *c, const bt_field *f, const bt_check_ice *n)
{
    if (c->ice.field) printf("ice area             %.6g m2, of the field file\n", f->ice_area);
    else
        printf("ice region           %g x %g m\n", c->ice.x_max - c->ice.x_min, c->ice.y_max - c->ice.y_min);
    printf("concentration        %.4g\n", n->concentration);
    const bool read = bt_case_reads_field(c);
    printf("floes                %s%.0f%s\n", read ? "" : "about ", n->count,
           c->ice.field ? " (read from the field file)"
           : read       ? " (read from the outlines)"
                        : "");
    if (n->count < 1) return;
    printf("mean floe            size %.4g m, thickness %.4g m, mass about %.4g kg\n", n->size, n->thickness,
           c->ice.density * n->thickness * BT_PI / 4 * n->size * n->size);
}

/// 0 for what rounding has left of it, m.
static double whole(double x) { return fabs(x) < 1e-9 ? 0 : x; }

static void print_line(const bt_case *c)
{
    const bool thrust = c->tow.mode == BT_TOW_THRUST;
    const bt_rope rope = bt_rope_named(c->tow.line.type, c->tow.line.diameter);
    printf("line                 %s, %d x %.4g m, EA %.4g N, damping %.4g N s/m, breaking load %s%.4g N%s\n",
           rope.name, (int)c->tow.line.branches, c->tow.line_length, c->tow.line_stiffness, c->tow.line_damping,
           c->tow.line.breaking_load > 0 ? "" : "none: ", c->tow.line.breaking_load,
           c->tow.line.breaking_load > 0 ? "" : " = never breaks");
    if (c->tow.line.branches > 1)
        printf("line, second branch  %.4g m, EA %.4g N, breaking load %s%.4g N%s\n", c->tow.branch2.length,
               c->tow.branch2.stiffness, c->tow.branch2.breaking_load > 0 ? "" : "none: ",
               c->tow.branch2.breaking_load, c->tow.branch2.breaking_load > 0 ? "" : " = never breaks");
    printf("line, fastened       at (%.4g, %.4g) m", whole(c->tow.hull_x), whole(c->tow.hull_y));
    if (c->tow.line.branches > 1)
        printf(" and (%.4g, %.4g) m", whole(c->tow.branch2.hull_x), whole(c->tow.branch2.hull_y));
    printf(" from the centroid of the waterline, along the body's own x and y\n");
    if (c->tow.line.type != BT_ROPE_NUMBERS)
        printf("line, named          diameter %.4g mm, %.4g kg/m, new EA %.4g N and breaking load %.4g N (%s)%s\n",
               1e3 * c->tow.line.diameter, rope.mass, rope.stiffness, rope.breaking, rope.source,
               c->tow.line.weight > 0 ? "" : "; weight and sag are not simulated");
    if (c->tow.line.weight > 0)
        printf("line, weight         %.4g N/m in water, an elastic catenary; it starts with a pull of %.4g N\n",
               c->tow.line.weight, BT_START_PULL * c->tow.line.weight * c->tow.line_length);
    printf("line, start          period of the body on the line %.3g s, ramp %.4g s, at least %g periods: %s\n",
           bt_case_line_period(c), bt_case_steepest_ramp(c), BT_RAMP_PERIODS,
           bt_case_start_is_slow(c) ? "ok" : "TOO SHORT: the start jerks the line");
    if (!thrust) return;
    // of a current that changes the mean over the run
    double current[2];
    bt_environment_mean(c, true, current);
    const double through = c->tow.speed - current[0] * bt_cos(c->tow.direction) - current[1] * bt_sin(c->tow.direction),
                 r = bt_min(bt_max(through, 0) / c->tow.vessel.free_speed, 1);
    printf("vessel               bollard pull %.4g N, free-running %.4g m/s; net pull left for the line at %.4g m/s "
           "through the water: %.4g N\n",
           c->tow.vessel.bollard_pull, c->tow.vessel.free_speed, through, c->tow.vessel.bollard_pull * (1 - r * r));
}

static void print_outlines(const bt_outline_counts *o)
{
    if (o->read)
        printf("outlines             %" PRId64 " read, %" PRId64 " turned round, %" PRId64
               " double or collinear vertices dropped\n",
               o->read, o->turned, o->dropped);
    if (o->read) printf("coordinates          %s\n", o->crs);
    if (o->read && isfinite(o->east))
        printf("origin               %.10g m east, %.10g m north at x = y = 0\n", o->east, o->north);
    if (o->rounded)
        printf("not convex           %" PRId64 " floes by rounding alone: %" PRId64
               " corners left out, which adds %.3g m2\n",
               o->rounded, o->rounded_corners, o->rounded_area);
    if (o->read && isfinite(o->lon))
        printf("origin               %.6f deg E, %.6f deg N at x = y = 0\n", o->lon * 180 / BT_PI,
               o->lat * 180 / BT_PI);
    if (o->hulled)
        printf("not convex           %" PRId64 " floes replaced by their hulls, which adds %.4g m2\n", o->hulled,
               o->hull_area);
    if (o->split) printf("not convex           %" PRId64 " floes in %" PRId64 " convex parts\n", o->split, o->parts);
}

static void print_body(const bt_case *c)
{
    double v[2 * BT_MAX_VERTICES];
    int n = bt_case_waterline(c, v);
    if (!n) {
        printf("body                 none\n");
        return;
    }
    bt_moments m = bt_shape_moments(n, v);
    double ahead = c->tow.direction - c->body.yaw, across = bt_shape_width(n, v, bt_cos(ahead), bt_sin(ahead)),
           along = bt_shape_width(n, v, -bt_sin(ahead), bt_cos(ahead));
    double mass = bt_case_body_mass(c), displaced = c->water.density * m.area * c->body.draft;
    printf("body                 %.4g m along the tow, %.4g m across, waterline %.4g m2, draft %.4g m, sail %.4g m\n",
           along, across, m.area, c->body.draft, c->body.sail);
    printf("body mass            %.4g kg, %.4g kg with added mass; displaced water %.4g kg (ratio %.3f)\n", mass,
           mass * (1 + c->body.added_mass), displaced, mass / displaced);
    double speed = c->tow.speed;
    if (c->tow.mode == BT_TOW_NONE) {
        printf("tow                  none, free drift\n");
        return;
    }
    static const char *const modes[] = {
        [BT_TOW_NONE] = "none", [BT_TOW_SPEED] = "speed", [BT_TOW_LINE] = "line", [BT_TOW_THRUST] = "thrust"};
    printf("tow                  %s, %.4g m/s, %.4g m in all, Froude number %.3g\n", modes[c->tow.mode], speed,
           bt_case_tow_distance(c, c->run.duration), speed / sqrt(BT_GRAVITY * along));
    if (c->tow.mode == BT_TOW_LINE || c->tow.mode == BT_TOW_THRUST) print_line(c);
}

/// What the contact laws of the case mean for the mean floe.
static void print_laws(const bt_case *c, const bt_check_ice *n)
{
    for (int law = 0; n->count >= 1 && law < BT_LAWS; law++) {
        char *line = bt_laws[law]->check ? bt_laws[law]->check(c, n->thickness, n->size) : NULL;
        if (line) fputs(line, stdout);
        free(line);
    }
    if (n->count < 1 || !(c->ice.splitting.toughness > 0)) return;
    const bt_check_split s = bt_check_split_of(c, n);
    printf("splitting            a mean floe, as a square, splits under %.4g N at three points, and %.4g N on each "
           "side of a wedge; pieces at least %.3g m wide (toughness and strength are not calibrated)\n",
           s.three_point, s.opening, c->ice.splitting.least_size);
}

static void print_window(const bt_case *c, const bt_check_ice *n)
{
    if (c->domain.ends != BT_BOUND_MOVING) return;
    bt_track t = n->count < 1 ? (bt_track){0} : bt_setup_track(c, n->size, n->thickness, n->concentration);
    printf("moving window        the body keeps %.4g m from its front and %.4g m from its rear; the tow is %.3g "
           "windows of ice long\n",
           c->domain.ahead, c->domain.length - c->domain.ahead, bt_track_laps(c, &t));
    bt_setup_track_free(&t);
}

/// With a field that was read as it will be; of a field that is still to be made, the strip.
static void print_lead(const bt_case *c, const bt_lead_stats *lead)
{
    if (c->lead.mode == BT_LEAD_NONE) return;
    printf("lead                 %s, %.4g m wide, %.4g m long, %.4g m2 of strip",
           c->lead.mode == BT_LEAD_CHANNEL ? "channel" : "managed", c->lead.width, c->lead.length,
           c->lead.width * c->lead.length);
    if (c->lead.mode == BT_LEAD_MANAGED) printf(", pieces of at most %.4g m", c->lead.floe_size);
    printf("\n");
    if (bt_case_reads_field(c)) bt_lead_stats_print(lead);
}

static void print_environment(const bt_case *c)
{
    static const char *const names[] = {"wind", "current"};
    for (int water = 1; water >= 0; water--) {
        double v[2];
        bt_environment_at(c, water, 0, v);
        const double most = bt_case_fastest_flow(c, water);
        const bt_table *t = water ? &c->water.table : &c->air.table;
        if (most == 0) continue;
        printf("%-20s (%.4g, %.4g) m/s at the start", names[water], v[0], v[1]);
        if (t->n > 0)
            printf(", table of %" PRId64 " rows to %g s, at most %.4g m/s", t->n, t->row[3 * (t->n - 1)], most);
        else if (water && c->water.tide.major > 0)
            printf(", tide of %.4g m/s in %.4g h", c->water.tide.major, c->water.tide.period / 3600);
        printf("\n");
    }
}

/// What ice and a free body begin with, where water, wind or slope move them.
static void print_drift(const bt_case *c, const bt_check_ice *n)
{
    double v[2][2];
    bt_setup_drift(c, n->size, n->thickness, n->concentration, v[0], v[1]);
    static const char *const names[] = {"free drift, mean floe", "free drift, body"};
    for (int k = n->count < 1; k < 2; k++)
        if (bt_hypot(v[k][0], v[k][1]) > 0) printf("%-20s (%.4g, %.4g) m/s at the start\n", names[k], v[k][0], v[k][1]);
}

static void print_step(const bt_case *c, const bt_check_ice *n)
{
    double speed = bt_case_reference_speed(c), dt = c->run.dt;
    printf("steps                %" PRId64 " of %g s = %g s\n", bt_case_steps(c), dt, c->run.duration);
    printf("reference speed      %.4g m/s, contact law solved to %.3g m/s\n", speed, speed * c->solver.tolerance);
    const bt_check_step s = bt_check_step_of(c, n);
    printf("time step, contact   %g s, at most %g s, the duration of a collision %s: %s\n", dt, s.longest,
           c->domain.frame == BT_FRAME_BASIN ? "in a basin" : "at full scale", bt_check_verdict(s.contact));
    if (n->count < 1) return;
    printf("time step, floes     moves %.3g %s a step, at most 0.1 (%.3g s to pass one): %s\n", s.passed,
           s.pieces ? "pieces of the lead" : "floe sizes", s.size / s.speed, bt_check_verdict(s.floes));
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

/// n: the ice of the run, with its lead.
static void print_cost(const bt_case *c, const bt_comm *comm, const bt_check_ice *n)
{
    const double per_step = bt_cost_floe_step(c, n->concentration), seconds = bt_check_seconds(c, n);
    const bt_cost_disk d = bt_cost_disk_of(c, n->count, n->corners, comm->size),
                       several = bt_cost_disk_of(c, n->count, n->corners, 2);
    char a[32], b[32], e[32];
    const double memory = bt_cost_memory(c, n->count, n->parts, comm->size, comm->ranks_here);
    printf("memory               about %s\n", bytes(memory, a));
    printf("frames               %.0f\n", bt_cost_frames(c));
    printf("disk                 about %s, up to %s while it runs", bytes(bt_cost_left(&d), a), bytes(d.most, b));
    if (comm->size == 1) printf("; %s from several ranks, which do not compress", bytes(bt_cost_left(&several), e));
    printf("\nwall time            rough estimate %.2g s on one core (%.2g us a floe and step at this concentration",
           seconds, 1e6 * per_step);
    const double making = bt_cost_making(c, n->made);
    if (making > 0) printf("; the making of ice %.2g s of it", making);
    printf(")\n");
}

static const char *warned(size_t n, char out[64])
{
    out[0] = '\0';
    if (n) snprintf(out, 64, ", with %zu warning%s", n, n > 1 ? "s" : "");
    return out;
}

static void print_warnings(const char *path, const bt_errors *w)
{
    char text[64];
    for (size_t i = 0; i < w->n; i++) printf("warning              %s\n", w->text[i]);
    if (w->n) printf("%s: valid%s\n", path, warned(w->n, text));
}

static void print_width(const bt_case *c, const bt_check_ice *n)
{
    const bt_arch a = bt_arch_of(c, n->concentration, n->count < 1 ? 0 : n->size);
    printf("%-20s ", strcmp(a.key, "domain.width") ? "domain length" : "domain width");
    if (isfinite(a.bodies)) printf("%.3g body widths, ", a.bodies);
    if (isfinite(a.floes)) printf("%.3g floe sizes, ", a.floes);
    printf("%s: arches of %s %s", a.sides, bt_arch_floes(&a), a.possible ? "POSSIBLE" : "not expected");
    printf("%s\n", a.unbounded ? ", load without an upper bound" : "");
}

static void print_packing(const bt_case *c, const bt_check_ice *n)
{
    const bt_packing p = bt_packing_of(c, n->concentration);
    if (p.time == 0) printf("wall ahead           the ice is packed (%g) up to it from the start\n", p.packed);
    else if (isfinite(p.time))
        printf("wall ahead           reached by packed ice (%g) at about %.3g s, after %.3g m of tow (estimate)\n",
               p.packed, p.time, p.way);
}

static void print_text(const char *path, const bt_case *c, const bt_field *f, const bt_comm *comm,
                       const bt_check_ice *n, const bt_check_ice *run, const bt_lead_stats *lead,
                       const bt_errors *warnings)
{
    char text[64];
    printf("%s: valid%s\n", path, warned(warnings->n, text));
    if (c->run.title) printf("title                %s\n", c->run.title);
    printf("domain               %g x %g m\n", c->domain.length, c->domain.width);
    print_ice(c, f, n);
    print_laws(c, n);
    print_outlines(&f->outlines);
    print_body(c);
    print_width(c, n);
    print_packing(c, n);
    print_window(c, n);
    print_environment(c);
    print_drift(c, run);
    print_lead(c, lead);
    bt_check_print_defaults(c);
    print_step(c, n);
    print_cost(c, comm, run);
    print_warnings(path, warnings);
}

static bt_status print_numbers(const options *o, const bt_case *c, bt_field *f, bt_errors *err)
{
    const bt_comm *comm = bt_comm_world();
    bt_check_ice n, run;
    bt_lead_stats lead = {0};
    const bt_status status = bt_check_ready(c, comm, f, &n, &run, &lead, err);
    if (status != BT_OK) return status;
    bt_errors warnings = {0};
    bt_check_warn(c, f, &n, &warnings);
    if (o->json) bt_check_print_json(o->file.path, c, comm, &n, &run, &warnings);
    else print_text(o->file.path, c, f, comm, &n, &run, &lead, &warnings);
    bt_errors_free(&warnings);
    return BT_OK;
}

static bt_status print_twin(bt_case *c, double ratio, bt_errors *err)
{
    const bt_status status = bt_case_scale(c, ratio, err);
    if (status != BT_OK) return status;
    char *text = bt_case_scaled_text(c, ratio);
    if (text) fputs(text, stdout);
    free(text);
    return BT_OK;
}

static bt_status check_study(const options *o, bt_errors *err)
{
    if (!(o->scale > 0) && !o->json) return bt_check_study(&o->file, bt_comm_world()->size, err);
    if (o->json)
        bt_errors_add(err, "%s: is a study, and --json is for a case; check its base case, with --set for what varies",
                      o->file.path);
    else
        bt_errors_add(err, "%s: is a study, and --scale is for a case; scale its base case, and give that as `base`",
                      o->file.path);
    return BT_ERR_USAGE;
}

int bt_cmd_check(int argc, char **argv)
{
    options o = {0};
    bt_cmd_parse(&check_argp, argc, argv, &o);
    bt_case c;
    bt_field f;
    bt_errors err = {0};
    if (bt_case_kind_of(o.file.path) == BT_FILE_STUDY) {
        const bt_status status = check_study(&o, &err);
        free(o.file.set);
        return bt_cmd_end(&bt_comm_alone, status, &err);
    }
    bt_field_init(&f);
    bt_status status = bt_case_read(&c, o.file.path, o.file.set, o.file.n_set, &err);
    if (status == BT_OK && o.scale > 0) status = print_twin(&c, o.scale, &err);
    else if (status == BT_OK) status = print_numbers(&o, &c, &f, &err);
    bt_field_free(&f);
    bt_case_free(&c);
    free(o.file.set);
    return bt_cmd_end(&bt_comm_alone, status, &err);
}
