// SPDX-License-Identifier: MIT
// Shortest paths of bounded curvature between two poses [Dubins 1957, Am. J. Math. 79].
//
// In units of the radius, and relative to the start. A unit circle lies to the left or right of each pose. Circles of
// the same sense are joined by an outer tangent, as long as the distance D of their centres; of opposite sense by an
// inner one, √(D² − 4) long. Or there are three arcs, the middle one on a circle that touches both; D <= 4.
#include "bergtow/route.h"

#include "base/elementary.h"
#include "base/inside.h"

/// a modulo 2π, 0 <= a < 2π; 0 for values that rounding puts just below 2π.
static double turn_of(double a)
{
    a -= 2 * BT_PI * floor(a / (2 * BT_PI));
    return a > 2 * BT_PI - 1e-9 ? 0 : a;
}

double bt_route_word(const double from[3], const double to[3], double radius, int word, double leg[3][2])
{
    BT_PLAIN_NUMBERS;
    static const int sense[6][3] = {{1, 0, 1}, {-1, 0, -1}, {1, 0, -1}, {-1, 0, 1}, {-1, 1, -1}, {1, -1, 1}};
    const int *w = sense[word];
    double s0, c0, s1, c1;
    bt_sincos(from[2], &s0, &c0);
    bt_sincos(to[2], &s1, &c1);
    // from the centre of the first circle to that of the last
    const double dx = (to[0] - from[0]) / radius - w[2] * s1 + w[0] * s0;
    const double dy = (to[1] - from[1]) / radius + w[2] * c1 - w[0] * c0;
    const double far = bt_hypot(dx, dy), way = bt_atan2(dy, dx);
    double heading, middle = 0; // as the path leaves the first circle; length of the middle part
    double last;                // heading as it enters the last circle
    if (w[1] == 0) {
        const double square = w[0] == w[2] ? far * far : far * far - 4;
        if (square < 0) return INFINITY;
        middle = sqrt(square);
        heading = w[0] == w[2] ? way : way + w[0] * bt_atan2(2, middle);
        if (w[0] == w[2] && far < 1e-12) heading = from[2]; // the same circle
        last = heading;
    } else {
        if (far > 4) return INFINITY;
        // the three centres form an isosceles triangle with sides 2, 2, far; the middle one lies left of the line from
        // the first to the last for LRL, right of it for RLR, which makes the middle arc longer than half a circle
        const double cosine = far / 4, angle = bt_atan2(sqrt(bt_max(0, 1 - cosine * cosine)), cosine);
        const double to_middle = way + w[0] * angle; // direction from the first centre to the middle one
        heading = to_middle + w[0] * 0.5 * BT_PI;
        const double from_middle = way - w[0] * angle + BT_PI; // from the last centre to the middle one
        last = from_middle + w[2] * 0.5 * BT_PI;
        middle = turn_of(w[1] * (last - heading));
    }
    const double part[3] = {turn_of(w[0] * (heading - from[2])), middle, turn_of(w[2] * (to[2] - last))};
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        leg[k][0] = part[k] * radius;
        leg[k][1] = w[k] / radius;
        sum += leg[k][0];
    }
    return sum;
}

double bt_route_dubins(const double from[3], const double to[3], double radius, double leg[3][2])
{
    BT_PLAIN_NUMBERS;
    double best = INFINITY, tried[3][2];
    for (int word = 0; word < 6; word++) {
        const double length = bt_route_word(from, to, radius, word, tried);
        if (length < best) {
            best = length;
            for (int k = 0; k < 3; k++) leg[k][0] = tried[k][0], leg[k][1] = tried[k][1];
        }
    }
    return best;
}
