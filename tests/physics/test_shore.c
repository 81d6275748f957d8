// SPDX-License-Identifier: MIT
// Fixed bodies against each other: contacts of a convex outline that is cut into pieces against that outline, and the
// search for polygons against all pairs.
#include "test.h"
#include "all_pairs.h"

#include "geometry/polygons.h"
#include "space/shore.h"

static const double SLOP = 1e-4; // m

static bt_world *world_of(double period)
{
    bt_params p = scene_params(0.1, 1);
    p.slop = SLOP;
    p.period_x = p.period_y = period;
    return bt_world_create(&p);
}

static void add_fixed(bt_world *w, int n, const double *at)
{
    double v[2 * BT_MAX_VERTICES];
    memcpy(v, at, 2 * (size_t)n * sizeof *v);
    const bt_moments m = bt_shape_centre(n, v);
    const bt_body_def d = {.motion = BT_STATIC, .n_vertices = n, .vertices = v, .x = m.cx, .y = m.cy};
    bt_world_add(w, &d);
}

/// Adds a polygon in pieces: cut by random lines again and again, so that seams end on edges of other pieces.
static void add_pieces(bt_world *w, uint64_t *rng, int n, const double *v, int cuts)
{
    const bt_moments m = bt_shape_moments(n, v);
    if (cuts > 0) {
        const double a = 2 * BT_PI * scene_uniform(rng), nx = cos(a), ny = sin(a), d = nx * m.cx + ny * m.cy;
        double one[2 * BT_MAX_VERTICES], other[2 * BT_MAX_VERTICES];
        const int n_one = bt_shape_clip(n, v, nx, ny, d, one), n_other = bt_shape_clip(n, v, -nx, -ny, -d, other);
        add_pieces(w, rng, n_one, one, cuts - 1);
        add_pieces(w, rng, n_other, other, cuts - 1);
        return;
    }
    add_fixed(w, n, v);
}

/// How far outline v reaches along (nx, ny).
static double support(int n, const double *v, double nx, double ny)
{
    double most = -INFINITY;
    for (int i = 0; i < n; i++) most = bt_max(most, nx * v[2 * i] + ny * v[2 * i + 1]);
    return most;
}

static double distance_to_edges(int n, const double *v, int m, const double *o)
{
    double least = INFINITY;
    for (int i = 0; i < n; i++)
        for (int j = 0; j < m; j++) {
            const double *x = v + 2 * i, *e = o + 2 * j, *f = o + 2 * ((j + 1) % m), dx = f[0] - e[0], dy = f[1] - e[1];
            double t = ((x[0] - e[0]) * dx + (x[1] - e[1]) * dy) / (dx * dx + dy * dy);
            t = t < 0 ? 0 : t > 1 ? 1 : t;
            least = bt_min(least, hypot(e[0] + t * dx - x[0], e[1] + t * dy - x[1]));
        }
    return least;
}

/// A floe beside an outline in pieces has a contact exactly if it is near the outline, its least gap is the distance,
/// and each contact pushes along a normal that the outline itself has there: to the side of a plane that holds all of
/// it.
TEST(pieces_touch_as_their_outline_does)
{
    uint64_t rng = 5;
    const double margin = bt_margin_for(&(bt_world){.par = {.dt = 0.1, .slop = SLOP, .size = 1}}, 1);
    int seen = 0, deep = 0;
    for (int scene = 0; scene < 40; scene++) {
        double outline[2 * BT_MAX_VERTICES];
        const int n = scene_random_polygon(&rng, 4, outline);
        bt_world *w = world_of(0);
        add_pieces(w, &rng, n, outline, 1 + scene % 4);
        const bt_idx n_pieces = w->bodies.n;
        double v[2 * BT_MAX_VERTICES];
        const int k = scene_random_polygon(&rng, 0.5, v);
        bt_body_def d = scene_prism(k, v, 900);
        const bt_gid probe = bt_world_add(w, &d);
        bt_shore_create(w);
        assert_true(bt_shore_has(w->shore, 0) && !bt_shore_has(w->shore, probe));
        for (int place = 0; place < 400; place++) {
            // to the surface along a random direction, and a little farther or nearer
            const bt_idx i = bt_world_index(w, probe);
            bt_pose *p = &w->bodies.pose[i];
            const double a = 2 * BT_PI * scene_uniform(&rng);
            *p = (bt_pose){6 * cos(a), 6 * sin(a), 6 * scene_uniform(&rng)};
            bt_bodies_turn(&w->bodies, i);
            const double *own = w->bodies.outline + 2 * w->bodies.offset[i];
            double low = 0, high = 1;
            for (int s = 0; s < 50; s++) {
                const double f = 0.5 * (low + high);
                if (bt_apart_of(n, outline, k, own, f * p->x, f * p->y).gap > 0) high = f;
                else low = f;
            }
            const double away = high + (scene_uniform(&rng) - 0.2) * margin / 6;
            p->x *= away, p->y *= away;
            double at[2 * BT_MAX_VERTICES];
            for (int j = 0; j < k; j++) at[2 * j] = p->x + own[2 * j], at[2 * j + 1] = p->y + own[2 * j + 1];
            bt_manifold *man;
            bt_idx n_man;
            brute_force(w, margin, &man, &n_man);
            const double gap = bt_apart_of(n, outline, k, own, p->x, p->y).gap,
                         distance = bt_min(distance_to_edges(n, outline, k, at), distance_to_edges(k, at, n, outline));
            double least = INFINITY;
            for (bt_idx c = 0; c < n_man; c++)
                for (int j = 0; j < man[c].n_points; j++) {
                    const bt_manifold *m = &man[c];
                    const double nx = m->b == i ? m->nx : -m->nx, ny = m->b == i ? m->ny : -m->ny;
                    const double *arm = m->b == i ? m->p[j].rb : m->p[j].ra;
                    const double x = p->x + arm[0], y = p->y + arm[1];
                    // no part of the outline is beyond the plane through the point, but for the gap that it halves
                    if (support(n, outline, nx, ny) - (nx * x + ny * y) > margin + 1e-9)
                        fail_msg("scene %d, place %d: a contact at (%g, %g) along (%g, %g) is inside the outline",
                                 scene, place, x, y, nx, ny);
                    least = bt_min(least, m->p[j].gap);
                }
            free(man);
            if (gap > 0 && distance < margin - 0.02) {
                CHECK_CLOSE(least, distance, 0.012);
                seen++;
            } else if (gap > 0 && distance > margin + 1e-6) {
                assert_true(isinf(least));
            } else if (gap < 0) {
                CHECK_CLOSE(least, gap, 0.012 - 0.5 * gap);
                deep++;
            }
        }
        assert_int_equal(w->bodies.n, n_pieces + 1);
        bt_world_free(w);
    }
    assert_true(seen > 4000 && deep > 1000);
}

