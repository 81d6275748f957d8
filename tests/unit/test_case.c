// SPDX-License-Identifier: MIT
// Case files: the table of keys, defaults, every error at once with its line, overrides.
#include "base/largest.h"
#include "base/name.h"
#include "bergtow/shape.h"
#include "case/schema.h"
#include "case_text.h"


// ---- the table ----

TEST(every_preset_and_range_is_well_formed)
{
    const struct { const bt_key *keys; int n; size_t size; } tables[] = {
        {bt_case_keys, bt_n_case_keys, sizeof(bt_case)}, {bt_floe_keys, bt_n_floe_keys, sizeof(bt_floe_def)}};
    for (int t = 0; t < 2; t++) {
        char *space = bt_alloc(1, tables[t].size);
        for (int i = 0; i < tables[t].n; i++) {
            const bt_key *k = &tables[t].keys[i];
            bt_range r;
            char why[BT_WHY];
            if (!bt_value_range(k, &r)) fail_msg("%s: bad range %s", k->name, k->range);
            if ((k->type == BT_KEY_REAL || k->type == BT_KEY_INT) && !k->range) fail_msg("%s: no range", k->name);
            if (k->type != BT_KEY_POINTS && k->preset && k->preset[0] != '=' &&
                !bt_value_read(k, space, k->preset, true, why))
                fail_msg("%s: default %s: %s", k->name, k->preset, why);
            if (!k->doc || strlen(k->doc) < 8) fail_msg("%s: no sentence", k->name);
            if (strlen(k->name) > 60) fail_msg("%s: longer than the buffers of messages", k->name);
            for (int j = 0; j < i; j++) {
                if (!strcmp(k->name, tables[t].keys[j].name)) fail_msg("%s: twice in the table", k->name);
                if (k->offset == tables[t].keys[j].offset)
                    fail_msg("%s and %s: one member", k->name, tables[t].keys[j].name);
            }
        }
        bt_schema_release(tables[t].keys, tables[t].n, space);
        free(space);
    }
}

// Sections are contiguous in the table: the resolved file would open a section twice otherwise.
TEST(resolved_text_opens_each_section_once)
{
    bt_case c;
    bt_errors err = {0};
    if (read_text(&c, base, &err)) fail_with(&err, "the smallest case is refused");
    char *text = bt_case_resolved(&c);
    static const char *const sections[] = {"run", "domain", "ice",    "body",     "tow",      "water",
                                           "air", "solver", "output", "estimate", "reference"};
    for (size_t i = 0; i < sizeof sections / sizeof *sections; i++) {
        char line[32];
        snprintf(line, sizeof line, "\n%s:\n", sections[i]);
        char *first = strstr(text, line);
        if (!first || strstr(first + 1, line)) fail_msg("section %s stands not exactly once", sections[i]);
    }
    free(text);
    bt_case_free(&c);
}

TEST(defaults_are_the_documented_ones)
{
    bt_case c;
    bt_errors err = {0};
    if (read_text(&c, base, &err)) fail_with(&err, "the smallest case is refused");
    assert_true(c.run.dt == 0.1 && c.run.duration == 10);
    assert_true(c.domain.length == 72 && c.domain.width == 10 && c.domain.x0 == 0 && c.domain.y0 == -5);
    assert_true(c.ice.x_min == 0 && c.ice.x_max == 72 && c.ice.y_min == -5 && c.ice.y_max == 5);
    assert_true(c.ice.drag.water_skin == 5.5e-3 && c.body.drag.water_skin == 5e-4);
    assert_true(c.ice.drag.air_skin == 2e-3 && c.body.drag.air_skin == 2.5e-4);
    assert_true(c.body.friction == c.ice.friction && c.body.restitution == c.ice.restitution);
    assert_true(c.body.width == 2 && c.body.x == 4 && c.tow.mode == BT_TOW_SPEED && c.tow.speed == 0.13);
    assert_true(fabs(c.body.sail - 0.5 * (1027.0 / 900 - 1)) < 1e-15);
    assert_true(c.solver.warm_start && c.solver.max_sweeps == 500 && c.output.frame_interval == 10.0 / 200);
    assert_true(isnan(c.reference.mean_force) && !c.reference.source && !c.ice.field && !c.n_floes);
    // the foremost point of a disc of length 2 lies near (1, 0)
    assert_true(fabs(c.tow.hull_x - 1) < 0.01 && fabs(c.tow.hull_y) < 0.06);
    bt_case_free(&c);
}

