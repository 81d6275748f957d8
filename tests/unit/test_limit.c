// SPDX-License-Identifier: MIT
// One update of a manifold with bounded impulses against the definition, over random problems; and the windows of a
// stall.
#include "scene.h"

#include "output/stall.h"
#include "solve/kernel.h"

#define TOLERANCE 1e-3 // m/s

/// A contact between two free bodies with random arms; n points.
static bt_contact random_contact(uint64_t *rng, int n)
{
    bt_contact u = {.a = 0, .b = 1, .n = n, .mu = 0};
    const double turn = 7 * scene_uniform(rng);
    u.nx = cos(turn), u.ny = sin(turn);
    for (int i = 0; i < n; i++) {
        u.ran[i] = 2 * scene_uniform(rng) - 1;
        u.rbn[i] = 2 * scene_uniform(rng) - 1;
        u.bias[i] = 0.2 * scene_uniform(rng) - 0.1;
    }
    u.rat = scene_uniform(rng), u.rbt = scene_uniform(rng);
    return u;
}

/// After the update: 0 <= λ; w >= 0 below the bound; w <= 0 above zero; λ on its bound L(w) where w < 0. A point with a
/// rising bound is exact when alone, a pair in the limit of many updates.
TEST(the_law_of_one_manifold)
{
    uint64_t rng = 3;
    int bound = 0, held = 0, open = 0, rising = 0;
    for (int k = 0; k < 20000; k++) {
        const bt_inv inv[2] = {{0.2 + scene_uniform(&rng), 3 * scene_uniform(&rng)},
                               {k % 3 ? scene_uniform(&rng) : 0, k % 3 ? 2 * scene_uniform(&rng) : 0}};
        const int n = 1 + (k & 1);
        bt_contact u = random_contact(&rng, n);
        const bt_mass m = bt_mass_of(&u, inv);
        bt_rise rise = {0};
        bt_limit l = {.flat = {INFINITY, INFINITY}, .most = {INFINITY, INFINITY}, .rise = &rise};
        for (int i = 0; i < n; i++) {
            if (scene_uniform(&rng) < 0.2) continue; // no ice
            l.flat[i] = l.most[i] = 0.5 * scene_uniform(&rng);
            l.place[i] = bt_max(u.bias[i], 0);
            if (scene_uniform(&rng) < 0.4) continue;
            rise.base[i] = l.flat[i] * bt_min(1, 1.5 * scene_uniform(&rng));
            rise.slope[i] = exp(4 * scene_uniform(&rng) - 2);
            l.most[i] += scene_uniform(&rng);
        }
        bt_vel v[2];
        for (int i = 0; i < 2; i++)
            v[i] = (bt_vel){2 * scene_uniform(&rng) - 1, 2 * scene_uniform(&rng) - 1, scene_uniform(&rng) - 0.5, 0};
        const double start[2] = {scene_uniform(&rng), n > 1 ? scene_uniform(&rng) : 0};
        for (int i = 0; i < n; i++) u.ln[i] = start[i];
        const bool flat = rise.slope[0] == 0 && rise.slope[1] == 0;
        for (int turn = 0; turn < (n == 1 || flat ? 1 : 300); turn++) bt_update_contact(&u, &m, &l, v, inv);
        double sum = 0;
        // turns converge by w12²/(w1 w2) each
        const bool tame = m.w[0] * m.w[1] - m.w12 * m.w12 > 0.05 * m.w[0] * m.w[1];
        if (n > 1 && !flat && !tame) continue;
        assert_true(bt_contact_residual(&u, &m, &l, v, TOLERANCE, &sum) < 1e-9);
        for (int i = 0; i < n; i++) {
            const double w = bt_normal_velocity(&u, i, &v[0], &v[1]) + u.bias[i],
                         approach = bt_max(0, -(w - u.bias[i] + l.place[i]));
            const double limit = bt_min(l.most[i], bt_max(l.flat[i], rise.base[i] + rise.slope[i] * approach)),
                         tol = 1e-7;
            assert_true(u.ln[i] >= 0 && u.ln[i] <= limit + tol);
            if (u.ln[i] > tol) assert_true(w <= tol);
            if (u.ln[i] < limit - tol) assert_true(w >= -tol);
            assert_true(bt_limit_bound(&l, &u, i, v) == limit || fabs(bt_limit_bound(&l, &u, i, v) - limit) < 1e-12);
            open += u.ln[i] == 0, held += u.ln[i] > 0 && w > -tol, bound += w < -1e-3,
                rising += w < -1e-3 && u.ln[i] > l.flat[i] + tol && u.ln[i] < l.most[i] - tol;
        }
    }
    assert_true(open > 1000 && held > 1000 && bound > 1000 && rising > 1000);
}

