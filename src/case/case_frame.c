// SPDX-License-Identifier: MIT
// Defaults that the frame of a case decides on.
//
// A row of the table of keys says with at_sea that its default is a model basin's. In the geographic frame such a
// number would look like an answer: there it is none until the case gives it, or another key does (a programme the
// speed, a named line its stiffness). Where it is then still none and has an effect, the case is refused. Other
// defaults hold in both frames, or follow from the scene in the geographic one (case_fill.c, case_tow.c).
#include "case/case_frame.h"

#include <math.h>
#include <string.h>

#include "case/case_derived.h"
#include "case/case_idle.h"
#include "case/schema.h"

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
