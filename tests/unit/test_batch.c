// SPDX-License-Identifier: MIT
// Sweeps in batches, and residual passes four at a time, against the scalar update, contact by contact in the same
// order: equal bit for bit; and what may stand together in a batch.
#include "scene.h"

#include "solve/batch_layout.h"
#include "solve/kernel.h"

enum { BODIES = 60, CONTACTS = 230 };

/// A cell whose contacts join random bodies, some of infinite mass; most contacts are listed.
typedef struct {
    bt_cell cell; // with these:
    bt_law_state laws;
    bt_work_list work;
    bt_contact contacts[CONTACTS];
    bt_gaps gaps[CONTACTS];
    bt_limit limits[CONTACTS];
    bt_in_place in_place[CONTACTS]; // of the scalar update
    bt_idx list[CONTACTS];
    bt_vel v[BODIES];
    bt_inv inv[BODIES];
} knot_of_floes;

static double any(uint64_t *rng) { return 2 * scene_uniform(rng) - 1; }

/// Of those with two points some have them in one place, or all but: then their two rows are one, but for rounding.
static bt_contact random_contact(uint64_t *rng, const bt_inv *inv)
{
    bt_contact u = {.n = 1 + (scene_uniform(rng) < 0.6), .mu = 0.5 * scene_uniform(rng)};
    u.a = (bt_idx)(BODIES * scene_uniform(rng));
    do u.b = (bt_idx)(BODIES * scene_uniform(rng));
    while (u.b == u.a || inv[u.a].m + inv[u.b].m == 0);
    const double turn = 7 * scene_uniform(rng);
    u.nx = cos(turn), u.ny = sin(turn);
    u.rat = any(rng), u.rbt = any(rng);
    for (int i = 0; i < 2; i++) { // levers of a point that is not there have no effect
        u.ran[i] = any(rng), u.rbn[i] = any(rng);
        if (i >= u.n) continue;
        u.bias[i] = any(rng);
        u.ln[i] = bt_max(0, any(rng));
    }
    u.lt = any(rng) * u.mu * (u.ln[0] + u.ln[1]);
    if (scene_uniform(rng) < 0.2) {
        const double apart = scene_uniform(rng) < 0.3 ? 0 : 1e-15;
        u.ran[1] = u.ran[0] + apart, u.rbn[1] = u.rbn[0] + apart;
        if (u.n > 1) u.bias[1] = u.bias[0]; // then both may press
    }
    return u;
}

/// Sheets between the bodies of a contact: two components, one step length.
static void make_sheets(bt_contact *u, uint64_t *rng)
{
    *u = (bt_contact){.a = u->a,
                      .b = u->b,
                      .nx = 1,
                      .ran = {any(rng)},
                      .rbn = {any(rng)},
                      .rat = any(rng),
                      .rbt = any(rng),
                      .ln = {any(rng)},
                      .lt = any(rng)};
}

/// Flat bounds for all contacts; a third of them become sheets.
static void bind(knot_of_floes *s, uint64_t *rng)
{
    s->cell.laws->limits = s->limits;
    for (bt_idx i = 0; i < CONTACTS; i++) {
        bt_limit *l = &s->limits[i];
        *l = (bt_limit){.flat = {INFINITY, INFINITY}, .most = {INFINITY, INFINITY}};
        if (scene_uniform(rng) < 0.35) {
            make_sheets(&s->contacts[i], rng);
            l->flat[0] = scene_uniform(rng) < 0.1 ? 0 : scene_uniform(rng);
            if (scene_uniform(rng) < 0.7)
                for (int c = 0; c < 2; c++) l->ends[c] = 0.6 * any(rng);
        } else if (scene_uniform(rng) < 0.8) {
            for (int c = 0; c < s->contacts[i].n; c++) l->flat[c] = l->most[c] = 0.6 * scene_uniform(rng);
        }
    }
}

