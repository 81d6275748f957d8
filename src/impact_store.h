// SPDX-License-Identifier: MIT
// Collisions and panel loads in result.h5: /impacts row by row as they end, /panels (private to the recorder). On rank 0.
#ifndef BT_IMPACT_STORE_H
#define BT_IMPACT_STORE_H

#include "bergtow/impact.h"
#include "h5read.h"
#include "h5util.h"
#include "snapshot.h"

enum { BT_IMPACT_COLUMNS = 13 };

typedef struct bt_impact_store {
    bt_h5 *h;                         ///< NULL: nothing is stored
    const bt_impacts *from;           ///< what is stored
    hid_t column[BT_IMPACT_COLUMNS];  ///< [collisions] each
    bt_impact *rows;                  ///< [n_rows] not yet written
    int64_t n_rows, cap_rows, written;
    // series of panel loads, if asked for
    hid_t force, normal;              ///< [samples][panels][2] N, [samples][panels] N; −1 = none
    int n_panels;
    double *forces, *normals;         ///< [n_samples] of these: mean of the steps of a sample
    double *sum;                      ///< [3 n_panels] of the present sample
    int64_t n_merged, n_samples, cap_samples, samples_written;
} bt_impact_store;

/// Make the groups. series: with the panel loads of every sample.
void bt_impact_store_create(bt_impact_store *s, bt_h5 *h, const bt_impacts *m, bool series);
/// Collisions that ended in the last step, and its panel loads.
void bt_impact_store_take(bt_impact_store *s);
/// Collisions alone: those that the end of the run has closed.
void bt_impact_store_take_closed(bt_impact_store *s);
/// The present sample is complete.
void bt_impact_store_end_sample(bt_impact_store *s);
/// What is kept into the file.
void bt_impact_store_write(bt_impact_store *s);
/// Means and maxima by panel.
void bt_impact_store_totals(bt_impact_store *s);
/// Where it stands, after bt_impact_store_write.
void bt_impact_store_save(const bt_impact_store *s, bt_snapshot *to);
/// Go on from there: what had been written by then comes from `old`, the result file of that run.
void bt_impact_store_load(bt_impact_store *s, bt_snapshot *from, bt_h5_reader *old);
void bt_impact_store_close(bt_impact_store *s);

#endif
