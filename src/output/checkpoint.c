// SPDX-License-Identifier: MIT
// Files of checkpoints: written under a temporary name, renamed in turn, read with the previous one as a fallback.
#include "output/checkpoint.h"

#include <inttypes.h>
#include <string.h>
#include <unistd.h>

#include "base/checksum.h"
#include "base/fileio.h"
#include "base/snapshot.h"

// --- units and axes of saved arrays ----------------------------------------------------------------------------------

typedef struct {
    const char *name, *units, *meaning; ///< units: NULL = text
    const char *axes;                   ///< h5dataset.h
} row;

static const row rows[] = {
    // origin and duration: not part of the state
    {"about/program", NULL, "program that wrote it", "one"},
    {"about/revision", NULL, "revision of its sources", "one"},
    {"about/written", NULL, "date and time at which it was written", "one"},
    {"about/command_line", NULL, "command line of the run", "one"},
    {"about/case_as_given", NULL, "the case file as it was given, with a document of what was set", "one"},
    {"about/case_path", NULL, "path of the case file", "one"},
    {"about/run", NULL, "identity of the run: digest of its case, its tables and its ice", "one"},
    {"about/ranks", "1", "MPI ranks of the run", "one"},
    {"about/threads", "1", "threads of each rank", "one"},
    {"clock/phases", "s", "wall time of each phase of the steps", "phase"},
    {"clock/shared", "s", "wall time of each phase in multithreaded passes", "phase"},
    {"clock/wall_time", "s", "wall time of the run so far", "one"},
    {"case/resolved", NULL, "the case with every key, in SI units", "one"},
    {"case/current", "s, m/s, m/s", "table of the current: time, x, y", "current_row time_x_y"},
    {"case/wind", "s, m/s, m/s", "table of the wind: time, x, y", "wind_row time_x_y"},
    // the world
    {"world/hash", "1", "hash of the state", "one"},
    {"contacts/added_laws", NULL, "contact laws that the program added, in the order of their indices", "one"},
    {"forces/added_laws", NULL, "force laws that the program added and that have acted, in order", "one"},
    // loads and counts of written rows
    {"impacts/open", "1", "collisions under way, a row each, columns in SI units", "impact column"},
    {"collisions/sum", "N", "panel loads of the sample under way: force x, y, normal", "panel panel_force"},
    {"collisions/panel_blocks", "N", "panel loads summed over blocks of steps", "panel_block panel_load"},
    {"record/entries", "1", "samples in result.h5", "one"},
    {"record/frames", "1", "frames in result.h5", "one"},
    {"record/law_series", NULL, "added series that are forces of laws", "one"},
    {"record/merged_steps", "1", "steps merged into the sample under way", "one"},
    {"run/frames_due", "1", "frames that are due so far", "one"},
    {"run/unconverged_in_a_row", "1", "steps without convergence one after the other", "one"},
    {"run/locked_steps", "1", "steps without a solution", "one"},
    {"run/energy_limit", "J", "largest kinetic energy of the bodies allowed by guard.energy; 0 = no limit", "one"},
    // the ice as it was
    {"field/offsets", "1", "floe i has the vertices offsets[i] up to offsets[i + 1]", "floe_end"},
    {"field/vertices", "m", "outlines, frame of the floe, anticlockwise about the centroid", "floe_vertex xy"},
    {"field/pose", "m, m, rad", "x, y, yaw of each floe at the start", "floe component"},
    {"field/thickness", "m", "thickness of each floe", "floe"},
    {"field/area", "m2", "area of each floe", "floe"},
    {"field/crs", NULL, "coordinate reference system of the map", "one"},
    {"field/nearly", NULL, "property names close to `thickness`, the first few", "one"},
    {"field/chart", NULL, "property names of an ice chart, the first few", "one"},
};

const char *bt_checkpoint_meaning(const char *name, const char **units, const char **axes)
{
    for (size_t k = 0; k < sizeof rows / sizeof *rows; k++)
        if (!strcmp(rows[k].name, name)) {
            *units = rows[k].units;
            *axes = rows[k].axes;
            return rows[k].meaning;
        }
    return NULL;
}

// --- files -----------------------------------------------------------------------------------------------------------

