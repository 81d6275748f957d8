// SPDX-License-Identifier: MIT
// What floes leave of each other's drag: an edge behind another, sheets on each other, a lone floe, a closed pack; the
// same factors whatever the step, the cells and the age of what was found before.
#include "scene.h"
#include "contact/overlap.h"
#include "force/exposure.h"
#include "force/forces.h"

#define LAMBDA (1 / 0.18)
#define DRAFT (910.0 / 1027)

/// Drag of unit coefficients: skin ρ C A = area, form per width as the thickness.
static bt_gid add_sheet(bt_world *w, int n, double *v, double thickness, double x, double y)
{
    bt_body_def d = scene_prism(n, v, 900 * thickness);
    const double area = bt_shape_moments(n, v).area;
    d.x = x, d.y = y, d.thickness = thickness;
    d.drag = (bt_drag){.water_skin = area, .water_form = 50 * thickness, .air_skin = 0.01 * area,
                       .air_form = 0.1 * thickness};
    return bt_world_add(w, &d);
}

static bt_gid add_square(bt_world *w, double side, double thickness, double x, double y)
{
    double v[8];
    scene_square(side, v);
    return add_sheet(w, 4, v, thickness, x, y);
}

static bt_world *begin(double dt, double size)
{
    bt_params p = scene_params(dt, size);
    p.lee = LAMBDA, p.draft = DRAFT, p.covers = true;
    return bt_world_create(&p);
}

static void look(bt_world *w)
{
    bt_exposure_setup(w, 1);
    bt_cells_begin(w);
    bt_exposure_look(w);
}

static bt_exposure of(const bt_world *w, bt_gid g) { return w->bodies.exposure[bt_world_index(w, g)]; }

TEST(an_edge_behind_another)
{
    const double h[2] = {DRAFT, 1 - DRAFT}; // of 1 m
    for (int k = 0; k < 30; k++) {
        const double gap = 0.01 * pow(1.3, k), angle = 0.37 * k, c = cos(angle), s = sin(angle);
        bt_world *w = begin(1, 10);
        double v[8], turned[8];
        scene_square(10, v);
        for (int i = 0; i < 4; i++)
            turned[2 * i] = c * v[2 * i] - s * v[2 * i + 1], turned[2 * i + 1] = s * v[2 * i] + c * v[2 * i + 1];
        const bt_gid front = add_sheet(w, 4, turned, 1, 0, 0),
                     rear = add_sheet(w, 4, turned, 1, c * (10 + gap), s * (10 + gap));
        w->par.water_u = w->par.air_u = 0.3 * c, w->par.water_v = w->par.air_v = 0.3 * s;
        look(w);
        assert_true(of(w, front).water_form == 1 && of(w, front).air_form == 1 && of(w, rear).skin == 1);
        const double got[2] = {of(w, rear).water_form, of(w, rear).air_form};
        for (int f = 0; f < 2; f++) {
            const double x = gap / (LAMBDA * h[f]);
            if (x < 3.5) CHECK_CLOSE(got[f], 1 - exp(-0.18 * gap / h[f]), 1e-9);
            else if (x < BT_EXPOSURE_REACH) assert_true(got[f] > 1 - exp(-x) && got[f] < 1);
            else assert_true(got[f] == 1);
        }
        bt_world_free(w);
    }
}

/// Half of the width in the lee; an obstacle half as high; one that is fixed; nothing behind; not in a flow across.
TEST(what_stands_ahead_counts)
{
    bt_world *w = begin(1, 10);
    const bt_gid rear = add_square(w, 10, 1, 0, 0);
    add_square(w, 10, 1, -11, 5); // over the lower half of the width: y < 0 is free
    add_square(w, 10, 1, 11, 0);  // behind
    w->par.water_u = 0.2, w->par.air_v = 5;
    look(w);
    CHECK_CLOSE(of(w, rear).water_form, 0.5 + 0.5 * (1 - exp(-0.18 / DRAFT)), 1e-9);
    assert_true(of(w, rear).air_form == 1);
    bt_world_free(w);
    for (int fixed = 0; fixed < 2; fixed++) {
        w = begin(1, 10);
        const bt_gid thick = add_square(w, 10, 1, 0, 0);
        double v[8];
        scene_square(10, v);
        bt_body_def d = scene_prism(4, v, 900);
        d.x = -10.5, d.thickness = 0.5, d.motion = fixed ? BT_STATIC : BT_DYNAMIC;
        bt_world_add(w, &d);
        w->par.water_u = 0.2;
        look(w);
        CHECK_CLOSE(of(w, thick).water_form, 1 - 0.5 * exp(-0.18 * 0.5 / (0.5 * DRAFT)), 1e-9);
        bt_world_free(w);
    }
}

