// SPDX-License-Identifier: MIT
// Checkpoints: a run that is taken up after a step goes on to the same bits; what is read is refused unless it is
// what was written.
//
// Each case runs once and keeps its state and its sample after every step. Then a new world is made from the state
// after every other step n, does LATER steps, and must have the same state (all of it, not only poses) and the same
// sample after each of them. What turns this red (tried): a member that the tables leave out: labels of the floes,
// whether they are due to be renewed, the largest margin, impulses, friction and features of contacts, the tow line's
// impulse, what is broken, the vessel's way, home.copy, open collisions.
#include <unistd.h>

#include "test.h"
#include "output/checkpoint.h"
#include "law_number.h"
#include "loads/impact.h"
#include "output/observe.h"
#include "run/setup.h"
#include "space/cells.h"
#include "tow/tow.h"
#include "step/window.h"
#include "base/checksum.h"
#include "base/snapshot.h"
#include "snapshot_file.h"
#include "output/state.h"

static char folder[] = "/tmp/bergtow-checkpoint-XXXXXX";

static char *in_folder(const char *name)
{
    static char path[4][128];
    static int which;
    which = (which + 1) % 4;
    snprintf(path[which], sizeof path[which], "%s/%s", folder, name);
    return path[which];
}

static void write_file(const char *name, const char *text)
{
    FILE *f = fopen(in_folder(name), "w");
    assert_non_null(f);
    assert_true(fputs(text, f) >= 0);
    assert_int_equal(fclose(f), 0);
}

enum { LATER = 3 };

// What each case must show in its steps, or it tests nothing.
enum {
    LINE_PULLS = 1,
    BREAKS = 2,
    RENEWS = 4,
    CRUSHES = 8,
    COLLIDES = 16,
    PARTS = 32,
    WRAPS = 64,
    RELABELS = 128,
    RESTS = 256,
    WAYPOINT = 512,
    RAFTS = 1024
};

