// SPDX-License-Identifier: MIT
// Speed, way and time of a tow; equations in case/speed_law.h.
#include "case/speed_law.h"

#include <math.h>

#include "bergtow/base.h"

double bt_speed_law_at(const bt_speed_law *l, double t)
{
    if (l->n > 0) {
        const double *p = l->programme, *last = p + 2 * (l->n - 1);
        if (t <= p[0]) return p[1];
        while (p < last && t >= p[2]) p += 2;
        return p == last ? p[1] : p[1] + (p[3] - p[1]) * ((t - p[0]) / (p[2] - p[0]));
    }
    if (t <= 0) return l->ramp > 0 ? 0 : l->speed;
    return l->ramp > 0 && t < l->ramp ? l->speed * (t / l->ramp) : l->speed;
}

double bt_speed_law_way(const bt_speed_law *l, double t)
{
    if (l->n > 0) {
        const double *p = l->programme;
        double way = bt_min(t, p[0]) * p[1]; // constant before the first
        for (int i = 0; i + 1 < l->n && t > p[2 * i]; i++) {
            const double dt = p[2 * i + 2] - p[2 * i], rise = (p[2 * i + 3] - p[2 * i + 1]) / dt,
                         s = bt_min(t - p[2 * i], dt);
            way += s * (p[2 * i + 1] + 0.5 * rise * s);
        }
        return way + bt_max(0, t - p[2 * l->n - 2]) * p[2 * l->n - 1];
    }
    return l->speed * (t < l->ramp ? t * t / (2 * l->ramp) : t - l->ramp / 2);
}

double bt_speed_law_time(const bt_speed_law *l, double way, double latest)
{
    if (l->n == 0)
        return way < l->speed * l->ramp / 2 ? sqrt(2 * l->ramp * way / l->speed) : way / l->speed + l->ramp / 2;
    double low = 0, high = latest;
    for (int i = 0; i < 100; i++) {
        const double mid = 0.5 * (low + high);
        if (bt_speed_law_way(l, mid) < way) low = mid;
        else high = mid;
    }
    return low;
}

double bt_speed_law_led(const bt_speed_law *l, int64_t n, double dt)
{
    const double ramp[] = {0, 0, l->ramp, l->speed}, *p = l->n > 0 ? l->programme : ramp;
    const int points = l->n > 0 ? l->n : 2;
    double sum = 0;
    int64_t k = 1; // of the steps that end in one linear piece the mean speed is that of the first and the last
    for (int i = 0; i <= points && k <= n; i++) {
        const double ends = i < points ? floor(p[2 * i] / dt) : INFINITY;
        const int64_t last = ends < (double)n ? (int64_t)ends : n;
        if (last < k) continue;
        sum += 0.5 * (double)(last - k + 1) *
               (bt_speed_law_at(l, (double)k * dt) + bt_speed_law_at(l, (double)last * dt));
        k = last + 1;
    }
    return dt * sum;
}
