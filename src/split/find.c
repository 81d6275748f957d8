// SPDX-License-Identifier: MIT
// The section along which a floe splits.
//
// Demand of a section, with N and M of section.h, h the thickness and l the length. At each of its ends
//     s = (N ∓ 6 M/l − 0.45 f_i)/(h l) = p + e,   − at a, + at b
// with p = 4 F_y/(h l) from the pair that opens it there; f_i is the part of the thrust at the other end that the
// floe's inertia balances: a point load through the depth of a beam relieves the far fibre by 0.40 to 0.55 f_i/(h l) at
// widths of 1 to 4 times l, by finite elements. Across the section, with f_t the thrust of the contacts at one end
// along it, f_i its part balanced by inertia (the rest has a support behind the floe), and w the length on which they
// bear,
//     t = (0.637 (1 − W^{3/2})(f_t − f_i) + 0.43 (1 − W) f_i)/(h b),   b = min(A/l, l), W = min(w/b, 1)
// 0.637 = 2/π is that of a disc between two points; both by finite elements. The strength of law.h with c = 0.75
// applies to a pair at the mouth of the crack, and to stress that closes it there:
//     near   p > 0:  (p + min(e, 0))/σ_0.75 + max(e, 0)/σ_1.4
//     far    p = 0:  e/σ_1.4
//     burst          t/σ_1.4
// The three peak at different places, so that the largest of the ratios counts, not their sum.
//
// Sections that are tested: from each of the largest contacts (up to 8, of a tenth of the largest load on) along its
// force, through the centroid, and to each other of them; through the centroid across the most tensile axis of Σ sym(x
// f); and across the long axis of the floe at its centroid and at a third and two thirds of its length: a strip struck
// at its end breaks at a third.
//
// Shortest section. In a convex floe a section shorter than the least width w cannot leave two pieces that are nowhere
// narrower: one of them has no longer chord parallel to the section, and the width of a convex body is at most its
// longest chord in any direction. So it cuts off a corner, which is left to crushing, unless the floe itself is
// narrower: then sections from its width on are judged, to tell that its size keeps it whole. A floe that is not convex
// may have a neck: there sections count from the shortest distance of a vertex from an edge that it is no end of, which
// no section between edges without a common vertex is below, and again a section shorter than w that cuts off less than
// w²/√3, the least area of a convex body of that width, is that of a corner.
//
// Quick reject. With G = Σ |f_k|, P the sum of opening forces, R the largest distance of a vertex from the centroid,
// and loads on the outline; the middle of a section is at most √(R² − l²/4) from the centroid, which is e here. N and M
// can be computed from either part, so they are at most the mean of both bounds:
//     |N| ≤ (G + |F|)/2 + |T| √(A/J)/2:   of F, |A1 − A2| |F|/(2 A); |S1| = |S2|, so each is at most half of
//         ∫ r dA ≤ √(A J).
//     |M| ≤ ((R + e) G + √(J/A + e²) |F| + |T| (1 + e √(A/J)))/2:   of F, ∫ |x − m| dA ≤ √(A (J + A e²)); of T/J,
//         (J1 + J2 + 2 |m| |S1|)/2.
// A short section of a convex floe cuts off little. With D = 2 R, r the distance of the nearest edge from the centroid
// and l ≤ 2 r, the chord through the centroid parallel to the section, c, is at least 2 r long. Let Q be a point of the
// part cut off, m the middle of the section and f ≤ l/(2 r) the share of the distance from Q to c at which the triangle
// Qc meets the section, in a length f c. If the line from Q through m meets c, then |Q m| ≤ f D. If not, m is outside
// the triangle, which covers at most l/2 of the section: f ≤ l/(4 r), and |Q m| ≤ f D + l/2. So |Q m| ≤ d with d = D
// l/(2 r). The part cut off is nowhere wider than l, so its share of the area is s ≤ l d/A, and
//     |N| ≤ G + s (|F| + |T| R A/J),   |M| ≤ d (G + s (|F| + |T| R A/J))
// Pairs add p ≤ 4 P/(h l) at their own end and press on the other.
// Bounds of N and M/l of the first kind fall with l, those of the second rise, and h l times the strength rises: over a
// range of lengths each is evaluated where it is largest.
#include "split/find.h"
#include "base/elementary.h"

