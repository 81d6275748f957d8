// SPDX-License-Identifier: MIT
// Floes that are not convex: contacts of their parts against distances of the outlines, bays, shores of several parts,
// balances.
#include "test.h"
#include "all_pairs.h"

#include "bergtow/outline.h"

static bt_params params_of_world(double dt) { return scene_params(dt, 1); }

/// A floe of any simple outline (centred in v), in parts when it is not convex.
static bt_gid add_outline(bt_world *w, int n, double *v, double x, double y, double yaw, double vx, double vy)
{
    bt_body_def d = scene_prism(n, v, 900);
    bt_parts parts;
    assert_null(bt_outline_fault(n, v));
    if (!bt_outline_convex(n, v)) {
        assert_true(bt_outline_split(n, v, &parts));
        d.parts = &parts;
    }
    d.x = x, d.y = y, d.yaw = yaw, d.vx = vx, d.vy = vy;
    return bt_world_add(w, &d);
}

static int random_star(uint64_t *rng, double r, double *v)
{
    int n;
    do {
        n = 6 + (int)(9 * scene_uniform(rng));
        for (int k = 0; k < n; k++) {
            const double a = 2 * BT_PI * (k + 0.7 * scene_uniform(rng)) / n, s = r * (0.35 + 0.65 * scene_uniform(rng));
            v[2 * k] = s * cos(a);
            v[2 * k + 1] = s * sin(a);
        }
    } while (bt_outline_fault(n, v));
    return n;
}

static int outline_at(const bt_world *w, bt_idx i, double x, double y, double *out)
{
    const bt_bodies *b = &w->bodies;
    const int n = bt_body_corners(b, i);
    for (int k = 0; k < n; k++) {
        out[2 * k] = x + b->outline[2 * (b->offset[i] + k)];
        out[2 * k + 1] = y + b->outline[2 * (b->offset[i] + k) + 1];
    }
    return n;
}

/// Distance of two outlines, every vertex against every edge, and where: (nx, ny) from p to q. 0 when edges cross.
static double distance_of(int np, const double *p, int nq, const double *q, double *nx, double *ny)
{
    double best = INFINITY;
    for (int side = 0; side < 2; side++) {
        const double *a = side ? q : p, *b = side ? p : q;
        const int na = side ? nq : np, nb = side ? np : nq;
        for (int i = 0; i < na; i++)
            for (int j = 0; j < nb; j++) {
                const double *e = b + 2 * j, *f = b + 2 * ((j + 1) % nb), *x = a + 2 * i;
                const double dx = f[0] - e[0], dy = f[1] - e[1];
                double t = ((x[0] - e[0]) * dx + (x[1] - e[1]) * dy) / (dx * dx + dy * dy);
                t = t < 0 ? 0 : t > 1 ? 1 : t;
                const double rx = e[0] + t * dx - x[0], ry = e[1] + t * dy - x[1], d = hypot(rx, ry);
                if (d < best) best = d, *nx = (side ? -rx : rx) / d, *ny = (side ? -ry : ry) / d;
            }
    }
    for (int i = 0; i < np; i++)
        for (int j = 0; j < nq; j++) {
            const double *a = p + 2 * i, *b = p + 2 * ((i + 1) % np), *c = q + 2 * j, *d = q + 2 * ((j + 1) % nq);
            const double s1 = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]),
                         s2 = (b[0] - a[0]) * (d[1] - a[1]) - (b[1] - a[1]) * (d[0] - a[0]);
            const double s3 = (d[0] - c[0]) * (a[1] - c[1]) - (d[1] - c[1]) * (a[0] - c[0]),
                         s4 = (d[0] - c[0]) * (b[1] - c[1]) - (d[1] - c[1]) * (b[0] - c[0]);
            if (s1 * s2 < 0 && s3 * s4 < 0) return 0;
        }
    return best;
}

