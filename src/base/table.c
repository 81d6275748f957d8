// SPDX-License-Identifier: MIT
// Tables of a velocity in time: strict reading of CSV, and linear interpolation.
#include "base/table.h"

#include <string.h>

#include "base/elementary.h"
#include "base/fileio.h"
#include "base/largest.h"
#include "base/units.h"

enum { LONGEST_LINE = 255, MAX_COMPLAINTS = 10 };
static const double largest_speed = 100; // m/s, as for the keys of a constant current or wind

void bt_table_free(bt_table *table)
{
    free(table->row);
    *table = (bt_table){0};
}

/// Cut off the end of the line and blanks around the text.
static char *trimmed(char *s)
{
    s += strspn(s, " \t");
    for (size_t n = strlen(s); n && strchr(" \t\r\n", s[n - 1]); n--) s[n - 1] = 0;
    return s;
}

static bool is_header(char *line)
{
    static const char *const names[] = {"t", "u", "v"};
    for (int i = 0; i < 3; i++) {
        char *comma = strchr(line, ',');
        if ((comma == NULL) != (i == 2)) return false;
        if (comma) *comma = 0;
        if (strcmp(trimmed(line), names[i])) return false;
        if (comma) line = comma + 1;
    }
    return true;
}

/// Read one row of numbers. Returns what is wrong with it, or NULL.
static const char *read_row(char *line, double row[3], char why[BT_WHY])
{
    for (int i = 0; i < 3; i++) {
        char *comma = strchr(line, ',');
        if ((comma == NULL) != (i == 2)) return "needs three columns; write t,u,v";
        if (comma) *comma = 0;
        if (!bt_units_parse(line, i == 0 ? BT_UNIT_TIME : BT_UNIT_SPEED, &row[i], why)) return why;
        if (i > 0 && fabs(row[i]) > largest_speed) return "a speed is out of range; give a value in [-100, 100] m/s";
        if (comma) line = comma + 1;
    }
    return NULL;
}

/// Take the line at *rest, terminate it, and move *rest behind it; n: its length. NULL after the last line.
static char *next_line(char **rest, const char *end, size_t *n)
{
    char *line = *rest;
    if (line >= end) return NULL;
    char *stop = memchr(line, '\n', (size_t)(end - line));
    *n = stop ? (size_t)(stop - line) : (size_t)(end - line);
    *rest = line + *n + 1;
    line[*n] = 0;
    return line;
}

static void read_lines(bt_table *table, char *rest, const char *end, const char *path, bt_errors *err)
{
    char *line, why[BT_WHY];
    size_t length;
    const size_t before = err->n;
    int64_t cap = 0;
    bool header = false;
    for (int number = 1; err->n - before < MAX_COMPLAINTS && (line = next_line(&rest, end, &length)); number++) {
        if (length > LONGEST_LINE || strlen(line) != length) {
            bt_errors_add(err, "%s:%d: %s; write t,u,v in each line", path, number,
                          length > LONGEST_LINE ? "is too long for a row of a table" : "contains a NUL character");
            return;
        }
        char *text = trimmed(line);
        if (!*text || *text == '#') continue;
        if (!header) {
            header = true;
            if (is_header(text)) continue;
            bt_errors_add(err, "%s:%d: is not the header; begin the table with the line t,u,v (s, m/s, m/s)", path,
                          number);
            return;
        }
        double row[3];
        const char *fault = read_row(text, row, why);
        if (!fault && table->n && !(row[0] > table->row[3 * (table->n - 1)]))
            fault = "its time is not later than that of the row before; sort the rows and remove duplicates";
        if (fault) {
            bt_errors_add(err, "%s:%d: %s", path, number, fault);
            continue;
        }
        if (table->n == BT_MAX_ROWS) {
            bt_errors_add(err, "%s:%d: more than %d rows; use longer steps between them", path, number, BT_MAX_ROWS);
            return;
        }
        if (table->n == cap)
            table->row = bt_realloc(table->row, (size_t)(cap = cap ? 2 * cap : 256), 3 * sizeof *table->row);
        memcpy(table->row + 3 * table->n++, row, sizeof row);
    }
    if (err->n == before && table->n == 0)
        bt_errors_add(err, "%s: has no rows; write the header t,u,v and below it a row for each time", path);
}

bt_status bt_table_read(bt_table *table, const char *path, bt_errors *err)
{
    bt_table_free(table);
    const size_t before = err->n;
    char *text;
    size_t size;
    bt_status status = bt_file_read_to(path, "a CSV table", BT_MAX_TABLE_BYTES, &text, &size, err);
    if (status == BT_OK) read_lines(table, text, text + size, path, err);
    free(text);
    if (status == BT_OK && err->n > before) status = BT_ERR_CASE;
    if (status != BT_OK) bt_table_free(table);
    return status;
}

bool bt_table_row_sound(const bt_table *table, int64_t i)
{
    const double *row = table->row + 3 * i;
    return isfinite(row[0]) && (i == 0 || row[0] > row[-3]) && fabs(row[1]) <= largest_speed &&
           fabs(row[2]) <= largest_speed;
}

void bt_table_at(const bt_table *table, double time, double v[2])
{
    const double *row = table->row;
    int64_t low = 0, high = table->n - 1; // row[low] <= time < row[high], unless time is at an end
    const int64_t end = !(time > row[0]) ? 0 : time >= row[3 * high] ? high : -1;
    if (end >= 0) {
        memcpy(v, row + 3 * end + 1, 2 * sizeof *v);
        return;
    }
    while (high - low > 1) {
        const int64_t mid = low + (high - low) / 2;
        *(time < row[3 * mid] ? &high : &low) = mid;
    }
    const double *p = row + 3 * low, *q = row + 3 * high, s = (time - p[0]) / (q[0] - p[0]);
    for (int k = 0; k < 2; k++) v[k] = p[k + 1] == q[k + 1] ? p[k + 1] : (1 - s) * p[k + 1] + s * q[k + 1];
}

double bt_table_fastest(const bt_table *table)
{
    double most = 0;
    for (int64_t i = 0; i < table->n; i++) most = bt_max(most, bt_hypot(table->row[3 * i + 1], table->row[3 * i + 2]));
    return most;
}
