// SPDX-License-Identifier: MIT
// The numbers of `bergtow check`: one row each, printed in lines or written as JSON.
//
// A row is a call of number(), flag() or word(): the key in the JSON object of its group, the label of the line that
// it begins (NULL: it continues the line), how it is printed, and the value. To add a number, add its row.
#include <inttypes.h>
#include <string.h>

#include "app/cmd_check.h"
#include "base/elementary.h"
#include "base/json.h"
#include "base/units.h"
#include "bergtow/shape.h"
#include "case/arch.h"
#include "case/case_derived.h"
#include "case/case_tow.h"
#include "case/case_check.h"
#include "case/cost.h"
#include "case/rope.h"
#include "case/schema.h"
#include "case/warning.h"
#include "contact/law.h"
#include "estimate/packing.h"
#include "force/environment.h"
#include "run/setup.h"

// --- rows ------------------------------------------------------------------------------------------------------------

enum { LABEL = 21, MOST = 118 }; // columns of the label and of a line

typedef struct {
    const char *key; ///< "group.name"
    char kind;       ///< 'n', 'f' or 'w'
    double number;
    const char *word;
} row;

/// Where rows go: to stdout, or into a list, since the rows of a group need not follow each other.
typedef struct {
    bool json, begun; ///< begun: the current line is not ended yet
    row *row;
    size_t n;
} sink;

static void end_line(sink *to)
{
    if (to->begun) printf("\n");
    to->begun = false;
}

/// Add a row to the list for JSON, or print its label; true if its value is to be printed.
static bool prints(sink *to, const row *of, const char *label)
{
    if (to->json && of->key) {
        to->row = bt_realloc(to->row, to->n + 1, sizeof *to->row);
        to->row[to->n++] = *of;
    }
    if (to->json || (of->kind == 'n' && isnan(of->number)) || (of->kind == 'w' && !of->word)) return false;
    if (label) {
        end_line(to);
        printf("%-*s", LABEL, label);
    }
    return to->begun = true;
}

/// value: NaN = does not apply: null, not printed. format: NULL = only in JSON.
static void number(sink *to, const char *key, const char *label, const char *format, double value)
{
    if (!format && !to->json) return;
    if (prints(to, &(row){.key = key, .kind = 'n', .number = value}, label)) printf(format, value);
}

/// A number of bytes; format with %s.
static void bytes(sink *to, const char *key, const char *label, const char *format, double value)
{
    char text[32];
    const bool mega = value < 999.5e6, giga = value < 999.5e9;
    snprintf(text, sizeof text, "%.3g %s", value / (mega ? 1e6 : giga ? 1e9 : 1e12), mega ? "MB" : giga ? "GB" : "TB");
    if (prints(to, &(row){.key = key, .kind = 'n', .number = value}, label)) printf(format, text);
}

static void flag(sink *to, const char *key, bool value, const char *yes, const char *no)
{
    if (prints(to, &(row){.key = key, .kind = 'f', .number = value}, NULL)) fputs(value ? yes : no, stdout);
}

/// value: NULL = as NaN. key: NULL = only printed.
static void word(sink *to, const char *key, const char *label, const char *value)
{
    if (prints(to, &(row){.key = key, .kind = 'w', .word = value}, label)) fputs(value, stdout);
}

static size_t group_of(const char *key) { return strcspn(key, "."); }

/// Write each group as an object, in the place of its first row.
static void write_rows(bt_json *json, const sink *from)
{
    for (size_t i = 0; i < from->n; i++) {
        const char *key = from->row[i].key;
        const size_t group = group_of(key);
        bool first = true;
        for (size_t k = 0; k < i; k++) first = first && strncmp(from->row[k].key, key, group + 1) != 0;
        if (!first) continue;
        char name[32];
        snprintf(name, sizeof name, "%.*s", (int)group, key);
        bt_json_open(json, name, '{');
        for (size_t k = i; k < from->n; k++) {
            const row *of = &from->row[k];
            if (strncmp(of->key, key, group + 1)) continue;
            if (of->kind == 'n') bt_json_number(json, of->key + group + 1, of->number);
            else if (of->kind == 'f') bt_json_bool(json, of->key + group + 1, of->number != 0);
            else bt_json_string(json, of->key + group + 1, of->word);
        }
        bt_json_close(json, '}');
    }
}