/// Force of the drag on all bodies at rest in a flow of v.
static double drag_along(const bt_world *w, double dt)
{
    double sum = 0;
    for (bt_idx i = 0; i < w->bodies.n; i++) {
        bt_impulse law[BT_MAX_FORCE_LAWS], series[BT_MAX_FORCE_SERIES];
        bt_forces_impulses(w, i, law, series);
        sum += series[bt_force_series_find("drag")].x / dt;
    }
    return sum;
}

/// In a current and in wind, without form drag.
TEST(a_raft_of_two_has_the_skin_of_what_it_covers)
{
    uint64_t rng = 4;
    for (int trial = 0; trial < 60; trial++) {
        bt_world *w = begin(1e-6, 8);
        for (int k = 0; k < 2; k++) {
            double v[2 * BT_MAX_VERTICES];
            const int n = scene_random_polygon(&rng, 4, v);
            const bt_gid g = add_sheet(w, n, v, 1, k * 5 * scene_uniform(&rng), k * 3 * scene_uniform(&rng));
            w->bodies.drag[g].water_form = w->bodies.drag[g].air_form = 0;
        }
        if (trial % 2) w->par.water_u = 0.7;
        else w->par.air_u = 7;
        look(w);
        bt_overlap o;
        double centroid[2];
        bt_overlap_clip(w, 0, 1, (const uint16_t[]){0, 0}, 0, 0, &o);
        const double both = bt_overlap_area(&o, centroid), cover = w->bodies.area[0] + w->bodies.area[1] - both;
        const double want = cover * (trial % 2 ? 0.7 * 0.7 : 0.01 * 7 * 7);
        CHECK_CLOSE(drag_along(w, 1e-6), want, 1e-6 * want);
        if (both > 0.1) assert_true(of(w, 0).skin < 1 && of(w, 1).skin < 1);
        bt_world_free(w);
    }
}

static bool inside(const bt_world *w, bt_idx i, double x, double y)
{
    const bt_bodies *b = &w->bodies;
    const int n = bt_body_corners(b, i);
    const double *v = b->outline + 2 * b->offset[i];
    for (int k = 0; k < n; k++) {
        const double *p = v + 2 * k, *q = v + 2 * ((k + 1) % n);
        if ((q[0] - p[0]) * (y - b->pose[i].y - p[1]) - (q[1] - p[1]) * (x - b->pose[i].x - p[0]) < 0) return false;
    }
    return true;
}

/// Sum over the sheets = what they cover together, by points of a lattice.
TEST(a_pile_has_the_skin_of_what_it_covers)
{
    enum { LATTICE = 400 };
    uint64_t rng = 11;
    double worst = 0;
    for (int sheets = 3; sheets <= 9; sheets++)
        for (int trial = 0; trial < 3; trial++) {
            bt_world *w = begin(1, 8);
            double largest = 0, sum = 0, covered = 0;
            for (int k = 0; k < sheets; k++) {
                double v[2 * BT_MAX_VERTICES];
                const int n = scene_random_polygon(&rng, 4, v);
                add_sheet(w, n, v, 1, 6 * scene_uniform(&rng) - 3, 6 * scene_uniform(&rng) - 3);
            }
            w->par.water_u = 0.5;
            look(w);
            for (bt_idx i = 0; i < sheets; i++) {
                largest = bt_max(largest, w->bodies.area[i]);
                sum += w->bodies.area[i] * w->bodies.exposure[i].skin;
            }
            for (int p = 0; p < LATTICE * LATTICE; p++) {
                const double x = -15 + 30 * (p % LATTICE + 0.5) / LATTICE, y = -15 + 30 * (p / LATTICE + 0.5) / LATTICE;
                bool any = false;
                for (bt_idx i = 0; i < sheets && !any; i++) any = inside(w, i, x, y);
                covered += any;
            }
            covered *= 900.0 / (LATTICE * LATTICE);
            worst = bt_max(worst, fabs(sum / covered - 1));
            assert_true(sum >= largest);
            CHECK_CLOSE(sum, covered, 2e-3 * covered); // of the lattice
            bt_world_free(w);
        }
    print_message("piles of 3-9 sheets: skin / union - 1 at most %.1e, lattice included\n", worst);
}

