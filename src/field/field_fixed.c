// SPDX-License-Identifier: MIT
// A field as a list of fixed floes by hand: a coast or structures from a map, for a case of any other ice.
#include <stdio.h>
#include <stdlib.h>

#include "base/fileio.h"
#include "bergtow/field.h"

/// By this a file is known again as one that this program has written.
#define HEAD "# fixed floes, written by bergtow "

bool bt_field_fixed_ours(const char *path) { return bt_file_begins(path, HEAD); }

bt_status bt_field_write_fixed(const bt_field *f, const bt_case *c, const char *path, bt_errors *err)
{
    bt_text lines;
    bt_text_begin(&lines);
    FILE *out = lines.out;
    const char *frame = bt_field_frame(c);
    fprintf(out, HEAD BT_VERSION "\n# x and y in metres of the frame %s\ndomain: {frame: %s}\nfloes:\n", frame, frame);
    for (bt_idx i = 0; i < f->n; i++) {
        const double *p = f->pose + 3 * (size_t)i;
        fprintf(out,
                "  - {shape: polygon, fixed: true, x: %.17g, y: %.17g, yaw: %.17g rad, thickness: %.17g, vertices: [",
                p[0], p[1], p[2], f->thickness[i]);
        for (int64_t k = f->offsets[i]; k < f->offsets[i + 1]; k++)
            fprintf(out, "%s[%.17g, %.17g]", k > f->offsets[i] ? ", " : "", f->vertices[2 * k], f->vertices[2 * k + 1]);
        fprintf(out, "]}\n");
    }
    char *text = bt_text_end(&lines);
    const bt_status status = bt_file_write(path, text, err);
    free(text);
    return status;
}
