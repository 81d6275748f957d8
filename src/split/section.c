// SPDX-License-Identifier: MIT
// Chords of an outline, and the loads on them (section.h).
#include "split/section.h"
#include "base/elementary.h"

#include <math.h>
#include <string.h>

static const double STRAIGHT = 1e-9; // sine of the angle of a corner: less is rounding

static double cross(double ax, double ay, double bx, double by) { return ax * by - ay * bx; }
static double square(double x, double y) { return x * x + y * y; }

void bt_chord_place(int n, const double *v, bt_chord_end end, double p[2])
{
    const double *a = v + 2 * end.edge, *b = v + 2 * (end.edge + 1 < n ? end.edge + 1 : 0);
    p[0] = a[0] + end.t * (b[0] - a[0]);
    p[1] = a[1] + end.t * (b[1] - a[1]);
}

/// The point at share t, 0 to 1, of an edge, or a vertex within the slop of it.
static bt_chord_end place_on(int n, const double *v, int edge, double t, double slop)
{
    const int next = edge + 1 < n ? edge + 1 : 0;
    const double l = bt_hypot(v[2 * next] - v[2 * edge], v[2 * next + 1] - v[2 * edge + 1]);
    if (t * l <= slop) return (bt_chord_end){edge, 0};
    if ((1 - t) * l <= slop || !(t < 1)) return (bt_chord_end){next, 0};
    return (bt_chord_end){edge, t};
}

bt_chord_end bt_chord_nearest(int n, const double *v, double x, double y, double slop)
{
    int edge = 0;
    double share = 0, least = INFINITY;
    for (int i = 0; i < n; i++) {
        const double *a = v + 2 * i, *b = v + 2 * (i + 1 < n ? i + 1 : 0);
        const double ex = b[0] - a[0], ey = b[1] - a[1], l2 = ex * ex + ey * ey;
        const double along = (x - a[0]) * ex + (y - a[1]) * ey, t = along <= 0 ? 0 : along < l2 ? along / l2 : 1;
        const double dx = x - a[0] - t * ex, dy = y - a[1] - t * ey, d2 = dx * dx + dy * dy;
        if (d2 < least) least = d2, edge = i, share = t;
    }
    return place_on(n, v, edge, share, slop);
}

typedef struct crossing {
    int edge;
    double t, along; ///< share of the edge; coordinate on the line, m
} crossing;

/// Crossings of the line through (x, y) along the unit vector (dx, dy) with the outline, in order along the line. A
/// vertex counts as on one side, the same for both its edges, so their number is even, and the line is inside between
/// the first and the second, the third and the fourth, ...
static int crossings(int n, const double *v, double x, double y, double dx, double dy, crossing *out)
{
    int k = 0;
    double s = cross(dx, dy, v[2 * (n - 1)] - x, v[2 * (n - 1) + 1] - y);
    for (int j = 0; j < n; j++) {
        const int i = j > 0 ? j - 1 : n - 1;
        const double s_next = cross(dx, dy, v[2 * j] - x, v[2 * j + 1] - y);
        if ((s > 0) != (s_next > 0)) {
            const double t = s / (s - s_next), *a = v + 2 * i, *b = v + 2 * j;
            const double px = a[0] + t * (b[0] - a[0]) - x, py = a[1] + t * (b[1] - a[1]) - y;
            const crossing c = {i, t, px * dx + py * dy};
            int at = k++;
            for (; at > 0 && out[at - 1].along > c.along; at--) out[at] = out[at - 1];
            out[at] = c;
        }
        s = s_next;
    }
    return k;
}

static bool unit(double *dx, double *dy)
{
    const double l = bt_hypot(*dx, *dy);
    if (!(l > 0)) return false;
    *dx /= l, *dy /= l;
    return true;
}

bool bt_chord_from(int n, const double *v, bt_chord_end end, double dx, double dy, double slop, bt_chord *chord)
{
    crossing at[BT_MAX_VERTICES];
    double p[2];
    bt_chord_place(n, v, end, p);
    if (!unit(&dx, &dy)) return false;
    const int k = crossings(n, v, p[0], p[1], dx, dy, at);
    int first = 0;
    while (first < k && at[first].along <= slop) first++;
    if ((k - first) % 2 == 0) return false; // the line leaves the outline at once
    *chord = (bt_chord){end, place_on(n, v, at[first].edge, at[first].t, slop)};
    return true;
}

