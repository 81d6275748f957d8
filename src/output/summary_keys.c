// SPDX-License-Identifier: MIT
// The table of summary.json. Scripts rely on keys, order and meaning: rows may be added, but not renamed.
#include "output/summary_keys.h"

#include <assert.h>
#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "output/estimate_text.h"
#include "output/impact_count.h"
#include "output/state.h"
#include "case/warning.h"
#include "contact/raft.h"
#include "step/splitting.h"
#include "step/window.h"

typedef bt_summary_view view;

enum { FROM_SUMMARY, FROM_HISTORY, FROM_TOTALS, FROM_CASE, FROM_WINDOW, FROM_UNDISTURBED, FROM_IMPACTS, FROM_SPLITTING,
       N_FROM };

// --- values that are not members of a struct -------------------------------------------------------------------------

static double number_or_nan(bool there, double x) { return there ? x : NAN; }

static const char *version(const view *from) { return (void)from, BT_VERSION; }
static const char *peak_conversion(const view *from) { return (void)from, "mean over a step, impulse / dt"; }
static double n_floes(const view *from) { return from->n_floes; }
static double memory_per_floe(const view *from)
{
    return number_or_nan(from->n_floes > 0, from->t->memory / (double)from->n_floes);
}
static double overlap_relative(const view *from)
{
    return number_or_nan(from->t->mean_size > 0, from->h->max_overlap / from->t->mean_size);
}

static double rafted_share(const view *from)
{
    const double area = from->h->laws[bt_law_first_total(BT_LAW_RAFTING) + BT_RAFT_TOTAL_AREA].real;
    return from->t->ice_area > 0 ? area / from->t->ice_area : 0;
}

static const bt_lead_stats *lead(const view *from) { return &from->t->lead; }
static bool has_lead(const view *from) { return lead(from)->mode != BT_LEAD_NONE; }
static bool is_channel(const view *from) { return lead(from)->mode == BT_LEAD_CHANNEL; }
static bool is_managed(const view *from) { return lead(from)->mode != BT_LEAD_CHANNEL; }
static const char *lead_mode(const view *from) { return is_channel(from) ? "channel" : "managed"; }
static double mean_piece(const view *from) { return number_or_nan(lead(from)->pieces > 0, lead(from)->mean_piece); }

static const bt_outline_counts *outlines(const view *from) { return &from->t->outlines; }
static bool has_map(const view *from) { return *outlines(from)->crs; }
static double origin_lon(const view *from) { return number_or_nan(has_map(from), outlines(from)->lon * 180 / BT_PI); }
static double origin_lat(const view *from) { return number_or_nan(has_map(from), outlines(from)->lat * 180 / BT_PI); }
static double origin_east(const view *from) { return number_or_nan(has_map(from), outlines(from)->east); }
static double origin_north(const view *from) { return number_or_nan(has_map(from), outlines(from)->north); }
static const char *crs(const view *from) { return outlines(from)->crs; }

static const char *verdict(const view *from)
{
    return from->s->body ? bt_verdict_names[from->s->window.verdict] : NULL;
}
static const char *rule(const view *from) { return !from->s->body ? NULL : from->s->window.given ? "given" : "mser5"; }
static double n_independent(const view *from) { return number_or_nan(from->s->window.n, from->s->ice.n_eff); }
static double n_stretches(const view *from)
{
    return number_or_nan(from->s->window.n && isfinite(from->s->window.stretches), from->s->window.stretches);
}
static double unconverged_share(const view *from)
{
    return number_or_nan(from->s->window.n, from->s->window.unconverged);
}
static double no_load_share(const view *from) { return number_or_nan(from->s->window.n, from->s->window.no_load); }
static double window_residual(const view *from) { return number_or_nan(from->s->window.n, from->s->window.residual); }
static double peak_tension(const view *from) { return bt_steady_peak_tension(&from->s->window, false); }
static double start_peak_tension(const view *from) { return bt_steady_peak_tension(&from->s->window, true); }
static bool has_body(const view *from) { return from->s->body; }
static bool has_reference(const view *from) { return !isnan(from->c->reference.mean_force); }

static bool has_impacts(const view *from) { return from->s->impacts; }
static bool has_largest(const view *from) { return from->s->impacts->n > 0; }
static const char *conversion(const view *from) { return from->s->impacts->conversion; }
static double collisions_per_hour(const view *from)
{
    return number_or_nan(from->s->impacts->hours > 0, (double)from->s->impacts->n / from->s->impacts->hours);
}
static double largest_floe(const view *from) { return from->s->impacts->largest.gid; }
static double largest_panel(const view *from) { return from->s->impacts->largest.panel; }

static bool has_window(const view *from) { return from->t->window; }
static double window_low(const view *from) { return bt_window_low(from->t->window, from->t->undisturbed); }
static double window_laps(const view *from) { return bt_window_laps(from->t->window); }

