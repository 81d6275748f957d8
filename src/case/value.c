// SPDX-License-Identifier: MIT
// Values of keys: strict reading of scalars with unit and range, and writing that keeps every bit.
#include "case/schema.h"

#include "base/largest.h"
#include "base/name.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <string.h>

static void *member_of(const bt_key *key, void *base) { return (char *)base + key->offset; }

bool bt_value_range(const bt_key *key, bt_range *range)
{
    *range = (bt_range){.lo = -INFINITY, .hi = INFINITY};
    if (!key->range) return true;
    char text[64], why[BT_WHY];
    size_t n = strlen(key->range);
    if (n < 5 || n >= sizeof text) return false;
    memcpy(text, key->range, n + 1);
    char *comma = strchr(text, ',');
    if (!comma || !strchr("[(", text[0]) || !strchr("])", text[n - 1])) return false;
    range->lo_open = text[0] == '(';
    range->hi_open = text[n - 1] == ')';
    *comma = text[n - 1] = 0;
    return bt_units_parse(text + 1, key->unit, &range->lo, why) &&
           bt_units_parse(comma + 1, key->unit, &range->hi, why) && range->lo < range->hi;
}

/// Suggest a percentage for a ratio of 2 or more (1.2 may as well be a slip for 0.12), or tenths for a concentration.
static void suggest_percent(const bt_key *key, const bt_range *range, double value, const char *text, char meant[80])
{
    const double tenths = value / 10;
    const bool chart = !strcmp(key->name, "ice.concentration") && value >= 1 && value <= 10 && !strchr(text, '%');
    if (chart && tenths <= range->hi)
        snprintf(meant, 80, "did you mean %g (ice charts count tenths) or %g %%? ", tenths, value);
    else if (chart) snprintf(meant, 80, "ice charts count tenths, and %g of them are %g; ", value, tenths);
    if (chart) return;
    const double ratio = value / 100;
    if (key->unit != BT_UNIT_RATIO || strchr(text, '%')) return;
    if (value < 2 || value > 100 || ratio < range->lo || ratio > range->hi) return;
    snprintf(meant, 80, "did you mean %g or %g %%? ", ratio, value);
}

bt_value bt_value_of(const bt_key *key, const void *base)
{
    const char *member = (const char *)base + key->offset;
    bt_value value = {.number = NAN};
    bool yes;
    unsigned choice;
    switch (key->type) {
    case BT_KEY_REAL: memcpy(&value.number, member, sizeof value.number); break;
    case BT_KEY_INT: memcpy(&value.whole, member, sizeof value.whole), value.number = (double)value.whole; break;
    case BT_KEY_BOOL: memcpy(&yes, member, sizeof yes), value.number = yes; break;
    case BT_KEY_CHOICE: memcpy(&choice, member, sizeof choice), value.text = key->choices[choice]; break;
    case BT_KEY_TEXT: memcpy(&value.text, member, sizeof value.text); break;
    case BT_KEY_POINTS:
        memcpy(&value.points, member, sizeof value.points);
        memcpy(&value.n, (const char *)base + key->offset_count, sizeof value.n);
        break;
    case BT_KEY_MAP: break;
    }
    return value;
}

double bt_value_number(const bt_key *key, const void *base) { return bt_value_of(key, base).number; }

static bool in_range(const bt_key *key, double value, const char *text, char *why)
{
    bt_range range;
    bt_value_range(key, &range);
    if ((range.lo_open ? value > range.lo : value >= range.lo) &&
        (range.hi_open ? value < range.hi : value <= range.hi)) return true;
    const char *bare = bt_units_bare(key->unit);
    bool plain = !strcmp(bare, "-");
    char meant[80] = "";
    suggest_percent(key, &range, value, text, meant);
    snprintf(why, BT_WHY, "%.40s is out of range; %sgive a value in %s%s%s", text, meant, key->range, plain ? "" : " ",
             plain ? "" : bare);
    return false;
}

static bool is_utf8(const char *text)
{
    size_t n = 1;
    for (const unsigned char *s = (const unsigned char *)text; *s && n; s += n) n = bt_utf8_length(s);
    return n > 0;
}

static bool read_real(const bt_key *key, void *base, const char *text, char *why)
{
    double v;
    if (!bt_value_read_coordinate(key, text, &v, why)) return false;
    memcpy(member_of(key, base), &v, sizeof v);
    return true;
}

static bool read_int(const bt_key *key, void *base, const char *text, char *why)
{
    const char *digits = text + (*text == '-' || *text == '+');
    size_t n = strspn(digits, "0123456789");
    if (!n || digits[n]) {
        snprintf(why, BT_WHY, "\"%.40s\" is not a whole number; give digits only", text);
        return false;
    }
    errno = 0;
    int64_t v = strtoll(text, NULL, 10);
    if (errno == ERANGE) {
        snprintf(why, BT_WHY, "%.40s is too large; give a value in %s", text, key->range);
        return false;
    }
    if (!in_range(key, (double)v, text, why)) return false;
    memcpy(member_of(key, base), &v, sizeof v);
    return true;
}

static bool read_bool(const bt_key *key, void *base, const char *text, char *why)
{
    static const char *const yes[] = {"true", "yes", "on"}, *const no[] = {"false", "no", "off"};
    for (int i = 0; i < 3; i++)
        if (!strcmp(text, yes[i]) || !strcmp(text, no[i])) {
            bool v = !strcmp(text, yes[i]);
            memcpy(member_of(key, base), &v, sizeof v);
            return true;
        }
    snprintf(why, BT_WHY, "\"%.40s\" is neither true nor false; give one of them", text);
    return false;
}