bool bt_chord_through(int n, const double *v, double x, double y, double dx, double dy, double slop, bt_chord *chord)
{
    crossing at[BT_MAX_VERTICES];
    if (!unit(&dx, &dy)) return false;
    const int k = crossings(n, v, x, y, dx, dy, at);
    int best = -1;
    double least = INFINITY;
    for (int i = 0; i + 1 < k; i += 2) {
        const double away = bt_max(0, bt_max(at[i].along, -at[i + 1].along));
        if (away < least) least = away, best = i;
    }
    if (best < 0) return false;
    *chord = (bt_chord){place_on(n, v, at[best].edge, at[best].t, slop),
                        place_on(n, v, at[best + 1].edge, at[best + 1].t, slop)};
    return true;
}

/// Is a point of the outline on the segment of this length from o along (dx, dy), further than the slop from its ends?
static bool is_crossed(int n, const double *v, const double *o, double dx, double dy, double length, double slop)
{
    const double *p = v + 2 * (n - 1);
    double s = cross(dx, dy, p[0] - o[0], p[1] - o[1]), along = dx * (p[0] - o[0]) + dy * (p[1] - o[1]);
    for (int i = 0; i < n; i++) {
        p = v + 2 * i;
        const double s_next = cross(dx, dy, p[0] - o[0], p[1] - o[1]);
        const double next = dx * (p[0] - o[0]) + dy * (p[1] - o[1]);
        if (fabs(s_next) <= slop && next > slop && next < length - slop) return true;
        if ((s > 0) != (s_next > 0)) {
            const double at = along + s / (s - s_next) * (next - along);
            if (at > slop && at < length - slop) return true;
        }
        s = s_next, along = next;
    }
    return false;
}

bool bt_chord_across(int n, const double *v, int vertex, int edge, double longest, double slop, bt_chord *chord)
{
    const int before = vertex > 0 ? vertex - 1 : n - 1, after = vertex + 1 < n ? vertex + 1 : 0;
    if (edge == vertex || edge == before) return false;
    const double *o = v + 2 * vertex, *p = v + 2 * before, *q = v + 2 * after;
    const double *a = v + 2 * edge, *b = v + 2 * (edge + 1 < n ? edge + 1 : 0);
    const double in[2] = {o[0] - p[0], o[1] - p[1]}, out[2] = {q[0] - o[0], q[1] - o[1]};
    const double turn = cross(in[0], in[1], out[0], out[1]);
    if (!(turn < -STRAIGHT * sqrt(square(in[0], in[1]) * square(out[0], out[1])))) return false;

    const double x = b[0] - a[0], y = b[1] - a[1], l2 = x * x + y * y;
    const double along = (o[0] - a[0]) * x + (o[1] - a[1]) * y, off = cross(x, y, o[0] - a[0], o[1] - a[1]);
    if (!(along < l2)) return false; // a vertex, where the next edge begins
    const bool foot = along > 0 && along * along > slop * slop * l2;
    if (foot && !(off > 0)) return false; // at the back of the edge
    if (!((foot ? off * off : square(o[0] - a[0], o[1] - a[1]) * l2) < longest * longest * l2)) return false;
    if (!foot) {
        const double *c = v + 2 * (edge > 0 ? edge - 1 : n - 1);
        const double back = (o[0] - a[0]) * (c[0] - a[0]) + (o[1] - a[1]) * (c[1] - a[1]);
        if (back > 0 && back * back > slop * slop * square(c[0] - a[0], c[1] - a[1])) return false;
    }
    const bt_chord_end end = foot ? place_on(n, v, edge, along / l2, slop) : (bt_chord_end){edge, 0};
    if (end.edge != edge) return false;

    double to[2];
    bt_chord_place(n, v, end, to);
    double dx = to[0] - o[0], dy = to[1] - o[1];
    const double length = bt_hypot(dx, dy);
    if (!unit(&dx, &dy)) return false;
    // From a reflex vertex a line leads inside if it is left of either edge.
    if (!(cross(in[0], in[1], dx, dy) > 0) && !(cross(out[0], out[1], dx, dy) > 0)) return false;
    if (is_crossed(n, v, o, dx, dy, length, slop)) return false;
    *chord = (bt_chord){{vertex, 0}, end};
    return true;
}

int bt_chord_piece(int n, const double *v, const bt_chord *chord, double *out)
{
    const bt_chord_end a = chord->a, b = chord->b;
    if (a.edge == b.edge && a.t == b.t) return 0;
    bt_chord_place(n, v, a, out);
    bt_chord_place(n, v, b, out + 2);
    // number of vertices after b up to that of a's edge, which is a itself if a is a vertex
    int between = a.edge - b.edge;
    if (between < 0 || (between == 0 && b.t > a.t)) between += n;
    if (a.t == 0 && between > 0) between--;
    const int first = b.edge + 1 < n ? b.edge + 1 : 0, straight = between < n - first ? between : n - first;
    memcpy(out + 4, v + 2 * first, 2 * (size_t)straight * sizeof *out);
    memcpy(out + 4 + 2 * straight, v, 2 * (size_t)(between - straight) * sizeof *out);
    return between + 2;
}

