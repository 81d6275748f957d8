// SPDX-License-Identifier: MIT
// The numbers of one step of a run, and the registry of their series. It determines the series of result.h5, their
// texts and the data that the summary keeps.
#ifndef BT_SAMPLE_H
#define BT_SAMPLE_H

#include <string.h>

#include "bergtow/forces.h"
#include "bergtow/quantity.h"

/// The numbers of one step for the recorder. Forces on the towed body are means over the step (impulse / Δt). "Along"
/// is the tow direction; resisting components are positive against it, so that
/// tow = ice + drag + Coriolis + tilt + other laws + inertia.
typedef struct bt_sample {
#define ROW(member, ...) double member;
#define SHOWN(member, ...) double member;
#define AT(place, member, ...) double member;
#define UNLESS(place, member, ...) double member;
#define FORCE(series, ...) double series##_force;
#include "output/series.inc"
#undef ROW
#undef SHOWN
#undef AT
#undef UNLESS
#undef FORCE
    double laws[BT_MAX_LAW_NUMBERS]; ///< of the contact laws, as in bt_step_stats
    double added[BT_MAX_ADDED]; ///< [bt_n_added()] of the registered quantities
} bt_sample;

/// The program's own series, one for each member of a sample except `laws` and `added`; those of the contact laws come
/// before the last BT_SERIES_AFTER_LAWS. bt_series has all of them.
extern const bt_quantity bt_own_series[];
extern const int bt_n_own_series;
enum { BT_SERIES_AFTER_LAWS = 3 };
/// Number of series before the first registered one.
int bt_n_program_series(void);

/// Force of series k (bt_force_series_of) on the towed body against the tow direction in the step just solved, N.
double bt_force_against(const bt_world *world, int k);

/// The same by the name of the series; of_world of a quantity whose context is that name.
double bt_force_of(const bt_world *world, const void *series);

/// The number of a sample that belongs to a quantity.
static inline double bt_sample_value(const bt_sample *sample, const bt_quantity *quantity)
{
    double value;
    memcpy(&value, (const char *)sample + quantity->offset, sizeof value);
    return value;
}

static inline void bt_sample_set(bt_sample *sample, const bt_quantity *quantity, double value)
{
    memcpy((char *)sample + quantity->offset, &value, sizeof value);
}

/// Larger than any quantity of a run, and small enough for sums of squares in the statistics.
#define BT_SAMPLE_MOST 1e100

/// The first quantity that applies but is not a number below BT_SAMPLE_MOST, or does not apply but is a number; NULL if
/// the sample is sound.
/// has: bit 1 << k for each bt_applies k of the run.
const bt_quantity *bt_sample_fault(const bt_sample *sample, unsigned has);

/// Set to NaN the contact forces of a step in which the load of the towed body is unbounded (solve/islands.h), at a
/// prescribed speed also the tow force; on a line that stays a number.
void bt_sample_lose_load(bt_sample *sample, bool prescribed);

#endif