static bool read_choice(const bt_key *key, void *base, const char *text, char *why)
{
    for (int i = 0; key->choices[i]; i++)
        if (!strcmp(text, key->choices[i])) {
            // gcc gives an enum without negative members the type unsigned int
            _Static_assert(sizeof(bt_bound) == sizeof(unsigned) && sizeof(bt_body_shape) == sizeof(unsigned),
                           "enums are unsigned int");
            memcpy(member_of(key, base), &(unsigned){(unsigned)i}, sizeof(unsigned));
            return true;
        }
    char list[128] = "";
    for (int i = 0; key->choices[i]; i++)
        snprintf(list + strlen(list), sizeof list - strlen(list), "%s%s", i ? ", " : "", key->choices[i]);
    const char *near = bt_suggest(text, key->choices);
    if (near) snprintf(why, BT_WHY, "\"%.40s\" is not one of %s; did you mean %s?", text, list, near);
    else snprintf(why, BT_WHY, "\"%.40s\" is not known; give one of %s", text, list);
    return false;
}

static bool read_text(const bt_key *key, void *base, const char *text, char *why)
{
    size_t n = strlen(text);
    if (n > BT_MAX_TEXT || !is_utf8(text)) {
        snprintf(why, BT_WHY,
                 n > BT_MAX_TEXT ? "the text has %zu bytes; give at most %d"
                                 : "the text is not UTF-8; save it as UTF-8",
                 n, BT_MAX_TEXT);
        return false;
    }
    char *old, *copy = bt_alloc(n + 1, 1);
    memcpy(copy, text, n);
    memcpy(&old, member_of(key, base), sizeof old);
    free(old);
    memcpy(member_of(key, base), &copy, sizeof copy);
    return true;
}

bool bt_value_read_coordinate(const bt_key *key, const char *text, double *value, char why[BT_WHY])
{
    double v;
    if (!bt_units_parse(text, key->unit, &v, why) || !in_range(key, v, text, why)) return false;
    *value = v;
    return true;
}

bool bt_value_read(const bt_key *key, void *base, const char *text, bool plain, char why[BT_WHY])
{
    if (plain && (!*text || !strcmp(text, "~") || !strcmp(text, "null"))) {
        snprintf(why, BT_WHY, "has no value; give one or remove the key");
        return false;
    }
    bool absent = plain && !strcmp(text, "none") && key->preset &&
                  (key->preset[0] == '=' || key->at_sea || !strcmp(key->preset, "none"));
    switch (key->type) {
    case BT_KEY_REAL:
        if (!absent) return read_real(key, base, text, why);
        memcpy(member_of(key, base), &(double){NAN}, sizeof(double));
        return true;
    case BT_KEY_TEXT: {
        if (!absent) return read_text(key, base, text, why);
        char *old;
        memcpy(&old, member_of(key, base), sizeof old);
        free(old);
        memset(member_of(key, base), 0, sizeof old);
        return true;
    }
    case BT_KEY_INT: return read_int(key, base, text, why);
    case BT_KEY_BOOL: return read_bool(key, base, text, why);
    case BT_KEY_CHOICE: return read_choice(key, base, text, why);
    case BT_KEY_POINTS:
    case BT_KEY_MAP: break;
    }
    snprintf(why, BT_WHY, "needs a list of points; give it as [[x, y], [x, y], ...]");
    return false;
}

// A double-quoted YAML scalar. Control characters, line separators that YAML folds, and characters that libyaml refuses
// to read raw are escaped, in a form that is valid JSON, too.
static void write_text(const char *text, FILE *out)
{
    fputc('"', out);
    for (const unsigned char *s = (const unsigned char *)text; *s;) {
        unsigned code = *s;
        int n = code < 0x80 ? 1 : code < 0xE0 ? 2 : code < 0xF0 ? 3 : 4;
        if (n > 1) code &= 0x7Fu >> n;
        for (int i = 1; i < n; i++) code = code << 6 | (s[i] & 0x3Fu);
        if (code == '"' || code == '\\') fprintf(out, "\\%c", (int)code);
        else if (code < 0x20 || (code >= 0x7F && code <= 0xA0) || code == 0x2028 || code == 0x2029 || code == 0xFEFF ||
                 code == 0xFFFE || code == 0xFFFF)
            fprintf(out, "\\u%04X", code);
        else fwrite(s, 1, (size_t)n, out);
        s += n;
    }
    fputc('"', out);
}

void bt_value_write(const bt_key *key, const void *base, FILE *out)
{
    const bt_value value = bt_value_of(key, base);
    char number[64];
    switch (key->type) {
    case BT_KEY_REAL:
        bt_units_format(value.number, key->unit, number, sizeof number);
        fputs(number, out);
        break;
    case BT_KEY_INT: fprintf(out, "%" PRId64, value.whole); break;
    case BT_KEY_BOOL: fputs(value.number != 0 ? "true" : "false", out); break;
    case BT_KEY_CHOICE: fputs(value.text, out); break;
    case BT_KEY_TEXT:
        if (value.text) write_text(value.text, out);
        else fputs("none", out);
        break;
    case BT_KEY_MAP: break;
    case BT_KEY_POINTS:
        if (!value.n) fputs("none", out);
        for (int i = 0; i < value.n; i++) {
            fputs(i ? ", [" : "[[", out);
            for (int j = 0; j < 2; j++) {
                bt_units_format(value.points[2 * i + j], bt_schema_column(key, j).unit, number, sizeof number);
                fprintf(out, "%s%s", j ? ", " : "", number);
            }
            fputs(i == value.n - 1 ? "]]" : "]", out);
        }
        break;
    }
}

bt_key bt_schema_column(const bt_key *k, int column)
{
    bt_key c = *k;
    if (column == 0 && k->range_first) c.unit = k->unit_first, c.range = k->range_first;
    return c;
}
