// SPDX-License-Identifier: MIT
// GeoJSON feature by feature: against the tree of the whole text, for sound files, and for each of them damaged in many
// places.
#include "scene.h"

#include <unistd.h>

#include "field/map_features.h"

static const char *const texts[] = {
    "{\"type\": \"FeatureCollection\", \"crs\": {\"features\": [1, 2]}, \"features\": [\n"
    " {\"type\": \"Feature\", \"id\": 7, \"properties\": {\"thickness\": 1.2}, \"geometry\": {\"type\": \"Polygon\", "
    "\"coordinates\": [[[0, 0], [1.5e1, 0], [1, -2.25]]]}},\n"
    " {\"type\": \"Feature\", \"properties\": null, \"geometry\": {\"coordinates\": [ [ [0.1 , 0.2,3] ,[ 1E-3,-0 "
    "],[-0.0,1] ] ] , \"type\": \"Polygon\"}},\n"
    " {\"geometry\": {\"type\": \"MultiPolygon\", \"coordinates\": [[[[1, 2], [3, 4], [5, 6]]]]}}\n], \"bergtow\": "
    "{\"origin\": [1, 2]}}\n",
    "{\"features\":[{\"geometry\":{\"type\":\"Polygon\",\"coordinates\":[[[0,0],[1,0],[1,1]],[[0,0],[1,0],[1,1]]]}},5,"
    "null,\"a,]}[{\\\"\\\\\",[],{},[[[1,2]]],"
    "{\"geometry\":{\"type\":\"MultiPolygon\",\"coordinates\":[[[1,2],[3,4]]]}},{\"geometry\":{\"type\":\"Polygon\","
    "\"coordinates\":null}},"
    "{\"geometry\":{\"type\":\"Polygon\",\"coordinates\":[[[1,2],[3]]]}},{\"geometry\":{\"type\":\"Polygon\","
    "\"coordinates\":[[[123456789012345678,2],[3,4]]]}},"
    "{\"geometry\":null,\"properties\":{\"geometry\":{\"type\":\"Polygon\",\"coordinates\":[[[1,2]]]}}}]}",
    "{\"\\u0066eatures\": [{\"geometry\": {\"type\": \"Polygon\", \"coordinates\": [[[1, 2], [3, 4]]]}}]}",
    "{\"features\": []}",
    "{\"features\": {\"a\": [1]}}",
    "{}",
    "[1, 2]",
};
enum { N_TEXTS = sizeof texts / sizeof *texts };

static json_t *coordinates_of(const json_t *feature)
{
    return json_object_get(json_object_get(feature, "geometry"), "coordinates");
}

/// The same values; a ring that was read apart stands in the tree as null.
static void check_feature(bt_features *f, size_t i, const json_t *whole)
{
    const json_t *found = bt_features_at(f, i);
    assert_non_null(found);
    size_t n;
    const double *ring = bt_features_ring(f, i, &n);
    if (!ring) {
        assert_true(json_equal((json_t *)found, (json_t *)whole));
        return;
    }
    assert_true(json_is_null(coordinates_of(found)));
    json_t *copy = json_deep_copy(whole);
    json_t *polygon = json_incref(coordinates_of(copy));
    json_object_set_new(json_object_get(copy, "geometry"), "coordinates", json_null());
    assert_true(json_equal((json_t *)found, copy));
    json_decref(copy);
    const bool multi =
        !strcmp(json_string_value(json_object_get(json_object_get(whole, "geometry"), "type")), "MultiPolygon");
    assert_int_equal(json_array_size(polygon), 1);
    const json_t *list = json_array_get(polygon, 0);
    if (multi) {
        assert_int_equal(json_array_size(list), 1);
        list = json_array_get(list, 0);
    }
    assert_int_equal(json_array_size(list), n);
    for (size_t k = 0; k < n; k++)
        for (size_t a = 0; a < 2; a++) {
            const double x = json_number_value(json_array_get(json_array_get(list, k), a));
            assert_memory_equal(&ring[2 * k + a], &x, sizeof x);
        }
    json_decref(polygon);
}