/// How far the loads of sheets reach along (x, y): max λ · (x, y).
static double reach(const bt_limit *l, double x, double y)
{
    return l->flat[0] * hypot(x, y) + fabs(l->ends[0] * x + l->ends[1] * y);
}

/// Sheets: at the end of many updates the load is one that they can bear, no farther in any direction than friction
/// and ends reach there, and takes all the power that these allow; or nothing slides.
TEST(the_law_of_sheets)
{
    uint64_t rng = 5;
    int slides = 0, sticks = 0;
    for (int k = 0; k < 5000; k++) {
        const bt_inv inv[2] = {{0.2 + scene_uniform(&rng), 3 * scene_uniform(&rng)},
                               {k % 3 ? scene_uniform(&rng) : 0, k % 3 ? 2 * scene_uniform(&rng) : 0}};
        bt_contact u = {.a = 0,
                        .b = 1,
                        .nx = 1,
                        .ran = {scene_uniform(&rng) - 0.5},
                        .rbn = {scene_uniform(&rng) - 0.5},
                        .rat = scene_uniform(&rng) - 0.5,
                        .rbt = scene_uniform(&rng) - 0.5};
        const bt_mass m = bt_mass_of(&u, inv);
        bt_limit l = {.flat = {k % 5 ? scene_uniform(&rng) : 0}};
        for (int c = 0; c < 2; c++) l.ends[c] = k % 2 ? 2 * scene_uniform(&rng) - 1 : 0;
        bt_vel v[2];
        for (int i = 0; i < 2; i++)
            v[i] = (bt_vel){2 * scene_uniform(&rng) - 1, 2 * scene_uniform(&rng) - 1, scene_uniform(&rng) - 0.5, 0};
        for (int turn = 0; turn < 400; turn++) bt_update_contact(&u, &m, &l, v, inv);
        double sum = 0;
        assert_true(bt_contact_residual(&u, &m, &l, v, TOLERANCE, &sum) < 1e-9);
        const double x = bt_normal_velocity(&u, 0, &v[0], &v[1]), y = bt_tangent_velocity(&u, &v[0], &v[1]);
        for (int way = 0; way < 720; way++) {
            const double c = cos(way * M_PI / 360), s = sin(way * M_PI / 360);
            assert_true(u.ln[0] * c + u.lt * s <= reach(&l, c, s) + 1e-12);
        }
        const double power = reach(&l, -x, -y);
        if (hypot(x, y) < 1e-7) {
            sticks++;
            continue;
        }
        slides++;
        CHECK_CLOSE(-(u.ln[0] * x + u.lt * y), power, 1e-6 * (power + hypot(x, y)));
    }
    assert_true(slides > 500 && sticks > 500);
}

/// Without a bound it is the rigid update, bit for bit but for the order of operations.
TEST(no_bound_is_rigid)
{
    uint64_t rng = 8;
    for (int k = 0; k < 2000; k++) {
        const bt_inv inv[2] = {{1, 3}, {0.5, 0.7}};
        bt_contact u = random_contact(&rng, 1 + (k & 1)), r;
        const bt_mass m = bt_mass_of(&u, inv);
        u.mu = 0.3;
        bt_vel v[2] = {{1, scene_uniform(&rng), 0, 0}, {scene_uniform(&rng), -1, 0.2, 0}}, x[2] = {v[0], v[1]};
        r = u;
        const bt_limit l = {.flat = {INFINITY, INFINITY}, .most = {INFINITY, INFINITY}};
        CHECK_CLOSE(bt_update_contact(&u, &m, &l, v, inv), bt_update_contact(&r, &m, NULL, x, inv), 1e-11);
        for (int i = 0; i < 2; i++) CHECK_CLOSE(u.ln[i], r.ln[i], 1e-11);
        CHECK_CLOSE(u.lt, r.lt, 1e-11);
        CHECK_CLOSE(v[1].x, x[1].x, 1e-11);
    }
}

