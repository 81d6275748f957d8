// SPDX-License-Identifier: MIT
// Cells on one rank: labels that follow the floes, cells at rest that cost nothing and wake up, blows that go farther
// than a cell, boxes of few cells around a period, and floes of very different size.
#include <sys/resource.h>

#include "test.h"
#include "space/pairs.h"
#include "all_pairs.h"

enum { SIDE = 20 }; // floes along one side of the square fields

static bt_params cell_params(void)
{
    bt_params p = scene_params(0.1, 1);
    p.slop = 1e-3;
    p.max_sweeps = 2000;
    return p;
}

/// Squares of 0.7 m, 1 m apart, turned by turns; with the velocity (u, v).
static void add_field(bt_world *w, double x0, double y0, int nx, int ny, double u, double v)
{
    for (int j = 0; j < ny; j++)
        for (int i = 0; i < nx; i++) {
            double s[8];
            scene_square(0.7, s);
            bt_body_def d = scene_prism(4, s, 40);
            d.x = x0 + i, d.y = y0 + j, d.yaw = 0.3 * ((i * 7 + j * 3) % 5);
            d.vx = u, d.vy = v;
            d.friction = 0.3;
            d.drag.water_skin = 5, d.drag.yaw = 0.1;
            bt_world_add(w, &d);
        }
}

/// A disc-like heavy body.
static bt_gid add_hitter(bt_world *w, double radius, double x, double y, double u, double v, bt_motion motion,
                         bool large)
{
    double s[32];
    for (int k = 0; k < 16; k++) s[2 * k] = radius * cos(BT_PI * k / 8), s[2 * k + 1] = radius * sin(BT_PI * k / 8);
    bt_body_def d = scene_prism(16, s, 400);
    d.motion = motion;
    d.large = large;
    d.x = x, d.y = y, d.vx = u, d.vy = v;
    return bt_world_add(w, &d);
}

static bt_pose pose_of(const bt_world *w, bt_gid g) { return w->bodies.pose[bt_world_index(w, g)]; }
static bt_vel vel_of(const bt_world *w, bt_gid g) { return w->bodies.vel[bt_world_index(w, g)]; }

static void assert_same_pose(bt_pose a, bt_pose b) { assert_true(a.x == b.x && a.y == b.y && a.yaw == b.yaw); }

/// The invariants of cells.h at the start of a step.
static void check_cells(const bt_world *w)
{
    const bt_cells *t = w->cells;
    const bt_bodies *b = &w->bodies;
    bt_idx n = 0;
    for (bt_idx k = 0; k < t->n; k++) {
        assert_int_equal(t->cell[k].first, n);
        for (n = t->cell[k].first; n < t->cell[k].end; n++) {
            assert_int_equal(bt_world_index(w, b->gid[n]), n);
            if (k == t->n - 1) continue;
            assert_true(b->cell[n][0] == t->cell[k].x && b->cell[n][1] == t->cell[k].y);
            assert_true(n == t->cell[k].first || b->gid[n - 1] < b->gid[n]);
            assert_true(bt_cells_outside(w, n) <= t->allowance);
        }
    }
    assert_int_equal(n, b->n);
}

// Red: `relabel` never set, or the distance outside taken from another cell.
TEST(labels_follow_the_floes)
{
    bt_params p = cell_params();
    p.water_u = 0.3; // cells go with the water: the field stays behind, and goes across
    bt_world *w = bt_world_create(&p);
    add_field(w, 0.5, 0.5, SIDE, SIDE, 0, 1);
    for (bt_idx i = 0; i < w->bodies.n; i++) w->bodies.drag[i] = (bt_drag){0};
    const bt_gid runner = add_hitter(w, 0.5, -3, 10.2, 1.5, 0, BT_DYNAMIC, false);
    int64_t touching = 0;
    for (int n = 0; n < 200; n++) {
        bt_world_step(w);
        assert_false(w->stats.outrun);
        touching += w->stats.n_points;
        bt_cells_begin(w);
        check_cells(w);
    }
    assert_true(w->cells->n_labellings > 5 && w->cells->n_labellings < 100);
    assert_true(touching > 100 && vel_of(w, runner).x < 1.4);
    // The storage is in the order of the cells and not of the gids: names lead to the right body all the same.
    for (bt_gid g = 0; g <= runner; g++) assert_int_equal(w->bodies.gid[bt_world_index(w, g)], g);
    bt_world_free(w);
}

