// SPDX-License-Identifier: MIT
// Constraints between keys: two tables of rows, each with the condition under which it holds. A message that needs more
// than a comparison comes from a function of its own (case_check.c, case_tow.c, case_window.c).
//
// Keys without effect. A file that gives both keys contradicts itself, and is refused. If they come from different
// places, the key may be inherited, from a base or from the case that a study or --set changes: then the run warns that
// it is not used. Defaults cause no message, nor do files with every key, such as a resolved case and a scaled twin.
// Rows of ALWAYS are refused wherever the key comes from: what it asks for would be missing. Rows of WARNED never are:
// open water is a value of ice.concentration like others.
//
// Limits: a value against a number or against another key, and combinations that are refused.

#include <string.h>

#include "base/elementary.h"
#include "base/largest.h"
#include "base/name.h"
#include "case/case_check.h"
#include "case/case_derived.h"
#include "case/schema.h"
#include "case/warning.h"

// --- keys without effect ---------------------------------------------------------------------------------------------

/// When keys without effect are refused. NEVER: there is no warning either, since the program itself sets them.
typedef enum { TOGETHER, ALWAYS, NEVER, WARNED } refusal;

/// Keys that are not used.
typedef struct idle {
    bool so;
    refusal refused;
    const char *keys;  ///< separated by blanks
    const char *cause; ///< keys that make them useless, separated by blanks
    const char *why;   ///< completes "has no effect "
} idle;

#define BRANCH2                                                                                                        \
    "tow.branch2.hull_x tow.branch2.hull_y tow.branch2.length tow.branch2.stiffness tow.branch2.damping "              \
    "tow.branch2.breaking_load"