void bt_checkpoint_begin(bt_snapshot *snap, const char *dir, const char *name, bt_errors *err)
{
    bt_snapshot_create(snap, BT_BESIDE(BT_PATH(dir, name), ".tmp"), bt_checkpoint_meaning, err);
}

bt_status bt_checkpoint_write(bt_snapshot *snap, const char *dir, const char *name, bt_errors *err)
{
    const char *path = BT_PATH(dir, name), *before = BT_PATH(dir, BT_CHECKPOINT_BEFORE),
               *damaged = BT_PATH(dir, BT_CHECKPOINT_DAMAGED), *part = BT_BESIDE(path, ".tmp");
    bt_status status = bt_snapshot_close(snap, err);
    if (status == BT_OK && !strcmp(name, BT_CHECKPOINT_FILE) && access(path, F_OK) == 0) {
        // A checkpoint that has been damaged meanwhile must not replace a sound one.
        const bool sound = bt_checksum_check(path, BT_CHECKSUM_CHECKPOINT, NULL, NULL) == BT_OK;
        status = bt_file_rename(path, sound ? before : damaged, err);
    }
    if (status == BT_OK) status = bt_file_rename(part, path, err);
    if (status != BT_OK) unlink(part);
    return status;
}

static bool there(const char *dir, const char *name, char **path)
{
    *path = bt_file_join(dir, name);
    return access(*path, F_OK) == 0;
}

bt_status bt_checkpoint_read(bt_snapshot *snap, const char *dir, char **path, char **said, bt_errors *err)
{
    *said = NULL;
    char *before;
    bt_errors why = {0};
    const bool first = there(dir, BT_CHECKPOINT_FILE, path), second = there(dir, BT_CHECKPOINT_BEFORE, &before);
    bt_status status = first ? bt_snapshot_read(snap, *path, &why) : BT_ERR_IO;
    if (status != BT_OK && second) {
        const bt_status other = bt_snapshot_read(snap, before, first ? NULL : &why);
        if (other == BT_OK) {
            *said = bt_text_of("%s; %s is taken, step %" PRId64,
                               first ? why.text[0] : "the last checkpoint is missing", before,
                               bt_snapshot_int(snap, "world/step"));
            free(*path);
            *path = before;
            before = NULL;
            status = BT_OK;
        } else if (!first) {
            status = other;
        }
    }
    if (status != BT_OK && !first && !second)
        bt_errors_add(err, "%s: holds no checkpoint; give the folder of a run that was stopped", dir);
    if (status != BT_OK) bt_errors_move(err, &why);
    if (status == BT_OK) snap->err = err, snap->faulty = false;
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
    unlink(BT_PATH(dir, BT_CHECKPOINT_BEFORE));
    unlink(BT_PATH(dir, BT_CHECKPOINT_FILE));
}

/// Print dimensions and type of an array, and its numbers if they are few.
static void print_item(const bt_item *item)
{
    static const char *const kinds[BT_ITEM_TYPES] = {
        [BT_ITEM_F64] = "float64", [BT_ITEM_I64] = "int64", [BT_ITEM_I32] = "int32", [BT_ITEM_U32] = "uint32",
        [BT_ITEM_U16] = "uint16",  [BT_ITEM_U8] = "uint8",  [BT_ITEM_TEXT] = "text"};
    printf("%-28s %-8s", item->name, kinds[item->type]);
    if (item->type == BT_ITEM_TEXT) {
        putchar(' ');
        for (const unsigned char *c = item->data; *c && c < (const unsigned char *)item->data + 60; c++)
            putchar(*c == '\n' || (*c >= 0x20 && *c != 0x7F) ? *c : '?');
        if (strlen(item->data) > 60) printf(" ...");
    } else if (item->n * item->width > 6 || item->n == 0) {
        printf(" [%" PRId64 "][%d]", item->n, item->width);
    } else {
        char text[40];
        for (int64_t k = 0; k < item->n * item->width; k++) printf(" %s", bt_item_number(item, k, text));
    }
    putchar('\n');
}

bt_status bt_checkpoint_print(const char *path, bt_errors *err)
{
    bt_snapshot snap;
    const bt_status status = bt_snapshot_read(&snap, path, err);
    for (int k = 0; k < snap.n; k++) print_item(&snap.item[k]);
    bt_snapshot_free(&snap);
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
