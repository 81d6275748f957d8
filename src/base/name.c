// SPDX-License-Identifier: MIT
// Names; see name.h.
#include "base/name.h"

#include <ctype.h>
#include <string.h>

bool bt_is_name(const char *s, int most)
{
    for (const char *p = s; *p; p++)
        if (!islower((unsigned char)*p) && *p != '_' && !(p > s && isdigit((unsigned char)*p))) return false;
    return *s && strlen(s) <= (size_t)most;
}