// Red: a cell at rest that is stepped all the same (n_active), or one that never wakes up (momentum).
TEST(rest_costs_nothing_and_ends)
{
    const bt_params p = cell_params();
    bt_world *w = bt_world_create(&p);
    enum { LONG = 60 };
    add_field(w, 0.5, 0.5, LONG, SIDE, 0, 0);
    const bt_gid n = LONG * SIDE;
    bt_pose *before = bt_alloc((size_t)n, sizeof *before);
    for (int k = 0; k < 3; k++) bt_world_step(w); // new bodies have to be looked at once
    assert_int_equal(w->stats.n_active, 0);
    assert_int_equal(w->stats.n_points, 0);
    assert_int_equal(w->cells->n_contacts, 0);
    assert_int_equal(w->cells->n_busy, 1);
    for (bt_gid g = 0; g < n; g++) before[g] = pose_of(w, g);
    double *listed = &w->cells->cell[w->cells->n - 1].search.margin_listed, kept = *listed *= 1 + 1e-12;
    for (int k = 0; k < 50; k++) bt_world_step(w);
    assert_true(*listed == kept); // a new list would have its own margin
    for (bt_gid g = 0; g < n; g++) assert_same_pose(before[g], pose_of(w, g));
    for (bt_idx k = 0; k < w->cells->n - 1; k++) assert_null(w->cells->cell[k].search.pairs);

    // One floe is set in motion from outside: its neighbourhood wakes up, the far end does not.
    const bt_gid first = 10 * LONG + 2;
    w->bodies.vel[bt_world_index(w, first)] = (bt_vel){.x = 1};
    w->cells->labelled = false; // as after every change from outside
    int64_t most = 0;
    for (int k = 0; k < 30; k++) {
        bt_world_step(w);
        most = w->stats.n_active > most ? w->stats.n_active : most;
        assert_true(w->stats.n_active > 0);
        assert_false(w->stats.outrun);
    }
    assert_true(most < n / 2);
    assert_true(vel_of(w, first + 1).x > 0); // it has been hit
    int moved = 0;
    for (bt_gid g = 0; g < n; g++) {
        if (g % LONG >= 40) assert_same_pose(before[g], pose_of(w, g));
        moved += before[g].x != pose_of(w, g).x;
    }
    assert_true(moved >= 2 && moved < 200);
    free(before);
    bt_world_free(w);
}

/// What is not listed is at rest and idle; the list ascends.
static void check_busy(const bt_cells *t)
{
    bt_idx n = 0;
    for (bt_idx k = 0; k < t->n; k++) {
        if (t->is_busy[k]) {
            assert_true(n < t->n_busy && t->busy[n] == k);
            n++;
            continue;
        }
        assert_true(k < t->n - 1 && t->asleep[k] == BT_ASLEEP && !t->awake[k] && t->bound[k] == 0 && t->speed[k] == 0);
        assert_true(!t->cell[k].active && !t->cell[k].search.pairs && t->cell[k].n_contacts == 0 &&
                    t->cell[k].overlap == 0 && !t->cell[k].swept);
    }
    assert_int_equal(n, t->n_busy);
}

