// SPDX-License-Identifier: MIT
// Numbers with units as people write them in a case file: "30 m", "1.5 kn", "0.8 %".
#ifndef BERGTOW_UNITS_H
#define BERGTOW_UNITS_H

#include <stdbool.h>
#include <stddef.h>

typedef enum {
    BT_UNIT_NONE,     ///< a plain number
    BT_UNIT_RATIO,    ///< a plain number that may be written in %
    BT_UNIT_LENGTH,   ///< m
    BT_UNIT_SPEED,    ///< m/s
    BT_UNIT_TIME,     ///< s
    BT_UNIT_ANGLE,    ///< rad inside; a bare number in a file is degrees
    BT_UNIT_TURN,     ///< rad/s inside; a bare number in a file is degrees a second
    BT_UNIT_FORCE,    ///< N
    BT_UNIT_MASS,     ///< kg
    BT_UNIT_DENSITY,  ///< kg/m3
    BT_UNIT_DAMPING,  ///< N s/m
    BT_UNIT_PRESSURE, ///< Pa
    BT_UNIT_LINE_LOAD, ///< N/m
    BT_UNIT_TOUGHNESS, ///< Pa m^0.5
    BT_UNIT_KINDS
} bt_unit;

/// Longest message of bt_units_parse and bt_value_read.
#define BT_WHY 320

/// Read the whole text as a number with an optional unit of this kind; value: in SI (angles in radians). Refused: a
/// unit of another kind, text after the number that is not a unit, hexadecimal, NaN, infinity, overflow. On refusal
/// `why` gives the reason and the remedy.
bool bt_units_parse(const char *text, bt_unit kind, double *value, char why[BT_WHY]);

/// Shortest decimal form, at most 17 digits, that reads back to the same bits, with the unit, as in "0.1 s"; NaN gives
/// "none". Independent of the locale. Returns the length.
int bt_units_format(double value, bt_unit kind, char *out, size_t size);

/// A unit that can be read: value in SI = number · up / down.
typedef struct bt_unit_entry {
    const char *symbol;
    bt_unit kind;
    double up, down;
} bt_unit_entry;
/// The k-th unit; false if there are fewer.
bool bt_units_entry(int k, bt_unit_entry *out);

/// Exponent a with which a quantity of this kind scales, as L^a, by the length ratio L at the same Froude number, with
/// densities and gravity kept.
double bt_units_froude(bt_unit kind);

const char *bt_units_symbol(bt_unit kind); ///< SI symbol of a formatted value, "" for plain numbers
const char *bt_units_bare(bt_unit kind);   ///< unit of a number written without one, "-" for plain numbers

/// A force to four digits, in N, kN, MN, GN or TN, with at most three digits before the point; returns out.
const char *bt_force_text(char out[32], double newton);

#endif