static bool has_splitting(const view *from) { return from->t->splitting; }
static double n_splits(const view *from) { return (double)from->t->splitting->n; }
static double size_before(const view *from) { return bt_splitting_size(from->t->splitting, true, 50); }
static double size_of_pieces(const view *from) { return bt_splitting_size(from->t->splitting, false, 50); }
static double least_piece(const view *from) { return bt_splitting_size(from->t->splitting, false, 0); }

static double n_events(const view *from) { return from->t->events ? (double)from->t->events->n : 0; }

static const char *state_hash(const view *from)
{
    static char text[17];
    snprintf(text, sizeof text, "%016" PRIx64, from->t->state_hash);
    return text;
}

// --- arrays and objects whose members are counted -------------------------------------------------------------------

static void write_quarters(bt_json *json, const char *key, const view *from, const void *reported)
{
    (void)from;
    bt_json_open(json, key, '[');
    for (int q = 0; q < 4; q++) bt_json_number(json, NULL, ((const bt_reported *)reported)->quarter[q]);
    bt_json_close(json, ']');
}

static void write_reported(bt_json *json, const char *key, const view *from, const void *source)
{
    (void)source;
    if (!from->s->body) return;
    bt_json_open(json, key, '{');
    for (int k = 0; k < BT_N_REPORTED; k++) {
        const bt_reported *reported = &from->s->window.series[k];
        // A broken branch has peaks but no mean.
        if (from->s->window.n == 0 || (!reported->present && isnan(reported->peak) && isnan(reported->start_peak)))
            continue;
        bt_json_open(json, reported->key, '{');
        bt_json_keys_write(json, bt_reported_keys, bt_n_reported_keys, from, (const void *const[]){reported});
        bt_json_close(json, '}');
    }
    bt_json_close(json, '}');
}

static void write_exceedance(bt_json *json, const char *key, const view *from, const void *source)
{
    (void)source;
    bt_impacts_exceedance(json, key, from->s->impacts);
}

static void write_estimates(bt_json *json, const char *key, const view *from, const void *source)
{
    (void)source;
    if (from->s->body) bt_estimates_json(json, key, &from->s->estimate, bt_summary_held_against(from->s));
    else bt_json_string(json, key, NULL);
}

static void write_labels(bt_json *json, const char *key, const view *from, const void *source)
{
    (void)source;
    if (from->s->body) bt_estimate_labels_json(json, key, &from->s->estimate);
    else bt_json_string(json, key, NULL);
}

static void write_added(bt_json *json, const char *key, const view *from, const void *source)
{
    (void)key, (void)source;
    for (int k = 0; k < from->s->n_added; k++) bt_json_number(json, bt_added(k)->summary, from->s->added[k]);
}

static void write_events(bt_json *json, const char *key, const view *from, const void *source)
{
    (void)source;
    const bt_events *events = from->t->events;
    bt_json_open(json, key, '[');
    for (int64_t i = 0; events && i < events->n && i < BT_EVENTS_REPORTED; i++) {
        bt_json_open(json, NULL, '{');
        bt_json_number(json, "time_s", events->event[i].time);
        bt_json_string(json, "kind", bt_event_names[events->event[i].kind]);
        bt_json_int(json, "subject", events->event[i].subject);
        bt_json_number(json, "value", events->event[i].value);
        bt_json_close(json, '}');
    }
    bt_json_close(json, ']');
}

static void write_warnings(bt_json *json, const char *key, const view *from, const void *warnings)
{
    (void)from;
    bt_warnings_json(json, key, warnings);
}

// --- the tables ------------------------------------------------------------------------------------------------------

