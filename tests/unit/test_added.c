// SPDX-License-Identifier: MIT
// A body shape and keys from outside the program: those of docs/how-to-add-a-body-shape.md and how-to-add-a-key.md.
//
// Red with (tried): the added shape taken for "none"; its name not in the list of body.shape; values read at the place
// of the key before; the unit of an added key ignored.
#include "scene.h"

#include <unistd.h>

#include "bergtow/case.h"
#include "bergtow/law_key.h"

#include "examples/body_shape.c"
#include "examples/key.c"

static bt_status read_text(bt_case *c, const char *text, bt_errors *err)
{
    char path[] = "/tmp/bergtow-added-XXXXXX";
    const int fd = mkstemp(path);
    assert_true(fd >= 0);
    FILE *f = fdopen(fd, "w");
    fprintf(f, "run: {dt: 0.1, duration: 1}\ndomain: {length: 40, width: 20}\nice: {concentration: 0}\n"
               "tow: {speed: 0.1}\n%s", text);
    assert_int_equal(fclose(f), 0);
    const bt_status status = bt_case_read(c, path, NULL, 0, err);
    unlink(path);
    return status;
}

TEST(a_shape_is_a_waterline)
{
    bt_case c;
    bt_errors err = {0};
    if (read_text(&c, "body: {shape: capsule, length: 6, width: 2, x: 10, yaw: 30 deg}\n", &err) != BT_OK)
        fail_msg("%s", err.text[0]);
    double v[2 * BT_MAX_VERTICES];
    const int n = bt_case_waterline(&c, v);
    assert_int_equal(n, 26);
    const bt_moments m = bt_shape_moments(n, v);
    // a polygon of 12 sides an end: (n/2π) sin(2π/n) of the circle's area with n = 24
    CHECK_CLOSE(m.area, 4 * 2 + 12 * sin(BT_PI / 12), 1e-12);
    CHECK_CLOSE(m.cx, 0, 1e-12);
    CHECK_CLOSE(bt_shape_width(n, v, 1, 0), 2, 1e-12);
    CHECK_CLOSE(bt_shape_width(n, v, 0, 1), 6, 1e-12);
    char *text = bt_case_resolved(&c);
    assert_non_null(strstr(text, "shape: capsule"));
    free(text);
    bt_case_free(&c);
}

TEST(unknown_shapes_are_reported)
{
    bt_case c;
    bt_errors err = {0};
    assert_int_equal(read_text(&c, "body: {shape: capsul, length: 6}\n", &err), BT_ERR_CASE);
    assert_non_null(strstr(err.text[0], "capsule"));
    bt_errors_free(&err);
}

static int line(double l, double w, double *v)
{
    (void)w;
    v[0] = 0, v[1] = 0, v[2] = l, v[3] = 0;
    return 2;
}

TEST(what_will_not_do_is_refused)
{
    const struct { const char *name; bt_shape_outline outline; const char *says; } bad[] = {
        {"ship", capsule, "this name is taken"}, {"capsule", capsule, "this name is taken"},
        {"none", capsule, "this name is taken"}, {"Big barge", capsule, "lower-case letters"},
        {"barge", NULL, "no function"},            {"stick", line, "it is not an outline"},
    };
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        bt_errors err = {0};
        assert_int_equal(bt_shape_register(bad[k].name, bad[k].outline, &err), BT_ERR_USAGE);
        if (err.n == 0 || !strstr(err.text[0], bad[k].says)) fail_msg("%s: %s", bad[k].says, err.n ? err.text[0] : "-");
        bt_errors_free(&err);
    }
}

TEST(a_key_is_a_key_of_the_case)
{
    bt_case c;
    bt_errors err = {0};
    if (read_text(&c, "body: {draft: 30 m, length: 2, x: 10}\npilot: {depth: 0.04 km}\n", &err) != BT_OK)
        fail_msg("%s", err.text[0]);
    CHECK_CLOSE(pilot_reserve(&c), 40 - 2 - 30, 1e-12);
    char *text = bt_case_resolved(&c);
    assert_non_null(strstr(text, "\npilot:\n  depth: 40 m"));
    free(text);
    bt_case_free(&c);
    assert_int_equal(read_text(&c, "pilot: {depth: -3 m}\n", &err), BT_ERR_CASE);
    assert_non_null(strstr(err.text[0], "pilot.depth"));
    bt_errors_free(&err);
    err = (bt_errors){0};
    assert_int_equal(read_text(&c, "pilot: {dept: 3 m}\n", &err), BT_ERR_CASE);
    assert_non_null(strstr(err.text[0], "depth"));
    bt_errors_free(&err);
}

/// What could not be read back from the resolved case is refused, and with it all keys of the call.
TEST(keys_that_cannot_be_read_back_are_refused)
{
    const struct { const char *section, *name, *doc, *says; } bad[] = {
        {"base", "x", "a key of the file", "no section is base"},
        {"floes", "x", "a key of the list", "no section is base or floes"},
        {"", "x", "a key of nothing", "SECTION.NAME"},
        {"mine", "[a", "a key of brackets", "SECTION.NAME"},
        {"mine", "x", "a key\nof two lines", "on one line"},
        {"mine", "x", "a key \x01 of control", "on one line"},
    };
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        const bt_law_key keys[] = {{"good", "m", "1", "[0, 2]", "a key that is good"},
                                   {bad[k].name, "m", "1", "[0, 2]", bad[k].doc}};
        bt_errors err = {0};
        assert_false(bt_keys_add(bad[k].section, keys, 2, &err));
        const char *last = err.n ? err.text[err.n - 1] : "-";
        if (!strstr(last, bad[k].says)) fail_msg("%s: %s", bad[k].says, last);
        bt_errors_free(&err);
    }
    bt_errors err = {0};
    assert_true(bt_keys_add("mine", &(bt_law_key){"good", "m", "1", "[0, 2]", "a key that is good"}, 1, &err));
    bt_errors_free(&err);
}

int main(void)
{
    bt_errors err = {0};
    if (bt_shape_register("capsule", capsule, &err) != BT_OK || !bt_keys_add("pilot", pilot_keys, N_PILOT_KEYS, &err))
        bt_errors_print(&err);
    return run_all_tests(NULL, NULL);
}
