// SPDX-License-Identifier: MIT
// Any bytes as a CSV table: rows in order, and values between them that no row exceeds.
#include <math.h>

#include "fuzz.h"
#include "base/table.h"

void bt_fuzz_table(const uint8_t *data, size_t n)
{
    bt_fuzz_file f = bt_fuzz_open(data, n);
    bt_table t = {0};
    bt_errors err = {0};
    const bt_status status = bt_table_read(&t, f.path, &err);
    bt_fuzz_reported(status, &err);
    bt_fuzz_check((status == BT_OK) == (t.n > 0), "an accepted table without rows, or a refused one with rows");
    const double most = t.n > 0 ? bt_table_fastest(&t) : 0;
    for (int64_t i = 0; i < t.n; i++) {
        bt_fuzz_check(i == 0 || t.row[3 * i] > t.row[3 * i - 3], "rows are not in order");
        const double next = i + 1 < t.n ? t.row[3 * i + 3] : 2 * t.row[3 * i];
        double v[2];
        bt_table_at(&t, t.row[3 * i] + 0.3 * (next - t.row[3 * i]), v);
        bt_fuzz_check(isfinite(v[0]) && isfinite(v[1]) && hypot(v[0], v[1]) <= most * (1 + 1e-12),
                      "a value between rows is beyond both");
    }
    bt_table_free(&t);
    bt_fuzz_close(&f);
}
