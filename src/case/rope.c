// SPDX-License-Identifier: MIT
// The table of tow lines; see case/rope.h.
#include "case/rope.h"

static const struct {
    const char *name, *source;
    double mass_d2, breaking_d2, breaking_d3; // kg/m³, N/m², N/m³
    double ea_d2, ea_per_breaking;            // N/m², 1
} ropes[] = {
    [BT_ROPE_NUMBERS] = {"by its numbers", "case", 0, 0, 0, 0, 0},
    [BT_ROPE_STEEL] = {"steel wire, 6x19 with wire core", "Orcina, OrcaFlex manual, Rope/Wire", 3989.7, 633358e3, 0,
                       4.04e10, 0},
    [BT_ROPE_POLYPROPYLENE] = {"polypropylene, 8-strand", "Orcina, OrcaFlex manual, Rope/Wire", 452.6, 105990e3, 0,
                               1.06e9, 0},
    [BT_ROPE_DYNEEMA] = {"Dyneema (HMPE)", "MoorPy property library, NREL", 496, 580e6, 651e6, 0, 56},
};

bt_rope bt_rope_named(bt_rope_type type, double d)
{
    const double breaking = (ropes[type].breaking_d2 + ropes[type].breaking_d3 * d) * d * d;
    return (bt_rope){.name = ropes[type].name,
                     .source = ropes[type].source,
                     .mass = ropes[type].mass_d2 * d * d,
                     .stiffness = ropes[type].ea_d2 * d * d + ropes[type].ea_per_breaking * breaking,
                     .breaking = breaking};
}