// --- the numbers -----------------------------------------------------------------------------------------------------

/// x if it applies, otherwise NaN.
static double where(bool applies, double x) { return applies ? x : NAN; }

static void domain(sink *to, const bt_checked *c)
{
    number(to, "domain.length_m", "domain", "%g", c->input->domain.length);
    number(to, "domain.width_m", NULL, " x %g m", c->input->domain.width);
}

static void ice(sink *to, const bt_checked *c)
{
    const bt_case *input = c->input;
    const bt_check_ice *ice = c->ice;
    const bool any = ice->count >= 1, splits = any && input->ice.splitting.toughness > 0,
               box = !input->ice.field;
    number(to, "ice.area_m2", "ice area", "%.6g m2, of the field file", where(!box, c->field->ice_area));
    number(to, "ice.region_x_m", "ice region", "%g", where(box, input->ice.x_max - input->ice.x_min));
    number(to, "ice.region_y_m", NULL, " x %g m", where(box, input->ice.y_max - input->ice.y_min));
    number(to, "ice.concentration", "concentration", "%.4g", ice->concentration);
    number(to, "ice.floes", "floes", bt_case_reads_field(input) ? "%.0f" : "about %.0f", round(ice->count));
    if (bt_case_reads_field(input))
        word(to, NULL, NULL, box ? " (read from the outlines)" : " (read from the field file)");
    number(to, "ice.mean_size_m", "mean floe", "size %.4g m", where(any, ice->size));
    number(to, "ice.mean_thickness_m", NULL, ", thickness %.4g m", where(any, ice->thickness));
    number(to, "ice.mean_mass_kg", NULL, ", mass about %.4g kg", where(any, input->ice.density * ice->volume));
    for (int law = 0; !to->json && any && law < BT_LAWS; law++) {
        char *line = bt_laws[law]->check ? bt_laws[law]->check(input, ice->thickness, ice->size) : NULL;
        end_line(to);
        if (line) fputs(line, stdout);
        free(line);
    }
    const bt_check_split split = splits ? bt_check_split_of(input, ice) : (bt_check_split){NAN, NAN};
    number(to, "ice.split_three_point_n", "splitting",
           "a mean floe, as a square, splits under %.4g N at three points", split.three_point);
    number(to, "ice.split_opening_n", NULL, ", and %.4g N on each side of a wedge", split.opening);
    number(to, "ice.split_least_size_m", NULL,
           "; pieces at least %.3g m wide (toughness and strength are not calibrated)",
           where(splits, input->ice.splitting.least_size));
}

static void print_outlines(sink *to, const bt_outline_counts *counts)
{
    if (to->json) return;
    end_line(to);
    if (counts->read)
        printf("outlines             %" PRId64 " read, %" PRId64 " turned round, %" PRId64
               " double or collinear vertices dropped\n",
               counts->read, counts->turned, counts->dropped);
    if (counts->bare && counts->bare < counts->read)
        printf("without a thickness  %" PRId64 " of them, which have that of the case\n", counts->bare);
    if (*counts->crs) printf("coordinates          %s\n", counts->crs);
    if (*counts->crs && isfinite(counts->east))
        printf("origin               %.10g m east, %.10g m north at x = y = 0\n", counts->east, counts->north);
    if (counts->rounded)
        printf("not convex           %" PRId64 " floes by rounding alone: %" PRId64
               " corners left out, which adds %.3g m2\n",
               counts->rounded, counts->rounded_corners, counts->rounded_area);
    if (*counts->crs && isfinite(counts->lon))
        printf("origin               %.6f deg E, %.6f deg N at x = y = 0\n", counts->lon * 180 / BT_PI,
               counts->lat * 180 / BT_PI);
    if (counts->hulled)
        printf("not convex           %" PRId64 " floes replaced by their hulls, which adds %.4g m2\n", counts->hulled,
               counts->hull_area);
    if (counts->split)
        printf("not convex           %" PRId64 " floes in %" PRId64 " convex parts\n", counts->split, counts->parts);
}

