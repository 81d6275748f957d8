// SPDX-License-Identifier: MIT
// Windows in which the towed body stood still; what they are: output/stall.h.
#include "output/stall.h"

#include <math.h>

#include "tow/tow.h"
#include "bergtow/world.h"
#include "base/elementary.h"

void bt_stall_add(bt_stall *s, double asked, double dt, double x, double y, double path)
{
    if (!s->begun) { // where the body was before its first step is not known: the window begins after it
        s->from_x = x, s->from_y = y;
        s->begun = true;
        return;
    }
    if (!(asked > 0)) return; // a tow that holds asks for nothing
    s->asked += asked;
    s->spent += dt;
    if (s->asked < path) return;
    if (bt_hypot(x - s->from_x, y - s->from_y) < BT_STALL_SHARE * s->asked) {
        s->windows++;
        s->time += s->spent;
    }
    s->asked = s->spent = 0;
    s->from_x = x, s->from_y = y;
}

void bt_stall_step(bt_stall *s, const bt_world *w, double path)
{
    const bt_tow *t = w->tow;
    if (!t || t->mode == BT_TOW_NONE || t->mode == BT_TOW_SPEED) return;
    bt_stall_add(s, w->par.dt * bt_tow_speed(t, t->time), w->par.dt, t->travel_x, t->travel_y, path);
}
