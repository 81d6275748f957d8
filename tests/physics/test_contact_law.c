// SPDX-License-Identifier: MIT
// A contact law from outside the program: the fender of docs/how-to-add-a-contact-law.md, against closed forms, and
// what the table refuses. What runs of it leave is in tests/cli/test_contact_law.py.
//
// Red with (tried): the given depth left out of the gap; the bound without Δt; growth booked whichever law is at its
// bound; the record not written; applies not asked; the work of the points not booked; the state counted from contacts
// at work alone; the names of the laws in a checkpoint not compared.
#include "scene.h"

#include "bergtow/contact.h"
#include "bergtow/quantity.h"
#include "base/snapshot.h"
#include "contact/law.h"
#include "output/state.h"

#include "examples/contact_law.c"

static bt_law_contact seen; // by the bound of the fender, the last time

static void watch(const bt_law_contact *t, double load[2], double given[2])
{
    seen = *t;
    fender_bound(t, load, given);
}

static double two(const bt_world *world, const void *context) { return (void)world, (void)context, 2; }

static const double sheet = 50, soft = 30, stiff = 400; // kg/m², N, N/m

/// The hull: a slab from x = 0.71 on that stands still, and is what is towed.
static bt_world *hull_and_floe(double dt, double turn, double speed, double slope)
{
    bt_params p = scene_params(dt, 1);
    p.tilt_ax = slope;
    p.added_laws = 1;
    p.law_own[BT_LAWS][LOAD] = soft, p.law_own[BT_LAWS][STIFFNESS] = stiff;
    bt_world *w = bt_world_create(&p);
    double v[8];
    scene_square(1, v);
    bt_body_def d = scene_prism(4, v, sheet);
    d.yaw = turn, d.vx = speed, d.x = turn ? 0 : 0.2, d.thickness = 0.1;
    bt_world_add(w, &d);
    w->towed = scene_wall(w, 0.71, -5, 4, 5, 0);
    return w;
}

static double pressed(const bt_world *w) { return w->stats.added[0][2]; }

/// A floe that comes with its corner first is stopped at F0 d + ½ k d² = ½ m v², and what it lost is the fender's work.
TEST(it_takes_the_energy_of_a_floe)
{
    for (int i = 0; i < 3; i++) {
        const double speed = (double[]){0.2, 0.5, 1}[i], energy = 0.5 * sheet * speed * speed;
        bt_world *w = hull_and_floe(5e-4, BT_PI / 4, speed, 0);
        double work = 0, points = 0;
        for (int s = 0; s < 3000; s++) {
            bt_world_step(w);
            work += w->stats.added[0][0], points += w->stats.added[0][1];
            assert_true(w->stats.converged);
        }
        const double depth = (sqrt(soft * soft + 2 * stiff * energy) - soft) / stiff;
        CHECK_CLOSE(pressed(w), depth, 0.01 * depth);
        CHECK_CLOSE(work, energy, 1e-5 * energy); // the step that stops it is not at the bound
        CHECK_CLOSE(w->bodies.pose[0].x + sqrt(0.5) - 0.71, depth, 0.01 * depth); // there it stays
        CHECK_CLOSE(w->bodies.vel[0].x, 0, 1e-12);
        assert_true(points > 10);
        bt_world_free(w);
    }
}

/// Edge on, two points bear: a steady force presses the fender until 2 (F0 + k d) is the force, and no deeper.
TEST(it_creeps_until_it_bears)
{
    const double force[] = {0.9 * 2 * soft, 1.5 * 2 * soft, 3 * 2 * soft};
    for (int i = 0; i < 3; i++) {
        bt_world *w = hull_and_floe(2e-3, 0, 0, force[i] / sheet);
        w->bodies.pose[0].x = 0.21; // touching
        for (int s = 0; s < 12000; s++) {
            w->bodies.vel[0].x *= 0.9; // slow, so that nothing overshoots
            bt_world_step(w);
        }
        const double depth = bt_max(0, (0.5 * force[i] - soft) / stiff);
        CHECK_CLOSE(pressed(w), depth, 0.005 * depth + 1e-9);
        bt_world_free(w);
    }
}