// Red: a cell that contacts wake left out of the list; an awake cell that leaves it; a pair left out of the near ones
// while it may close.
TEST(a_step_looks_at_busy_cells_alone)
{
    bt_world *w[2]; // the second looks at everything in every step
    bt_gid hitter = 0;
    for (int k = 0; k < 2; k++) {
        bt_params p = cell_params();
        p.slop = 1e-5;
        p.tolerance = 1e-6;
        p.max_sweeps = 200;
        w[k] = bt_world_create(&p);
        add_field(w[k], 6.5, 0.5, 50, SIDE, 0, 0);
        hitter = add_hitter(w[k], 2, 3, 10.1, 0.8, 0, BT_KINEMATIC, true);
    }
    int64_t points = 0;
    bt_idx least = w[0]->cells->n + 1000;
    for (int n = 0; n < 120; n++) {
        // It goes on, stops until nearly all rests, and comes back.
        for (int k = 0; k < 2; k++) w[k]->bodies.vel[bt_world_index(w[k], hitter)].x = n < 50 ? 0.8 : n < 70 ? 0 : -0.8;
        bt_cells *all = w[1]->cells;
        for (bt_idx k = 0; k < all->n; k++) {
            all->asleep[k] = BT_AWAKE;
            all->cell[k].search.near_known = false;
        }
        if (n > 0) bt_cells_wake_all(all);
        for (int k = 0; k < 2; k++) bt_world_step(w[k]);
        assert_true(bt_world_hash(w[0]) == bt_world_hash(w[1]));
        assert_true(w[0]->stats.n_active == w[1]->stats.n_active &&
                    w[0]->stats.kinetic_energy == w[1]->stats.kinetic_energy);
        assert_true(w[0]->stats.contact_updates == w[1]->stats.contact_updates &&
                    w[0]->stats.overlap == w[1]->stats.overlap);
        check_busy(w[0]->cells);
        points += w[0]->stats.n_points;
        least = n > 2 && w[0]->cells->n_busy < least ? w[0]->cells->n_busy : least;
    }
    assert_true(points > 1000 && least < w[0]->cells->n / 2);
    for (int k = 0; k < 2; k++) bt_world_free(w[k]);
}

/// A body goes through a field at `speed` relative to water that flows with (u, v).
static bt_world *tow_in_current(double u, double v, double speed, int steps, int64_t *active, int64_t *points,
                                bool *projected)
{
    bt_params p = cell_params();
    p.slop = 1e-5; // so that overlap is pushed out now and then
    p.tolerance = 1e-6;
    p.max_sweeps = 200;
    p.water_u = p.air_u = u;
    p.water_v = p.air_v = v;
    bt_world *w = bt_world_create(&p);
    add_field(w, 6.5, 0.5, 50, SIDE, u, v);
    add_hitter(w, 2, 3, 10.4, u + speed, v, BT_KINEMATIC, true);
    *active = *points = 0;
    for (int n = 0; n < steps; n++) {
        bt_world_step(w);
        if (w->stats.n_active > *active && n > 2) *active = w->stats.n_active;
        *points += w->stats.n_points;
        *projected = *projected || w->stats.position_sweeps > 0;
    }
    return w;
}

// Red: cells that do not move with the water; a floe whose velocity the rounding of the drag takes off that of the
// water.
TEST(uniform_current_is_a_moving_frame)
{
    // Rounding doubles every other step or so once floes rub, and sooner or later decides in which sweep a solve ends,
    // which is worth its tolerance: 1e-13 m here, 3e-6 m one step on, millimetres at 80.
    enum { STEPS = 39 };
    int64_t active[2], points[2];
    bool projected[2] = {false, false};
    const double u = 0.25, v = -0.125, t = 0.1 * STEPS; // powers of two: the drift of one step is as exact as may be
    bt_world *still = tow_in_current(0, 0, 0.5, STEPS, &active[0], &points[0], &projected[0]);
    bt_world *drift = tow_in_current(u, v, 0.5, STEPS, &active[1], &points[1], &projected[1]);
    assert_true(projected[0] && projected[1]);
    assert_true(points[0] > 1000 && active[0] > 50 && active[0] < 400);
    assert_int_equal(active[0], active[1]);
    assert_int_equal(points[0], points[1]);
    int rest = 0, disturbed = 0;
    for (bt_gid g = 0; g < 50 * SIDE; g++) {
        const bt_pose p = pose_of(still, g), q = pose_of(drift, g);
        if (p.x == 6.5 + g % 50) rest++;
        else disturbed++;
        CHECK_CLOSE(q.x, p.x + u * t, 1e-10);
        CHECK_CLOSE(q.y, p.y + v * t, 1e-10);
        CHECK_CLOSE(q.yaw, p.yaw, 1e-10);
        if (p.x == 6.5 + g % 50) assert_true(vel_of(drift, g).x == u && vel_of(drift, g).y == v);
    }
    assert_true(rest > 800 && disturbed >= 10);
    bt_world_free(still);
    bt_world_free(drift);
}

