// SPDX-License-Identifier: MIT
// Splitting of a floe: closed forms of the law, what a section carries against quadrature, and cuts that lose nothing.
#include "test.h"
#include "base/rng.h"
#include "split/section.h"
#include "split/find.h"
#include "step/splitting.h"

static const double K = 150e3, STRENGTH = 300e3;

static bt_split_law law_of(double least_width)
{
    return (bt_split_law){.toughness = K, .strength = STRENGTH, .least_width = least_width, .aspect = 6, .slop = 1e-6};
}

static void assert_near(double got, double want, double rel)
{
    if (!(fabs(got - want) <= rel * fabs(want)))
        fail_msg("got %.17g, want %.17g (relative %g)", got, want, (got - want) / want);
}

static void assert_within(double got, double want, double error)
{
    if (!(fabs(got - want) <= error)) fail_msg("got %.17g, want %.17g, %g apart", got, want, got - want);
}

/// Outline of a floe about its centroid.
typedef struct floe { int n; double v[2 * BT_MAX_VERTICES]; bool convex; } floe;

static floe rectangle(double l, double w)
{
    return (floe){4, {-l / 2, -w / 2, l / 2, -w / 2, l / 2, w / 2, -l / 2, w / 2}, true};
}

static bt_split_floe seen(const floe *f, double h)
{
    return (bt_split_floe){.n = f->n, .outline = f->v, .convex = f->convex, .thickness = h, .factor = 1};
}

static floe random_floe(bt_rng *r, bool convex)
{
    for (;;) {
        floe f = {.n = 4 + (int)(8 * bt_rng_uniform(r)), .convex = convex};
        const double size = exp(4 * bt_rng_uniform(r)), slim = 0.3 + 0.7 * bt_rng_uniform(r);
        const double turn = 6 * bt_rng_uniform(r);
        for (int i = 0; i < f.n; i++) {
            const double at = 2 * BT_PI * (i + 0.6 * bt_rng_uniform(r)) / f.n,
                         out = size * (convex ? 1 : 0.25 + bt_rng_uniform(r));
            const double x = out * cos(at), y = slim * out * sin(at);
            f.v[2 * i] = x * cos(turn) - y * sin(turn);
            f.v[2 * i + 1] = x * sin(turn) + y * cos(turn);
        }
        bt_shape_centre(f.n, f.v);
        if (!bt_outline_fault(f.n, f.v) && bt_outline_convex(f.n, f.v) == convex) return f;
    }
}

/// A load at a random place of the outline, pushing inwards with friction.
static bt_floe_load random_load(bt_rng *r, const floe *f, double size, int number)
{
    const int i = (int)(f->n * bt_rng_uniform(r)), j = (i + 1) % f->n;
    const double t = bt_rng_uniform(r), ex = f->v[2 * j] - f->v[2 * i], ey = f->v[2 * j + 1] - f->v[2 * i + 1];
    const double l = hypot(ex, ey), push = size * bt_rng_uniform(r), drag = push * (0.6 * bt_rng_uniform(r) - 0.3);
    return (bt_floe_load){.x = f->v[2 * i] + t * ex, .y = f->v[2 * i + 1] + t * ey, .edge_x = ex / l, .edge_y = ey / l,
                          .fx = (-ey * push + ex * drag) / l, .fy = (ex * push + ey * drag) / l,
                          .length = bt_rng_uniform(r) < 0.5 ? 0 : 0.4 * l * bt_rng_uniform(r),
                          .opening = bt_rng_uniform(r) < 0.3 ? push * bt_rng_uniform(r) : 0, .other = number};
}

static bt_floe_load push(double x, double y, double fx, double fy)
{
    return (bt_floe_load){.x = x, .y = y, .fx = fx, .fy = fy, .edge_x = fx != 0 ? 0 : 1, .edge_y = fx != 0 ? 1 : 0};
}

static bool splits(const bt_split_floe *f, const bt_floe_load *load, int n, double scale, const bt_split_law *law,
                   bt_split *best)
{
    bt_floe_load own[16];
    for (int k = 0; k < n; k++) {
        own[k] = load[k];
        own[k].fx *= scale, own[k].fy *= scale, own[k].opening *= scale;
        own[k].other = own[k].other ? own[k].other : k + 1;
    }
    return bt_split_find(f, own, n, law, best);
}

/// The factor on the loads from which the floe splits, by bisection; *best what it does there.
static double critical(const bt_split_floe *f, const bt_floe_load *load, int n, const bt_split_law *law, bt_split *best)
{
    double low = 1e-3, high = 1e12;
    assert_false(splits(f, load, n, low, law, best));
    assert_true(splits(f, load, n, high, law, best));
    while (high > low * (1 + 1e-9)) {
        const double middle = sqrt(low * high);
        *(splits(f, load, n, middle, law, best) ? &high : &low) = middle;
    }
    assert_true(splits(f, load, n, high, law, best));
    assert_near(best->ratio, 1, 1e-8);
    return high;
}

TEST(test_strength)
{
    const bt_split_law law = law_of(1);
    assert_near(bt_split_strength(&law, 1e6, true), 0.75 * K / 1e3, 1e-6);   // fracture mechanics
    assert_near(bt_split_strength(&law, 1e6, false), 1.4 * K / 1e3, 1e-6);
    assert_near(bt_split_strength(&law, 1e-6, true), STRENGTH, 1e-5);        // ice without a crack
    assert_near(bt_split_strength(&law, 0.75 * 0.75 * K * K / STRENGTH / STRENGTH, true), STRENGTH / sqrt(2), 1e-15);
    bt_split_law endless = law;
    endless.toughness = 1e300;
    assert_near(bt_split_strength(&endless, 30, true), STRENGTH, 1e-15);
    assert_near(bt_split_work(K, 1, 30), 122.85, 1e-12); // 4.095 J/m2
}