static void fill(knot_of_floes *s, uint64_t *rng, double listed)
{
    memset(s, 0, sizeof *s);
    for (int i = 0; i < BODIES; i++) {
        if (i % 7) s->inv[i] = (bt_inv){0.1 + scene_uniform(rng), 0.1 + scene_uniform(rng)};
        s->v[i] = (bt_vel){any(rng), any(rng), any(rng), 0};
    }
    s->laws = (bt_law_state){0};
    s->work = (bt_work_list){.list = s->list, .cap_list = CONTACTS};
    s->cell = (bt_cell){.contacts = s->contacts, .gaps = s->gaps, .n_contacts = CONTACTS, .laws = &s->laws,
                        .work = &s->work};
    for (bt_idx i = 0; i < CONTACTS; i++) {
        s->contacts[i] = random_contact(rng, s->inv);
        if (scene_uniform(rng) < listed) s->list[s->cell.n_listed++] = i;
    }
}

/// What the scalar update has beside the contacts; their impulses are those before the last sweep.
static void set_out(knot_of_floes *s)
{
    for (bt_idx i = 0; i < CONTACTS; i++) {
        const bt_contact *u = &s->contacts[i];
        s->in_place[i] = (bt_in_place){.mass = bt_mass_of(u, s->inv), .before = {u->ln[0], u->ln[1], u->lt}};
    }
}

/// The contacts of the cell into memory of its own: batches take their place there.
static void own_contacts(knot_of_floes *s)
{
    s->cell.contacts = NULL;
    s->cell.contact_bytes = 0;
    bt_cells_make_room(&s->cell, sizeof s->contacts);
    memcpy(s->cell.contacts, s->contacts, sizeof s->contacts);
}

/// All contacts into the list.
static void list_all(bt_cell *cell)
{
    for (bt_idx i = 0; i < CONTACTS; i++) cell->work->list[i] = i;
    cell->n_listed = CONTACTS;
}

/// The same visit with the scalar update; returns what it turned against its move.
static double scalar_visit(knot_of_floes *s, const bt_idx *order, const bt_sweep *o, int times, double *most)
{
    static double y[CONTACTS][3];
    for (bt_idx j = 0; o->moves && j < s->cell.n_listed; j++) {
        bt_contact *u = &s->contacts[order[j]];
        bt_rounds_move(o, u->ln, s->in_place[order[j]].before, y[j], 2);
        bt_rounds_move(o, &u->lt, s->in_place[order[j]].before + 2, y[j] + 2, 1);
    }
    for (int n = 0; n < times; n++) {
        double largest = 0;
        for (bt_idx j = 0; j < s->cell.n_listed; j++) {
            const bt_limit *l = s->cell.laws->limits ? &s->limits[order[j]] : NULL;
            const bt_mass *m = &s->in_place[order[j]].mass;
            largest = bt_max(largest, bt_update_contact(&s->contacts[order[j]], m, l, s->v, s->inv));
        }
        if (n == 0) *most = largest;
    }
    double against = 0;
    for (bt_idx j = 0; o->moves && j < s->cell.n_listed; j++) {
        const bt_contact *u = &s->contacts[order[j]];
        const bt_mass *m = &s->in_place[order[j]].mass;
        const double *x = s->in_place[order[j]].before;
        against += bt_rounds_against(m->w[0], u->ln[0], x[0], y[j][0]) +
                   bt_rounds_against(m->w[1], u->ln[1], x[1], y[j][1]) + bt_rounds_against(m->wt, u->lt, x[2], y[j][2]);
    }
    return against;
}

/// The contacts of the list in the order in which they are swept, [n_list]; of a cell that has been swept.
static void swept_order(const bt_cell *cell, bt_idx *contact)
{
    for (bt_idx k = 0; k < cell->work->n_batches; k++)
        for (int l = 0; l < cell->work->batch[k].n; l++) *contact++ = cell->work->batch[k].contact[l];
}