bt_edge_load bt_edge_load_of(const bt_split_floe *floe, const bt_floe_load *load, double slop)
{
    bt_edge_load edge = {.load = load, .place = bt_chord_nearest(floe->n, floe->outline, load->x, load->y, slop),
                         .parts = 1};
    double p[2];
    bt_chord_place(floe->n, floe->outline, edge.place, p);
    edge.x = p[0], edge.y = p[1];
    edge.part[0].x = p[0], edge.part[0].y = p[1], edge.part[0].position = edge.place.edge + edge.place.t;
    edge.mean_x = p[0], edge.mean_y = p[1];
    if (!(load->length / 4 > slop)) return edge;
    edge.parts = 2;
    for (int i = 0; i < 2; i++) {
        const double off = (i ? 0.25 : -0.25) * load->length;
        const bt_chord_end at =
            bt_chord_nearest(floe->n, floe->outline, edge.x + off * load->edge_x, edge.y + off * load->edge_y, 0);
        bt_chord_place(floe->n, floe->outline, at, p);
        edge.part[i].x = p[0], edge.part[i].y = p[1], edge.part[i].position = at.edge + at.t;
    }
    edge.mean_x = (edge.part[0].x + edge.part[1].x) / 2, edge.mean_y = (edge.part[0].y + edge.part[1].y) / 2;
    return edge;
}

bt_load_case bt_load_case_of(const bt_edge_load *load, int n, int peak)
{
    bt_load_case loads = {.load = load, .n = n, .peak = peak};
    for (int k = 0; k < n; k++) {
        if (!bt_load_acts(&loads, k)) continue;
        const bt_floe_load *f = load[k].load;
        loads.fx += f->fx, loads.fy += f->fy;
        loads.size += bt_hypot(f->fx, f->fy);
        loads.opening += f->opening;
        loads.torque += cross(load[k].mean_x, load[k].mean_y, f->fx, f->fy);
    }
    return loads;
}

/// Area, first moments and polar second moment of a polygon about the origin.
static void moments_about_origin(int n, const double *v, double *area, double *sx, double *sy, double *polar)
{
    *area = *sx = *sy = *polar = 0;
    for (int i = 0; i < n; i++) {
        const double *p = v + 2 * i, *q = v + 2 * (i + 1 < n ? i + 1 : 0), c = cross(p[0], p[1], q[0], q[1]);
        *area += c / 2;
        *sx += c * (p[0] + q[0]) / 6;
        *sy += c * (p[1] + q[1]) / 6;
        *polar += c * (p[0] * p[0] + p[1] * p[1] + p[0] * q[0] + p[1] * q[1] + q[0] * q[0] + q[1] * q[1]) / 12;
    }
}

static bool same_point(const bt_floe_load *p, const bt_floe_load *q)
{
    return p->other == q->other && p->part == q->part && p->point == q->point;
}