static const struct scenario {
    const char *name, *text;
    int from, steps;       ///< the first steps are not looked at
    int shows;
} scenarios[] = {
    {"basin on a line",
     "run: {dt: 0.1, duration: 18}\n"
     "domain: {length: 14, width: 6}\n"
     "ice: {concentration: 0.8, size: 0.8, friction: 0.35}\n"
     "body: {length: 2, x: 2}\n"
     "tow: {mode: line, speed: 0.3, ramp: 1, line_length: 4}\n"
     "solver: {cell_size: 2.5}\n",
     40, 50, LINE_PULLS | RESTS},
    {"set speed, panels, crushed corners, restitution",
     "run: {dt: 0.1, duration: 12}\n"
     "domain: {length: 14, width: 6, sides: periodic}\n"
     "ice: {concentration: 0.5, size: 0.7, restitution: 0.3}\n"
     "body: {length: 2, x: 2, restitution: 0.2}\n"
     "tow: {mode: speed, speed: 0.6, ramp: 1}\n"
     "impact: {conversion: crushing, corner: real}\n"
     "solver: {cell_size: 2.5}\n",
     5, 60, COLLIDES | RESTS},
    {"vessel, bridle that breaks, way-points, tide, wind from a table",
     "run: {dt: 0.2, duration: 28}\n"
     "domain: {frame: geographic, length: 44, width: 14, ends: open, sides: open}\n"
     "ice: {concentration: 0.7, size: 1, thickness: 0.04, drag: {water_form: 0.85}}\n"
     "body: {length: 2, draft: 0.5, x: -14}\n"
     "tow: {mode: thrust, programme: [[0, 0], [2, 0.9], [20, 0.9], [28, 0.3]], waypoints: [[-9, 0], [0, 4], [60, 4]], "
     "turn_radius: 2, line_length: 3,\n"
     "      line_stiffness: 2000, line_damping: 100, line: {branches: 2}, branch2: {breaking_load: 90},\n"
     "      vessel: {mass: 800, bollard_pull: 600, free_speed: 3, lookahead: 3}}\n"
     "water: {latitude: 75, tilt: dynamic, tide: {major: 0.05, minor: 0.02, period: 60}}\n"
     "air: {wind_table: wind.csv}\n"
     "solver: {cell_size: 3}\n",
     0, 90, LINE_PULLS | BREAKS | WAYPOINT | RELABELS},
    {"moving window on a line",
     "run: {dt: 0.125, duration: 40}\n"
     "domain: {frame: geographic, length: 26, width: 14, ends: moving, sides: wall, ahead: 14}\n"
     "ice: {concentration: 0.35, size: 1, size_law: lognormal, thickness: 0.04, thickness_law: lognormal}\n"
     "body: {length: 2, draft: 0.5}\n"
     "tow: {mode: line, speed: 1.5, ramp: 1, line_length: 3, line_stiffness: 10 kN, line_damping: 100, direction: "
     "180}\n"
     "water: {latitude: 75, current_x: 0.1}\n"
     "air: {wind_x: 5, wind_y: 3}\n"
     "solver: {cell_size: 2.5, max_sweeps: 40}\n",
     60, 70, RENEWS | WRAPS | RELABELS},
    {"crushing in a jam behind a managed lead",
     "run: {dt: 0.1, duration: 12}\n"
     "domain: {length: 12, width: 5}\n"
     "ice: {concentration: 0.85, size: 0.8, friction: 0.35, thickness: 0.05, crushing: {pressure: 20 kPa}}\n"
     "body: {length: 2, x: 2}\n"
     "tow: {mode: line, speed: 0.5, ramp: 0.5, line_length: 3}\n"
     "lead: {mode: managed, width: 2.4, length: 4, floe_size: 0.4}\n"
     "solver: {cell_size: 2.5, max_sweeps: 60}\n",
     10, 50, CRUSHES | LINE_PULLS},
    {"rafting and crushing in a moving window",
     "run: {dt: 0.1, duration: 20}\n"
     "domain: {length: 16, width: 8, ends: moving}\n"
     "ice: {concentration: 0.75, size: 0.8, friction: 0.35, restitution: 0.1, thickness: 0.04, thickness_law: "
     "lognormal, crushing: {pressure: 100 Pa}, rafting: {kappa: 6}}\n"
     "body: {length: 2}\n"
     "tow: {mode: line, speed: 0.8, ramp: 1, line_length: 2}\n"
     "solver: {cell_size: 2.5, max_sweeps: 60}\n",
     90, 60, RAFTS | CRUSHES | RENEWS},
    {"walls that close on a periodic pack, rebounding",
     "run: {dt: 0.1, duration: 10}\n"
     "domain: {length: 16, width: 10, ends: periodic, sides_closing: 0.4}\n"
     "ice: {concentration: 0.8, size: 0.9, restitution: 0.9, friction: 0.6}\n"
     "body: {shape: none}\n"
     "water: {current_x: 0.4}\n"
     "guard: {overlap: 0}\n" // by the end there is no room left
     "solver: {cell_size: 2.5, max_sweeps: 60}\n",
     0, 60, WRAPS | RELABELS},
    {"floes in parts, floes by hand, a pier",
     "run: {dt: 0.2, duration: 20}\n"
     "domain: {length: 20, width: 10, ends: open, sides: open}\n"
     "ice: {outlines: bays.geojson, outlines_crs: plane, nonconvex: split, thickness: 0.25, x_min: 0, x_max: 20}\n"
     "floes: [{shape: square, length: 1, x: 18, y: 3, vx: -0.6, thickness: 0.3}, {shape: square, length: 1, x: 9, y: "
     "4.2, thickness: 0.3, fixed: true}]\n"
     "body: {length: 2, x: 2}\n"
     "tow: {mode: speed, speed: 0.8, ramp: 1}\n"
     "solver: {cell_size: 2.5}\n",
     0, 70, PARTS},
};
enum { N_SCENARIOS = sizeof scenarios / sizeof *scenarios };

static const char wind[] = "t,u,v\n0,2,0\n10,4,-1\n20,-3,2\n40,0,0\n";

/// Floes with a bay each, in rows.
static void write_outlines(void)
{
    static const double c[][2] = {{0, 0}, {2, 0}, {2, 0.5}, {0.5, 0.5}, {0.5, 1.5}, {2, 1.5}, {2, 2}, {0, 2}};
    FILE *f = fopen(in_folder("bays.geojson"), "w");
    assert_non_null(f);
    fprintf(f, "{\"type\": \"FeatureCollection\", \"features\": [");
    for (int k = 0; k < 15; k++) {
        const double x = 4 + 2.6 * (k % 5), y = -3.8 + 2.4 * (k / 5);
        fprintf(
            f,
            "%s{\"type\": \"Feature\", \"properties\": {}, \"geometry\": {\"type\": \"Polygon\", \"coordinates\": [[",
            k ? ", " : "");
        for (int v = 0; v <= 8; v++) fprintf(f, "%s[%g, %g]", v ? ", " : "", c[v % 8][0] + x, c[v % 8][1] + y);
        fprintf(f, "]]}}");
    }
    fprintf(f, "]}");
    assert_int_equal(fclose(f), 0);
}

