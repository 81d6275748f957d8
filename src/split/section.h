// SPDX-License-Identifier: MIT
// A section through a floe: a chord of its outline, and what it has to carry.
//
// A rigid floe under contact forces f_k at x_k moves so that its inertia balances them, whatever its material. With the
// centroid at the origin, F = Σ f_k, T = Σ x_k × f_k, area A and J = ∫ r² dA, a force
//     q(x) = −F/A − (T/J) k × x
// per area balances the contacts: the share of added mass and inertia cancels, as both are a part of the body's own.
// (Left out: drag, whose stress is a thousandth of the others'.) A chord from a along the unit vector d, n = d turned
// left, m its middle, l its length; the part 1 on its left has the area A1, S1 = ∫ x dA and J1 = ∫ r² dA, about the
// parent's centroid. The part is in balance under its contacts, q and the tractions of the section, hence
//     Q_b = −F A1/A − (T/J) k × S1
//     N = (Σ₁ f_k + Q_b) . n                                       tension > 0
//     M = Σ₁ (x_k − m) × f_k + S1 × (−F/A) − (T/J) J1 − m × Q_b    opens the end b > 0
// and with a linear stress over the section N/(h l) − 6 M/(h l²) at a, N/(h l) + 6 M/(h l²) at b.
//
// A load on the section counts half to each side. One that acts on a length w is two half loads at ±w/4 along the
// edge: for a section at its middle that is exact for an even pressure, F w/8 of bending.
//
// An outline need not be convex: a section is the piece of the line inside it that begins at a.
#ifndef BT_SPLIT_SECTION_H
#define BT_SPLIT_SECTION_H

#include "split/law.h"

#include "bergtow/shape.h"

/// A place on an outline: on the edge from vertex `edge` to the next, at share t of it from 0 to below 1; 0 is the
/// vertex itself. The same in every frame the outline is turned into.
typedef struct bt_chord_end {
    int edge;
    double t;
} bt_chord_end;

/// A section: from a to b through the inside. Left of it lies what the outline goes round from b to a, anticlockwise.
typedef struct bt_chord { bt_chord_end a, b; } bt_chord;

/// A floe as the law sees it.
typedef struct bt_split_floe {
    int n;                 ///< vertices
    const double *outline; ///< [n][2] m, anticlockwise, centroid at the origin
    bool convex;
    double thickness;      ///< h, m
    double factor;         ///< of the strength (bt_split_scatter), 1 = the law's
} bt_split_floe;

/// A load, moved to the nearest place of the outline: a contact pushes across the edge, so that it slides along its own
/// line of action, and each is on one side of a section, or at its end.
typedef struct bt_edge_load {
    const bt_floe_load *load;
    bt_chord_end place;
    double x, y;              ///< of it, m
    double mean_x, mean_y;    ///< of the parts, m
    int parts;                ///< 1, or 2 half loads at ±w/4 along the edge
    struct {
        double x, y;          ///< m, on the outline
        double position;      ///< edge + t
    } part[2];
} bt_edge_load;

/// Loads that act at the same time, and their sums.
typedef struct bt_load_case {
    const bt_edge_load *load;         ///< [n]
    int n;
    int peak;                         ///< the one collision among them that acts; −1 = none
    double fx, fy, torque;            ///< F, N, and T about the centroid, N m
    double size, opening;             ///< sums of |f_k| and of opening forces, N
} bt_load_case;

/// Contacts at one end of a section.
typedef struct bt_section_end {
    double opening;  ///< of their pairs, across the section, F_y, N: it adds F_y to N and F_y l/2 to M, < 0 at a
    double thrust;   ///< along the section, into it, N
    double inertial; ///< the part of it that the floe's inertia balances, N
    double bearing;  ///< length that they bear on, m
} bt_section_end;

/// What a section carries.
typedef struct bt_section {
    double length;        ///< l, m
    double width;         ///< of the floe across it, A/l, m
    double normal;        ///< N, with opening pairs, N
    double moment;        ///< M, with opening pairs, N m
    bt_section_end at[2]; ///< a and b
} bt_section;

/// Does load k act in this case?
static inline bool bt_load_acts(const bt_load_case *loads, int k)
{
    return !loads->load[k].load->collision || k == loads->peak;
}

/// Put a load on the outline.
bt_edge_load bt_edge_load_of(const bt_split_floe *floe, const bt_floe_load *load, double slop);

/// The persisting loads and the collision number `peak` (−1: none), with their sums.
bt_load_case bt_load_case_of(const bt_edge_load *load, int n, int peak);

/// The place on the outline that is nearest to (x, y); a vertex when that lies within slop of it.
bt_chord_end bt_chord_nearest(int n, const double *v, double x, double y, double slop);

/// The place in metres.
void bt_chord_place(int n, const double *v, bt_chord_end end, double p[2]);

/// The section from a place on the outline along (dx, dy), to where it first leaves the floe. False when it does not
/// lead inside, or leaves at once.
bool bt_chord_from(int n, const double *v, bt_chord_end end, double dx, double dy, double slop, bt_chord *chord);

/// The section along (dx, dy) through (x, y), or when that lies outside the floe, the nearest one on the same line.
bool bt_chord_through(int n, const double *v, double x, double y, double dx, double dy, double slop, bt_chord *chord);

/// Outline of the part left of the chord, [at most n + 2][2] m into out: a, b, and on round to a. Returns the number of
/// vertices, fewer than 3 when there is no such part. The right part is the left one of the chord from b to a.
int bt_chord_piece(int n, const double *v, const bt_chord *chord, double *out);

/// What a section carries. area, polar: A and J of the floe.
bt_section bt_section_of(const bt_split_floe *floe, double area, double polar, const bt_load_case *loads,
                         const bt_chord *chord, double slop);

#endif