/// Depth of the deepest vertex of one outline inside the other, with nothing of the contact code: crossing number, and
/// distance to the shore.
static double depth_of(int np, const double *p, int nq, const double *q)
{
    double deepest = 0;
    for (int side = 0; side < 2; side++) {
        const double *a = side ? q : p, *b = side ? p : q;
        const int na = side ? nq : np, nb = side ? np : nq;
        for (int i = 0; i < na; i++) {
            const double x = a[2 * i], y = a[2 * i + 1];
            bool in = false;
            double shore = INFINITY;
            for (int j = 0, k = nb - 1; j < nb; k = j++) {
                const double *e = b + 2 * k, *f = b + 2 * j, dx = f[0] - e[0], dy = f[1] - e[1];
                if ((e[1] > y) != (f[1] > y) && x < e[0] + dx * (y - e[1]) / dy) in = !in;
                double t = ((x - e[0]) * dx + (y - e[1]) * dy) / (dx * dx + dy * dy);
                t = t < 0 ? 0 : t > 1 ? 1 : t;
                shore = bt_min(shore, hypot(e[0] + t * dx - x, e[1] + t * dy - y));
            }
            if (in) deepest = bt_max(deepest, shore);
        }
    }
    return deepest;
}

static double deepest_of_all(const bt_world *w)
{
    double deepest = 0, p[2 * BT_MAX_VERTICES], q[2 * BT_MAX_VERTICES];
    for (bt_idx i = 0; i < w->bodies.n; i++)
        for (bt_idx j = i + 1; j < w->bodies.n; j++) {
            const bt_pose *x = &w->bodies.pose[i], *y = &w->bodies.pose[j];
            // walls meet at their corners
            if (w->bodies.motion[i] != BT_DYNAMIC && w->bodies.motion[j] != BT_DYNAMIC) continue;
            if (hypot(x->x - y->x, x->y - y->y) > w->bodies.radius[i] + w->bodies.radius[j]) continue;
            const int n = outline_at(w, i, x->x, x->y, p), m = outline_at(w, j, y->x, y->y, q);
            deepest = bt_max(deepest, depth_of(n, p, m, q));
        }
    return deepest;
}

/// Least gap of all manifolds of the pair, and the normal of that one.
static double least_gap(const bt_world *w, double margin, double *nx, double *ny)
{
    bt_manifold *m;
    bt_idx n;
    brute_force(w, margin, &m, &n);
    double least = INFINITY;
    for (bt_idx k = 0; k < n; k++)
        for (int j = 0; j < m[k].n_points; j++)
            if (m[k].p[j].gap < least) least = m[k].p[j].gap, *nx = m[k].nx, *ny = m[k].ny;
    free(m);
    return least;
}

/// Two outlines, one of them or both with bays, at a known distance: there is a contact within the margin, its gap is
/// the distance, and none feigns less. A little into each other along their nearest points: the depth is found, and the
/// way out is short.
TEST(gaps_are_distances_of_outlines)
{
    uint64_t rng = 5;
    int near = 0, in = 0, lost = 0;
    for (int k = 0; k < 3000; k++) {
        bt_params p = params_of_world(0.1);
        bt_world *w = bt_world_create(&p);
        double v[2 * BT_MAX_VERTICES], q[2 * BT_MAX_VERTICES], nx = 0, ny = 0, mx = 0, my = 0;
        int n = random_star(&rng, 1, v);
        add_outline(w, n, v, 0, 0, 0, 0, 0);
        n = k % 2 ? random_star(&rng, 1, v) : scene_random_polygon(&rng, 0.5, v);
        // Start apart, and close in along the line of the nearest points as long as there is way: bays are entered.
        const double a = 2 * BT_PI * scene_uniform(&rng);
        add_outline(w, n, v, 4 * cos(a), 4 * sin(a), 7 * scene_uniform(&rng), 0, 0);
        double goal = 0.05 * scene_uniform(&rng), distance = 1, x = w->bodies.pose[1].x, y = w->bodies.pose[1].y;
        const int n0 = outline_at(w, 0, 0, 0, v);
        for (int s = 0; s < 60 && fabs(distance - goal) > 1e-9; s++) {
            const int n1 = outline_at(w, 1, x, y, q);
            distance = distance_of(n0, v, n1, q, &nx, &ny);
            if (distance == 0) break;
            x += (goal - distance) * nx, y += (goal - distance) * ny;
        }
        const int n1 = outline_at(w, 1, x, y, q);
        distance = distance_of(n0, v, n1, q, &nx, &ny);
        if (distance == 0) { bt_world_free(w); continue; }
        w->bodies.pose[1].x = x, w->bodies.pose[1].y = y;
        const double tie = 0.01 * bt_min(w->bodies.radius[0], w->bodies.radius[1]), margin = 0.06;
        double gap = least_gap(w, margin, &mx, &my);
        CHECK_CLOSE(gap, distance, tie + 1e-9);
        near++;
        const double depth = 1e-3;
        w->bodies.pose[1].x = x - (distance + depth) * nx, w->bodies.pose[1].y = y - (distance + depth) * ny;
        gap = least_gap(w, margin, &mx, &my);
        in++;
        // Corner on corner the way out may be shorter than the way in, and nearly none; never much longer.
        lost += !(gap < 0);
        if (!(gap >= -4 * depth - tie)) fail_msg("pair %d: gap %g after a push of %g", k, gap, depth);
        bt_world_free(w);
    }
    assert_true(near > 2500);
    if (lost > in / 100) fail_msg("%d of %d overlaps were not seen", lost, in);
}