typedef struct {
    bt_case c;
    bt_field f;
    bt_lead_stats lead;
    double speed;
} setting;

static void must(bt_status status, bt_errors *err)
{
    if (status != BT_OK) fail_msg("%s", err->n ? err->text[0] : "no message");
}

static void set_up(const struct scenario *s, setting *t)
{
    bt_errors err = {0};
    write_file("case.yml", s->text);
    must(bt_case_read(&t->c, in_folder("case.yml"), NULL, 0, &err), &err);
    bt_field_init(&t->f);
    must(bt_field_load(&t->c, &t->f, &err), &err);
    must(bt_lead_open(&t->c, &t->f, &t->lead, &err), &err);
    t->speed = bt_case_reference_speed(&t->c);
}

static bt_world *new_world(const setting *t, const bt_field *f)
{
    bt_errors err = {0};
    bt_world *w;
    bt_roster roster;
    must(bt_setup_world(&t->c, f, &w, &roster, &err), &err);
    bt_roster_free(&roster);
    return w;
}

static void save(const setting *t, const bt_world *w, bt_snapshot *s)
{
    bt_errors err = {0};
    must(bt_state_save(w, &bt_comm_alone, s, &err), &err);
    must(bt_state_save_field(&t->f, w, &bt_comm_alone, s, &err), &err);
}

/// A world from a state, with the field that it holds.
static bt_world *take_up(const setting *t, bt_snapshot *s)
{
    bt_errors err = {0};
    bt_field f;
    bt_field_init(&f);
    s->err = &err;
    bt_state_load_field(&f, s);
    assert_false(s->faulty);
    bt_world *w = new_world(t, &f);
    must(bt_state_load(w, &bt_comm_alone, s, &err), &err);
    bt_field_free(&f);
    return w;
}

static int seen_in(const bt_world *w)
{
    int seen = 0;
    const bt_tow *t = w->tow;
    if (bt_tow_has_line(t) && t->branch[0].lambda > 0) seen |= LINE_PULLS;
    for (int64_t k = 0; k < w->events.n; k++)
        seen |= w->events.event[k].kind == BT_EVENT_LINE_BROKEN ? BREAKS : WAYPOINT;
    if (w->window && w->window->renewed > 0) seen |= RENEWS;
    if (scene_law(w, "crushing") > 0) seen |= CRUSHES;
    if (scene_law(w, "rafting") > 0 && scene_law(w, "raft_friction_work") > 0) seen |= RAFTS;
    if (w->impacts && w->impacts->n_closed + w->impacts->n_open > 0) seen |= COLLIDES;
    if (w->cells->relabel) seen |= RELABELS;
    for (bt_idx i = 0; i < w->bodies.n; i++) {
        if (bt_part_first(&w->bodies, i) > 0) seen |= PARTS;
        if (w->bodies.lap[i] != 0) seen |= WRAPS;
    }
    for (bt_idx k = 0; k + 1 < w->cells->n; k++)
        if (w->cells->asleep[k] && w->cells->cell[k].end > w->cells->cell[k].first) seen |= RESTS;
    return seen;
}

static void check_same(const struct scenario *s, int from, int at, const bt_snapshot *wanted, const bt_snapshot *found)
{
    char text[400];
    if (bt_snapshot_differ(wanted, found, text))
        fail_msg("%s: taken up after step %d, step %d: %s", s->name, from, at, text);
}

