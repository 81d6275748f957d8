// SPDX-License-Identifier: MIT
// Names; see name.h.
#include "base/name.h"

#include <ctype.h>
#include <string.h>

bool (*bt_series_may_be)(const char *name, int more, bt_errors *err);

bool bt_is_name(const char *s, int most)
{
    for (const char *p = s; *p; p++)
        if (!islower((unsigned char)*p) && *p != '_' && !(p > s && isdigit((unsigned char)*p))) return false;
    return *s && strlen(s) <= (size_t)most;
}

void bt_name_check(const char *kind, const char *name, int most, bool taken, bt_errors *err)
{
    if (!bt_is_name(name, most))
        bt_errors_add(err, "%s \"%s\": the name must have only lower-case letters, digits and _, at most %d", kind,
                      name, most);
    else if (taken) bt_errors_add(err, "%s %s: this name is taken; choose another", kind, name);
}

size_t bt_utf8_length(const unsigned char *s)
{
    if (s[0] < 0x80) return 1;
    const size_t n = s[0] >= 0xc2 && s[0] <= 0xdf   ? 2
                     : (s[0] & 0xf0) == 0xe0        ? 3
                     : s[0] >= 0xf0 && s[0] <= 0xf4 ? 4
                                                    : 0;
    for (size_t i = 1; i < n; i++)
        if ((s[i] & 0xc0) != 0x80) return 0;
    if (s[0] == 0xe0 && s[1] < 0xa0) return 0; // overlong
    if (s[0] == 0xed && s[1] > 0x9f) return 0; // surrogates
    if (s[0] == 0xf0 && s[1] < 0x90) return 0;
    if (s[0] == 0xf4 && s[1] > 0x8f) return 0; // beyond U+10FFFF
    return n;
}

bool bt_next_name(const char **names, char name[BT_LONGEST_KEY])
{
    if (!**names) return false;
    const size_t n = strcspn(*names, " ");
    snprintf(name, BT_LONGEST_KEY, "%.*s", (int)n, *names);
    *names += n + strspn(*names + n, " ");
    return true;
}

// --- the closest word ------------------------------------------------------------------------------------------------

enum { LONGEST = 63 };

static int min3(int a, int b, int c)
{
    int m = a < b ? a : b;
    return m < c ? m : c;
}

int bt_suggest_distance(const char *a, const char *b, int enough)
{
    size_t na = strlen(a), nb = strlen(b);
    // Each byte of difference in length takes at least one edit.
    if (na > LONGEST || nb > LONGEST || (na > nb ? na - nb : nb - na) >= (size_t)enough) return LONGEST + 1;
    // d[i][j]: distance between the first i bytes of a and the first j of b
    int d[LONGEST + 1][LONGEST + 1];
    for (size_t i = 0; i <= na; i++) d[i][0] = (int)i;
    for (size_t j = 0; j <= nb; j++) d[0][j] = (int)j;
    for (size_t i = 1; i <= na; i++)
        for (size_t j = 1; j <= nb; j++) {
            int cost = a[i - 1] != b[j - 1];
            d[i][j] = min3(d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + cost);
            if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] && d[i - 2][j - 2] + 1 < d[i][j])
                d[i][j] = d[i - 2][j - 2] + 1;
        }
    return d[na][nb];
}

int bt_suggest_limit(const char *word)
{
    int limit = (int)(strlen(word) / 3);
    return limit < 1 ? 1 : limit;
}

const char *bt_suggest(const char *word, const char *const *list)
{
    const char *best = NULL;
    int least = bt_suggest_limit(word) + 1;
    for (; *list; list++) {
        int d = bt_suggest_distance(word, *list, least);
        if (d < least) {
            least = d;
            best = *list;
        }
    }
    return best;
}