// K_I of a pair at the mouth of an edge crack, by finite elements: F_y = 0.187 h K sqrt(L) in a square.
TEST(test_opening_pair)
{
    const double sides[] = {10, 30, 100}, h = 1.3;
    double force[3];
    for (int i = 0; i < 3; i++) {
        const double l = sides[i];
        const floe f = rectangle(l, l);
        const bt_split_floe s = seen(&f, h);
        const bt_split_law law = law_of(2);
        bt_split best;
        bt_floe_load load = push(-l / 2, 0, 0, 0);
        load.edge_x = 0, load.edge_y = 1, load.opening = 1;
        force[i] = critical(&s, &load, 1, &law, &best);
        assert_near(force[i], bt_split_opening_load(&law, h, l), 1e-8);
        assert_near(force[i], 0.1875 * h * K * sqrt(l), 0.01);
        assert_int_equal(best.mode, BT_SPLIT_OPENED);
        assert_near(best.length, l, 1e-12);
        assert_int_equal(best.chord.a.edge, 3); // the side x = -L/2, in its middle
        assert_int_equal(best.chord.b.edge, 1);
        assert_near(best.chord.a.t, 0.5, 1e-12);
        assert_near(best.chord.b.t, 0.5, 1e-12);
    }
    assert_within(log(force[2] / force[1]) / log(100 / 30.), 0.5, 0.002); // sqrt(L) where L >> l0
    // Short sections are as strong as the ice: F in proportion to L.
    bt_split best;
    bt_split_law law = law_of(1e-4);
    law.slop = 1e-9;
    double small[2];
    for (int i = 0; i < 2; i++) {
        const floe f = rectangle(1e-3 * (i + 1), 1e-3 * (i + 1));
        const bt_split_floe s = seen(&f, h);
        bt_floe_load load = push(f.v[0], 0, 0, 0);
        load.edge_x = 0, load.edge_y = 1, load.opening = 1;
        small[i] = critical(&s, &load, 1, &law, &best);
    }
    assert_near(small[1] / small[0], 2, 0.01);
    assert_near(small[0], STRENGTH * h * 1e-3 / 4, 0.01);
}

// A wedge with the thrust that presses it in: F_x = r 0.75/(4 - 0.75 r) h K sqrt(L). Beyond r = 16/3 it opens nothing.
TEST(test_wedge)
{
    const double l = 30, h = 1, mu = 0.1;
    const floe f = rectangle(l, l);
    const bt_split_floe s = seen(&f, h);
    const bt_split_law law = law_of(3);
    const double want[] = {0, 0.17, 0.22, 0.37, 0.62, 0.85, 1.2}; // F_x/(h K sqrt(L)) by hand, to two digits
    const double angle[] = {0, 15, 20, 30, 40, 45, 50};
    for (int i = 1; i < 7; i++) {
        const double r = bt_split_wedge(angle[i] * BT_PI / 180, mu);
        bt_floe_load load = push(-l / 2, 0, 1, 0);
        load.opening = 1 / r;
        bt_split best;
        const double force = critical(&s, &load, 1, &law, &best);
        assert_near(force, r * bt_split_strength(&law, l, true) * h * l / (4 - 0.75 * r), 1e-8);
        assert_near(force, r * 0.75 / (4 - 0.75 * r) * h * K * sqrt(l), 0.01);
        assert_within(force / (h * K * sqrt(l)), want[i], i < 6 ? 0.006 : 0.06);
        assert_int_equal(best.mode, BT_SPLIT_OPENED);
    }
    bt_split best;
    bt_floe_load load = push(-l / 2, 0, 1, 0);
    load.opening = 1 / bt_split_wedge(65 * BT_PI / 180, mu);
    assert_true(1 / load.opening > 16 / 3.);
    critical(&s, &load, 1, &law, &best);
    assert_int_equal(best.mode, BT_SPLIT_BURST); // closed by the thrust, and burst across it
    assert_true(bt_split_wedge(85 * BT_PI / 180, mu) == 0);
}

// Between two plates of width w: (pi/2) sigma_c h B/(1 - (w/B)^1.5), the Brazilian test at w = 0.
TEST(test_squeezed)
{
    const double l = 30, h = 1;
    const floe f = rectangle(l, l);
    const bt_split_floe s = seen(&f, h);
    const bt_split_law law = law_of(3);
    for (int i = 0; i < 4; i++) {
        const double w = i * 6.0;
        bt_floe_load load[2] = {push(-l / 2, 0, 1, 0), push(l / 2, 0, -1, 0)};
        load[0].length = load[1].length = w;
        bt_split best;
        const double force = critical(&s, load, 2, &law, &best), strength = bt_split_strength(&law, l, false);
        assert_near(force, BT_PI / 2 * strength * h * l / (1 - pow(w / l, 1.5)), 0.001);
        assert_int_equal(best.mode, BT_SPLIT_BURST);
    }
}

// A thrust that the floe's own inertia balances: N = 0, M = F L/8; of beam theory's 0.75 F/(h L) at the far end 0.30 is
// left, and across the force it bursts at 0.43.
TEST(test_free_thrust)
{
    const double l = 30, h = 2;
    const floe f = rectangle(l, l);
    const bt_split_floe s = seen(&f, h);
    const bt_split_law law = law_of(6);
    bt_floe_load load = push(-l / 2, 0, 1, 0);
    const bt_edge_load on_edge = bt_edge_load_of(&s, &load, law.slop);
    const bt_load_case w = bt_load_case_of(&on_edge, 1, -1);
    const bt_chord c = {{3, 0.5}, {1, 0.5}};
    const bt_section q = bt_section_of(&s, l * l, l * l * l * l / 6, &w, &c, law.slop);
    assert_within(q.normal, 0, 1e-12);
    assert_near(q.moment, l / 8, 1e-12);
    assert_near(q.normal / l - 6 * q.moment / (l * l), -0.75 / l, 1e-12);
    assert_near(q.at[0].thrust, 1, 1e-15);
    assert_near(q.at[0].inertial, 1, 1e-15);
    bt_split best;
    assert_near(critical(&s, &load, 1, &law, &best), bt_split_strength(&law, l, false) * h * l / 0.43, 1e-8);
    assert_int_equal(best.mode, BT_SPLIT_BURST);
    load.length = l / 2;
    assert_near(critical(&s, &load, 1, &law, &best), bt_split_strength(&law, l, false) * h * l / 0.215, 1e-8);
    // a hit of which a share persists bears on the same length
    for (double share = 1e-16; share < 1; share = share < 1e-3 ? 0.3 : 1) {
        bt_floe_load parts[2] = {load, load};
        parts[0].other = parts[1].other = 1;
        parts[0].fx = share, parts[1].fx = 1 - share, parts[1].collision = true;
        assert_near(critical(&s, parts, 2, &law, &best), bt_split_strength(&law, l, false) * h * l / 0.215, 1e-8);
    }
}

// A force at the middle of a side, held at two fixed posts: 1.5 F/(h L) at the far end, nothing taken off.
TEST(test_three_point)
{
    const double l = 30, h = 1;
    const floe f = rectangle(l, l);
    const bt_split_floe s = seen(&f, h);
    const bt_split_law law = law_of(3);
    bt_floe_load load[3] = {push(-l / 2, 0, 1, 0), push(l / 2, -l / 2, -0.5, 0), push(l / 2, l / 2, -0.5, 0)};
    bt_split best;
    const double force = critical(&s, load, 3, &law, &best);
    assert_near(force, bt_split_three_point_load(&law, h, l), 1e-8);
    assert_near(force, 1.4 * h * K * sqrt(l) / 1.5, 0.01);
    assert_int_equal(best.mode, BT_SPLIT_BENT);
    assert_near(best.length, l, 1e-12);
    load[0].length = 6; // an even pressure takes F w/8 of the bending
    const double wide = bt_split_strength(&law, l, false) * h * l / (1.5 - 0.75 * 6 / l);
    assert_near(critical(&s, load, 3, &law, &best), wide, 1e-8);
}

