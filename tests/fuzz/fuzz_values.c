// SPDX-License-Identifier: MIT
// Any keys of a small case set to any values within their ranges, the ends included: what the schema lets through one
// by one must do no harm together.
//
// The input: a byte for the base case, then a key and a place in its range, a byte each.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fuzz.h"
#include "case/schema.h"

static const char *const bases[] = {
    "run: {dt: 0.1, duration: 1}\ndomain: {length: 9, width: 6}\nice: {concentration: 0.4, size: 1}\nbody: {x: 3, "
    "length: 1}\ntow: {speed: 0.1, ramp: 0}\n",
    ("run: {dt: 1, duration: 20}\ndomain: {frame: geographic, length: 300, width: 200, ends: open, sides: periodic}\n"
     "ice: {concentration: 0.4, size: 40, shape: rectangles, thickness: 1}\nbody: {shape: ship, length: 40, width: 15, "
     "draft: 0.5}\n"
     "tow: {mode: thrust, speed: 1, line_length: 40, line_stiffness: 1 MN, vessel: {mass: 500 t, bollard_pull: "
     "900 kN, free_speed: 7}}\nwater: {latitude: 75}\n"),
    ("run: {dt: 0.5, duration: 20}\ndomain: {length: 40, width: 10, ends: moving}\nice: {concentration: 0.3, size: 3, "
     "size_law: power, size_min: 2, size_max: 5}\n"
     "body: {length: 2}\ntow: {mode: line, speed: 0.3}\nlead: {mode: managed, floe_size: 1}\n"),
};
enum { N_BASES = sizeof bases / sizeof *bases, MOST = 12 };

/// The place 0 ... 255 of a range: its ends, and between them by size, so that 1e-6 and 1e6 are as near as each other.
static double place(const bt_key *k, int at)
{
    bt_range r;
    bt_value_range(k, &r);
    const double lo = isfinite(r.lo) ? r.lo : -1e300, hi = isfinite(r.hi) ? r.hi : 1e300;
    if (at == 0) return r.lo_open ? lo + 1e-12 * (hi - lo) : lo;
    if (at == 255) return r.hi_open ? hi - 1e-12 * (hi - lo) : hi;
    const double s = (at - 1) / 253.0, top = log10(bt_max(fabs(lo), fabs(hi)));
    const double x = lo < 0 ? (at & 1 ? -1 : 1) * pow(10, -6 + s * (top + 6)) : pow(10, -9 + s * (top + 9));
    return bt_min(hi, bt_max(lo, x));
}

static char *setting(const bt_key *k, int at)
{
    char *text = NULL, number[64];
    double x;
    int n = 0;
    switch (k->type) {
    case BT_KEY_REAL:
        x = place(k, at); // in SI
        bt_units_format(x, k->unit, number, sizeof number);
        n = asprintf(&text, "%s=%s", k->name, number);
        break;
    case BT_KEY_INT: n = asprintf(&text, "%s=%.0f", k->name, floor(place(k, at))); break;
    case BT_KEY_BOOL: n = asprintf(&text, "%s=%s", k->name, at & 1 ? "true" : "false"); break;
    case BT_KEY_CHOICE: {
        int count = 0;
        while (k->choices[count]) count++;
        n = asprintf(&text, "%s=%s", k->name, k->choices[at % count]);
        break;
    }
    default: break; // texts name files, lists of points are left to the case files
    }
    bt_fuzz_check(n >= 0, "no memory");
    return text;
}

void bt_fuzz_values(const uint8_t *data, size_t n)
{
    if (n < 1) return;
    const char *base = bases[data[0] % N_BASES];
    char *set[MOST];
    int n_set = 0;
    for (size_t i = 1; i + 1 < n && n_set < MOST; i += 2) {
        char *text = setting(&bt_case_keys[data[i] % bt_n_case_keys], data[i + 1]);
        if (text) set[n_set++] = text;
    }
    if (getenv("BT_FUZZ_TELL"))
        for (int i = 0; i < n_set; i++) fprintf(stderr, "base %d --set %s\n", data[0] % N_BASES, set[i]);
    bt_fuzz_begin_run((const uint8_t *)base, strlen(base), (const char *const *)set, n_set);
    for (int i = 0; i < n_set; i++) free(set[i]);
}
