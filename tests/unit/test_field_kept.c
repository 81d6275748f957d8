// SPDX-License-Identifier: MIT
// Fields kept for other runs: the same bits, under a name that holds all they follow from, and never a damaged one.
#include <sys/stat.h>
#include <unistd.h>

#include "test.h"
#include "field/field_kept.h"
#include "base/fileio.h"
#include "case/schema.h"

static char folder[] = "/tmp/bt_test_kept_XXXXXX";
static char *kept; ///< the folder of the fields

static const char text[] =
    "run: {dt: 1 s, duration: 60 s}\n"
    "domain: {frame: geographic, x0: 0 m, y0: 0 m, length: 600 m, width: 400 m, ends: wall, sides: periodic}\n"
    "ice: {concentration: 0.6, shape: voronoi, size: 30 m, thickness: 1 m, thickness_law: lognormal, "
    "thickness_spread: 0.3, shake: 3, seed: 7}\n"
    "body: {shape: disc, length: 60 m, draft: 20 m, x: 100 m, y: 200 m}\n"
    "tow: {mode: speed, speed: 0.5 m/s, ramp: 0 s}\n";

static int make_folder(void **state)
{
    (void)state;
    if (!mkdtemp(folder)) return -1;
    kept = bt_text_of("%s/fields", folder);
    return 0;
}

static int remove_folder(void **state)
{
    (void)state;
    free(kept);
    char *path = bt_file_join(folder, "case.yml");
    remove(path);
    free(path);
    return rmdir(folder); // nothing else is left
}

/// The case above with `set`, as --set takes it, or NULL.
static bt_case case_with(const char *set)
{
    char *path = bt_file_join(folder, "case.yml");
    bt_errors err = {0};
    bt_case c = {0};
    assert_int_equal(bt_file_write(path, text, &err), BT_OK);
    const bt_status status = bt_case_read(&c, path, &set, set ? 1 : 0, &err);
    if (status != BT_OK) print_error("%s: %s\n", set ? set : "", err.n ? err.text[0] : "");
    assert_int_equal(status, BT_OK);
    bt_errors_free(&err);
    free(path);
    return c;
}

static bt_field field_of(const char *dir, const bt_case *c)
{
    bt_field f;
    bt_errors err = {0};
    bt_field_init(&f);
    assert_int_equal(bt_field_load_kept(dir, c, &f, &err), BT_OK);
    assert_true(f.n > 50);
    return f;
}

static void assert_same(const bt_field *f, const bt_field *g)
{
    const size_t n = (size_t)f->n;
    assert_int_equal(f->n, g->n);
    assert_memory_equal(f->offsets, g->offsets, (n + 1) * sizeof *f->offsets);
    assert_memory_equal(f->vertices, g->vertices, 2 * (size_t)f->offsets[n] * sizeof *f->vertices);
    assert_memory_equal(f->pose, g->pose, 3 * n * sizeof *f->pose);
    assert_memory_equal(f->thickness, g->thickness, n * sizeof *f->thickness);
    assert_memory_equal(f->area, g->area, n * sizeof *f->area);
    assert_memory_equal(&f->ice_area, &g->ice_area, sizeof f->ice_area);
    assert_memory_equal(&f->concentration, &g->concentration, sizeof f->concentration);
    assert_memory_equal(&f->strip, &g->strip, sizeof f->strip);
    assert_string_equal(f->frame, g->frame);
}

static char *path_of(const bt_case *c)
{
    char name[BT_CHECKSUM_DIGEST];
    bt_field_digest(c, name);
    return bt_file_join(kept, name);
}

TEST(test_the_same_bits_and_no_second_making)
{
    bt_case c = case_with("ice.extent.y_max=500 m");
    bt_field made = field_of(NULL, &c), first = field_of(kept, &c);
    char *path = path_of(&c);
    struct stat before, after;
    assert_int_equal(stat(path, &before), 0);
    bt_field second = field_of(kept, &c);
    assert_int_equal(stat(path, &after), 0);
    assert_int_equal(before.st_ino, after.st_ino); // a file that is written again is another one
    assert_true(made.strip > 0);
    assert_same(&made, &first);
    assert_same(&made, &second);
    bt_field_free(&made), bt_field_free(&first), bt_field_free(&second);
    bt_field_forget_kept(kept);
    assert_int_equal(access(kept, F_OK), -1);
    free(path);
    bt_case_free(&c);
}