/// A contact point as a body has it: normal towards the body, place along the surface, gap.
typedef struct { double nx, ny, along, gap; } row;

static int rows_of(const bt_world *w, bt_idx i, double margin, row *rows)
{
    bt_manifold *man;
    bt_idx n_man;
    int n = 0;
    brute_force(w, margin, &man, &n_man);
    for (bt_idx c = 0; c < n_man; c++)
        for (int j = 0; j < man[c].n_points; j++) {
            const bt_manifold *m = &man[c];
            const double sign = m->b == i ? 1 : -1, *arm = m->b == i ? m->p[j].rb : m->p[j].ra;
            rows[n++] = (row){sign * m->nx, sign * m->ny, sign * (m->nx * arm[1] - m->ny * arm[0]), m->p[j].gap};
        }
    free(man);
    return n;
}

static bool among(const row *r, const row *rows, int n)
{
    for (int k = 0; k < n; k++)
        if (rows[k].nx * r->nx + rows[k].ny * r->ny > 1 - 1e-9 && fabs(rows[k].along - r->along) < 0.01 &&
            fabs(rows[k].gap - r->gap) < 0.002) return true;
    return false;
}

/// A floe some way off an outline in pieces has the points that it has off the outline in one piece, and no more. (Two
/// in a hundred differ in whose edge gives the normal.) Points at seams took loads from the corners of a floe; or a
/// corner had no point where the edge between them was tilted and another corner nearer, past the seam.
TEST(pieces_have_the_points_of_their_outline)
{
    uint64_t rng = 11;
    int all = 0, lost = 0, more = 0;
    for (int scene = 0; scene < 60; scene++) {
        double outline[2 * BT_MAX_VERTICES], v[2 * BT_MAX_VERTICES];
        const int n = scene_random_polygon(&rng, 4, outline), k = scene_random_polygon(&rng, 0.5 + scene % 3, v);
        bt_world *w[2] = {world_of(0), world_of(0)};
        add_fixed(w[0], n, outline);
        add_pieces(w[1], &rng, n, outline, 1 + scene % 4);
        bt_idx probe[2];
        for (int cut = 0; cut < 2; cut++) {
            const bt_body_def d = scene_prism(k, v, 900);
            probe[cut] = bt_world_index(w[cut], bt_world_add(w[cut], &d));
            bt_shore_create(w[cut]);
        }
        for (int place = 0; place < 100; place++) {
            const double a = 2 * BT_PI * scene_uniform(&rng), yaw = 6 * scene_uniform(&rng),
                         off = 0.05 * scene_uniform(&rng), margin = 0.02 + 0.6 * scene_uniform(&rng);
            row rows[2][64];
            int n_rows[2];
            double away = 1;
            for (int cut = 0; cut < 2; cut++) {
                bt_pose *p = &w[cut]->bodies.pose[probe[cut]];
                *p = (bt_pose){8 * cos(a), 8 * sin(a), yaw};
                bt_bodies_turn(&w[cut]->bodies, probe[cut]);
                const double *own = w[cut]->bodies.outline + 2 * w[cut]->bodies.offset[probe[cut]];
                for (double step = 0.5; cut == 0 && step > 1e-9; step *= 0.5)
                    if (bt_apart_of(n, outline, k, own, (away - step) * p->x, (away - step) * p->y).gap > 0)
                        away -= step;
                p->x *= away + off, p->y *= away + off;
                n_rows[cut] = rows_of(w[cut], probe[cut], margin, rows[cut]);
            }
            for (int i = 0; i < n_rows[0]; i++) lost += !among(&rows[0][i], rows[1], n_rows[1]);
            for (int i = 0; i < n_rows[1]; i++) more += !among(&rows[1][i], rows[0], n_rows[0]);
            all += n_rows[0];
        }
        bt_world_free(w[0]), bt_world_free(w[1]);
    }
    printf("of %d points %d are lost and %d added\n", all, lost, more);
    assert_true(all > 5000 && 50 * lost < all && 7 * more < all); // more: at seams
}

