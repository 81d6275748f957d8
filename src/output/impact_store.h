// SPDX-License-Identifier: MIT
// Collisions and panel loads in result.h5: /impacts row by row as they end, /panels (private to the recorder). On rank
// 0.
#ifndef BT_IMPACT_STORE_H
#define BT_IMPACT_STORE_H

#include "loads/impact.h"
#include "base/h5read.h"
#include "base/h5util.h"
#include "output/gather.h"
#include "output/impact_count.h"
#include "loads/panel.h"
#include "base/snapshot.h"

enum { BT_IMPACT_COLUMNS = 13 };

typedef struct bt_impact_store {
    bt_h5 *h;                         ///< NULL: nothing is stored
    const bt_impacts *from;           ///< their source
    double earliest;                  ///< the window of the statistics begins there or later, s
    hid_t column[BT_IMPACT_COLUMNS];  ///< [collisions] each
    bt_impact *rows;                  ///< [n_rows] not yet written
    int64_t n_rows, cap_rows, written;
    const bt_roster *roster;          ///< if floes may split; NULL: ids are rows
    int64_t n_bodies;                 ///< rows of /floes and /bodies
    bt_panel_blocks blocks;
    // series of panel loads, if asked for
    hid_t force, normal;              ///< [samples][panels][2] N, [samples][panels] N; −1 = none
    int n_panels;
    double *forces, *normals;         ///< [n_samples] of these: mean of the steps of a sample
    double *sum;                      ///< [3 n_panels] of the present sample
    int64_t n_merged, n_samples, cap_samples, samples_written;
} bt_impact_store;

/// Make the groups of the case; with output.panels also for the panel loads of every sample.
void bt_impact_store_create(bt_impact_store *store, bt_h5 *h5, const bt_impacts *impacts, const bt_case *input);
/// For runs whose floes may split: collisions refer to rows of /floes, /bodies (n_bodies together) and /pieces.
void bt_impact_store_pieces(bt_impact_store *store, const bt_roster *roster, int64_t n_bodies);
/// Take the collisions that ended in the last step, and its panel loads; time: end of the step, s. no_load: the loads
/// are not numbers: NaN in the series, zero in means and maxima, which are then lower bounds.
void bt_impact_store_take(bt_impact_store *store, double time, bool no_load);
/// End the present sample.
void bt_impact_store_end_sample(bt_impact_store *store);
/// Write the buffered data to the file.
void bt_impact_store_write(bt_impact_store *store);
/// When everything has been written: count the collisions of the file, one after the other.
void bt_impact_store_count(bt_impact_store *store, bt_impact_count *count);
/// Write means and maxima by panel, over the window `steady` and before it.
void bt_impact_store_totals(bt_impact_store *store, const bt_impact_count *c, const bt_steady *steady);
/// Save the state of the store, after bt_impact_store_write.
void bt_impact_store_save(const bt_impact_store *store, bt_snapshot *to);
/// Load that state: the data written by then comes from `old`, the result file of that run.
void bt_impact_store_load(bt_impact_store *store, bt_snapshot *from, bt_h5_reader *old);
void bt_impact_store_close(bt_impact_store *store);

#endif