// A strip l x b. Struck at its end it bends as F x (1 - x/l)^2, most at a third: 4 F l/27; struck in its middle F l/8.
TEST(test_strip)
{
    const double l = 60, b = 3, h = 1;
    const floe f = rectangle(b, l);
    const bt_split_floe s = seen(&f, h);
    const bt_split_law law = law_of(1);
    bt_split best;
    bt_floe_load load = push(-b / 2, -l / 2, 1, 0);
    const double strength = bt_split_strength(&law, b, false);
    assert_near(critical(&s, &load, 1, &law, &best), 27 * strength * h * b * b / (24 * l), 0.01);
    assert_int_equal(best.mode, BT_SPLIT_BENT);
    double p[2];
    bt_chord_place(f.n, f.v, best.chord.b, p);
    assert_within(p[0], -b / 2, 1e-9); // the crack begins on the side that is struck, away from the end
    assert_within(p[1], -l / 6, 1e-9);
    load = push(-b / 2, 0, 1, 0);
    assert_near(critical(&s, &load, 1, &law, &best), strength * h * b / (0.75 * l / b - 0.45), 1e-8);
    bt_chord_place(f.n, f.v, best.chord.b, p);
    assert_within(p[0], b / 2, 1e-9);
    assert_within(p[1], 0, 1e-9);
}

// The speed at which a floe splits on a corner that it runs against, F = v √(2 p h tan(φ) m), does not depend on h.
TEST(test_collision)
{
    const double sides[] = {3, 10, 30, 100}, want45[] = {1.41, 0.77, 0.45, 0.24}, want30[] = {0.81, 0.44, 0.26, 0.14};
    const double p = 1.5e6, rho = 910, mu = 0.1, l0 = 0.75 * 0.75 * K * K / STRENGTH / STRENGTH;
    for (int j = 0; j < 2; j++)
        for (int i = 0; i < 4; i++)
            for (int thick = 0; thick < 2; thick++) {
                const double l = sides[i], h = thick ? 0.4 : 0.1, phi = (j ? 30 : 45) * BT_PI / 180;
                const double r = bt_split_wedge(phi, mu), unit = sqrt(2 * p * h * tan(phi) * rho * h * l * l);
                const floe f = rectangle(l, l);
                const bt_split_floe s = seen(&f, h);
                const bt_split_law law = law_of(0.3);
                bt_floe_load load = push(-l / 2, 0, unit, 0);
                load.opening = unit / r;
                load.collision = true;
                bt_split best;
                const double v = critical(&s, &load, 1, &law, &best), beta = r * 0.75 / (4 - 0.75 * r);
                assert_int_equal(best.peak, 0);
                assert_near(v, beta * K / sqrt(2 * p * tan(phi) * rho * (l + l0)), 1e-8); // l0: size effect
                assert_near(v, j ? want30[i] : want45[i], 0.03);
            }
}

/// Peaks of two collisions are not added, and each is added to what persists.
TEST(test_peaks)
{
    const double l = 30;
    const floe f = rectangle(l, l);
    const bt_split_floe s = seen(&f, 1);
    const bt_split_law law = law_of(3);
    bt_floe_load load[2] = {push(-l / 2, 0, 1, 0), push(l / 2, 0, -1, 0)};
    bt_split best;
    const double both = critical(&s, load, 2, &law, &best);
    load[1].collision = true;
    assert_near(critical(&s, load, 2, &law, &best), both, 1e-8);
    assert_int_equal(best.peak, 1);
    load[0].collision = true; // each alone
    const double alone = critical(&s, load, 1, &law, &best);
    assert_near(critical(&s, load, 2, &law, &best), alone, 1e-8);
    assert_true(fabs(alone - both) > 0.1 * both);
}

/// Both parts of a floe say the same of the section between them: the same force, the opposite moment.
TEST(test_sides_agree)
{
    bt_rng r = bt_rng_start(1, BT_RNG_PLACE, 0);
    for (int trial = 0; trial < 2000; trial++) {
        const floe f = random_floe(&r, trial % 2);
        const bt_split_floe s = seen(&f, 1);
        const bt_moments m = bt_shape_area_moments(f.n, f.v);
        bt_floe_load load[5];
        bt_edge_load on_edge[5];
        for (int k = 0; k < 5; k++) {
            load[k] = random_load(&r, &f, 1, k);
            on_edge[k] = bt_edge_load_of(&s, &load[k], 1e-9);
        }
        const bt_load_case w = bt_load_case_of(on_edge, 5, -1);
        bt_chord c, back;
        const bt_chord_end from = trial % 3 ? on_edge[0].place : bt_chord_nearest(f.n, f.v, 1e3, 1e3, 1e-9);
        if (!bt_chord_from(f.n, f.v, from, -on_edge[1].x, on_edge[2].y, 1e-9, &c)) continue;
        back = (bt_chord){c.b, c.a};
        const bt_section p = bt_section_of(&s, m.area, m.polar, &w, &c, 1e-9),
                         q = bt_section_of(&s, m.area, m.polar, &w, &back, 1e-9);
        assert_within(p.normal, q.normal, 1e-11);
        assert_within(p.moment, -q.moment, 1e-11 * m.radius);
        assert_near(p.length, q.length, 1e-15);
    }
}

