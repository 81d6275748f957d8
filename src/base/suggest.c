// SPDX-License-Identifier: MIT
// Edit distance between words and the nearest entry of a list.
#include "base/suggest.h"

#include <string.h>

enum { LONGEST = 63 };

static int min3(int a, int b, int c)
{
    int m = a < b ? a : b;
    return m < c ? m : c;
}

int bt_suggest_distance(const char *a, const char *b, int enough)
{
    size_t na = strlen(a), nb = strlen(b);
    // Each byte more is an edit at least.
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