/// x, or 0 if it is only rounding, m.
static double zero_if_tiny(double x) { return fabs(x) < 1e-9 ? 0 : x; }

/// Print the tow line of the case.
static void print_line(sink *to, const bt_case *input)
{
    if (to->json) return;
    end_line(to);
    const bt_rope rope = bt_rope_named(input->tow.line.type, input->tow.line.diameter);
    printf("line                 %s, %d x %.4g m, EA %.4g N, damping %.4g N s/m, breaking load %s%.4g N%s\n",
           rope.name, (int)input->tow.line.branches, input->tow.line_length, input->tow.line_stiffness,
           input->tow.line_damping, input->tow.line.breaking_load > 0 ? "" : "none: ", input->tow.line.breaking_load,
           input->tow.line.breaking_load > 0 ? "" : " = never breaks");
    if (input->tow.line.branches > 1)
        printf("line, second branch  %.4g m, EA %.4g N, breaking load %s%.4g N%s\n", input->tow.branch2.length,
               input->tow.branch2.stiffness, input->tow.branch2.breaking_load > 0 ? "" : "none: ",
               input->tow.branch2.breaking_load, input->tow.branch2.breaking_load > 0 ? "" : " = never breaks");
    printf("line, fastened       at (%.4g, %.4g) m", zero_if_tiny(input->tow.hull_x), zero_if_tiny(input->tow.hull_y));
    if (input->tow.line.branches > 1)
        printf(" and (%.4g, %.4g) m", zero_if_tiny(input->tow.branch2.hull_x), zero_if_tiny(input->tow.branch2.hull_y));
    printf(" from the centroid of the waterline, along the body's own x and y\n");
    if (input->tow.line.type != BT_ROPE_NUMBERS)
        printf("line, named          diameter %.4g mm, %.4g kg/m, new EA %.4g N and breaking load %.4g N (%s)%s\n",
               1e3 * input->tow.line.diameter, rope.mass, rope.stiffness, rope.breaking, rope.source,
               input->tow.line.weight > 0 ? "" : "; weight and sag are not simulated");
}

static void tow_line(sink *to, const bt_case *input)
{
    print_line(to, input);
    number(to, "line.weight_n_m", "line, weight", "%.4g N/m in water, an elastic catenary",
           where(input->tow.line.weight > 0, input->tow.line.weight));
    number(to, "line.start_pull_n", NULL, "; it starts with a pull of %.4g N",
           where(input->tow.line.weight > 0, BT_START_PULL * input->tow.line.weight * input->tow.line_length));
    number(to, "line.period_s", "line, start", "period of the body on the line %.3g s", bt_case_line_period(input));
    number(to, "line.ramp_s", NULL, ", ramp %.4g s", bt_case_steepest_ramp(input));
    number(to, "line.ramp_periods_needed", NULL, ", at least %g periods", BT_RAMP_PERIODS);
    flag(to, "line.starts_slowly", bt_case_start_is_slow(input), ": ok", ": TOO SHORT: the start jerks the line");
    if (input->tow.mode != BT_TOW_THRUST) return;
    double current[2]; // if it changes, its mean over the run
    bt_environment_mean(input, current);
    const double through = input->tow.speed - current[0] * bt_cos(input->tow.direction) -
                           current[1] * bt_sin(input->tow.direction),
                 r = bt_min(bt_max(through, 0) / input->tow.vessel.free_speed, 1);
    number(to, "vessel.bollard_pull_n", "vessel", "bollard pull %.4g N", input->tow.vessel.bollard_pull);
    number(to, "vessel.free_speed_m_s", NULL, ", free-running %.4g m/s", input->tow.vessel.free_speed);
    number(to, "vessel.speed_through_water_m_s", NULL, "; net pull left for the line at %.4g m/s through the water",
           through);
    number(to, "vessel.net_pull_n", NULL, ": %.4g N", input->tow.vessel.bollard_pull * (1 - r * r));
}