#include "bergtow/outline.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double BURST_HELD = 0.637, BURST_FREE = 0.43, FAR_RELIEF = 0.45;
static const double LEAST_LOAD = 0.1; // share of the largest load: only contacts that carry more give sections
static const double EQUAL = 1e-9;    // ratios that differ by less are equal
static const double COMPACT = 0.1;   // of the sum of the second moments: if both differ by less, no long axis

/// Quantities of a floe's outline that do not depend on loads.
typedef struct form {
    double area, polar, radius, inradius;
    double xx, xy, yy;               ///< second moments, m⁴
} form;

static form form_of(const bt_split_floe *floe)
{
    form outline = {.inradius = floe->convex ? INFINITY : 0};
    double r2 = 0;
    for (int i = 0; i < floe->n; i++) {
        const double *p = floe->outline + 2 * i, *q = floe->outline + 2 * (i + 1 < floe->n ? i + 1 : 0);
        const double c = p[0] * q[1] - p[1] * q[0];
        outline.area += c / 2;
        outline.xx += c * (p[0] * p[0] + p[0] * q[0] + q[0] * q[0]) / 12;
        outline.yy += c * (p[1] * p[1] + p[1] * q[1] + q[1] * q[1]) / 12;
        outline.xy += c * (2 * (p[0] * p[1] + q[0] * q[1]) + p[0] * q[1] + q[0] * p[1]) / 24;
        r2 = bt_max(r2, p[0] * p[0] + p[1] * p[1]);
        if (floe->convex) outline.inradius = bt_min(outline.inradius, c / bt_hypot(q[0] - p[0], q[1] - p[1]));
    }
    outline.radius = sqrt(r2);
    outline.polar = outline.xx + outline.yy;
    outline.inradius = bt_max(0, outline.inradius);
    return outline;
}

static const double STEP = 1.1;  // ratio of the ends of a length range with one bound, for bt_split_borne
static const double COARSE = 2;  // the same, for the loads of a step

/// Least width of a convex polygon, and its length / width, the length along the edge across which it is narrowest.
static double width_of(int n, const double *v, double *aspect)
{
    double width = INFINITY;
    for (int i = 0; i < n; i++) {
        const double *p = v + 2 * i, *q = v + 2 * (i + 1 < n ? i + 1 : 0);
        const double l = bt_hypot(q[0] - p[0], q[1] - p[1]);
        if (!(l > 0)) continue;
        const double ex = (q[0] - p[0]) / l, ey = (q[1] - p[1]) / l;
        double across = 0, low = 0, high = l;
        for (int k = 0; k < n; k++) {
            const double x = v[2 * k] - p[0], y = v[2 * k + 1] - p[1], along = x * ex + y * ey;
            across = bt_max(across, ex * y - ey * x);
            low = bt_min(low, along), high = bt_max(high, along);
        }
        if (across < width) width = across, *aspect = (high - low) / across;
    }
    return width;
}

/// Shortest distance of a vertex from an edge that it is no end of, m.
static double neck_of(int n, const double *v)
{
    double least = INFINITY;
    for (int i = 0; i < n; i++) {
        const double *p = v + 2 * i, *q = v + 2 * ((i + 1) % n);
        const double x = q[0] - p[0], y = q[1] - p[1], l2 = x * x + y * y;
        for (int k = i + 2; k < i + n; k++) {
            const double *o = v + 2 * (k % n), ox = o[0] - p[0], oy = o[1] - p[1];
            const double t = l2 > 0 ? bt_max(0, bt_min(1, (ox * x + oy * y) / l2)) : 0;
            least = bt_min(least, bt_hypot(ox - t * x, oy - t * y));
        }
    }
    return least;
}

/// Length of the shortest section that is judged, m. Either end of a section may have moved to a vertex.
static double least_length(const bt_split_floe *floe, const bt_split_law *law)
{
    double aspect;
    const double own = floe->convex ? width_of(floe->n, floe->outline, &aspect) : neck_of(floe->n, floe->outline);
    return bt_max(law->slop, bt_min(law->least_width, own - 2 * law->slop));
}

/// Sums over the loads: G, |F|, |T| and P.
typedef struct sums { double size, net, torque, opening; } sums;

