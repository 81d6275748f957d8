// SPDX-License-Identifier: MIT
// Keys of a case that belong to a law: of a force (bergtow/forces.h) or of contact (bergtow/contact.h).
#ifndef BERGTOW_LAW_KEY_H
#define BERGTOW_LAW_KEY_H

/// A key of a law's own: always a real number.
typedef struct bt_law_key {
    const char *name;          ///< after the name of the law: the key is NAME.name
    /// SI symbol: "m", "m/s", "s", "rad", "rad/s", "N", "kg", "kg/m3", "N s/m", "Pa", "N/m"; "" = a plain number
    const char *unit;
    /// "0 N", "[0, 1e9]" (least and most of a bare number): the law should do nothing by its presets
    const char *preset, *range;
    const char *doc;           ///< one sentence
} bt_law_key;

#endif