#define OF_SUMMARY(...) {BT_JSON_AT(FROM_SUMMARY, bt_summary, __VA_ARGS__)}
#define SAVED(key_) {.key = key_, .kind = BT_JSON_SAVED} // a running total of history.c
#define OF_TOTALS(...) {BT_JSON_AT(FROM_TOTALS, bt_run_totals, __VA_ARGS__)}
#define OF_CASE(...) {BT_JSON_AT(FROM_CASE, bt_case, __VA_ARGS__)}
#define OF_WINDOW(...) {BT_JSON_AT(FROM_WINDOW, bt_window, __VA_ARGS__)}
#define OF_UNDISTURBED(...) {BT_JSON_AT(FROM_UNDISTURBED, bt_undisturbed, __VA_ARGS__)}
#define OF_IMPACTS(...) {BT_JSON_AT(FROM_IMPACTS, bt_impact_count, __VA_ARGS__)}
#define MACHINE(...) {BT_JSON_AT(FROM_TOTALS, bt_run_totals, __VA_ARGS__), .machine = true}
#define PHASE(name, text) MACHINE("phases_s." #name, phases.name, "s", "wall time of " text),
#define SHARED(name, text) MACHINE("shared_s." #name, shared.name, "s", "wall time in multithreaded passes of " text),
#define CALL_PART(name, text) MACHINE("call_s." #name, call.name, "s", "wall time of " text),
#define MACHINE_SUMMARY(...) {BT_JSON_AT(FROM_SUMMARY, bt_summary, __VA_ARGS__), .machine = true}
#define WHEN(when_, ...) {BT_JSON_AT(FROM_TOTALS, bt_run_totals, __VA_ARGS__), .when = when_}
#define BY(kind_, key_, units_, text_) .key = key_, .units = units_, .description = text_, .kind = BT_JSON_##kind_
#define NUMBER(key_, function, units_, text_) {BY(REAL, key_, units_, text_), .number = function}
#define COUNT(key_, function, units_, text_) {BY(INT, key_, units_, text_), .number = function}
#define MACHINE_OF(key_, function, units_, text_) {BY(REAL, key_, units_, text_), .number = function, .machine = true}
#define TEXT(key_, function, text_) {BY(TEXT, key_, "", text_), .text = function}
#define GROUP(key_, when_, text_) {BY(GROUP, key_, "", text_), .when = when_}
#define WRITTEN(key_, function, text_) {BY(WRITTEN, key_, "", text_), .write = function}
#define WARNINGS(key_, member, text_) \
    {BY(WRITTEN, key_, "", text_), .write = write_warnings, .offset = offsetof(bt_summary, member)}
/// Mean with standard error and 95 % interval, N.
#define MEAN(key_, member, text_) \
    OF_SUMMARY("mean_" key_ "_n", member.mean, "N", "mean over the window: " text_), \
    OF_SUMMARY("mean_" key_ "_se_n", member.se, "N", "standard error of mean_" key_ "_n"), \
    OF_SUMMARY("mean_" key_ "_low_n", member.low, "N", "lower end of the 95 % interval of mean_" key_ "_n"), \
    OF_SUMMARY("mean_" key_ "_high_n", member.high, "N", "upper end of the 95 % interval of mean_" key_ "_n")