static void body(sink *to, const bt_checked *c)
{
    const bt_case *input = c->input;
    double v[2 * BT_MAX_VERTICES];
    const int n = bt_case_waterline(input, v);
    const bool towed = n && input->tow.mode != BT_TOW_NONE;
    static const char *const modes[] = {
        [BT_TOW_NONE] = "none", [BT_TOW_SPEED] = "speed", [BT_TOW_LINE] = "line", [BT_TOW_THRUST] = "thrust"};
    const double distance = towed ? bt_case_tow_distance(input, input->run.duration) : 0;
    double along = 0;
    if (n) {
        const bt_moments moments = bt_shape_moments(n, v);
        const double ahead = input->tow.direction - input->body.yaw, mass = bt_case_body_mass(input),
                     displaced = input->water.density * moments.area * input->body.draft;
        along = bt_shape_width(n, v, -bt_sin(ahead), bt_cos(ahead));
        number(to, "body.length_m", "body", "%.4g m along the tow", along);
        number(to, "body.width_m", NULL, ", %.4g m across", bt_shape_width(n, v, bt_cos(ahead), bt_sin(ahead)));
        number(to, "body.waterline_m2", NULL, ", waterline %.4g m2", moments.area);
        number(to, "body.draft_m", NULL, ", draft %.4g m", input->body.draft);
        number(to, "body.sail_m", NULL, ", sail %.4g m", input->body.sail);
        number(to, "body.mass_kg", "body mass", "%.4g kg", mass);
        number(to, "body.mass_with_added_kg", NULL, ", %.4g kg with added mass", mass * (1 + input->body.added_mass));
        number(to, "body.displaced_kg", NULL, "; displaced water %.4g kg", displaced);
        number(to, "body.mass_ratio", NULL, " (ratio %.3f)", mass / displaced);
    } else word(to, NULL, "body", "none");
    if (towed) word(to, NULL, "tow", modes[input->tow.mode]);
    else if (n) word(to, NULL, "tow", "none, free drift");
    number(to, "run.tow_speed_m_s", NULL, ", %.4g m/s", where(towed, input->tow.speed));
    number(to, "run.tow_distance_m", NULL, towed ? ", %.4g m in all" : NULL, distance);
    number(to, "run.froude_number", NULL, ", Froude number %.3g",
           where(towed, input->tow.speed / sqrt(BT_GRAVITY * along)));
    if (towed && input->tow.mode != BT_TOW_SPEED) tow_line(to, input);
}

