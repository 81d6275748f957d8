// SPDX-License-Identifier: MIT
// Shapes of the towed body, and those that a program adds; see body_shapes.h and bergtow/shape.h.
#include "case/body_shapes.h"

#include <string.h>

#include "base/name.h"

const char *bt_body_shapes[BT_OWN_SHAPES + BT_MAX_ADDED_SHAPES + 1] = {BT_SHAPE_NAMES, "polygon", "none", NULL};
static bt_shape_outline added[BT_MAX_ADDED_SHAPES];
static int n_added;

int bt_body_shape_named(bt_body_shape shape, double length, double width, double *v)
{
    const int k = (int)shape - BT_OWN_SHAPES;
    if (k >= 0) return added[k](length, width, v);
    return bt_shape_named(bt_body_shapes[shape], length, shape == BT_BODY_SQUARE ? length : width, v);
}

bt_status bt_shape_register(const char *name, bt_shape_outline outline, bt_errors *err)
{
    const size_t before = err->n;
    if (!name || !bt_is_name(name, BT_MOST_LAW_NAME))
        bt_errors_add(err, "shape \"%s\": the name must be of lower-case letters, digits and _, at most 40",
                      name ? name : "");
    for (int k = 0; err->n == before && bt_body_shapes[k]; k++)
        if (!strcmp(bt_body_shapes[k], name))
            bt_errors_add(err, "shape %s: there is a shape of this name; choose another", name);
    if (!outline) bt_errors_add(err, "shape %s: it has no function", name);
    if (n_added == BT_MAX_ADDED_SHAPES)
        bt_errors_add(err, "shape %s: there are %d of them; raise BT_MAX_ADDED_SHAPES", name, n_added);
    if (err->n > before) return BT_ERR_USAGE;
    double v[2 * BT_MAX_VERTICES];
    const int n = outline(2, 1, v);
    const char *fault = bt_shape_fault(n, v);
    if (fault) {
        bt_errors_add(err, "shape %s: of 2 m by 1 m it is no outline: %s", name, fault);
        return BT_ERR_USAGE;
    }
    added[n_added] = outline;
    bt_body_shapes[BT_OWN_SHAPES + n_added++] = name;
    return BT_OK;
}
