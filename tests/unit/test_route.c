// SPDX-License-Identifier: MIT
// Routes in C: areas of polygons in cells against clipping, and plans of all kinds, whose ends and sums are held; the
// sanitizers see all of the planner here. Known answers: tests/cli/test_route_planner.py.
#include "scene.h"

#include "bergtow/route.h"
#include "route/ice.h"

/// Area of a convex polygon in the cell (i, j).
static double in_cell(int n, const double *v, int i, int j)
{
    double a[2 * BT_MAX_VERTICES], b[2 * BT_MAX_VERTICES];
    n = bt_shape_clip(n, v, 1, 0, i + 1, a);
    n = bt_shape_clip(n, a, -1, 0, -i, b);
    n = bt_shape_clip(n, b, 0, 1, j + 1, a);
    n = bt_shape_clip(n, a, 0, -1, -j, b);
    return n < 3 ? 0 : bt_shape_moments(n, b).area;
}

/// Polygons in the raster, across its sides, around it, on lines between cells; clockwise, too.
TEST(areas_in_cells_are_those_of_clipping)
{
    enum { NX = 7, NY = 5, TRIALS = 300 };
    uint64_t seed = 9;
    for (int trial = 0; trial < TRIALS; trial++) {
        double v[16], w[16], sums[NY][NX + 2] = {{0}};
        const double x = -3 + 13 * scene_uniform(&seed), y = -3 + 11 * scene_uniform(&seed);
        const double size = trial % 7 == 0 ? 20 : 0.1 + 4 * scene_uniform(&seed);
        int n = 8;
        for (int k = 0; k < n; k++) {
            v[2 * k] = x + size * (scene_uniform(&seed) - 0.5);
            v[2 * k + 1] = y + size * (scene_uniform(&seed) - 0.5);
            if (trial % 3 == 0) v[2 * k] = round(v[2 * k]), v[2 * k + 1] = round(v[2 * k + 1]);
        }
        n = bt_shape_hull(n, v);
        if (n < 3) continue;
        for (int k = 0; k < n; k++) memcpy(w + 2 * k, v + 2 * (trial % 2 ? k : n - 1 - k), 2 * sizeof *v);
        bt_route_ice_add(sums[0], NX, NY, n, w, 2);
        bt_route_ice_sum(sums[0], NX, NY);
        for (int j = 0; j < NY; j++)
            for (int i = 0; i < NX; i++) assert_true(fabs(sums[j][i] - 2 * in_cell(n, v, i, j)) < 1e-12);
    }
}

/// 40 octagons in 600 × 400 m, and an island.
typedef struct sea {
    double floe[40][8][2], h[40], island[6][2];
    int64_t first[41], land_first[2];
} sea;

static bt_route_task task_in(sea *s)
{
    uint64_t seed = 4;
    for (int k = 0; k < 40; k++) {
        const double x = 600 * scene_uniform(&seed), y = 400 * scene_uniform(&seed), r = 5 + 20 * scene_uniform(&seed);
        for (int m = 0; m < 8; m++)
            s->floe[k][m][0] = x + r * cos(0.25 * BT_PI * m), s->floe[k][m][1] = y + r * sin(0.25 * BT_PI * m);
        s->h[k] = 0.5 + scene_uniform(&seed);
        s->first[k + 1] = 8 * (k + 1);
    }
    for (int m = 0; m < 6; m++)
        s->island[m][0] = 300 + 40 * cos(BT_PI * m / 3), s->island[m][1] = 190 + 40 * sin(BT_PI * m / 3);
    s->land_first[1] = 6;
    return (bt_route_task){
        .n_floes = 40, .floe_first = s->first, .floe = s->floe[0][0], .thickness = s->h, .density = 910,
        .jam_cover = 0.84, .rafting = INFINITY, .width = 20, .reach = 12, .drag = 1e4, .start = {30, 200},
        .goal = {570, 210, 570, 210}, .extent = {0, 0, 600, 400}, .start_heading = NAN, .goal_heading = NAN,
        .speed = {1}, .n_speeds = 1, .force_limit = INFINITY, .force_factor = 1, .n_no_go = 1,
        .no_go_first = s->land_first, .no_go = s->island[0], .weight = {1, 1, 1, 1, 0}, .headings = 16, .routes = 2};
}