/// What a section carries, by summing the inertia of small squares of the floe left of it.
TEST(test_section_by_quadrature)
{
    bt_rng r = bt_rng_start(2, BT_RNG_PLACE, 0);
    for (int trial = 0; trial < 4; trial++) {
        const floe f = random_floe(&r, true);
        const bt_split_floe s = seen(&f, 1);
        const bt_moments m = bt_shape_area_moments(f.n, f.v);
        bt_floe_load load[3];
        bt_edge_load on_edge[3];
        for (int k = 0; k < 3; k++) {
            load[k] = random_load(&r, &f, 1, k);
            load[k].length = load[k].opening = 0;
            on_edge[k] = bt_edge_load_of(&s, &load[k], 1e-9);
        }
        const bt_load_case w = bt_load_case_of(on_edge, 3, -1);
        bt_chord c;
        assert_true(bt_chord_through(f.n, f.v, 0.1, 0.05, 1, 0.3, 1e-9, &c));
        double a[2], b[2];
        bt_chord_place(f.n, f.v, c.a, a);
        bt_chord_place(f.n, f.v, c.b, b);
        const double l = hypot(b[0] - a[0], b[1] - a[1]), nx = -(b[1] - a[1]) / l, ny = (b[0] - a[0]) / l;
        const double mx = (a[0] + b[0]) / 2, my = (a[1] + b[1]) / 2;
        double area = 0, polar = 0, fx = 0, fy = 0, torque = 0, normal = 0, moment = 0;
        enum { N = 1200 };
        const double cell = 2 * m.radius / N;
        for (int k = 0; k < 3; k++) {
            fx += load[k].fx, fy += load[k].fy;
            torque += load[k].x * load[k].fy - load[k].y * load[k].fx;
        }
        for (int pass = 0; pass < 2; pass++) // A and J first
            for (int i = 0; i < N; i++)
                for (int j = 0; j < N; j++) {
                    const double x = (i + 0.5) * cell - m.radius, y = (j + 0.5) * cell - m.radius, da = cell * cell;
                    bool inside = true;
                    for (int k = 0; k < f.n && inside; k++) {
                        const double *p = f.v + 2 * k, *q = f.v + 2 * ((k + 1) % f.n);
                        inside = (q[0] - p[0]) * (y - p[1]) > (q[1] - p[1]) * (x - p[0]);
                    }
                    if (!inside) continue;
                    if (!pass) {
                        area += da, polar += (x * x + y * y) * da;
                    } else if ((x - a[0]) * nx + (y - a[1]) * ny > 0) {
                        const double qx = -fx / area + torque / polar * y, qy = -fy / area - torque / polar * x;
                        normal += (qx * nx + qy * ny) * da;
                        moment += ((x - mx) * qy - (y - my) * qx) * da;
                    }
                }
        for (int k = 0; k < 3; k++)
            if ((load[k].x - a[0]) * nx + (load[k].y - a[1]) * ny > 0) {
                normal += load[k].fx * nx + load[k].fy * ny;
                moment += (load[k].x - mx) * load[k].fy - (load[k].y - my) * load[k].fx;
            }
        const bt_section q = bt_section_of(&s, m.area, m.polar, &w, &c, 1e-9);
        assert_within(q.normal, normal, 2e-3);
        assert_within(q.moment, moment, 2e-3 * m.radius);
    }
}

/// Stress over strength of a section, written out once more.
static double ratio_of(const bt_split_floe *s, const bt_load_case *w, const bt_split_law *law, const bt_chord *c)
{
    const bt_moments m = bt_shape_area_moments(s->n, s->outline);
    const bt_section q = bt_section_of(s, m.area, m.polar, w, c, law->slop);
    const double l = q.length, b = fmin(m.area / l, l), weak = bt_split_strength(law, l, true),
                 strong = bt_split_strength(law, l, false);
    double worst = 0;
    for (int at = 0; at < 2; at++) {
        const bt_section_end *e = &q.at[at];
        const double share = fmin(1, e->bearing / b), pair = 4 * e->opening / l;
        const double bending = (at ? 6 : -6) * q.moment / (l * l);
        const double rest = q.normal / l + bending - 0.45 * q.at[1 - at].inertial / l - pair;
        const double burst =
            (0.637 * (1 - pow(share, 1.5)) * (e->thrust - e->inertial) + 0.43 * (1 - share) * e->inertial) / b;
        worst = fmax(worst, burst / strong);
        worst = fmax(worst, (pair + fmin(0, rest)) / weak + fmax(0, rest) / strong);
    }
    return worst / s->thickness;
}

/// No section at all is above the bound, and where the quick reject says that nothing can split, nothing does.
TEST(test_bound)
{
    bt_rng r = bt_rng_start(3, BT_RNG_PLACE, 0);
    double tightest = 0;
    for (int trial = 0; trial < 4000; trial++) {
        const floe f = random_floe(&r, trial % 3 != 0);
        const bt_split_floe s = seen(&f, 1);
        bt_floe_load load[6];
        bt_edge_load on_edge[6];
        const int n = 1 + trial % 6;
        for (int k = 0; k < n; k++) {
            load[k] = random_load(&r, &f, 1e5, k);
            if (trial % 2) load[k].fx = 1e5 * bt_rng_normal(&r), load[k].fy = 1e5 * bt_rng_normal(&r);
            if (k % 2) load[k].x = f.v[2 * k % 8], load[k].y = f.v[2 * k % 8 + 1], load[k].length = 0; // a corner
            on_edge[k] = bt_edge_load_of(&s, &load[k], 1e-6);
        }
        const bt_load_case w = bt_load_case_of(on_edge, n, -1);
        bt_split_law law = law_of(0);
        for (int k = 0; k < 20; k++) {
            const bt_floe_load at = random_load(&r, &f, 1, 0), to = random_load(&r, &f, 1, 0);
            const bt_chord_end from = k % 2 ? on_edge[k % n].place : bt_chord_nearest(f.n, f.v, at.x, at.y, 1e-6);
            bt_chord c;
            if (f.convex && k % 4 == 0) { // cuts off a loaded corner
                const int corner = (k / 4) % 4;
                c = (bt_chord){{corner > 0 ? corner - 1 : f.n - 1, 1 - bt_rng_uniform(&r) / 2},
                               {corner, bt_rng_uniform(&r) / 2}};
            } else if (!bt_chord_from(f.n, f.v, from, to.x - at.x, to.y - at.y, 1e-6, &c)) {
                continue;
            }
            double a[2], b[2];
            bt_chord_place(f.n, f.v, c.a, a);
            bt_chord_place(f.n, f.v, c.b, b);
            const double l = hypot(b[0] - a[0], b[1] - a[1]);
            if (l < 1e-2) continue;
            const double ratio = ratio_of(&s, &w, &law, &c);
            const double most = bt_split_bound(&s, &w, &law, l), shorter = bt_split_bound(&s, &w, &law, l / 3);
            if (!(ratio <= most) || !(ratio <= shorter))
                fail_msg("trial %d: ratio %g, bound %g, from a third of the length on %g", trial, ratio, most, shorter);
            tightest = fmax(tightest, ratio / most);
            law.least_width = l;
            const double sum = w.size + w.opening, borne = bt_split_borne(&s, &law); // by the sum alone
            if (!(ratio <= sum / borne)) fail_msg("trial %d: ratio %g, by the sum %g", trial, ratio, sum / borne);
        }
    }
    assert_true(tightest > 0.2); // and it is no bound that says nothing
}

static void shuffle(bt_rng *r, bt_floe_load *load, int n)
{
    for (int k = n - 1; k > 0; k--) {
        const int j = (int)((k + 1) * bt_rng_uniform(r));
        const bt_floe_load t = load[k];
        load[k] = load[j], load[j] = t;
    }
}

/// Outline of f turned about its centroid, mirrored at y = 0 if `mirror`, numbered from vertex `first` on.
static floe turned(const floe *f, double turn, bool mirror, int first)
{
    floe g = *f;
    const double cs = cos(turn), sn = sin(turn);
    for (int i = 0; i < f->n; i++) {
        const int from = ((mirror ? -i : i) + first + f->n) % f->n;
        const double x = f->v[2 * from], y = mirror ? -f->v[2 * from + 1] : f->v[2 * from + 1];
        g.v[2 * i] = cs * x - sn * y, g.v[2 * i + 1] = sn * x + cs * y;
    }
    return g;
}

