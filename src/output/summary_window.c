// SPDX-License-Identifier: MIT
// What the moving window did, and when its ice is not that of a long domain.
#include "output/summary_window.h"
#include "case/warning.h"

#include <stdio.h>

#define SHARE_LIMIT 0.01 // of the floes that went round as they were, or are missing, above which it is reported

void bt_summary_window_print(const bt_window *v)
{
    if (!v) return;
    printf("  moving window       %.3g times its length; %lld floes renewed, %lld kept, %lld places missed, %lld floes "
           "wait\n",
           bt_window_laps(v), (long long)v->renewed, (long long)v->kept, (long long)v->missed, (long long)v->waiting);
}

void bt_summary_window_warn_laps(bt_errors *warnings, double laps)
{
    if (!(laps > 1)) return;
    bt_warn(warnings, BT_WARN_WINDOW_LAPS,
            "the moving window goes %.2f times its length through the ice: the body meets the same field "
            "again after each, with the hole in which it stood at time zero; samples a length apart are not "
            "independent, and the standard error may be too small; take a longer domain, or several values of "
            "ice.seed",
            laps);
}

void bt_summary_window_warn(bt_errors *warnings, const bt_window *v)
{
    if (!v) return;
    const double places = (double)(v->renewed + v->missed),
                 floes = (double)(v->renewed + v->kept);
    if (v->overtaken > v->stride)
        bt_warn(warnings, BT_WARN_ICE_OVERTOOK,
                "ice overtook the body, which fell %.3g m back through it: wind, current or tide carried the ice "
                "faster than the tow, and what came from behind was the ice of the window once more, which is "
                "renewed ahead only; set domain.ends: periodic or open, or tow faster",
                v->overtaken);
    bt_summary_window_warn_laps(warnings, bt_window_laps(v));
    if (places > 0 && (double)v->missed > SHARE_LIMIT * places)
        bt_warn(warnings, BT_WARN_PLACES_MISSED,
                "%.1f %% of the places at the front of the moving window stayed empty: the body carries their floes "
                "along, or pushes them far ahead; the ice that it meets is thinner by that; take a longer domain",
                100 * (double)v->missed / places);
    if (floes > 0 && (double)v->kept > SHARE_LIMIT * floes)
        bt_warn(warnings, BT_WARN_FLOES_KEPT,
                "%.1f %% of the floes behind the moving window came back ahead as they were, their places not being "
                "free: disturbed ice enters; take a longer domain, and more of it behind the body",
                100 * (double)v->kept / floes);
}