/// A square, tilted before a front that bends inwards, so that the corner over the one part is nearer than the other
/// part: its other corner has a point on that part, too.
TEST(a_tilted_edge_has_a_point_on_each_part)
{
    bt_params p = params_of_world(0.1);
    bt_world *w = bt_world_create(&p);
    double v[10] = {0.2, 0, 0, -4, 3, -4, 3, 4, 0, 4}, square[8];
    const bt_moments m = bt_shape_centre(5, v);
    add_outline(w, 5, v, m.cx, m.cy, 0, 0, 0);
    scene_square(1, square);
    add_outline(w, 4, square, -0.6, 0.15, 0.15, 0, 0);
    bt_manifold *man;
    bt_idx n;
    bool lower = false, upper = false;
    brute_force(w, 0.5, &man, &n);
    for (bt_idx k = 0; k < n; k++)
        for (int j = 0; j < man[k].n_points; j++) {
            const double y = w->bodies.pose[1].y + man[k].p[j].rb[1];
            lower = lower || fabs(y + 0.27) < 0.01, upper = upper || fabs(y - 0.72) < 0.01;
        }
    free(man);
    bt_world_free(w);
    assert_true(lower && upper);
}

/// Two outlines that meet at a corner, to rounding, as those on the two sides of a crack: neither is inside the other.
TEST(corners_that_meet_are_not_deep)
{
    uint64_t rng = 11;
    int met = 0;
    for (int k = 0; k < 20000; k++) {
        bt_params p = params_of_world(0.1);
        bt_world *w = bt_world_create(&p);
        double v[2 * BT_MAX_VERTICES], q[2 * BT_MAX_VERTICES], nx = 0, ny = 0;
        add_outline(w, random_star(&rng, 1, v), v, 0, 0, 7 * scene_uniform(&rng), 0, 0);
        const int m = k % 2 ? random_star(&rng, 1, q) : scene_random_polygon(&rng, 0.5, q);
        add_outline(w, m, q, 0, 0, 7 * scene_uniform(&rng), 0, 0);
        int n0 = outline_at(w, 0, 0, 0, v), n1 = outline_at(w, 1, 0, 0, q);
        const int i = (int)(n0 * scene_uniform(&rng)), j = (int)(n1 * scene_uniform(&rng));
        w->bodies.pose[1].x = v[2 * i] - q[2 * j], w->bodies.pose[1].y = v[2 * i + 1] - q[2 * j + 1];
        n1 = outline_at(w, 1, w->bodies.pose[1].x, w->bodies.pose[1].y, q);
        if (distance_of(n0, v, n1, q, &nx, &ny) > 0 && depth_of(n0, v, n1, q) < 1e-12 &&
            depth_of(n1, q, n0, v) < 1e-12) {
            const double tie = 0.01 * bt_min(w->bodies.radius[0], w->bodies.radius[1]);
            const bt_pose at = w->bodies.pose[1];
            met++;
            for (int l = 0; l < 20; l++) { // rounding decides which features are nearest
                w->bodies.pose[1].x = at.x + 1e-15 * (scene_uniform(&rng) - 0.5);
                w->bodies.pose[1].y = at.y + 1e-15 * (scene_uniform(&rng) - 0.5);
                const double gap = least_gap(w, 0.05, &nx, &ny);
                if (gap < -tie) fail_msg("pair %d: depth %g", k, -gap);
            }
        }
        bt_world_free(w);
    }
    assert_true(met > 1000);
}