static void room(sink *to, const bt_checked *c)
{
    const bt_arch arch = bt_arch_of(c->input, c->ice->concentration, c->ice->count < 1 ? 0 : c->ice->size);
    word(to, NULL, strcmp(arch.key, "domain.width") ? "domain length" : "domain width", "");
    number(to, "domain.body_widths", NULL, isfinite(arch.bodies) ? "%.3g body widths, " : NULL, arch.bodies);
    number(to, "domain.floe_sizes", NULL, isfinite(arch.floes) ? "%.3g floe sizes, " : NULL, arch.floes);
    number(to, "domain.body_widths_needed", NULL, NULL, arch.needed);
    if (to->json) word(to, "domain.across", NULL, arch.key);
    word(to, "domain.sides", NULL, arch.sides);
    word(to, NULL, NULL, ": arches of ");
    word(to, NULL, NULL, bt_arch_floes(&arch));
    word(to, NULL, NULL, arch.possible ? " POSSIBLE" : " not expected");
    flag(to, "domain.load_unbounded", arch.unbounded, ", load without an upper bound", "");
    const bt_packing packing = bt_packing_of(c->input, c->ice->concentration);
    const bool packs = isfinite(packing.time), later = packs && packing.time > 0;
    number(to, "domain.packed_concentration", "wall ahead",
           later ? "reached by packed ice (%g)" : "the ice is packed (%g) up to it from the start",
           where(packs, packing.packed));
    number(to, "domain.packed_s", NULL, later ? " at about %.3g s" : NULL, where(packs, packing.time));
    number(to, "domain.packed_way_m", NULL, later ? ", after %.3g m of tow (estimate)" : NULL,
           where(packs, packing.way));
    if (c->input->domain.ends != BT_BOUND_MOVING) return;
    bt_track track = c->ice->count < 1 ? (bt_track){0} : bt_setup_track(c->input, c->ice->size, c->ice->thickness,
                                                                        c->ice->concentration);
    number(to, "domain.ahead_m", "moving window", "the body keeps %.4g m from its front", c->input->domain.ahead);
    number(to, "domain.behind_m", NULL, " and %.4g m from its rear", c->input->domain.length - c->input->domain.ahead);
    number(to, "domain.windows", NULL, "; the tow is %.3g windows long", bt_track_laps(c->input, &track));
    bt_setup_track_free(&track);
}

static void flow(sink *to, const bt_case *input, bool water)
{
    const double most = bt_case_fastest_flow(input, water);
    const bt_table *table = water ? &input->water.table : &input->air.table;
    double v[2];
    if (most == 0) return;
    bt_environment_at(input, water, 0, v);
    number(to, water ? "water.current_x_m_s" : "air.wind_x_m_s", water ? "current" : "wind", "(%.4g, ", v[0]);
    number(to, water ? "water.current_y_m_s" : "air.wind_y_m_s", NULL, "%.4g) m/s at the start", v[1]);
    if (table->n > 0 && !to->json) {
        printf(", table of %" PRId64 " rows to %g s", table->n, table->row[3 * (table->n - 1)]);
    } else if (water && input->water.tide.major > 0) {
        number(to, "water.tide_m_s", NULL, ", tide of %.4g m/s", input->water.tide.major);
        number(to, "water.tide_period_s", NULL, NULL, input->water.tide.period);
        if (!to->json) printf(" in %.4g h", input->water.tide.period / 3600);
    }
    number(to, water ? "water.fastest_m_s" : "air.fastest_m_s", NULL, table->n > 0 ? ", at most %.4g m/s" : NULL, most);
}

static void environment(sink *to, const bt_checked *c)
{
    flow(to, c->input, true);
    flow(to, c->input, false);
    double v[2][2]; // initial velocities of ice and a free body, if water, wind or slope move them
    bt_setup_drift(c->input, c->run->size, c->run->thickness, c->run->concentration, v[0], v[1]);
    static const char *const keys[2][2] = {{"ice.drift_x_m_s", "ice.drift_y_m_s"},
                                           {"body.drift_x_m_s", "body.drift_y_m_s"}},
                      *const labels[] = {"free drift, mean floe", "free drift, body"};
    for (int k = c->run->count < 1; k < 2; k++) {
        if (!(bt_hypot(v[k][0], v[k][1]) > 0)) continue;
        number(to, keys[k][0], labels[k], k ? "(%.4g, " : " (%.4g, ", v[k][0]);
        number(to, keys[k][1], NULL, "%.4g) m/s at the start", v[k][1]);
    }
}