/// Blocks of different depth with their fronts in one line: above it a floe is pushed straight away from it, although
/// the sides of the deeper ones show at their backs.
TEST(sides_that_show_at_the_back_do_not_stop_a_slide)
{
    uint64_t rng = 3;
    const double margin = 0.5;
    int seen = 0;
    bt_world *w = world_of(0);
    for (int k = 0; k < 20; k++) {
        const double depth = 2 + 2 * scene_uniform(&rng), x = k - 10;
        add_fixed(w, 4, (double[8]){x, -depth, x + 1, -depth, x + 1, 0, x, 0});
    }
    double v[8];
    scene_square(1.5, v);
    bt_body_def d = scene_prism(4, v, 900);
    const bt_gid probe = bt_world_add(w, &d);
    bt_shore_create(w);
    for (int place = 0; place < 4000; place++) {
        const bt_idx i = bt_world_index(w, probe);
        bt_pose *p = &w->bodies.pose[i];
        *p = (bt_pose){14 * (scene_uniform(&rng) - 0.5), 0, 0.02 * (scene_uniform(&rng) - 0.5)};
        if (place % 2) { // with a corner just past a seam
            p->x = floor(p->x) + 0.25 + 0.006 * (scene_uniform(&rng) - 0.5);
            p->yaw *= 0.1;
        }
        bt_bodies_turn(&w->bodies, i);
        p->y = support(4, w->bodies.outline + 2 * w->bodies.offset[i], 0, -1) + 0.004 * (scene_uniform(&rng) - 0.8);
        bt_manifold *man;
        bt_idx n_man;
        brute_force(w, margin, &man, &n_man);
        for (bt_idx c = 0; c < n_man; c++, seen++)
            if (fabs(man[c].nx) > 0.02) fail_msg("place %d: pushed along (%g, %g)", place, man[c].nx, man[c].ny);
        free(man);
    }
    assert_true(seen > 4000);
    bt_world_free(w);
}

/// The tree finds the polygons of a shore as a look at all pairs does, also across periods.
TEST(detection_on_a_shore_equals_brute_force)
{
    uint64_t rng = 9;
    bt_idx total = 0;
    for (int scene = 0; scene < 8; scene++) {
        bt_world *w = world_of(scene % 2 ? 24 : 0);
        for (int k = 0; k < 24; k++) { // a band across the period, of pieces that lie in each other
            double v[2 * BT_MAX_VERTICES];
            const int n = scene_random_polygon(&rng, 1, v);
            for (int j = 0; j < n; j++) v[2 * j] += k + 0.5, v[2 * j + 1] += 12 + 2 * sin(k);
            add_fixed(w, n, v);
        }
        for (int k = 0; k < 150; k++) {
            double v[2 * BT_MAX_VERTICES];
            const int n = scene_random_polygon(&rng, 0.4, v);
            bt_body_def d = scene_prism(n, v, 900);
            d.x = 24 * scene_uniform(&rng), d.y = 24 * scene_uniform(&rng);
            bt_world_add(w, &d);
        }
        bt_shore_create(w);
        for (int move = 0; move < 6; move++) {
            const double margin = bt_margin_for(w, 1);
            detect_all(w, margin);
            bt_manifold *want;
            bt_idx n_want, n_have = 0;
            brute_force(w, margin, &want, &n_want);
            for (bt_idx k = 0; k < w->cells->n; k++) n_have += w->cells->cell[k].n_contacts;
            assert_int_equal(n_have, n_want);
            for (bt_idx k = 0; k < n_want; k++) total += bt_shore_holds(w, want[k].a) || bt_shore_holds(w, want[k].b);
            free(want);
            for (bt_idx i = 0; i < w->bodies.n; i++) {
                if (w->bodies.motion[i] != BT_DYNAMIC) continue;
                w->bodies.pose[i].x += 0.3 * (scene_uniform(&rng) - 0.5);
                w->bodies.pose[i].y += 0.3 * (scene_uniform(&rng) - 0.5);
                w->bodies.path[i] += 0.3;
            }
            w->cells->relabel = true;
        }
        bt_world_free(w);
    }
    assert_true(total > 500);
}

TEST_MAIN(NULL, NULL)
