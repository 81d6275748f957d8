// SPDX-License-Identifier: MIT
// A set of named arrays: adding, taking, sharing, comparing.
#include "base/snapshot.h"
#include "base/inside.h"

#include <inttypes.h>
#include <string.h>

size_t bt_item_size(bt_item_type type)
{
    static const size_t size[BT_ITEM_TYPES] = {
        [BT_ITEM_F64] = 8, [BT_ITEM_I64] = 8, [BT_ITEM_I32] = 4, [BT_ITEM_U32] = 4,
        [BT_ITEM_U16] = 2, [BT_ITEM_U8] = 1,  [BT_ITEM_TEXT] = 1};
    return size[type];
}

static size_t bytes_of(const bt_item *item) { return (size_t)item->n * (size_t)item->width * bt_item_size(item->type); }

// --- adding ----------------------------------------------------------------------------------------------------------

void *bt_snapshot_begin(bt_snapshot *snap, const char *name, bt_item_type type, int64_t n, int width)
{
    BT_MAKE_ROOM(snap->item, snap->n, snap->cap, 64);
    bt_item *item = &snap->item[snap->n++];
    *item = (bt_item){.name = bt_text_copy(name), .type = type, .n = n, .width = width};
    snap->rows = 0;
    if (snap->sink) snap->sink->begin(snap);
    else item->data = bt_alloc(bytes_of(item), 1);
    return item->data;
}

void bt_snapshot_put(bt_snapshot *snap, int64_t n, const void *rows)
{
    const bt_item *item = &snap->item[snap->n - 1];
    const size_t row = (size_t)item->width * bt_item_size(item->type);
    if (snap->sink) snap->sink->put(snap, n, rows);
    else if (n > 0) memcpy((char *)item->data + (size_t)snap->rows * row, rows, (size_t)n * row);
    snap->rows += n;
}

void bt_snapshot_add(bt_snapshot *snap, const char *name, bt_item_type type, int64_t n, int width, const void *data)
{
    bt_snapshot_begin(snap, name, type, n, width);
    bt_snapshot_put(snap, n, data);
}

void bt_snapshot_add_text(bt_snapshot *snap, const char *name, const char *text)
{
    bt_snapshot_add(snap, name, BT_ITEM_TEXT, (int64_t)strlen(text) + 1, 1, text);
}
void bt_snapshot_add_int(bt_snapshot *snap, const char *name, int64_t value)
{
    bt_snapshot_add(snap, name, BT_ITEM_I64, 1, 1, &value);
}
void bt_snapshot_add_real(bt_snapshot *snap, const char *name, double value)
{
    bt_snapshot_add(snap, name, BT_ITEM_F64, 1, 1, &value);
}

void bt_snapshot_begin_row(bt_snapshot *snap, const char *group, const bt_state_row *row, int64_t n)
{
    char name[128];
    snprintf(name, sizeof name, "%s/%s", group, row->name);
    bt_snapshot_begin(snap, name, row->type, n, row->width);
    bt_item *item = &snap->item[snap->n - 1];
    item->units = row->units, item->meaning = row->meaning, item->axes = row->axes;
}

void bt_snapshot_add_row(bt_snapshot *snap, const char *group, const bt_state_row *row, int64_t n, const void *data)
{
    bt_snapshot_begin_row(snap, group, row, n);
    bt_snapshot_put(snap, n, data);
}

void bt_snapshot_add_rows(bt_snapshot *snap, const char *group, const bt_state_row *row, int n_rows, const void *base)
{
    for (int k = 0; k < n_rows; k++)
        bt_snapshot_add_row(snap, group, &row[k], 1, (const char *)base + row[k].offset);
}

void bt_snapshot_free(bt_snapshot *snap)
{
    if (snap->sink) snap->sink->drop(snap);
    for (int k = 0; k < snap->n; k++) {
        free(snap->item[k].name);
        free(snap->item[k].data);
    }
    free(snap->item);
    *snap = (bt_snapshot){0};
}

// --- taking ----------------------------------------------------------------------------------------------------------

const bt_item *bt_snapshot_find(const bt_snapshot *snap, const char *name)
{
    for (int k = 0; k < snap->n; k++)
        if (!strcmp(snap->item[k].name, name)) return &snap->item[k];
    return NULL;
}

static void complain(bt_snapshot *snap, const char *name, const char *what)
{
    if (!snap->faulty && snap->err)
        bt_errors_add(
            snap->err,
            "%s: /%s %s; it was written by another version of the program: use that one, or start the run again",
            snap->path ? snap->path : "checkpoint", name, what);
    snap->faulty = true;
}

