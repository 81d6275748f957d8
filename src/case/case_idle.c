// SPDX-License-Identifier: MIT
// Keys that have no effect beside what another key says.
//
// Who gives both in one file contradicts himself, and is refused. Where they come from different places, the key may be
// inherited, from a base or from the case that a study or --set changes: then the run says that it was not used. A
// default says nothing, nor does a file that has every key, as a resolved case and a scaled twin have: it says what is.
#include "case/case_idle.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/name.h"
#include "case/case_check.h"
#include "case/case_derived.h"
#include "case/schema.h"
#include "case/warning.h"

/// Keys that are not used.
typedef struct idle {
    bool so;
    const char *keys;  ///< separated by blanks
    const char *cause; ///< the keys that make them so, separated by blanks
    const char *why;   ///< completes "has no effect "
} idle;

#define BRANCH2                                                                                                        \
    "tow.branch2.hull_x tow.branch2.hull_y tow.branch2.length tow.branch2.stiffness tow.branch2.damping "              \
    "tow.branch2.breaking_load"

enum { RULES = 26 };

static void list(const bt_case *c, idle out[RULES])
{
    const bool read = bt_case_reads_field(c), power = c->ice.size_law == BT_SIZE_POWER;
    // of ice that is read a moving window has its room in floes of ice.size (case_window.c)
    const bool sized = c->domain.ends == BT_BOUND_MOVING;
    const bool line = c->tow.mode == BT_TOW_LINE || c->tow.mode == BT_TOW_THRUST;
    const bool walls = c->domain.ends == BT_BOUND_WALL || c->domain.sides == BT_BOUND_WALL;
    const char *source = c->ice.field ? "ice.field" : "ice.outlines";
    const idle all[RULES] = {
        {read, "ice.concentration ice.shape ice.sides ice.aspect ice.size_law ice.size_spread ice.size_min "
               "ice.size_max ice.size_exponent ice.shake ice.extent.x_min ice.extent.x_max ice.extent.y_min "
               "ice.extent.y_max",
         source, "on ice that is read from a file"},
        {read && !sized, "ice.size", source, "on ice that is read from a file"},
        {c->ice.field, "ice.thickness_law ice.thickness_spread", "ice.field",
         "on the floes of a field file, which have thicknesses of their own"},
        {c->ice.field && c->n_floes == 0, "ice.thickness", "ice.field",
         "on the floes of a field file, which have thicknesses of their own"},
        {c->ice.field, "ice.x_min ice.x_max ice.y_min ice.y_max", "ice.field",
         "on a field file, which has its own ice region"},
        {!c->ice.field && c->ice.thickness_law == BT_THICK_CONSTANT, "ice.thickness_spread", "ice.thickness_law",
         "with ice.thickness_law: constant"},
        {!read && c->ice.size_law == BT_SIZE_SINGLE, "ice.size_min ice.size_max", "ice.size_law",
         "with ice.size_law: single"},
        {!read && !power, "ice.size_exponent", "ice.size_law", "without ice.size_law: power"},
        {!read && power, "ice.size ice.size_spread", "ice.size_law",
         "with ice.size_law: power, whose sizes follow from ice.size_min, size_max and size_exponent"},
        {!read, c->ice.shape == BT_ICE_RECTANGLES ? "ice.sides"
                : c->ice.shape == BT_ICE_POLYGONS ? "ice.aspect"
                                                  : "ice.sides ice.aspect",
         "ice.shape", "on floes of this ice.shape"},
        {!(c->ice.crushing_pressure > 0), "ice.crushing.least_length", "ice.crushing.pressure",
         "on ice that is not crushed (ice.crushing.pressure)"},
        {!(c->ice.splitting.toughness > 0),
         "ice.splitting.strength ice.splitting.least_size ice.splitting.generations ice.splitting.aspect "
         "ice.splitting.reserve ice.splitting.scatter",
         "ice.splitting.toughness", "on floes that do not split (ice.splitting.toughness)"},
        {c->body.shape == BT_BODY_POLYGON, "body.length body.width", "body.shape",
         "on the waterline of body.vertices (body.shape: polygon)"},
        {c->body.shape == BT_BODY_ABSENT,
         "body.length body.width body.x body.y body.yaw body.yaw_rate body.draft body.sail body.density "
         "body.mass body.added_mass body.added_inertia body.friction body.restitution body.drag.water_form "
         "body.drag.water_skin body.drag.air_form body.drag.air_skin body.drag.tangential",
         "body.shape", "without a towed body (body.shape: none)"},
        {c->body.shape == BT_BODY_ABSENT, "tow.ramp tow.direction impact.panels output.panels", "body.shape",
         "without a body that is towed (body.shape: none)"},
        {c->body.shape != BT_BODY_ABSENT && c->tow.mode == BT_TOW_NONE, "tow.ramp", "tow.mode",
         "on a body that is not towed (tow.mode: none)"},
        {!line, "tow.line_length tow.line_stiffness tow.line_damping tow.hull_x tow.hull_y tow.line.type "
                "tow.line.diameter tow.line.branches tow.line.breaking_load tow.line.weight " BRANCH2,
         "tow.mode", "without a line, which tow.mode: line and thrust have"},
        {line && c->tow.line.branches < 2, BRANCH2, "tow.line.branches", "on a single line (tow.line.branches)"},
        {c->tow.mode != BT_TOW_THRUST, "tow.vessel.mass tow.vessel.added_mass tow.vessel.bollard_pull "
                                       "tow.vessel.free_speed tow.vessel.free_resistance tow.vessel.lateral_drag "
                                       "tow.vessel.lookahead",
         "tow.mode", "without a vessel, which tow.mode: thrust has"},
        {c->lead.mode == BT_LEAD_NONE, "lead.width lead.length lead.floe_size", "lead.mode",
         "without a lead (lead.mode)"},
        {c->lead.mode == BT_LEAD_CHANNEL, "lead.floe_size", "lead.mode", "on a channel, in which no pieces are left"},
        {!(c->water.tide.major > 0), "water.tide.inclination water.tide.period water.tide.phase", "water.tide.major",
         "without a tide (water.tide.major)"},
        {!walls, "domain.wall_friction domain.wall_restitution", "domain.ends domain.sides",
         "without walls (domain.ends, domain.sides)"},
        {c->impact.conversion != BT_IMPACT_DURATION, "impact.duration", "impact.conversion",
         "without impact.conversion: duration"},
        {c->impact.conversion != BT_IMPACT_CRUSHING, "impact.pressure impact.corner impact.corner_angle",
         "impact.conversion", "without impact.conversion: crushing"},
        {c->impact.conversion == BT_IMPACT_NONE, "impact.least_speed", "impact.conversion",
         "where collisions are not told apart (impact.conversion)"},
    };
    memcpy(out, all, sizeof all);
}

