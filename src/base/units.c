// SPDX-License-Identifier: MIT
// Numbers with units: one table of units, a strict reader and a writer that keeps every bit.
//
// value_SI = number · up / down. Two factors instead of one: 30 mm as 30/1000 is the double nearest to 0.03, and
// 30·0.001 may not be. So a case in millimetres gives the same bits as the same case in metres.
#include "base/units.h"

#include "bergtow/base.h"

#include <ctype.h>
#include <math.h>
#include <string.h>

// The first unit of a kind is the SI one. ft: the international foot, 0.3048 m; tf: 1000 kg under standard gravity.
static const bt_unit_entry units[] = {
    {"%", BT_UNIT_RATIO, 1, 100},
    {"m", BT_UNIT_LENGTH, 1, 1}, {"km", BT_UNIT_LENGTH, 1000, 1}, {"cm", BT_UNIT_LENGTH, 1, 100},
    {"mm", BT_UNIT_LENGTH, 1, 1000}, {"nmi", BT_UNIT_LENGTH, 1852, 1}, {"ft", BT_UNIT_LENGTH, 3048, 10000},
    {"m/s", BT_UNIT_SPEED, 1, 1}, {"cm/s", BT_UNIT_SPEED, 1, 100}, {"mm/s", BT_UNIT_SPEED, 1, 1000},
    {"km/h", BT_UNIT_SPEED, 1000, 3600}, {"kn", BT_UNIT_SPEED, 1852, 3600},
    {"ft/s", BT_UNIT_SPEED, 3048, 10000},
    {"s", BT_UNIT_TIME, 1, 1}, {"ms", BT_UNIT_TIME, 1, 1000}, {"min", BT_UNIT_TIME, 60, 1},
    {"h", BT_UNIT_TIME, 3600, 1}, {"d", BT_UNIT_TIME, 86400, 1},
    {"rad", BT_UNIT_ANGLE, 1, 1}, {"deg", BT_UNIT_ANGLE, BT_PI, 180}, {"°", BT_UNIT_ANGLE, BT_PI, 180},
    {"rad/s", BT_UNIT_TURN, 1, 1}, {"deg/s", BT_UNIT_TURN, BT_PI, 180},
    {"N", BT_UNIT_FORCE, 1, 1}, {"kN", BT_UNIT_FORCE, 1e3, 1}, {"MN", BT_UNIT_FORCE, 1e6, 1},
    {"GN", BT_UNIT_FORCE, 1e9, 1}, {"tf", BT_UNIT_FORCE, 9806.65, 1},
    {"kg", BT_UNIT_MASS, 1, 1}, {"g", BT_UNIT_MASS, 1, 1000}, {"t", BT_UNIT_MASS, 1e3, 1},
    {"kt", BT_UNIT_MASS, 1e6, 1}, {"Mt", BT_UNIT_MASS, 1e9, 1},
    {"kg/m3", BT_UNIT_DENSITY, 1, 1}, {"kg/m^3", BT_UNIT_DENSITY, 1, 1}, {"kg/m³", BT_UNIT_DENSITY, 1, 1},
    {"t/m3", BT_UNIT_DENSITY, 1000, 1}, {"g/cm3", BT_UNIT_DENSITY, 1000, 1},
    {"N s/m", BT_UNIT_DAMPING, 1, 1}, {"N*s/m", BT_UNIT_DAMPING, 1, 1}, {"kN s/m", BT_UNIT_DAMPING, 1e3, 1},
    {"kN*s/m", BT_UNIT_DAMPING, 1e3, 1},
    {"Pa", BT_UNIT_PRESSURE, 1, 1}, {"kPa", BT_UNIT_PRESSURE, 1e3, 1}, {"MPa", BT_UNIT_PRESSURE, 1e6, 1},
    {"N/m", BT_UNIT_LINE_LOAD, 1, 1}, {"kN/m", BT_UNIT_LINE_LOAD, 1e3, 1}, {"MN/m", BT_UNIT_LINE_LOAD, 1e6, 1},
    {"Pa m^0.5", BT_UNIT_TOUGHNESS, 1, 1}, {"kPa m^0.5", BT_UNIT_TOUGHNESS, 1e3, 1},
    {"MPa m^0.5", BT_UNIT_TOUGHNESS, 1e6, 1}, {"kPa√m", BT_UNIT_TOUGHNESS, 1e3, 1},
    {"MPa√m", BT_UNIT_TOUGHNESS, 1e6, 1},
};
enum { N_UNITS = sizeof units / sizeof *units };