// Red: displacements of an earlier step applied to floes that rest meanwhile (seen: their array is not cleared where
// nothing moves).
TEST(old_displacements_are_forgotten)
{
    bt_params p = cell_params();
    p.water_u = p.air_u = 0.25;
    bt_world *w = bt_world_create(&p);
    add_field(w, 0.5, 0.5, 40, SIDE, 0.25, 0);
    // two places far apart where a floe is set upon its neighbour, the second when all is over at the first
    for (int k = 0; k < 2; k++) {
        const bt_gid g = 3 * 40 + (k ? 35 : 3);
        const bt_idx i = bt_world_index(w, g);
        w->bodies.pose[i].x += 0.4;
        w->bodies.disturbed[i] = 1;
        if (k) w->cells->asleep[bt_cells_at(w->cells, w->bodies.cell[i][0], w->bodies.cell[i][1])] = BT_AWAKE;
        const double before = pose_of(w, g).x;
        double near[10]; // floes at the first place
        for (int m = 0; m < 10; m++) near[m] = pose_of(w, 3 * 40 + m).x;
        bt_world_step(w);
        assert_true(w->solver->shifted && w->stats.overlap > 0.01);
        assert_true(pose_of(w, g).x - before - 0.025 < -0.003); // pushed back
        for (int m = 0; m < 10 && k; m++) CHECK_CLOSE(pose_of(w, 3 * 40 + m).x, near[m] + 0.025, 1e-13);
        for (int n = 0; n < 10; n++) bt_world_step(w);
        assert_false(w->solver->shifted);
        assert_int_equal(w->stats.n_active, 0);
    }
    bt_world_free(w);
}

/// A row of n touching squares of 1 m at rest, the first hit by a heavy one at 1 m/s, no restitution.
static bt_world *hit_row(int n, double cell, int steps, bool *outrun, int64_t *repeats, double *lost)
{
    bt_params p = cell_params();
    p.cell = cell;
    bt_world *w = bt_world_create(&p);
    double s[8];
    scene_square(1, s);
    bt_body_def d = scene_prism(4, s, 100);
    for (int k = 0; k < n; k++) {
        d.x = k;
        bt_world_add(w, &d);
    }
    d.x = -1.05;
    bt_world_add(w, &d);
    for (int k = 0; k < 3; k++) bt_world_step(w); // new bodies are looked at; now all rest
    assert_int_equal(w->stats.n_active, 0);
    w->bodies.vel[bt_world_index(w, n)].x = 1;
    w->cells->labelled = false; // as after every change from outside
    *outrun = false;
    *repeats = 0;
    *lost = 0;
    for (int m = 0; m < steps; m++) {
        bt_world_step(w);
        *outrun = *outrun || w->stats.outrun;
        *repeats += w->stats.repeats;
        double momentum = 0;
        for (bt_idx i = 0; i < w->bodies.n; i++) momentum += 100 * w->bodies.vel[i].x;
        *lost = bt_max(*lost, fabs(momentum - 100));
    }
    return w;
}

