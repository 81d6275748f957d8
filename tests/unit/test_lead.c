// SPDX-License-Identifier: MIT
// The lead in a field: which floes it takes, and what their pieces must be. Overlap with the strip is found here by
// clipping, not by the separating axes that the program uses.
#include "test.h"
#include "bergtow/field.h"
#include "field/lead.h"
#include "bergtow/shape.h"

/// Convex floes all over 40 × 20 m, given by a seed; thickness differs from floe to floe.
static void make_field(bt_field *f, bt_bound ends)
{
    bt_case c;
    bt_errors err = {0};
    bt_case_defaults(&c);
    c.run.dt = 0.1, c.run.duration = 1;
    c.domain.length = 40, c.domain.width = 20;
    c.domain.ends = ends;
    c.ice.concentration = 0.75, c.ice.size = 2, c.ice.size_law = BT_SIZE_LOGNORMAL, c.ice.size_spread = 0.4;
    c.ice.thickness_law = BT_THICK_LOGNORMAL, c.ice.shake = 3;
    c.body.shape = BT_BODY_ABSENT;
    c.tow.mode = BT_TOW_NONE;
    assert_int_equal(bt_case_finish(&c, &err), BT_OK);
    bt_field_init(f);
    assert_int_equal(bt_field_generate(&c, f, &err), BT_OK);
    assert_true(f->n > 100);
    bt_case_free(&c);
}

/// Outline of floe i in the domain, moved by (dx, dy).
static int placed(const bt_field *f, bt_idx i, double dx, double dy, double *v)
{
    const int n = (int)(f->offsets[i + 1] - f->offsets[i]);
    const double *p = f->pose + 3 * (size_t)i, c = cos(p[2]), s = sin(p[2]);
    for (int k = 0; k < n; k++) {
        const double *q = f->vertices + 2 * (f->offsets[i] + k);
        v[2 * k] = p[0] + c * q[0] - s * q[1] + dx;
        v[2 * k + 1] = p[1] + s * q[0] + c * q[1] + dy;
    }
    return n;
}

static double clipped(int n, const double *v, double ux, double uy, double low, double high)
{
    double a[2 * (BT_MAX_VERTICES + 2)], b[2 * (BT_MAX_VERTICES + 2)];
    n = bt_shape_clip(n, v, ux, uy, high, a);
    n = bt_shape_clip(n, a, -ux, -uy, -low, b);
    return n >= 3 ? bt_shape_moments(n, b).area : 0;
}

/// Area of floe i (an image of it) within the legs of the strip, plus 1 if a joint's centre is nearer than half the
/// width.
static double within(const bt_lead *l, const bt_field *f, bt_idx i, double dx, double dy)
{
    double v[2 * BT_MAX_VERTICES], a[2 * (BT_MAX_VERTICES + 2)], b[2 * (BT_MAX_VERTICES + 2)], most = 0;
    const int n = placed(f, i, dx, dy, v);
    for (int k = 0; k + 1 < l->n; k++) {
        const double *p = l->path + 2 * k, *q = p + 2, length = hypot(q[0] - p[0], q[1] - p[1]),
                     ux = (q[0] - p[0]) / length, uy = (q[1] - p[1]) / length;
        const double along = ux * p[0] + uy * p[1], across = -uy * p[0] + ux * p[1];
        int m = bt_shape_clip(n, v, ux, uy, along + length, a);
        m = bt_shape_clip(m, a, -ux, -uy, -along, b);
        if (m >= 3) most = bt_max(most, clipped(m, b, -uy, ux, across - 0.5 * l->width, across + 0.5 * l->width));
        for (int e = 0; k > 0 && e < n; e++) { // distance of the joint from an edge
            const double *s = v + 2 * e, *t = v + 2 * ((e + 1) % n), ex = t[0] - s[0], ey = t[1] - s[1];
            const double at = bt_max(0, bt_min(1, ((p[0] - s[0]) * ex + (p[1] - s[1]) * ey) / (ex * ex + ey * ey)));
            // the round has 32 sides
            if (hypot(s[0] + at * ex - p[0], s[1] + at * ey - p[1]) < 0.5 * l->width * 0.99) most = bt_max(most, 1);
        }
    }
    return most;
}

static bool same_floe(const bt_field *f, bt_idx i, const bt_field *g, bt_idx j)
{
    const int64_t n = f->offsets[i + 1] - f->offsets[i];
    return n == g->offsets[j + 1] - g->offsets[j] && f->thickness[i] == g->thickness[j] && f->area[i] == g->area[j] &&
           !memcmp(f->pose + 3 * (size_t)i, g->pose + 3 * (size_t)j, 3 * sizeof(double)) &&
           !memcmp(f->vertices + 2 * f->offsets[i], g->vertices + 2 * g->offsets[j], 2 * (size_t)n * sizeof(double));
}