/// The length that a law is given is that between points which may close, whether the search finds others or not.
TEST(its_length_is_what_may_close)
{
    for (int i = 0; i < 4; i++) {
        const bool turned = i > 1, fast = i % 2;
        const double yaw = turned ? 0.03 : 0;
        bt_world *w = hull_and_floe(1e-4, yaw, 0.5, 0);
        w->bodies.pose[0].x = 0.71 - 0.5 * (cos(yaw) + sin(yaw));
        double v[8];
        scene_square(1, v);
        bt_body_def d = scene_prism(4, v, sheet);
        d.x = -2, d.vx = -300;
        if (fast) bt_world_add(w, &d);
        bt_world_step(w);
        assert_int_equal(seen.n, turned && !fast ? 1 : 2);
        assert_int_equal(seen.closes[0] + seen.closes[1], turned ? 1 : 2);
        for (int k = 0; k < seen.n; k++) assert_true(seen.closes[k] == (seen.gap[k] < 1e-3));
        CHECK_CLOSE(seen.length, turned ? 0 : 1, 1e-9);
        bt_world_free(w);
    }
}

/// What is not towed has no fender: a wall stops the same floe at its surface.
TEST(it_is_the_hull_s_alone)
{
    bt_world *w = hull_and_floe(5e-4, BT_PI / 4, 0.5, 0);
    w->towed = -1;
    for (int s = 0; s < 300; s++) bt_world_step(w);
    assert_true(pressed(w) == 0 && w->stats.added[0][0] == 0);
    CHECK_CLOSE(w->bodies.pose[0].x + sqrt(0.5), 0.71, 2e-3);
    bt_world_free(w);
}

/// Of two laws the weaker yields: ice that crushes under less than the fender leaves the fender whole.
TEST(the_weaker_law_yields)
{
    for (int i = 0; i < 2; i++) {
        bt_world *w = hull_and_floe(5e-4, BT_PI / 4, 0.5, 0);
        double *own = w->par.law_own[BT_LAW_CRUSHING];
        own[BT_CRUSH_PRESSURE] = i ? 5e6 : 300, own[BT_CRUSH_LEAST] = 0.01;
        double crushed = 0;
        for (int s = 0; s < 1000; s++) {
            bt_world_step(w);
            crushed += scene_law(w, "crushed_work");
        }
        const double energy = 0.5 * sheet * 0.25;
        assert_true(i ? pressed(w) > 0.1 && crushed < 0.05 * energy : pressed(w) == 0 && crushed > 0.2 * energy);
        bt_world_free(w);
    }
}

/// Memory names its law by a number: a program with other laws before this one would take it for one of theirs.
TEST(a_state_of_other_laws_is_refused)
{
    static const char *const had[] = {"fender", "fender, grip", "grip, fender"};
    for (int k = 0; k < 3; k++) {
        bt_world *w = hull_and_floe(5e-4, BT_PI / 4, 0.5, 0), *other = hull_and_floe(5e-4, BT_PI / 4, 0.5, 0);
        for (int s = 0; s < 900; s++) bt_world_step(w);
        assert_true(pressed(w) > 0);
        bt_errors err = {0};
        bt_snapshot saved = {.path = "checkpoint", .err = &err}, s = saved;
        assert_int_equal(bt_state_save(w, &bt_comm_alone, &saved, &err), BT_OK);
        for (int i = 0; i < saved.n; i++) {
            const bt_item *x = &saved.item[i];
            if (!strcmp(x->name, "contacts/added_laws")) bt_snapshot_add_text(&s, x->name, had[k]);
            else bt_snapshot_add(&s, x->name, x->type, x->n, x->width, x->data);
        }
        assert_string_equal(bt_snapshot_text(&saved, "contacts/added_laws"), had[0]);
        const bt_status status = bt_state_load(other, &bt_comm_alone, &s, &err);
        if (k == 0) assert_true(status == BT_OK && bt_world_hash(other) == bt_world_hash(w));
        else assert_true(status == BT_ERR_CASE && err.n == 1 && strstr(err.text[0], had[k]));
        bt_errors_free(&err);
        bt_snapshot_free(&saved);
        bt_snapshot_free(&s);
        bt_world_free(w);
        bt_world_free(other);
    }
}