static bt_floe_load turned_load(const bt_floe_load *p, double turn, bool mirror)
{
    const double cs = cos(turn), sn = sin(turn), sign = mirror ? -1 : 1;
    bt_floe_load q = *p;
    q.x = cs * p->x - sn * sign * p->y, q.y = sn * p->x + cs * sign * p->y;
    q.fx = cs * p->fx - sn * sign * p->fy, q.fy = sn * p->fx + cs * sign * p->fy;
    q.edge_x = cs * p->edge_x - sn * sign * p->edge_y, q.edge_y = sn * p->edge_x + cs * sign * p->edge_y;
    return q;
}

/// Do both ends of a section lie at the ends of the other, one of floe f, the other of f turned?
static void assert_same_chord(const floe *f, const bt_chord *c, const floe *g, const bt_chord *d, double turn,
                              bool mirror, double error)
{
    const double cs = cos(turn), sn = sin(turn);
    double p[2], q[4];
    bt_chord_place(g->n, g->v, d->a, q);
    bt_chord_place(g->n, g->v, d->b, q + 2);
    for (int k = 0; k < 2; k++) { // which of the ends is a may depend on rounding
        bt_chord_place(f->n, f->v, k ? c->b : c->a, p);
        const double x = p[0], y = mirror ? -p[1] : p[1], px = cs * x - sn * y, py = sn * x + cs * y;
        assert_within(fmin(hypot(q[0] - px, q[1] - py), hypot(q[2] - px, q[3] - py)), 0, error);
    }
}

/// The order of the loads changes no bit; turned or mirrored, the same section is found to rounding.
TEST(test_same_from_all_sides)
{
    bt_rng r = bt_rng_start(4, BT_RNG_PLACE, 0);
    int n_split = 0;
    for (int trial = 0; trial < 1000; trial++) {
        const floe f = random_floe(&r, trial % 2);
        const int n = 1 + (int)(11 * bt_rng_uniform(&r));
        bt_floe_load load[12], other[12];
        for (int k = 0; k < n; k++) {
            load[k] = random_load(&r, &f, 1e5 * bt_shape_area_moments(f.n, f.v).radius, k % 5);
            load[k].point = k;
            load[k].collision = k % 4 == 3;
        }
        const bt_split_floe s = seen(&f, 1);
        const bt_split_law law = law_of(0.3 * sqrt(bt_shape_centroid(f.n, f.v).area));
        bt_split best, again;
        memcpy(other, load, sizeof other);
        const bool split = bt_split_find(&s, load, n, &law, &best);
        shuffle(&r, other, n);
        assert_int_equal(bt_split_find(&s, other, n, &law, &again), split);
        assert_memory_equal(&again, &best, sizeof best);
        n_split += split;
        for (int mirror = 0; mirror < 2; mirror++) {
            const double turn = 6 * bt_rng_uniform(&r);
            const floe g = turned(&f, turn, mirror, mirror ? f.n - 1 : 0);
            for (int k = 0; k < n; k++) other[k] = turned_load(&load[k], turn, mirror);
            const bt_split_floe t = seen(&g, 1);
            assert_int_equal(bt_split_find(&t, other, n, &law, &again), split);
            if (!split) continue;
            assert_near(again.ratio, best.ratio, 1e-6);
            assert_int_equal(again.mode, best.mode);
            assert_same_chord(&f, &best.chord, &g, &again.chord, turn, mirror, 1e-5 * best.length);
        }
    }
    if (!(n_split > 200 && n_split < 900)) fail_msg("%d of 1000 split", n_split);
}

/// Blocks of a x 10 m and b x 10 m with a neck between them, w wide and 1 m long; *middle: x of the neck's middle.
static floe necked(double a, double b, double w, double *middle)
{
    floe f = {12, {-a - 0.5, -5, -0.5, -5, -0.5, -w / 2, 0.5, -w / 2, 0.5, -5, b + 0.5, -5, b + 0.5, 5, 0.5, 5,
                   0.5, w / 2, -0.5, w / 2, -0.5, 5, -a - 0.5, 5}, false};
    bt_shape_centre(f.n, f.v);
    *middle = f.v[2] + 0.5;
    return f;
}

/// The floe splits from a factor of 1 on the loads on, along the section at x; so it does turned, mirrored, and
/// numbered from any vertex.
static void assert_breaks_at(const floe *f, const bt_floe_load *load, int n, const bt_split_law *law, double x,
                             double length)
{
    const bt_split_floe s = seen(f, 1);
    bt_split best, again;
    bt_floe_load other[4];
    assert_near(critical(&s, load, n, law, &best), 1, 1e-8);
    assert_false(splits(&s, load, n, 0.999, law, &best));
    assert_true(best.refused_ratio == 0);
    assert_true(splits(&s, load, n, 1.001, law, &best));
    assert_int_equal(best.mode, BT_SPLIT_BENT);
    assert_near(best.length, length, 1e-9);
    double a[2], b[2];
    bt_chord_place(f->n, f->v, best.chord.a, a);
    bt_chord_place(f->n, f->v, best.chord.b, b);
    assert_within(a[0], x, 1e-9);
    assert_within(b[0], x, 1e-9);
    const bt_moments m = bt_shape_area_moments(f->n, f->v);
    bt_piece piece[2];
    assert_true(bt_split_cut(f->n, f->v, m.area, m.polar, &best.chord, piece));
    assert_near(piece[0].area + piece[1].area, m.area, 1e-15);
    for (int k = 0; k < 2; k++) assert_near(bt_shape_centroid(piece[k].n, piece[k].outline).area, piece[k].area, 1e-13);
    for (int k = 0; k < 4 * f->n; k++) {
        const double turn = 0.7 * k;
        const floe g = turned(f, turn, k % 2, k / 2 % f->n);
        const bt_split_floe t = seen(&g, 1);
        for (int i = 0; i < n; i++) other[i] = turned_load(&load[i], turn, k % 2);
        assert_true(splits(&t, other, n, 1.001, law, &again));
        assert_near(again.ratio, best.ratio, 1e-9);
        assert_same_chord(f, &best.chord, &g, &again.chord, turn, k % 2, 1e-9);
    }
}

