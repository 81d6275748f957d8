// SPDX-License-Identifier: MIT
// Tables of a velocity in time: strict reading of CSV, and linear interpolation.
#include "table.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fileio.h"
#include "units.h"

enum { LARGEST_FILE = 64 << 20, LONGEST_LINE = 256, MOST_COMPLAINTS = 10 };
static const double largest_speed = 100; // m/s, as for the keys of a constant current or wind

void bt_table_free(bt_table *t)
{
    free(t->row);
    *t = (bt_table){0};
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

/// One row of numbers; says what is wrong with it, or NULL.
static const char *read_row(char *line, double row[3], char why[BT_WHY])
{
    for (int i = 0; i < 3; i++) {
        char *comma = strchr(line, ',');
        if ((comma == NULL) != (i == 2)) return "has not three columns; write t,u,v";
        if (comma) *comma = 0;
        if (!bt_units_parse(line, i == 0 ? BT_UNIT_TIME : BT_UNIT_SPEED, &row[i], why)) return why;
        if (i > 0 && fabs(row[i]) > largest_speed) return "a speed is out of range; give a value in [-100, 100] m/s";
        if (comma) line = comma + 1;
    }
    return NULL;
}

static void read_lines(bt_table *t, FILE *f, const char *path, bt_errors *err)
{
    char line[LONGEST_LINE], why[BT_WHY];
    const size_t before = err->n;
    int64_t cap = 0;
    bool header = false;
    for (int number = 1; err->n - before < MOST_COMPLAINTS && fgets(line, sizeof line, f); number++) {
        if (strlen(line) == sizeof line - 1 && line[sizeof line - 2] != '\n') {
            bt_errors_add(err, "%s:%d: is longer than a row of a table can be; write t,u,v in each line", path, number);
            return;
        }
        char *text = trimmed(line);
        if (!*text || *text == '#') continue;
        if (!header) {
            header = true;
            if (is_header(text)) continue;
            bt_errors_add(err, "%s:%d: is not the header; begin the table with the line t,u,v (s, m/s, m/s)", path, number);
            return;
        }
        double row[3];
        const char *fault = read_row(text, row, why);
        if (!fault && t->n && !(row[0] > t->row[3 * (t->n - 1)])) fault = "its time is not after that of the row before; sort the rows and remove doubles";
        if (fault) {
            bt_errors_add(err, "%s:%d: %s", path, number, fault);
            continue;
        }
        if (t->n == cap) t->row = bt_realloc(t->row, (size_t)(cap = cap ? 2 * cap : 256), 3 * sizeof *t->row);
        memcpy(t->row + 3 * t->n++, row, sizeof row);
    }
    if (err->n == before && t->n == 0) bt_errors_add(err, "%s: holds no row; write the header t,u,v and below it a row for each time", path);
}

bt_status bt_table_read(bt_table *t, const char *path, bt_errors *err)
{
    bt_table_free(t);
    const size_t before = err->n;
    FILE *f = fopen(path, "r");
    if (!f) return bt_file_fail(path, "be read", errno, err);
    // A folder opens but cannot be read, nor has it an end worth going to.
    if (fseek(f, 0, SEEK_END) || ftell(f) < 0 || ftell(f) > LARGEST_FILE) {
        bt_errors_add(err, "%s: is no file of at most 64 MiB; give the path of a CSV table", path);
        fclose(f);
        return BT_ERR_CASE;
    }
    rewind(f);
    read_lines(t, f, path, err);
    const bool broken = ferror(f);
    fclose(f);
    if (err->n == before && !broken) return BT_OK;
    bt_table_free(t);
    return broken ? bt_file_fail(path, "be read", EIO, err) : BT_ERR_CASE;
}

void bt_table_at(const bt_table *t, double time, double v[2])
{
    const double *row = t->row;
    int64_t low = 0, high = t->n - 1; // row[low] <= time < row[high], once the ends are done with
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

double bt_table_fastest(const bt_table *t)
{
    double most = 0;
    for (int64_t i = 0; i < t->n; i++) most = bt_max(most, hypot(t->row[3 * i + 1], t->row[3 * i + 2]));
    return most;
}