TEST(what_will_not_do_is_refused)
{
    static const bt_law_key furlong[] = {{"load", "furlong", "0", "[0, 1]", "a load of something"}};
    static const bt_contact_number lonely[] = {{"bits", "1", "something that nothing counts", true}};
    static const bt_contact_number taken[] = {{"contacts", "1", "a series that is there", false}},
                                   nameless[] = {{NULL, "1", "a number without a name", false}},
                                   twice[] = {{"grip", "1", "a number of the test", false},
                                              {"grip", "N", "another number of the test", false}},
                                   work[] = {{"soft_work", "1", "a number of the test", false}};
    const struct { bt_contact_law law; const char *says;
    } bad[] = {
        {{.name = "twin", .doc = "a law with a number that is there", .on = fender_on, .bound = fender_bound,
          .remember = fender_remember, .numbers = taken, .n_numbers = 1}, "contacts: this name is taken"},
        {{.name = "blank", .doc = "a law with a number without a name", .on = fender_on, .bound = fender_bound,
          .remember = fender_remember, .numbers = nameless, .n_numbers = 1}, "its number 1 needs name"},
        {{.name = "soft", .doc = "a law with two numbers of one name", .on = fender_on, .bound = fender_bound,
          .remember = fender_remember, .numbers = twice, .n_numbers = 2}, "two of its series are named grip"},
        {{.name = "soft", .doc = "a law with a number called its work", .on = fender_on, .bound = fender_bound,
          .remember = fender_remember, .numbers = work, .n_numbers = 1}, "two of its series are named soft_work"},
        {{.name = "rafting", .doc = "a law of that name", .on = fender_on, .bound = fender_bound}, "name is taken"},
        {{.name = "fender", .doc = "a law of that name", .on = fender_on, .bound = fender_bound}, "name is taken"},
        {{.name = "Big", .doc = "a law of that name", .on = fender_on, .bound = fender_bound}, "lower-case letters"},
        {{.name = "idle", .doc = "a law without functions"}, "`on` and `bound`"},
        {{.name = "mute", .on = fender_on, .bound = fender_bound}, "describe it in one line"},
        {{.name = "odd", .doc = "a law with a bad unit", .on = fender_on, .bound = fender_bound, .keys = furlong,
          .n_keys = 1}, "unit furlong"},
        {{.name = "sad", .doc = "a law with an idle number", .on = fender_on, .bound = fender_bound,
          .numbers = lonely, .n_numbers = 1}, "nothing adds to its number bits"},
    };
    assert_true(bt_n_series() > 0); // which has the linker take what keeps the series
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        bt_errors err = {0};
        assert_int_equal(bt_contact_register(&bad[k].law, &err), BT_ERR_USAGE);
        if (err.n == 0 || !strstr(err.text[0], bad[k].says))
            fail_msg("%s: %s", bad[k].says, err.n ? err.text[0] : "nothing said");
        bt_errors_free(&err);
    }
    assert_int_equal(bt_n_contact_laws(), 1);
}

/// The arrays that hold them have room, and each series names a total of the summary.
TEST(numbers_of_the_laws_have_their_places)
{
    assert_true(bt_law_first_number(BT_LAWS) <= BT_MAX_LAW_NUMBERS && bt_law_first_total(BT_LAWS) <= BT_MAX_LAW_TOTALS);
    for (int law = 0; law < BT_LAWS; law++) {
        const bt_law *l = bt_laws[law];
        bool summed[BT_MAX_LAW_NUMBERS] = {false};
        for (int k = 0; k < l->n_totals; k++)
            summed[l->totals[k].number] |= !strcmp(l->numbers[l->totals[k].number].key, l->totals[k].key);
        for (int k = 0; k < l->n_numbers; k++) assert_true(summed[k]);
    }
}

int main(void)
{
    bt_errors err = {0};
    bt_contact_law watched = fender_law;
    watched.bound = watch;
    if (bt_contact_register(&watched, &err) != BT_OK) bt_errors_print(&err);
    bt_errors_free(&err);
    // Its series are made when first needed, and have their names before that.
    const bt_quantity of_fender = {.name = fender_law.numbers[0].name, .units = "1", .of_world = two,
                                   .description = "a quantity with the name of a number of the law"};
    if (bt_quantity_register(&of_fender, &err) != BT_ERR_USAGE) return 1;
    bt_errors_free(&err);
    return run_all_tests(NULL, NULL);
}
