// SPDX-License-Identifier: MIT
// Values that a case leaves to the program, and that follow from the rest of it: `check` says what they became.
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "app/cmd_check.h"
#include "base/json.h"
#include "base/units.h"
#include "case/case_idle.h"
#include "case/schema.h"

enum { FIRST = 21, MOST = 118 }; // columns of a line

/// Is the value of this row one that follows, that has an effect, and that nobody changed?
static bool is_followed(const bt_case *c, const bt_key *k, double *value)
{
    if (k->type != BT_KEY_REAL || !k->preset || k->preset[0] != '=') return false;
    if (!strcmp(k->name, "domain.ahead") && c->domain.ends != BT_BOUND_MOVING) return false;
    memcpy(value, (const char *)c + k->offset, sizeof *value);
    return isfinite(*value) && !bt_case_is_unused(c, k->name) && !bt_case_changed(c, k->name);
}

void bt_check_print_defaults(const bt_case *c)
{
    int column = 0;
    for (int i = 0; i < bt_n_case_keys; i++) {
        const bt_key *k = &bt_case_keys[i];
        double value;
        char text[160];
        if (!is_followed(c, k, &value)) continue;
        const char *unit = bt_units_symbol(k->unit);
        if (fabs(value) < 1e-12) value = 0; // rounding
        const int n = snprintf(text, sizeof text, "%s %.4g%s%s", k->name, value, *unit ? " " : "", unit);
        const bool wraps = column > 0 && column + 2 + n > MOST;
        if (column == 0) column = printf("%-*s%s", FIRST, "by default", text);
        else if (wraps) column = printf(",\n%*s%s", FIRST, "", text) - 2;
        else column += printf(", %s", text);
    }
    if (column > 0) printf("\n");
}

void bt_check_write_defaults(bt_json *j, const bt_case *c)
{
    bt_json_open(j, "by_default", '{');
    for (int i = 0; i < bt_n_case_keys; i++) {
        double value;
        if (is_followed(c, &bt_case_keys[i], &value)) bt_json_number(j, bt_case_keys[i].name, value);
    }
    bt_json_close(j, '}');
}