/// A floe breaks at its neck: between three points, where the moment on it is largest, M = σ_c h w²/6.
TEST(test_neck)
{
    const double widths[] = {0.8, 1.5};
    const bt_split_law law = law_of(2);
    double at;
    for (int i = 0; i < 2; i++) {
        const double w = widths[i], most = bt_split_strength(&law, w, false) * w * w / 6;
        const floe f = necked(10, 30, w, &at);
        const double force = most / 8, arm = at + 2; // at 8 m from the end of the neck that is nearer to the support
        const bt_floe_load bend[3] = {push(at - 7.5, -5, 0, force), push(arm, 5, 0, -force * 35 / 25.5),
                                      push(arm + 25.5, -5, 0, force * 9.5 / 25.5)};
        assert_breaks_at(&f, bend, 3, &law, at + 0.5, w);
    }
    // As wide as the blocks but for a notch: it breaks at the support, where the moment is larger.
    floe f = necked(10, 30, 9.9, &at);
    double force = bt_split_strength(&law, 10, false) * 100 / 6 / 9.5;
    const bt_floe_load bend[3] = {push(at - 7.5, -5, 0, force), push(at + 2, 5, 0, -force * 35 / 25.5),
                                  push(at + 27.5, -5, 0, force * 9.5 / 25.5)};
    assert_breaks_at(&f, bend, 3, &law, at + 2, 10);
    // Loads on one block alone break that block.
    f = necked(10, 30, 0.8, &at);
    force = bt_split_strength(&law, 10, false) * 100 / 6 / 10;
    const bt_floe_load far[3] = {push(at + 15, -5, 0, 2 * force), push(at + 5, 5, 0, -force),
                                 push(at + 25, 5, 0, -force)};
    assert_breaks_at(&f, far, 3, &law, at + 15, 10);
}

/// Both ends of a neck bear the same. It breaks at the one that is nearer to the first load.
TEST(test_neck_ties)
{
    const double w = 1.2;
    const bt_split_law law = law_of(2);
    double at;
    const floe f = necked(20, 24, w, &at);
    const double force = bt_split_strength(&law, w, false) * w * w / 6 / 10;
    bt_floe_load bend[4] = {push(at - 15, -5, 0, force), push(at - 5, 5, 0, -force), push(at + 5, 5, 0, -force),
                            push(at + 15, -5, 0, force)};
    for (int k = 0; k < 2; k++) {
        for (int i = 0; i < 4; i++) bend[i].other = k ? 4 - i : 1 + i;
        assert_breaks_at(&f, bend, 4, &law, at + (k ? 0.5 : -0.5), w);
    }
}

/// An arm that tapers towards its end, where a force bends it, breaks at its root, across which nothing is narrowest.
TEST(test_root_of_an_arm)
{
    floe f = {8, {-20, -10, 0, -10, 0, -2, 18, -1.5, 18, 1.5, 0, 2, 0, 10, -20, 10}, false};
    bt_shape_centre(f.n, f.v);
    const double x = f.v[2], w = 4;
    const bt_split_law law = law_of(1);
    const double force = bt_split_strength(&law, w, false) * w * w / 6 / 18;
    const bt_floe_load load[3] = {push(x + 18, -1.5, 0, force), push(x - 5, 10, 0, -force * 33 / 10),
                                  push(x - 15, -10, 0, force * 23 / 10)};
    const bt_split_floe s = seen(&f, 1);
    bt_split best;
    assert_near(critical(&s, load, 3, &law, &best), 1, 2e-3); // the section is not quite across the arm
    double a[2], b[2];
    bt_chord_place(f.n, f.v, best.chord.a, a);
    bt_chord_place(f.n, f.v, best.chord.b, b);
    assert_within(a[0], x, 0.2);
    assert_within(b[0], x, 0.2);
}

static double from_edge(const double *p, const double *a, const double *b)
{
    const double x = b[0] - a[0], y = b[1] - a[1];
    const double t = fmax(0, fmin(1, ((p[0] - a[0]) * x + (p[1] - a[1]) * y) / (x * x + y * y)));
    return hypot(a[0] + t * x - p[0], a[1] + t * y - p[1]);
}

/// Between two random coasts, the narrowest section of all is one of those from a reflex vertex.
TEST(test_narrowest_is_tried)
{
    enum { SIDE = 12 };
    bt_rng r = bt_rng_start(8, BT_RNG_PLACE, 0);
    for (int trial = 0; trial < 300; trial++) {
        floe f = {.n = 2 * SIDE}; // the lower coast from left to right, the upper one back
        for (int i = 0; i < f.n; i++) {
            const int k = i < SIDE ? i : f.n - 1 - i;
            const double wide = k == 0 || k == SIDE - 1 ? 8 : 0.5 + 5 * bt_rng_uniform(&r);
            f.v[2 * i] = k + 0.6 * (bt_rng_uniform(&r) - 0.5);
            f.v[2 * i + 1] = (i < SIDE ? -1 : 1) * wide;
        }
        double least = INFINITY, found = INFINITY;
        for (int i = 0; i < f.n; i++)
            for (int k = 0; k + 1 < SIDE; k++) {
                const double *a = f.v + 2 * (i < SIDE ? SIDE + k : k);
                least = fmin(least, from_edge(f.v + 2 * i, a, a + 2));
            }
        const floe g = turned(&f, 0.1 * trial, trial % 2, trial % f.n);
        bt_chord c;
        for (int i = 0; i < g.n; i++)
            for (int k = 0; k < g.n; k++) {
                if (!bt_chord_across(g.n, g.v, i, k, INFINITY, 1e-6, &c)) continue;
                double a[2], b[2], x, y;
                bt_chord_place(g.n, g.v, c.a, a);
                bt_chord_place(g.n, g.v, c.b, b);
                y = sin(-0.1 * trial) * a[0] + cos(0.1 * trial) * a[1];
                x = sin(-0.1 * trial) * b[0] + cos(0.1 * trial) * b[1];
                if (x * y < 0) found = fmin(found, hypot(b[0] - a[0], b[1] - a[1]));
            }
        assert_near(found, least, 1e-6);
    }
}

/// A twin of s times the lengths, s^1.5 the toughness, s the strength and s^3 the forces splits alike.
TEST(test_froude)
{
    bt_rng r = bt_rng_start(5, BT_RNG_PLACE, 0);
    for (int trial = 0; trial < 100; trial++) {
        const floe f = random_floe(&r, trial % 2);
        const double radius = bt_shape_area_moments(f.n, f.v).radius, scale = trial % 2 ? 4 : 1 / 37.;
        bt_floe_load load[3], twin[3];
        floe g = f;
        for (int i = 0; i < 2 * f.n; i++) g.v[i] *= scale;
        for (int k = 0; k < 3; k++) {
            twin[k] = load[k] = random_load(&r, &f, 3e5 * radius, k);
            twin[k].x *= scale, twin[k].y *= scale, twin[k].length *= scale;
            twin[k].fx *= pow(scale, 3), twin[k].fy *= pow(scale, 3), twin[k].opening *= pow(scale, 3);
        }
        const bt_split_law law = law_of(0.3 * radius);
        bt_split_law small = law;
        small.toughness *= pow(scale, 1.5), small.strength *= scale, small.least_width *= scale, small.slop *= scale;
        const bt_split_floe s = seen(&f, 1), t = seen(&g, scale);
        bt_split best, again;
        assert_int_equal(bt_split_find(&s, load, 3, &law, &best), bt_split_find(&t, twin, 3, &small, &again));
        assert_within(again.ratio, best.ratio, 1e-9 * best.ratio);
        assert_int_equal(again.chord.a.edge, best.chord.a.edge);
        assert_within(again.chord.b.t, best.chord.b.t, 1e-9);
    }
}