/// The n rows for a case; the caller frees them.
static idle *list_idle(const bt_case *input, int *n)
{
    const bool read = bt_case_reads_field(input), made = bt_case_makes_ice(input),
               power = input->ice.size_law == BT_SIZE_POWER;
    // for ice that is read, a moving window measures its room in floes of ice.size (case_window.c)
    const bool sized = input->domain.ends == BT_BOUND_MOVING;
    const bool line = input->tow.mode == BT_TOW_LINE || input->tow.mode == BT_TOW_THRUST;
    const bool walls = input->domain.ends == BT_BOUND_WALL || input->domain.sides == BT_BOUND_WALL;
    const char *source = input->ice.field ? "ice.field" : "ice.outlines";
    const idle all[] = {
        {read, TOGETHER, "ice.concentration ice.shape ice.sides ice.aspect ice.size_law ice.size_spread ice.size_min "
               "ice.size_max ice.size_exponent ice.shake ice.extent.x_min ice.extent.x_max ice.extent.y_min "
               "ice.extent.y_max",
         source, "on ice that is read from a file"},
        {read && !sized, TOGETHER, "ice.size", source, "on ice that is read from a file"},
        {input->ice.field, TOGETHER, "ice.thickness_law ice.thickness_spread", "ice.field",
         "on the floes of a field file, which have their own thicknesses"},
        {input->ice.field && input->n_floes == 0, TOGETHER, "ice.thickness", "ice.field",
         "on the floes of a field file, which have their own thicknesses"},
        {input->ice.field, TOGETHER, "ice.x_min ice.x_max ice.y_min ice.y_max", "ice.field",
         "on a field file, which has its own ice region"},
        // sizes and mean thickness also belong to the curves of the estimates
        {!read && !made, WARNED, "ice.shape ice.sides ice.aspect ice.shake ice.extent.x_min ice.extent.x_max "
               "ice.extent.y_min ice.extent.y_max ice.thickness_law ice.thickness_spread",
         "ice.concentration", "without ice (ice.concentration: 0)"},
        {(made || input->ice.outlines) && input->ice.thickness_law == BT_THICK_CONSTANT, TOGETHER,
         "ice.thickness_spread", "ice.thickness_law", "with ice.thickness_law: constant"},
        {!read && input->ice.size_law == BT_SIZE_SINGLE, TOGETHER, "ice.size_min ice.size_max", "ice.size_law",
         "with ice.size_law: single"},
        {!read && !power, TOGETHER, "ice.size_exponent", "ice.size_law", "without ice.size_law: power"},
        {!read && power, TOGETHER, "ice.size ice.size_spread", "ice.size_law",
         "with ice.size_law: power, whose sizes follow from ice.size_min, size_max and size_exponent"},
        {made, TOGETHER, input->ice.shape == BT_ICE_RECTANGLES ? "ice.sides"
                : input->ice.shape == BT_ICE_POLYGONS ? "ice.aspect"
                                                      : "ice.sides ice.aspect",
         "ice.shape", "on floes of this ice.shape"},
        {!(input->ice.crushing_pressure > 0), TOGETHER, "ice.crushing.least_length", "ice.crushing.pressure",
         "on ice that does not crush (ice.crushing.pressure)"},
        {!(input->ice.splitting.toughness > 0), TOGETHER,
         "ice.splitting.strength ice.splitting.least_size ice.splitting.generations ice.splitting.aspect "
         "ice.splitting.reserve ice.splitting.scatter",
         "ice.splitting.toughness", "on floes that do not split (ice.splitting.toughness)"},
        {input->body.shape == BT_BODY_POLYGON, TOGETHER, "body.length body.width", "body.shape",
         "on the waterline of body.vertices (body.shape: polygon)"},
        {input->body.shape == BT_BODY_ABSENT, TOGETHER,
         "body.length body.width body.x body.y body.yaw body.yaw_rate body.draft body.sail body.density "
         "body.mass body.added_mass body.added_inertia body.friction body.restitution body.drag.water_form "
         "body.drag.water_skin body.drag.air_form body.drag.air_skin body.drag.tangential",
         "body.shape", "without a towed body (body.shape: none)"},
        {input->body.shape == BT_BODY_ABSENT, TOGETHER, "tow.ramp tow.direction impact.panels output.panels",
         "body.shape",
         "without a towed body (body.shape: none)"},
        {input->body.shape != BT_BODY_ABSENT && input->tow.mode == BT_TOW_NONE, TOGETHER, "tow.ramp", "tow.mode",
         "on a body that is not towed (tow.mode: none)"},
        {!line, TOGETHER, "tow.line_length tow.line_stiffness tow.line_damping tow.hull_x tow.hull_y tow.line.type "
                "tow.line.diameter tow.line.branches tow.line.breaking_load tow.line.weight " BRANCH2,
         "tow.mode", "without a line (tow.mode: line or thrust)"},
        {line && input->tow.line.branches < 2, TOGETHER, BRANCH2, "tow.line.branches",
         "on a single line (tow.line.branches)"},
        {input->tow.mode != BT_TOW_THRUST, TOGETHER, "tow.vessel.mass tow.vessel.added_mass tow.vessel.bollard_pull "
                                           "tow.vessel.free_speed tow.vessel.free_resistance tow.vessel.lateral_drag "
                                           "tow.vessel.lookahead",
         "tow.mode", "without a vessel (tow.mode: thrust)"},
        {input->lead.mode == BT_LEAD_NONE, TOGETHER, "lead.width lead.length lead.floe_size", "lead.mode",
         "without a lead (lead.mode)"},
        {input->lead.mode == BT_LEAD_CHANNEL, TOGETHER, "lead.floe_size", "lead.mode",
         "on a channel, where no pieces are left"},
        {!(input->water.tide.major > 0), TOGETHER, "water.tide.inclination water.tide.period water.tide.phase",
         "water.tide.major", "without a tide (water.tide.major)"},
        {!walls, TOGETHER, "domain.wall_friction domain.wall_restitution", "domain.ends domain.sides",
         "without walls (domain.ends, domain.sides)"},
        {input->impact.conversion != BT_IMPACT_DURATION, TOGETHER, "impact.duration", "impact.conversion",
         "without impact.conversion: duration"},
        {input->impact.conversion != BT_IMPACT_CRUSHING, TOGETHER, "impact.pressure impact.corner impact.corner_angle",
         "impact.conversion", "without impact.conversion: crushing"},
        {input->impact.conversion == BT_IMPACT_NONE, TOGETHER, "impact.least_speed", "impact.conversion",
         "where collisions are not identified (impact.conversion)"},
        {input->domain.ends != BT_BOUND_MOVING, NEVER, "domain.ahead", "domain.ends", "without a moving window"},
        {input->body.shape == BT_BODY_ABSENT || input->tow.mode == BT_TOW_NONE, NEVER, "tow.speed", "tow.mode",
         "without a tow"},
        {input->domain.ends != BT_BOUND_WALL, ALWAYS, "domain.ends_closing", "domain.ends", "without a wall to move"},
        {input->domain.sides != BT_BOUND_WALL, ALWAYS, "domain.sides_closing", "domain.sides",
         "without a wall to move"},
        {input->tow.mode == BT_TOW_NONE, ALWAYS, "tow.programme tow.waypoints", "tow.mode", "with tow.mode: none"},
        {input->tow.n_waypoints == 0, ALWAYS, "tow.turn_radius", "tow.waypoints", "without tow.waypoints"},
        {line && input->tow.line.type == BT_ROPE_NUMBERS, ALWAYS, "tow.line.diameter", "tow.line.type",
         "without a named line"},
        {input->water.tilt != BT_TILT_SLOPE, ALWAYS, "water.slope_x water.slope_y", "water.tilt",
         "without water.tilt: slope"},
        {input->water.current_table, ALWAYS, "water.current_x water.current_y water.tide.major water.tide.minor",
         "water.current_table", "with water.current_table, which gives the whole current"},
        {input->air.wind_table, ALWAYS, "air.wind_x air.wind_y", "air.wind_table",
         "with air.wind_table, which gives the whole wind"},
        {!input->ice.outlines, ALWAYS, "ice.outlines_crs", "ice.outlines", "without ice.outlines"},
        {!read, ALWAYS, "ice.nonconvex", "ice.outlines ice.field", "on a field that the program makes, whose floes are "
                                                                   "convex"},
    };
    *n = sizeof all / sizeof *all;
    return memcpy(bt_alloc(1, sizeof all), all, sizeof all);
}