static const double bend[] = {3, -4, 18, 2, 22, -6, 36, -5};

TEST(channel_takes_what_it_overlaps)
{
    const bt_lead l = {.mode = BT_LEAD_CHANNEL, .width = 3, .n = 4, .path = bend};
    bt_field f, before;
    make_field(&f, BT_BOUND_WALL);
    make_field(&before, BT_BOUND_WALL);
    bt_lead_stats s;
    bt_errors err = {0};
    assert_int_equal(bt_lead_cut(&l, &f, &s, &err), BT_OK);
    bt_idx kept = 0, taken = 0;
    double area = 0;
    for (bt_idx i = 0; i < before.n; i++) {
        const double in = within(&l, &before, i, 0, 0);
        if (kept < f.n && same_floe(&before, i, &f, kept)) { // in its old order, to the bit
            assert_true(in < 1e-6);
            kept++;
        } else {
            // A floe at the rim of a joint's round may be taken without one percent of the width being within it.
            if (in == 0) {
                bt_lead wider = l;
                wider.width *= 1.03;
                assert_true(within(&wider, &before, i, 0, 0) > 0);
            }
            taken++;
            area += before.area[i];
        }
    }
    assert_int_equal(kept, f.n);
    assert_true(taken > 20);
    assert_int_equal(s.taken, taken);
    assert_int_equal(s.pieces, 0);
    assert_true(fabs(s.area_taken - area) < 1e-9 * area);
    assert_true(fabs(s.length - (hypot(15, 6) + hypot(4, 8) + hypot(14, 1))) < 1e-12);
    assert_true(fabs(s.concentration_before - before.concentration) < 1e-15 &&
                fabs(f.concentration - (before.concentration - area / f.ice_area)) < 1e-12);
    assert_true(s.concentration_after == f.concentration);
    bt_field_free(&f);
    bt_field_free(&before);
}

/// Do any two floes overlap? By clipping one with the edges of the other.
static double worst_overlap(const bt_field *f)
{
    double worst = 0;
    for (bt_idx i = 0; i < f->n; i++) {
        double v[2 * BT_MAX_VERTICES], w[2 * BT_MAX_VERTICES], a[2 * (2 * BT_MAX_VERTICES + 2)],
            b[2 * (2 * BT_MAX_VERTICES + 2)];
        const int n = placed(f, i, 0, 0, v);
        for (bt_idx j = i + 1; j < f->n; j++) {
            if (hypot(f->pose[3 * i] - f->pose[3 * j], f->pose[3 * i + 1] - f->pose[3 * j + 1]) > 8) continue;
            const int nw = placed(f, j, 0, 0, w);
            int m = n;
            memcpy(a, v, 2 * (size_t)n * sizeof *v);
            for (int e = 0; e < nw && m >= 3; e++) {
                const double *p = w + 2 * e, *q = w + 2 * ((e + 1) % nw), nx = q[1] - p[1], ny = p[0] - q[0];
                m = bt_shape_clip(m, a, nx, ny, nx * p[0] + ny * p[1], b);
                memcpy(a, b, 2 * (size_t)m * sizeof *b);
            }
            if (m >= 3) worst = bt_max(worst, bt_shape_moments(m, a).area);
        }
    }
    return worst;
}