/// The lead: with a field that was read, as it is cut; with a field to be generated, only the strip.
static void lead(sink *to, const bt_checked *c)
{
    const bt_case *input = c->input;
    if (input->lead.mode == BT_LEAD_NONE) return;
    const bool managed = input->lead.mode == BT_LEAD_MANAGED;
    word(to, NULL, "lead", managed ? "managed" : "channel");
    number(to, "lead.width_m", NULL, ", %.4g m wide", input->lead.width);
    number(to, "lead.length_m", NULL, ", %.4g m long", input->lead.length);
    number(to, "lead.area_m2", NULL, ", %.4g m2 of strip", input->lead.width * input->lead.length);
    number(to, "lead.largest_piece_m", NULL, ", pieces of at most %.4g m", where(managed, input->lead.floe_size));
    if (to->json || !bt_case_reads_field(input)) return;
    end_line(to);
    bt_lead_stats_print(c->lead);
}

/// Values that were not given and follow from others: {name: value in SI}, or in lines.
static void defaults(sink *to, bt_json *json, const bt_case *input)
{
    if (to->json) bt_json_open(json, "by_default", '{');
    else end_line(to);
    int column = 0;
    for (int i = 0; i < bt_n_case_keys; i++) {
        const bt_key *key = &bt_case_keys[i];
        if (key->type != BT_KEY_REAL || !key->preset || key->preset[0] != '=') continue;
        double value = bt_value_number(key, input);
        char text[160];
        if (!isfinite(value) || bt_case_why_unused(input, key->name) || bt_case_changed(input, key->name)) continue;
        if (to->json) {
            bt_json_number(json, key->name, value);
            continue;
        }
        const char *unit = bt_units_symbol(key->unit);
        if (fabs(value) < 1e-12) value = 0; // rounding
        const int n = snprintf(text, sizeof text, "%s %.4g%s%s", key->name, value, *unit ? " " : "", unit);
        const bool wraps = column > 0 && column + 2 + n > MOST;
        if (column == 0) column = printf("%-*s%s", LABEL, "by default", text);
        else if (wraps) column = printf(",\n%*s%s", LABEL, "", text) - 2;
        else column += printf(", %s", text);
    }
    if (column > 0) printf("\n");
    if (to->json) bt_json_close(json, '}');
}

static void steps(sink *to, const bt_checked *c)
{
    const bt_case *input = c->input;
    const bool any = c->ice->count >= 1;
    const double speed = bt_case_reference_speed(input), dt = input->run.dt;
    const bt_time_step step = bt_check_step(input, c->ice);
    number(to, "run.n_steps", "steps", "%.0f", (double)bt_case_steps(input));
    number(to, "run.dt_s", NULL, " of %g s", dt);
    // whole steps may take longer than the case asks
    const double whole = (double)bt_case_steps(input) * dt, duration = input->run.duration,
                 taken = whole > duration * (1 + 1e-9) ? whole : duration;
    number(to, "run.duration_s", NULL, " = %g s", taken);
    if (taken > duration) word(to, NULL, NULL, ", run.duration rounded up to whole steps");
    number(to, "run.reference_speed_m_s", "reference speed", "%.4g m/s", speed);
    number(to, "run.residual_m_s", NULL, ", contact law solved to %.3g m/s", speed * input->solver.tolerance);
    if (!to->json) number(to, NULL, "time step, contact", "%g s", dt);
    number(to, "run.dt_most_s", NULL, ", at most %g s", step.longest);
    word(to, NULL, NULL, ", the duration of a collision ");
    word(to, NULL, NULL, input->domain.frame == BT_FRAME_BASIN ? "in a basin: " : "at full scale: ");
    flag(to, "run.dt_resolves_collisions", step.contact, bt_check_verdict(true), bt_check_verdict(false));
    number(to, "run.sizes_a_step", "time step, floes", "moves %.3g", where(any, step.passed));
    if (any) word(to, NULL, NULL, step.pieces ? " pieces of the lead" : " floe sizes");
    number(to, "run.time_to_pass_s", NULL, " a step, at most 0.1 (%.3g s to pass one): ",
           where(any, step.size / step.speed));
    flag(to, "run.dt_resolves_floes", !any || step.floes, any ? bt_check_verdict(true) : "", bt_check_verdict(false));
    number(to, "run.widths_of_a_piece_a_step", "time step, splits", "moves %.3g",
           where(any && input->ice.splitting.toughness > 0, dt * speed / input->ice.splitting.least_size));
    if (any && input->ice.splitting.toughness > 0)
        word(to, NULL, NULL, " of the least width of a piece per step; above about 0.2 (assumed) pieces may overlap");
}

