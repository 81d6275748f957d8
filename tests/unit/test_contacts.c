// SPDX-License-Identifier: MIT
// Contact detection: the optimised path against all pairs, distances against an independent computation, features.
#include "test.h"
#include "all_pairs.h"

#include "contact/row.h"


/// Distance of two separate convex polygons by brute force over vertices and edges (own arithmetic, no contact code).
static double reference_distance(const double *p, int np, const double *q, int nq)
{
    double best = INFINITY;
    for (int side = 0; side < 2; side++) {
        const double *a = side ? q : p, *b = side ? p : q;
        int na = side ? nq : np, nb = side ? np : nq;
        for (int i = 0; i < na; i++)
            for (int j = 0; j < nb; j++) {
                const double *e = b + 2 * j, *f = b + 2 * ((j + 1) % nb), *x = a + 2 * i;
                double dx = f[0] - e[0], dy = f[1] - e[1];
                double t = ((x[0] - e[0]) * dx + (x[1] - e[1]) * dy) / (dx * dx + dy * dy);
                t = t < 0 ? 0 : t > 1 ? 1 : t;
                best = bt_min(best, hypot(x[0] - e[0] - t * dx, x[1] - e[1] - t * dy));
            }
    }
    return best;
}

static int world_polygon(const bt_world *w, bt_idx i, double shift_x, double shift_y, double *out)
{
    const bt_bodies *b = &w->bodies;
    int n = (int)(b->offset[i + 1] - b->offset[i]);
    for (int k = 0; k < n; k++) {
        const double *v = b->vertices + 2 * (b->offset[i] + k);
        double c = cos(b->pose[i].yaw), s = sin(b->pose[i].yaw);
        out[2 * k] = b->pose[i].x + shift_x + c * v[0] - s * v[1];
        out[2 * k + 1] = b->pose[i].y + shift_y + s * v[0] + c * v[1];
    }
    return n;
}

/// Random floes in a box, with large bodies among them; moved at random, so that the list ages.
static bt_world *random_scene(uint64_t *rng, int n, bool periodic, double box)
{
    bt_params p = scene_params(0.1, 1);
    p.cell = 2; // small, so that floes change their cells
    p.period_x = periodic ? box : 0;
    p.period_y = periodic ? box : 0;
    bt_world *w = bt_world_create(&p);
    double v[2 * BT_MAX_VERTICES];
    for (int i = 0; i < n; i++) {
        int nv = scene_random_polygon(rng, 0.2 + 0.5 * scene_uniform(rng), v);
        bt_body_def d = scene_prism(nv, v, 900);
        d.x = box * scene_uniform(rng), d.y = box * scene_uniform(rng), d.yaw = 7 * scene_uniform(rng);
        d.vx = scene_uniform(rng) - 0.5, d.vy = scene_uniform(rng) - 0.5, d.yaw_rate = scene_uniform(rng) - 0.5;
        bt_world_add(w, &d);
    }
    int nv = bt_shape_named("disc", 6, 6, v);
    bt_body_def d = scene_prism(nv, v, 900);
    d.x = 0.4 * box, d.y = 0.3 * box, d.vx = 0.5, d.large = true, d.motion = BT_KINEMATIC;
    bt_world_add(w, &d);
    if (!periodic) scene_wall(w, -5, -5, 0, box + 5, 0.1);
    return w;
}

static void move_all(bt_world *w, uint64_t *rng, double step)
{
    bt_bodies *b = &w->bodies;
    for (bt_idx i = 0; i < b->n; i++) {
        if (b->motion[i] == BT_STATIC) continue;
        double dx = step * (scene_uniform(rng) - 0.5), dy = step * (scene_uniform(rng) - 0.5),
               dr = step * (scene_uniform(rng) - 0.5);
        b->pose[i].x += dx, b->pose[i].y += dy, b->pose[i].yaw += dr;
        if (w->par.period_x > 0) b->pose[i].x -= w->par.period_x * floor(b->pose[i].x / w->par.period_x);
        if (w->par.period_y > 0) b->pose[i].y -= w->par.period_y * floor(b->pose[i].y / w->par.period_y);
        bt_bodies_turn(&w->bodies, i);
        b->path[i] += hypot(dx, dy) + b->radius[i] * fabs(dr);
    }
}

/// What the cells must know of moves that were not made by a step.
static void note_moves(bt_world *w, double most)
{
    bt_cells *t = w->cells;
    for (bt_idx k = 0; k < t->n; k++) t->moved[k] += most;
    t->moved_any += most;
    for (bt_idx i = 0; i < t->n_in_cells; i++) t->relabel = t->relabel || bt_cells_outside(w, i) > t->allowance;
}

