// SPDX-License-Identifier: MIT
// Areas of polygons in the cells of a raster, and loads; route/ice.h.
//
// Area. By Green's theorem the area of a polygon in a cell is a sum over its edges. A piece of an edge within a row, of
// height dy at the mean distance f from the left side of its cell, adds dy (1 − f) to that cell and dy to all cells to
// the right of it: two numbers, and one running sum along the row at the end for all polygons together. Exact to
// rounding for any simple polygon. Rejected: clipping each polygon to each cell, which gives the same areas at ten
// times the work.
// Whole floes. The momentum of an oblique collision falls with the square of the offset. The inverse Abel transform of
// that is a hemisphere over the disc of radius (D + W)/2: the integral of this one raster along a path counts each floe
// by its offset, whatever the heading. A floe that is not round is replaced by the ellipse of its second moments,
// assumed. Rejected: D/W times the area in the swath, which underestimates a large floe that the berg grazes.
// Compaction depends on the ice around the berg, not in its swath: floes that are met push others. A path between floes
// avoids none of it, and it makes detours expensive in dense ice. In 128 tows along arbitrary paths through ice of 40
// and 50 % more than half of the work did not depend on the floes near the path. The averages reach one width and one
// mean floe to each side, assumed.
#include "route/ice.h"

#include "base/elementary.h"
#include "base/inside.h"
#include "bergtow/outline.h"

/// Limit of the factor on f1 in ice so dense that the front would run away; assumed.
#define MAX_COMPACTION 10.0

/// Add a piece of an edge within one row, 0 <= x <= nx.
static void add_piece(double *row, int nx, double xa, double xb, double dy)
{
    const double low = bt_min(xa, xb), high = bt_max(xa, xb);
    int i = (int)low;
    if (i >= nx) return; // nothing on its right
    if (high <= i + 1) {
        const double f = 0.5 * (low + high) - i;
        row[i] += dy * (1 - f);
        row[i + 1] += dy * f;
        return;
    }
    for (double at = low; at < high && i < nx; i++) {
        const double next = bt_min(high, i + 1), part = dy * (next - at) / (high - low), f = 0.5 * (at + next) - i;
        row[i] += part * (1 - f);
        row[i + 1] += part * f;
        at = next;
    }
}

/// The same for any x: parts to the left of the raster are moved to its left side, which keeps the area on their right.
static void add_row(double *row, int nx, double xa, double ya, double xb, double yb, double weight)
{
    const double side[2] = {0, nx};
    double cut[4] = {0, 1, 1, 1};
    int n = 1;
    for (int k = 0; k < 2; k++) {
        const int near = xa < xb ? k : 1 - k;
        if ((xa < side[near]) == (xb < side[near])) continue;
        const double f = (side[near] - xa) / (xb - xa);
        if (f > 0 && f < 1) cut[n++] = f;
    }
    cut[n] = 1;
    for (int k = 0; k < n; k++) {
        const double x0 = xa + cut[k] * (xb - xa), x1 = xa + cut[k + 1] * (xb - xa);
        add_piece(row, nx, bt_min(bt_max(x0, 0), nx), bt_min(bt_max(x1, 0), nx),
                  weight * (cut[k + 1] - cut[k]) * (yb - ya));
    }
}

void bt_route_ice_add(double *sums, int nx, int ny, int64_t n, const double *v, double weight)
{
    if (bt_outline_area2((int)n, v) > 0) weight = -weight; // anticlockwise: the inside is right of a falling edge
    for (int64_t e = 0; e < n; e++) {
        const double *p = v + 2 * e, *q = v + 2 * (e + 1 < n ? e + 1 : 0);
        const double low = bt_max(bt_min(p[1], q[1]), 0), high = bt_min(bt_max(p[1], q[1]), ny);
        if (!(low < high)) continue;
        const double slope = (q[0] - p[0]) / (q[1] - p[1]);
        for (int j = (int)low; j < ny && j < high; j++) {
            const double ya = bt_max(low, j), yb = bt_min(high, j + 1);
            const double xa = p[0] + slope * (ya - p[1]), xb = p[0] + slope * (yb - p[1]);
            double *row = sums + (int64_t)j * (nx + 2);
            if (q[1] > p[1]) add_row(row, nx, xa, ya, xb, yb, weight);
            else add_row(row, nx, xb, yb, xa, ya, weight);
        }
    }
}

void bt_route_ice_sum(double *sums, int nx, int ny)
{
    for (int j = 0; j < ny; j++) {
        double *row = sums + (int64_t)j * (nx + 2), sum = 0;
        for (int i = 0; i < nx; i++) row[i] = sum += row[i];
    }
}

