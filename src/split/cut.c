// SPDX-License-Identifier: MIT
// The cut of an outline along a section (cut.h).
#include "split/cut.h"


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
    const bt_moments of_left = bt_shape_extent(n_left, left), of_right = bt_shape_extent(n_right, right);
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