static const bt_key *row_of(const char *key)
{
    return &bt_case_keys[bt_schema_find(bt_case_keys, bt_n_case_keys, key)];
}

static size_t size_of(const bt_key *key)
{
    return key->type == BT_KEY_REAL ? sizeof(double) : key->type == BT_KEY_INT ? sizeof(int64_t) : sizeof(int);
}

/// A case with one key, a number or a choice, at its default, and all others as they are. Owns no memory.
static bt_case with_default(const bt_case *c, const bt_key *key)
{
    bt_case d = *c;
    bt_schema_preset(key, 1, &d);
    bt_case_fill(&d);
    return d;
}

const char *bt_case_why_unused(const bt_case *input, const char *key)
{
    int n;
    idle *rules = list_idle(input, &n);
    char name[BT_LONGEST_KEY];
    const char *why = NULL;
    for (int i = 0; i < n && !why; i++)
        for (const char *keys = rules[i].keys; rules[i].so && bt_next_name(&keys, name);)
            if (!strcmp(name, key)) why = rules[i].why;
    free(rules);
    return why;
}

bool bt_case_changed(const bt_case *c, const char *key)
{
    const bt_key *k = row_of(key);
    if (k->type == BT_KEY_POINTS) return bt_value_of(k, c).n > 0;
    if (k->type == BT_KEY_REAL && isnan(bt_value_number(k, c))) return false;
    const bt_case d = with_default(c, k);
    return memcmp((const char *)c + k->offset, (const char *)&d + k->offset, size_of(k)) != 0;
}

