// SPDX-License-Identifier: MIT
// The limits of size as a list for people.
#include "base/largest.h"

#include "bergtow/shape.h"
#include "bergtow/study.h"

void bt_largest_print(FILE *out)
{
    const struct {
        const char *what;
        double most;
        const char *unit;
    } rows[] = {
        {"case or study file", BT_MAX_TEXT_BYTES, "bytes"},
        {"base files of a case", BT_MAX_BASES, ""},
        {"nesting of a case file", BT_TREE_DEPTH, "levels"},
        {"values of a case file", BT_TREE_NODES, "in all"},
        {"keys of one section", BT_TREE_MAP, ""},
        {"a text", BT_MAX_TEXT, "bytes"},
        {"floes given by hand", BT_MAX_FLOES_BY_HAND, "floes"},
        {"tow.programme, tow.waypoints", BT_MAX_POINTS, "points each"},
        {"corners of a polygon", BT_MAX_VERTICES, "vertices"},
        {"floes, made or read", BT_MAX_FLOES, "floes"},
        {"steps", BT_MAX_STEPS, "steps"},
        {"frames", BT_MAX_FRAMES, "frames"},
        {"series and frames of a run", BT_MAX_RESULT_BYTES, "bytes, estimated"},
        {"work of a run", BT_MAX_CORE_SECONDS, "s on one core, estimated"},
        {"CSV table", BT_MAX_TABLE_BYTES, "bytes"},
        {"rows of a CSV table", BT_MAX_ROWS, "rows"},
        {"GeoJSON file", BT_MAX_OUTLINE_BYTES, "bytes"},
        {"lists (vertices) of a GeoJSON file", BT_MAX_LISTS, "lists"},
        {"an outline before ice.nonconvex: hull", BT_MAX_RING, "vertices"},
        {"parameters of a study", BT_MAX_PARAMETERS, ""},
        {"values of one parameter", BT_MAX_VALUES, ""},
        {"members of a study", BT_MAX_MEMBERS, "members"},
        {"errors reported for one case", BT_MAX_COMPLAINTS, "errors"},
    };
    const struct {
        const char *what;
        double least;
        const char *unit;
    } floors[] = {
        {"concentration, unless 0", BT_LEAST_CONCENTRATION, ""},
        {"mean size of the floes", BT_LEAST_SIZE, "m"},
        {"thickness of a floe", BT_LEAST_THICKNESS, "m"},
    };
    fputs("\n"
          "The program refuses anything beyond these limits, and names a remedy. It also refuses, before it begins, a "
          "run that needs more memory than the machine has.\n\n",
          out);
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
        fprintf(out, "%-40s %12.10g %s\n", rows[i].what, rows[i].most, rows[i].unit);
    fputs("\nThe program refuses anything below these limits as too small to be ice.\n\n", out);
    for (size_t i = 0; i < sizeof floors / sizeof *floors; i++)
        fprintf(out, "%-40s %12.10g %s\n", floors[i].what, floors[i].least, floors[i].unit);
}