static const bt_json_key rows[] = {
    OF_CASE("title", run.title, "", "title of the case"),
    TEXT("version", version, "version of the program"),
    COUNT("n_floes", n_floes, "1", "floes"),
    OF_TOTALS("n_steps", n_steps, "1", "steps done"),
    OF_TOTALS("dt_s", dt, "s", "time step"),
    OF_SUMMARY("sim_time_s", sim_time, "s", "simulated time"),
    MACHINE("wall_time_s", wall_time, "s", "wall time of the run"),
    MACHINE("ranks", ranks, "1", "MPI ranks"),
    MACHINE("threads", threads, "1", "threads of a rank"),
    MACHINE("divisions", division.divisions, "1", "times the field was repartitioned among the ranks in the last call"),
    MACHINE("undivided_steps", division.undivided, "1",
        "steps of the last call that one rank computed alone because that was estimated to be faster"),
    MACHINE("moved_floes", division.moved, "1", "floes moved to another rank by repartitions in the last call"),
    MACHINE("imbalance", division.imbalance, "1",
        "work of the busiest rank over the mean, less 1, with the busiest in the sweeps and the busiest in the rest of "
        "the steps; mean of the checks of the last call; NaN without one"),
    MACHINE("worst_imbalance", division.worst_imbalance, "1", "largest imbalance at a check of the last call"),
    MACHINE("repartition_imbalance", division.repartition_imbalance, "1",
        "imbalance just after a repartition, mean of those after the first"),
    MACHINE("worst_repartition_imbalance", division.worst_repartition_imbalance, "1",
        "largest imbalance just after a repartition"),
    MACHINE("edge_cut", division.cut, "1", "fraction of the edges between cells that the partition cuts"),
    MACHINE("halo_share", division.halo, "1", "copies of bodies on other ranks / bodies owned"),
    MACHINE_OF("memory_per_floe_b", memory_per_floe, "byte", "peak resident memory of all ranks for each floe"),
    MACHINE("sweep_bytes_per_contact", sweep_bytes_per_contact, "byte",
        "batches and velocities that a sweep goes through for a contact point, in the last step"),
    OF_TOTALS("concentration", concentration, "1", "ice concentration as made"),
    OF_TOTALS("mean_size_m", mean_size, "m", "mean equivalent diameter of the floes"),
    OF_TOTALS("floes_unplaced", sizes.unplaced, "1",
        "floes drawn from ice.size_law that found no place among larger ones, and are not in the ice"),
    GROUP("domain", has_body, "whether the forces are a property of the domain"),
    OF_SUMMARY("domain.across", arch.key, "", "key of the extent of the domain across the tow"),
    OF_SUMMARY("domain.body_widths", arch.bodies, "1",
        "extent of the domain across the tow, in widths of the body across the tow"),
    OF_SUMMARY("domain.body_widths_needed", arch.needed, "1",
        "widths of the body from which the domain's width is not expected to show (assumed), where walls or periodic "
        "images hold dense ice"),
    OF_SUMMARY("domain.load_unbounded", arch.unbounded, "1",
        "dense ice of rigid floes, whose load on the body has no upper bound in the model"),
    GROUP("lead", has_lead, "what was cut into the ice ahead of the tow"),
    TEXT("lead.mode", lead_mode, "channel or managed"),
    OF_TOTALS("lead.width_m", lead.width, "m", "width of the lead"),
    OF_TOTALS("lead.length_m", lead.length, "m", "length of the lead"),
    WHEN(is_channel, "lead.floes_removed", lead.taken, "1", "floes that overlapped the channel"),
    WHEN(is_managed, "lead.floes_cut", lead.taken, "1", "floes that overlapped the managed ice"),
    WHEN(is_channel, "lead.area_removed_m2", lead.area_taken, "m2", "area of the floes removed"),
    WHEN(is_managed, "lead.area_cut_m2", lead.area_taken, "m2", "area of the floes cut"),
    OF_TOTALS("lead.pieces", lead.pieces, "1", "pieces that the floes were cut into"),
    NUMBER("lead.mean_piece_m", mean_piece, "m", "mean equivalent diameter of the pieces"),
    OF_TOTALS("lead.concentration_before", lead.concentration_before, "1", "concentration before the cut"),
    OF_TOTALS("lead.concentration_after", lead.concentration_after, "1", "concentration after the cut"),
    GROUP("outlines", NULL, "how the outlines of a field were read"),
    OF_TOTALS("outlines.read", outlines.read, "1", "outlines of a GeoJSON file"),
    OF_TOTALS("outlines.turned", outlines.turned, "1", "outlines listed clockwise, and reversed"),
    OF_TOTALS("outlines.dropped_vertices", outlines.dropped, "1", "vertices left out: double, or on a straight line"),
    OF_TOTALS("outlines.rounded", outlines.rounded, "1", "floes not convex by rounding alone, taken for convex"),
    OF_TOTALS("outlines.rounded_corners", outlines.rounded_corners, "1", "corners left out of floes taken for convex"),
    OF_TOTALS("outlines.rounded_area_added_m2", outlines.rounded_area, "m2", "area added to floes taken for convex"),
    OF_TOTALS("outlines.hulled", outlines.hulled, "1", "floes replaced by their convex hull"),
    OF_TOTALS("outlines.hull_area_added_m2", outlines.hull_area, "m2", "area added by convex hulls"),
    OF_TOTALS("outlines.split", outlines.split, "1", "floes split into convex parts"),
    OF_TOTALS("outlines.parts", outlines.parts, "1", "convex parts of the floes that were split"),
    NUMBER("outlines.origin_lon_deg", origin_lon, "degree", "longitude of x = y = 0"),
    NUMBER("outlines.origin_lat_deg", origin_lat, "degree", "latitude of x = y = 0"),
    NUMBER("outlines.origin_east_m", origin_east, "m", "easting of x = y = 0 in the plane of the file"),
    NUMBER("outlines.origin_north_m", origin_north, "m", "northing of x = y = 0 in the plane of the file"),
    TEXT("outlines.crs", crs, "coordinates of the file; empty without a map"),
    OF_TOTALS("outlines.nearly_thickness", outlines.unnamed, "1",
        "features without a property `thickness` that have one of nearly that name"),
    MEAN("ice_resistance", ice, "contact force of ice and walls on the towed body against the tow"),
    OF_SUMMARY("sd_ice_resistance_n", ice.sd, "N",
        "standard deviation of the step means of the ice resistance in the window"),
    OF_SUMMARY("p95_ice_resistance_n", p95, "N",
        "95th percentile of the step means of the ice resistance in the window"),
    OF_SUMMARY("p99_ice_resistance_n", p99, "N",
        "99th percentile of the step means of the ice resistance in the window"),
    OF_SUMMARY("peak_ice_resistance_n", peak, "N", "largest step mean of the ice resistance in the window"),
    TEXT("peak_conversion", peak_conversion, "what a peak of a series is"),
    MEAN("tow_force", tow, "towing force on the body along the tow"),
    OF_SUMMARY("peak_tow_force_n", window.series[BT_REPORTED_TOW].peak, "N",
        "largest step mean of the tow force in the window"),
    OF_SUMMARY("start_peak_tow_force_n", window.series[BT_REPORTED_TOW].start_peak, "N",
        "largest step mean of the tow force before the window"),
    MEAN("line_tension", window.series[BT_REPORTED_TENSION_1].mean, "tension of the line, of its first branch"),
    MEAN("line_tension_2", window.series[BT_REPORTED_TENSION_2].mean, "tension of the second branch"),
    MEAN("vessel_thrust", window.series[BT_REPORTED_THRUST].mean, "thrust of the vessel along its course"),
    NUMBER("peak_line_tension_n", peak_tension, "N", "largest step mean of the tension of either branch in the window"),
    NUMBER("start_peak_line_tension_n", start_peak_tension, "N",
        "largest step mean of the tension of either branch before the window"),
    OF_SUMMARY("mean_drag_force_n", drag.mean, "N", "mean over the window: drag of water and air against the tow"),
    OF_SUMMARY("mean_coriolis_force_n", coriolis.mean, "N", "mean over the window: Coriolis force against the tow"),
    OF_SUMMARY("mean_tilt_force_n", tilt.mean, "N",
        "mean over the window: force of the sea-surface tilt against the tow"),
    OF_SUMMARY("mean_inertia_force_n", inertia.mean, "N",
        "mean over the window: (mass + added mass) x acceleration along the tow"),
    OF_SUMMARY("mean_ice_resistance_budget_n", budget.mean, "N",
        "mean ice resistance over the window by momentum, without the contacts of the body"),
    GROUP("budget", NULL, "momentum balance of the towed body over the window"),
    OF_SUMMARY("budget.tow_minus_other_forces_n", balance, "N",
        "mean tow force less drag, Coriolis, tilt, registered forces of the balance, and inertia"),
    OF_SUMMARY("budget.closure_n", closure, "N", "mean ice resistance less `budget.tow_minus_other_forces_n`"),
    OF_SUMMARY("budget.closure_relative", closure_relative, "1", "budget.closure_n over the largest of the means"),
    OF_SUMMARY("budget.ice_momentum_closure_relative", budget_closure_relative, "1",
        "mean ice resistance less mean_ice_resistance_budget_n, over the largest of the means"),
    GROUP("window", NULL, "the window that the means refer to"),
    TEXT("window.verdict", verdict, "steady, not steady or too short"),
    WARNINGS("window.reasons", window.reasons, "reasons for a verdict other than steady: [{code, text, values}]"),
    OF_SUMMARY("window.earliest_s", window.earliest, "s", "earliest time at which the window may begin"),
    OF_SUMMARY("window.start_s", window.start, "s", "end of the first step in the window; that step is part of it"),
    OF_SUMMARY("window.end_s", window.end, "s", "end of the last step of the window"),
    OF_SUMMARY("window.n_samples", window.n, "1", "steps in the window"),
    NUMBER("window.n_independent", n_independent, "1",
        "independent samples of the ice resistance among them; where contact pauses, at most its stretches of up to "
        "two correlation times"),
    NUMBER("window.n_contact_stretches", n_stretches, "1",
        "effective number of equally large stretches of contact behind the mean; null if the ice resistance hardly "
        "varies"),
    OF_SUMMARY("window.correlation_time_s", window.correlation_time, "s", "correlation time of the ice resistance"),
    NUMBER("window.no_load_share", no_load_share, "1",
        "share of the steps in the window in which the load on the body has no bound"),
    OF_SUMMARY("window.at_least", window.at_least, "1",
        "means, intervals, percentiles and peaks of the loads are lower bounds: the load has no bound in some steps"),
    NUMBER("window.unconverged_share", unconverged_share, "1",
        "share of the steps in the window that did not converge"),
    NUMBER("window.max_residual_m_s", window_residual, "m/s", "largest residual of a step in the window"),
    TEXT("window.rule", rule, "given by output.window_start, or mser5: found"),
    WRITTEN("window.series", write_reported, "basis of the verdict, for each reported series"),
    GROUP("reference", has_reference, "the measured force of the case"),
    OF_CASE("reference.mean_force_n", reference.mean_force, "N", "measured mean force, given in the case"),
    OF_CASE("reference.source", reference.source, "", "source of the measured force"),
    OF_SUMMARY("reference.ratio", reference_ratio, "1", "mean ice resistance / measured mean force"),
    GROUP("impacts", has_impacts, "collisions with the towed body"),
    TEXT("impacts.conversion", conversion, "how the impulse of a collision is turned into a peak"),
    OF_IMPACTS("impacts.from_s", start, "s", "end of the first step in the window; that step is part of it"),
    OF_IMPACTS("impacts.hours", hours, "h", "length of the window"),
    OF_IMPACTS("impacts.collisions_whole_run", n_all, "1", "collisions of the whole run"),
    OF_IMPACTS("impacts.collisions", n, "1", "collisions in the window"),
    NUMBER("impacts.collisions_per_hour", collisions_per_hour, "1/h", "collisions in the window per hour"),
    OF_IMPACTS("impacts.mean_collision_resistance_n", collision_resistance, "N",
        "part of the mean ice resistance that belongs to collisions"),
    OF_IMPACTS("impacts.mean_quasi_static_resistance_n", quasi_static_resistance, "N",
        "rest of the mean ice resistance: quasi-static"),
    OF_IMPACTS("impacts.largest_quasi_static_load_n", largest_quasi_static_load, "N",
        "largest normal force of a floe, wall or shore in a step of the window that is no collision"),
    OF_IMPACTS("impacts.start_largest_quasi_static_load_n", start_quasi_static_load, "N",
        "largest normal force of a floe, wall or shore in a step before the window that is no collision"),
    OF_IMPACTS("impacts.start_largest_peak_n", start_peak, "N", "largest peak of a collision before the window"),
    GROUP("impacts.largest", has_largest, "the collision with the largest peak in the window"),
    OF_IMPACTS("impacts.largest.peak_n", largest.peak, "N", "peak force by the conversion"),
    OF_IMPACTS("impacts.largest.mean_n", largest.mean, "N", "mean force by the conversion"),
    OF_IMPACTS("impacts.largest.duration_s", largest.duration, "s", "duration by the conversion"),
    OF_IMPACTS("impacts.largest.impulse_ns", largest.impulse, "N s", "impulse"),
    OF_IMPACTS("impacts.largest.approach_m_s", largest.approach, "m/s", "approach speed"),
    OF_IMPACTS("impacts.largest.effective_mass_kg", largest.mass, "kg",
        "effective mass of the two bodies along the normal"),
    OF_IMPACTS("impacts.largest.time_s", largest.time, "s", "end of the step in which the collision began"),
    COUNT("impacts.largest.floe", largest_floe, "1", "the floe, as in /impacts/floe"),
    COUNT("impacts.largest.panel", largest_panel, "1", "panel of the hull"),
    OF_IMPACTS("impacts.largest.x_m", largest.x, "m", "place on the hull, x of the body frame"),
    OF_IMPACTS("impacts.largest.y_m", largest.y, "m", "place on the hull, y of the body frame"),
    WRITTEN("impacts.exceedance", write_exceedance, "how often a peak is reached or exceeded, by rank"),
    WRITTEN("estimates", write_estimates,
        "published and derived estimates for the conditions of the run; null without a towed body"),
    WRITTEN("estimate_labels", write_labels, "label of each estimate in pictures and tables, and its kind"),
    {.key = "", .kind = BT_JSON_ADDED, .write = write_added},
    SAVED("max_overlap_m"),
    NUMBER("max_overlap_relative", overlap_relative, "1", "deepest overlap of two bodies / mean floe size"),
    SAVED("unconverged_steps"),
    SAVED("locked_steps"),
    SAVED("no_load_steps"),
    SAVED("max_residual_m_s"),
    OF_TOTALS("tolerance_m_s", tolerance, "m/s", "residual at which the sweeps stop"),
    OF_SUMMARY("mean_sweeps", sweeps, "1", "sweeps of the contact solver in a step, mean over all steps"),
    OF_SUMMARY("mean_contact_updates", updates, "1", "updates of single contacts in a step, mean over all steps"),
    OF_SUMMARY("mean_momentum_moves", moves, "1",
        "contacts extrapolated along their last change between the sweeps of a step, mean over all steps"),
    OF_SUMMARY("mean_residual_checks", checks, "1",
        "residuals of single contacts taken in a step, mean over all steps"),
    OF_SUMMARY("mean_position_updates", projected, "1",
        "updates of single contacts by the position projection of a step, mean over all steps"),
    SAVED("unprojected_steps"),
    OF_SUMMARY("contacts_mean", contacts, "1", "contact points, mean over all steps"),
    SAVED("contact_work_j"),
    {.kind = BT_JSON_LAWS}, // the totals of the contact laws: src/contact/crush.c, raft.c
    NUMBER("rafted_share_of_ice", rafted_share, "1",
        "area where floes lie over each other at the end, over the area of all ice"),
    OF_TOTALS("stalled_s", stall.time, "s", "time for which the body stood still although the tow demanded motion"),
    OF_TOTALS("stalled_windows", stall.windows, "1", "periods in which the body stood still"),
    SAVED("positive_work_steps"),
    SAVED("repeated_solves"),
    SAVED("outrun_steps"),
    SAVED("misjudged_contacts"),
    SAVED("restitution_cut_steps"),
    SAVED("momentum_residual"),
    OF_TOTALS("floes_outside", floes_outside, "1", "floes that left an open domain"),
    GROUP("moving_window", has_window, "what the moving window did"),
    OF_WINDOW("moving_window.length_m", length, "m", "length of the window"),
    OF_WINDOW("moving_window.ahead_m", ahead, "m", "distance from the body to the front of the window"),
    NUMBER("moving_window.x_m", window_low, "m", "low end of the window, not wrapped"),
    NUMBER("moving_window.laps", window_laps, "1", "distance that the window has moved through the ice / its length"),
    OF_WINDOW("moving_window.renewed", renewed, "1", "floes taken out behind and put in ahead"),
    OF_WINDOW("moving_window.waiting", waiting, "1", "floes behind the window whose place ahead is not free"),
    OF_WINDOW("moving_window.kept", kept, "1", "floes that came round unchanged"),
    OF_WINDOW("moving_window.missed", missed, "1", "places ahead that stayed empty"),
    OF_UNDISTURBED("moving_window.ice_drift_x_m", drift_x, "m", "distance that undisturbed ice has moved, x"),
    OF_UNDISTURBED("moving_window.ice_drift_y_m", drift_y, "m", "distance that undisturbed ice has moved, y"),
    OF_WINDOW("moving_window.dropped_momentum_x_n_s", dropped[0], "N s",
        "momentum of the renewed floes as they were taken out, x"),
    OF_WINDOW("moving_window.dropped_momentum_y_n_s", dropped[1], "N s",
        "momentum of the renewed floes as they were taken out, y"),
    OF_WINDOW("moving_window.dropped_energy_j", dropped[2], "J",
        "kinetic energy of the renewed floes as they were taken out"),
    OF_WINDOW("moving_window.brought_momentum_x_n_s", brought[0], "N s",
        "momentum of the renewed floes as they entered, x"),
    OF_WINDOW("moving_window.brought_momentum_y_n_s", brought[1], "N s",
        "momentum of the renewed floes as they entered, y"),
    OF_WINDOW("moving_window.brought_energy_j", brought[2], "J", "kinetic energy of the renewed floes as they entered"),
    GROUP("splitting", has_splitting, "floes that split"),
    COUNT("splitting.splits", n_splits, "1", "splits, each of a floe into two pieces"),
    NUMBER("splitting.size_before_m", size_before, "m",
        "median root of the area of the original floes that split"),
    NUMBER("splitting.piece_size_m", size_of_pieces, "m", "median root of the area of the pieces at the end"),
    NUMBER("splitting.least_piece_m", least_piece, "m", "size of the smallest piece"),
    {.kind = BT_JSON_SPLITS}, // its totals: bt_split_total_rows of src/output/state.c
    MACHINE_SUMMARY("ns_per_floe_step", ns_per_floe_step, "ns", "wall time for each floe and step"),
    GROUP("phases_s", NULL, "wall time of the steps by their parts"),
    BT_WALL_PHASES(PHASE)
    GROUP("shared_s", NULL, "wall time of each part of the steps in multithreaded passes; one thread does the rest"),
    BT_WALL_PHASES(SHARED)
    GROUP("call_s", NULL, "wall time of the last call by its parts, the whole process where it ran once"),
    BT_CALL_PARTS(CALL_PART)
    TEXT("state_hash", state_hash, "hash of the state at the end, the same for any ranks and threads"),
    OF_TOTALS("stopped", stopped, "", "why the run ended early"),
    WRITTEN("events", write_events, "events of the run, the first 40; all are in result.h5"),
    COUNT("n_events", n_events, "1", "number of events"),
    WARNINGS("warnings", warnings, "doubts about the numbers: [{code, text, values}]"),
};

