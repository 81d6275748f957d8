// SPDX-License-Identifier: MIT
// The balance of momentum of a step: a loss that is made by hand is found, whether bodies move or nearly rest.
//
// Red with (tried): the momentum at the solver's tolerance left out; that of all bodies in its place.
#include "scene.h"

#include "bergtow/contact.h"

static bt_world *now;
static double lost; // kg m/s, of each contact after the solve

static bool on(const double *own) { return own[0] > 0; }

static void bound(const bt_law_contact *contact, double load[2], double given[2])
{
    (void)contact, (void)load, (void)given;
}

static bool lose(bt_law_contact *contact, double *number)
{
    (void)number;
    now->bodies.vel[contact->b].x -= lost / now->bodies.mass[contact->b];
    return false;
}

static const bt_law_key keys[] = {{"lossy", "", "0", "[0, 1]", "contacts lose momentum"}};
static const bt_contact_law lossy = {
    .name = "lossy", .doc = "contacts lose momentum", .keys = keys, .n_keys = 1, .on = on, .bound = bound,
    .remember = lose};

/// A floe of 1 kg runs into one of 50 kg; a third, of 1000 kg, rests elsewhere. A share of the momentum that they
/// exchange is lost on the way. The measure is that momentum, and for slow ones what both have at the tolerance.
TEST(a_loss_is_found_at_any_speed)
{
    const double speed[] = {0.3, 2e-3, 3e-4}, share[] = {0, 1e-6, 1e-3}, sheet[] = {1, 50, 1000};
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            bt_params p = scene_params(0.1, 1);
            p.tolerance = 1e-4, p.added_laws = 1, p.law_own[BT_LAWS][0] = 1;
            bt_world *w = now = bt_world_create(&p);
            for (int b = 0; b < 3; b++) {
                double v[8];
                scene_square(1, v);
                bt_body_def d = scene_prism(4, v, sheet[b]);
                d.x = b < 2 ? b : 20, d.vx = b == 0 ? speed[i] : 0;
                bt_world_add(w, &d);
            }
            lost = share[k] * speed[i] * sheet[1] / (sheet[0] + sheet[1]);
            bt_world_step(w);
            const double exchanged = sheet[0] * (speed[i] - w->bodies.vel[0].x);
            CHECK_CLOSE(exchanged, speed[i], 0.1 * speed[i]);
            const double residual = lost / fmax(exchanged, (sheet[0] + sheet[1]) * p.tolerance);
            CHECK_CLOSE(w->stats.momentum_residual, residual, 1e-6 * residual + 1e-12);
            assert_true((w->stats.momentum_residual > 1e-9) == (share[k] > 0)); // a run reports it
            bt_world_free(w);
        }
}

int main(void)
{
    bt_errors err = {0};
    if (bt_contact_register(&lossy, &err) != BT_OK) {
        bt_errors_print(&err);
        return 1;
    }
    return run_all_tests(NULL, NULL);
}