static sums sums_of(const bt_load_case *loads)
{
    return (sums){loads->size, bt_hypot(loads->fx, loads->fy), fabs(loads->torque), loads->opening};
}

/// Upper bound of stress / strength for sections of lengths in this range.
static double bound_between(const bt_split_floe *floe, const form *outline, const sums *s, const bt_split_law *law,
                            double low, double high)
{
    const double radius = outline->radius, ratio = outline->area / outline->polar;
    const double off = sqrt(bt_max(0, radius * radius - low * low / 4));
    double normal = (s->size + s->net + s->torque * sqrt(ratio)) / 2;
    double bending = ((radius + off) * s->size + sqrt(1 / ratio + off * off) * s->net +
                      s->torque * (1 + off * sqrt(ratio))) / (2 * low); // M/l
    if (high <= 2 * outline->inradius) {
        const double slope = radius / outline->inradius + 2 * law->slop / low; // d/l
        const double share = bt_min(1, high * high * slope / outline->area);
        const double part = s->size + share * (s->net + s->torque * radius * ratio);
        normal = bt_min(normal, part);
        bending = bt_min(bending, slope * part);
    }
    const double strength = bt_split_strength(law, low, false), hl = floe->thickness * low;
    double most = (normal + 6 * bending) / (hl * strength);
    if (s->opening > 0) most += 4 * s->opening / (hl * bt_split_strength(law, low, true));
    // b = l of burst is below that; b = A/l is largest at l = D
    const double d = 2 * radius;
    return bt_max(most, BURST_HELD * s->size * d /
                        (floe->thickness * outline->area * bt_split_strength(law, d, false))) / floe->factor;
}

/// The same for all sections of length l or more.
static double bound(const bt_split_floe *floe, const form *outline, const sums *s, const bt_split_law *law, double l)
{
    double most = 0;
    while (l < 2 * outline->inradius) {
        const double high = bt_min(STEP * l, 2 * outline->inradius);
        most = bt_max(most, bound_between(floe, outline, s, law, l, high));
        l = high;
    }
    return bt_max(most, bound_between(floe, outline, s, law, l, INFINITY));
}

/// A length above which no section splits, m.
static double safe_length(const bt_split_floe *floe, const form *outline, const sums *s, const bt_split_law *law,
                          double least)
{
    double high = INFINITY, low = bt_max(2 * (floe->convex ? outline->inradius : outline->radius), least);
    while (!(bound_between(floe, outline, s, law, low, high) > 1)) {
        high = low;
        if (!(low > least)) break;
        low = bt_max(low / COARSE, least);
    }
    return high;
}

double bt_split_bound(const bt_split_floe *floe, const bt_load_case *loads, const bt_split_law *law, double l)
{
    const form outline = form_of(floe);
    const sums s = sums_of(loads);
    return bound(floe, &outline, &s, law, l);
}

double bt_split_borne(const bt_split_floe *floe, const bt_split_law *law)
{
    const form outline = form_of(floe);
    if (!(2 * outline.radius >= law->least_width)) return INFINITY;
    const double l = least_length(floe, law); // the bound is linear in sizes and opening forces
    const sums load = {.size = 1, .net = 1, .torque = outline.radius}, pair = {.opening = 1};
    return 1 / bt_max(bound(floe, &outline, &load, law, l), bound_between(floe, &outline, &pair, law, l, INFINITY));
}

static double hull_width(int n, const double *v, bool convex, double *aspect)
{
    if (convex) return width_of(n, v, aspect);
    double hull[2 * (BT_MAX_VERTICES + 2)];
    memcpy(hull, v, 2 * (size_t)n * sizeof *hull);
    return width_of(bt_shape_hull(n, hull), hull, aspect);
}

static bool has_parts(int n, const double *v)
{
    bt_parts parts;
    return bt_outline_convex(n, v) || (!bt_outline_fault(n, v) && bt_outline_split(n, v, &parts));
}