/// Add keys for saved members.
static int keys_of_rows(bt_json_key *key, const bt_state_row *row, int n, int from)
{
    for (int i = 0; i < n; i++)
        key[i] = (bt_json_key){.key = row[i].key, .units = row[i].units, .description = row[i].meaning,
                               .kind = row[i].type == BT_ITEM_I64 ? BT_JSON_INT : BT_JSON_REAL, .from = from,
                               .offset = row[i].offset};
    return n;
}

/// The running total of a key.
static const bt_state_row *total_of(const char *key)
{
    for (int k = 0; k < bt_n_history_totals(); k++) {
        const bt_state_row *row = &bt_history_total(k)->at;
        if (row->key && !strcmp(row->key, key)) return row;
    }
    assert(!"a total of this key");
    return NULL;
}

const bt_json_key *bt_summary_keys(int *n)
{
    enum { MAX_SPLITS = 32 };
    static bt_json_key keys[sizeof rows / sizeof *rows + BT_MAX_LAW_TOTALS + MAX_SPLITS];
    static int made;
    for (size_t k = 0, ready = made > 0; !ready && k < sizeof rows / sizeof *rows; k++) {
        if (rows[k].kind == BT_JSON_LAWS) {
            for (int i = bt_n_history_totals() - bt_law_first_total(BT_LAWS); i < bt_n_history_totals(); i++)
                made += keys_of_rows(keys + made, &bt_history_total(i)->at, 1, FROM_HISTORY);
        } else if (rows[k].kind == BT_JSON_SAVED) {
            made += keys_of_rows(keys + made, total_of(rows[k].key), 1, FROM_HISTORY);
        } else if (rows[k].kind == BT_JSON_SPLITS) {
            made += keys_of_rows(keys + made, bt_split_total_rows, bt_n_split_total_rows, FROM_SPLITTING);
        } else {
            keys[made++] = rows[k];
        }
    }
    *n = made;
    return keys;
}