/// The residual pass four at a time against one by one, bit for bit; the sum of squares of a packed cell but for
/// rounding.
static void check_residual(knot_of_floes *four, knot_of_floes *one)
{
    const bt_problem p = {.tolerance = 1e-3};
    bt_idx list[CONTACTS], n = 0;
    const bt_idx n_list = four->cell.n_listed;
    memcpy(list, four->list, sizeof list);
    const bool packed = four->cell.work->packed;
    const bt_found f = bt_batch_residual(&four->cell, four->v, four->inv, &p);
    bt_found e = {0};
    for (bt_idx i = 0; i < CONTACTS; i++) {
        const bt_contact *u = &one->contacts[i];
        const bt_limit *k = one->cell.laws->limits ? &one->limits[i] : NULL;
        const bt_mass *m = &one->in_place[i].mass;
        const double r = bt_contact_residual(u, m, k, one->v, p.tolerance, &e.squares), *x = one->in_place[i].before;
        e.most = bt_max(e.most, r);
        e.rows += u->n > 0 ? u->n + 1 : 2;
        e.bad += r > BT_NEAR * p.tolerance;
        bool on = u->ln[0] + u->ln[1] > 0 || u->lt != 0 || x[0] != u->ln[0] || x[1] != u->ln[1] || x[2] != u->lt;
        if (u->n == 0) on = on || r > 0;
        for (int c = 0; c < u->n; c++)
            on = on || !(bt_normal_velocity(u, c, &one->v[u->a], &one->v[u->b]) + u->bias[c] >= 0);
        if (on) assert_true(n < four->cell.n_listed && four->list[n] == i), n++;
    }
    assert_int_equal(n, four->cell.n_listed);
    assert_true(f.most == e.most && f.rows == e.rows && f.bad == e.bad);
    CHECK_CLOSE(f.squares, e.squares, packed ? 1e-13 * e.squares : 0);
    const bool same = n == n_list && memcmp(list, four->list, (size_t)n * sizeof *list) == 0;
    assert_true(four->cell.work->packed == (packed && same)); // batches of the same contacts stay
    memcpy(four->list, list, sizeof list);
    four->cell.n_listed = n_list;
}

/// Totals of a sweep that adds up what it turned against its moves in units of 1 J.
static bt_totals no_totals(void) { return (bt_totals){.n_sums = BT_SWEEP_N}; }

static const bt_problem never_calm = {.tolerance = -1, .per_energy = 1},
                        always_calm = {.tolerance = INFINITY, .per_energy = 1};