// Units written out as words are read, but neither listed nor written.
static const struct {
    const char *word, *symbol;
} words[] = {{"foot", "ft"},   {"feet", "ft"},  {"knot", "kn"},    {"knots", "kn"}, {"second", "s"}, {"seconds", "s"},
             {"minute", "min"}, {"minutes", "min"}, {"hour", "h"}, {"hours", "h"},  {"day", "d"},    {"days", "d"},
             {"tonne-force", "tf"}, {"tonnes-force", "tf"}};

// froude: with g and the densities kept, time ~ L^1/2 and mass ~ L^3, so that a kind of dimension mass^a length^b
// time^c has the exponent 3 a + b + c/2.
static const struct {
    const char *noun, *symbol, *bare;
    double froude;
} kinds[BT_UNIT_KINDS] = {
    [BT_UNIT_NONE] = {"a plain number", "", "-", 0},
    [BT_UNIT_RATIO] = {"a ratio", "", "-", 0},
    [BT_UNIT_LENGTH] = {"a length", "m", "m", 1},
    [BT_UNIT_SPEED] = {"a speed", "m/s", "m/s", 0.5},
    [BT_UNIT_TIME] = {"a time", "s", "s", 0.5},
    [BT_UNIT_ANGLE] = {"an angle", "rad", "deg", 0},
    [BT_UNIT_TURN] = {"a rate of turn", "rad/s", "deg/s", -0.5},
    [BT_UNIT_FORCE] = {"a force", "N", "N", 3},
    [BT_UNIT_MASS] = {"a mass", "kg", "kg", 3},
    [BT_UNIT_DENSITY] = {"a density", "kg/m3", "kg/m3", 0},
    [BT_UNIT_DAMPING] = {"a damping", "N s/m", "N s/m", 2.5},
    [BT_UNIT_PRESSURE] = {"a pressure", "Pa", "Pa", 1},
    [BT_UNIT_LINE_LOAD] = {"a force per length", "N/m", "N/m", 2},
    [BT_UNIT_TOUGHNESS] = {"a fracture toughness", "Pa m^0.5", "Pa m^0.5", 1.5},
};

double bt_units_froude(bt_unit kind) { return kinds[kind].froude; }
const char *bt_units_symbol(bt_unit kind) { return kinds[kind].symbol; }
const char *bt_units_bare(bt_unit kind) { return kinds[kind].bare; }

bool bt_units_entry(int k, bt_unit_entry *out)
{
    if (k < 0 || k >= N_UNITS) return false;
    *out = units[k];
    return true;
}

// Length of a decimal number at the start of s, 0 if there is none: [+-] digits [. digits] [e [+-] digits]. An "e"
// without digits after it is left to the unit.
static size_t number_length(const char *s)
{
    size_t i = 0, digits = 0;
    if (s[i] == '+' || s[i] == '-') i++;
    for (; isdigit((unsigned char)s[i]); i++) digits++;
    if (s[i] == '.')
        for (i++; isdigit((unsigned char)s[i]); i++) digits++;
    if (!digits) return 0;
    if (s[i] == 'e' || s[i] == 'E') {
        size_t j = i + 1;
        if (s[j] == '+' || s[j] == '-') j++;
        if (isdigit((unsigned char)s[j])) {
            while (isdigit((unsigned char)s[j])) j++;
            i = j;
        }
    }
    return i;
}

static void list_units(bt_unit kind, char *out, size_t size)
{
    size_t used = 0;
    out[0] = 0;
    for (int i = 0; i < N_UNITS; i++)
        if (units[i].kind == kind)
            used += (size_t)snprintf(out + used, size - used, "%s%s", used ? ", " : "", units[i].symbol);
}

static const bt_unit_entry *find_unit(const char *symbol, size_t n, bt_unit kind)
{
    for (size_t i = 0; i < sizeof words / sizeof *words; i++)
        if (strlen(words[i].word) == n && !memcmp(words[i].word, symbol, n))
            symbol = words[i].symbol, n = strlen(symbol);
    for (int i = 0; i < N_UNITS; i++)
        if ((kind == BT_UNIT_KINDS || units[i].kind == kind) && strlen(units[i].symbol) == n &&
            !memcmp(units[i].symbol, symbol, n))
            return &units[i];
    return NULL;
}

