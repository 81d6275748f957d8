// SPDX-License-Identifier: MIT
// The Froude-scaled twin of a case.
//
// With gravity and all densities kept, every equation of the model stays the same if lengths grow by L, times and
// speeds by √L, masses and forces by L³ and pressures by L: the Froude number V/√(g l) is that of the original. The
// kind of unit in the schema gives the exponent of a key (bt_units_froude), except for the keys in the table below.
#include "bergtow/case.h"

#include <string.h>

#include "base/inside.h"
#include "case/case_check.h"
#include "case/schema.h"

static const struct {
    const char *key;
    double exponent;
} exceptions[] = {
    {"output.progress", 0},        // wall time
    {"output.checkpoint_wall", 0},
    {"estimate.p_star", 0},        // at full scale; the length scale converts them to the scale of the case
    {"estimate.p_s", 0},
    {"estimate.length_scale", -1}, // full scale / case
};

// Texts that stand for no numbers with a dimension. Any other may name a file, which would have to be scaled as well;
// at scale 1 the twin uses the same file.
static const char *const plain_texts[] = {"run.title",       "reference.source", "report.client",
                                         "report.project",  "report.author",    "report.document",
                                         "report.revision", "report.distribution"};

// L^e. Square roots are correctly rounded: if L is a power of 4, the numbers of the twin have the same bits as those of
// the original, except for their exponents.
static double power(double ratio, double e)
{
    const double whole = floor(e);
    double f = e == whole ? 1 : sqrt(ratio);
    for (int i = 0; i < (int)fabs(whole); i++) f = whole > 0 ? f * ratio : f / ratio;
    return f;
}

static double factor(const bt_key *key, double ratio)
{
    for (size_t i = 0; i < sizeof exceptions / sizeof *exceptions; i++)
        if (!strcmp(key->name, exceptions[i].key)) return power(ratio, exceptions[i].exponent);
    return power(ratio, bt_units_froude(key->unit));
}

static void refuse_range(const bt_case *input, const bt_key *key, double value, double ratio, bt_errors *err)
{
    char why[BT_WHY];
    double one = 1; // in the unit of the range
    bt_units_parse("1", key->unit, &one, why);
    const char *unit = bt_units_bare(key->unit);
    bt_errors_add(err, "%s: %s: becomes %g in the twin of scale %g, out of its range %s%s%s; use a scale nearer to 1",
                  bt_case_name(input), key->name, value / one, ratio, key->range,
                  strcmp(unit, "-") ? " " : "", strcmp(unit, "-") ? unit : "");
}

static void scale_real(const bt_case *input, const bt_key *key, double *v, double ratio, bt_errors *err)
{
    // A negative window start is sought by the run, and a negative frame interval means no frames.
    const bool found = !strcmp(key->name, "output.window_start") || !strcmp(key->name, "output.frame_interval");
    if (isnan(*v) || (found && *v < 0)) return; // not a quantity that scales
    *v *= factor(key, ratio);
    bt_range range;
    bt_value_range(key, &range);
    if ((range.lo_open ? *v > range.lo : *v >= range.lo) && (range.hi_open ? *v < range.hi : *v <= range.hi)) return;
    refuse_range(input, key, *v, ratio, err);
}

static bool is_plain(const char *name)
{
    for (size_t i = 0; i < sizeof plain_texts / sizeof *plain_texts; i++)
        if (!strcmp(name, plain_texts[i])) return true;
    return false;
}