static bt_split_refusal refusal_of(const bt_split_floe *floe, const bt_chord *chord, const bt_split_law *law)
{
    double whole = 0;
    hull_width(floe->n, floe->outline, floe->convex, &whole);
    const double most = bt_max(law->aspect, whole * (1 - EQUAL));
    for (int side = 0; side < 2; side++) {
        const bt_chord along = side ? (bt_chord){chord->b, chord->a} : *chord;
        double piece[2 * (BT_MAX_VERTICES + 2)], aspect = 0;
        const int n = bt_chord_piece(floe->n, floe->outline, &along, piece);
        if (n < 3 || !(hull_width(n, piece, floe->convex, &aspect) >= law->least_width)) return BT_SPLIT_SIZE;
        if (aspect > most) return BT_SPLIT_ASPECT;
        if (n > BT_MAX_VERTICES || (!floe->convex && !has_parts(n, piece))) return BT_SPLIT_OUTLINE;
    }
    return BT_SPLIT_ALLOWED;
}

/// What a section was chosen by.
typedef enum { BY_CONTACT, BY_MIDDLE, BY_NECK } choice;

/// A search through the sections of one floe under loads that act at the same time.
typedef struct search {
    const bt_split_floe *floe;
    const form *form;
    const bt_load_case *loads;
    sums sums;
    double least, safe;              ///< m: sections from one length up to the other may split
    const bt_split_law *law;
    bt_split *best;
    bool neck;                       ///< a section at a neck is the best so far
} search;

/// Largest stress / strength of a section.
static double demand(const search *s, const bt_section *section, bt_split_mode *mode)
{
    const double l = section->length, hl = s->floe->thickness * l, b = bt_min(section->width, l);
    const double strength = s->floe->factor * bt_split_strength(s->law, l, false);
    double worst = 0;
    *mode = BT_SPLIT_BENT;
    for (int k = 0; k < 2; k++) {
        const bt_section_end *end = &section->at[k], *opposite = &section->at[1 - k];
        const double pair = 4 * end->opening / hl, share = bt_min(1, end->bearing / b);
        const double rest =
            (section->normal + (k ? 6 : -6) * section->moment / l - FAR_RELIEF * opposite->inertial) / hl - pair;
        double ratio = bt_max(0, rest) / strength;
        if (pair > 0) ratio += (pair + bt_min(0, rest)) / (s->floe->factor * bt_split_strength(s->law, l, true));
        if (ratio > worst) worst = ratio, *mode = pair > 0 ? BT_SPLIT_OPENED : BT_SPLIT_BENT;
        const double burst = (BURST_HELD * (1 - share * sqrt(share)) * (end->thrust - end->inertial) +
                              BURST_FREE * (1 - share) * end->inertial) /
                             (s->floe->thickness * b * strength);
        if (burst > worst) worst = burst, *mode = BT_SPLIT_BURST;
    }
    return worst;
}

/// Does a section cut off less than any convex piece of the least width has?
static bool is_corner(const search *s, const bt_chord *chord)
{
    double piece[2 * (BT_MAX_VERTICES + 2)], area = 0;
    const int n = bt_chord_piece(s->floe->n, s->floe->outline, chord, piece);
    if (n >= 3) area = bt_shape_centroid(n, piece).area;
    return bt_min(area, s->form->area - area) * sqrt(3) < s->law->least_width * s->law->least_width;
}

static double ends_of(const search *s, const bt_chord *chord, double a[2], double b[2])
{
    bt_chord_place(s->floe->n, s->floe->outline, chord->a, a);
    bt_chord_place(s->floe->n, s->floe->outline, chord->b, b);
    return bt_hypot(b[0] - a[0], b[1] - a[1]);
}

/// Is the middle of one section nearer to the first load, in their order, from which both are not as far? Of equal
/// sections, such as the two ends of a straight neck, this tells one however the vertices are numbered.
static bool is_nearer(const search *s, const bt_chord *chord, const bt_chord *than)
{
    double a[2], b[2], c[2], d[2];
    ends_of(s, chord, a, b), ends_of(s, than, c, d);
    for (int k = 0; k < s->loads->n; k++) {
        if (!bt_load_acts(s->loads, k)) continue;
        const double x = s->loads->load[k].x, y = s->loads->load[k].y;
        const double one = bt_hypot((a[0] + b[0]) / 2 - x, (a[1] + b[1]) / 2 - y);
        const double other = bt_hypot((c[0] + d[0]) / 2 - x, (c[1] + d[1]) / 2 - y);
        if (fabs(one - other) > s->law->slop) return one < other;
    }
    return false;
}