TEST(detect_equals_brute_force_with_parts)
{
    uint64_t rng = 9;
    int64_t total = 0, missing = 0;
    for (int scene = 0; scene < 4; scene++) {
        bt_params p = params_of_world(0.1);
        const double box = 16;
        p.cell = 2;
        p.period_x = p.period_y = scene % 2 ? box : 0;
        bt_world *w = bt_world_create(&p);
        double v[2 * BT_MAX_VERTICES];
        for (int i = 0; i < 120; i++) {
            const int n = i % 3 ? random_star(&rng, 0.8, v) : scene_random_polygon(&rng, 0.6, v);
            // one after the other: compilers differ in the order of arguments
            const double yaw = 7 * scene_uniform(&rng), y = box * scene_uniform(&rng), x = box * scene_uniform(&rng);
            add_outline(w, n, v, x, y, yaw, 0, 0);
        }
        // A large one, with bays: in the last cell, with floes of any other.
        int n_large;
        do n_large = random_star(&rng, 3, v);
        while (bt_outline_convex(n_large, v));
        bt_body_def d = scene_prism(n_large, v, 900);
        bt_parts parts;
        assert_true(bt_outline_split(n_large, v, &parts));
        d.parts = &parts;
        d.large = true;
        d.x = d.y = 0.5 * box;
        bt_world_add(w, &d);
        for (int step = 0; step < 25; step++) {
            const double margin = bt_margin_for(w, 0.5 / w->par.dt * (step % 10 < 5 ? 0.05 : 0.12));
            // Which of two facing edges is the reference depends on the step before, within the tie: without it both
            // must find the same.
            for (bt_idx k = 0; k < w->cells->n; k++)
                for (bt_idx j = 0; j < w->cells->cell[k].search.n_pairs; j++)
                    w->cells->cell[k].search.pairs[j].contact = -1;
            detect_all(w, margin);
            bt_manifold *want;
            bt_idx n, have = 0;
            brute_force(w, margin, &want, &n);
            bool *taken = bt_alloc((size_t)n, sizeof *taken);
            for (bt_idx k = 0; k < w->cells->n; k++)
                for (bt_idx j = 0; j < w->cells->cell[k].n_contacts; j++) {
                    const bt_contact *u = &w->cells->cell[k].contacts[j];
                    const double *gaps = w->cells->cell[k].gaps[j].gap,
                                 gap = u->n > 1 ? bt_min(gaps[0], gaps[1]) : gaps[0];
                    bt_idx at = -1;
                    for (bt_idx l = 0; l < n && at < 0; l++) {
                        const bt_manifold *m = &want[l];
                        const double g = m->n_points > 1 ? bt_min(m->p[0].gap, m->p[1].gap) : m->p[0].gap;
                        if (!taken[l] && m->a == u->a && m->b == u->b && g == gap) at = l;
                    }
                    if (at >= 0) taken[at] = true;
                    missing += at < 0;
                    have++;
                }
            free(taken);
            assert_int_equal(have, n);
            total += n;
            free(want);
            bt_bodies *b = &w->bodies;
            for (bt_idx i = 0; i < b->n; i++) {
                const double dx = 0.06 * (scene_uniform(&rng) - 0.5), dy = 0.06 * (scene_uniform(&rng) - 0.5),
                             dr = 0.06 * (scene_uniform(&rng) - 0.5);
                b->pose[i].x += dx, b->pose[i].y += dy, b->pose[i].yaw += dr;
                bt_bodies_turn(&w->bodies, i);
                b->path[i] += hypot(dx, dy) + b->radius[i] * fabs(dr);
            }
            for (bt_idx k = 0; k < w->cells->n; k++) w->cells->moved[k] += 0.14;
            w->cells->moved_any += 0.14;
            w->cells->relabel = true;
        }
        bt_world_free(w);
    }
    assert_true(total > 5000);
    assert_int_equal(missing, 0);
}