TEST(a_geographic_domain_lies_about_the_origin)
{
    bt_case c;
    bt_errors err = {0};
    if (read_text(&c,
                  "run: {dt: 1, duration: 10}\ndomain: {frame: geographic, length: 2 km, width: 1 km, ends: open, "
                  "sides: open}\nice: {concentration: 0.8, size: 30 m, thickness: 1}\nbody: {length: 2, draft: 0.5}\n"
                  "tow: {speed: 0.1}\n",
                  &err))
        fail_with(&err, "refused");
    assert_true(c.domain.x0 == -1000 && c.domain.y0 == -500 && c.body.x == 0);
    bt_case_free(&c);
}

TEST(every_key_is_listed)
{
    char *text = NULL;
    size_t size;
    FILE *f = open_memstream(&text, &size);
    bt_case_list_keys(f);
    fclose(f);
    for (int i = 0; i < bt_n_case_keys; i++) {
        char line[80];
        snprintf(line, sizeof line, "\n%s ", bt_case_keys[i].name);
        if (!strstr(text, line) || !strstr(text, bt_case_keys[i].doc))
            fail_msg("%s is not listed", bt_case_keys[i].name);
    }
    free(text);
}

TEST(suggestions_are_near_or_absent)
{
    char buffer[64];
    assert_int_equal(bt_suggest_distance("speed", "sped", 9), 1);
    assert_int_equal(bt_suggest_distance("speed", "spede", 9), 1);
    assert_int_equal(bt_suggest_distance("kitten", "sitting", 9), 3);
    assert_int_equal(bt_suggest_distance("", "abc", 9), 3);
    assert_int_equal(bt_suggest_distance("", "abc", 3), 64);
    static const struct {
        const char *typed, *meant;
    } words[] = {{"tow.sped", "tow.speed"},
                 {"run.seed", "ice.seed"},
                 {"toww", "tow"},
                 {"ice.drags.water_form", "ice.drag.water_form"},
                 {"floe", "floes"},
                 {"ice.darg", "ice.drag"},
                 {"concentration", "ice.concentration"}};
    for (size_t i = 0; i < sizeof words / sizeof *words; i++) {
        const char *near = bt_schema_suggest(bt_case_keys, bt_n_case_keys, words[i].typed, buffer);
        if (!near || strcmp(near, words[i].meant))
            fail_msg("%s: suggested %s, not %s", words[i].typed, near ? near : "nothing", words[i].meant);
    }
    assert_null(bt_schema_suggest(bt_case_keys, bt_n_case_keys, "banana", buffer));
}

// ---- reading ----