static bool refuse_unit(const char *number, size_t n_number, const char *symbol, size_t n, bt_unit kind, char *why)
{
    char known[160];
    list_units(kind, known, sizeof known);
    const bt_unit_entry *other = find_unit(symbol, n, BT_UNIT_KINDS);
    int shown = n > 24 ? 24 : (int)n, digits = n_number > 24 ? 24 : (int)n_number;
    const char *cut = n > 24 ? "..." : "";
    if (!*known)
        snprintf(why, BT_WHY, "\"%.*s%s\" after the number; give a plain number, as in %.*s", shown, symbol, cut,
                 digits, number);
    else if (other)
        snprintf(why, BT_WHY, "%s is the unit of %s, but this is %s; use %s", other->symbol, kinds[other->kind].noun,
                 kinds[kind].noun, known);
    else
        snprintf(why, BT_WHY, "\"%.*s%s\" is not a unit of %s; use %s", shown, symbol, cut,
                 kinds[kind].noun + (kinds[kind].noun[1] == 'n' ? 3 : 2), known);
    return false;
}

bool bt_units_parse(const char *text, bt_unit kind, double *value, char why[BT_WHY])
{
    while (isspace((unsigned char)*text)) text++;
    size_t n = number_length(text);
    if (!n) {
        snprintf(why, BT_WHY, "\"%.40s%s\" is not a number; give %s%s%s", text, strlen(text) > 40 ? "..." : "",
                 kinds[kind].noun, *kinds[kind].symbol ? ", as in 1.5 " : "",
                 *kinds[kind].symbol ? kinds[kind].bare : "");
        return false;
    }
    const char *symbol = text + n;
    if (*symbol == ',' && isdigit((unsigned char)symbol[1])) {
        const bool decimals = !memchr(text, '.', n) && strspn(symbol + 1, "0123456789") != 3; // else thousands, perhaps
        char mended[64] = "";
        if (decimals) snprintf(mended, sizeof mended, ", as in %.*s.%.20s", n > 20 ? 20 : (int)n, text, symbol + 1);
        snprintf(why, BT_WHY, "%.40s has a comma; write decimals with a point%s, and thousands without a "
                              "separator", text,
                 mended);
        return false;
    }
    while (isspace((unsigned char)*symbol)) symbol++;
    size_t n_symbol = strlen(symbol);
    while (n_symbol && isspace((unsigned char)symbol[n_symbol - 1])) n_symbol--;

    double number = strtod(text, NULL);
    const bt_unit_entry *unit = NULL;
    if (n_symbol) {
        unit = find_unit(symbol, n_symbol, kind);
        if (!unit) return refuse_unit(text, n, symbol, n_symbol, kind, why);
    } else if (kind == BT_UNIT_ANGLE || kind == BT_UNIT_TURN) {
        unit = find_unit(kinds[kind].bare, strlen(kinds[kind].bare), kind);
    }
    if (number == 0 && strcspn(text, "123456789") < strcspn(text, "eE") && strcspn(text, "123456789") < n) {
        snprintf(why, BT_WHY, "%.*s is too small a number; give 0, or at least 1e-300",
                 n > 40 ? 40 : (int)n, text);
        return false;
    }
    double si = unit ? number * unit->up / unit->down : number;
    if (!isfinite(si)) {
        snprintf(why, BT_WHY, "%.*s is too large a number; give at most 1e308",
                 n > 40 ? 40 : (int)n, text);
        return false;
    }
    *value = si;
    return true;
}

int bt_units_format(double value, bt_unit kind, char *out, size_t size)
{
    if (isnan(value)) return snprintf(out, size, "none");
    char digits[40];
    for (int precision = 15; precision <= 17; precision++) {
        snprintf(digits, sizeof digits, "%.*g", precision, value);
        double back = strtod(digits, NULL);
        if (!memcmp(&back, &value, sizeof back)) break;
    }
    const char *symbol = kinds[kind].symbol;
    return snprintf(out, size, "%s%s%s", digits, *symbol ? " " : "", symbol);
}

const char *bt_force_text(char out[32], double newton)
{
    static const char *const unit[] = {"N", "kN", "MN", "GN", "TN"};
    if (isnan(newton)) {
        snprintf(out, 32, "–");
        return out;
    }
    double value = newton;
    int k = 0;
    // "%#.4g" turns 999.95 into "1000.", so the unit is that of the rounded number
    while (fabs(value) >= 999.95 && isfinite(value) && k < (int)(sizeof unit / sizeof *unit) - 1) value /= 1000, k++;
    snprintf(out, 32, fabs(value) < 999.95 ? "%#.4g %s" : "%.4g %s", value, unit[k]);
    return out;
}