/// A small floe enters the bay of a C that its hull would close, meets the inner shore after the way that is drawn, and
/// both go on with the common momentum.
TEST(a_bay_is_open)
{
    bt_params p = params_of_world(0.01);
    bt_world *w = bt_world_create(&p);
    double c[] = {0, 0, 2, 0, 2, 0.5, 0.5, 0.5, 0.5, 1.5, 2, 1.5, 2, 2, 0, 2}, s[8];
    const double area = 4 - 1.5, cx = (4.0 - 1.5 * 1.25) / area; // square less the bay
    add_outline(w, 8, c, cx, 1, 0, 0, 0);
    scene_square(0.4, s);
    add_outline(w, 4, s, 4, 1, 0, -0.5, 0);
    const double way = 4 - 0.2 - 0.5, time = way / 0.5, common = -0.5 * 0.16 / (0.16 + area);
    while ((double)w->step * 0.01 < time - 0.015) {
        bt_world_step(w);
        assert_true(w->bodies.vel[bt_world_index(w, 0)].x == 0); // not one step earlier
    }
    for (int k = 0; k < 3; k++) bt_world_step(w);
    for (int g = 0; g < 2; g++) {
        const bt_vel *v = &w->bodies.vel[bt_world_index(w, g)];
        CHECK_CLOSE(v->x, common, 1e-8);
        CHECK_CLOSE(v->y, 0, 1e-8);
        CHECK_CLOSE(v->w, 0, 1e-8);
    }
    bt_world_free(w);
}

/// A floe pressed on a straight shore of two parts slides over the cut, both ways, as if it were not there.
TEST(a_cut_does_not_stop_a_slide)
{
    for (int way = -1; way <= 1; way += 2) {
        bt_params p = params_of_world(0.01);
        p.tilt_ay = -0.1;
        bt_world *w = bt_world_create(&p);
        double shore[] = {-3, -1, 3, -1, 3, 1, 0, 1, -3, 1}, s[8];
        bt_shape_centre(5, shore);
        // Cut from the middle of the upper side to a corner below.
        const bt_parts parts = {.n = 2, .count = {4, 3}, .n_vertices = 7, .corner = {0, 1, 2, 3, 0, 3, 4}};
        bt_body_def d = {.motion = BT_STATIC, .large = true, .n_vertices = 5, .vertices = shore, .parts = &parts};
        bt_world_add(w, &d);
        scene_square(0.5, s);
        bt_body_def f = scene_prism(4, s, 900);
        f.x = -way * 1.5, f.y = 1.25 + 1e-7, f.vx = way * 0.5;
        bt_world_add(w, &f);
        for (int k = 0; k < 600; k++) {
            bt_world_step(w);
            const bt_vel *v = &w->bodies.vel[bt_world_index(w, 1)];
            CHECK_CLOSE(v->x, way * 0.5, 1e-9);
            CHECK_CLOSE(v->w, 0, 1e-7);
            assert_true(w->stats.n_points > 0);
        }
        CHECK_CLOSE(w->bodies.pose[bt_world_index(w, 1)].x, way * 1.5, 1e-6);
        CHECK_CLOSE(w->bodies.pose[bt_world_index(w, 1)].y, 1.25, 3e-6);
        bt_world_free(w);
    }
}

