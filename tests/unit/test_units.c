// SPDX-License-Identifier: MIT
// Units: what is read, what is refused, and that writing keeps every bit.
#include "test.h"
#include "base/units.h"

#include "bergtow/base.h"

#include <float.h>

TEST(reads_units_of_each_kind)
{
    static const struct {
        const char *text;
        bt_unit kind;
        double value;
    } good[] = {
        {"30 m", BT_UNIT_LENGTH, 30},
        {"30m", BT_UNIT_LENGTH, 30},
        {"2.5 km", BT_UNIT_LENGTH, 2500},
        {"30 mm", BT_UNIT_LENGTH, 0.03},
        {"4 cm", BT_UNIT_LENGTH, 0.04},
        {"1.5 kn", BT_UNIT_SPEED, 1.5 * 1852 / 3600},
        {"36 km/h", BT_UNIT_SPEED, 10},
        {"10 ms", BT_UNIT_TIME, 0.01},
        {"2 h", BT_UNIT_TIME, 7200},
        {"3 min", BT_UNIT_TIME, 180},
        {"1 d", BT_UNIT_TIME, 86400},
        {"100 ft", BT_UNIT_LENGTH, 30.48},
        {"1 foot", BT_UNIT_LENGTH, 0.3048},
        {"5280 feet", BT_UNIT_LENGTH, 1609.344},
        {"10 ft/s", BT_UNIT_SPEED, 3.048},
        {"1.5 knots", BT_UNIT_SPEED, 1.5 * 1852 / 3600},
        {"1 knot", BT_UNIT_SPEED, 1852.0 / 3600},
        {"1 hour", BT_UNIT_TIME, 3600},
        {"2.5 hours", BT_UNIT_TIME, 9000},
        {"1 minute", BT_UNIT_TIME, 60},
        {"90 minutes", BT_UNIT_TIME, 5400},
        {"30 seconds", BT_UNIT_TIME, 30},
        {"1 second", BT_UNIT_TIME, 1},
        {"1 day", BT_UNIT_TIME, 86400},
        {"2 days", BT_UNIT_TIME, 172800},
        {"80 tf", BT_UNIT_FORCE, 784532},
        {"1 tonne-force", BT_UNIT_FORCE, 9806.65},
        {"80 tonnes-force", BT_UNIT_FORCE, 784532},
        {"180 deg", BT_UNIT_ANGLE, BT_PI},
        {"180", BT_UNIT_ANGLE, BT_PI},
        {"3 rad", BT_UNIT_ANGLE, 3},
        {"90°", BT_UNIT_ANGLE, BT_PI / 2},
        {"180", BT_UNIT_TURN, BT_PI},
        {"1 rad/s", BT_UNIT_TURN, 1},
        {"50 kN", BT_UNIT_FORCE, 5e4},
        {"1 MN", BT_UNIT_FORCE, 1e6},
        {"15.5 kt", BT_UNIT_MASS, 15.5e6},
        {"2 t", BT_UNIT_MASS, 2000},
        {"0.91 t/m3", BT_UNIT_DENSITY, 910},
        {"910 kg/m^3", BT_UNIT_DENSITY, 910},
        {"2 kN s/m", BT_UNIT_DAMPING, 2000},
        {"20 kPa", BT_UNIT_PRESSURE, 2e4},
        {"13 kN/m", BT_UNIT_LINE_LOAD, 13e3},
        {"150 kPa m^0.5", BT_UNIT_TOUGHNESS, 150e3},
        {"0.15 MPa√m", BT_UNIT_TOUGHNESS, 0.15e6},
        {"150e3", BT_UNIT_TOUGHNESS, 150e3},
        {"0.8 %", BT_UNIT_RATIO, 0.008},
        {"80%", BT_UNIT_RATIO, 0.8},
        {" 1e-3 ", BT_UNIT_RATIO, 1e-3},
        {"+.5", BT_UNIT_NONE, 0.5},
        {"5.", BT_UNIT_NONE, 5},
        {"-1E2 m", BT_UNIT_LENGTH, -100},
        {"1e2m", BT_UNIT_LENGTH, 100},
    };
    for (size_t i = 0; i < sizeof good / sizeof *good; i++) {
        double value = NAN;
        char why[BT_WHY] = "";
        if (!bt_units_parse(good[i].text, good[i].kind, &value, why)) fail_msg("\"%s\" refused: %s", good[i].text, why);
        if (value != good[i].value) fail_msg("\"%s\" read as %.17g, not %.17g", good[i].text, value, good[i].value);
    }
}