/// Take a section if it is the best so far. A section from a contact keeps its direction, others are turned so that
/// bending opens b: if the pieces are equal, the direction decides which is the first.
static void consider(search *s, bt_chord chord, choice by)
{
    double a[2], b[2];
    const double l = ends_of(s, &chord, a, b);
    const bt_load_case *loads = s->loads;
    if (!(l >= s->least) || !(l > s->law->slop) || l >= s->safe) return;
    if (!(bound_between(s->floe, s->form, &s->sums, s->law, l, l) > 1)) return;
    const bt_section section = bt_section_of(s->floe, s->form->area, s->form->polar, loads, &chord, s->law->slop);
    bt_split_mode mode;
    const double ratio = demand(s, &section, &mode);
    if (by != BY_CONTACT && section.moment < 0) chord = (bt_chord){chord.b, chord.a};
    bt_split *best = s->best;
    if (!(ratio > 1)) return;
    const bool tie = by == BY_NECK && s->neck && ratio > best->ratio * (1 - EQUAL);
    if (!(ratio > best->ratio * (1 + EQUAL)) && !(tie && is_nearer(s, &chord, &best->chord))) return;
    const bt_split_refusal refused = refusal_of(s->floe, &chord, s->law);
    if (refused) {
        if ((by == BY_NECK || l < s->law->least_width) && is_corner(s, &chord)) return;
        if (ratio > best->refused_ratio) best->refused_ratio = ratio, best->refused = refused;
        return;
    }
    best->chord = chord;
    best->mode = mode;
    best->ratio = ratio;
    best->length = l;
    best->peak = loads->peak;
    s->neck = by == BY_NECK;
}

static void consider_from(search *s, bt_chord_end from, double dx, double dy)
{
    bt_chord chord;
    if (bt_chord_from(s->floe->n, s->floe->outline, from, dx, dy, s->law->slop, &chord)) consider(s, chord, BY_CONTACT);
}

static void consider_through(search *s, double x, double y, double dx, double dy)
{
    bt_chord chord;
    if (bt_chord_through(s->floe->n, s->floe->outline, x, y, dx, dy, s->law->slop, &chord))
        consider(s, chord, BY_MIDDLE);
}

/// Unit vector of the larger eigenvalue of a symmetric 2 × 2 matrix; false when both differ by less than 2 tiny.
static bool major_axis(double xx, double xy, double yy, double tiny, double *x, double *y)
{
    const double half = (xx - yy) / 2, r = bt_hypot(half, xy);
    if (!(r > tiny)) return false;
    *x = sqrt(bt_max(0, (1 + half / r) / 2));
    *y = sqrt(bt_max(0, (1 - half / r) / 2));
    if (xy < 0) *y = -*y;
    return true;
}

static double load_size(const bt_load_case *loads, int k)
{
    return bt_hypot(loads->load[k].load->fx, loads->load[k].load->fy) + loads->load[k].load->opening;
}

static void search_necks(search *s)
{
    const int n = s->floe->n;
    bt_chord chord;
    for (int i = 0; i < n; i++)
        for (int k = 0; k < n; k++)
            if (bt_chord_across(n, s->floe->outline, i, k, s->safe, s->law->slop, &chord)) consider(s, chord, BY_NECK);
}