/// A floe that is cut from corner to corner stands on that corner: both parts touch there, by one point each, and the
/// two are one.
TEST(a_corner_at_a_cut_is_one_point)
{
    const bt_params p = params_of_world(0.01);
    for (int upper = 0; upper < 2; upper++) { // the floe comes before the shore, or after it
        bt_world *w = bt_world_create(&p);
        double diamond[] = {0, -1, 1, 0, 0, 1, -1, 0}, shore[] = {-5, -2, 5, -2, 5, 0, -5, 0};
        const bt_parts parts = {.n = 2, .count = {3, 3}, .n_vertices = 6, .corner = {0, 1, 2, 0, 2, 3}};
        bt_shape_centre(4, shore);
        bt_body_def f = scene_prism(4, diamond, 900),
                    s = {.motion = BT_STATIC, .n_vertices = 4, .vertices = shore, .y = -1};
        f.parts = &parts, f.x = 0.1, f.y = 1.001;
        bt_world_add(w, upper ? &s : &f);
        bt_world_add(w, upper ? &f : &s);
        bt_manifold *m;
        bt_idx n;
        brute_force(w, 0.1, &m, &n);
        assert_int_equal(n, 1);
        assert_int_equal(m[0].n_points, 1);
        CHECK_CLOSE(m[0].p[0].gap, 0.001, 1e-12);
        free(m);
        detect_all(w, 0.1);
        bt_idx rows = 0;
        for (bt_idx k = 0; k < w->cells->n; k++)
            for (bt_idx j = 0; j < w->cells->cell[k].n_contacts; j++) rows += w->cells->cell[k].contacts[j].n;
        assert_int_equal(rows, 1);
        bt_world_free(w);
    }
}

/// A convex floe cut by hand collides like the whole one: off-centre, so that it turns, and with the cut where it is
/// hit or elsewhere. Where two edges face each other squarely the parts may take the other one's normal, within the tie
/// of the narrow phase; that is some per cent of the velocities, and happens in few of these.
TEST(parts_collide_like_the_whole)
{
    int differ = 0;
    for (int cut = 0; cut < 3; cut++)
        for (int k = 0; k < 8; k++) {
            bt_vel end[2][2];
            for (int split = 0; split < 2; split++) {
                bt_params p = params_of_world(0.01);
                bt_world *w = bt_world_create(&p);
                double hexagon[12], s[8];
                bt_shape_regular(6, 2, hexagon);
                bt_body_def d = scene_prism(6, hexagon, 900);
                const bt_parts parts[3] = {
                    {.n = 2, .count = {4, 4}, .n_vertices = 8, .corner = {0, 1, 2, 3, 0, 3, 4, 5}},
                    {.n = 2, .count = {4, 4}, .n_vertices = 8, .corner = {1, 2, 3, 4, 1, 4, 5, 0}},
                    {.n = 4, .count = {3, 3, 3, 3}, .n_vertices = 12, .corner = {0, 1, 2, 0, 2, 3, 0, 3, 4, 0, 4, 5}}};
                d.parts = split ? &parts[cut] : NULL;
                d.friction = 0.2;
                bt_world_add(w, &d);
                scene_square(0.6, s);
                bt_body_def f = scene_prism(4, s, 900);
                f.x = 3, f.y = -0.7 + 0.2 * k, f.yaw = 0.3 + 0.1 * k, f.vx = -0.8, f.friction = 0.2;
                bt_world_add(w, &f);
                for (int i = 0; i < 300; i++) bt_world_step(w);
                for (int g = 0; g < 2; g++) end[split][g] = w->bodies.vel[bt_world_index(w, g)];
                bt_world_free(w);
            }
            assert_true(end[0][0].x < -0.05);
            differ += fabs(end[1][0].w - end[0][0].w) > 1e-6;
            for (int g = 0; g < 2; g++) {
                CHECK_CLOSE(end[1][g].x, end[0][g].x, 0.02);
                CHECK_CLOSE(end[1][g].y, end[0][g].y, 0.02);
                CHECK_CLOSE(end[1][g].w, end[0][g].w, 0.05);
            }
        }
    if (differ > 2) fail_msg("%d of 24 differ", differ);
}