TEST(batches_do_what_single_updates_do)
{
    static knot_of_floes four, one;
    bt_idx order[CONTACTS];
    uint64_t rng = 5;
    for (int k = 0; k < 300; k++) {
        fill(&four, &rng, k % 3 ? 0.8 : 0.03);
        if (k % 5 > 1) bind(&four, &rng);
        set_out(&four);
        one = four;
        own_contacts(&four);
        const int times = 1 + k % 3;
        // A list, and then another, in which contacts that were in the first move on.
        for (int round = 0; round < 2; round++) {
            if (round > 0) list_all(&four.cell), one.cell.n_listed = CONTACTS;
            const double beta = k % 4 == 1 ? 0.7 : 0;
            const bt_sweep o = {.problem = &never_calm, .moves = k % 2, .beta = beta, .lead = {beta}};
            bt_totals totals = no_totals();
            double most_of_one = 0;
            bt_batch_sweep(&four.cell, four.v, four.inv, &o, times, &totals);
            assert_true(four.cell.work->packed);
            CHECK_CLOSE(bt_sum_value(&totals.sum[BT_SWEEP_UPDATES]), times * four.cell.n_listed, 0);
            CHECK_CLOSE(bt_sum_value(&totals.sum[BT_SWEEP_MOVED]), o.moves && beta > 0 ? four.cell.n_listed : 0, 0);
            swept_order(&four.cell, order);
            const double most = totals.most, against = bt_sum_value(&totals.sum[BT_SWEEP_AGAINST]);
            CHECK_CLOSE(scalar_visit(&one, order, &o, times, &most_of_one), against, 1e-11 * (1 + fabs(against)));
            if (k % 7 < 3) check_residual(&four, &one);
            bt_batch_unpack(&four.cell);
            assert_false(four.cell.work->packed);
            assert_int_equal(four.cell.work->n_last, four.cell.n_listed);
            CHECK_CLOSE(most, most_of_one, 0);
            for (int i = 0; i < BODIES; i++) {
                assert_true(four.v[i].x == one.v[i].x && four.v[i].y == one.v[i].y && four.v[i].w == one.v[i].w);
                if (i % 7 == 0) assert_memory_equal(&four.v[i], &one.v[i], sizeof *four.v);
            }
            for (bt_idx i = 0; i < CONTACTS; i++) {
                const bt_contact *p = &four.cell.contacts[i], *q = &one.contacts[i];
                assert_true(p->ln[0] == q->ln[0] && p->ln[1] == q->ln[1] && p->lt == q->lt);
                bt_contact same = *p; // but for the impulses, whose zeros may have a sign
                memcpy(same.ln, q->ln, sizeof same.ln);
                same.lt = q->lt;
                assert_memory_equal(&same, q, sizeof same);
            }
            check_residual(&four, &one);
        }
        free(four.cell.contacts);
    }
}

/// Every listed contact is swept once, and not much is left empty where there is a choice.
TEST(each_listed_contact_is_in_one_batch)
{
    static knot_of_floes s;
    uint64_t rng = 8;
    fill(&s, &rng, 1);
    own_contacts(&s);
    bt_idx order[CONTACTS];
    bool seen[CONTACTS] = {false};
    bt_totals totals = no_totals();
    bt_batch_sweep(&s.cell, s.v, s.inv, &(bt_sweep){.problem = &never_calm}, 1, &totals);
    swept_order(&s.cell, order);
    for (bt_idx j = 0; j < s.cell.n_listed; j++) {
        assert_false(seen[order[j]]);
        seen[order[j]] = true;
    }
    assert_true(BT_LANES * s.cell.work->n_batches < 1.15 * s.cell.n_listed);
    // A visit ends when a pass has changed nothing that matters.
    totals = no_totals();
    bt_batch_sweep(&s.cell, s.v, s.inv, &(bt_sweep){.problem = &always_calm}, 5, &totals);
    CHECK_CLOSE(bt_sum_value(&totals.sum[BT_SWEEP_UPDATES]), s.cell.n_listed, 0);
    free(s.cell.contacts);
}

/// A sweep with the moves beta, the last one first; returns the number of updates.
static double sweep_once(knot_of_floes *s, const double beta[2], const bt_problem *problem)
{
    const bt_sweep o = {.problem = problem, .moves = true, .beta = beta[0], .lead = {beta[0], beta[1] * (1 + beta[0])},
                        .lag = {0, beta[1]}};
    bt_totals totals = no_totals();
    bt_batch_sweep(&s->cell, s->v, s->inv, &o, 1, &totals);
    return bt_sum_value(&totals.sum[BT_SWEEP_UPDATES]);
}