TEST(values_land_in_their_members)
{
    bt_case c;
    bt_errors err = {0};
    const char *text =
        "run:\n  dt: 10 ms\n  duration: 2 min\n  title: \"a: b # c\"\n"
        "ice:\n  concentration: 50 %\n  drag: {water_form: 0.7}\n  seed: 9007199254740993\n"
        "body:\n  shape: polygon\n  vertices: [[0, 0], [200 cm, 0], [2, 1], [0, 1]]\n  x: 5\n  yaw: 90\n  mass: 15.5 "
        "t\n"
        "tow: {mode: line, speed: 0.5 kn, line_stiffness: 50 kN}\n"
        "solver.warm_start: off\n"
        "floes:\n  - {x: 20, y: 1, length: 1 m, yaw: 45 deg}\n"
        "  - {shape: rectangle, x: 30, y: 0, length: 2, width: 1, thickness: 5 cm, vx: -0.1}\n"
        "  - {shape: square, x: 40, y: 0, length: 2, fixed: true}\n";
    if (read_text(&c, text, &err)) fail_with(&err, "refused");
    assert_true(c.run.dt == 0.01 && c.run.duration == 120);
    assert_string_equal(c.run.title, "a: b # c");
    assert_true(c.ice.concentration == 0.5 && c.ice.drag.water_form == 0.7);
    assert_true(c.ice.seed == 9007199254740993); // not representable as a double
    assert_true(c.body.shape == BT_BODY_POLYGON && c.body.n_vertices == 4 && c.body.vertices[2] == 2 &&
                c.body.mass == 15500);
    assert_true(c.body.yaw == BT_PI / 2 && c.tow.mode == BT_TOW_LINE && c.tow.speed == 0.5 * 1852 / 3600 &&
                c.tow.line_stiffness == 5e4);
    assert_false(c.solver.warm_start);
    assert_int_equal(c.n_floes, 3);
    assert_true(c.floes[0].width == 1 && c.floes[0].thickness == 0.04 && c.floes[0].yaw == BT_PI / 4 &&
                !c.floes[0].fixed);
    assert_true(c.floes[1].shape == BT_BODY_RECTANGLE && c.floes[1].thickness == 0.05 && c.floes[1].vx == -0.1 &&
                !c.floes[1].fixed && c.floes[2].fixed);
    assert_int_equal(c.floes[1].line, 19);
    // the tow points along +x and the body's x along +y: the flat side at body y = -0.5 leads, and its middle is taken
    assert_true(fabs(c.tow.hull_x) < 1e-12 && fabs(c.tow.hull_y + 0.5) < 1e-12);
    double v[2 * BT_MAX_VERTICES];
    assert_int_equal(bt_case_floe_outline(&c.floes[1], v), 4);
    assert_true(bt_case_body_mass(&c) == 15500);
    bt_case_free(&c);
}

TEST(all_errors_come_at_once_with_their_lines)
{
    bt_case c;
    bt_errors err = {0};
    const char *text = "run:\n"
                       "  dt: 0.1 x\n"           // 2
                       "tow:\n"
                       "  sped: 1\n"             // 4
                       "  speed: 3 kN\n"         // 5
                       "ice:\n"
                       "  concentration: 1.2\n"  // 7
                       "  thickness: -1 m\n"     // 8
                       "  seed: 1.5\n"           // 9
                       "  shape: voronoy\n"      // 10
                       "  drag:\n"
                       "    water_form: .nan\n"  // 12
                       "  size: [1, 2]\n"        // 13
                       "  friction:\n"           // 14
                       "solver:\n"
                       "  warm_start: maybe\n"   // 16
                       "body:\n"
                       "  vertices: [[0, 0], [1, 0], [1]]\n" // 18
                       "iec:\n"                  // 19
                       "  size: 3\n"
                       "water: 3\n"              // 21
                       "seed: 3\n"               // 22
                       "floes:\n"
                       "  - {x: 1, y: 1, lenght: 1 m}\n" // 24
                       "  - 7\n";                // 25
    assert_int_equal(read_text(&c, text, &err), BT_ERR_CASE);
    static const char *const wanted[] = {
        "a.yml:2: run.dt: \"x\" is not a unit of time",
        "run.duration: missing",
        "a.yml:4: tow.sped: unknown key; did you mean tow.speed?",
        "a.yml:5: tow.speed: kN is the unit of a force",
        "a.yml:7: ice.concentration: 1.2 is out of range",
        "a.yml:8: ice.thickness: -1 m is out of range",
        "a.yml:9: ice.seed: \"1.5\" is not a whole number",
        "a.yml:10: ice.shape: \"voronoy\" is not one of voronoi, rectangles, polygons; did you mean voronoi?",
        "a.yml:12: ice.drag.water_form: \".nan\" is not a number",
        "a.yml:13: ice.size: is a list",
        "a.yml:14: ice.friction: has no value",
        "a.yml:16: solver.warm_start: \"maybe\" is neither true nor false",
        "a.yml:18: body.vertices: point 3 is not a pair",
        "a.yml:19: iec: unknown key; did you mean ice?",
        "a.yml:21: water: is a section",
        "a.yml:22: seed: unknown key; did you mean ice.seed?",
        "a.yml:24: floes[0].lenght: unknown key; did you mean length?",
        "a.yml:25: floes[1]: is not a map"};
    size_t n = sizeof wanted / sizeof *wanted;
    for (size_t i = 0; i < n; i++)
        if (!has(&err, wanted[i])) fail_with(&err, wanted[i]);
    if (err.n != n) fail_with(&err, "more messages than errors");
    for (size_t i = 0; i < err.n; i++)
        if (!strchr(err.text[i], ';')) fail_with(&err, err.text[i]);
    bt_errors_free(&err);
    bt_case_free(&c);
}

