// SPDX-License-Identifier: MIT
// Windows in which the towed body stood still; what they are: output/stall.h.
#include "output/stall.h"

#include <math.h>

#include "tow/tow.h"
#include "bergtow/world.h"
#include "base/elementary.h"

void bt_stall_add(bt_stall *s, double asked, double dt, const double at[2], double ice, double pull, double path)
{
    if (!s->begun) { // where the body was before its first step is not known: the window begins after it
        s->from_x = at[0], s->from_y = at[1];
        s->begun = true;
        return;
    }
    if (!(asked > 0)) return; // a tow that holds asks for nothing
    s->asked += asked;
    s->spent += dt;
    s->ice += ice * dt;
    s->pull += pull * dt;
    if (s->asked < path) return;
    const double way = bt_hypot(at[0] - s->from_x, at[1] - s->from_y);
    if (way < BT_STALL_SHARE * s->asked && s->pull > 0 && s->ice >= BT_STALL_HELD * s->pull) {
        s->windows++;
        s->time += s->spent;
    }
    s->asked = s->spent = s->ice = s->pull = 0;
    s->from_x = at[0], s->from_y = at[1];
}

void bt_stall_step(bt_stall *s, const bt_world *w, double ice, double pull, double path)
{
    const bt_tow *t = w->tow;
    if (!t || t->mode == BT_TOW_NONE || t->mode == BT_TOW_SPEED) return;
    bt_stall_add(s, w->par.dt * bt_tow_speed(t, t->time), w->par.dt, (const double[]){t->travel_x, t->travel_y}, ice,
                 pull, path);
}