/// Every byte counts, a missing end, and the field of another case under this name.
TEST(test_what_is_damaged_is_made_anew)
{
    bt_case c = case_with(NULL), other = case_with("ice.seed=8");
    bt_field made = field_of(kept, &c), foreign = field_of(kept, &other);
    char *path = path_of(&c), *strange = path_of(&other), *whole, *wrong, *again;
    size_t size, n_wrong, n_again;
    bt_errors err = {0};
    assert_int_equal(bt_file_read(path, "a field", &whole, &size, &err), BT_OK);
    assert_int_equal(bt_file_read(strange, "a field", &wrong, &n_wrong, &err), BT_OK);
    for (int k = 0; k < 12; k++) {
        FILE *out = fopen(path, "w");
        assert_non_null(out);
        const size_t at = (size_t)k * (size - 1) / 9;
        if (k < 10) whole[at] ^= 1;
        if (k == 11) fwrite(wrong, 1, n_wrong, out);
        else fwrite(whole, 1, k == 10 ? size - 8 : size, out);
        if (k < 10) whole[at] ^= 1;
        fclose(out);
        bt_field f = field_of(kept, &c);
        assert_same(&made, &f);
        bt_field_free(&f);
        assert_int_equal(bt_file_read(path, "a field", &again, &n_again, &err), BT_OK);
        assert_int_equal(n_again, size);
        assert_memory_equal(again, whole, size);
        free(again);
    }
    bt_field_free(&made), bt_field_free(&foreign);
    bt_field_forget_kept(kept);
    free(path), free(strange), free(whole), free(wrong);
    bt_case_free(&c), bt_case_free(&other);
}

static void digest_with(const char *set, char digest[BT_CHECKSUM_DIGEST])
{
    bt_case c = case_with(set);
    bt_field_digest(&c, digest);
    bt_case_free(&c);
}

TEST(test_what_a_field_follows_from_is_in_its_name)
{
    static const char *const counts[] = {
        "ice.concentration=0.61", "ice.size=31 m", "ice.seed=8", "ice.shake=4", "ice.thickness=1.1 m",
        "ice.thickness_spread=0.2", "ice.shape=rectangles", "ice.size_spread=0.3", "ice.x_min=10 m",
        "ice.extent.y_max=500 m", "domain.length=610 m", "domain.width=410 m", "domain.ends=open",
        "domain.sides=wall", "domain.x0=1 m", "body.length=61 m", "body.x=101 m", "body.yaw=1 deg",
        "body.shape=square", "body.width=50 m"};
    char first[BT_CHECKSUM_DIGEST], other[BT_CHECKSUM_DIGEST];
    digest_with(NULL, first);
    for (size_t k = 0; k < sizeof counts / sizeof *counts; k++) {
        digest_with(counts[k], other);
        if (!strcmp(first, other)) print_error("%s does not count\n", counts[k]);
        assert_string_not_equal(first, other);
    }
}

/// And what is left out of the name changes no bit of the ice.
TEST(test_what_is_not_in_the_name_changes_nothing)
{
    static const char *const idle[] = {
        "run.dt=0.5 s", "run.duration=30 s", "tow.speed=0.4 m/s", "water.latitude=75 deg", "ice.friction=0.1",
        "ice.restitution=0.2", "ice.density=850 kg/m3", "ice.added_mass=0.2", "ice.added_inertia=0.2",
        "ice.drag.water_form=0.3", "ice.drag.sheltering=2", "ice.rafting.kappa=10", "ice.crushing.pressure=100 kPa",
        "ice.splitting.toughness=150 kPa m^0.5",
        "ice.start=rest", "domain.wall_friction=0.1",
        "domain.wall_restitution=0.1", "body.added_mass=0.3", "body.added_inertia=0.3", "body.density=800 kg/m3",
        "body.draft=21 m", "body.drag.air_form=0.3", "body.friction=0.2", "body.restitution=0.2", "body.sail=2 m",
        "body.mass=1e8 kg"};
    bt_case c = case_with(NULL);
    bt_field made = field_of(NULL, &c);
    char first[BT_CHECKSUM_DIGEST], other[BT_CHECKSUM_DIGEST];
    bt_field_digest(&c, first);
    for (size_t k = 0; k < sizeof idle / sizeof *idle; k++) {
        bt_case d = case_with(idle[k]);
        bt_field_digest(&d, other);
        if (strcmp(first, other)) print_error("%s counts\n", idle[k]);
        assert_string_equal(first, other);
        bt_field f = field_of(NULL, &d);
        assert_same(&made, &f);
        bt_field_free(&f);
        bt_case_free(&d);
    }
    bt_field_free(&made);
    bt_case_free(&c);
}

TEST_MAIN(make_folder, remove_folder)