TEST(refuses_yaml_beyond_maps_lists_and_scalars)
{
    static const struct { const char *text, *fragment;
    } bad[] = {
        {"run: {dt: 0.1, duration: 10}\nice: {size: 1}\nice: {size: 2}\n",
         "a.yml:3: ice: duplicate key, first given in line 2"},
        {"run:\n  dt: 0.1\n  duration: 10\n  dt: 0.2\n", "a.yml:4: dt: duplicate key, first given in line 2"},
        {"run: {dt: 0.1, duration: 10}\nrun.dt: 0.2\n", "a.yml:2: run.dt: duplicate key, first given in line 1"},
        {"run: &a {dt: 0.1, duration: 10}\n", "a.yml:1: anchors"},
        {"run: {dt: 0.1, duration: 10}\nice: *a\n", "a.yml:2: "},
        {"run: !!map {dt: 0.1}\n", "tags (!)"},
        {"run: {dt: 0.1, duration: 10}\n---\nrun: 3\n", "a.yml:2: a second document"},
        {"run: {dt: 0.1\n", "not valid YAML"},
        {"run:\n\tdt: 1\n", "a.yml:2: not valid YAML"},
        {"", "holds no keys"},
        {"# nothing\n", "holds no keys"},
        {"- 1\n- 2\n", "is not a case: the file holds a list"},
        {"hello", "is not a case: the file holds a single text"},
        {"[[[[[[[[[[[[[[[[[[[[1]]]]]]]]]]]]]]]]]]]]", "nested deeper"},
        {"{[a]: 1}", "a key must be a word"},
        {"run: {dt: 0.1, duration: 10, title: \"a\\0b\"}\n", "NUL"},
        {"\xff\xfe\x01", "not UTF-8"},
        {"run: \"\x01\"", "not UTF-8"},
        {"floes: 3\nrun: {dt: 0.1, duration: 10}\n", "a.yml:1: floes: is not a list"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        bt_case c;
        bt_errors err = {0};
        if (read_text(&c, bad[i].text, &err) != BT_ERR_CASE) fail_msg("accepted:\n%s", bad[i].text);
        if (!has(&err, bad[i].fragment)) fail_with(&err, bad[i].fragment);
        bt_errors_free(&err);
        bt_case_free(&c);
    }
}

TEST(sizes_of_the_input_are_limited)
{
    bt_case c;
    bt_errors err = {0};
    size_t n = (size_t)17 << 20;
    char *text = bt_alloc(n, 1);
    memset(text, '\n', n);
    memcpy(text, base, strlen(base));
    write_bytes(text, n);
    assert_int_equal(bt_case_read(&c, path, NULL, 0, &err), BT_ERR_CASE);
    assert_true(has(&err, "larger than 16 MiB"));
    bt_case_free(&c);
    bt_errors_free(&err);

    size_t used = (size_t)snprintf(text, n, "%sfloes: [", base);
    for (int i = 0; i <= BT_MAX_FLOES_BY_HAND; i++)
        used += (size_t)snprintf(text + used, n - used, "{x: 9, y: 0, length: 1},");
    snprintf(text + used, n - used, "]\n");
    assert_int_equal(read_text(&c, text, &err), BT_ERR_CASE);
    assert_true(has(&err, "a.yml:2: floes: has 10001 entries"));
    bt_case_free(&c);
    bt_errors_free(&err);
    free(text);
}

TEST(a_missing_file_and_a_folder_are_input_errors)
{
    bt_case c;
    bt_errors err = {0};
    assert_int_equal(bt_case_read(&c, "/nonexistent/a.yml", NULL, 0, &err), BT_ERR_IO);
    assert_true(has(&err, "/nonexistent/a.yml: cannot be read: No such file"));
    bt_case_free(&c);
    assert_int_equal(bt_case_read(&c, folder, NULL, 0, &err), BT_ERR_IO);
    assert_true(has(&err, "is a folder"));
    bt_case_free(&c);
    bt_errors_free(&err);
}

TEST(overrides_replace_the_file_and_are_named_in_errors)
{
    bt_case c;
    bt_errors err = {0};
    const char *text = "run: {dt: 0.1}\nice: {size: 1 kN, concentration: 0.2}\n";
    const char *good[] = {
        "run.duration=5 s", "ice.size=2 m",       "ice.concentration=30 %",           "ice.concentration=0.4",
        "run.title=a: [b",  "body.shape=polygon", "body.vertices=[[0,0],[2,0],[0,2]]"};
    if (read_text_with(&c, text, good, 7, &err)) fail_with(&err, "refused");
    assert_true(c.run.duration == 5 && c.ice.size == 2 && c.ice.concentration == 0.4 && c.body.n_vertices == 3);
    assert_string_equal(c.run.title, "a: [b");
    bt_case_free(&c);

    const char *bad[] = {"tow.sped=1",         "tow=3",
                         "ice.size",           "=3",
                         "ice.thickness=0.8x", "run.dt=",
                         "floes=[]",           "body.vertices=[[0,0],[1",
                         "tow.speed=60",       "run.duration=0.05",
                         "run.title=\xff"};
    assert_int_equal(read_text_with(&c, base, bad, 11, &err), BT_ERR_CASE);
    static const char *const wanted[] = {"--set tow.sped=1: unknown key; did you mean tow.speed?",
                                         "--set tow=3: tow is a section",
                                         "--set ice.size: is not key=value",
                                         "--set =3: is not key=value",
                                         "--set ice.thickness=0.8x: \"x\" is not a unit",
                                         "--set run.dt=: has no value",
                                         "--set floes=[]: the list of floes cannot be set",
                                         "--set body.vertices=[[0,0],[1:2: not valid YAML",
                                         "--set tow.speed=60: 60 is out of range",
                                         "not UTF-8"};
    for (size_t i = 0; i < sizeof wanted / sizeof *wanted; i++)
        if (!has(&err, wanted[i])) fail_with(&err, wanted[i]);
    if (err.n != sizeof wanted / sizeof *wanted)
        fail_with(&err, "run.dt was refused: nothing may be said about its relation to run.duration");
    bt_errors_free(&err);
    bt_case_free(&c);

    // a check across keys names the override, too
    const char *longer[] = {"run.dt=20"};
    assert_int_equal(read_text_with(&c, base, longer, 1, &err), BT_ERR_CASE);
    if (!has(&err, "--set run.dt=20: 20 s is more than run.duration")) fail_with(&err, "cross check");
    bt_errors_free(&err);
    bt_case_free(&c);
}

TEST_MAIN(make_folder, remove_folder)
