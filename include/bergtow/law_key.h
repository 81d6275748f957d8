// SPDX-License-Identifier: MIT
// Keys of a case that a program adds: those of a law (bergtow/forces.h, bergtow/contact.h), or of its own.
// How to add one, also to bergtow itself: docs/how-to-add-a-key.md.
#ifndef BERGTOW_LAW_KEY_H
#define BERGTOW_LAW_KEY_H

#include <stdbool.h>

#include "bergtow/case.h"

BT_BEGIN_C

/// An added key: always a real number.
typedef struct bt_law_key {
    const char *name;          ///< the key is NAME.name, with NAME of the law or section
    /// SI symbol: "m", "m/s", "s", "rad", "rad/s", "N", "kg", "kg/m3", "N s/m", "Pa", "N/m",
    /// "Pa m^0.5"; "" = a plain number
    const char *unit;
    /// "0 N", "[0, 1e9]": with its presets the law should do nothing. The range is that of a number written without a
    /// unit, which is in `unit`, but in degrees (per second) for rad (rad/s)
    const char *preset, *range;
    const char *doc;           ///< one sentence
} bt_law_key;

/// Add keys SECTION.name, before any case is read and from one thread; laws do so by their own registration. They are
/// read, checked, listed by --list-keys, written to the resolved case and scaled like all others. False if any was
/// rejected: reason and remedy in err. The texts must remain valid. A program can add BT_EXTRA_KEYS keys, including
/// those of laws.
bool bt_keys_add(const char *section, const bt_law_key *keys, int n, bt_errors *err);

/// Get the values of added keys, own [n], in SI units. The keys must have been added (bt_keys_add) before `input` was
/// read; otherwise the result is undefined.
void bt_keys_get(const bt_case *input, const char *section, const bt_law_key *keys, int n, double *own);

BT_END_C

#endif