#define OF_REPORTED(...) {BT_JSON_AT(0, bt_reported, __VA_ARGS__)}
const bt_json_key bt_reported_keys[] = {
    OF_REPORTED("mean_n", mean.mean, "N", "mean over the window"),
    OF_REPORTED("mean_low_n", mean.low, "N", "lower end of the 95 % interval of the mean"),
    OF_REPORTED("mean_high_n", mean.high, "N", "upper end of the 95 % interval of the mean"),
    OF_REPORTED("n_independent", mean.n_eff, "1", "independent samples"),
    OF_REPORTED("change_n", trend.change, "N", "change of a straight line over the window"),
    OF_REPORTED("change_low_n", trend.low, "N", "lower end of the 95 % interval of the change"),
    OF_REPORTED("change_high_n", trend.high, "N", "upper end of the 95 % interval of the change"),
    WRITTEN("quarters_n", write_quarters, "means of the quarters of the window, N"),
    OF_REPORTED("peak_n", peak, "N", "largest step mean in the window"),
    OF_REPORTED("start_peak_n", start_peak, "N", "largest step mean before the window"),
};
const int bt_n_reported_keys = sizeof bt_reported_keys / sizeof *bt_reported_keys;

char *bt_summary_json(const bt_summary *summary, const bt_history *history, const bt_case *input,
                      const bt_run_totals *totals, bt_idx n)
{
    const view from = {summary, history, input, totals, n};
    const void *const source[N_FROM] = {summary, history, totals, input, totals->window, totals->undisturbed,
                                        summary->impacts, totals->splitting ? &totals->splitting->total : NULL};
    bt_json json = {0};
    bt_json_open(&json, NULL, '{');
    int n_keys;
    const bt_json_key *keys = bt_summary_keys(&n_keys);
    bt_json_keys_write(&json, keys, n_keys, &from, source);
    bt_json_close(&json, '}');
    return json.text;
}

