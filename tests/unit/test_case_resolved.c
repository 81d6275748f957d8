// SPDX-License-Identifier: MIT
// The resolved file of a case reads back to the same bits.
#include "base/largest.h"
#include "case/case_files.h"
#include "case/schema.h"
#include "case_text.h"


static uint64_t random_bits(void)
{
    static uint64_t s = 0xD1B54A32D192ED03u;
    s ^= s << 13, s ^= s >> 7, s ^= s << 17;
    return s;
}

static double random_in(const bt_key *k)
{
    bt_range r;
    assert_true(bt_value_range(k, &r));
    double u = (double)(random_bits() >> 11) * 0x1p-53, v = r.lo + u * (r.hi - r.lo);
    if (random_bits() % 4 == 0 && r.lo >= 0 && r.hi > 1e-12) v = r.hi * pow(10, -12 * u);
    return v > r.lo && v < r.hi ? v : r.lo / 2 + r.hi / 2;
}

// Random values of the allowed range into every member.
static void fill_randomly(const bt_key *keys, int n, void *members)
{
    static const char *const texts[] = {"plain",
                                        "none",
                                        "",
                                        "~",
                                        "a: b # c",
                                        " two  blanks ",
                                        "quote \" and \\ back",
                                        "tab\tnewline\nend",
                                        "søl, 冰山, 🧊",
                                        "\x01\x7f",
                                        "\xc2\x85 \xe2\x80\xa8 \xef\xbb\xbf",
                                        "- x",
                                        "'single'",
                                        "%",
                                        "@`",
                                        "true",
                                        "1.5"};
    for (int i = 0; i < n; i++) {
        const bt_key *k = &keys[i];
        char *m = (char *)members + k->offset;
        if (k->type == BT_KEY_REAL) memcpy(m, &(double){random_in(k)}, sizeof(double));
        if (k->type == BT_KEY_INT) memcpy(m, &(int64_t){(int64_t)random_in(k)}, sizeof(int64_t));
        if (k->type == BT_KEY_BOOL) memcpy(m, &(bool){random_bits() & 1}, sizeof(bool));
        if (k->type == BT_KEY_CHOICE) {
            unsigned count = 0;
            while (k->choices[count]) count++;
            memcpy(m, &(unsigned){(unsigned)(random_bits() % count)}, sizeof count);
        }
        if (k->type == BT_KEY_TEXT) {
            char *t = strdup(texts[random_bits() % (sizeof texts / sizeof *texts)]), *old;
            memcpy(&old, m, sizeof old);
            free(old);
            memcpy(m, &t, sizeof t);
        }
        if (k->type == BT_KEY_POINTS) {
            int count = 3 + (int)(random_bits() % 6);
            double *p = bt_alloc((size_t)count, 2 * sizeof *p), *old;
            for (int j = 0; j < 2 * count; j++) {
                const bt_key column = bt_schema_column(k, j % 2);
                p[j] = random_in(&column);
            }
            memcpy(&old, m, sizeof old);
            free(old);
            memcpy(m, &p, sizeof p);
            memcpy((char *)members + k->offset_count, &count, sizeof count);
        }
    }
}

static void compare(const bt_key *keys, int n, const void *a, const void *b)
{
    for (int i = 0; i < n; i++) {
        const bt_key *k = &keys[i];
        const char *ma = (const char *)a + k->offset, *mb = (const char *)b + k->offset;
        bool same = true;
        if (k->type == BT_KEY_REAL || k->type == BT_KEY_INT) same = !memcmp(ma, mb, 8);
        if (k->type == BT_KEY_BOOL) same = !memcmp(ma, mb, sizeof(bool));
        if (k->type == BT_KEY_CHOICE) same = !memcmp(ma, mb, sizeof(unsigned));
        if (k->type == BT_KEY_TEXT) {
            const char *ta, *tb;
            memcpy(&ta, ma, sizeof ta), memcpy(&tb, mb, sizeof tb);
            same = ta && tb ? !strcmp(ta, tb) : ta == tb;
            // becomes absolute; compared as text below
            const size_t o = k->offset;
            if (keys == bt_case_keys &&
                (o == offsetof(bt_case, ice.field) || o == offsetof(bt_case, ice.outlines) ||
                 o == offsetof(bt_case, water.current_table) || o == offsetof(bt_case, air.wind_table)))
                same = true;
        }
        if (k->type == BT_KEY_POINTS) {
            const double *pa, *pb;
            int na, nb;
            memcpy(&pa, ma, sizeof pa), memcpy(&pb, mb, sizeof pb);
            memcpy(&na, (const char *)a + k->offset_count, sizeof na),
                memcpy(&nb, (const char *)b + k->offset_count, sizeof nb);
            same = na == nb && (!na || !memcmp(pa, pb, (size_t)na * 2 * sizeof *pa));
        }
        if (!same) fail_msg("%s changed on the way through the file", k->name);
    }
}

// Values of the whole range of every key, most of them no sensible case together: what counts is that the reader gets
// the same bits, so its cross checks may complain, and the values must still be there.
TEST(resolved_file_reads_back_to_the_same_bits)
{
    for (int round = 0; round < 60; round++) {
        bt_case c, d;
        bt_errors err = {0};
        bt_case_defaults(&c);
        fill_randomly(bt_case_keys, bt_n_case_keys, &c);
        c.output.frame_interval = 1;
        c.n_floes = 3;
        c.floes = bt_alloc(3, sizeof *c.floes);
        for (int i = 0; i < 3; i++) fill_randomly(bt_floe_keys, bt_n_floe_keys, &c.floes[i]);
        char *text = bt_case_resolved(&c);
        read_text(&d, text, &err);
        for (size_t i = 0; i < err.n; i++) // complaints of the cross checks only
            if (strstr(err.text[i], "out of range") || strstr(err.text[i], "unknown") || strstr(err.text[i], "YAML") ||
                strstr(err.text[i], "is not a"))
                fail_with(&err, "value refused");
        if (c.body.shape == BT_BODY_ABSENT || c.tow.mode == BT_TOW_NONE)
            c.tow.mode = d.tow.mode, c.tow.speed = d.tow.speed;
        compare(bt_case_keys, bt_n_case_keys, &c, &d);
        assert_int_equal(d.n_floes, 3);
        for (int i = 0; i < 3; i++) compare(bt_floe_keys, bt_n_floe_keys, &c.floes[i], &d.floes[i]);
        free(text);
        bt_errors_free(&err);
        bt_case_free(&c);
        bt_case_free(&d);
    }
}