// Red: no look at what the solution outran (the far end of the row stays at rest, its neighbour runs into it, nothing
// is said).
TEST(a_blow_goes_through_a_row)
{
    bool outrun;
    int64_t repeats;
    double lost;
    // Cells of four floes: eight of them are more than the hit cell and the ring around it.
    enum { N = 32 };
    bt_world *w = hit_row(N, 4, 2, &outrun, &repeats, &lost);
    assert_false(outrun);
    assert_true(repeats > 0 && w->stats.converged);
    CHECK_CLOSE(lost, 0, 1e-9);
    for (bt_gid g = 0; g <= N; g++) CHECK_CLOSE(vel_of(w, g).x, 1.0 / (N + 1), 1e-6);
    bt_world_free(w);

    // So long that the repeats of a step do not reach the end: reported as outrun; nothing is lost, and no floe runs
    // through another.
    enum { LONG = 160 };
    w = hit_row(LONG, 2.5, 1, &outrun, &repeats, &lost);
    assert_true(outrun);
    CHECK_CLOSE(lost, 0, 1e-9);
    assert_true(vel_of(w, LONG - 1).x == 0);
    bt_world_free(w);
    w = hit_row(LONG, 2.5, 12, &outrun, &repeats, &lost);
    assert_true(outrun && !w->stats.outrun);
    CHECK_CLOSE(lost, 0, 1e-9);
    for (bt_gid g = 0; g <= LONG; g++) CHECK_CLOSE(vel_of(w, g).x, 1.0 / (LONG + 1), 1e-5);
    for (bt_gid g = 1; g < LONG; g++) assert_true(pose_of(w, g).x - pose_of(w, g - 1).x > 1 - 2e-3);
    bt_world_free(w);
}

/// The work by which ranks are balanced is that of the sweeps, cell by cell: in batches, and of a large body.
TEST(work_is_counted_cell_by_cell)
{
    bool outrun;
    int64_t repeats, before = 0;
    double lost;
    bt_world *w = hit_row(8, 2.5, 0, &outrun, &repeats, &lost);
    double s[8];
    scene_square(5, s);
    bt_body_def d = scene_prism(4, s, 100);
    d.x = 10, d.large = true;
    bt_world_add(w, &d);
    for (int k = 0; k < 4; k++) {
        bt_world_step(w);
        int64_t work = 0;
        for (bt_idx c = 0; c < w->cells->n; c++) work += w->cells->cell[c].updates;
        assert_int_equal(work - before, w->stats.contact_updates);
        before = work;
    }
    assert_true(w->cells->cell[w->cells->n - 1].updates > 0);
    assert_true(before > w->cells->cell[w->cells->n - 1].updates);
    bt_world_free(w);
}

/// (margin: a power of two, which is not rounded up). Do the contacts of every cell, together, have the pairs that
/// testing all with all finds, each once?
static void check_contacts(bt_world *w, double margin)
{
    bt_manifold *want;
    bt_idx n_want;
    detect_all(w, margin);
    brute_force(w, margin, &want, &n_want);
    assert_int_equal(w->cells->n_contacts, n_want);
    const bt_gid *gid = w->bodies.gid;
    uint64_t sum = 0, sum_want = 0;
    for (bt_idx k = 0; k < w->cells->n; k++)
        for (bt_idx j = 0; j < w->cells->cell[k].n_contacts; j++) {
            const bt_contact *u = &w->cells->cell[k].contacts[j];
            sum += (uint64_t)(gid[u->a] + 1) * (uint64_t)(gid[u->b] + 7) * (uint64_t)(gid[u->b] + 3);
        }
    for (bt_idx k = 0; k < n_want; k++)
        sum_want += (uint64_t)(gid[want[k].a] + 1) * (uint64_t)(gid[want[k].b] + 7) * (uint64_t)(gid[want[k].b] + 3);
    assert_true(sum == sum_want && n_want > 0);
    free(want);
}