void bt_snapshot_want(bt_snapshot *snap, bool good, const char *name, int64_t row, const char *what)
{
    if (good) return;
    char where[32] = "";
    if (row >= 0) snprintf(where, sizeof where, ", row %" PRId64 ",", row);
    if (!snap->faulty && snap->err)
        bt_errors_add(snap->err, "%s: /%s%s %s; no run writes that: use another checkpoint, or start the run again",
                      snap->path ? snap->path : "checkpoint", name, where, what);
    snap->faulty = true;
}

static bool yes_and_no(const bt_item *item)
{
    for (int64_t k = 0; k < item->n * item->width; k++)
        if (((const uint8_t *)item->data)[k] > 1) return false;
    return true;
}

static const bt_item *demand(bt_snapshot *snap, const char *name, bt_item_type type, int64_t n, int width)
{
    const bt_item *item = bt_snapshot_find(snap, name);
    if (!item) complain(snap, name, "is missing");
    else if (item->type != type || item->width != width || (n >= 0 && item->n != n))
        complain(snap, name, "has an unexpected shape");
    else if (type == BT_ITEM_U8 && !yes_and_no(item))
        bt_snapshot_want(snap, false, name, -1, "holds values other than 0 and 1");
    else return item;
    return NULL;
}

int64_t bt_snapshot_rows(bt_snapshot *snap, const char *name)
{
    const bt_item *item = bt_snapshot_find(snap, name);
    if (!item) complain(snap, name, "is missing");
    return item ? item->n : 0;
}

void bt_snapshot_take(bt_snapshot *snap, const char *name, bt_item_type type, int64_t n, int width, void *to)
{
    const bt_item *item = demand(snap, name, type, n, width);
    if (item && bytes_of(item)) memcpy(to, item->data, bytes_of(item));
}

const char *bt_snapshot_text(bt_snapshot *snap, const char *name)
{
    const bt_item *item = demand(snap, name, BT_ITEM_TEXT, -1, 1);
    return item ? item->data : "";
}

int64_t bt_snapshot_int(bt_snapshot *snap, const char *name)
{
    int64_t x = 0;
    bt_snapshot_take(snap, name, BT_ITEM_I64, 1, 1, &x);
    return x;
}

double bt_snapshot_real(bt_snapshot *snap, const char *name)
{
    double x = NAN;
    bt_snapshot_take(snap, name, BT_ITEM_F64, 1, 1, &x);
    return x;
}

static bool sound(bt_row_check check, double x)
{
    switch (check) {
    case BT_ROW_FINITE: return isfinite(x);
    case BT_ROW_NOT_NEGATIVE: return isfinite(x) && x >= 0;
    case BT_ROW_SHARE: return x >= 0 && x <= 1;
    case BT_ROW_COUNT: return x >= 0 && x <= 1e15; // more than any run can count, and far from overflow
    case BT_ROW_FAR: return fabs(x) <= 1e9;        // cells, periods: the limit of the labels of cells (cells.c)
    case BT_ROW_YES_OR_NO: return x == 0 || x == 1;
    default: return true;
    }
}

/// Of an array of whole numbers.
static int64_t whole_number(const bt_item *item, int64_t at)
{
    switch (item->type) {
    case BT_ITEM_I64: return ((const int64_t *)item->data)[at];
    case BT_ITEM_I32: return ((const int32_t *)item->data)[at];
    case BT_ITEM_U32: return ((const uint32_t *)item->data)[at];
    case BT_ITEM_U16: return ((const uint16_t *)item->data)[at];
    default: return ((const uint8_t *)item->data)[at];
    }
}

static double number_of(const bt_item *item, int64_t at)
{
    return item->type == BT_ITEM_F64 ? ((const double *)item->data)[at] : (double)whole_number(item, at);
}

void bt_snapshot_take_row(bt_snapshot *snap, const char *group, const bt_state_row *row, int64_t n, void *to)
{
    static const char *const what[BT_ROW_CHECKS] = {
        [BT_ROW_FINITE] = "is not finite", [BT_ROW_NOT_NEGATIVE] = "is negative or not finite",
        [BT_ROW_SHARE] = "is not a share",    [BT_ROW_COUNT] = "is not a count",
        [BT_ROW_FAR] = "is out of range",  [BT_ROW_YES_OR_NO] = "is neither 0 nor 1"};
    char name[128];
    snprintf(name, sizeof name, "%s/%s", group, row->name);
    bt_snapshot_take(snap, name, row->type, n, row->width, to);
    const bt_item *item = bt_snapshot_find(snap, name);
    for (int64_t k = 0; row->check && k < n * row->width && !snap->faulty; k++)
        bt_snapshot_want(snap, sound(row->check, number_of(item, k)), name, n > 1 ? k / row->width : -1,
                         what[row->check]);
}