typedef struct {
    bt_gid a, b;
    int n_points;
    double gap;       ///< least
    uint32_t feature; ///< of the first point
} contact;

static int by_gids(const void *p, const void *q)
{
    const contact *a = p, *b = q;
    if (a->a != b->a) return a->a < b->a ? -1 : 1;
    return a->b < b->b ? -1 : a->b > b->b;
}

/// Contacts of all cells in the order of their gids; the caller frees.
static contact *contacts_of(const bt_world *w, bt_idx *n)
{
    contact *c = bt_alloc((size_t)w->cells->n_contacts, sizeof *c);
    *n = 0;
    for (bt_idx k = 0; k < w->cells->n; k++) {
        const bt_cell *t = &w->cells->cell[k];
        for (bt_idx j = 0; j < t->n_contacts; j++) {
            const bt_contact *u = &t->contacts[j];
            assert_int_equal(bt_cells_of_pair(w, u->a, u->b), k);
            c[(*n)++] = (contact){w->bodies.gid[u->a], w->bodies.gid[u->b], u->n,
                                  u->n > 1 ? bt_min(t->gaps[j].gap[0], t->gaps[j].gap[1]) : t->gaps[j].gap[0],
                                  t->gaps[j].feature[0]};
        }
    }
    assert_int_equal(*n, w->cells->n_contacts);
    if (*n) qsort(c, (size_t)*n, sizeof *c, by_gids);
    return c;
}

/// Cells that this detection has listed anew. The margin of their lists is moved by a trace, so that no later one
/// looks like it.
static int64_t new_lists(bt_world *w, double margin)
{
    int64_t n = 0;
    for (bt_idx k = 0; k < w->cells->n; k++) {
        double *listed = &w->cells->cell[k].search.margin_listed;
        n += *listed == margin;
        *listed *= 1 + 1e-12;
    }
    return n;
}

TEST(detect_equals_brute_force)
{
    uint64_t rng = 7;
    int64_t total = 0, labellings = 0;
    for (int scene = 0; scene < 12; scene++) {
        const bool periodic = scene % 3 == 2;
        const double box = scene % 2 ? 12 : 25;
        bt_world *w = random_scene(&rng, scene % 4 == 0 ? 30 : 250, periodic, box);
        int64_t listings = 0;
        for (int step = 0; step < 60; step++) {
            // it comes and goes
            const double margin = bt_margin_for(w, 0.5 / w->par.dt * (step % 20 < 10 ? 0.05 : 0.12));
            detect_all(w, margin);
            listings += new_lists(w, margin);
            bt_manifold *want;
            bt_idx n, m;
            brute_force(w, margin, &want, &n);
            contact *have = contacts_of(w, &m);
            assert_int_equal(m, n);
            total += n;
            for (bt_idx k = 0; k < n; k++) {
                assert_int_equal(have[k].a, w->bodies.gid[want[k].a]);
                assert_int_equal(have[k].b, w->bodies.gid[want[k].b]);
            }
            free(want);
            free(have);
            move_all(w, &rng, 0.08);
            note_moves(w, 0.09);
        }
        labellings += w->cells->n_labellings;
        // labels and lists are in fact kept
        assert_true(w->cells->n_labellings < 30 && listings < 50 * w->cells->n);
        bt_world_free(w);
    }
    assert_true(total > 10000 && labellings > 14); // and renewed
}

/// Floes on top of each other, many of them thin: opposite edges of those separate nearly alike.
static bt_world *heap(uint64_t *rng, int n)
{
    const bt_params p = scene_params(0.1, 1);
    bt_world *w = bt_world_create(&p);
    double v[2 * BT_MAX_VERTICES];
    for (int i = 0; i < n; i++) {
        const int nv = scene_random_polygon(rng, 0.2 + 0.8 * scene_uniform(rng), v);
        const double flat = i % 2 ? 0.05 : 1;
        for (int k = 0; k < nv; k++) v[2 * k + 1] *= flat;
        bt_body_def d = scene_prism(nv, v, 900);
        d.x = 2 * scene_uniform(rng), d.y = 2 * scene_uniform(rng), d.yaw = i % 4 < 2 ? 0 : 7 * scene_uniform(rng);
        bt_world_add(w, &d);
    }
    detect_all(w, 0.1);
    return w;
}