/// Call `found` for each key that is not used although its value is not the default.
static void look(const bt_case *input, void (*found)(void *to, const char *key, const idle *rule), void *to)
{
    int n;
    idle *rules = list_idle(input, &n);
    char name[BT_LONGEST_KEY];
    for (int i = 0; i < n; i++)
        for (const char *keys = rules[i].keys; rules[i].so && rules[i].refused != NEVER && bt_next_name(&keys, name);)
            if (bt_case_changed(input, name)) found(to, name, &rules[i]);
    free(rules);
}

/// Does the file that gives the key have more than half of all keys? Nobody writes so many by hand.
static bool says_all(const bt_check *check, const char *key)
{
    int n = 0;
    for (int i = 0; i < bt_n_case_keys; i++)
        n += check->from[i].line > 0 && !strcmp(bt_check_file(check, bt_case_keys[i].name), bt_check_file(check, key));
    return 2 * n > bt_n_case_keys;
}

static void refuse(void *to, const char *key, const idle *rule)
{
    const bt_check *check = to;
    const bool always = rule->refused == ALWAYS;
    if (!bt_check_sound(check, key) || !bt_check_sound(check, rule->cause) ||
        rule->refused == WARNED || (!always && (!check->from || says_all(check, key)))) return;
    const char *causes = rule->cause;
    char cause[BT_LONGEST_KEY];
    while (bt_next_name(&causes, cause))
        if (!always && !bt_check_together(check, key, cause)) return;
    causes = rule->cause;
    bt_next_name(&causes, cause); // the first is the one to change
    bt_check_fault(check, key, "has no effect %s; remove the key, or change %s", rule->why, cause);
}

/// Keys with the same reason in sequence, so that one warning names them all.
typedef struct warning {
    bt_errors *warnings;
    const char *why;
    char names[512];
} warning;

static void put(warning *w)
{
    if (*w->names) bt_warn(w->warnings, BT_WARN_IDLE, "%s: no effect %s", w->names, w->why);
    *w->names = 0;
}

static void gather(void *to, const char *key, const idle *rule)
{
    warning *w = to;
    if (w->why != rule->why) put(w);
    w->why = rule->why;
    const size_t n = strlen(w->names);
    snprintf(w->names + n, sizeof w->names - n, "%s%s", n ? ", " : "", key);
}

void bt_case_warn_idle(const bt_case *input, bt_errors *warnings)
{
    warning w = {.warnings = warnings};
    look(input, gather, &w);
    put(&w);
}

static void mark(void *to, const char *key, const idle *rule)
{
    (void)rule;
    ((bool *)to)[row_of(key) - bt_case_keys] = true;
}

void bt_case_mark_idle(const bt_case *input, bool *idle_key) { look(input, mark, idle_key); }

void bt_case_put_default(bt_case *c, int key)
{
    const bt_key *k = &bt_case_keys[key];
    const bt_case d = with_default(c, k);
    memcpy((char *)c + k->offset, (const char *)&d + k->offset, size_of(k));
}

// --- limits ----------------------------------------------------------------------------------------------------------

typedef enum { REFUSED, NEEDED, BELOW, AT_MOST, AT_LEAST, UP_TO, FROM } relation;

/// A value that must be above 0 (NEEDED) or keep within a bound; or a combination that is refused. UP_TO, FROM: AT_MOST
/// and AT_LEAST of positions, which rounding may put just beyond.
typedef struct limit {
    bool so;           ///< the row applies; of REFUSED: the fault is present
    relation relation;
    const char *key;
    const char *of;    ///< the key or words (with blanks) behind the bound; of NEEDED: why the value is needed
    double bound;
    const char *beside; ///< other keys that the row depends on, separated by blanks
    const char *why;    ///< reason and remedy, with the colon or semicolon before them; of NEEDED: an example
} limit;

#define EXTENT "ice.x_min ice.x_max ice.y_min ice.y_max domain.x0 domain.y0 domain.length domain.width "
#define MADE "ice.concentration ice.field ice.outlines ice.size ice.size_law ice.size_min ice.size_max "
#define BODY "body.shape tow.mode"

enum { TIDE_STEPS = 20 }; // a step takes the current at its middle: 1 - sinc(π/20) = 0.4 % off its mean