void bt_snapshot_take_rows(bt_snapshot *snap, const char *group, const bt_state_row *row, int n_rows, void *base)
{
    for (int k = 0; k < n_rows; k++) bt_snapshot_take_row(snap, group, &row[k], 1, (char *)base + row[k].offset);
}

void *bt_snapshot_copy(bt_snapshot *snap, const char *name, bt_item_type type, int width, int64_t *n)
{
    const bt_item *item = demand(snap, name, type, -1, width);
    *n = item ? item->n : 0;
    void *copy = bt_alloc(item ? bytes_of(item) : 0, 1);
    if (item && bytes_of(item)) memcpy(copy, item->data, bytes_of(item));
    return copy;
}

// --- sharing ---------------------------------------------------------------------------------------------------------

void bt_snapshot_share(const bt_comm *comm, bt_snapshot *snap)
{
    if (comm->size == 1) return;
    int64_t n = snap->n;
    bt_comm_bcast(comm, &n, sizeof n);
    for (int64_t k = 0; k < n; k++) {
        int64_t head[4] = {0}; // name, type, rows, width
        if (comm->rank == 0) {
            const bt_item *item = &snap->item[k];
            head[0] = (int64_t)strlen(item->name) + 1, head[1] = item->type, head[2] = item->n, head[3] = item->width;
        }
        bt_comm_bcast(comm, head, sizeof head);
        char name[160] = "";
        if (comm->rank == 0) snprintf(name, sizeof name, "%s", snap->item[k].name);
        bt_comm_bcast(comm, name, sizeof name);
        if (comm->rank != 0) bt_snapshot_begin(snap, name, (bt_item_type)head[1], head[2], (int)head[3]);
        bt_comm_bcast(comm, snap->item[k].data, bytes_of(&snap->item[k]));
    }
}

// --- comparing -------------------------------------------------------------------------------------------------------

const char *bt_item_number(const bt_item *item, int64_t at, char out[40])
{
    if (item->type == BT_ITEM_F64) snprintf(out, 40, "%.17g", number_of(item, at));
    else snprintf(out, 40, "%" PRId64, whole_number(item, at));
    return out;
}

/// The same bits, or two zeros: −0 and +0 are one state, as in bt_world_hash.
static bool same_number(const bt_item *a, const bt_item *b, int64_t at)
{
    if (a->type == BT_ITEM_F64) {
        const double x = ((const double *)a->data)[at], y = ((const double *)b->data)[at];
        if (x == y) return true;
    }
    const size_t size = bt_item_size(a->type);
    return !memcmp((const char *)a->data + (size_t)at * size, (const char *)b->data + (size_t)at * size, size);
}

static bool differ(const bt_item *a, const bt_item *b, char out[400])
{
    if (a->type == BT_ITEM_TEXT && b->type == BT_ITEM_TEXT) {
        if (!strcmp(a->data, b->data)) return false;
        int64_t line = 1;
        for (const char *p = a->data, *q = b->data; *p && *p == *q; p++, q++) line += *p == '\n';
        snprintf(out, 400, "/%s: the texts differ from line %" PRId64 " on", a->name, line);
        return true;
    }
    if (a->type != b->type || a->width != b->width || a->n != b->n) {
        snprintf(out, 400, "/%s: %" PRId64 " rows of %d in one, %" PRId64 " of %d in the other", a->name, a->n,
                 a->width, b->n, b->width);
        return true;
    }
    int64_t first = -1, many = 0;
    for (int64_t k = 0; k < a->n * a->width; k++) {
        if (same_number(a, b, k)) continue;
        if (first < 0) first = k;
        many++;
    }
    if (first < 0) return false;
    char x[40], y[40];
    bt_item_number(a, first, x);
    bt_item_number(b, first, y);
    snprintf(out, 400, "/%s: row %" PRId64 ", column %d: %s and %s (%" PRId64 " of %" PRId64 " numbers differ)",
             a->name, first / a->width, (int)(first % a->width), x, y, many, a->n * a->width);
    return true;
}

static bool compared(const bt_item *item)
{
    return strncmp(item->name, "about/", 6) && strncmp(item->name, "clock/", 6);
}

bool bt_snapshot_differ(const bt_snapshot *a, const bt_snapshot *b, char out[400])
{
    for (int k = 0; k < a->n; k++) {
        if (!compared(&a->item[k])) continue;
        const bt_item *other = bt_snapshot_find(b, a->item[k].name);
        if (!other) {
            snprintf(out, 400, "/%s: only in the first", a->item[k].name);
            return true;
        }
        if (differ(&a->item[k], other, out)) return true;
    }
    for (int k = 0; k < b->n; k++)
        if (compared(&b->item[k]) && !bt_snapshot_find(a, b->item[k].name)) {
            snprintf(out, 400, "/%s: only in the second", b->item[k].name);
            return true;
        }
    return false;
}