// Red: three cells around a period (two of one colour meet at the seam), two (a block that holds a cell twice), wrong
// nearest cell.
TEST(few_cells_around_a_period)
{
    uint64_t seed = 11;
    for (int around = 1; around <= 5; around++) { // periods of room for 1 to 5 cells of 4 m
        for (int both = 0; both < 2; both++) {
            bt_params p = cell_params();
            p.cell = 4;
            p.period_x = 4.2 * around;
            p.period_y = both ? 4.2 * around : 0;
            bt_world *w = bt_world_create(&p);
            add_field(w, 0.3, 0.3, (int)p.period_x, both ? (int)p.period_y : 12, 0, 0);
            for (bt_idx i = 0; i < w->bodies.n; i++) {
                w->bodies.vel[i] = (bt_vel){.x = scene_uniform(&seed) - 0.2,
                                            .y = scene_uniform(&seed) - (both ? 0.8 : 0.5),
                                            .w = scene_uniform(&seed) - 0.5};
                w->bodies.drag[i] = (bt_drag){0};
            }
            bt_cells_begin(w);
            const int want = around < 4 ? 1 : 4;
            assert_int_equal(w->cells->wrap_x, want);
            assert_int_equal(w->cells->wrap_y, both ? want : 0);
            double before[2] = {0, 0}, after[2] = {0, 0};
            for (bt_idx i = 0; i < w->bodies.n; i++) before[0] += w->bodies.vel[i].x, before[1] += w->bodies.vel[i].y;
            double overlap = 0;
            for (int n = 0; n < 150; n++) {
                bt_world_step(w);
                overlap = bt_max(overlap, w->stats.overlap);
                assert_false(w->stats.outrun);
                for (bt_idx i = 0; i < w->bodies.n; i++)
                    assert_true(w->bodies.pose[i].x >= 0 && w->bodies.pose[i].x < p.period_x);
            }
            for (bt_idx i = 0; i < w->bodies.n; i++) after[0] += w->bodies.vel[i].x, after[1] += w->bodies.vel[i].y;
            CHECK_CLOSE(after[0], before[0], 1e-9);
            CHECK_CLOSE(after[1], before[1], 1e-9);
            assert_true(overlap < 0.02); // pairs across the seam are seen
            check_contacts(w, 0.25);
            bt_world_free(w);
        }
    }
}

// Red: cells made for the mean size, so that a large floe touches others beyond its block.
TEST(floes_of_very_different_size)
{
    uint64_t seed = 5;
    bt_params p = cell_params();
    p.cell = 2;
    bt_world *w = bt_world_create(&p);
    double v[2 * BT_MAX_VERTICES];
    for (int k = 0; k < 300; k++) {
        const double radius = k % 40 == 0 ? 3.5 : k % 7 == 0 ? 1 : 0.3;
        const int n = scene_random_polygon(&seed, radius, v);
        bt_body_def d = scene_prism(n, v, 40);
        d.x = 40 * scene_uniform(&seed), d.y = 40 * scene_uniform(&seed), d.yaw = 6 * scene_uniform(&seed);
        d.vx = scene_uniform(&seed) - 0.5, d.vy = scene_uniform(&seed) - 0.5;
        bt_world_add(w, &d);
    }
    check_contacts(w, 0.0625); // they overlap at random: only the pairs matter here
    assert_true(w->cells->side_x > 2 * w->cells->max_radius && w->cells->max_radius > 3);
    // A margin beyond what the cells were made for makes larger ones.
    const double side = w->cells->side_x;
    check_contacts(w, 4);
    assert_true(w->cells->side_x > side);
    for (int n = 0; n < 20; n++) bt_world_step(w);
    check_contacts(w, 0.25);
    bt_cells_begin(w);
    check_cells(w);
    bt_world_free(w);
}