static const bt_json_key *find(const char *key)
{
    int n;
    const bt_json_key *keys = bt_summary_keys(&n);
    return bt_json_keys_find(keys, n, key);
}

bt_status bt_summary_check_added(bt_errors *err)
{
    const size_t before = err->n;
    for (int k = 0; k < bt_n_added(); k++)
        if (find(bt_added(k)->summary))
            bt_errors_add(err, "quantity %s: its key %s is one of the summary's own; choose another name",
                          bt_added(k)->name, bt_added(k)->summary);
    return err->n > before ? BT_ERR_USAGE : BT_OK;
}

// --- meanings --------------------------------------------------------------------------------------------------------

static bt_meaning meaning_of(const bt_json_key *key)
{
    bt_meaning meaning = {.units = "", .description = "", .estimate = "", .label = "", .kind = ""};
    if (!key) return meaning;
    meaning.known = true, meaning.machine = key->machine;
    meaning.units = key->units, meaning.description = key->description;
    return meaning;
}

/// A key "estimates.NAME.key", or one of the conditions.
static bt_meaning meaning_of_estimate(const char *key)
{
    const char *dot = strchr(key, '.');
    if (!dot) return meaning_of(bt_json_keys_find(bt_condition_keys, bt_n_condition_keys, key));
    for (int k = 0; k < bt_n_estimates(); k++) {
        const bt_estimate_def *def = bt_estimate_of(k);
        if (strncmp(def->name, key, (size_t)(dot - key)) || def->name[dot - key]) continue;
        bt_meaning meaning = meaning_of(bt_json_keys_find(bt_estimate_keys, bt_n_estimate_keys, dot + 1));
        meaning.estimate = def->name, meaning.label = def->label, meaning.kind = bt_estimate_kind_name(def);
        return meaning;
    }
    return meaning_of(NULL);
}

bt_meaning bt_summary_meaning(const char *key)
{
    for (int k = 0; k < bt_n_added(); k++)
        if (!strcmp(bt_added(k)->summary, key))
            return meaning_of(
                &(bt_json_key){.units = bt_added(k)->units, .description = bt_added(k)->description});
    if (!strncmp(key, "estimates.", 10)) return meaning_of_estimate(key + 10);
    const char *dot = strrchr(key, '.');
    if (!strncmp(key, "window.series.", 14))
        return meaning_of(bt_json_keys_find(bt_reported_keys, bt_n_reported_keys, dot + 1));
    return meaning_of(find(key));
}
