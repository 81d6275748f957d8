// SPDX-License-Identifier: MIT
// The order of passes over the tiles: what each body meets, and that tiles done at once share no body.
#include <omp.h>
#include <stdatomic.h>

#include "phases.h"
#include "scene.h"

enum { TURN = BT_MAX_TURN, SEVERAL = 12 }; // strips of a ring on which three passes work at once

/// What passes have done so far.
typedef struct {
    atomic_int *holder; ///< [n bodies] 1 + tile that works on it, 0 = none
    int *stamp;         ///< [n bodies] passes × phases: the latest that it met
    atomic_int *visits; ///< [TURN][n tiles]
    atomic_int shared, early;
} log_of_passes;

typedef struct {
    int pass;
    log_of_passes *log;
} visitor;

static bool movable(const bt_world *w, bt_idx i) { return w->bodies.inv[i].m > 0; }

static void visit(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    const visitor *v = context;
    log_of_passes *log = v->log;
    const bt_tile *tile = &w->tiles->tile[k];
    const int now = BT_PHASES * v->pass + tile->phase;
    atomic_fetch_add(&log->visits[v->pass * w->tiles->n + k], 1);
    for (bt_idx j = 0; j < tile->n_units; j++) {
        const bt_idx ends[2] = {tile->units[j].a, tile->units[j].b};
        for (int e = 0; e < 2; e++) {
            if (!movable(w, ends[e])) continue;
            const int before = atomic_exchange(&log->holder[ends[e]], k + 1);
            if (before != 0 && before != k + 1) atomic_fetch_add(&log->shared, 1);
            if (log->stamp[ends[e]] > now) atomic_fetch_add(&log->early, 1);
            log->stamp[ends[e]] = now;
        }
    }
    for (bt_idx j = 0; j < tile->n_units; j++) {
        atomic_store(&log->holder[tile->units[j].a], 0);
        atomic_store(&log->holder[tile->units[j].b], 0);
    }
    bt_sum_add(&t->sum[0], tile->n_units);
    t->most = bt_max(t->most, v->pass);
}

/// n passes in turn.
static void assert_sound(bt_world *w, int n)
{
    const size_t bodies = (size_t)w->bodies.n, tiles = (size_t)w->tiles->n;
    log_of_passes log = {.holder = bt_alloc(bodies, sizeof *log.holder), .stamp = bt_alloc(bodies, sizeof *log.stamp), .visits = bt_alloc(TURN * tiles, sizeof *log.visits)};
    visitor v[TURN];
    bt_pass pass[TURN];
    bt_totals t[TURN];
    for (int q = 0; q < n; q++) {
        v[q] = (visitor){q, &log};
        t[q] = (bt_totals){.n_sums = 1};
        pass[q] = (bt_pass){visit, &v[q], &t[q], false};
    }
    bt_phases_turn(w, pass, n, NULL);
    assert_int_equal(log.shared, 0);
    assert_int_equal(log.early, 0);
    for (int q = 0; q < n; q++) {
        CHECK_CLOSE(bt_sum_value(&t[q].sum[0]), w->tiles->n_units, 0);
        CHECK_CLOSE(t[q].most, q, 0);
        for (size_t k = 0; k < tiles; k++) assert_int_equal(log.visits[(size_t)q * tiles + k], w->tiles->tile[k].n_units > 0);
    }
    free(log.holder);
    free(log.stamp);
    free(log.visits);
}

typedef struct {
    double length, width;
    bool round_x, round_y;
    double at_x, at_y; ///< of a large movable body, as shares; negative = none
} scene;

/// 6,000 floes or more thrown into some thousand tiles, over each other: only the order is asked for.
static bt_world *fill(const scene *s, uint64_t *rng)
{
    bt_params p = scene_params(0.1, 1);
    p.tile = 2;
    p.period_x = s->round_x ? s->length : 0;
    p.period_y = s->round_y ? s->width : 0;
    bt_world *w = bt_world_create(&p);
    double v[2 * BT_MAX_VERTICES];
    for (int i = 0; i < 2.0 / 3 * s->length * s->width; i++) {
        const int nv = scene_random_polygon(rng, 0.3 + 0.2 * scene_uniform(rng), v);
        bt_body_def d = scene_prism(nv, v, 900);
        d.x = s->length * scene_uniform(rng), d.y = s->width * scene_uniform(rng);
        bt_world_add(w, &d);
    }
    if (s->at_x >= 0) {
        const int nv = bt_shape_named("disc", 9, 9, v);
        bt_body_def d = scene_prism(nv, v, 900);
        d.x = s->at_x * s->length, d.y = s->at_y * s->width, d.large = true;
        bt_world_add(w, &d);
    }
    bt_contacts_detect_all(w, 0.1);
    return w;
}

static void every_body_meets_its_tiles_in_order(void **state)
{
    (void)state;
    uint64_t rng = 11;
    // Wide, high, periodic along one axis or both: strips along either axis, in a row and on a ring.
    static const scene scenes[] = {
        {90, 90, false, false, -1, 0},  {300, 30, false, false, -1, 0}, {30, 300, false, false, -1, 0},   {90, 90, true, false, -1, 0},
        {300, 30, false, true, -1, 0},  {90, 90, true, true, -1, 0},    {30, 480, false, true, -1, 0},    {30, 480, true, true, -1, 0},
        {90, 90, false, false, 0.4, 0.6}, {300, 30, false, true, 0.2, 0.5}, {30, 480, false, true, 0.5, 0.3}, {30, 480, false, true, 0.5, 0.999},
        {30, 300, false, false, 0.5, 0},
    };
    int in_a_row = 0, on_a_ring = 0, with_large = 0;
    omp_set_num_threads(4);
    for (size_t f = 0; f < sizeof scenes / sizeof *scenes; f++) {
        bt_world *w = fill(&scenes[f], &rng);
        const bt_tiles *t = w->tiles;
        for (int n = 1; n <= TURN; n++) assert_sound(w, n);
        assert_int_equal(scenes[f].at_x >= 0, t->large_after >= 0);
        in_a_row += !t->ring && t->n_strips >= 4;
        on_a_ring += t->ring && t->n_strips >= SEVERAL;
        with_large += t->large_after >= 0 && t->n_strips >= (t->ring ? SEVERAL : 4);
        bt_world_free(w);
    }
    assert_true(in_a_row >= 6);
    assert_true(on_a_ring >= 3);
    assert_true(with_large >= 4);
}

/// Six passes on rings of 1 to 12 strips: the first ends beside where others are under way.
static void passes_meet_on_a_short_ring_in_order(void **state)
{
    (void)state;
    uint64_t rng = 5;
    bool seen[SEVERAL + 1] = {false};
    omp_set_num_threads(4);
    // Strips are thinner in the validation build, so a narrow field and a wide one.
    for (double length = 12; length <= 30; length += 18)
        for (double width = length; width < 330; width *= 1.12) {
            bt_world *w = fill(&(scene){length, width, false, true, -1, 0}, &rng);
            for (int n = 2; n <= TURN; n++) assert_sound(w, n);
            if (w->tiles->ring && w->tiles->n_strips <= SEVERAL) seen[w->tiles->n_strips] = true;
            bt_world_free(w);
        }
    int lengths = 0;
    for (int n = 1; n <= SEVERAL; n++) lengths += seen[n];
    assert_true(lengths >= 8);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(every_body_meets_its_tiles_in_order), cmocka_unit_test(passes_meet_on_a_short_ring_in_order)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