/// Area, momentum, angular momentum and energy of two pieces that move on as parts of the rigid parent.
static void assert_nothing_lost(double area, double polar, const bt_piece *piece, bt_rng *r)
{
    const double u = bt_rng_normal(r), v = bt_rng_normal(r), w = bt_rng_normal(r) / sqrt(polar / area);
    double sum[5] = {0}, own[5] = {area, area * u, area * v, polar * w, (area * (u * u + v * v) + polar * w * w) / 2};
    for (int k = 0; k < 2; k++) {
        const bt_piece *p = &piece[k];
        const double pu = u - w * p->y, pv = v + w * p->x;
        sum[0] += p->area, sum[1] += p->area * pu, sum[2] += p->area * pv;
        sum[3] += p->polar * w + p->area * (p->x * pv - p->y * pu);
        sum[4] += (p->area * (pu * pu + pv * pv) + p->polar * w * w) / 2;
    }
    const double scale[5] = {area, area * hypot(u, v), area * hypot(u, v), polar * fabs(w), own[4]};
    for (int k = 0; k < 5; k++) assert_within(sum[k], own[k], 1e-13 * scale[k]);
}

TEST(test_cuts)
{
    bt_rng r = bt_rng_start(6, BT_RNG_CUT, 0);
    int cuts = 0, concave = 0;
    for (int trial = 0; cuts < 1000; trial++) {
        const floe f = random_floe(&r, trial % 2);
        const bt_moments m = bt_shape_area_moments(f.n, f.v);
        const bt_floe_load at = random_load(&r, &f, 1, 0), to = random_load(&r, &f, 1, 0);
        const double slop = 1e-3 * m.radius;
        bt_chord c;
        bt_piece piece[2];
        if (!bt_chord_from(f.n, f.v, bt_chord_nearest(f.n, f.v, at.x, at.y, slop), to.x - at.x, to.y - at.y, slop, &c))
            continue;
        if (!bt_split_cut(f.n, f.v, m.area, m.polar, &c, piece)) continue;
        cuts++;
        assert_nothing_lost(m.area, m.polar, piece, &r);
        assert_true(piece[0].area >= piece[1].area * (1 - 1e-9));
        assert_true(piece[0].left != piece[1].left);
        double p[2], q[2];
        bt_chord_place(f.n, f.v, c.a, p);
        bt_chord_place(f.n, f.v, c.b, q);
        for (int k = 0; k < 2; k++) {
            // The moments are those of the outline that the piece has.
            const bt_moments own = bt_shape_area_moments(piece[k].n, piece[k].outline);
            const double share = m.area / piece[k].area;
            assert_near(own.area, piece[k].area, 1e-13 * share);
            assert_near(own.polar, piece[k].polar, 1e-12 * m.polar / piece[k].polar);
            assert_within(hypot(own.cx, own.cy), 0, 1e-13 * m.radius * share);
            assert_true(piece[k].convex == bt_outline_convex(piece[k].n, piece[k].outline));
            if (f.convex) assert_true(piece[k].convex);
            if (!piece[k].convex) concave++, assert_true(piece[k].parts.n > 1);
            // The first two vertices are the section's ends, less the centroid and nothing else.
            const double *first = piece[k].left ? p : q, *second = piece[k].left ? q : p;
            const double edge[4] = {first[0] - piece[k].x, first[1] - piece[k].y, second[0] - piece[k].x,
                                    second[1] - piece[k].y};
            assert_memory_equal(edge, piece[k].outline, sizeof edge);
        }
    }
    assert_true(concave > 100);
}

/// Ends within slop of a vertex are that vertex.
TEST(test_snap)
{
    const floe f = rectangle(10, 10);
    bt_chord c;
    assert_true(bt_chord_from(4, f.v, bt_chord_nearest(4, f.v, -4.95, -5, 0.1), 9.95, 10, 0.1, &c));
    assert_int_equal(c.a.edge, 0);
    assert_int_equal(c.b.edge, 2);
    assert_true(c.a.t == 0 && c.b.t == 0);
    bt_piece piece[2];
    assert_true(bt_split_cut(4, f.v, 100, 10000 / 6., &c, piece));
    assert_int_equal(piece[0].n, 3);
    assert_int_equal(piece[1].n, 3);
    assert_true(piece[0].left); // equal halves: the left one first
    assert_false(bt_chord_from(4, f.v, (bt_chord_end){0, 0.5}, 0.2, -1, 0.1, &c)); // outwards
    // Rounding of equal halves does not say which is the larger.
    for (int k = 0; k < 50; k++) {
        double v[12];
        for (int i = 0; i < 6; i++) v[2 * i] = cos(k + i * BT_PI / 3), v[2 * i + 1] = sin(k + i * BT_PI / 3);
        const bt_moments m = bt_shape_area_moments(6, v);
        assert_true(bt_split_cut(6, v, m.area, m.polar, &(bt_chord){{k % 6, 0}, {(k + 3) % 6, 0}}, piece));
        assert_true(piece[0].left);
    }
}

