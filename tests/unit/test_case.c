// SPDX-License-Identifier: MIT
// Case files: defaults, every error at once with its line, overrides, cross checks, and the resolved file.
#include "bergtow/case.h"
#include "bergtow/shape.h"
#include "case/case_check.h"
#include "base/largest.h"
#include "case/schema.h"
#include "base/suggest.h"
#include "case/value.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

static char folder[] = "/tmp/bt_test_case_XXXXXX";
static char path[64];

static int make_folder(void **state)
{
    (void)state;
    if (!mkdtemp(folder)) return -1;
    snprintf(path, sizeof path, "%s/a.yml", folder);
    return 0;
}

static int remove_folder(void **state)
{
    (void)state;
    remove(path);
    return rmdir(folder);
}

static void write_bytes(const char *text, size_t n)
{
    FILE *f = fopen(path, "wb");
    assert_non_null(f);
    assert_int_equal(fwrite(text, 1, n, f), n);
    assert_int_equal(fclose(f), 0);
}

static bt_status read_text_with(bt_case *c, const char *text, const char *const *set, int n, bt_errors *err)
{
    write_bytes(text, strlen(text));
    return bt_case_read(c, path, set, n, err);
}

static bt_status read_text(bt_case *c, const char *text, bt_errors *err)
{
    return read_text_with(c, text, NULL, 0, err);
}

static void fail_with(const bt_errors *err, const char *what)
{
    for (size_t i = 0; i < err->n; i++) print_message("  message: %s\n", err->text[i]);
    fail_msg("%s", what);
}

static bool has(const bt_errors *err, const char *fragment)
{
    for (size_t i = 0; i < err->n; i++)
        if (strstr(err->text[i], fragment)) return true;
    return false;
}

static const char base[] = "run: {dt: 0.1, duration: 10}\n";

// ---- the table ----

