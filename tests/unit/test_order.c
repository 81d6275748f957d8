// SPDX-License-Identifier: MIT
// The order of passes over the tiles: what each body meets, and that tiles done at once share no body.
#include <omp.h>
#include <stdatomic.h>
#include <stdlib.h>

#include "order.h"
#include "phases.h"
#include "scene.h"

enum { TURN = BT_MAX_TURN };

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
    int held_up; ///< this thread takes long over each tile; −1 = none, −2 = any over some tiles
} visitor;

static void take_long(double seconds)
{
    const double began = bt_clock();
    while (bt_clock() < began + seconds) {}
}

static bool movable(const bt_world *w, bt_idx i) { return w->bodies.inv[i].m > 0; }

static void visit(bt_world *w, bt_idx k, const void *context, bt_totals *t)
{
    const visitor *v = context;
    log_of_passes *log = v->log;
    const bt_tile *tile = &w->tiles->tile[k];
    const int now = BT_PHASES * v->pass + tile->phase;
    atomic_fetch_add(&log->visits[v->pass * w->tiles->n + k], 1);
    if (v->held_up == omp_get_thread_num()) take_long(20e-6);
    if (v->held_up == -2 && (k * 7 + v->pass * 13) % 101 == 0) take_long(200e-6);
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

/// n passes in turn; one thread may be held up (visitor).
static void assert_sound_with(bt_world *w, int n, int held_up)
{
    const size_t bodies = (size_t)w->bodies.n, tiles = (size_t)w->tiles->n;
    log_of_passes log = {.holder = bt_alloc(bodies, sizeof *log.holder), .stamp = bt_alloc(bodies, sizeof *log.stamp), .visits = bt_alloc(TURN * tiles, sizeof *log.visits)};
    visitor v[TURN];
    bt_pass pass[TURN];
    bt_totals t[TURN];
    for (int q = 0; q < n; q++) {
        v[q] = (visitor){q, &log, held_up};
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

static void assert_sound(bt_world *w, int n) { assert_sound_with(w, n, -1); }

static bool tied(const bt_world *w, bt_idx k, bt_idx l)
{
    const bt_bands *b = &w->tiles->bands;
    const bt_idx from = w->tiles->tile[k].knot, to = w->tiles->tile[l].knot;
    if (from < 0 || to < 0) return false;
    for (bt_idx i = b->knot[from].begin; i < b->knot[from].end; i++)
        if (b->other[i] == to) return true;
    return false;
}

/// Band that is expected to do each tile, n bands for those that either of two may do.
static bt_idx *bands_of_tiles(const bt_world *w)
{
    const bt_tiles *t = w->tiles;
    const bt_bands *b = &t->bands;
    bt_idx *band = bt_alloc((size_t)t->n, sizeof *band);
    for (bt_idx k = 0; k < b->n; k++)
        for (bt_idx i = b->first[k]; i < b->first[k + 1]; i++) band[b->member[i]] = k;
    for (bt_idx s = 0; s < (b->n + 1) / 2; s++)
        for (bt_idx i = b->start[b->segment[s].free_begin * BT_PHASES]; i < b->start[b->segment[s].free_end * BT_PHASES]; i++) band[t->order[i]] = b->n;
    return band;
}

/// Two tiles that share a body, and that two threads may do, wait for each other: a race that is seldom lost is found here.
static void assert_tied(const bt_world *w)
{
    enum { MOST = 5 }; // the tiles of a floe's corner, and that of the large bodies
    const bt_tiles *t = w->tiles;
    bt_idx *band = bands_of_tiles(w), *meets = bt_alloc((size_t)w->bodies.n * MOST, sizeof *meets);
    int *n_meets = bt_alloc((size_t)w->bodies.n, sizeof *n_meets);
    for (bt_idx k = 0; k < t->n; k++)
        for (bt_idx j = 0; j < t->tile[k].n_units; j++) {
            const bt_idx ends[2] = {t->tile[k].units[j].a, t->tile[k].units[j].b};
            for (int e = 0; e < 2; e++) {
                const bt_idx i = ends[e];
                if (!movable(w, i) || w->bodies.large[i]) continue;
                if (n_meets[i] > 0 && meets[i * MOST + n_meets[i] - 1] == k) continue;
                for (int m = 0; m < n_meets[i]; m++) {
                    const bt_idx l = meets[i * MOST + m];
                    assert_true((band[k] == band[l] && band[k] < t->bands.n) || (tied(w, k, l) && tied(w, l, k)));
                }
                assert_in_range(n_meets[i], 0, MOST - 1);
                meets[i * MOST + n_meets[i]++] = k;
            }
        }
    free(band);
    free(meets);
    free(n_meets);
}

static int n_free(const bt_world *w)
{
    const bt_bands *b = &w->tiles->bands;
    int n = 0;
    for (bt_idx s = 0; s < (b->n + 1) / 2; s++) n += b->segment[s].free_end - b->segment[s].free_begin;
    return n;
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
    // Wide, high, periodic along one axis or both: rows along either axis, in a row and on a ring.
    static const scene scenes[] = {
        {90, 90, false, false, -1, 0},  {300, 30, false, false, -1, 0}, {30, 300, false, false, -1, 0},   {90, 90, true, false, -1, 0},
        {300, 30, false, true, -1, 0},  {90, 90, true, true, -1, 0},    {30, 480, false, true, -1, 0},    {480, 30, true, true, -1, 0},
        {90, 90, false, false, 0.4, 0.6}, {300, 30, false, true, 0.2, 0.5}, {30, 480, false, true, 0.5, 0.3}, {30, 480, false, true, 0.5, 0.999},
        {30, 300, false, false, 0.5, 0}, {480, 30, true, false, 0.001, 0.5},
        // A row of tiles is 1/240: a large body on even and odd rows, where levels rise and fall, beside a border of bands.
        {30, 480, false, true, 0.5, 0.1}, {30, 480, false, true, 0.5, 0.1 + 1.0 / 240}, {30, 480, false, true, 0.5, 0.5}, {30, 480, false, true, 0.5, 0.5 + 1.0 / 240},
        {12, 1200, false, false, -1, 0}, {12, 1200, false, true, -1, 0}, {12, 1200, false, false, 0.5, 0.5}, {12, 1200, false, true, 0.5, 0.26}, {1200, 12, false, false, 0.75, 0.5},
        {30, 480, false, true, 0.5, 0.8}, {30, 480, false, true, 0.5, 0.8 + 1.0 / 240}, {480, 30, false, false, 0.3, 0.5}, {480, 30, false, false, 0.3 + 1.0 / 240, 0.5},
    };
    int with_levels = 0, knotted_large = 0, meeting = 0, fixed = 0;
    for (size_t f = 0; f < sizeof scenes / sizeof *scenes; f++)
        for (int threads = 1; threads <= 4; threads++) {
            omp_set_num_threads(threads);
            bt_world *w = fill(&scenes[f], &rng);
            const bt_tiles *t = w->tiles;
            const bt_tile *large = &t->tile[t->n - 1];
            for (int n = 1; n <= TURN; n++) assert_sound_with(w, n, n % 2 == 0 ? -2 : n == TURN - 1 ? (int)f % threads : -1);
            assert_tied(w);
            const bool ring = t->n_y >= t->n_x ? t->n_y == t->wrap_y : t->n_x == t->wrap_x;
            assert_int_equal(t->bands.n_threads, threads);
            assert_int_equal(t->bands.n, threads + (ring && threads % 2 == 1));
            assert_int_equal(scenes[f].at_x >= 0, large->n_units > 0);
            assert_true(t->bands.n == 1 || t->bands.n_knots > 0);
            with_levels += t->bands.n_groups >= 4;
            meeting += n_free(w) > 0;
            fixed += t->bands.n > 1 && n_free(w) == 0;
            knotted_large += large->n_units > 0 && large->knot >= 0;
            bt_world_free(w);
        }
    assert_true(with_levels >= 12);
    assert_true(knotted_large >= 3);
    assert_true(meeting >= 6);
    assert_true(fixed >= 10);
}

/// Rings of 2 to 50 rows of tiles, with bands as thin as two rows.
static void passes_meet_on_a_short_ring_in_order(void **state)
{
    (void)state;
    uint64_t rng = 5;
    int n_thin = 0, n_rings = 0, most = 0;
    for (double length = 12; length <= 30; length += 18)
        for (double width = 6; width < 130; width *= 1.12)
            for (int threads = 1; threads <= 4; threads++) {
                omp_set_num_threads(threads);
                bt_world *w = fill(&(scene){length, width, false, true, -1, 0}, &rng);
                for (int n = 1; n <= TURN; n++) assert_sound_with(w, n, n == TURN - 1 ? -2 : -1);
                assert_tied(w);
                const bt_tiles *t = w->tiles;
                n_thin += t->bands.n_threads > 1 && t->wrap_y < 4 * t->bands.n;
                n_rings += t->n_y == t->wrap_y && t->n_y >= t->n_x;
                most = t->wrap_y > most ? t->wrap_y : most;
                bt_world_free(w);
            }
#ifdef BT_VALIDATE // else so few tiles are one thread's
    assert_true(n_thin >= 40);
#endif
    assert_true(n_rings >= 40);
    assert_true(most >= 30);
}

/// A team smaller than the number of bands: a thread has several of them.
static void a_small_team_has_several_bands_each(void **state)
{
    (void)state;
    uint64_t rng = 8;
    omp_set_num_threads(4);
    bt_world *w = fill(&(scene){30, 480, false, true, 0.5, 0.3}, &rng);
    assert_int_equal(w->tiles->bands.n, 4);
    omp_set_max_active_levels(1);
#pragma omp parallel num_threads(2)
#pragma omp single
    {
        assert_int_equal(omp_get_num_threads(), 2); // within it every team is of one thread
        for (int n = 1; n <= TURN; n++) assert_sound(w, n);
    }
    bt_world_free(w);
}

/// The groups about the middle are done by the thread that comes first, all of them if the other is very late, and some are left to it.
static void bands_meet_where_their_threads_do(void **state)
{
    (void)state;
    uint64_t rng = 6;
    omp_set_num_threads(2);
    bt_world *w = fill(&(scene){12, 2400, false, false, -1, 0}, &rng);
    const bt_bands *b = &w->tiles->bands;
    assert_int_equal(b->n, 2);
    assert_true(n_free(w) >= 8);
    for (int late = 0; late < 2; late++) {
        b->worked[0] = b->worked[1] = 0;
        assert_sound_with(w, TURN, late);
        assert_true(b->worked[!late] > 1.2 * b->worked[late]);
        CHECK_CLOSE(b->worked[0] + b->worked[1], TURN * w->tiles->n_units, 0);
    }
    bt_world_free(w);
}

/// Units of the tiles that each band is expected to do, as a share of all.
static double dealt_to(const bt_world *w, bt_idx band)
{
    const bt_bands *b = &w->tiles->bands;
    double n = 0;
    for (bt_idx i = b->first[band]; i < b->first[band + 1]; i++) n += w->tiles->tile[b->member[i]].n_units;
    return n / w->tiles->n_units;
}

/// A band that took three times as long has less to do in the next step, none ends with nothing, and the order is sound.
static void slow_bands_get_less(void **state)
{
    (void)state;
    uint64_t rng = 3;
    omp_set_num_threads(4);
    bt_world *w = fill(&(scene){30, 480, false, false, -1, 0}, &rng);
    bt_bands *b = &w->tiles->bands;
    assert_int_equal(b->n, 4);
    for (int k = 0; k < 4; k++) assert_true(fabs(dealt_to(w, k) - 0.25) < 0.03);
    assert_sound(w, 2);
    for (int k = 0; k < 4; k++) assert_true(b->busy[k] > 0 && b->worked[k] > 0);
    for (int step = 0; step < 20; step++) { // pace 1, 1/3, 1, 1
        for (int k = 0; k < 4; k++) b->worked[k] = 1, b->busy[k] = k == 1 ? 3 : 1;
        bt_order_tiles(w);
    }
    for (int k = 0; k < 4; k++) assert_true(fabs(dealt_to(w, k) - (k == 1 ? 0.125 : 0.875 / 3)) < 0.04); // an eighth is the least
    for (int n = 1; n <= TURN; n++) assert_sound(w, n);
    assert_tied(w);
    bt_world_free(w);
}

/// Three threads on a ring of four bands: the two of one thread are half as large each, and of different pairs, so that each thread meets another.
static void threads_of_two_bands_have_no_more(void **state)
{
    (void)state;
    uint64_t rng = 9;
    omp_set_num_threads(3);
    bt_world *w = fill(&(scene){30, 480, false, true, -1, 0}, &rng);
    const bt_bands *b = &w->tiles->bands;
    assert_int_equal(b->n, 4);
    for (int step = 0; step < 10; step++) {
        for (int k = 0; k < 4; k++) b->worked[k] = b->busy[k] = 1;
        bt_order_tiles(w);
    }
    for (bt_idx t = 0; t < 3; t++) {
        double all = 0;
        for (bt_idx k = bt_bands_of(b, t, 3); k < bt_bands_of(b, t + 1, 3); k++) all += dealt_to(w, k);
        assert_true(fabs(all - 1.0 / 3) < 0.05);
        for (bt_idx k = bt_bands_of(b, t, 3) + 1; k < bt_bands_of(b, t + 1, 3); k++) assert_true(k % 2 == 0); // 2 s and 2 s + 1 are a pair
    }
    for (int n = 1; n <= TURN; n++) assert_sound(w, n);
    bt_world_free(w);
}

/// Two heaps with nothing between them, after a step in which there was something: nobody waits, in a field too short for bands that meet anywhere.
static void heaps_far_apart_are_not_tied(void **state)
{
    (void)state;
    uint64_t rng = 4;
    omp_set_num_threads(2);
    bt_world *w = fill(&(scene){60, 90, false, false, -1, 0}, &rng);
    bt_tiles *t = w->tiles;
    assert_int_equal(t->bands.n, 2);
    assert_true(t->bands.n_knots > 0);
    double units[2] = {0};
    for (bt_idx k = 0; k < t->n; k++) {
        const int32_t above = t->tile[k].y - t->low_y - t->n_y / 2;
        if (abs(above) < t->n_y / 8) t->tile[k].n_units = 0;
        units[above > 0] += t->tile[k].n_units;
    }
    for (int b = 0; b < 2; b++) t->bands.share[b] = units[b] / (units[0] + units[1]); // a heap each
    t->bands.busy[0] = 0;
    bt_order_tiles(w);
    assert_int_equal(t->bands.n, 2);
    assert_int_equal(n_free(w), 0);
    assert_int_equal(t->bands.n_knots, 0);
    for (int n = 1; n <= TURN; n++) assert_sound(w, n);
    bt_world_free(w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(every_body_meets_its_tiles_in_order), cmocka_unit_test(passes_meet_on_a_short_ring_in_order),
                                       cmocka_unit_test(a_small_team_has_several_bands_each), cmocka_unit_test(bands_meet_where_their_threads_do), cmocka_unit_test(slow_bands_get_less),
                                       cmocka_unit_test(threads_of_two_bands_have_no_more),
                                       cmocka_unit_test(heaps_far_apart_are_not_tied)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