/// Does the tow run along x? Then its lead goes round in a moving window without being displaced.
static bool along_x(const bt_case *input)
{
    bool along = fabs(bt_sin(input->tow.direction)) <= 1e-9;
    for (int i = 0; i < input->tow.n_waypoints; i++)
        along = along && fabs(input->tow.waypoints[2 * i + 1] - input->body.y) <= 1e-9 * input->domain.width;
    return along;
}

/// The n rows for a case; the caller frees them.
static limit *list_limits(const bt_case *input, int *n)
{
    const double size_min = input->ice.size_min, size_max = input->ice.size_max, ahead = input->domain.ahead;
    const bool read = bt_case_reads_field(input), made = bt_case_makes_ice(input),
               power = input->ice.size_law == BT_SIZE_POWER, ordered = size_min < size_max || size_max == 0,
               splits = input->ice.splitting.toughness > 0,
               lognormal = made && input->ice.size_law == BT_SIZE_LOGNORMAL && ordered;
    const double x0 = input->domain.x0, x1 = x0 + input->domain.length, y0 = input->domain.y0,
                 y1 = y0 + input->domain.width;
    // a region without room, or sizes in the wrong order, are refused for that alone
    const double room = bt_min(input->ice.x_max - input->ice.x_min, input->ice.y_max - input->ice.y_min);
    const bool roomy = made && room > 0 && ordered;
    const double period = bt_case_period(input);
    const double largest = power ? size_max : input->ice.size;
    const bool lon = !isnan(input->ice.origin_lon), lat = !isnan(input->ice.origin_lat),
               east = !isnan(input->ice.origin_east), north = !isnan(input->ice.origin_north);
    const bt_crs crs = input->ice.outlines_crs;
    const bool degrees = crs == BT_CRS_FILE || crs == BT_CRS_LONLAT, plane = crs == BT_CRS_FILE || crs == BT_CRS_PLANE;
    const bool absent = input->body.shape == BT_BODY_ABSENT, polygon = input->body.shape == BT_BODY_POLYGON;
    const bool thrust = input->tow.mode == BT_TOW_THRUST, line = input->tow.mode == BT_TOW_LINE || thrust;
    const bool named = input->tow.line.type != BT_ROPE_NUMBERS, thick = input->tow.line.diameter > 0;
    const bool driven = input->tow.mode == BT_TOW_SPEED, towed = !absent && input->tow.mode != BT_TOW_NONE;
    const bool lead = input->lead.mode != BT_LEAD_NONE;
    static const char *const empty = ": the ice region is empty; move one of them", *const inside = "; move it inside",
                      *const unit = "; check the unit", *const one = "; change one of them",
                      *const swap = "; swap them and turn the inclination by 90 deg",
                      *const cut = ", and the field is cut from its extent; move it, or leave the key out",
                      *const large = "; use smaller floes or a larger region",
                      *const prescribed = "has no effect with tow.mode: speed, which prescribes the velocity; remove "
                                          "it or set another mode",
                      *const alone = "is given without the other coordinate of the origin; give both, or none for the "
                                     "middle of the outlines";
    const limit all[] = {
        // in a case built in memory, the two keys without a default may be unset
        {true, NEEDED, "run.dt", "a run needs it", 0, "", "0.1 s"},
        {true, NEEDED, "run.duration", "a run needs it", 0, "", "450 s"},
        {true, AT_MOST, "run.dt", "run.duration", input->run.duration, "", "; shorten the step or lengthen the run"},
        {true, BELOW, "output.window_start", "run.duration", input->run.duration, "", "; give an earlier time"},

        {true, BELOW, "ice.x_min", "ice.x_max", input->ice.x_max, EXTENT, empty},
        {true, BELOW, "ice.y_min", "ice.y_max", input->ice.y_max, EXTENT, empty},
        {true, FROM, "ice.x_min", "the low end of the domain", x0, EXTENT, inside},
        {true, UP_TO, "ice.x_max", "the high end of the domain", x1, EXTENT, inside},
        {true, FROM, "ice.y_min", "the low end of the domain", y0, EXTENT, inside},
        {true, UP_TO, "ice.y_max", "the high end of the domain", y1, EXTENT, inside},
        {!read, UP_TO, "ice.extent.x_min", "ice.x_min", input->ice.x_min, "", cut},
        {!read, FROM, "ice.extent.x_max", "ice.x_max", input->ice.x_max, "", cut},
        {!read, UP_TO, "ice.extent.y_min", "ice.y_min", input->ice.y_min, "", cut},
        {!read, FROM, "ice.extent.y_max", "ice.y_max", input->ice.y_max, "", cut},

        {true, AT_LEAST, "ice.thickness", NULL, BT_LEAST_THICKNESS, "", ", too thin for ice; check the unit"},
        {true, AT_MOST, "ice.density", "water.density", input->water.density, "",
         ": such ice sinks; correct one of them"},
        {input->ice.rafting_kappa > 0, AT_LEAST, "ice.rafting.kappa", NULL, 2, "",
         ", the potential energy that the sheets gain: floes would gain energy by lying over each other; give 0 for "
         "none, or 10 to 34, twice the published ratios of work to energy"},
        {input->ice.rafting_kappa > 0 && input->ice.density == input->water.density, REFUSED, "ice.rafting.kappa", NULL,
         0,
         "ice.density water.density",
         "cannot be used with ice as heavy as water: sheets that do not float bear nothing at their edges; give "
         "ice.density, or 0 for rigid floes"},
        {made, AT_LEAST, "ice.concentration", NULL, BT_LEAST_CONCENTRATION, "",
         "; give a fraction, or 0 for open water"},
        {made && !power, AT_LEAST, "ice.size", NULL, BT_LEAST_SIZE, "", unit},
        {made && power && size_min > 0, AT_LEAST, "ice.size_min", NULL, BT_LEAST_SIZE, "", unit},
        {made && power, NEEDED, "ice.size_min", "size_law power needs a smallest size", 0, MADE, "10 m"},
        {made && power, NEEDED, "ice.size_max", "size_law power needs a largest size", 0, MADE, "100 m"},
        {made && size_max != 0, BELOW, "ice.size_min", "ice.size_max", size_max, MADE, "; swap them"},
        {lognormal, AT_LEAST, "ice.size", "ice.size_min", size_min, MADE, one},
        {lognormal && size_max > 0, AT_MOST, "ice.size", "ice.size_max", size_max, MADE, one},
        {roomy && power, AT_MOST, "ice.size_max", "the short side of the ice region", room, MADE EXTENT, large},
        {roomy && !power, AT_MOST, "ice.size", "the short side of the ice region", room, MADE EXTENT, large},
        // otherwise it depends on the seed whether a run is refused
        {roomy && input->ice.size_law != BT_SIZE_SINGLE && size_max <= room, BELOW, "ice.size_max",
         "half the period of the domain", 0.5 * period, MADE EXTENT,
         ": two such floes have no room to turn side by side; use smaller floes or a larger domain"},
        {splits && input->domain.ends == BT_BOUND_MOVING, REFUSED, "ice.splitting.toughness", NULL, 0, "domain.ends",
         "floes that split are not supported with domain.ends: moving, where floes left behind come back ahead; set 0, "
         "or use another boundary and a domain as long as the tow"},
        {splits && input->ice.added_inertia != input->ice.added_mass, REFUSED, "ice.added_inertia", NULL, 0,
         "ice.added_mass ice.splitting.toughness",
         "is not ice.added_mass, but where floes split the two must be equal, or a split would make or destroy energy "
         "of the water that turns with the floe; give both the same value"},
        {splits && input->ice.splitting.scatter > 0, AT_LEAST, "ice.splitting.scatter", NULL, 2,
         "ice.splitting.toughness",
         ": such a Weibull modulus leaves floes without strength; give at least 2, as in 10, or 0 for the same "
         "strength everywhere"},
        {splits, NEEDED, "ice.splitting.least_size", "has no default where ice.thickness is none", 0,
         "ice.splitting.toughness ice.thickness", "2 m"},
        {splits && made && largest > 0, BELOW, "ice.splitting.least_size", power ? "ice.size_max" : "ice.size", largest,
         "ice.splitting.toughness ice.thickness ice.size_law ice.size_min ice.size_exponent",
         ", so that no floe can split; give a smaller one, or ice.splitting.toughness: 0"},

        {input->ice.field && input->ice.outlines, REFUSED, "ice.outlines", NULL, 0, "ice.field",
         "the field is read from ice.field already; remove one of the two keys"},
        {lon != lat, REFUSED, lon ? "ice.origin_lon" : "ice.origin_lat", NULL, 0, "ice.origin_lon ice.origin_lat",
         alone},
        {east != north, REFUSED, east ? "ice.origin_east" : "ice.origin_north", NULL, 0,
         "ice.origin_east ice.origin_north", alone},
        {lon && east, REFUSED, "ice.origin_east", NULL, 0, "ice.origin_lon",
         "and ice.origin_lon both say where x = y = 0 is; keep those of the file's coordinates, metres or degrees"},
        {input->ice.outlines && lon && !degrees, REFUSED, "ice.origin_lon", NULL, 0, "ice.outlines ice.outlines_crs",
         "has no effect on outlines in metres; give ice.origin_east and ice.origin_north, or remove the origin"},
        {east && (!input->ice.outlines || !plane), REFUSED, "ice.origin_east", NULL, 0, "ice.outlines ice.outlines_crs",
         "has no effect unless ice.outlines are read that are metres east and north; remove the origin, or set "
         "ice.outlines_crs: plane"},

        {polygon && !input->body.n_vertices, REFUSED, "body.vertices", NULL, 0, "body.shape",
         "is missing for shape polygon; give the corners as [[x, y], [x, y], ...]"},
        {!polygon && input->body.n_vertices, REFUSED, "body.vertices", NULL, 0, "body.shape",
         "is given but the shape is not polygon; set body.shape: polygon, or remove the corners"},
        {input->body.shape == BT_BODY_SQUARE && input->body.width != input->body.length, REFUSED, "body.width", NULL, 0,
         "body.shape body.length",
         "differs from body.length, but the shape is square; remove the key or set body.shape: rectangle"},
        {driven && input->body.vx != 0, REFUSED, "body.vx", NULL, 0, BODY, prescribed},
        {driven && input->body.vy != 0, REFUSED, "body.vy", NULL, 0, BODY, prescribed},
        {driven && input->body.yaw_rate != 0, REFUSED, "body.yaw_rate", NULL, 0, BODY, prescribed},

        {line, NEEDED, "tow.line_length", "a tow by a line needs it", 0, "tow.mode", "5 m"},
        {line && named, NEEDED, "tow.line.diameter", "a named line needs a diameter", 0, "tow.mode tow.line.type",
         "60 mm"},
        {line && (!named || thick), NEEDED, "tow.line_stiffness", "a line needs a stiffness EA", 0,
         "tow.mode tow.line.type tow.line.diameter", "10 kN"},
        {thrust, NEEDED, "tow.vessel.mass", "tow.mode thrust needs it", 0, "tow.mode", "3000 t"},
        {thrust, NEEDED, "tow.vessel.bollard_pull", "tow.mode thrust needs it", 0, "tow.mode", "1 MN"},
        {thrust, NEEDED, "tow.vessel.free_speed", "tow.mode thrust needs it", 0, "tow.mode", "15 kn"},
        {thrust, AT_MOST, "tow.vessel.free_resistance", "tow.vessel.bollard_pull", input->tow.vessel.bollard_pull,
         "tow.mode", ": thrust does not grow with speed; lower it"},

        {input->water.tilt == BT_TILT_GEOSTROPHIC && input->water.latitude == 0, REFUSED, "water.tilt", NULL, 0,
         "water.latitude", "geostrophic balance needs the Coriolis force; give water.latitude"},
        {true, AT_MOST, "water.tide.minor", "water.tide.major", input->water.tide.major, "", swap},
        {true, AT_LEAST, "water.tide.minor", "the opposite of water.tide.major", -input->water.tide.major,
         "water.tide.major", swap},
        {input->water.tide.major > 0, AT_LEAST, "water.tide.period", "the time of 20 steps", TIDE_STEPS * input->run.dt,
         "run.dt", ": they cannot follow it; tidal periods are hours, as in 12.42 h"},

        {lead && !towed, REFUSED, "lead.mode", NULL, 0, BODY,
         "a lead lies along the tow, but nothing is towed; set it to none, or set tow.mode"},
        {lead && towed, NEEDED, "lead.width", "a lead needs it", 0, BODY, "20 m"},
        {lead && towed, NEEDED, "lead.length", "a lead needs it", 0, BODY, "500 m"},
        {input->lead.mode == BT_LEAD_MANAGED && towed, NEEDED, "lead.floe_size",
         "a managed lead needs the size of its pieces", 0, BODY, "10 m"},
        {lead && towed && input->domain.ends == BT_BOUND_MOVING && !along_x(input), AT_MOST, "lead.length",
         "domain.ahead", ahead, BODY " domain.ends domain.length tow.direction tow.waypoints body.y",
         ", and the tow leads away from the x axis: in a moving window the lead would come round beside it; shorten "
         "the lead, tow along x, or set domain.ends: periodic or open"},

        {true, AT_LEAST, "estimate.kappa", "estimate.kappa_low", input->estimate.kappa_low, "", "; lower that too"},
        {true, AT_MOST, "estimate.kappa", "estimate.kappa_high", input->estimate.kappa_high, "", "; raise that too"},
    };
    *n = sizeof all / sizeof *all;
    return memcpy(bt_alloc(1, sizeof all), all, sizeof all);
}