bt_section bt_section_of(const bt_split_floe *floe, double area, double polar, const bt_load_case *loads,
                         const bt_chord *chord, double slop)
{
    double a[2], b[2], piece[2 * (BT_MAX_VERTICES + 2)];
    bt_chord_place(floe->n, floe->outline, chord->a, a);
    bt_chord_place(floe->n, floe->outline, chord->b, b);
    bt_section section = {.length = bt_hypot(b[0] - a[0], b[1] - a[1])};
    const double l = section.length, dx = (b[0] - a[0]) / l, dy = (b[1] - a[1]) / l, nx = -dy, ny = dx;
    const double mx = (a[0] + b[0]) / 2, my = (a[1] + b[1]) / 2;
    double area1, sx, sy, polar1;
    moments_about_origin(bt_chord_piece(floe->n, floe->outline, chord, piece), piece, &area1, &sx, &sy, &polar1);
    const double turn = loads->torque / polar;
    double qx = -loads->fx * area1 / area + turn * sy, qy = -loads->fy * area1 / area - turn * sx;
    double moment = -cross(sx, sy, loads->fx, loads->fy) / area - turn * polar1 - cross(mx, my, qx, qy);

    const double at_a = chord->a.edge + chord->a.t, at_b = chord->b.edge + chord->b.t, n = floe->n;
    const double left = at_a >= at_b ? at_a - at_b : at_a - at_b + n, near2 = slop * slop;
    for (int k = 0; k < loads->n; k++) {
        if (!bt_load_acts(loads, k)) continue;
        const bt_edge_load *edge = &loads->load[k];
        const bt_floe_load *force = edge->load;
        const double from_a = square(edge->x - a[0], edge->y - a[1]), from_b = square(edge->x - b[0], edge->y - b[1]);
        const double reach = slop + force->length / 2;
        if (bt_min(from_a, from_b) > reach * reach) {
            const double position = edge->place.edge + edge->place.t;
            if (!((position >= at_b ? position - at_b : position - at_b + n) < left)) continue;
            qx += force->fx, qy += force->fy;
            moment += cross(edge->mean_x - mx, edge->mean_y - my, force->fx, force->fy);
            continue;
        }
        for (int i = 0; i < edge->parts; i++) {
            const double x = edge->part[i].x, y = edge->part[i].y, position = edge->part[i].position;
            const double after_b = position >= at_b ? position - at_b : position - at_b + n;
            const bool at_end = square(x - a[0], y - a[1]) <= near2 || square(x - b[0], y - b[1]) <= near2;
            const double share = (at_end ? 0.5 : after_b < left ? 1 : 0) / edge->parts;
            qx += share * force->fx, qy += share * force->fy;
            moment += share * cross(x - mx, y - my, force->fx, force->fy);
        }
        const int end = from_a <= from_b ? 0 : 1;
        section.at[end].opening += force->opening * fabs(force->edge_x * nx + force->edge_y * ny);
        section.at[end].thrust += (end ? -1 : 1) * (force->fx * dx + force->fy * dy);
        // the peak of a collision follows what persists at the same point, and bears on the same length
        if (!(k > 0 && bt_load_acts(loads, k - 1) && same_point(force, loads->load[k - 1].load)))
            section.at[end].bearing += force->length;
    }
    for (int end = 0; end < 2; end++) {
        section.at[end].thrust = bt_max(0, section.at[end].thrust);
        section.at[end].inertial =
            bt_min(section.at[end].thrust, bt_max(0, (end ? -1 : 1) * (loads->fx * dx + loads->fy * dy)));
    }
    section.width = area / l;
    section.normal = qx * nx + qy * ny + section.at[0].opening + section.at[1].opening;
    section.moment = moment + (section.at[1].opening - section.at[0].opening) * l / 2;
    return section;
}

// --- the cut ---------------------------------------------------------------------------------------------------------

enum { ROOM = 2 * (BT_MAX_VERTICES + 2) };

static const double EQUAL = 1e-9; // share of the whole: if areas differ by less, the cut is symmetric

static bool take(bt_piece *piece, int n, const double *v)
{
    if (n < 3 || n > BT_MAX_VERTICES) return false;
    piece->n = n;
    for (int i = 0; i < n; i++) {
        piece->outline[2 * i] = v[2 * i] - piece->x;
        piece->outline[2 * i + 1] = v[2 * i + 1] - piece->y;
    }
    piece->parts = (bt_parts){0};
    piece->convex = bt_outline_convex(n, piece->outline);
    return piece->convex ||
           (!bt_outline_fault(n, piece->outline) && bt_outline_split(n, piece->outline, &piece->parts));
}

bool bt_split_cut(int n, const double *outline, double area, double polar, const bt_chord *chord, bt_piece piece[2])
{
    double left[ROOM], right[ROOM];
    const bt_chord back = {chord->b, chord->a};
    const int n_left = bt_chord_piece(n, outline, chord, left), n_right = bt_chord_piece(n, outline, &back, right);
    if (n_left < 3 || n_right < 3 || n_left > BT_MAX_VERTICES || n_right > BT_MAX_VERTICES) return false;
    const bt_moments of_left = bt_shape_area_moments(n_left, left), of_right = bt_shape_area_moments(n_right, right);
    const bool left_first = of_left.area >= of_right.area - EQUAL * area;
    const bt_moments *moments = left_first ? &of_left : &of_right;
    const double rest = area - moments->area;
    if (!(moments->area > 0) || !(rest > 0)) return false;
    bt_piece *p = &piece[0], *q = &piece[1];
    p->x = moments->cx, p->y = moments->cy, p->area = moments->area, p->polar = moments->polar, p->left = left_first;
    q->x = -moments->area * moments->cx / rest, q->y = -moments->area * moments->cy / rest, q->area = rest,
    q->left = !left_first;
    q->polar = polar - p->polar - p->area * (p->x * p->x + p->y * p->y) - rest * (q->x * q->x + q->y * q->y);
    if (!(q->polar > 0)) return false;
    return take(p, left_first ? n_left : n_right, left_first ? left : right) &&
           take(q, left_first ? n_right : n_left, left_first ? right : left);
}