// From a case with derived defaults: resolving twice gives the same text, also from another folder.
TEST(resolved_text_of_the_resolved_text_is_identical)
{
    static const char *const texts[] = {
        "run: {dt: 0.1, duration: 100}\nice: {field: some.h5}\n",
        "run: {dt: 0.3, duration: 100}\nbody: {shape: none}\n",
        "run: {dt: 0.1, duration: 100}\ntow: {mode: none}\nbody: {shape: ship, length: 4.1, width: 1.3, yaw: 33, vx: "
        "0.1}\n",
        "run: {dt: 1, duration: 100}\ndomain: {frame: geographic, length: 1 nmi, width: 0.7 km, ends: wall, sides: "
        "open}\nice: "
        "{concentration: 0.8, size: 33.3, thickness: 0.04}\nbody: {length: 2, draft: 0.5}\ntow: {speed: 0.13}\n",
        "run: {dt: 1, duration: 100}\ndomain: {frame: geographic, length: 1 km, width: 1 km, ends: open, sides: open}\n"
        "ice: {outlines: some.json}\nbody: {length: 2, draft: 0.5}\n"
        "tow: {mode: line, speed: 0.13, line_length: 9, line_stiffness: 9 kN}\n",
        "run: {dt: 1, duration: 100}\ndomain: {frame: geographic, length: 1 km, width: 1 km, ends: open, sides: open}\n"
        "ice: {concentration: 0}\nfloes: [{x: 9.1, y: 0.3, length: 0.7, thickness: 1}]\nbody: {shape: none}\n",
        "run: {dt: 0.1, duration: 100}\nfloes: [{x: 9.1, y: 0.3, length: 0.7}, {x: 20, y: 0, shape: polygon, vertices: "
        "[[0,0],[1,0],[0,1]]}]\n",
    };
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        bt_case c, d;
        bt_errors err = {0};
        if (read_text(&c, texts[i], &err)) fail_with(&err, texts[i]);
        char *first = bt_case_resolved(&c);
        if (i == 0) {
            assert_string_equal(c.ice.field + strlen(c.ice.field) - 8, "/some.h5");
            assert_int_equal(c.ice.field[0], '/');
            assert_non_null(strstr(c.ice.field, folder));
        }
        char away[32] = "/tmp/bt_resolved_XXXXXX";
        int fd = mkstemp(away);
        assert_true(fd >= 0 && write(fd, first, strlen(first)) == (ssize_t)strlen(first));
        close(fd);
        bt_status status = bt_case_read(&d, away, NULL, 0, &err);
        remove(away);
        if (status) fail_with(&err, "the resolved file is refused");
        char *second = bt_case_resolved(&d);
        assert_string_equal(first, second);
        free(first);
        free(second);
        bt_case_free(&c);
        bt_case_free(&d);
    }
}

// Every line end of YAML, also in the middle, and none at the end: a piece of the text that became a line of its own
// would be a key of the case.
TEST(the_case_as_given_comes_back)
{
    static const char *const given[] = {
        "run: {dt: 1}\n", "run: {dt: 1}", "\n\n# a\n\n", "a: 1\r\nb: 2\r\n", "a: 1\rb: 2\r", "a: 1\n\r",
        "# a\xc2\x85"
        "b: 1 # \xe2\x80\xa8" "c: 2\xe2\x80\xa9" "d: \xc2\xa0\xe2\x80\xa7", "#> a\n#> b", "---\na: 1\n...\n"};
    bt_case c = {0}, back = {0};
    bt_errors err = {0};
    assert_int_equal(read_text(&c, "run: {dt: 0.1, duration: 100}\nfloes: [{x: 9, y: 0, length: 1}]\n", &err),
                     BT_OK);
    char *resolved = bt_case_resolved(&c);
    for (size_t i = 0; i < sizeof given / sizeof *given; i++) {
        char *text = bt_case_with_comments(resolved, "# water.current_table: 3 bytes\n", given[i]);
        char *found = bt_case_given_in(text);
        assert_string_equal(found, given[i]);
        assert_int_equal(bt_case_itself_same("case.yml", text, "out", &err), BT_OK);
        assert_int_equal(read_text(&back, text, &err), BT_OK);
        char *same = bt_case_resolved(&back);
        assert_string_equal(same, resolved);
        bt_case_free(&back);
        free(same);
        free(found);
        free(text);
    }
    char *alone = bt_case_with_comments(resolved, NULL, NULL);
    assert_null(bt_case_given_in(alone));
    char *large = calloc(1, BT_MAX_TEXT_BYTES + 1); // with which the text could not be read
    assert_non_null(large);
    memset(large, '#', BT_MAX_TEXT_BYTES);
    char *without = bt_case_with_comments(resolved, NULL, large);
    assert_string_equal(without, alone);
    free(without);
    free(large);
    free(alone);
    free(resolved);
    bt_case_free(&c);
}

TEST_MAIN(make_folder, remove_folder)