static void refuse_limit(const bt_check *check, const limit *l)
{
    static const char *const broken[] = {[BELOW] = "not below", [AT_MOST] = "more than", [AT_LEAST] = "less than",
                                         [UP_TO] = "more than", [FROM] = "less than"};
    const bt_key *row = row_of(l->key);
    const bool is_key = l->of && !strchr(l->of, ' ');
    const double value = row->type == BT_KEY_REAL ? bt_value_number(row, check->c) : 1;
    const double slack = 1e-9 * (check->c->domain.length + check->c->domain.width);
    const bool bad[] = {[REFUSED] = true,
                        [NEEDED] = !(value > 0),
                        [BELOW] = value >= l->bound,
                        [AT_MOST] = value > l->bound,
                        [AT_LEAST] = value < l->bound,
                        [UP_TO] = value > l->bound + slack,
                        [FROM] = value < l->bound - slack};
    if (!l->so || !bad[l->relation] || !bt_check_sound(check, l->key) || !bt_check_sound(check, l->beside) ||
        (is_key && !bt_check_sound(check, l->of)))
        return;
    const char *unit = bt_units_symbol(row->unit), *blank = *unit ? " " : "";
    if (l->relation == REFUSED) bt_check_fault(check, l->key, "%s", l->why);
    else if (l->relation == NEEDED && isnan(value))
        bt_check_fault(check, l->key, "is not set, and %s; give it, as in %s", l->of, l->why);
    else if (l->relation == NEEDED)
        bt_check_fault(check, l->key, "is %g%s%s and %s; give it, as in %s", value, blank, unit, l->of, l->why);
    else
        bt_check_fault(check, l->key, "%g%s%s is %s %s%s%g%s%s%s", value, blank, unit, broken[l->relation],
                       l->of ? l->of : "", l->of ? ", " : "", l->bound, blank, unit, l->why);
}

void bt_case_check_constraints(const bt_check *check)
{
    int n;
    look(check->c, refuse, (void *)check);
    limit *limits = list_limits(check->c, &n);
    for (int i = 0; i < n; i++) refuse_limit(check, &limits[i]);
    free(limits);
}
