// SPDX-License-Identifier: MIT
// Sizes of floes as drawn from the law of the case (case/size_law.h), and as they came out.
#include "field/field_make.h"
#include "case/warning.h"

#include <math.h>

#include "base/elementary.h"
#include "base/rng.h"
#include "case/case_derived.h"
#include "case/size_law.h"

#define LEAST_SPREAD 1e-6 // a distribution narrower than this has numbers that no double holds: 1/spread²

double bt_sizes_draw(const bt_sizes *s, int64_t seed, int64_t id)
{
    bt_rng r = bt_rng_start(seed, BT_RNG_SIZE, id);
    if (s->law == BT_SIZE_POWER) {
        // inverse of P(>d) = u
        double q = bt_pow(s->max / s->min, -s->exponent), u = 1 - bt_rng_uniform(&r);
        return s->min * bt_pow(q + u * (1 - q), -1 / s->exponent);
    }
    if (s->spread < LEAST_SPREAD) return s->mean;
    for (;;) {
        double d;
        if (s->law == BT_SIZE_LOGNORMAL) {
            d = bt_exp(s->mu + s->sigma * bt_rng_normal(&r));
            if (d >= s->min && (s->max <= 0 || d <= s->max)) return d;
        } else {
            d = s->scale * bt_rng_gamma(&r, 1 / (s->spread * s->spread));
            if (d >= BT_SINGLE_LEAST * s->mean) return d;
        }
    }
}

#define SIZE_OFF 0.05   // of the mean, from which on it is said
#define SPREAD_OFF 0.1  // of the spread, likewise
#define BELOW_OFF 0.01  // of the floes, likewise
#define BELOW_SLACK 1e-2 // of size_min: a common factor near 1 brings the areas to the concentration

/// Every floe is one that the size law drew, put into a cell.
static bool as_drawn(const bt_case *c) { return !bt_case_reads_field(c) && c->lead.mode == BT_LEAD_NONE; }

bt_field_sizes bt_field_sizes_of(const bt_case *c, const bt_field *f)
{
    const double limit = as_drawn(c) && c->ice.size_law != BT_SIZE_SINGLE ? (1 - BELOW_SLACK) * c->ice.size_min : 0;
    bt_field_sizes s = {.n = f->n, .mean = bt_field_mean_size(f), .least = INFINITY};
    for (bt_idx i = 0; i < f->n; i++) {
        const double d = sqrt(4 * f->area[i] / BT_PI);
        s.below += d < limit;
        s.least = bt_min(s.least, d);
    }
    return s;
}

void bt_field_size_warn(const bt_case *c, const bt_field_sizes *found, bt_errors *warnings)
{
    bt_sizes s;
    bt_errors refused = {0}; // such a case makes no ice
    const bt_idx n = found->n;
    if (as_drawn(c) && n > 0 && bt_sizes_init(&s, c, &refused) == BT_OK) {
        const double mean = bt_sizes_mean(&s), second = bt_sizes_mean_area(&s) * 4 / BT_PI;
        const double scatter = sqrt(bt_max(second - mean * mean, 0) / n), off = found->mean - mean;
        if (fabs(off) > SIZE_OFF * mean && fabs(off) > 2 * scatter)
            bt_warn(warnings, BT_WARN_MEAN_SIZE,
                    "the %d floes have a mean diameter of %.3g m, %.0f %% %s than that of ice.size_law: at a "
                    "wide spread small floes are drawn again, or find no place; %s, or "
                    "count on the diameter that was made",
                    (int)n, found->mean, 100 * fabs(off) / mean, off > 0 ? "more" : "less",
                    s.law == BT_SIZE_POWER ? "narrow ice.size_min to size_max" : "lower ice.size_spread");
        const double spread = sqrt(bt_max(second - mean * mean, 0)) / mean;
        if (s.law != BT_SIZE_POWER && spread < (1 - SPREAD_OFF) * s.spread)
            bt_warn(warnings, BT_WARN_SPREAD,
                    "%s the sizes a spread of %.2g, where ice.size_spread asks for %.2g: all that is drawn "
                    "beyond is drawn again; %slower ice.size_spread",
                    s.law == BT_SIZE_LOGNORMAL ? "ice.size_min and ice.size_max leave"
                                               : "a least size of a tenth of the mean leaves",
                    spread, s.spread, s.law == BT_SIZE_LOGNORMAL ? "move them apart, or " : "");
        if (found->below > BELOW_OFF * n)
            bt_warn(warnings, BT_WARN_SMALL_FLOES,
                    "%d of the %d floes, %.2g %%, are smaller than ice.size_min, down to %.3g m: small floes "
                    "get the room that larger ones leave them; narrow the range of sizes, or lower the "
                    "concentration",
                    (int)found->below, (int)n, 100.0 * found->below / n, found->least);
    }
    bt_errors_free(&refused);
}
