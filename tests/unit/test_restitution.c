// SPDX-License-Identifier: MIT
// Which rebounds are lowered, and by how much, on contacts whose impulses and velocities are given.
#include "test.h"
#include "all_pairs.h"

#include "solve/solver.h"

static bt_contact *contact_of(const bt_world *w, bt_gid a, bt_gid b)
{
    for (bt_idx k = 0; k < w->cells->n; k++)
        for (bt_idx j = 0; j < w->cells->cell[k].n_contacts; j++) {
            bt_contact *u = &w->cells->cell[k].contacts[j];
            if (w->bodies.gid[u->a] == a && w->bodies.gid[u->b] == b) return u;
        }
    fail_msg("no contact of %d and %d", (int)a, (int)b);
    return NULL;
}

/// Three squares in a row. The first, at 1 m/s, hits the second, at rest, and comes back at 2 m/s: the impulse, 1 N s,
/// has done the work 1 · ½(−1 + 2) = ½ J. The third comes at 5 m/s and goes on so, and the impulse there takes 5 J.
static bt_world *row(double restitution)
{
    bt_params p = scene_params(0.1, 1);
    bt_world *w = bt_world_create(&p);
    const double before[3] = {1, 0, -5}, after[3] = {-2, 0, -5};
    double v[8];
    scene_square(1, v);
    for (int k = 0; k < 3; k++) {
        bt_body_def d = scene_prism(4, v, 100);
        d.x = 1.0001 * k, d.restitution = restitution;
        bt_world_add(w, &d);
    }
    detect_all(w, 0.1);
    for (int k = 0; k < 3; k++) {
        const bt_idx i = bt_world_index(w, k);
        w->bodies.vel_start[i].x = w->bodies.vel_free[i].x = before[k];
        w->bodies.vel[i].x = after[k];
    }
    w->stats.residual = 0, w->stats.converged = true;
    contact_of(w, 0, 1)->ln[0] = contact_of(w, 1, 2)->ln[0] = 1;
    return w;
}

/// A step that is solved to 0.2 m/s may have given 0.2 J for each N s, of friction as of a normal impulse: the ½ J of
/// the first contact is doubtful with 2 N s of friction beside its 1 N s, and not with 1 N s.
TEST(what_the_residual_can_have_given_counts_friction)
{
    bt_world *w = row(0.6);
    bt_contact *hit = contact_of(w, 0, 1);
    contact_of(w, 1, 2)->ln[0] = 0;
    w->stats.residual = 0.2;
    for (int sign = -1; sign <= 1; sign += 2) {
        assert_true(bt_restitution_begin(w));
        hit->lt = sign * 2;
        assert_false(bt_restitution_lower(w));
        hit->lt = sign * 1;
        assert_true(bt_restitution_lower(w));
    }
    bt_world_free(w);
}

/// By halves, and below a fifth to none; each solution begins with all of it again, whatever the last one has left.
TEST(a_rebound_that_gives_energy_is_lowered)
{
    bt_world *w = row(0.6);
    const bt_contact *hit = contact_of(w, 0, 1);
    contact_of(w, 1, 2)->ln[0] = 0;
    for (int solution = 0; solution < 2; solution++) {
        assert_true(bt_restitution_begin(w));
        CHECK_CLOSE(hit->bias[0], -0.6, 1e-15); // e × approach
        for (double share = 0.5; share >= 0.125; share *= 0.5) {
            assert_true(bt_restitution_lower(w));
            CHECK_CLOSE(hit->bias[0], -0.6 * share, 1e-15);
        }
        assert_true(bt_restitution_lower(w));
        CHECK_CLOSE(hit->bias[0], 0.0001 / 0.1, 1e-12); // without it the gap may close
        assert_false(bt_restitution_lower(w));
    }
    bt_world_free(w);
}

/// Another contact of the island may take what a rebound gives, where it is one of edges; what sheets that slide over
/// each other take is no reason to let it be. Together the contacts lose 4½ J.
TEST(sheets_do_not_pay_for_rebounds)
{
    for (int sheets = 0; sheets < 2; sheets++) {
        bt_world *w = row(0.6);
        assert_true(bt_restitution_begin(w));
        if (sheets) contact_of(w, 1, 2)->n = 0;
        assert_int_equal(bt_restitution_lower(w), sheets);
        bt_world_free(w);
    }
}

TEST_MAIN(NULL, NULL)
