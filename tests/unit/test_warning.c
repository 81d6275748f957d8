// SPDX-License-Identifier: MIT
// Warnings: code and values beside the text, through every list that they pass.
#include "scene.h"

#include <float.h>

#include "case/warning.h"

static char *json_of(const bt_errors *list)
{
    bt_json j = {0};
    bt_json_open(&j, NULL, '{');
    bt_warnings_json(&j, "warnings", list);
    bt_json_close(&j, '}');
    return j.text;
}

TEST(values_follow_from_the_conversions)
{
    bt_errors list = {0};
    bt_warn(&list, BT_WARN_UNCONVERGED, "%lld of %ld steps, 100 %% (%.2g m/s, %+.1f m/s); %s", 3LL, 4L, 0.123456789,
            -2.5, "wording");
    bt_warn(&list, BT_WARN_GRID_PLANE, "%s %g %g %.0f", "EPSG:\"1\"", 1.5, (double)NAN, DBL_MAX);
    bt_warn(&list, BT_WARN_TURN_JUMP, "%d", 7);
    bt_warn(&list, BT_WARN_NOT_FINITE, "no value");
    bt_errors_add(&list, "none of the table");
    char *json = json_of(&list);
    static const char wanted[] =
        "{\n  \"warnings\": [\n"
        "    {\"code\": \"unconverged\", \"text\": \"3 of 4 steps, 100 % (0.12 m/s, -2.5 m/s); wording\", \"values\": "
        "{\"steps\": 3, \"of_steps\": 4, \"residual_m_s\": 0.123456789, \"tolerance_m_s\": -2.5}},\n";
    assert_int_equal(strncmp(json, wanted, sizeof wanted - 1), 0);
    assert_non_null(strstr(json, "{\"crs\": \"EPSG:\\\"1\\\"\", \"along\": 1.5, \"across\": null, \"area_percent\": "));
    assert_non_null(strstr(json, "\"text\": \"7\", \"values\": {\"waypoint\": 7}},\n"));
    assert_non_null(strstr(json, "{\"code\": \"not_finite\", \"text\": \"no value\", \"values\": {}},\n"));
    assert_non_null(strstr(json, "{\"code\": null, \"text\": \"none of the table\", \"values\": {}}\n  ]\n}\n"));
    free(json);
    bt_errors_free(&list);
}

TEST(what_a_text_rounds_is_added)
{
    bt_errors list = {0};
    bt_warn(&list, BT_WARN_STOPPED, "stopped");
    bt_warn_name(&list, "by", "a signal");
    bt_warn_number(&list, "step", 1e300);
    assert_string_equal(list.note[0].values, "{\"by\": \"a signal\", \"step\": 1e+300}");
    bt_warn(NULL, BT_WARN_STOPPED, "nobody %s", "listens");
    bt_warn_number(NULL, "step", 1);
    bt_errors_free(&list);
}

/// 40 warnings of two lists, moved: more than a list has room for at first.
TEST(codes_move_with_their_texts)
{
    bt_errors a = {0}, b = {0};
    for (int i = 0; i < 40; i++) bt_warn(i % 2 ? &a : &b, i % 2 ? BT_WARN_OVERLAP : BT_WARN_OUTRUN, "%d", i);
    bt_errors_add(&a, "plain");
    bt_errors_move(&b, &a);
    assert_int_equal(a.n, 0);
    assert_int_equal(b.n, 41);
    for (size_t i = 0; i < 40; i++) {
        assert_string_equal(b.note[i].code, i < 20 ? "outrun" : "overlap");
        assert_non_null(strstr(b.note[i].values, b.text[i]));
    }
    assert_null(b.note[40].code);
    char *text = bt_warnings_text(&b);
    assert_int_equal(strncmp(text, "0; 2; 4; ", 9), 0);
    assert_non_null(strstr(text, "; 39; plain"));
    free(text);
    bt_errors_free(&b);
}

TEST_MAIN(NULL, NULL)
