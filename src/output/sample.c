// SPDX-License-Identifier: MIT
// The program's own series: the rows of series.inc as quantities.
#include "output/sample.h"
#include "case/cost.h"
#include "tow/tow.h"

#define PARTS(name_, applies_, keep_, units_, text_, role_, label_, key_)                                              \
    .name = #name_, .units = units_, .description = text_, .offset = offsetof(bt_sample, name_),                       \
    .keep = BT_KEEP_##keep_, .applies = BT_APPLIES_##applies_, .role = BT_ROLE_##role_, .label = label_, .summary = key_
#define SHOWN(...) {PARTS(__VA_ARGS__)},
#define ROW(...) {PARTS(__VA_ARGS__, NONE, NULL, NULL)},

// --- rows with the place of their number; observe.c forms the others -------------------------------------------------

/// The place of a number in the world.
typedef struct {
    size_t offset;
    enum { REAL, WHOLE, FLAG, NO_FLAG } kind; ///< NO_FLAG: 1 if false
} place;

static double at_place(const bt_world *world, const void *context)
{
    const place *p = context;
    const void *at = (const char *)world + p->offset;
    switch (p->kind) {
    case WHOLE: return (double)*(const int64_t *)at;
    case FLAG: return *(const bool *)at;
    case NO_FLAG: return !*(const bool *)at;
    default: return *(const double *)at;
    }
}

double bt_force_against(const bt_world *world, int k)
{
    const bt_impulse *j = &world->forces->series[k];
    return 0.0 - (j->x * world->tow->ux + j->y * world->tow->uy) / world->par.dt; // 0 − x avoids −0 in open water
}

double bt_force_of(const bt_world *world, const void *series)
{
    return bt_force_against(world, bt_force_series_find(series));
}

#define PLACE(at_, kind_) .of_world = at_place, .context = &(const place){offsetof(bt_world, at_), kind_}
#define AT(at_, ...)                                                                                                   \
    {PARTS(__VA_ARGS__), PLACE(at_, _Generic(((bt_world *)0)->at_, double: REAL, int64_t: WHOLE, bool: FLAG))},
#define UNLESS(at_, ...) {PARTS(__VA_ARGS__), PLACE(at_, NO_FLAG)},
#define FORCE(series_, ...) {PARTS(series_##_force, __VA_ARGS__), .of_world = bt_force_of, .context = #series_},

const bt_quantity bt_own_series[] = {
#include "output/series.inc"
};

const int bt_n_own_series = sizeof bt_own_series / sizeof *bt_own_series;

_Static_assert(sizeof bt_own_series / sizeof *bt_own_series <= BT_COST_SERIES + 8,
               "what check says of the disk counts them");
