// SPDX-License-Identifier: MIT
// Progress lines against a clock of the test's own.
#include "test.h"
#include "base/progress.h"

static double now;
static double test_clock(void) { return now; }

/// 100 of 400 steps at one step a second, after a start at step `first`; returns all that was written.
static char *run(bt_progress p, int64_t first, double force)
{
    static char text[20000];
    memset(text, 0, sizeof text);
    p.out = tmpfile();
    p.clock = test_clock;
    p.n_steps = 400;
    now = 1000;
    bt_progress_start(&p, first);
    for (int i = 1; i <= 100; i++) {
        now += 1;
        bt_progress_step(&p, first + i, 0.5 * (double)(first + i), i * force);
    }
    bt_progress_end(&p);
    rewind(p.out);
    const size_t n = fread(text, 1, sizeof text - 1, p.out);
    text[n] = '\0';
    fclose(p.out);
    return text;
}

static int count(const char *text, char c)
{
    int n = 0;
    for (; *text; text++) n += *text == c;
    return n;
}

TEST(plain_lines_come_at_the_interval)
{
    const char *text = run((bt_progress){.interval = 10}, 0, 2);
    assert_int_equal(count(text, '\n'), 10);
    assert_int_equal(count(text, '\r'), 0);
    // The mean of 2, 4, ... 20 is 11.
    const char *first = "  2.5 %  t = 5 s  1 steps/s  6 min 30 s left  mean ice resistance so far 11 N\n";
    assert_int_equal(strncmp(text, first, strlen(first)), 0);
    assert_non_null(strstr(text, " 25.0 %  t = 50 s  1 steps/s  5 min 00 s left  mean ice resistance so far 101 N\n"));
}

TEST(a_resumed_run_counts_its_own_steps)
{
    const char *text = run((bt_progress){.interval = 100}, 200, NAN);
    assert_string_equal(text, " 75.0 %  t = 150 s  1 steps/s  1 min 40 s left\n"); // no force without a body
}

TEST(a_terminal_has_one_line)
{
    const char *text = run((bt_progress){.interval = 1e9, .terminal = true}, 0, 1);
    assert_int_equal(count(text, '\n'), 0);
    assert_int_equal(count(text, '\r'), 101);
    assert_string_equal(strrchr(text, '\r'), "\r\x1b[K"); // left empty
}

TEST(quiet_is_quiet)
{
    assert_string_equal(run((bt_progress){.interval = 0, .quiet = true}, 0, 1), "");
    assert_string_equal(run((bt_progress){.quiet = true, .terminal = true}, 0, 1), "");
}

TEST_MAIN(NULL, NULL)
