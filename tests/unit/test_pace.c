// SPDX-License-Identifier: MIT
// Threads of a run on machines that are made up: idle, shared with others, shared for a while.
#include "test.h"
#include "run/pace.h"

enum { MOST = 8 };

/// Work a second and use of the cores for a number of threads.
typedef struct machine { double rate[MOST + 1], use[MOST + 1]; } machine;

static const machine idle = {{[1] = 1, [2] = 1.9, [4] = 3.4, [8] = 6}, {[1] = 1, [2] = 0.95, [4] = 0.9, [8] = 0.8}};
static const machine full = {{[1] = 0.1, [2] = 0.02, [4] = 0.01, [8] = 0.01},
                             {[1] = 0.1, [2] = 0.1, [4] = 0.1, [8] = 0.1}};
// four cores are free
static const machine half = {{[1] = 1, [2] = 1.9, [4] = 3.4, [8] = 2}, {[1] = 1, [2] = 0.95, [4] = 0.9, [8] = 0.4}};
// idle, but with little to do for each thread
static const machine small = {{[1] = 1, [2] = 1.2, [4] = 1.5, [8] = 1.8}, {[1] = 1, [2] = 0.5, [4] = 0.4, [8] = 0.3}};

/// Steps of 10 ms for some seconds. Returns the work that was done.
static double work_on(bt_pace *p, const machine *m, double seconds)
{
    double done = 0;
    for (int i = 0; i < (int)(seconds * 100); i++) {
        const double work = 0.01 * m->rate[p->now];
        done += work;
        bt_pace_step(p, 0.01, 0.01 * m->use[p->now] * p->now, work);
    }
    return done;
}

static bt_pace started(int threads)
{
    bt_pace p;
    bt_pace_begin(&p, threads, true);
    return p;
}

TEST(an_idle_machine_keeps_all_threads)
{
    bt_pace p = started(8);
    assert_true(fabs(work_on(&p, &idle, 100) - 600) < 1e-6); // not one trial
    p = started(8);
    assert_true(work_on(&p, &small, 100) > 0.99 * 180); // trials are rare
    assert_true(p.now == 8 || p.from == 8);
}

TEST(a_busy_machine_has_as_many_as_pay)
{
    bt_pace p = started(8);
    assert_true(work_on(&p, &full, 100) > 0.9 * 10);
    p = started(8);
    assert_true(work_on(&p, &half, 100) > 0.97 * 340);
    p = started(2);
    assert_true(work_on(&p, &full, 100) > 0.9 * 10);
}

TEST(threads_come_back_when_the_others_have_gone)
{
    bt_pace p = started(8);
    work_on(&p, &full, 100);
    assert_true(p.now <= 2);
    assert_true(work_on(&p, &idle, 100) > 0.8 * 600);
    assert_int_equal(p.now, 8);
}

TEST(a_fixed_number_stays)
{
    bt_pace p;
    bt_pace_begin(&p, 8, false);
    work_on(&p, &full, 10);
    assert_int_equal(p.now, 8);
    bt_pace_begin(&p, 1, true);
    work_on(&p, &full, 10);
    assert_int_equal(p.now, 1);
}

TEST_MAIN(NULL, NULL)
