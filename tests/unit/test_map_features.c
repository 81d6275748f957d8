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

/// Visited features, each of which must be the next element of a list.
typedef struct visit { const json_t *list; size_t n; } visit;

static void see(void *context, size_t index, const json_t *feature)
{
    visit *seen = context;
    assert_int_equal(index, seen->n++);
    if (seen->list) assert_true(json_equal((json_t *)feature, json_array_get(seen->list, index)));
}

/// Is it taken, as the whole is?
static bool check(const char *path, const char *text, size_t size)
{
    unlink(path); // to overwrite a file waits for the disk on some systems
    FILE *out = fopen(path, "wb");
    assert_true(out && fwrite(text, 1, size, out) == size);
    fclose(out);
    json_error_t why;
    json_t *whole = json_loadb(text, size, JSON_REJECT_DUPLICATES, &why), *root,
           *list = json_object_get(whole, "features");
    visit seen = {.list = list};
    size_t n;
    bt_errors err = {0};
    const bt_status status = bt_features_read(path, see, &seen, &root, &n, &err);
    if (!whole) {
        char expected[512];
        snprintf(expected, sizeof expected, "%s:%d: is not JSON: %s; correct the file", path, why.line, why.text);
        assert_int_equal(status, BT_ERR_CASE);
        assert_null(root);
        assert_int_equal(err.n, 1);
        assert_string_equal(err.text[0], expected);
    } else {
        assert_int_equal(status, BT_OK);
        assert_int_equal(n, json_array_size(list));
        assert_int_equal(n, seen.n);
        json_array_clear(list);
        assert_true(json_equal(root, whole));
    }
    bt_errors_free(&err);
    json_decref(root);
    json_decref(whole);
    return status == BT_OK;
}

// Red: a comma at the end of the list or a NUL at the end of the file let through.
TEST(as_the_tree_of_the_whole)
{
    char path[] = "/tmp/bergtow_features_XXXXXX";
    close(mkstemp(path));
    for (int k = 0; k < N_TEXTS; k++) assert_true(check(path, texts[k], strlen(texts[k])));
    assert_false(check(path, texts[0], strlen(texts[0]) + 1)); // with the NUL
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
                if (check(path, damaged, n - (*c == '\b'))) taken++;
                else refused++;
            }
    }
    assert_true(refused > 5000 && taken > 1000);
    unlink(path);
}

TEST_MAIN(NULL, NULL)