/// Average `sums`, where known, over squares of 2 half + 1 cells; result in `mean`.
static void average(const double *sums, const double *known, int nx, int ny, int half, float *mean)
{
    const int64_t wide = nx + 1;
    double *total[2] = {bt_alloc((size_t)(wide * (ny + 1)), sizeof(double)),
                        bt_alloc((size_t)(wide * (ny + 1)), sizeof(double))};
    for (int a = 0; a < 2; a++)
        for (int j = 0; j < ny; j++) {
            double row = 0;
            for (int i = 0; i < nx; i++) {
                const int64_t k = (int64_t)j * (nx + 2) + i;
                row += a ? known[k] : known[k] * sums[k];
                total[a][(j + 1) * wide + i + 1] = total[a][j * wide + i + 1] + row;
            }
        }
    for (int j = 0; j < ny; j++)
        for (int i = 0; i < nx; i++) {
            const int i0 = i > half ? i - half : 0, i1 = i + half + 1 < nx ? i + half + 1 : nx;
            const int j0 = j > half ? j - half : 0, j1 = j + half + 1 < ny ? j + half + 1 : ny;
            double s[2];
            for (int a = 0; a < 2; a++)
                s[a] = total[a][j1 * wide + i1] - total[a][j0 * wide + i1] - total[a][j1 * wide + i0] +
                       total[a][j0 * wide + i0];
            mean[(int64_t)j * nx + i] = s[1] > 0.01 ? (float)bt_max(0, s[0] / s[1]) : 0;
        }
    free(total[0]);
    free(total[1]);
}

static double weight_of(int field, const bt_route_task *task, int64_t floe)
{
    const double h = task->thickness[floe], mass = task->density * h;
    switch (field) {
    case BT_ICE_COVER: return 1;
    case BT_ICE_MASS:
    case BT_ICE_FLOES: return mass;
    default: return h * h;
    }
}

/// Add the share of a floe in BT_ICE_FLOES to sums [ny][nx + 2], kg/m. The floe has n points v [n][2], in cells, and
/// `mass` kg/m²; w: width of the berg in cells.
static void add_floe(const bt_route_ice *ice, double w, double mass, int64_t n, const double *v, double *sums)
{
    double area = 0, mx = 0, my = 0, xx = 0, xy = 0, yy = 0; // about the first point
    for (int64_t e = 0; e < n; e++) {
        const double *p = v + 2 * e, *q = v + 2 * (e + 1 < n ? e + 1 : 0);
        const double x0 = p[0] - v[0], y0 = p[1] - v[1], x1 = q[0] - v[0], y1 = q[1] - v[1], c = x0 * y1 - x1 * y0;
        area += c / 2, mx += c * (x0 + x1) / 6, my += c * (y0 + y1) / 6;
        xx += c * (x0 * x0 + x0 * x1 + x1 * x1) / 12, yy += c * (y0 * y0 + y0 * y1 + y1 * y1) / 12;
        xy += c * (x0 * (2 * y0 + y1) + x1 * (y0 + 2 * y1)) / 24;
    }
    if (!(fabs(area) > 0)) return;
    mx /= area, my /= area, xx = xx / area - mx * mx, yy = yy / area - my * my, xy = xy / area - mx * my;
    const double half = (xx - yy) / 2, root = bt_hypot(half, xy), angle = 0.5 * bt_atan2(xy, half);
    const double a = 2 * sqrt(bt_max(0, (xx + yy) / 2 + root)), b = 2 * sqrt(bt_max(0, (xx + yy) / 2 - root));
    const double wide = a + w / 2, high = b + w / 2, share = sqrt(a * b / (wide * high));
    const double most = mass * fabs(area) * share * 2 / (BT_PI * sqrt(wide * high)) * ice->cell;
    double sine, cosine;
    bt_sincos(angle, &sine, &cosine);
    mx += v[0], my += v[1];
    const int i0 = (int)bt_max(0, mx - wide), i1 = (int)bt_min(ice->nx, mx + wide + 1);
    const int j0 = (int)bt_max(0, my - wide), j1 = (int)bt_min(ice->ny, my + wide + 1);
    for (int j = j0; j < j1; j++)
        for (int i = i0; i < i1; i++) {
            const double x = i + 0.5 - mx, y = j + 0.5 - my;
            const double along = (x * cosine + y * sine) / wide, across = (y * cosine - x * sine) / high;
            const double inside = 1 - along * along - across * across;
            if (inside > 0) sums[(int64_t)j * (ice->nx + 2) + i] += most * sqrt(inside);
        }
}

static void into_cells(const bt_route_ice *ice, int64_t n, const double *v, double *out)
{
    for (int64_t k = 0; k < n; k++) bt_route_ice_place(ice, v[2 * k], v[2 * k + 1], out + 2 * k);
}

/// Area-weighted mean diameter of the floes, m.
static double mean_size(const bt_route_task *task)
{
    double area = 0, sum = 0;
    for (int64_t i = 0; i < task->n_floes; i++) {
        const int64_t first = task->floe_first[i], n = task->floe_first[i + 1] - first;
        const double a = 0.5 * fabs(bt_outline_area2((int)n, task->floe + 2 * first));
        area += a, sum += a * sqrt(4 * a / BT_PI);
    }
    return area > 0 ? sum / area : 0;
}