TEST(refuses_what_is_not_a_number_with_a_unit_of_the_kind)
{
    static const struct {
        const char *text;
        bt_unit kind;
        const char *fragment;
    } bad[] = {
        {"0.8x", BT_UNIT_RATIO, "\"x\" is not a unit"},
        {"10 kN", BT_UNIT_LENGTH, "kN is the unit of a force, but this is a length"},
        {"10 ms", BT_UNIT_SPEED, "unit of a time"},
        {"1.5 kt", BT_UNIT_SPEED, "unit of a mass"},
        {"3 m", BT_UNIT_NONE, "plain number"},
        {"nan", BT_UNIT_LENGTH, "is not a number"},
        {".nan", BT_UNIT_LENGTH, "is not a number"},
        {"inf", BT_UNIT_LENGTH, "is not a number"},
        {"-.inf", BT_UNIT_LENGTH, "is not a number"},
        {"0x10", BT_UNIT_LENGTH, "\"x10\""},
        {"0x1p3", BT_UNIT_NONE, "\"x1p3\""},
        {"1e999", BT_UNIT_NONE, "too large"},
        {"1e308 km", BT_UNIT_LENGTH, "too large"},
        {"", BT_UNIT_LENGTH, "is not a number"},
        {"m", BT_UNIT_LENGTH, "is not a number"},
        {"1,5 m", BT_UNIT_LENGTH, "1,5 m has a comma; write decimals with a point"},
        {"1 000 m", BT_UNIT_LENGTH, "\"000 m\""},
        {"1 m m", BT_UNIT_LENGTH, "\"m m\""},
        {"1e", BT_UNIT_NONE, "\"e\""},
        {"1e+", BT_UNIT_NONE, "\"e+\""},
        {"--1", BT_UNIT_NONE, "not a number"},
        {"1.2.3", BT_UNIT_NONE, "\".3\""},
        {"1_000", BT_UNIT_NONE, "\"_000\""},
        {"5 M", BT_UNIT_LENGTH, "\"M\" is not a unit of length"},
        {"5 %", BT_UNIT_LENGTH, "unit of a ratio"},
        {"80 t", BT_UNIT_FORCE, "t is the unit of a mass, but this is a force; use N, kN, MN, GN, tf"},
        {"2 hrs", BT_UNIT_TIME, "use s, ms, min, h, d"},
        {"3 inches", BT_UNIT_LENGTH, "use m, km, cm, mm, nmi, ft"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        double value = 42;
        char why[BT_WHY] = "";
        if (bt_units_parse(bad[i].text, bad[i].kind, &value, why))
            fail_msg("\"%s\" accepted as %g", bad[i].text, value);
        if (!strstr(why, bad[i].fragment))
            fail_msg("\"%s\": the message lacks '%s': %s", bad[i].text, bad[i].fragment, why);
        if (!strchr(why, ';')) fail_msg("\"%s\": no remedy in: %s", bad[i].text, why);
        assert_true(value == 42);
    }
}

// Every message fits its buffer, however long the text: the buffer's last byte stays a terminator.
TEST(long_texts_give_short_messages)
{
    char text[5000], why[BT_WHY];
    double value;
    for (int kind = 0; kind < BT_UNIT_KINDS; kind++)
        for (int digit = 0; digit < 2; digit++) {
            memset(text, digit ? '7' : 'z', sizeof text);
            memset(text + 2000, 'z', 1000);
            text[sizeof text - 1] = 0;
            assert_false(bt_units_parse(text, (bt_unit)kind, &value, why));
            assert_true(strlen(why) < BT_WHY - 1);
        }
}

static uint64_t random_bits(void)
{
    static uint64_t s = 0x9E3779B97F4A7C15u;
    s ^= s << 13, s ^= s >> 7, s ^= s << 17;
    return s;
}

TEST(written_values_read_back_to_the_same_bits)
{
    static const double edges[] = {0.0, -0.0,    DBL_MAX,     DBL_MIN, DBL_TRUE_MIN,
                                   0.1, 1.0 / 3, BT_PI / 180, 1e22,    0.30000000000000004};
    for (int i = 0; i < 20000; i++) {
        double v, back;
        uint64_t bits = random_bits();
        memcpy(&v, &bits, sizeof v);
        if (i < (int)(sizeof edges / sizeof *edges)) v = edges[i];
        if (!isfinite(v)) continue;
        bt_unit kind = (bt_unit)(i % BT_UNIT_KINDS);
        char text[64], why[BT_WHY];
        bt_units_format(v, kind, text, sizeof text);
        if (!bt_units_parse(text, kind, &back, why)) fail_msg("%s refused: %s", text, why);
        if (memcmp(&v, &back, sizeof v)) fail_msg("%a written as %s reads back as %a", v, text, back);
    }
}

TEST(short_values_are_written_short)
{
    char text[64];
    bt_units_format(0.1, BT_UNIT_TIME, text, sizeof text);
    assert_string_equal(text, "0.1 s");
    bt_units_format(BT_PI / 2, BT_UNIT_ANGLE, text, sizeof text);
    assert_string_equal(text, "1.5707963267948966 rad");
    bt_units_format(NAN, BT_UNIT_FORCE, text, sizeof text);
    assert_string_equal(text, "none");
}

TEST(a_force_has_four_digits_and_no_stray_point)
{
    static const struct { double newton; const char *text; } some[] = {
        {0, "0.000 N"}, {12.34, "12.34 N"}, {999.94, "999.9 N"}, {999.96, "1.000 kN"}, {-1500, "-1.500 kN"},
        {999960, "1.000 MN"}, {-6.359e9, "-6.359 GN"}, {5.007e10, "50.07 GN"}, {1.213e9, "1.213 GN"},
        {3e14, "300.0 TN"}, {2.5e20, "2.5e+08 TN"}, {NAN, "–"}, {INFINITY, "inf N"},
    };
    char text[32];
    for (size_t i = 0; i < sizeof some / sizeof *some; i++)
        assert_string_equal(bt_force_text(text, some[i].newton), some[i].text);
}

TEST_MAIN(NULL, NULL)