static void every_preset_and_range_is_well_formed(void **state)
{
    (void)state;
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
static void resolved_text_opens_each_section_once(void **state)
{
    (void)state;
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

static void defaults_are_the_documented_ones(void **state)
{
    (void)state;
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

static void a_geographic_domain_lies_about_the_origin(void **state)
{
    (void)state;
    bt_case c;
    bt_errors err = {0};
    if (read_text(&c,
                  "run: {dt: 1, duration: 10}\ndomain: {frame: geographic, length: 2 km, width: 1 km}\nice: "
                  "{concentration: 0.8, size: 30 m, thickness: 1}\nbody: {length: 2, draft: 0.5}\n",
                  &err))
        fail_with(&err, "refused");
    assert_true(c.domain.x0 == -1000 && c.domain.y0 == -500 && c.body.x == 0);
    bt_case_free(&c);
}

// ---- reading ----

static void values_land_in_their_members(void **state)
{
    (void)state;
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
        "  - {shape: rectangle, x: 30, y: 0, length: 2, width: 1, thickness: 5 cm, vx: -0.1, fixed: true}\n";
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
    assert_int_equal(c.n_floes, 2);
    assert_true(c.floes[0].width == 1 && c.floes[0].thickness == 0.04 && c.floes[0].yaw == BT_PI / 4 &&
                !c.floes[0].fixed);
    assert_true(c.floes[1].shape == BT_BODY_RECTANGLE && c.floes[1].thickness == 0.05 && c.floes[1].vx == -0.1 &&
                c.floes[1].fixed);
    assert_int_equal(c.floes[1].line, 19);
    // the tow points along +x and the body's x along +y: the flat side at body y = -0.5 leads, and its middle is taken
    assert_true(fabs(c.tow.hull_x) < 1e-12 && fabs(c.tow.hull_y + 0.5) < 1e-12);
    double v[2 * BT_MAX_VERTICES];
    assert_int_equal(bt_case_floe_outline(&c.floes[1], v), 4);
    assert_true(bt_case_body_mass(&c) == 15500);
    bt_case_free(&c);
}

static void all_errors_come_at_once_with_their_lines(void **state)
{
    (void)state;
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

static void refuses_yaml_beyond_maps_lists_and_scalars(void **state)
{
    (void)state;
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

static void sizes_of_the_input_are_limited(void **state)
{
    (void)state;
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

static void a_missing_file_and_a_folder_are_input_errors(void **state)
{
    (void)state;
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

static void overrides_replace_the_file_and_are_named_in_errors(void **state)
{
    (void)state;
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
    if (!has(&err, "--set run.dt=20: 20 s is longer than run.duration")) fail_with(&err, "cross check");
    bt_errors_free(&err);
    bt_case_free(&c);
}

// ---- checks across keys ----

static void cross_checks_refuse(void **state)
{
    (void)state;
    static const struct { const char *set, *fragment;
    } bad[] = {
        {"run.dt=11", "--set run.dt=11: 11 s is longer than run.duration"},
        {"run.dt=1e-9", "steps of run.duration"},
        {"output.frame_interval=1e-6", "frames, at most"},
        {"output.window_start=10", "not before the end of the run"},
        {"body.shape=square;body.length=11", "spans 11 m along y in a domain of 10 m"},
        {"body.x=0.5", "is outside the domain"},
        {"body.y=4.5", "is outside the domain"},
        {"body.x=100", "is outside the domain"},
        {"ice.x_min=80", "the ice region is empty"},
        {"ice.x_max=73", "outside the domain, which ends at 72 m"},
        {"ice.y_min=-6", "outside the domain, which begins at -5 m"},
        {"ice.x_min=-1", "outside the domain"},
        {"ice.y_max=6", "outside the domain"},
        {"ice.size=11", "larger than the ice region"},
        {"ice.size=1 mm", "floes, at most 20000000"},
        {"ice.size_law=power", "needs a smallest size"},
        {"ice.size_min=3;ice.size_max=2", "is not below ice.size_max"},
        {"ice.size_law=power;ice.size_min=2;ice.size_max=20", "ice.size_max=20: 20 m is larger"},
        {"ice.size_law=lognormal;ice.size_min=2;ice.size_max=3", "not between"},
        {"domain.ends=periodic;domain.ends_closing=0.1", "needs a wall to move"},
        {"domain.sides=open;domain.sides_closing=0.1", "needs a wall to move"},
        {"domain.sides_closing=1", "brings the walls together after 5 s"},
        {"tow.mode=line;tow.line_length=0", "needs a line"},
        {"tow.mode=line;tow.line_stiffness=0", "needs a stiffness"},
        {"body.shape=none;tow.mode=speed", "no body to tow"},
        {"tow.mode=none;tow.speed=1", "has no effect with tow.mode: none"},
        {"body.vx=1", "has no effect with tow.mode: speed"},
        {"body.shape=square;tow.speed=10", "a wall stands after 67 m"},
        {"body.shape=square;tow.direction=90;tow.speed=1", "a wall stands after 4 m"},
        {"body.shape=square;tow.direction=180;tow.speed=1", "a wall stands after 3 m"},
        {"body.shape=polygon", "body.vertices: is missing"},
        {"body.vertices=[[0,0],[1,0],[0,1]]", "the shape is not polygon"},
        {"body.shape=polygon;body.vertices=[[0,0],[0,1],[1,0]]", "the waterline is refused"},
        {"body.shape=square;body.width=1", "the shape is square"},
        {"water.tilt=geostrophic", "needs the Coriolis force"},
        {"water.slope_x=0.001", "has no effect without water.tilt"},
        {"tow.programme=[[0,1],[5,2],[5,0]]", "point 3 is at 5 s, not after the one before"},
        {"tow.programme=[[0,1],[5,60]]", "point 2: 60 is out of range; give a value in [0, 50] m/s"},
        {"tow.programme=[[0 m,1]]", "point 1: m is the unit of a length and this is a time"},
        {"tow.programme=[[0,0],[5,1]];tow.speed=2", "has no effect with tow.programme, whose largest speed is 1 m/s"},
        {"tow.programme=[[0,0],[5,1]];tow.ramp=4", "reaches its largest speed at 5 s"},
        {"tow.mode=none;tow.programme=[[0,1]]", "has no effect with tow.mode: none"},
        {"body.shape=square;tow.programme=[[0,8],[10,8]]", "a wall stands after 67 m; shorten the run to 8.37 s"},
        {"tow.waypoints=[]", "has 0 points"},
        {"tow.waypoints=[[9,0],[9,0]]", "way-point 2 is where the one before it"},
        {"tow.turn_radius=3", "no effect without tow.waypoints"},
        {"tow.waypoints=[[20,0],[20,2]];tow.turn_radius=3", "leaves no room for a turn"},
        {"tow.waypoints=[[20,0]];tow.direction=10", "is not the direction from the body to the first way-point"},
        {"tow.mode=line;tow.waypoints=[[9,0]]", "is not ahead of where the towing end starts, (10"},
        {"tow.waypoints=[[6,0],[6,10]];tow.speed=1", "into a wall after"},
        {"domain.ends=moving;tow.waypoints=[[40,0],[41,3]]", "the leg from way-point 1 leads 71.5651 deg from x"},
        {"tow.mode=none;tow.waypoints=[[9,0]]", "have no effect with tow.mode: none"},
        {"tow.mode=line;tow.line.type=dyneema", "a named line needs a diameter"},
        {"tow.mode=line;tow.line.diameter=0.1", "has no effect without a named line"},
        {"tow.mode=line;tow.line.branches=2;tow.branch2.length=0.9", "do not both reach the middle"},
        {"tow.mode=thrust", "tow.vessel.mass: is 0 and tow.mode thrust needs it"},
        {"tow.mode=thrust;tow.vessel.mass=1;tow.vessel.bollard_pull=1;tow.vessel.free_resistance=2",
         "thrust does not grow with speed"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        char copy[128];
        const char *set[8];
        int n = 0;
        snprintf(copy, sizeof copy, "%s", bad[i].set);
        for (char *part = strtok(copy, ";"); part; part = strtok(NULL, ";")) set[n++] = part;
        bt_case c;
        bt_errors err = {0};
        if (read_text_with(&c, base, set, n, &err) != BT_ERR_CASE) fail_msg("accepted: %s", bad[i].set);
        if (!has(&err, bad[i].fragment)) fail_with(&err, bad[i].fragment);
        bt_errors_free(&err);
        bt_case_free(&c);
    }
}

static void cross_checks_let_pass(void **state)
{
    (void)state;
    static const char *const good[] = {
        "tow.speed=6.7", // 6.7 × (10 − 2.5) = 50 m of 67 m: the ramp counts
        "domain.ends=open;tow.speed=50",
        "domain.ends=periodic;tow.speed=50",
        "tow.mode=none",
        "body.shape=none",
        "tow.mode=line;body.vx=1",
        "tow.speed=0",
        "ice.concentration=0;ice.size=1 mm",
        "domain.sides=open;body.length=11;body.x=12",
        "domain.sides_closing=0.4",
        "body.vertices=none",
        "body.x=none",
        "domain.length=0.3;domain.x0=-0.1;ice.x_max=0.2;body.shape=none;ice.size=0.1",
        "ice.size_law=power;ice.size_min=0.5;ice.size_max=5",
        "water.tilt=geostrophic;water.latitude=75",
        "tow.programme=[[0,8],[10,0]]",
        "tow.programme=[[0,0],[1,7],[8,7]];tow.speed=7;tow.ramp=1",
        "tow.waypoints=[[20,0],[40,3]];tow.direction=0;tow.turn_radius=10",
        "tow.mode=line;tow.waypoints=[[11,0],[9,0]]",
        "tow.mode=line;tow.line.branches=2;tow.branch2.length=5.5",
        "tow.mode=line;tow.line.type=steel-wire;tow.line.diameter=20 mm",
        "tow.mode=thrust;tow.vessel.mass=1 t;tow.vessel.bollard_pull=1 kN;tow.vessel.free_speed=2;tow.speed=50",
    };
    for (size_t i = 0; i < sizeof good / sizeof *good; i++) {
        char copy[128];
        const char *set[8];
        int n = 0;
        snprintf(copy, sizeof copy, "%s", good[i]);
        for (char *part = strtok(copy, ";"); part; part = strtok(NULL, ";")) set[n++] = part;
        bt_case c;
        bt_errors err = {0};
        if (read_text_with(&c, base, set, n, &err)) fail_with(&err, good[i]);
        if (c.tow.mode == BT_TOW_NONE) assert_true(c.tow.speed == 0);
        if (c.body.shape == BT_BODY_ABSENT) assert_true(c.tow.mode == BT_TOW_NONE && bt_case_body_mass(&c) == 0);
        assert_true(bt_case_reference_speed(&c) > 0);
        bt_case_free(&c);
    }
}

static void floes_by_hand_are_checked(void **state)
{
    (void)state;
    static const struct { const char *floe, *fragment;
    } bad[] = {
        {"{x: 1, length: 1}", "a.yml:2: floes[0].y: missing"},
        {"{x: 5, y: 0}", "a.yml:2: floes[0]: has no length"},
        {"{x: 71.8, y: 0, length: 1}", "outside the domain in x"},
        {"{x: 9, y: 6, length: 1}", "outside the domain in y"},
        {"{x: 9, y: 0, shape: polygon}", "has shape polygon and no vertices"},
        {"{x: 9, y: 0, shape: none}", "did you mean"},
        {"{x: 9, y: 0, length: 1, vertices: [[0,0],[1,0],[0,1]]}", "the shape is not polygon"},
        {"{x: 9, y: 0, shape: polygon, vertices: [[0,0],[2,0],[1,0.1],[0,2]]}", "outline is refused"},
        {"{x: 9, y: 0, length: 1, x: 2}", "duplicate key"},
        {"{x: 9, y: 0, length: 0}", "out of range"},
        {"{x: 9, y: 0, shape: polygon, vertices: [[0,0],[1,0]]}", "has 2 points"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        char text[256];
        bt_case c;
        bt_errors err = {0};
        snprintf(text, sizeof text, "%sfloes: [%s]\n", base, bad[i].floe);
        if (read_text(&c, text, &err) != BT_ERR_CASE) fail_msg("accepted: %s", bad[i].floe);
        if (i != 5 && !has(&err, bad[i].fragment)) fail_with(&err, bad[i].fragment);
        if (err.n != 1) fail_with(&err, bad[i].floe);
        bt_errors_free(&err);
        bt_case_free(&c);
    }
    char text[256];
    bt_case c;
    bt_errors err = {0};
    snprintf(text, sizeof text, "%sfloes: [{x: 71.8, y: 0, length: 1, fixed: true}]\n", base);
    if (read_text(&c, text, &err)) fail_with(&err, "a fixed body may stand in a wall");
    bt_case_free(&c);
}

// The tow end after time t against the integral of its speed.
static void tow_distance_is_the_integral_of_the_ramped_speed(void **state)
{
    (void)state;
    bt_case c;
    bt_case_defaults(&c);
    c.tow.speed = 0.7;
    c.tow.ramp = 3;
    double way = 0, dt = 1e-4;
    for (int i = 0; i < 80000; i++) {
        way += dt * c.tow.speed * bt_min(1, (i + 0.5) * dt / c.tow.ramp);
        if (i % 9999 == 0) assert_true(fabs(bt_case_tow_distance(&c, (i + 1) * dt) - way) < 1e-9);
    }
    bt_case_free(&c);
}

// Expected number of floes of a power law against a sum over a fine histogram of N(>d) ~ d^-a.
static void expected_floes_of_a_power_law(void **state)
{
    (void)state;
    bt_case c;
    bt_errors err = {0};
    const char *set[] = {"ice.size_law=power",    "ice.size_min=0.5", "ice.size_max=5",
                         "ice.concentration=0.5", "body.shape=none",  ""};
    static const char *const exponents[] = {"ice.size_exponent=1.5", "ice.size_exponent=2", "ice.size_exponent=2.5"};
    for (int e = 0; e < 3; e++) {
        set[5] = exponents[e];
        if (read_text_with(&c, base, set, 6, &err)) fail_with(&err, "refused");
        double a = c.ice.size_exponent, count = 0, area = 0;
        for (int i = 0; i < 100000; i++) {
            double d0 = 0.5 + 4.5 * i / 100000, d1 = 0.5 + 4.5 * (i + 1) / 100000, d = (d0 + d1) / 2,
                   n = pow(d0, -a) - pow(d1, -a);
            count += n;
            area += n * BT_PI / 4 * d * d;
        }
        double want = 0.5 * 720 * count / area;
        assert_true(fabs(bt_case_expected_floes(&c) / want - 1) < 1e-6);
        bt_case_free(&c);
    }
}

static void steps_do_not_gain_one_by_round_off(void **state)
{
    (void)state;
    bt_case c;
    bt_case_defaults(&c);
    c.run.duration = 450, c.run.dt = 0.1;
    assert_true(bt_case_steps(&c) == 4500);
    c.run.duration = 0.3, c.run.dt = 0.1; // the quotient is 2.9999999999999996
    assert_true(bt_case_steps(&c) == 3);
    c.run.duration = 2.1, c.run.dt = 0.3; // the quotient is 7.000000000000001
    assert_true(bt_case_steps(&c) == 7);
    c.run.duration = 1e7, c.run.dt = 0.01;
    assert_true(bt_case_steps(&c) == 1000000000);
    c.run.duration = 1, c.run.dt = 0.3;
    assert_true(bt_case_steps(&c) == 4);
    bt_case_free(&c);
}

// ---- the resolved file ----

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
static void resolved_file_reads_back_to_the_same_bits(void **state)
{
    (void)state;
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
static void resolved_text_of_the_resolved_text_is_identical(void **state)
{
    (void)state;
    static const char *const texts[] = {
        "run: {dt: 0.1, duration: 100}\nice: {field: some.h5}\n",
        "run: {dt: 0.3, duration: 100}\nbody: {shape: none}\n",
        "run: {dt: 0.1, duration: 100}\ntow: {mode: none}\nbody: {shape: ship, length: 4.1, width: 1.3, yaw: 33, vx: "
        "0.1}\n",
        "run: {dt: 1, duration: 100}\ndomain: {frame: geographic, length: 1 nmi, width: 0.7 km, sides: open}\nice: "
        "{concentration: 0.8, size: 33.3, thickness: 0.04}\nbody: {length: 2, draft: 0.5}\n",
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

static void every_key_is_listed(void **state)
{
    (void)state;
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

static void suggestions_are_near_or_absent(void **state)
{
    (void)state;
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_preset_and_range_is_well_formed),
        cmocka_unit_test(resolved_text_opens_each_section_once),
        cmocka_unit_test(defaults_are_the_documented_ones),
        cmocka_unit_test(a_geographic_domain_lies_about_the_origin),
        cmocka_unit_test(values_land_in_their_members),
        cmocka_unit_test(all_errors_come_at_once_with_their_lines),
        cmocka_unit_test(refuses_yaml_beyond_maps_lists_and_scalars),
        cmocka_unit_test(sizes_of_the_input_are_limited),
        cmocka_unit_test(a_missing_file_and_a_folder_are_input_errors),
        cmocka_unit_test(overrides_replace_the_file_and_are_named_in_errors),
        cmocka_unit_test(cross_checks_refuse),
        cmocka_unit_test(cross_checks_let_pass),
        cmocka_unit_test(floes_by_hand_are_checked),
        cmocka_unit_test(tow_distance_is_the_integral_of_the_ramped_speed),
        cmocka_unit_test(expected_floes_of_a_power_law),
        cmocka_unit_test(steps_do_not_gain_one_by_round_off),
        cmocka_unit_test(resolved_file_reads_back_to_the_same_bits),
        cmocka_unit_test(resolved_text_of_the_resolved_text_is_identical),
        cmocka_unit_test(every_key_is_listed),
        cmocka_unit_test(suggestions_are_near_or_absent),
    };
    return cmocka_run_group_tests_name("case", tests, make_folder, remove_folder);
}
