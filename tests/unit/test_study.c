// SPDX-License-Identifier: MIT
// Studies: members of grids and Latin hypercubes, their names, seeds and values.
#include <unistd.h>

#include "test.h"
#include "bergtow/study.h"

static bt_study read_text(const char *text)
{
    char path[] = "/tmp/bergtow-study-XXXXXX";
    const int fd = mkstemp(path);
    assert_true(fd >= 0 && write(fd, text, strlen(text)) == (ssize_t)strlen(text));
    close(fd);
    bt_study s;
    bt_errors err = {0};
    const bt_status status = bt_study_read(&s, path, &err);
    bt_errors_print(&err);
    assert_int_equal(status, BT_OK);
    unlink(path);
    return s;
}

static bool has(const bt_member *m, const char *set)
{
    for (int i = 0; i < m->n_set; i++)
        if (!strcmp(m->set[i], set)) return true;
    return false;
}

TEST(grid_holds_every_combination_once)
{
    bt_study s =
        read_text("base: a.yml\nset: {run.duration: 60 s}\nparameters:\n  ice.concentration: [0.2, 0.5, 80 %]\n  "
                  "tow.speed: {from: 0.1 m/s, to: 0.4 m/s, n: 3, scale: log}\n"
                  "variants:\n  squares: {ice.shape: rectangles, ice.aspect: 1}\n  hexagons: {ice.shape: polygons, "
                  "ice.sides: 6}\nwith:\n  ice.concentration=0.5: {domain.width: 40 m}\nrepeats: 5\nseed: 7\n");
    assert_int_equal(s.n_conditions, 18);
    assert_int_equal(bt_study_n_members(&s), 90);
    int64_t *seeds = bt_alloc(90, sizeof *seeds);
    for (int64_t i = 0; i < 90; i++) {
        bt_member m, other;
        bt_study_member(&s, i, &m);
        seeds[i] = m.seed;
        for (int64_t j = 0; j < i; j++) {
            assert_true(seeds[j] != m.seed);
            bt_study_member(&s, j, &other);
            bool same = m.repeat == other.repeat;
            for (int p = 0; p < s.n_parameters; p++) same = same && !strcmp(m.value[p], other.value[p]);
            assert_false(same);
            bt_member_free(&other);
        }
        assert_true(has(&m, "run.duration=60 s"));
        assert_true(has(&m, "domain.width=40 m") == has(&m, "ice.concentration=0.5"));
        assert_true(has(&m, "ice.shape=rectangles") == !strcmp(m.value[2], "squares") &&
                    has(&m, "ice.sides=6") == !strcmp(m.value[2], "hexagons"));
        bt_member_free(&m);
    }
    bt_member m;
    // third concentration, second speed, second variant, fourth field
    bt_study_member(&s, 5 * (2 * 6 + 1 * 2 + 1) + 3, &m);
    assert_string_equal(m.name, "c016-r004");
    assert_true(has(&m, "ice.concentration=80 %") && has(&m, "tow.speed=0.2") && has(&m, "ice.shape=polygons"));
    bt_member_free(&m);
    // More repeats leave every member what it was.
    s.repeats = 8;
    bt_study_member(&s, 8 * 15 + 3, &m);
    assert_string_equal(m.name, "c016-r004");
    assert_true(m.seed == seeds[78]);
    bt_member_free(&m);
    free(seeds);
    bt_study_free(&s);
}

