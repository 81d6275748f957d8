// SPDX-License-Identifier: MIT
// What those arrays of a checkpoint are that no row of a saved member describes (state.c, history.c), for readers.
#include "output/checkpoint_names.h"

#include <string.h>

#include "bergtow/quantity.h"

typedef struct {
    const char *name, *units, *meaning; ///< units: NULL = text
    const char *axes;                   ///< h5dataset.h
} row;

static const row rows[] = {
    // where it comes from, and how long it took: no part of the state
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
    {"clock/shared", "s", "of it, in passes that several threads share", "phase"},
    {"clock/wall_time", "s", "wall time of the run so far", "one"},
    {"case/resolved", NULL, "the case with every key, in SI units", "one"},
    {"case/current", "s, m/s, m/s", "table of the current: time, x, y", "current_row time_x_y"},
    {"case/wind", "s, m/s, m/s", "table of the wind: time, x, y", "wind_row time_x_y"},
    // the world
    {"world/hash", "1", "hash of the state", "one"},
    {"contacts/added_laws", NULL, "contact laws that the program added, in the order of their indices", "one"},
    {"forces/added_laws", NULL, "force laws that the program added and that have acted, in order", "one"},
    // loads and what was written
    {"impacts/open", "1", "collisions under way, a row each, columns in SI units", "impact column"},
    {"collisions/sum", "N", "panel loads of the sample under way: force x, y, normal", "panel panel_force"},
    {"collisions/panel_blocks", "N", "panel loads summed over blocks of steps", "panel_block panel_load"},
    {"record/entries", "1", "samples in result.h5", "one"},
    {"record/frames", "1", "frames in result.h5", "one"},
    {"record/merged_steps", "1", "steps merged into the sample under way", "one"},
    {"run/frames_due", "1", "frames that are due so far", "one"},
    {"run/unconverged_in_a_row", "1", "steps without convergence one after the other", "one"},
    {"run/locked_steps", "1", "steps without a solution", "one"},
    {"run/energy_limit", "J", "of the bodies, by guard.energy and what drives them at the start; 0 without", "one"},
    // the ice as it was
    {"field/offsets", "1", "floe i has the vertices offsets[i] up to offsets[i + 1]", "floe_end"},
    {"field/vertices", "m", "outlines, frame of the floe, anticlockwise about the centroid", "floe_vertex xy"},
    {"field/pose", "m, m, rad", "x, y, yaw of each floe at the start", "floe component"},
    {"field/thickness", "m", "thickness of each floe", "floe"},
    {"field/area", "m2", "area of each floe", "floe"},
    {"field/crs", NULL, "coordinate reference system of the map", "one"},
    {"field/nearly", NULL, "such names, the first few", "one"},
};

const char *bt_checkpoint_meaning(const char *name, const char **units, const char **axes)
{
    static const char added[] = "history/added_";
    for (size_t k = 0; k < sizeof rows / sizeof *rows; k++)
        if (!strcmp(rows[k].name, name)) {
            *units = rows[k].units;
            *axes = rows[k].axes;
            return rows[k].meaning;
        }
    const bt_quantity *q = strncmp(name, added, sizeof added - 1) ? NULL : bt_series_find(name + sizeof added - 1);
    *units = q ? q->units : NULL;
    *axes = "time";
    return q ? q->description : NULL;
}
