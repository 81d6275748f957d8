// SPDX-License-Identifier: MIT
// Names; see name.h.
#include "base/name.h"

#include <ctype.h>
#include <stdio.h>
#include <string.h>

bool (*bt_series_may_be)(const char *name, int more, bt_errors *err);

bool bt_is_name(const char *s, int most)
{
    for (const char *p = s; *p; p++)
        if (!islower((unsigned char)*p) && *p != '_' && !(p > s && isdigit((unsigned char)*p))) return false;
    return *s && strlen(s) <= (size_t)most;
}

bool bt_next_name(const char **names, char name[BT_LONGEST_KEY])
{
    if (!**names) return false;
    const size_t n = strcspn(*names, " ");
    snprintf(name, BT_LONGEST_KEY, "%.*s", (int)n, *names);
    *names += n + strspn(*names + n, " ");
    return true;
}
