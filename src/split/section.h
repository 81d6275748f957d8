// SPDX-License-Identifier: MIT
// A section through a floe: a chord of its outline, and the force and moment on it.
//
// A rigid floe under contact forces f_k at x_k moves so that its inertia balances them, whatever its material. With the
// centroid at the origin, F = Σ f_k, T = Σ x_k × f_k, area A and J = ∫ r² dA, a force
//     q(x) = −F/A − (T/J) k × x
// per area balances the contacts: added mass and inertia cancel, as they are proportional to the body's own.
// (Neglected: drag, whose stress is a thousandth of the others.) A chord from a along the unit vector d has n = d
// turned left, the middle m and the length l; part 1 on its left has the area A1, S1 = ∫ x dA and J1 = ∫ r² dA, about
// the parent's centroid. Part 1 is in equilibrium under its contacts, q and the tractions of the section, hence
//     Q_b = −F A1/A − (T/J) k × S1
//     N = (Σ₁ f_k + Q_b) . n                                       tension > 0
//     M = Σ₁ (x_k − m) × f_k + S1 × (−F/A) − (T/J) J1 − m × Q_b    opens the end b > 0
// and with a linear stress over the section N/(h l) − 6 M/(h l²) at a, N/(h l) + 6 M/(h l²) at b.
//
// A load on the section counts half to each side. A load on a length w is two half loads at ±w/4 along the edge: for a
// section at its middle this is exact for uniform pressure, with F w/8 of bending.
//
// An outline need not be convex: a section is the stretch of the line inside it that begins at a.
#ifndef BT_SPLIT_SECTION_H
#define BT_SPLIT_SECTION_H

#include "split/law.h"

#include "bergtow/outline.h"

/// A place on an outline: on the edge from vertex `edge` to the next, at share t of it from 0 to below 1; 0 is the
/// vertex itself. It does not change when the outline is rotated.
typedef struct bt_chord_end {
    int edge;
    double t;
} bt_chord_end;

/// A section from a to b through the inside. The outline from b to a, anticlockwise, bounds the part on its left.
typedef struct bt_chord { bt_chord_end a, b; } bt_chord;

/// A floe as the law sees it.
typedef struct bt_split_floe {
    int n;                 ///< vertices
    const double *outline; ///< [n][2] m, anticlockwise, centroid at the origin
    bool convex;
    double thickness;      ///< h, m
    double factor;         ///< of the strength (bt_split_scatter), 1 = the law's
} bt_split_floe;

/// A load, moved to the nearest point of the outline: a contact pushes across the edge, so it slides along its line of
/// action, and each load is on one side of a section, or at an end of it.
typedef struct bt_edge_load {
    const bt_floe_load *load;
    bt_chord_end place;
    double x, y;              ///< of the place, m
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
    int peak;                         ///< index of the only collision that acts; −1 = none
    double fx, fy, torque;            ///< F, N, and T about the centroid, N m
    double size, opening;             ///< sums of |f_k| and of opening forces, N
} bt_load_case;

/// Contacts at one end of a section.
typedef struct bt_section_end {
    double opening;  ///< F_y of their pairs across the section, N: adds F_y to N and ±F_y l/2 to M, − at a
    double thrust;   ///< along the section, into it, N
    double inertial; ///< its part balanced by the floe's inertia, N
    double bearing;  ///< length on which they bear, m
} bt_section_end;

/// Force and moment on a section.
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

/// Move a load to the outline.
bt_edge_load bt_edge_load_of(const bt_split_floe *floe, const bt_floe_load *load, double slop);

/// The persisting loads and collision `peak` (−1: none), with their sums.
bt_load_case bt_load_case_of(const bt_edge_load *load, int n, int peak);

/// The point on the outline nearest to (x, y), or a vertex if one lies within the slop of it.
bt_chord_end bt_chord_nearest(int n, const double *v, double x, double y, double slop);

/// Coordinates of the place, m.
void bt_chord_place(int n, const double *v, bt_chord_end end, double p[2]);

/// The section from a point on the outline along (dx, dy), to where it first leaves the floe. False if it does not lead
/// inside, or leaves at once.
bool bt_chord_from(int n, const double *v, bt_chord_end end, double dx, double dy, double slop, bt_chord *chord);

/// The section along (dx, dy) through (x, y), or if that lies outside the floe, the nearest section on the same line.
bool bt_chord_through(int n, const double *v, double x, double y, double dx, double dy, double slop, bt_chord *chord);

/// The section from a reflex vertex to the point of an edge nearest to it: the foot of the perpendicular, or the vertex
/// at which the edge begins. False if it is as long as `longest`, m, if the vertex is not reflex, if the outline beside
/// that point is nearer, or if it is in between, the latter two up to the slop.
bool bt_chord_across(int n, const double *v, int vertex, int edge, double longest, double slop, bt_chord *chord);

/// Outline of the part left of the chord, written to out[at most n + 2][2], m: a, b, and on around to a. Returns the
/// number of vertices, fewer than 3 if there is no such part. The right part is the left part of the chord from b to a.
int bt_chord_piece(int n, const double *v, const bt_chord *chord, double *out);

/// Force and moment on a section. area (m²), polar (m⁴): A and J of the floe.
bt_section bt_section_of(const bt_split_floe *floe, double area, double polar, const bt_load_case *loads,
                         const bt_chord *chord, double slop);

// --- the cut ---------------------------------------------------------------------------------------------------------

// The cut of an outline along a section into two pieces, without loss.

/// One of the two pieces.
typedef struct bt_piece {
    int n;                             ///< vertices
    double outline[2 * BT_MAX_VERTICES]; ///< [n][2] m, anticlockwise, about its own centroid
    bool convex;
    bt_parts parts;                    ///< convex parts of an outline that is not convex
    double x, y;                       ///< centroid in the parent's frame, m
    double area;                       ///< m²
    double polar;                      ///< ∫ r² dA about its own centroid, m⁴
    bool left;                         ///< of the chord
} bt_piece;

/// Cut an outline of n vertices, centroid at the origin, along a section. area (m²) and polar (m⁴) are those of the
/// parent body. The larger piece comes first; if the two are equal to 1e-9, the left one. Area, and first and second
/// moments, of the second piece are the parent's minus the first's, so that the sums
///     A_1 + A_2 = A,   A_1 c_1 + A_2 c_2 = 0,   J_1 + A_1 c_1² + J_2 + A_2 c_2² = J
/// hold to rounding, and with velocities V + ω k × c_i and spins ω also mass, momentum, angular momentum and kinetic
/// energy, if mass and inertia have the same share of added water. The ends of the section have the same bits in the
/// parent's frame before the centroids are subtracted. False if a piece has fewer than 3 or more than BT_MAX_VERTICES
/// vertices, no area, or no convex parts.
bool bt_split_cut(int n, const double *outline, double area, double polar, const bt_chord *chord, bt_piece piece[2]);

#endif
