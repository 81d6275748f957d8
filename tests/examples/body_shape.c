// SPDX-License-Identifier: MIT
// Example of a body shape of one's own: a barge with half-round ends, length l over all, width w <= l.
#include "bergtow/shape.h"

#include <math.h>

static int capsule(double l, double w, double *v)
{
    enum { ARC = 12 };
    const double r = 0.5 * w, straight = fmax(0, 0.5 * l - r), pi = 3.14159265358979;
    int n = 0;
    for (int end = 0; end < 2; end++)
        for (int k = 0; k <= ARC; k++) {
            const double angle = pi * ((double)k / ARC - 0.5 + end);
            v[2 * n] = (end ? -straight : straight) + r * cos(angle);
            v[2 * n + 1] = r * sin(angle);
            n++;
        }
    return n;
}
