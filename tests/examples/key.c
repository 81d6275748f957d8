// SPDX-License-Identifier: MIT
// Example of a key of one's own: the draught that a pilot allows, and what a program makes of it.
#include "bergtow/case.h"
#include "bergtow/law_key.h"

static const bt_law_key pilot_keys[] = {
    {"depth", "m", "1 km", "(0, 1e4]", "depth of water along the tow, assumed"},
    {"clearance", "m", "2 m", "[0, 1e3]", "water to be left under the body"},
};
enum { N_PILOT_KEYS = 2 };

/// Water left under the towed body beyond the clearance, m; below 0 the tow is not allowed.
static inline double pilot_reserve(const bt_case *c)
{
    double own[N_PILOT_KEYS];
    bt_keys_get(c, "pilot", pilot_keys, N_PILOT_KEYS, own);
    return own[0] - own[1] - c->body.draft;
}