/// Windows of 1 m of asked path at 0.5 m/s: stands for 10 s, goes for 10 s, holds (asks for nothing), creeps at 4 % and
/// at 6 %.
TEST(stall_windows)
{
    bt_stall s = {0};
    double x = 3;
    const struct {
        double asked, moves, ice, time; // of a pull of 8 N
        int64_t windows;
    } parts[] = {{0.5, 0, 5, 10, 5},     {0.5, 0.4, 5, 10, 5},   {0, 0, 5, 100, 5}, {0.5, 0.02, 5, 10, 10},
                 {0.5, 0.03, 5, 10, 10}, {0.5, 0, 3.9, 10, 10}, {0.5, 0, 4.1, 10, 15}};
    bt_stall_add(&s, 0.05, 0.1, (const double[]){x, 0}, 5, 8, 1);
    for (int p = 0; p < (int)(sizeof parts / sizeof *parts); p++) {
        for (int k = 0; k < (int)(parts[p].time / 0.1 + 0.5); k++) {
            x += 0.1 * parts[p].moves;
            bt_stall_add(&s, 0.1 * parts[p].asked, 0.1, (const double[]){x, 0}, parts[p].ice, 8, 1 - 1e-9);
        }
        assert_int_equal(s.windows, parts[p].windows);
        CHECK_CLOSE(s.time, 2 * (double)parts[p].windows, 1e-6);
    }
}

/// The towing end passes through the hull twice, steps of half a second: how long in all, and from when on. Where it
/// begins within, the first way out comes first; of a body adrift nothing counts.
TEST(the_end_within_the_hull)
{
    static const double ahead[] = {0.2, 3, 0.9, 0, -0.9, -3, -0.9, 3};
    enum { STEPS = sizeof ahead / sizeof *ahead };
    for (int adrift = 0; adrift < 2; adrift++) {
        bt_params p = scene_params(0.5, 1);
        bt_world *w = bt_world_create(&p);
        double v[8];
        scene_square(2, v);
        bt_body_def d = scene_prism(4, v, 100);
        w->towed = bt_world_add(w, &d);
        bt_tow tow = {.mode = BT_TOW_LINE, .n_branches = 1, .branch[0].broken = adrift > 0, .travel_x = 7};
        bt_stall s = {0};
        w->tow = &tow;
        for (int k = 0; k < STEPS; k++) {
            tow.time = 10 + 0.5 * k, tow.carriage_x = tow.travel_x + ahead[k];
            bt_stall_step(&s, w, 0, 0, 1);
        }
        w->tow = NULL;
        CHECK_CLOSE(s.inside, adrift ? 0 : 4 * 0.5, 0);
        if (!adrift) CHECK_CLOSE(s.inside_from, 11, 0);
        bt_world_free(w);
    }
}

/// A bound whose impulse moves the bodies by less than the tolerance: what the impulse is short of it still counts by
/// the speed that it leaves, until 1 % is left. Rows that close by less than the tolerance are as they should be.
TEST(a_bound_below_the_tolerance_is_not_left_out)
{
    const bt_inv inv[2] = {{1, 2}, {0, 0}};
    const double most = 1e-6;
    const bt_limit l = {.flat = {most, most}, .most = {most, most}, .place = {0, 0}};
    for (int sheets = 0; sheets < 2; sheets++)
        for (int k = 0; k < 4; k++) {
            const double speed = k == 3 ? 0.5 * TOLERANCE : 0.3, part = k == 0 || k == 3 ? 0 : k == 1 ? 0.9 : 0.995;
            const bt_contact u = {.a = 0, .b = 1, .nx = 1, .n = sheets ? 0 : 1, .ln = {part * most}};
            const bt_mass m = bt_mass_of(&u, inv);
            const bt_vel v[2] = {{speed, 0, 0, 0}, {0, 0, 0, 0}};
            double sum = 0;
            const double r = bt_contact_residual(&u, &m, &l, v, TOLERANCE, &sum);
            assert_true((r > TOLERANCE) == (k < 2));
            assert_true(r <= 0.3 && sum >= r * r * (1 - 1e-12));
        }
}

/// Neither a contact nor sheets: the largest of numbers passes over one that is none.
TEST(a_velocity_that_is_no_number_is_not_solved)
{
    uint64_t rng = 5;
    const bt_inv inv[2] = {{1, 2}, {0.5, 1}};
    const bt_limit l = {.flat = {1, INFINITY}, .most = {1, INFINITY}};
    for (int k = 0; k < 6; k++) {
        bt_contact u = random_contact(&rng, 1);
        const bt_mass m = bt_mass_of(&u, inv);
        bt_vel v[2] = {{0.1, 0.2, 0.3, 0}, {0.3, 0.2, 0.1, 0}};
        double *hit[3] = {&v[k / 3].x, &v[k / 3].y, &v[k / 3].w}, sum = 0;
        assert_true(isfinite(bt_contact_residual(&u, &m, NULL, v, TOLERANCE, &sum)));
        *hit[k % 3] = NAN;
        assert_true(isinf(bt_contact_residual(&u, &m, NULL, v, TOLERANCE, &sum)));
        u.n = 0;
        assert_true(isinf(bt_contact_residual(&u, &m, &l, v, TOLERANCE, &sum)));
    }
}

TEST_MAIN(NULL, NULL)