TEST(managed_pieces_are_small_and_keep_the_mass)
{
    const bt_lead l = {.mode = BT_LEAD_MANAGED, .width = 3, .floe_size = 0.8, .n = 4, .path = bend};
    const double largest = BT_PI / 4 * 0.64;
    bt_field f, before;
    make_field(&f, BT_BOUND_WALL);
    make_field(&before, BT_BOUND_WALL);
    bt_lead_stats s;
    bt_errors err = {0};
    assert_int_equal(bt_lead_cut(&l, &f, &s, &err), BT_OK);
    bt_idx j = 0, cut = 0, pieces = 0, large_outside = 0;
    for (bt_idx i = 0; i < before.n; i++) {
        if (same_floe(&before, i, &f, j)) {
            assert_true(within(&l, &before, i, 0, 0) < 1e-6 || before.area[i] <= largest);
            j++;
            continue;
        }
        // Its pieces stand in its place until its mass is used up.
        const double mass = before.area[i] * before.thickness[i];
        double sum = 0, area = 0, h = f.thickness[j];
        while (j < f.n && sum < mass * (1 - 1e-9)) {
            assert_true(f.thickness[j] == h && h > before.thickness[i] && h < 1.005 * before.thickness[i]);
            assert_null(bt_shape_fault((int)(f.offsets[j + 1] - f.offsets[j]), f.vertices + 2 * f.offsets[j]));
            assert_true(f.area[j] > largest / 2.5);
            if (f.area[j] > largest) {
                assert_true(within(&l, &f, j, 0, 0) < 1e-6);
                large_outside++;
            }
            sum += f.area[j] * f.thickness[j], area += f.area[j];
            j++, pieces++;
        }
        assert_true(fabs(sum - mass) < 1e-12 * mass);
        assert_true(area < before.area[i] && area > 0.995 * before.area[i]);
        cut++;
    }
    assert_int_equal(j, f.n);
    assert_true(cut > 20 && pieces > 4 * cut && large_outside > 5);
    // small floes in the strip are a piece each
    assert_true(s.taken >= cut && s.pieces >= pieces && s.pieces - pieces == s.taken - cut);
    assert_true(s.mean_piece > 0.5 && s.mean_piece < 1);
    assert_true(worst_overlap(&f) == 0);
    // Cut already: nothing is left to cut.
    bt_lead_stats again;
    const bt_idx n = f.n;
    assert_int_equal(bt_lead_cut(&l, &f, &again, &err), BT_OK);
    assert_int_equal(f.n, n);
    bt_field_free(&f);
    bt_field_free(&before);
}

/// In a periodic domain the strip goes on at the other end, as often as it is long, and pieces stay in the domain.
TEST(a_lead_goes_over_the_seam)
{
    const double path[] = {30, 0, 30 + 60, 0}; // to x = 10 of the next period but one: the whole width of the domain
    for (int managed = 0; managed < 2; managed++) {
        const bt_lead l = {.mode = managed ? BT_LEAD_MANAGED : BT_LEAD_CHANNEL,
                           .width = 2,
                           .floe_size = 0.7,
                           .n = 2,
                           .path = path,
                           .period_x = 40,
                           .y0 = -10};
        bt_field f;
        make_field(&f, BT_BOUND_PERIODIC);
        bt_lead_stats s;
        bt_errors err = {0};
        assert_int_equal(bt_lead_cut(&l, &f, &s, &err), BT_OK);
        for (bt_idx i = 0; i < f.n; i++) {
            assert_true(f.pose[3 * i] >= 0 && f.pose[3 * i] < 40);
            double in = 0;
            for (int k = -1; k <= 3; k++) in = bt_max(in, within(&l, &f, i, 40 * k, 0));
            assert_true(in < 1e-6 || (managed && f.area[i] <= BT_PI / 4 * 0.49));
        }
        assert_true(s.taken > 15);
        bt_field_free(&f);
    }
}

/// Of a field file that does not say where its ice region is, nobody knows the concentration after a lead.
TEST(an_unnamed_region_leaves_the_concentration_unknown)
{
    bt_case c;
    bt_case_defaults(&c);
    c.domain.length = 40, c.domain.width = 20, c.domain.y0 = -10;
    c.ice.field = (char[]){"old.h5"};
    c.body.x = 10;
    c.lead.mode = BT_LEAD_CHANNEL, c.lead.width = 4, c.lead.length = 20;
    for (int named = 0; named < 2; named++) {
        bt_field f;
        make_field(&f, BT_BOUND_WALL);
        f.ice_area = 400, f.concentration = 0.75; // of the half up to x = 20
        if (named) memcpy(f.outlines.region, (double[]){0, -10, 20, 10}, sizeof f.outlines.region);
        bt_lead_stats s;
        bt_errors err = {0};
        assert_int_equal(bt_lead_open(&c, &f, &s, &err), BT_OK);
        assert_int_equal(isnan(s.concentration_after) != 0, !named);
        assert_true(f.concentration > 0.5 && f.concentration < 0.74);
        bt_field_free(&f);
    }
    c.ice.field = NULL;
    bt_case_free(&c);
}

TEST(too_many_pieces_are_refused)
{
    const bt_lead l = {.name = "a.yml", .mode = BT_LEAD_MANAGED, .width = 3, .floe_size = 1e-4, .n = 4, .path = bend};
    bt_field f;
    make_field(&f, BT_BOUND_WALL);
    const bt_idx n = f.n;
    bt_lead_stats s;
    bt_errors err = {0};
    assert_int_equal(bt_lead_cut(&l, &f, &s, &err), BT_ERR_CASE);
    assert_int_equal(f.n, n);
    assert_int_equal(err.n, 1);
    assert_non_null(strstr(err.text[0], "a.yml: lead.floe_size: 0.0001 m makes up to"));
    bt_errors_free(&err);
    bt_field_free(&f);
}

TEST_MAIN(NULL, NULL)