static void goes_on_from_every_other_step(const struct scenario *s)
{
    setting t = {.speed = 0};
    set_up(s, &t);
    bt_world *w = new_world(&t, &t.f);
    bt_cells_begin(w);
    bt_snapshot *state = calloc((size_t)s->steps + 1, sizeof *state);
    bt_sample *sample = calloc((size_t)s->steps + 1, sizeof *sample);
    int seen = 0;
    for (int n = 0; n < s->from; n++) bt_world_step(w);
    for (int n = 0; n <= s->steps; n++) {
        if (n > 0) {
            bt_world_step(w);
            bt_observe(w, t.speed, &sample[n]);
            seen |= seen_in(w);
        }
        save(&t, w, &state[n]);
    }
    bt_world_free(w);
    if ((seen & s->shows) != s->shows) fail_msg("%s: shows %x, wanted %x", s->name, (unsigned)seen, (unsigned)s->shows);
    for (int n = 0; n < s->steps; n += 2) {
        bt_world *again = take_up(&t, &state[n]);
        bt_snapshot as_read = {0};
        save(&t, again, &as_read);
        check_same(s, s->from + n, s->from + n, &state[n], &as_read);
        bt_snapshot_free(&as_read);
        for (int k = n + 1; k <= n + LATER && k <= s->steps; k++) {
            bt_snapshot now = {0};
            bt_sample o;
            bt_world_step(again);
            bt_observe(again, t.speed, &o);
            save(&t, again, &now);
            check_same(s, s->from + n, s->from + k, &state[k], &now);
            if (memcmp(&o, &sample[k], sizeof o))
                fail_msg("%s: taken up after step %d, another sample at step %d", s->name, s->from + n, s->from + k);
            bt_snapshot_free(&now);
        }
        bt_world_free(again);
    }
    for (int n = 0; n <= s->steps; n++) bt_snapshot_free(&state[n]);
    free(state);
    free(sample);
    bt_field_free(&t.f);
    bt_case_free(&t.c);
}

TEST(a_run_goes_on_from_every_other_step)
{
    for (int k = 0; k < N_SCENARIOS; k++) goes_on_from_every_other_step(&scenarios[k]);
}

// --- the file --------------------------------------------------------------------------------------------------------

TEST(a_file_gives_back_every_bit)
{
    bt_errors err = {0};
    bt_snapshot s = {0}, back;
    const double reals[] = {0.1, -0.0, 1e-320, NAN, INFINITY, 3};
    const uint16_t small[] = {0, 65535, 7};
    const int32_t whole[] = {INT32_MIN, -1, INT32_MAX, 0};
    bt_snapshot_add(&s, "a/reals", BT_ITEM_F64, 3, 2, reals);
    bt_snapshot_add(&s, "a/none", BT_ITEM_F64, 0, 3, NULL);
    bt_snapshot_add(&s, "b/small", BT_ITEM_U16, 3, 1, small);
    bt_snapshot_add(&s, "b/whole", BT_ITEM_I32, 2, 2, whole);
    bt_snapshot_add_text(&s, "b/text", "two\nlines \xc3\xa9");
    bt_snapshot_add_text(&s, "b/empty", "");
    bt_snapshot_add_int(&s, "c/count", INT64_MIN);
    must(write_checkpoint(&s, folder, BT_CHECKPOINT_FILE, &err), &err);
    char *path, *said;
    must(bt_checkpoint_read(&back, folder, &path, &said, &err), &err);
    assert_null(said);
    assert_int_equal(back.n, s.n);
    for (int k = 0; k < s.n; k++) {
        const bt_item *i = bt_snapshot_find(&back, s.item[k].name);
        assert_non_null(i);
        assert_int_equal(i->type, s.item[k].type);
        assert_int_equal(i->n, s.item[k].n);
        assert_int_equal(i->width, s.item[k].width);
        assert_memory_equal(i->data, s.item[k].data, (size_t)(i->n * i->width) * bt_item_size(i->type));
    }
    char text[400];
    assert_false(bt_snapshot_differ(&s, &back, text));
    int64_t n;
    assert_ptr_equal(bt_snapshot_find(&back, "a/missing"), NULL);
    back.err = &err;
    free(bt_snapshot_copy(&back, "b/whole", BT_ITEM_I32, 3, &n)); // another shape
    assert_true(back.faulty && err.n == 1 && strstr(err.text[0], "/b/whole"));
    bt_errors_free(&err);
    bt_snapshot_free(&s);
    bt_snapshot_free(&back);
    free(path);
}

TEST(the_first_difference_is_named)
{
    bt_snapshot a = {0}, b = {0};
    double x[] = {1, 2, 3, 4};
    char text[400];
    bt_snapshot_add(&a, "bodies/pose", BT_ITEM_F64, 2, 2, x);
    bt_snapshot_add_text(&a, "about/written", "then");
    x[3] = 4.000000000000001;
    bt_snapshot_add(&b, "bodies/pose", BT_ITEM_F64, 2, 2, x);
    bt_snapshot_add_text(&b, "about/written", "now");
    assert_true(bt_snapshot_differ(&a, &b, text));
    assert_string_equal(text, "/bodies/pose: row 1, column 1: 4 and 4.0000000000000009 (1 of 4 numbers differ)");
    bt_snapshot_free(&a);
    bt_snapshot_free(&b);
}