static const bt_key *row_of(const char *key)
{
    return &bt_case_keys[bt_schema_find(bt_case_keys, bt_n_case_keys, key)];
}

static size_t size_of(const bt_key *k)
{
    return k->type == BT_KEY_REAL ? sizeof(double) : k->type == BT_KEY_INT ? sizeof(int64_t) : sizeof(int);
}

/// A case with a key of a number or a choice at its default, all others as they are. No memory of its own.
static bt_case with_default(const bt_case *c, const bt_key *k)
{
    bt_case d = *c;
    bt_schema_preset(k, 1, &d);
    bt_case_fill(&d);
    return d;
}

bool bt_case_is_unused(const bt_case *c, const char *key)
{
    idle rules[RULES];
    char name[BT_LONGEST_KEY];
    list(c, rules);
    for (int i = 0; i < RULES; i++)
        for (const char *keys = rules[i].keys; rules[i].so && bt_next_name(&keys, name);)
            if (!strcmp(name, key)) return true;
    return false;
}

bool bt_case_changed(const bt_case *c, const char *key)
{
    const bt_key *k = row_of(key);
    const void *at = (const char *)c + k->offset;
    double value = 0;
    if (k->type == BT_KEY_REAL) memcpy(&value, at, sizeof value);
    const bt_case d = with_default(c, k);
    return !isnan(value) && memcmp(at, (const char *)&d + k->offset, size_of(k)) != 0;
}

/// Calls found for each key that is not used although its value is not the default.
static void look(const bt_case *c, void (*found)(void *to, const char *key, const idle *r), void *to)
{
    idle rules[RULES];
    char name[BT_LONGEST_KEY];
    list(c, rules);
    for (int i = 0; i < RULES; i++)
        for (const char *keys = rules[i].keys; rules[i].so && bt_next_name(&keys, name);)
            if (bt_case_changed(c, name)) found(to, name, &rules[i]);
}

/// Does the file in which the key stands have more than half of all keys? Nobody writes so many by hand.
static bool says_all(const bt_check *k, const char *key)
{
    int n = 0;
    for (int i = 0; i < bt_n_case_keys; i++)
        n += k->from[i].line > 0 && !strcmp(bt_check_file(k, bt_case_keys[i].name), bt_check_file(k, key));
    return 2 * n > bt_n_case_keys;
}