/// Every stretch begins where the one before it ends, on its tangent; the last ends at the goal.
static void check_route(const bt_route_task *t, const bt_route *r, bool sharp)
{
    double x = t->start[0], y = t->start[1], time = 0, length = 0, work = 0;
    for (int64_t k = 0; k < r->n_stretches; k++) {
        const bt_route_stretch *s = &r->stretch[k];
        assert_true(fabs(s->x - x) < 1e-6 && fabs(s->y - y) < 1e-6 && s->length > 0);
        const double a = s->turn * s->length, along = s->turn != 0 ? sin(a) / s->turn : s->length;
        const double aside = s->turn != 0 ? (1 - cos(a)) / s->turn : 0;
        if (k > 0 && !sharp) {
            const bt_route_stretch *b = s - 1;
            const double turned = b->turn * b->length, cx = cos(turned), sx = sin(turned);
            assert_true(fabs(b->tx * cx - b->ty * sx - s->tx) < 1e-6 && fabs(b->ty * cx + b->tx * sx - s->ty) < 1e-6);
        }
        x += along * s->tx - aside * s->ty, y += along * s->ty + aside * s->tx;
        time += s->length / s->speed, length += s->length, work += s->length * s->force;
    }
    const double *g = t->goal, gx = g[0] - t->drift[0] * time, gy = g[1] - t->drift[1] * time;
    assert_true(fabs(x - gx) < 1e-3 && (t->goal_is_line || fabs(y - gy) < 1e-3));
    CHECK_CLOSE(r->length, length, 1e-9 * length);
    CHECK_CLOSE(r->duration, time, 1e-9 * time);
    CHECK_CLOSE(r->work, work, 1e-9 * work);
    assert_true(r->length >= hypot(x - t->start[0], y - t->start[1]) - 1e-9);
}

TEST(plans_of_all_kinds_end_at_the_goal)
{
    for (int kind = 0; kind < 8; kind++) {
        static sea s;
        bt_route_task t = task_in(&s);
        if (kind == 1) t.headings = 32, t.radius = 60;
        if (kind == 2) t.drift[0] = t.water[0] = 0.1, t.drift[1] = t.water[1] = -0.05, t.radius = 30;
        if (kind == 3) t.goal_is_line = 1, t.goal[1] = 50, t.goal[3] = 350;
        if (kind == 4) t.start_heading = 0.4, t.radius = 40;
        if (kind == 5) t.start_heading = -0.5, t.goal_heading = 2.5, t.radius = 40;
        if (kind == 6) t.objective = BT_ROUTE_PEAK, t.n_speeds = 3, t.speed[1] = 0.5, t.speed[2] = 2;
        if (kind == 7) t.objective = BT_ROUTE_TIME, t.n_speeds = 2, t.speed[1] = 2, t.force_limit = 7e4;
        bt_route_plan plan, again;
        bt_route_make(&t, &plan);
        bt_route_make(&t, &again);
        assert_true(plan.status <= BT_ROUTE_FEWER && plan.n >= 2 && plan.n == again.n);
        assert_true(plan.route[0].faults & BT_ROUTE_IN_NO_GO);
        for (int k = 0; k < plan.n; k++) {
            check_route(&t, &plan.route[k], !(t.radius > 0));
            assert_true(k == 0 || (!(plan.route[k].faults & ~BT_ROUTE_OVER_LIMIT) && plan.route[k].clearance > -0.1));
            assert_true(plan.route[k].cost == again.route[k].cost);
        }
        bt_route_free(&plan);
        bt_route_free(&again);
    }
}

TEST_MAIN(NULL, NULL)
