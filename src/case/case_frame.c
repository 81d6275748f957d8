// SPDX-License-Identifier: MIT
// Defaults that the frame of a case decides on.
//
// A row of the table of keys says with at_sea that its default is a model basin's. In the geographic frame such a
// number would look like an answer: there it is none until the case gives it, or another key does (a programme the
// speed, a named line its stiffness). Where it is then still none and has an effect, the case is refused. Other
// defaults hold in both frames, or follow from the scene in the geographic one.
#include "case/case_frame.h"

#include <math.h>
#include <string.h>

#include "bergtow/shape.h"
#include "case/case_check.h"
#include "case/case_derived.h"
#include "case/case_idle.h"
#include "case/schema.h"

static const double LINE_DAMPING = 0.03; // of critical, assumed
static const double REST_SPEED = 0.01;   // of the reference speed, assumed; in the basin 1e-3 m/s of 0.13 m/s

static double *number(bt_case *c, const bt_key *k) { return (double *)(void *)((char *)c + k->offset); }

static bool is_basin(const bt_case *c) { return c->domain.frame == BT_FRAME_BASIN; }

double bt_case_frame_size(const bt_case *c)
{
    if (is_basin(c) || bt_case_makes_ice(c) || bt_case_reads_field(c)) return NAN; // that is asked for
    double v[2 * BT_MAX_VERTICES], sum = 0;
    for (bt_idx i = 0; i < c->n_floes; i++) {
        const int n = bt_case_floe_outline(&c->floes[i], v);
        if (n) sum += sqrt(4 / BT_PI * bt_shape_moments(n, v).area);
    }
    if (sum > 0) return sum / c->n_floes;
    const int n = bt_case_waterline(c, v);
    return n ? sqrt(4 / BT_PI * bt_shape_moments(n, v).area) : 1; // of no bodies: without effect
}

double bt_case_frame_damping(const bt_case *c)
{
    if (is_basin(c)) return 100;
    const double stiffness = c->tow.line_stiffness / c->tow.line_length, period = bt_case_line_period(c);
    // 2 ζ k/ω of each of parallel lines makes 2 ζ M ω of them all
    return period > 0 ? LINE_DAMPING * stiffness * period / BT_PI : 0;
}

double bt_case_frame_rest_speed(const bt_case *c)
{
    return is_basin(c) ? 1e-3 : REST_SPEED * bt_case_reference_speed(c);
}

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
        if (!is_used(c, row->name, by_hand) || may_miss(c, row->name, by_hand)) continue;
        if (is_basin(c)) bt_check_fault(k, row->name, "is none where a value is needed; give it (%s)", row->at_sea);
        else
            bt_check_fault(k, row->name,
                           "missing, and in domain.frame: geographic it has no default (that would be a model "
                           "basin's); add it (%s)",
                           row->at_sea);
        if (k->from) k->from[i].faulty = true;
    }
}