static void refuse(void *to, const char *key, const idle *r)
{
    const bt_check *k = to;
    if (says_all(k, key) || !bt_check_sound(k, key) || !bt_check_sound(k, r->cause)) return;
    const char *causes = r->cause;
    char cause[BT_LONGEST_KEY];
    while (bt_next_name(&causes, cause))
        if (!bt_check_together(k, key, cause)) return;
    causes = r->cause;
    bt_next_name(&causes, cause); // the first is the one to change
    bt_check_fault(k, key, "has no effect %s; remove the key, or change %s", r->why, cause);
}

void bt_case_check_idle(const bt_check *k)
{
    if (k->from) look(k->c, refuse, (void *)k);
}

/// Keys of one reason in a row, so that one warning says them.
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

static void gather(void *to, const char *key, const idle *r)
{
    warning *w = to;
    if (w->why != r->why) put(w);
    w->why = r->why;
    const size_t n = strlen(w->names);
    snprintf(w->names + n, sizeof w->names - n, "%s%s", n ? ", " : "", key);
}

void bt_case_warn_idle(const bt_case *c, bt_errors *warnings)
{
    warning w = {.warnings = warnings};
    look(c, gather, &w);
    put(&w);
}

static void mark(void *to, const char *key, const idle *r)
{
    (void)r;
    ((bool *)to)[row_of(key) - bt_case_keys] = true;
}

void bt_case_mark_idle(const bt_case *c, bool *idle_key) { look(c, mark, idle_key); }

void bt_case_put_default(bt_case *c, int key)
{
    const bt_key *k = &bt_case_keys[key];
    const bt_case d = with_default(c, k);
    memcpy((char *)c + k->offset, (const char *)&d + k->offset, size_of(k));
}

// --- of the frames ---------------------------------------------------------------------------------------------------

// Defaults that the frame of a case decides on.
//
// A row of the table of keys says with at_sea that its default is a model basin's. In the geographic frame such a
// number would look like an answer: there it is none until the case gives it, or another key does (a programme the
// speed, a named line its stiffness). Where it is then still none and has an effect, the case is refused. Other
// defaults hold in both frames, or follow from the scene in the geographic one (case_fill.c, case_tow.c).

static double *number(bt_case *c, const bt_key *k) { return (double *)(void *)((char *)c + k->offset); }

static bool is_basin(const bt_case *c) { return c->domain.frame == BT_FRAME_BASIN; }

/// May the run use the value of this key?
static bool is_used(const bt_case *c, const char *key, bool by_hand)
{
    if (bt_case_is_unused(c, key)) return false;
    if (!strcmp(key, "ice.thickness")) return bt_case_makes_ice(c) || by_hand || c->ice.outlines;
    if (!strcmp(key, "tow.speed")) return c->body.shape != BT_BODY_ABSENT && c->tow.mode != BT_TOW_NONE;
    return true;
}

void bt_case_frame_clear(const bt_check *k, bool by_hand)
{
    if (!k->from || is_basin(k->c)) return;
    for (int i = 0; i < bt_n_case_keys; i++) {
        const bt_key *row = &bt_case_keys[i];
        if (!row->at_sea || row->type != BT_KEY_REAL || bt_check_given(k, row->name)) continue;
        if (is_used(k->c, row->name, by_hand)) *number(k->c, row) = NAN;
    }
}

static bool is_missing(const bt_check *k, const bt_key *row)
{
    if (row->type == BT_KEY_REAL) return isnan(*number(k->c, row));
    return k->from && !is_basin(k->c) && !bt_check_given(k, row->name);
}

/// geojson.c asks for a thickness where outlines lack one.
static bool may_miss(const bt_case *c, const char *key, bool by_hand)
{
    return !strcmp(key, "ice.thickness") && c->ice.outlines && !by_hand;
}

void bt_case_frame_check(const bt_check *k, bool by_hand)
{
    bt_case *c = k->c;
    if (!bt_check_sound(k, "domain.frame")) return;
    for (int i = 0; i < bt_n_case_keys; i++) {
        const bt_key *row = &bt_case_keys[i];
        if (!row->at_sea || !bt_check_sound(k, row->name) || !is_missing(k, row)) continue;
        if (!is_used(c, row->name, by_hand)) { // a number without effect that is given as none
            bt_schema_preset(row, row->type == BT_KEY_REAL, c);
            continue;
        }
        if (may_miss(c, row->name, by_hand)) continue;
        if (is_basin(c)) bt_check_fault(k, row->name, "is none where a value is needed; give it (%s)", row->at_sea);
        else
            bt_check_fault(k, row->name,
                           "missing, and in domain.frame: geographic it has no default (that would be a model "
                           "basin's); add it (%s)",
                           row->at_sea);
        if (k->from) k->from[i].faulty = true;
    }
}