/// Returns how many rings were read apart; −1: refused, as the whole is.
static int check(const char *path, const char *text, size_t size)
{
    unlink(path); // to overwrite a file waits for the disk on some systems
    FILE *out = fopen(path, "wb");
    assert_true(out && fwrite(text, 1, size, out) == size);
    fclose(out);
    json_error_t why;
    json_t *whole = json_loadb(text, size, JSON_REJECT_DUPLICATES, &why);
    bt_features f;
    bt_errors err = {0};
    const bt_status status = bt_features_open(&f, path, &err);
    int rings = -1;
    if (!whole) {
        char expected[512];
        snprintf(expected, sizeof expected, "%s:%d: is not JSON: %s; correct the file", path, why.line, why.text);
        assert_int_equal(status, BT_ERR_CASE);
        assert_int_equal(err.n, 1);
        assert_string_equal(err.text[0], expected);
    } else {
        const json_t *list = json_object_get(whole, "features");
        assert_int_equal(status, BT_OK);
        assert_int_equal(f.n, json_array_size(list));
        assert_int_equal(f.listed, json_is_array(list));
        size_t n;
        rings = 0;
        for (size_t i = 0; i < f.n; i++) {
            check_feature(&f, i, json_array_get(list, i));
            rings += bt_features_ring(&f, i, &n) != NULL;
        }
        if (f.span && f.n > 0) json_array_clear(json_object_get(whole, "features"));
        assert_true(json_equal(f.root, whole));
    }
    bt_features_close(&f);
    bt_errors_free(&err);
    json_decref(whole);
    return rings;
}

// Red: a comma at the end of the list let through; depth not held against the type.
TEST(as_the_tree_of_the_whole)
{
    char path[] = "/tmp/bergtow_features_XXXXXX";
    close(mkstemp(path));
    const int rings[N_TEXTS] = {3};
    for (int k = 0; k < N_TEXTS; k++) assert_int_equal(check(path, texts[k], strlen(texts[k])), rings[k]);
    // Every byte left out, doubled, or another that means something.
    int refused = 0, taken = 0;
    for (int k = 0; k < N_TEXTS; k++) {
        const size_t n = strlen(texts[k]);
        for (size_t at = 0; at < n; at++)
            for (const char *c = "\b[]{},:\"\\ 0.e-"; *c; c++) {
                char damaged[2048];
                memcpy(damaged, texts[k], n);
                if (*c == '\b') memmove(damaged + at, texts[k] + at + 1, n - at - 1);
                else damaged[at] = *c;
                if (check(path, damaged, n - (*c == '\b')) < 0) refused++;
                else taken++;
            }
    }
    assert_true(refused > 5000 && taken > 1000);
    unlink(path);
}

// Red: the rest of the quotient left out (numbers just beyond the middle of two doubles go the wrong way), or its least
// number of bits.
TEST(numbers_are_rounded_as_strtod_does)
{
    char path[] = "/tmp/bergtow_features_XXXXXX";
    close(mkstemp(path));
    static const char *const hard[] = {"9007199254740993.0",
                                       "9007199254740992.9999",
                                       "4503599627370497.5",
                                       "0.1",
                                       "0.30000000000000004",
                                       "1e308",
                                       "4.9e-324",
                                       "123456789.000000000000000000000000000001",
                                       "1234567890123456789.0",
                                       "12345678901234567890.5",
                                       "999999999999999",
                                       "0.0000000000000000000000000012",
                                       "0.000123",
                                       "0.00000000000000001",
                                       "5.0000000000000002220446049250313080847263336181640625"};
    uint64_t rng = 3;
    enum { N = 19000 };
    char *text = bt_alloc(64 * N + 4096, 1), *p = text;
    p += sprintf(p, "{\"features\":[{\"geometry\":{\"type\":\"Polygon\",\"coordinates\":[[");
    const char *first = p;
    for (size_t k = 0; k < sizeof hard / sizeof *hard; k++) p += sprintf(p, "[%s,-%s],", hard[k], hard[k]);
    for (int k = 0; k < N / 4; k++) { // as programs write them; and the middle of two doubles, which 19 digits hold
        const double x = (scene_uniform(&rng) - 0.5) * pow(10, 8 * scene_uniform(&rng)),
                     odd = floor(0x1p52 * (1 + scene_uniform(&rng)));
        p += sprintf(p, "[%.17g,%.9f],[%.1f,%.0f.5]%s", x, x, odd, odd, k + 1 < N / 4 ? "," : "");
    }
    assert_true(p - first < 64 * N);
    p += sprintf(p, "]]}}]}");
    FILE *out = fopen(path, "w");
    fputs(text, out);
    fclose(out);
    bt_features f;
    bt_errors err = {0};
    assert_int_equal(bt_features_open(&f, path, &err), BT_OK);
    size_t n;
    const double *ring = bt_features_ring(&f, 0, &n);
    assert_true(ring && n == sizeof hard / sizeof *hard + 2 * (N / 4));
    const char *at = first;
    for (size_t k = 0; k < 2 * n; k++) {
        at += strcspn(at, "-0123456789");
        char *end;
        const double x = strtod(at, &end);
        assert_memory_equal(&ring[k], &x, sizeof x);
        at = end;
    }
    bt_features_close(&f);
    free(text);
    unlink(path);
}

TEST_MAIN(NULL, NULL)