/// Alone, and with neighbours that it has no lee of, it goes on to the same bits as without the law.
TEST(a_lone_floe_goes_on_as_without)
{
    uint64_t hash[2];
    for (int with = 0; with < 2; with++) {
        bt_world *w = begin(0.5, 10);
        double v[10] = {0, 0, 11, 1, 12, 7, 5, 12, -1, 6};
        add_sheet(w, 5, v, 0.8, 0, 0);
        w->par.water_u = 0.4, w->par.air_u = 9, w->par.air_v = -4, w->par.coriolis = 1e-4;
        w->par.lee = with ? LAMBDA : 0, w->par.covers = with;
        bt_exposure_setup(w, 1);
        assert_int_equal(w->par.exposure_steps > 0, with);
        for (int k = 0; k < 200; k++) bt_world_step(w);
        hash[with] = bt_world_hash(w);
        bt_world_free(w);
    }
    assert_true(hash[0] == hash[1]);
}

/// Squares that lie flush around both periods have no edge in the stream: skin alone. Beside it the same floe alone.
TEST(a_closed_pack_is_braked_by_its_skin)
{
    enum { N = 12 };
    const double v = 0.3, dt = 1e-6;
    bt_world *w = begin(dt, 10);
    w->par.period_x = w->par.period_y = 10 * N, w->par.x0 = w->par.y0 = -5;
    for (int k = 0; k < N * N; k++) add_square(w, 10, 1, 10 * (k % N), 10 * (k / N));
    w->par.water_u = v;
    look(w);
    CHECK_CLOSE(drag_along(w, dt), N * N * 100 * v * v, 1e-6 * N * N * 100 * v * v);
    for (bt_idx i = 0; i < w->bodies.n; i++) {
        assert_true(w->bodies.exposure[i].skin == 1);
        CHECK_CLOSE(w->bodies.exposure[i].water_form, 0, 1e-9);
    }
    bt_world_free(w);
    w = begin(dt, 10);
    add_square(w, 10, 1, 0, 0);
    w->par.water_u = v;
    look(w);
    CHECK_CLOSE(drag_along(w, dt), (100 + 50 * 10) * v * v, 1e-6 * 600 * v * v);
    bt_world_free(w);
}

enum { FLOES = 300 };

/// A loose field that drifts at random, some on others; a lee may reach over two cells.
static bt_world *random_field(double dt, double cell)
{
    uint64_t rng = 5;
    bt_world *w = begin(dt, 8);
    w->par.cell = cell, w->par.water_u = 0.1, w->par.air_v = 6;
    for (int k = 0; k < FLOES; k++) {
        double v[2 * BT_MAX_VERTICES];
        const int n = scene_random_polygon(&rng, 4, v);
        const double h = 0.5 + 3 * scene_uniform(&rng), x = 140 * scene_uniform(&rng), y = 140 * scene_uniform(&rng);
        const bt_gid g = add_sheet(w, n, v, h, x, y);
        w->bodies.vel[g] = (bt_vel){.x = scene_uniform(&rng) - 0.5, .y = scene_uniform(&rng) - 0.5};
    }
    return w;
}

