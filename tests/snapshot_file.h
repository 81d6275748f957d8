// SPDX-License-Identifier: MIT
// Write a snapshot from memory to a file.
#ifndef BERGTOW_TEST_SNAPSHOT_FILE_H
#define BERGTOW_TEST_SNAPSHOT_FILE_H

#include "output/checkpoint.h"
#include "base/snapshot.h"

static inline void add_items(bt_snapshot *to, const bt_snapshot *s)
{
    for (int k = 0; k < s->n; k++)
        bt_snapshot_add(to, s->item[k].name, s->item[k].type, s->item[k].n, s->item[k].width, s->item[k].data);
}

static inline bt_status write_snapshot(const bt_snapshot *s, const char *path, bt_item_meaning *meaning, bt_errors *err)
{
    bt_snapshot to = {0};
    bt_snapshot_create(&to, path, meaning, err);
    add_items(&to, s);
    const bt_status status = bt_snapshot_close(&to, err);
    bt_snapshot_free(&to);
    return status;
}

static inline bt_status write_checkpoint(const bt_snapshot *s, const char *dir, const char *name, bt_errors *err)
{
    bt_snapshot to = {0};
    bt_checkpoint_begin(&to, dir, name, err);
    add_items(&to, s);
    const bt_status status = bt_checkpoint_write(&to, dir, name, err);
    bt_snapshot_free(&to);
    return status;
}

#endif