static void search_sections(search *s)
{
    const bt_load_case *loads = s->loads;
    const bt_split_floe *floe = s->floe;
    // Choose the largest contacts, in the order of the loads: an order by size would depend on rounding.
    int chosen[BT_SPLIT_CONTACTS] = {0}, n = 0;
    double largest = 0;
    for (int k = 0; k < loads->n; k++)
        if (bt_load_acts(loads, k)) largest = bt_max(largest, load_size(loads, k));
    for (int k = 0; k < loads->n; k++) {
        if (!bt_load_acts(loads, k) || !(load_size(loads, k) > LEAST_LOAD * largest)) continue;
        if (n < BT_SPLIT_CONTACTS) {
            chosen[n++] = k;
            continue;
        }
        int least = 0;
        for (int i = 1; i < n; i++)
            if (load_size(loads, chosen[i]) < load_size(loads, chosen[least])) least = i;
        if (!(load_size(loads, k) > load_size(loads, chosen[least]))) continue;
        memmove(chosen + least, chosen + least + 1, (size_t)(n - 1 - least) * sizeof *chosen);
        chosen[n - 1] = k;
    }
    // Both ends of a section may move to a vertex, so 2 slops more.
    const double safe = floe->convex ? s->safe + 2 * s->law->slop : INFINITY;
    const bool central = !(2 * s->form->inradius > safe); // through the centroid
    double xx = 0, xy = 0, yy = 0, scale = 0;
    for (int i = 0; i < n; i++) {
        const bt_edge_load *edge = &loads->load[chosen[i]];
        consider_from(s, edge->place, edge->load->fx, edge->load->fy);
        if (central) consider_from(s, edge->place, -edge->x, -edge->y);
        // In an outline that is not convex the section from the other end may differ.
        for (int j = floe->convex ? i + 1 : 0; j < n; j++) {
            const bt_edge_load *other = &loads->load[chosen[j]];
            const double dx = other->x - edge->x, dy = other->y - edge->y;
            if (j != i && !(dx * dx + dy * dy > safe * safe)) consider_from(s, edge->place, dx, dy);
        }
        xx += edge->x * edge->load->fx, yy += edge->y * edge->load->fy;
        xy += (edge->x * edge->load->fy + edge->y * edge->load->fx) / 2;
        scale += s->form->radius * (fabs(edge->load->fx) + fabs(edge->load->fy));
    }
    double x, y;
    if (central && major_axis(xx, xy, yy, EQUAL * scale, &x, &y)) consider_through(s, 0, 0, -y, x);
    // A chord at a third of the length is at least half as long as the parallel one through the centroid, which lies at
    // most at two thirds: the length of parallel chords is concave.
    const form *outline = s->form;
    if (outline->inradius > safe) return;
    if (!major_axis(outline->xx, outline->xy, outline->yy, COMPACT * outline->polar / 2, &x, &y)) return;
    if (x * floe->outline[0] + y * floe->outline[1] < 0) x = -x, y = -y;
    double low = 0, high = 0;
    for (int i = 0; i < floe->n; i++) {
        const double along = x * floe->outline[2 * i] + y * floe->outline[2 * i + 1];
        low = bt_min(low, along), high = bt_max(high, along);
    }
    consider_through(s, 0, 0, -y, x);
    for (int k = 1; k <= 2; k++) {
        const double at = low + k * (high - low) / 3;
        consider_through(s, at * x, at * y, -y, x);
    }
}

static int by_contact(const void *a, const void *b)
{
    const bt_floe_load *p = a, *q = b;
    if (p->other != q->other) return p->other < q->other ? -1 : 1;
    if (p->part != q->part) return p->part < q->part ? -1 : 1;
    if (p->point != q->point) return p->point < q->point ? -1 : 1;
    return (int)p->collision - (int)q->collision;
}

bool bt_split_find(const bt_split_floe *floe, bt_floe_load *load, int n_loads, const bt_split_law *law, bt_split *best)
{
    *best = (bt_split){.peak = -1};
    const form outline = form_of(floe);
    if (!(2 * outline.radius >= law->least_width)) return false;
    qsort(load, (size_t)n_loads, sizeof *load, by_contact);
    bt_edge_load few[16], *on_edge = n_loads <= 16 ? few : bt_alloc((size_t)n_loads, sizeof *on_edge);
    for (int k = 0; k < n_loads; k++) on_edge[k] = bt_edge_load_of(floe, &load[k], law->slop);
    const double least = least_length(floe, law);
    for (int k = -1; k < n_loads; k++) {
        if (k >= 0 && !load[k].collision) continue;
        const bt_load_case loads = bt_load_case_of(on_edge, n_loads, k);
        const sums s = sums_of(&loads);
        const double safe = safe_length(floe, &outline, &s, law, least);
        if (!(safe > least)) continue;
        search one = {floe, &outline, &loads, s, least, safe, law, best, false};
        search_sections(&one);
        if (!floe->convex) search_necks(&one);
    }
    if (on_edge != few) free(on_edge);
    return best->ratio > 0;
}