/// What the law does not allow is named, with the ratio that it had.
TEST(test_refused)
{
    const floe f = rectangle(30, 30), strip = rectangle(30, 5);
    const bt_split_floe s = seen(&f, 1), t = seen(&strip, 1);
    bt_split_law law = law_of(16);
    const bt_floe_load load[2] = {push(-15, 0, 1e8, 0), push(15, 0, -1e8, 0)};
    bt_split best;
    assert_false(splits(&s, load, 2, 1, &law, &best));
    assert_int_equal(best.refused, BT_SPLIT_SIZE);
    assert_near(best.refused_ratio, 0.637 * 1e8 / 30 / bt_split_strength(&law, 30, false), 1e-8);
    law = law_of(2);
    law.aspect = 10;
    assert_false(splits(&t, load, 2, 1, &law, &best) && best.mode == BT_SPLIT_BURST && best.length > 29);
    assert_int_equal(best.refused, BT_SPLIT_ASPECT); // two strips of 30 x 2.5, and the parent was not so slender
    law.aspect = 13;
    assert_true(splits(&t, load, 2, 1, &law, &best));
    assert_near(best.length, 30, 1e-12);
    // Sections shorter than the least width: of a strip that is narrower itself, and of a neck between two blocks.
    const floe narrow = rectangle(2.9, 20);
    const bt_split_floe u = seen(&narrow, 1);
    const bt_floe_load bend[3] = {push(-1.45, 0, 2e5, 0), push(1.45, -8, -1e5, 0), push(1.45, 8, -1e5, 0)};
    law = law_of(2.8);
    const double ratio = splits(&u, bend, 3, 1, &law, &best) ? best.ratio : 0;
    law = law_of(3);
    assert_false(splits(&u, bend, 3, 1, &law, &best));
    assert_int_equal(best.refused, BT_SPLIT_SIZE);
    assert_near(best.refused_ratio, ratio, 1e-9);
    floe joined = {8, {0, -22, 20, -22, 20, -2, 2.9, -2, 2.9, 2, 20, 2, 20, 22, 0, 22}, false};
    bt_shape_centre(joined.n, joined.v);
    const double left = joined.v[0];
    const bt_split_floe v = seen(&joined, 1);
    const bt_floe_load neck[3] = {push(left, 0, 4e4, 0), push(left + 20, -18, -2e4, 0), push(left + 20, 18, -2e4, 0)};
    assert_true(splits(&v, neck, 3, 1, &law, &best));
    assert_near(best.length, 2.9, 1e-9);
    bt_split_floe weak = s;
    const double whole = critical(&s, load, 2, &law, &best);
    weak.factor = 0.5;
    assert_near(critical(&weak, load, 2, &law, &best), whole / 2, 1e-8);
}

/// Halved until the least width stops it, every piece ends between that and twice that, and the area is what it was.
static void halve(const bt_piece *p, const bt_split_law *law, double *area, int *pieces)
{
    int longest = 0;
    double length = 0;
    for (int i = 0; i < p->n; i++) {
        const double *a = p->outline + 2 * i, *b = p->outline + 2 * ((i + 1) % p->n);
        if (hypot(b[0] - a[0], b[1] - a[1]) > length * (1 + 1e-9))
            length = hypot(b[0] - a[0], b[1] - a[1]), longest = i;
    }
    const double *a = p->outline + 2 * longest, *b = p->outline + 2 * ((longest + 1) % p->n);
    bt_floe_load load = {.x = (a[0] + b[0]) / 2, .y = (a[1] + b[1]) / 2, .opening = 1e9,
                         .edge_x = (b[0] - a[0]) / length, .edge_y = (b[1] - a[1]) / length};
    const bt_split_floe f = {p->n, p->outline, p->convex, 1, 1};
    bt_split best;
    bt_piece half[2];
    if (!bt_split_find(&f, &load, 1, law, &best)) {
        assert_true(length >= law->least_width && length < 2 * law->least_width);
        *area += p->area, ++*pieces;
        return;
    }
    assert_true(bt_split_cut(p->n, p->outline, p->area, p->polar, &best.chord, half));
    for (int k = 0; k < 2; k++) halve(&half[k], law, area, pieces);
}

TEST(test_cascade)
{
    bt_piece whole = {.n = 4, .convex = true, .area = 900, .polar = 135000};
    memcpy(whole.outline, rectangle(30, 30).v, sizeof whole.outline);
    const bt_split_law law = law_of(2.9);
    double area = 0;
    int pieces = 0;
    halve(&whole, &law, &area, &pieces);
    assert_near(area, 900, 1e-13);
    assert_int_equal(pieces, 64); // 30/8 = 3.75 m wide
}

/// Pieces that split again with probability f: (1 - f)(2 f)^k of generation k, of 2^-k of the area. So the cumulative
/// number of pieces goes as area^-(1 + log2 f). Strength is drawn from the generator of the program: f is the share
/// whose factor is below what holds.
static void count(double area, bt_gid ancestor, int64_t path, double least, int generation, int *number)
{
    if (generation < 12 && bt_split_scatter(7, ancestor, path, 10) < least)
        for (int k = 0; k < 2; k++) count(area / 2, ancestor, 2 * path + k, least, generation + 1, number);
    else number[generation]++;
}

TEST(test_forced_cascade)
{
    enum { FLOES = 20000 };
    for (int i = 0; i < 2; i++) {
        const double f = i ? 0.8 : 0.6, least = pow(-log(1 - f) / log(2), 0.1);
        int number[13] = {0};
        for (int k = 0; k < FLOES; k++) count(1, k, 1, least, 0, number);
        double last = 0;
        for (int k = 0; k <= 4; k++) {
            const double want = FLOES * (1 - f) * pow(2 * f, k);
            assert_near(number[k], want, 4 / sqrt(FLOES * (1 - f)) * sqrt(pow(2, k) / pow(2 * f, k)) + 0.02);
            last = number[k];
        }
        assert_within(log2(last / number[3]), 1 + log2(f), 0.05);
    }
}

TEST(test_scatter)
{
    enum { DRAWS = 20000 };
    int below[3] = {0};
    const double at[3] = {0.9, 1, 1.1};
    for (int k = 0; k < DRAWS; k++) {
        const double w = bt_split_scatter(3, k, 1, 8);
        assert_true(w > 0 && isfinite(w));
        for (int i = 0; i < 3; i++) below[i] += w < at[i];
    }
    for (int i = 0; i < 3; i++) {
        const double p = 1 - pow(2, -pow(at[i], 8));
        assert_within(below[i], DRAWS * p, 4 * sqrt(DRAWS * p * (1 - p)));
    }
    assert_true(bt_split_scatter(3, 5, 1, 0) == 1);
    const double w = bt_split_scatter(3, 5, 2, 8);
    assert_true(w == bt_split_scatter(3, 5, 2, 8));
    assert_true(w != bt_split_scatter(3, 5, 3, 8) && w != bt_split_scatter(3, 6, 2, 8) &&
                w != bt_split_scatter(4, 5, 2, 8));
}

TEST(test_sizes_of_an_even_number)
{
    // floes of 2 m and 4 m split in halves of sqrt(2) m and sqrt(8) m, and one of the latter in two of 2 m
    bt_splitting *splitting = bt_alloc(1, sizeof *splitting);
    splitting->first = 10;
    const double areas[] = {2, 8, 4}, none[2] = {0};
    for (int k = 0; k < 3; k++) {
        const bt_split_record record = {.parent = k < 2 ? k : 12, .generation = k < 2 ? 1 : 2,
                                        .area = {areas[k], areas[k]}};
        bt_splitting_append(splitting, &record, none);
    }
    assert_near(bt_splitting_size(splitting, true, 50), 3, 1e-15); // red: 2 m, the smaller one of the middle two
    assert_near(bt_splitting_size(splitting, false, 50), 2, 1e-15);
    assert_near(bt_splitting_size(splitting, false, 0), sqrt(2), 1e-15);
    bt_splitting_free(splitting);
}

TEST_MAIN(NULL, NULL)