/// Calm batches rest for one sweep, then for three. Their next update starts where the moves have come to meanwhile, as
/// if each had been made in its sweep.
TEST(a_batch_that_has_rested_catches_up_with_the_moves)
{
    static knot_of_floes s, one;
    static double x0[CONTACTS][3], x1[CONTACTS][3];
    bt_idx order[CONTACTS];
    uint64_t rng = 9;
    fill(&s, &rng, 1);
    list_all(&s.cell);
    set_out(&s);
    one = s;
    own_contacts(&s);
    assert_true(sweep_once(&s, (double[2]){0}, &always_calm) == CONTACTS);
    const bt_batch *batch = s.cell.work->batch;
    for (bt_idx k = 0; k < s.cell.work->n_batches; k++)
        for (int l = 0; l < batch[k].n; l++)
            for (int c = 0; c < 3; c++)
                x0[batch[k].contact[l]][c] = batch[k].before[c][l], x1[batch[k].contact[l]][c] = batch[k].x[c][l];
    assert_true(sweep_once(&s, (double[2]){0.5}, &always_calm) == 0);
    // by hand: the moves of two sweeps, and the update of the second
    for (bt_idx i = 0; i < CONTACTS; i++) {
        double x[3];
        for (int c = 0; c < 3; c++) {
            const double first = x1[i][c] + 0.5 * (x1[i][c] - x0[i][c]);
            x[c] = first + 0.7 * (first - x1[i][c]);
        }
        one.contacts[i].ln[0] = x[0], one.contacts[i].ln[1] = x[1], one.contacts[i].lt = x[2];
    }
    memcpy(one.v, s.v, sizeof one.v);
    swept_order(&s.cell, order);
    double most;
    scalar_visit(&one, order, &(bt_sweep){0}, 1, &most);
    assert_true(sweep_once(&s, (double[2]){0.7, 0.5}, &always_calm) == CONTACTS);
    for (bt_idx k = 0; k < s.cell.work->n_batches; k++)
        for (int l = 0; l < batch[k].n; l++) {
            const bt_idx i = batch[k].contact[l];
            const bt_contact *u = &one.contacts[i];
            // of points in one place either may bear the load
            CHECK_CLOSE(batch[k].x[0][l] + batch[k].x[1][l], u->ln[0] + u->ln[1], 1e-12);
            CHECK_CLOSE(batch[k].x[2][l], u->lt, 1e-12);
            for (int c = 0; c < 3; c++)
                CHECK_CLOSE(batch[k].before[c][l], x1[i][c] + 0.5 * (x1[i][c] - x0[i][c]), 1e-14);
        }
    for (int i = 0; i < 3; i++) assert_true(sweep_once(&s, (double[2]){0}, &always_calm) == 0);
    assert_true(sweep_once(&s, (double[2]){0}, &never_calm) == CONTACTS);
    assert_true(sweep_once(&s, (double[2]){0}, &never_calm) == CONTACTS);
    free(s.cell.contacts);
}

TEST(impulses_of_batches_are_applied_as_those_of_contacts)
{
    static knot_of_floes four, one;
    uint64_t rng = 17;
    for (int k = 0; k < 20; k++) {
        fill(&four, &rng, 1);
        list_all(&four.cell);
        if (k % 2) bind(&four, &rng);
        one = four;
        own_contacts(&four);
        bt_batch_pack(&four.cell, four.inv);
        bt_batch_apply(&four.cell, four.v);
        for (bt_idx i = 0; i < CONTACTS; i++) {
            const bt_contact *u = &one.contacts[i];
            bt_vel a = one.v[u->a], b = one.v[u->b];
            bt_apply(u, u->ln[0] + u->ln[1], u->ln[0] * u->ran[0] + u->ln[1] * u->ran[1],
                     u->ln[0] * u->rbn[0] + u->ln[1] * u->rbn[1], u->lt, one.inv[u->a], one.inv[u->b], &a, &b);
            bt_store(&one.v[u->a], one.inv[u->a], &a);
            bt_store(&one.v[u->b], one.inv[u->b], &b);
        }
        for (int i = 0; i < BODIES; i++) {
            CHECK_CLOSE(four.v[i].x, one.v[i].x, 1e-12);
            CHECK_CLOSE(four.v[i].y, one.v[i].y, 1e-12);
            CHECK_CLOSE(four.v[i].w, one.v[i].w, 1e-12);
        }
        free(four.cell.contacts);
    }
}

TEST_MAIN(NULL, NULL)
