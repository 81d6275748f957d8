// SPDX-License-Identifier: MIT
// Any bytes as GeoJSON outlines. Bits of the first byte: 0, 1 ice.nonconvex; 2 longitude and latitude; 3 periodic ends;
// 4 geographic frame; 5 as the file says (with 2: metres of the frame).
#include <math.h>
#include <string.h>

#include "bergtow/field.h"
#include "bergtow/outline.h"
#include "bergtow/shape.h"
#include "fuzz.h"
#include "case/ice_bounds.h"
#include "base/largest.h"

static bool prepare(bt_case *c, int how)
{
    bt_case_defaults(c);
    c->run.dt = 1, c->run.duration = 10;
    c->domain.length = c->domain.width = 1000;
    c->domain.ends = how & 8 ? BT_BOUND_PERIODIC : BT_BOUND_OPEN;
    c->domain.sides = how & 8 ? BT_BOUND_WALL : BT_BOUND_OPEN;
    c->domain.frame = how & 16 ? BT_FRAME_GEOGRAPHIC : BT_FRAME_BASIN;
    c->body.shape = BT_BODY_ABSENT;
    c->tow.mode = BT_TOW_NONE;
    bt_errors err = {0};
    const bt_status status = bt_case_finish(c, &err);
    bt_errors_free(&err);
    c->ice.nonconvex = (bt_nonconvex)((how & 3) % 3);
    static const bt_crs crs[] = {BT_CRS_PLANE, BT_CRS_LONLAT, BT_CRS_FILE, BT_CRS_FRAME};
    c->ice.outlines_crs = crs[(how >> 2 & 1) + (how >> 4 & 2)];
    return status == BT_OK;
}

static void check_floes(const bt_field *f, bt_nonconvex nonconvex)
{
    for (bt_idx i = 0; i < f->n; i++) {
        const int n = (int)(f->offsets[i + 1] - f->offsets[i]);
        const double *v = f->vertices + 2 * f->offsets[i], *p = f->pose + 3 * (size_t)i;
        bt_parts parts;
        bt_fuzz_check(n <= BT_MAX_VERTICES && (nonconvex == BT_NONCONVEX_SPLIT ? bt_outline_split(n, v, &parts)
                                                                               : bt_shape_fault(n, v) == NULL),
                      "an outline was accepted that is no floe");
        char why[BT_ICE_WHY];
        const bt_ice_floe floe = {n, v, p[0], p[1], p[2], f->thickness[i], f->area[i], 1e-6};
        bt_fuzz_check(bt_ice_floe_fault(&floe, why, NULL) == NULL, "a floe beyond the bounds of ice was accepted");
        bt_fuzz_check(isfinite(p[0]) && isfinite(p[1]) && f->area[i] > 0 && f->thickness[i] > 0,
                      "a floe of no place, area or thickness");
    }
    bt_fuzz_check(f->n > 0 && f->concentration >= BT_LEAST_CONCENTRATION && f->concentration <= 1 + 1e-9,
                  "a field of no floe, or of no concentration");
}

void bt_fuzz_outlines(const uint8_t *data, size_t n)
{
    if (n < 1) return;
    bt_fuzz_file file = bt_fuzz_open(data + 1, n - 1);
    bt_case c;
    bt_fuzz_check(prepare(&c, data[0]), "the harness's own case is refused");
    c.ice.outlines = file.path;
    bt_field f;
    bt_field_init(&f);
    bt_errors err = {0};
    const bt_status status = bt_field_read_outlines(&c, &f, &err);
    bt_fuzz_reported(status, &err);
    if (status == BT_OK) check_floes(&f, c.ice.nonconvex);
    else bt_fuzz_check(f.n == 0, "a refused file left floes");
    bt_field_free(&f);
    c.ice.outlines = NULL;
    bt_case_free(&c);
    bt_fuzz_close(&file);
}