/// Every floe against all others, one line after the other, without cells.
static double plain_lee(const bt_world *w, bt_idx i)
{
    enum { LINES = 8 };
    const bt_bodies *b = &w->bodies;
    const double vx = 0.1 - b->vel[i].x, vy = -b->vel[i].y, size = hypot(vx, vy), ex = vx / size, ey = vy / size;
    double low = INFINITY, high = -INFINITY, sum = 0;
    const double *v = b->outline + 2 * b->offset[i];
    for (int k = 0; k < bt_body_corners(b, i); k++) {
        const double t = ex * v[2 * k + 1] - ey * v[2 * k];
        low = fmin(low, t), high = fmax(high, t);
    }
    for (int k = 0; k < LINES; k++) {
        const double t = low + (k + 0.5) * (high - low) / LINES;
        double enter = INFINITY, best = 0;
        for (int who = -1; who < b->n; who++) {
            const bt_idx j = who < 0 ? i : who;
            if (who == i) continue;
            const double *u = b->outline + 2 * b->offset[j], dx = b->pose[j].x - b->pose[i].x,
                         dy = b->pose[j].y - b->pose[i].y, h = b->thickness[j];
            const int n = bt_body_corners(b, j);
            double in = INFINITY, out = -INFINITY;
            for (int e = 0; e < n; e++) {
                const double *p = u + 2 * e, *q = u + 2 * ((e + 1) % n);
                const double tp = ex * (p[1] + dy) - ey * (p[0] + dx), tq = ex * (q[1] + dy) - ey * (q[0] + dx),
                             sp = ex * (p[0] + dx) + ey * (p[1] + dy), sq = ex * (q[0] + dx) + ey * (q[1] + dy);
                if ((tp < t) == (tq < t)) continue;
                const double s = sp + (t - tp) / (tq - tp) * (sq - sp);
                in = fmin(in, s), out = fmax(out, s);
            }
            if (who < 0) enter = in;
            if (who < 0 || !(in < enter)) continue;
            const double x = fmax(0, enter - out) / (LAMBDA * DRAFT * h), a = x - 3.5;
            const double left = exp(-x) * (a > 0 ? 1 - a * a * (3 - 2 * a) : 1);
            best = fmax(best, x >= 4.5 ? 0 : fmin(1, h / b->thickness[i]) * left);
        }
        sum += best;
    }
    return 1 - sum / LINES;
}

TEST(nothing_but_the_poses_counts)
{
    bt_exposure found[3][FLOES];
    for (int k = 0; k < 3; k++) { // step, cells, and a search before that has found other things
        bt_world *w = random_field(k == 0 ? 0.1 : 5, k == 2 ? 9 : 0);
        if (k == 2) {
            w->par.water_v = 3;
            look(w);
            w->par.water_v = 0;
        }
        look(w);
        for (bt_gid g = 0; g < FLOES; g++) found[k][g] = of(w, g);
        if (k == 0)
            for (bt_idx i = 0; i < FLOES; i++) CHECK_CLOSE(w->bodies.exposure[i].water_form, plain_lee(w, i), 1e-9);
        bt_world_free(w);
    }
    assert_memory_equal(found[0], found[1], sizeof found[0]);
    assert_memory_equal(found[0], found[2], sizeof found[0]);
}

/// Without a flow there is nothing to find, and what was found last stays.
TEST(no_flow_no_factor)
{
    bt_world *w = begin(1, 10);
    add_square(w, 10, 1, 0, 0);
    const bt_gid rear = add_square(w, 10, 1, 10.2, 0);
    look(w);
    assert_true(of(w, rear).water_form == 1);
    w->par.water_u = 1e-12;
    look(w);
    CHECK_CLOSE(of(w, rear).water_form, 1 - exp(-0.18 * 0.2 / DRAFT), 1e-9);
    w->par.water_u = 0;
    look(w);
    CHECK_CLOSE(of(w, rear).water_form, 1 - exp(-0.18 * 0.2 / DRAFT), 1e-9);
    bt_world_free(w);
}

TEST_MAIN(NULL, NULL)