static void cost(sink *to, const bt_checked *c)
{
    const bt_case *input = c->input;
    const bt_check_ice *ice = c->run;
    const bt_cost_disk disk = bt_cost_disk_of(input, ice->count, ice->corners, c->comm->size),
                       several = bt_cost_disk_of(input, ice->count, ice->corners, 2);
    const double making = bt_cost_making(input, ice->made);
    bytes(to, "cost.memory_b", "memory", "about %s",
          bt_cost_memory(input, ice->count, ice->parts, c->comm->size, c->comm->ranks_here));
    number(to, "cost.frames", "frames", "%.0f", bt_cost_frames(input));
    bytes(to, "cost.disk_b", "disk", "about %s", bt_cost_left(&disk));
    bytes(to, "cost.disk_while_running_b", NULL, ", up to %s while it runs", disk.most);
    if (c->comm->size == 1)
        bytes(to, "cost.disk_of_ranks_b", NULL, "; %s from several ranks, which do not compress",
              bt_cost_left(&several));
    number(to, "cost.core_time_s", "wall time", "rough estimate %.2g s on one core", bt_check_seconds(input, ice));
    number(to, "cost.us_a_floe_and_step", NULL, " (%.2g us a floe and step at this concentration",
           1e6 * bt_cost_floe_step(input, ice->concentration));
    number(to, "cost.making_of_ice_s", NULL, making > 0 ? "; making the ice takes %.2g s of it" : NULL, making);
    if (input->ice.splitting.toughness > 0)
        word(to, NULL, NULL, "; without the time for splits and their pieces");
    word(to, NULL, NULL, ")");
}

// --- all of it -------------------------------------------------------------------------------------------------------

static void print_title(const bt_checked *c, bool title)
{
    char warned[64] = "";
    if (c->warnings->n)
        snprintf(warned, sizeof warned, ", with %zu warning%s", c->warnings->n, bt_plural((int64_t)c->warnings->n));
    printf("%s: valid%s\n", c->path, warned);
    if (title && c->input->run.title) printf("%-*s%s\n", LABEL, "title", c->input->run.title);
}

void bt_check_print(const bt_checked *c, bool as_json)
{
    sink to = {.json = as_json};
    bt_json json = {0};
    if (as_json) {
        bt_json_open(&json, NULL, '{');
        bt_json_string(&json, "case", c->path);
        bt_json_string(&json, "title", c->input->run.title);
        bt_warnings_json(&json, "warnings", c->warnings);
    } else print_title(c, true);
    domain(&to, c);
    ice(&to, c);
    print_outlines(&to, &c->field->outlines);
    body(&to, c);
    room(&to, c);
    environment(&to, c);
    lead(&to, c);
    defaults(&to, &json, c->input);
    steps(&to, c);
    cost(&to, c);
    if (as_json) {
        write_rows(&json, &to);
        bt_json_close(&json, '}');
        fputs(json.text, stdout);
    } else {
        end_line(&to);
        for (size_t i = 0; i < c->warnings->n; i++) printf("%-*s%s\n", LABEL, "warning", c->warnings->text[i]);
        if (c->warnings->n) print_title(c, false);
    }
    bt_json_free(&json);
    free(to.row);
}