// Red: a row of cells that does not fit into its integer (found by fuzzing a checkpoint): undefined, and on x86 the
// whole field.
TEST(a_body_far_away_covers_no_cell)
{
    bt_params p = cell_params();
    bt_world *w = bt_world_create(&p);
    add_field(w, 0.5, 0.5, 5, 5, 0, 0);
    const bt_gid berg = add_hitter(w, 2, 10, 2, 0, 0, BT_DYNAMIC, true);
    bt_cells_begin(w);
    const bt_idx i = bt_world_index(w, berg);
    static const double far[] = {1e6, 3e10, 1e14, 1e300};
    for (size_t k = 0; k < sizeof far / sizeof *far; k++)
        for (int direction = 0; direction < 4; direction++) {
            const double at = direction & 1 ? far[k] : -far[k];
            w->bodies.pose[i].x = direction & 2 ? 2 : at;
            w->bodies.pose[i].y = direction & 2 ? at : 2;
            const bt_cell_range r = bt_pairs_range(w, i, 1);
            assert_true(r.x0 > r.x1 || r.y0 > r.y1);
        }
    w->bodies.pose[i].x = w->bodies.pose[i].y = 2;
    const bt_cell_range r = bt_pairs_range(w, i, 1);
    assert_true(r.x0 <= 0 && r.x1 >= 0 && r.y0 <= 0 && r.y1 >= 0);
    bt_world_free(w);
}

// Red: rows for every cell around the period, of nanometres, where there is no floe (found by fuzzing, with cells of a
// fifth: 2 GB and a minute).
TEST(no_floes_need_no_rows)
{
    bt_params p = cell_params();
    p.size = 5e-8, p.dt = 5e-7, p.slop = 5e-11;
    p.period_y = 300;
    bt_world *w = bt_world_create(&p);
    add_hitter(w, 20, 10, 100, 0.1, 0, BT_DYNAMIC, true);
    add_hitter(w, 20, 49.9, 100, 0, 0, BT_DYNAMIC, true);
    struct rusage before, after;
    getrusage(RUSAGE_SELF, &before);
    bt_world_step(w);
    getrusage(RUSAGE_SELF, &after);
    assert_true(w->cells->wrap_y > 1000000);
    assert_in_range(after.ru_maxrss - before.ru_maxrss, 0, 200000); // kB
    bt_world_free(w);
}

/// Light floes fly over many cells towards a heavy free body that stays where it is: the last cell, whose list has
/// nothing of its own that moves, looks again in time, and each hits.
TEST(floes_find_a_body_at_rest)
{
    bt_params p = cell_params();
    bt_world *w = bt_world_create(&p);
    for (int k = 0; k < 3; k++) {
        double s[8];
        scene_square(0.7, s);
        bt_body_def d = scene_prism(4, s, 40);
        d.x = 10 + 4 * k, d.y = 0.5 * k - 0.5, d.vx = -0.9 + 0.1 * k;
        bt_world_add(w, &d);
    }
    const bt_gid body = add_hitter(w, 3, 0, 0, 0, 0, BT_DYNAMIC, true);
    double deepest = 0;
    for (int i = 0; i < 300; i++) {
        bt_world_step(w);
        deepest = bt_max(deepest, bt_world_overlaps(w, 0).deepest);
    }
    assert_true(deepest < 0.01);
    assert_true(pose_of(w, body).x < 0);
    bt_world_free(w);
}

/// A floe that could meet another as fast from beyond the largest margin is reported; one just within is not.
TEST(what_outruns_all_margins_is_reported)
{
    const double dt = 0.1, sizes[] = {7.9, 8.1};
    for (int k = 0; k < 2; k++) {
        bt_params p = cell_params();
        p.dt = dt;
        bt_world *w = bt_world_create(&p);
        double s[8];
        scene_square(1, s);
        bt_body_def d = scene_prism(4, s, 40);
        d.vx = sizes[k] * p.size / dt;
        bt_world_add(w, &d);
        bt_world_step(w);
        assert_int_equal(w->stats.outrun, k);
        bt_world_free(w);
    }
}

TEST_MAIN(NULL, NULL)