void bt_route_ice_make(bt_route_ice *ice, const bt_route_task *task)
{
    const int nx = ice->nx, ny = ice->ny, half = (int)((task->width + mean_size(task)) / ice->cell + 0.5);
    const size_t cells = (size_t)nx * (size_t)ny, padded = (size_t)(nx + 2) * (size_t)ny;
    double *sums = bt_alloc(padded, sizeof *sums), *known = bt_alloc(padded, sizeof *known), *v = NULL;
    const double *e = task->extent, corners[8] = {e[0], e[1], e[2], e[1], e[2], e[3], e[0], e[3]};
    double in_cells[8];
    into_cells(ice, 4, corners, in_cells);
    bt_route_ice_add(known, nx, ny, 4, in_cells, 1);
    bt_route_ice_sum(known, nx, ny);
    for (int f = 0; f < BT_ICE_FIELDS; f++) {
        for (size_t k = 0; k < padded; k++) sums[k] = 0;
        for (int64_t i = 0; i < task->n_floes; i++) {
            const int64_t first = task->floe_first[i], n = task->floe_first[i + 1] - first;
            v = bt_realloc(v, (size_t)n, 2 * sizeof *v);
            into_cells(ice, n, task->floe + 2 * first, v);
            if (f == BT_ICE_FLOES) add_floe(ice, task->width / ice->cell, weight_of(f, task, i), n, v, sums);
            else bt_route_ice_add(sums, nx, ny, n, v, weight_of(f, task, i));
        }
        if (f != BT_ICE_FLOES) bt_route_ice_sum(sums, nx, ny);
        ice->field[f] = bt_alloc(cells, sizeof(float));
        ice->mean[f] = bt_alloc(cells, sizeof(float));
        for (int j = 0; j < ny; j++)
            for (int i = 0; i < nx; i++) { // rounding leaves 1e-13 where there is no ice
                const double x = sums[(int64_t)j * (nx + 2) + i];
                ice->field[f][(int64_t)j * nx + i] = x > 1e-9 ? (float)x : 0;
            }
        average(sums, known, nx, ny, half, ice->mean[f]);
    }
    BT_FREE(v, sums, known);
    ice->n_speeds = task->n_speeds;
    ice->load = bt_alloc(cells * (size_t)task->n_speeds, sizeof(float));
    ice->line = bt_alloc(cells * (size_t)task->n_speeds, sizeof(float));
    for (size_t k = 0; k < cells; k++)
        for (int s = 0; s < task->n_speeds; s++) {
            double term[BT_ROUTE_TERMS], sum = 0;
            bt_route_ice_terms(ice, task, (int64_t)k, task->speed[s], term);
            for (int a = 1; a < BT_ROUTE_TERMS; a++) sum += a == BT_ROUTE_LARGE ? 0 : task->weight[a] * term[a];
            ice->load[k * (size_t)task->n_speeds + (size_t)s] = (float)sum;
            ice->line[k * (size_t)task->n_speeds + (size_t)s] =
                (float)(task->weight[BT_ROUTE_LARGE] * term[BT_ROUTE_LARGE]);
        }
}

void bt_route_ice_terms(const bt_route_ice *ice, const bt_route_task *task, int64_t k, double v,
                        double term[BT_ROUTE_TERMS])
{
    for (int a = 0; a < BT_ROUTE_TERMS; a++) term[a] = 0;
    const double unit = (1 + task->added_mass) * v * v, cover = ice->mean[BT_ICE_COVER][k];
    const double near = unit * (ice->mean[BT_ICE_MASS][k] + ice->mean[BT_ICE_FLOES][k] / task->width);
    const double packed = cover < task->jam_cover ? bt_min(MAX_COMPACTION, 1 / (1 - cover / task->jam_cover))
                                                  : MAX_COMPACTION;
    double most = isfinite(task->rafting) && cover > 0 ? task->rafting * ice->mean[BT_ICE_RAFT][k] / cover : INFINITY;
    most -= term[1] = bt_min(unit * ice->field[BT_ICE_MASS][k], most);
    most -= term[2] = bt_min(near * (packed - 1), most);
    term[BT_ROUTE_LARGE] = bt_min(unit * ice->field[BT_ICE_FLOES][k], task->width * most);
    if (isfinite(task->rafting)) term[4] = task->rafting * ice->field[BT_ICE_RAFT][k];
}

void bt_route_ice_free(bt_route_ice *ice)
{
    for (int f = 0; f < BT_ICE_FIELDS; f++) {
        free(ice->field[f]);
        free(ice->mean[f]);
    }
    free(ice->load);
    free(ice->line);
}
