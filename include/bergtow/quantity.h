// SPDX-License-Identifier: MIT
// Quantities: the numbers that a run keeps of every step, each registered once, with all that a reader needs.
//
// A registered quantity is
//     a series            /series/NAME of result.h5, with units, description, merge, applies, role, label as attributes
//     a number            KEY of summary.json: its reduction over the window (over all steps where nothing is towed)
//     a column of members /summary/KEY of ensemble.h5
//     a line or a panel   of the pictures, and a row of the report, by its role
//     part of the state   a run that was killed and resumed has the same numbers, bit for bit
//     a line              of `bergtow --list-quantities`
// and none of these places knows its name. How to add one: docs/how-to-add-a-quantity.md.
#ifndef BERGTOW_QUANTITY_H
#define BERGTOW_QUANTITY_H

#include "bergtow/world.h"

BT_BEGIN_C

enum { BT_MAX_ADDED = 32 }; ///< most quantities besides the program's own

/// How steps merge into an entry of the series, and those of the window into the summary.
typedef enum { BT_KEEP_LAST, BT_KEEP_MEAN, BT_KEEP_MAX, BT_KEEP_SUM } bt_keep;
enum { BT_KEEP_KINDS = BT_KEEP_SUM + 1 };

/// The feature that a run must have for a number to be defined. Without it the number is NaN; with it, never.
typedef enum {
    BT_APPLIES_ALWAYS, BT_APPLIES_BODY, BT_APPLIES_LINE, BT_APPLIES_BRIDLE, BT_APPLIES_VESSEL, BT_APPLIES_IMPACTS,
    BT_APPLIES_WINDOW, BT_APPLIES_KINDS
} bt_applies;

/// Where pictures and reports show it.
typedef enum {
    BT_ROLE_NONE,
    /// a force against the tow that the momentum balance of the towed body adds up (tow and inertia included)
    BT_ROLE_BALANCE,
    BT_ROLE_FORCE,      ///< a force on the towed body against the tow that is part of another force
    BT_ROLE_LOAD,       ///< a load of the line or the vessel
    BT_ROLE_DIAGNOSTIC, ///< a separate panel beside those of the contact solver
    BT_ROLE_KINDS
} bt_role;

extern const char *const bt_keep_names[BT_KEEP_KINDS];       ///< "last", "mean", "max", "sum"
extern const char *const bt_applies_names[BT_APPLIES_KINDS]; ///< "with a tow line", for readers
extern const char *const bt_applies_codes[BT_APPLIES_KINDS]; ///< "line", for programs
extern const char *const bt_role_names[BT_ROLE_KINDS];       ///< "balance"; "" for none

typedef struct bt_quantity {
    const char *name;        ///< of the series: lower case, digits and _
    const char *units;       ///< SI; "1" for a number
    const char *description; ///< a sentence
    const char *label;       ///< in legends and tables; NULL = the name in words
    bt_keep keep;
    bt_applies applies;
    bt_role role;
    /// key of its reduction in summary.json, NULL = none; for a registered one made from name and units
    const char *summary;
    // one of the next two
    /// From data on every rank: the towed body, the tow, the numbers of the step. Called after the step, on every rank,
    /// with the same result.
    double (*of_world)(const bt_world *world, const void *context);
    /// The contribution of one movable floe; not called for fixed floes, walls and the towed body. The sum over all is
    /// exact: the same bits on any number of ranks and threads.
    double (*of_floe)(const bt_world *world, bt_idx floe, const void *context);
    const void *context;     ///< of the functions
    size_t offset;           ///< in bt_sample; set by registration
} bt_quantity;

/// Add a quantity, to be recorded in runs that begin later. It is copied; its texts and context must outlive every run.
/// Errors: BT_ERR_USAGE, with the reason in err: a missing or used name, no unit, no sentence, no function, no room.
bt_status bt_quantity_register(const bt_quantity *quantity, bt_errors *err);

/// Number of series: the program's own, then the registered ones.
int bt_n_series(void);
/// The k-th series, from 0, in the order of the file.
const bt_quantity *bt_series(int k);
/// A series by name, NULL if there is none.
const bt_quantity *bt_series_find(const char *name);

/// Number of registered series, the last ones.
int bt_n_added(void);
/// The k-th of these, from 0.
const bt_quantity *bt_added(int k);

/// "tow - drag - Coriolis - tilt - ... - inertia": the ice resistance by the balance of the towed body, in the labels
/// of the series with role BT_ROLE_BALANCE. Made anew whenever quantities are added; not thread-safe.
const char *bt_balance_words(void);

BT_END_C

#endif