/// What a pair has kept of its last search changes nothing, however the two have moved; and it spares most searches.
TEST(kept_edges_change_nothing)
{
    enum { BODIES = 30, PAIRS = BODIES * (BODIES - 1) / 2 };
    uint64_t rng = 17;
    int looks = 0, searches = 0, touching = 0;
    for (int scene = 0; scene < 8; scene++) {
        bt_world *w = heap(&rng, BODIES);
        bt_axes kept[PAIRS];
        int before[PAIRS];
        for (int k = 0; k < PAIRS; k++) kept[k] = (bt_axes)BT_NO_AXES, before[k] = -1;
        for (int step = 0; step < 150; step++) {
            int k = 0;
            for (bt_gid g = 0; g < BODIES; g++)
                for (bt_gid h = g + 1; h < BODIES; h++, k++) {
                    const bt_idx i = bt_world_index(w, g), j = bt_world_index(w, h);
                    const bt_axes last = kept[k];
                    bt_manifold m = {0}, want = {0};
                    const bool touch = bt_contacts_parts(w, i, j, (uint16_t[2]){0}, 0.1, before[k], &m, &kept[k]);
                    assert_int_equal(touch, bt_contacts_parts(w, i, j, (uint16_t[2]){0}, 0.1, before[k], &want, NULL));
                    if (touch) assert_memory_equal(&m, &want, sizeof m);
                    before[k] = touch ? (int)(m.p[0].feature >> 31) : -1;
                    looks += touch && step > 0;
                    searches += touch && step > 0 && (kept[k].x != last.x || kept[k].y != last.y);
                    touching += touch;
                }
            // by turns together, along one direction, across it, and turning
            const double small = 0.05 * pow(scene_uniform(&rng), 3);
            for (bt_idx i = 0; i < w->bodies.n; i++) {
                bt_pose *p = &w->bodies.pose[i];
                p->x += 0.5 + (step % 4 == 1) * small * (scene_uniform(&rng) - 0.5);
                p->y += (step % 4 == 2) * small * (scene_uniform(&rng) - 0.5);
                p->yaw += (step % 4 == 3) * small * (scene_uniform(&rng) - 0.5);
                bt_bodies_turn(&w->bodies, i);
            }
        }
        bt_world_free(w);
    }
    assert_true(touching > 100000 && searches < looks / 3);
}

/// Every separate pair nearer than the margin has a manifold, its least gap is the distance, and none is farther.
TEST(gaps_are_distances)
{
    uint64_t rng = 11;
    int seen = 0, corners = 0;
    for (int scene = 0; scene < 10; scene++) {
        bt_world *w = random_scene(&rng, 120, scene % 2, 25);
        const double margin = bt_margin_for(w, 0.5 / w->par.dt * 0.6);
        detect_all(w, margin);
        bt_idx k = 0, n;
        contact *c = contacts_of(w, &n);
        for (bt_gid g = 0; g < w->bodies.n; g++)
            for (bt_gid h = g + 1; h < w->bodies.n; h++) {
                const bt_idx i = bt_world_index(w, g), j = bt_world_index(w, h);
                if (w->bodies.motion[i] != BT_DYNAMIC && w->bodies.motion[j] != BT_DYNAMIC) continue;
                double p[2 * BT_MAX_VERTICES], q[2 * BT_MAX_VERTICES], d[2];
                bt_bodies_offset(w, i, j, d);
                int np = world_polygon(w, i, 0, 0, p);
                int nq = world_polygon(w, j, w->bodies.pose[i].x + d[0] - w->bodies.pose[j].x,
                                       w->bodies.pose[i].y + d[1] - w->bodies.pose[j].y, q);
                double distance = reference_distance(p, np, q, nq);
                while (k < n && (c[k].a < g || (c[k].a == g && c[k].b < h))) k++;
                const bool have = k < n && c[k].a == g && c[k].b == h;
                const double gap = have ? c[k].gap : INFINITY;
                if (have && gap <= 0) continue; // they overlap
                if (distance > margin + 1e-12) {
                    assert_false(have);
                } else if (distance < margin - 1e-12) {
                    assert_true(have);
                    // The reference edge may be a near tie (1 % of the radius) of the best one.
                    CHECK_CLOSE(gap, distance, 0.011);
                    seen++;
                    corners += c[k].feature >= 0x7ff00000u && c[k].feature < 0x80000000u;
                }
            }
        free(c);
        bt_world_free(w);
    }
    assert_true(seen > 500);
    assert_true(corners > 20);
}

