// SPDX-License-Identifier: MIT
// Files of checkpoints: written beside, renamed in turn, read with a second one to fall back on.
#include "output/checkpoint.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/fileio.h"
#include "base/checksum.h"
#include "base/snapshot.h"
#include "output/checkpoint_names.h"

static char *path_of_part(const char *dir, const char *name)
{
    char *path = bt_file_join(dir, name), *part = bt_text_of("%s.tmp", path);
    free(path);
    return part;
}

void bt_checkpoint_begin(bt_snapshot *s, const char *dir, const char *name, bt_errors *err)
{
    char *part = path_of_part(dir, name);
    bt_snapshot_create(s, part, bt_checkpoint_meaning, err);
    free(part);
}

bt_status bt_checkpoint_write(bt_snapshot *s, const char *dir, const char *name, bt_errors *err)
{
    char *path = bt_file_join(dir, name), *before = bt_file_join(dir, BT_CHECKPOINT_BEFORE),
         *damaged = bt_file_join(dir, BT_CHECKPOINT_DAMAGED), *part = path_of_part(dir, name);
    bt_status status = bt_snapshot_close(s, err);
    if (status == BT_OK && !strcmp(name, BT_CHECKPOINT_FILE) && access(path, F_OK) == 0) {
        // One that has been damaged meanwhile must not take the place of a sound one.
        bt_errors unheard = {0};
        const bool sound = bt_checksum_check(path, BT_CHECKSUM_CHECKPOINT, NULL, &unheard) == BT_OK;
        status = bt_file_rename(path, sound ? before : damaged, err);
        bt_errors_free(&unheard);
    }
    if (status == BT_OK) status = bt_file_rename(part, path, err);
    if (status != BT_OK) unlink(part);
    free(path);
    free(before);
    free(damaged);
    free(part);
    return status;
}

static bool there(const char *dir, const char *name, char **path)
{
    *path = bt_file_join(dir, name);
    return access(*path, F_OK) == 0;
}

bt_status bt_checkpoint_read(bt_snapshot *s, const char *dir, char **path, char **said, bt_errors *err)
{
    *said = NULL;
    char *before;
    bt_errors why = {0};
    const bool first = there(dir, BT_CHECKPOINT_FILE, path), second = there(dir, BT_CHECKPOINT_BEFORE, &before);
    bt_status status = first ? bt_snapshot_read(s, *path, &why) : BT_ERR_IO;
    if (status != BT_OK && second) {
        bt_errors unheard = {0};
        const bt_status other = bt_snapshot_read(s, before, first ? &unheard : &why);
        if (other == BT_OK) {
            *said = bt_text_of("%s; %s is taken, step %" PRId64,
                               first ? why.text[0] : "the last checkpoint is missing", before,
                               bt_snapshot_int(s, "world/step"));
            free(*path);
            *path = before;
            before = NULL;
            status = BT_OK;
        } else if (!first) {
            status = other;
        }
        bt_errors_free(&unheard);
    }
    if (status != BT_OK && !first && !second)
        bt_errors_add(err, "%s: holds no checkpoint; give the folder of a run that was stopped", dir);
    if (status != BT_OK) bt_errors_move(err, &why);
    if (status == BT_OK) s->err = err, s->faulty = false;
    bt_errors_free(&why);
    free(before);
    return status;
}

bool bt_checkpoint_there(const char *dir)
{
    return bt_file_there(dir, BT_CHECKPOINT_FILE) || bt_file_there(dir, BT_CHECKPOINT_BEFORE);
}

void bt_checkpoint_remove(const char *dir)
{
    static const char *const names[] = {BT_CHECKPOINT_BEFORE, BT_CHECKPOINT_FILE};
    for (int k = 0; k < 2; k++) {
        char *path = bt_file_join(dir, names[k]);
        unlink(path);
        free(path);
    }
}

/// Dimensions and kind of an array, and its numbers where they are few.
static void print_item(const bt_item *i)
{
    static const char *const kinds[BT_ITEM_TYPES] = {
        [BT_ITEM_F64] = "float64", [BT_ITEM_I64] = "int64", [BT_ITEM_I32] = "int32", [BT_ITEM_U32] = "uint32",
        [BT_ITEM_U16] = "uint16",  [BT_ITEM_U8] = "uint8",  [BT_ITEM_TEXT] = "text"};
    printf("%-28s %-8s", i->name, kinds[i->type]);
    if (i->type == BT_ITEM_TEXT) {
        putchar(' ');
        for (const unsigned char *c = i->data; *c && c < (const unsigned char *)i->data + 60; c++)
            putchar(*c == '\n' || (*c >= 0x20 && *c != 0x7F) ? *c : '?');
        if (strlen(i->data) > 60) printf(" ...");
    } else if (i->n * i->width > 6 || i->n == 0) {
        printf(" [%" PRId64 "][%d]", i->n, i->width);
    } else {
        char text[40];
        for (int64_t k = 0; k < i->n * i->width; k++) printf(" %s", bt_item_number(i, k, text));
    }
    putchar('\n');
}

bt_status bt_checkpoint_print(const char *path, bt_errors *err)
{
    bt_snapshot s;
    const bt_status status = bt_snapshot_read(&s, path, err);
    for (int k = 0; k < s.n; k++) print_item(&s.item[k]);
    bt_snapshot_free(&s);
    return status;
}

bt_status bt_checkpoint_compare(const char *a, const char *b, char **difference, bt_errors *err)
{
    bt_snapshot x, y = {0};
    char text[400];
    *difference = NULL;
    bt_status status = bt_snapshot_read(&x, a, err);
    if (status == BT_OK) status = bt_snapshot_read(&y, b, err);
    if (status == BT_OK && bt_snapshot_differ(&x, &y, text)) *difference = bt_text_copy(text);
    bt_snapshot_free(&x);
    bt_snapshot_free(&y);
    return status;
}