static char *slurp(const char *path, size_t *n)
{
    FILE *f = fopen(path, "rb");
    assert_non_null(f);
    assert_int_equal(fseek(f, 0, SEEK_END), 0);
    *n = (size_t)ftell(f);
    rewind(f);
    char *bytes = malloc(*n);
    assert_int_equal(fread(bytes, 1, *n, f), *n);
    fclose(f);
    return bytes;
}

static void spill(const char *path, const char *bytes, size_t n)
{
    FILE *f = fopen(path, "wb");
    assert_non_null(f);
    assert_int_equal(fwrite(bytes, 1, n, f), n);
    fclose(f);
}

static void refused(const char *path, size_t at)
{
    bt_errors err = {0};
    bt_snapshot s;
    const bt_status status = bt_snapshot_read(&s, path, &err);
    if (status != BT_ERR_CASE || err.n != 1 || !strstr(err.text[0], path) || s.n != 0)
        fail_msg("byte %zu: status %d, %zu arrays: %s", at, (int)status, (size_t)s.n,
                 err.n ? err.text[0] : "no message");
    bt_errors_free(&err);
}

/// A thousand flipped bits and a hundred cuts of a real checkpoint: each is refused with one message. Without the
/// comparison with the checksum (tried) the first flip passes.
TEST(damage_is_refused)
{
    bt_errors err = {0};
    setting t = {.speed = 0};
    set_up(&scenarios[1], &t);
    bt_world *w = new_world(&t, &t.f);
    bt_cells_begin(w);
    for (int n = 0; n < 20; n++) bt_world_step(w);
    bt_snapshot s = {0};
    save(&t, w, &s);
    must(write_checkpoint(&s, folder, BT_CHECKPOINT_FILE, &err), &err);
    size_t n;
    char *path = strdup(in_folder("damaged.h5")), *bytes = slurp(in_folder(BT_CHECKPOINT_FILE), &n);
    assert_true(n > 20000);
    uint64_t x = 88172645463325252u; // xorshift64
    for (int k = 0; k < 1100; k++) {
        x ^= x << 13, x ^= x >> 7, x ^= x << 17;
        // A fifth of them in the checksum and the first metadata, which are few bytes.
        const size_t at = k % 5 ? x % n : k % 2 ? x % 1024 : n - 1 - x % BT_CHECKSUM_BYTES;
        const char bit = (char)(1 << (x >> 40) % 8);
        bytes[at] ^= bit;
        spill(path, bytes, k < 1000 ? n : at);
        bytes[at] ^= bit;
        refused(path, at);
    }
    bytes = realloc(bytes, n + 1);
    bytes[n] = 0;
    spill(path, bytes, n + 1); // longer by one
    refused(path, n);
    // Whole, of another version of the program.
    spill(path, bytes, n);
    must(bt_checksum_write(path, "checkpoint 1", &err), &err);
    bt_snapshot old;
    assert_int_equal(bt_snapshot_read(&old, path, &err), BT_ERR_CASE);
    assert_non_null(
        strstr(err.text[0],
               "has the format \"checkpoint 1\", but this program reads \"checkpoint 5\"; use the program that "
               "wrote it"));
    bt_errors_free(&err);
    // Two files, the front of one on the back of the other.
    bt_world_step(w);
    bt_snapshot later = {0};
    save(&t, w, &later);
    must(write_snapshot(&later, path, bt_checkpoint_meaning, &err), &err);
    size_t m;
    char *other = slurp(path, &m);
    const size_t both = (m < n ? m : n) - BT_CHECKSUM_BYTES;
    size_t last = both - 1;
    while (other[last] == bytes[last]) last--;
    memcpy(other, bytes, last); // the last byte in which they differ stays
    spill(path, other, m);
    refused(path, m);
    memcpy(other, bytes, both); // under the seal of the other
    spill(path, other, m);
    refused(path, m);
    free(other);
    free(bytes);
    free(path);
    bt_snapshot_free(&s);
    bt_snapshot_free(&later);
    bt_world_free(w);
    bt_field_free(&t.f);
    bt_case_free(&t.c);
}

int main(void)
{
    if (!mkdtemp(folder)) return 1;
    write_file("wind.csv", wind);
    write_outlines();
    const int failed = run_all_tests(NULL, NULL);
    char command[160];
    snprintf(command, sizeof command, "rm -rf %s", folder);
    return system(command) != 0 || failed;
}