static void scale_members(const bt_case *input, const bt_key *keys, int n, void *base, double ratio, bt_errors *err)
{
    for (int i = 0; i < n; i++) {
        const bt_key *key = &keys[i];
        char *member = (char *)base + key->offset;
        switch (key->type) {
        case BT_KEY_REAL: {
            double v;
            memcpy(&v, member, sizeof v);
            scale_real(input, key, &v, ratio, err);
            memcpy(member, &v, sizeof v);
            break;
        }
        case BT_KEY_POINTS: {
            double *p;
            int count;
            memcpy(&p, member, sizeof p);
            memcpy(&count, (char *)base + key->offset_count, sizeof count);
            const bt_key column[2] = {bt_schema_column(key, 0), bt_schema_column(key, 1)};
            for (int j = 0; j < 2 * count; j++) scale_real(input, &column[j % 2], &p[j], ratio, err);
            break;
        }
        case BT_KEY_TEXT: {
            const char *text;
            memcpy(&text, member, sizeof text);
            if (text && ratio != 1 && !is_plain(key->name))
                bt_errors_add(
                    err, "%s: %s: %s cannot be scaled with the case; remove the key, or make such a file for the twin",
                    bt_case_name(input), key->name, text);
            break;
        }
        case BT_KEY_INT:
        case BT_KEY_BOOL:
        case BT_KEY_CHOICE:
        case BT_KEY_MAP: break;
        }
    }
}

bt_status bt_case_scale(bt_case *input, double ratio, bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    const size_t before = err->n;
    bool *was = bt_alloc((size_t)bt_n_case_keys, sizeof *was), *now = bt_alloc((size_t)bt_n_case_keys, 1);
    bt_case_mark_idle(input, was);
    scale_members(input, bt_case_keys, bt_n_case_keys, input, ratio, err);
    for (bt_idx i = 0; i < input->n_floes; i++)
        scale_members(input, bt_floe_keys, bt_n_floe_keys, &input->floes[i], ratio, err);
    if (err->n > before) {
        free(was);
        free(now);
        return BT_ERR_CASE;
    }
    // EA and strength of a rope grow with d², those of the twin with L³: the twin has their numbers, not the name.
    if (ratio != 1) input->tow.line.type = BT_ROPE_NUMBERS, input->tow.line.diameter = 0;
    // A default without effect that was scaled would look like a value that somebody gave.
    for (bool more = true; more;) { // one default may follow from another
        more = false;
        memset(now, 0, (size_t)bt_n_case_keys * sizeof *now);
        bt_case_mark_idle(input, now);
        for (int i = 0; i < bt_n_case_keys; i++)
            if (now[i] && !was[i]) bt_case_put_default(input, i), more = true;
    }
    free(was);
    free(now);
    // domain.ahead follows from body.x, which is a default again without a body.
    if (input->domain.ends != BT_BOUND_MOVING) input->domain.ahead = bt_case_window_ahead(input);
    return bt_case_finish(input, err);
}

char *bt_case_scaled_text(const bt_case *twin, double ratio)
{
    BT_PLAIN_NUMBERS;
    const char *path = twin->path ? twin->path : "a case";
    const char *coriolis = twin->water.latitude == 0
                               ? ""
                               : "#   - The earth turns as it does (water.latitude is kept): Coriolis force / inertia "
                                 "is sqrt(L) times that of the original.\n";
    char *head = bt_text_of(
        "# The Froude-scaled twin of %s, L = %.17g: lengths times L; times and speeds sqrt(L); rates of turn "
        "1/sqrt(L); masses,\n"
        "# forces and stiffnesses EA L^3; dampings L^(5/2); forces per length L^2; pressures L; fracture toughness "
        "L^(3/2); densities, angles and ratios as they were.\n"
        "# In this model it moves alike in sqrt(L) times the time. What is not similar between a model and full "
        "scale:\n"
        "#   - Drag coefficients are kept, though they depend on the Reynolds number, which is L^(3/2) times that "
        "of the original.\n"
        "#   - Pressures of the ice scale with L, those of real ice do not; estimate.p_star and estimate.p_s are "
        "those of full scale, and\n"
        "#     estimate.length_scale brings them here. Friction and restitution are kept.\n"
        "#   - A named tow line has become its numbers: a rope of L times the diameter has L^2 times the stiffness.\n"
        "%s# The field made from the seed is the original's, scaled, to the last bit when L is a power of 4 and "
        "ice.size_law is not lognormal.\n"
        "# Otherwise rounding changes the shaken field into another of the same statistics (not so with "
        "ice.shake: 0).\n"
        "# Every key with its value in SI units, and what it means; the sources named are those of the defaults.\n",
        path, ratio, coriolis);
    char *text = bt_case_text(twin, head);
    free(head);
    return text;
}