TEST(hypercube_has_one_sample_in_each_stratum)
{
    bt_study s = read_text("base: a.yml\nsampling: latin-hypercube\nsamples: 50\nrepeats: 2\nparameters:\n  "
                           "ice.thickness: {from: 1 m, to: 3 m}\n"
                           "  ice.size: {from: 10 m, to: 1000 m, scale: log}\n  ice.shape: [voronoi, rectangles]\n");
    assert_int_equal(bt_study_n_members(&s), 100);
    int seen[2][50] = {{0}}, shapes[2] = {0};
    double x[50], y[50], sxy = 0;
    for (int64_t c = 0; c < 50; c++) {
        bt_member m, twin;
        bt_study_member(&s, 2 * c, &m);
        bt_study_member(&s, 2 * c + 1, &twin);
        for (int p = 0; p < 3; p++) assert_string_equal(m.value[p], twin.value[p]);
        assert_true(m.seed != twin.seed);
        x[c] = (atof(m.value[0]) - 1) / 2, y[c] = log10(atof(m.value[1]) / 10) / 2;
        seen[0][(int)(50 * x[c])]++;
        seen[1][(int)(50 * y[c])]++;
        shapes[!strcmp(m.value[2], "voronoi")]++;
        bt_member_free(&m);
        bt_member_free(&twin);
    }
    for (int k = 0; k < 50; k++) {
        assert_int_equal(seen[0][k], 1);
        assert_int_equal(seen[1][k], 1);
        sxy += (x[k] - 0.5) * (y[k] - 0.5) * 12 / 50;
    }
    assert_int_equal(shapes[0], 25);
    assert_true(fabs(sxy) < 0.45); // three standard deviations of the correlation of independent permutations
    bt_study_free(&s);
}

TEST(common_fields_are_the_same_in_every_condition)
{
    static const char *const words[] = {"own", "common", "numbered"};
    const char *text = "base: a.yml\nrepeats: 3\nseed: 70\nfields: %s\nparameters:\n  run.dt: [1 s, 2 s]\n";
    int64_t seed[3][6];
    for (int k = 0; k < 3; k++) {
        char *t;
        assert_true(asprintf(&t, text, words[k]) > 0);
        bt_study s = read_text(t);
        free(t);
        for (int64_t i = 0; i < 6; i++) {
            bt_member m;
            bt_study_member(&s, i, &m);
            seed[k][i] = m.seed;
            bt_member_free(&m);
        }
        bt_study_free(&s);
    }
    for (int i = 0; i < 3; i++) {
        assert_true(seed[0][i] != seed[0][i + 3]);
        assert_true(seed[1][i] == seed[1][i + 3] && seed[1][i] == seed[0][i] && seed[1][i] != seed[1][(i + 1) % 3]);
        assert_true(seed[2][i] == 70 + i && seed[2][i + 3] == 70 + i);
    }
}

/// Conditions of a hypercube of 700 over the corners of floes, 3 to 9, that have so many.
static void count_corners(const char *how, int n[33])
{
    char *text;
    assert_true(asprintf(&text, "base: a.yml\nsampling: latin-hypercube\nsamples: 700\nparameters:\n  ice.sides: "
                                "{from: 3, to: 9, n: 40, %s}\n", how) > 0);
    bt_study s = read_text(text);
    free(text);
    for (int64_t c = 0; c < 700; c++) {
        bt_member m;
        bt_study_member(&s, c, &m);
        const int corners = atoi(m.value[0]);
        assert_true(corners >= 0 && corners <= 32);
        n[corners]++;
        bt_member_free(&m);
    }
    bt_study_free(&s);
}

/// Share of a triangular distribution below k of its seven whole numbers.
static double peaked_below(int k) { return k < 4 ? 2. * k * k / 49 : 1 - 2. * (7 - k) * (7 - k) / 49; }

TEST(whole_numbers_are_drawn_as_often_as_their_share)
{
    int even[33] = {0}, logarithmic[33] = {0}, peaked[33] = {0}, sum = 0;
    count_corners("distribution: uniform", even);
    count_corners("scale: log", logarithmic);
    count_corners("distribution: triangular", peaked);
    for (int k = 3; k <= 9; k++) {
        assert_int_equal(even[k], 100);
        // each end of a share lies within a stratum
        assert_true(fabs(logarithmic[k] - 700 * log((k + 0.5) / (k - 0.5)) / log(9.5 / 2.5)) < 2);
        assert_true(fabs(peaked[k] - 700 * (peaked_below(k - 2) - peaked_below(k - 3))) < 2);
        sum += peaked[k];
    }
    assert_int_equal(sum, 700);
}

TEST_MAIN(NULL, NULL)
