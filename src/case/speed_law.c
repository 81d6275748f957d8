// SPDX-License-Identifier: MIT
// Speed, way and time of a tow; equations in case/speed_law.h.
#include "case/speed_law.h"

#include <math.h>

#include "bergtow/base.h"

double bt_speed_law_at(const bt_speed_law *law, double t)
{
    if (law->n > 0) {
        const double *p = law->programme, *last = p + 2 * (law->n - 1);
        if (t <= p[0]) return p[1];
        while (p < last && t >= p[2]) p += 2;
        return p == last ? p[1] : p[1] + (p[3] - p[1]) * ((t - p[0]) / (p[2] - p[0]));
    }
    if (t <= 0) return law->ramp > 0 ? 0 : law->speed;
    return law->ramp > 0 && t < law->ramp ? law->speed * (t / law->ramp) : law->speed;
}

double bt_speed_law_way(const bt_speed_law *law, double t)
{
    if (law->n > 0) {
        const double *p = law->programme;
        double way = bt_min(t, p[0]) * p[1]; // constant before the first
        for (int i = 0; i + 1 < law->n && t > p[2 * i]; i++) {
            const double dt = p[2 * i + 2] - p[2 * i], rise = (p[2 * i + 3] - p[2 * i + 1]) / dt,
                         s = bt_min(t - p[2 * i], dt);
            way += s * (p[2 * i + 1] + 0.5 * rise * s);
        }
        return way + bt_max(0, t - p[2 * law->n - 2]) * p[2 * law->n - 1];
    }
    return law->speed * (t < law->ramp ? t * t / (2 * law->ramp) : t - law->ramp / 2);
}

double bt_speed_law_time(const bt_speed_law *law, double way, double latest)
{
    if (law->n == 0)
        return way < law->speed * law->ramp / 2 ? sqrt(2 * law->ramp * way / law->speed)
                                                : way / law->speed + law->ramp / 2;
    double low = 0, high = latest;
    for (int i = 0; i < 100; i++) {
        const double mid = 0.5 * (low + high);
        if (bt_speed_law_way(law, mid) < way) low = mid;
        else high = mid;
    }
    return low;
}

double bt_speed_law_led(const bt_speed_law *law, int64_t n, double dt)
{
    const double ramp[] = {0, 0, law->ramp, law->speed}, *p = law->n > 0 ? law->programme : ramp;
    const int points = law->n > 0 ? law->n : 2;
    double sum = 0;
    int64_t k = 1; // steps that end in one linear piece have the mean speed of the first and the last of them
    for (int i = 0; i <= points && k <= n; i++) {
        const double ends = i < points ? floor(p[2 * i] / dt) : INFINITY;
        const int64_t last = ends < (double)n ? (int64_t)ends : n;
        if (last < k) continue;
        sum += 0.5 * (double)(last - k + 1) *
               (bt_speed_law_at(law, (double)k * dt) + bt_speed_law_at(law, (double)last * dt));
        k = last + 1;
    }
    return dt * sum;
}