/// Stars that collide in a heap: momentum and angular momentum stay, energy does not grow, overlap is small.
TEST(heap_of_stars_keeps_its_balances)
{
    uint64_t rng = 21;
    bt_params p = params_of_world(0.02);
    p.position_sweeps = 0; // displacements would add to the angular momentum of what moves
    bt_world *w = bt_world_create(&p);
    double v[2 * BT_MAX_VERTICES];
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) {
            const bt_gid g = add_outline(w, random_star(&rng, 0.9, v), v, 2.2 * i, 2.2 * j, 7 * scene_uniform(&rng),
                                         -0.2 * (i - 2.5), -0.2 * (j - 2.5));
            w->bodies.friction[g] = 0.3;
        }
    double before[4] = {0}, energy = INFINITY, touched = 0, overlap = 0;
    for (int s = 0; s <= 500; s++) {
        if (s > 0) bt_world_step(w);
        double sum[4] = {0};
        for (bt_idx i = 0; i < w->bodies.n; i++) {
            const bt_vel *u = &w->bodies.vel[i];
            const bt_pose *x = &w->bodies.pose[i];
            const double m = w->bodies.mass[i];
            sum[0] += m * u->x, sum[1] += m * u->y;
            sum[2] += m * (x->x * u->y - x->y * u->x) + w->bodies.inertia[i] * u->w;
            sum[3] += 0.5 * (m * (u->x * u->x + u->y * u->y) + w->bodies.inertia[i] * u->w * u->w);
        }
        if (s == 0) memcpy(before, sum, sizeof sum);
        for (int k = 0; k < 3; k++) CHECK_CLOSE(sum[k], before[k], 1e-7 * before[3]);
        assert_true(sum[3] <= energy * (1 + 1e-9));
        energy = sum[3];
        touched += (double)w->stats.n_points;
        overlap = bt_max(overlap, bt_max(w->stats.overlap, s % 10 ? 0 : deepest_of_all(w)));
    }
    assert_true(touched > 10000 && energy < 0.5 * before[3]);
    if (!(overlap < 0.02)) fail_msg("overlap %g m", overlap);
    bt_world_free(w);
}

/// Stars pressed together by walls that close until they lock: every overlap that a look at the outlines finds stays
/// small, and the program's own figure of it does not hide any.
TEST(pressed_stars_do_not_pass_through_each_other)
{
    uint64_t rng = 33;
    bt_params p = params_of_world(0.05);
    p.slop = 1e-3, p.max_sweeps = 2000, p.tolerance = 1e-5, p.position_sweeps = 300;
    bt_world *w = bt_world_create(&p);
    double v[2 * BT_MAX_VERTICES], pressed = 0;
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) {
            const bt_gid g = add_outline(w, random_star(&rng, 0.9, v), v, 2 * i, 2 * j, 7 * scene_uniform(&rng), 0, 0);
            w->bodies.friction[g] = 0.2;
        }
    for (int k = 0; k < 4; k++) {
        // centre and half sides
        const double in = 0.05, at[4][4] = {{-3.5, 5, 1, 9}, {13.5, 5, 1, 9}, {5, -3.5, 9, 1}, {5, 13.5, 9, 1}};
        double slab[8] = {-at[k][2], -at[k][3], at[k][2], -at[k][3], at[k][2], at[k][3], -at[k][2], at[k][3]};
        bt_body_def d = {.motion = BT_KINEMATIC,
                         .large = true,
                         .n_vertices = 4,
                         .vertices = slab,
                         .x = at[k][0],
                         .y = at[k][1],
                         .friction = 0.1};
        if (k < 2) d.vx = k ? -in : in;
        else d.vy = k == 3 ? -in : in;
        bt_world_add(w, &d);
    }
    double worst = 0, deepest = 0, there = 0; // there: before the step, whose own figure is of that place, too
    for (int s = 0; s < 1550; s++) {
        if (s % 20 == 0) there = deepest_of_all(w);
        bt_world_step(w);
        for (bt_idx k = 0; k < w->cells->n; k++)
            for (bt_idx j = 0; j < w->cells->cell[k].n_contacts; j++)
                pressed = bt_max(pressed, w->cells->cell[k].contacts[j].ln[0]);
        if (s % 20 == 0) worst = bt_max(worst, bt_max(there - 2 * w->stats.overlap, 0));
        if (s % 20 == 0) deepest = bt_max(deepest, w->stats.overlap);
    }
    assert_true(pressed > 100); // N s: the heap does carry load
    if (!(worst < 2 * p.slop && deepest < 6 * p.slop)) fail_msg("overlap %g m, unseen %g m", deepest, worst);
    bt_world_free(w);
}

TEST_MAIN(NULL, NULL)