/// Both arms of a point end in the same place, on the surfaces' middle; the normal points from a to b.
TEST(arms_meet)
{
    uint64_t rng = 3;
    bt_world *w = random_scene(&rng, 200, true, 15);
    bt_manifold *man;
    bt_idx n;
    brute_force(w, 0.1, &man, &n);
    assert_true(n > 100);
    for (bt_idx k = 0; k < n; k++) {
        const bt_manifold *m = &man[k];
        double d[2];
        bt_bodies_offset(w, m->a, m->b, d);
        CHECK_CLOSE(hypot(m->nx, m->ny), 1, 1e-12);
        assert_true(m->n_points >= 1 && m->n_points <= 2);
        for (int i = 0; i < m->n_points; i++) {
            CHECK_CLOSE(m->p[i].ra[0], m->p[i].rb[0] + d[0], 1e-12);
            CHECK_CLOSE(m->p[i].ra[1], m->p[i].rb[1] + d[1], 1e-12);
            assert_true(m->p[i].gap <= 0.1);
        }
        // Moving b by the normal opens the gap.
        if (m->p[0].gap > 0) {
            bt_manifold after;
            const double step = 1e-4;
            w->bodies.pose[m->b].x += step * m->nx;
            w->bodies.pose[m->b].y += step * m->ny;
            if (bt_contacts_parts(w, m->a, m->b, (uint16_t[2]){0}, 0.2, (int)(m->p[0].feature >> 31), &after, NULL))
                CHECK_CLOSE(bt_min(after.p[0].gap, after.p[after.n_points - 1].gap),
                            bt_min(m->p[0].gap, m->p[m->n_points - 1].gap) + step, 1e-7);
            w->bodies.pose[m->b].x -= step * m->nx;
            w->bodies.pose[m->b].y -= step * m->ny;
        }
    }
    free(man);
    bt_world_free(w);
}

/// Squares of 1 m at the origin and at (x, y).
static bt_world *two_squares(double x, double y)
{
    bt_params p = scene_params(0.1, 1);
    bt_world *w = bt_world_create(&p);
    double v[8];
    scene_square(1, v);
    bt_body_def d = scene_prism(4, v, 900);
    bt_world_add(w, &d);
    d.x = x, d.y = y;
    bt_world_add(w, &d);
    return w;
}

/// Two squares edge to edge: two points at the ends of the shared edge, the same features while they slide a little.
TEST(edge_contact_keeps_its_features)
{
    bt_world *w = two_squares(1.01, 0.3);
    uint32_t features[2] = {0, 0};
    for (int s = 0; s < 50; s++) {
        detect_all(w, 0.05);
        assert_int_equal(w->cells->n_contacts, 1);
        const bt_idx k = bt_cells_of_pair(w, 0, 1);
        bt_contact *u = &w->cells->cell[k].contacts[0];
        const bt_gaps *g = &w->cells->cell[k].gaps[0];
        assert_int_equal(u->n, 2);
        CHECK_CLOSE(u->nx, 1, 0.02);
        if (s == 0) {
            CHECK_CLOSE(fabs(u->ran[0] - u->ran[1]), 0.7, 1e-12);
            CHECK_CLOSE(g->gap[0], 0.01, 1e-12);
        } else {
            CHECK_CLOSE(u->ln[0], 100 + s - 1, 0);
            CHECK_CLOSE(u->lt, 7 + s - 1, 0);
            assert_int_equal(g->feature[0], features[0]);
            assert_int_equal(g->feature[1], features[1]);
        }
        features[0] = g->feature[0], features[1] = g->feature[1];
        u->ln[0] = 100 + s; // must be handed on to the next step
        u->lt = 7 + s;
        w->bodies.pose[1].y += 0.002;
        w->bodies.pose[1].yaw = 2e-4 * (s % 2 ? 1 : -1); // the two edges take turns in being the better axis
        bt_bodies_turn(&w->bodies, 1);
        w->bodies.path[1] += 0.01;
        note_moves(w, 0.01);
    }
    bt_world_free(w);
}

/// Two squares whose edges face each other along a millionth of their length: two points, and no telling how they share
/// the load. Solved together they would take the difference of two impulses of any size.
TEST(points_that_all_but_coincide_are_not_solved_together)
{
    bt_world *w = two_squares(1.01, 1 - 1e-6);
    detect_all(w, 0.05);
    assert_int_equal(w->cells->n_contacts, 1);
    const bt_contact *u = &w->cells->cell[bt_cells_of_pair(w, 0, 1)].contacts[0];
    assert_int_equal(u->n, 2);
    CHECK_CLOSE(u->ran[0] - u->ran[1], 0, 1.01e-6);
    assert_true(bt_mass_of(u, w->bodies.inv).per_det == 0);
    bt_world_free(w);
}

TEST_MAIN(NULL, NULL)
