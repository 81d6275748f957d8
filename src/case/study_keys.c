// SPDX-License-Identifier: MIT
// The keys of a study file (bergtow/study.h describes how they work together): words, defaults and ranges for reading
// and for --list-keys.
#include "case/schema.h"

static const char *const samplings[] = {"grid", "latin-hypercube", NULL};
static const char *const fields[] = {"own", "common", "numbered", NULL};

#define ROW(key, kind, preset_, doc_) {.name = key, .type = BT_KEY_##kind, .preset = preset_, .doc = doc_}
#define WHOLE(key, preset_, range_, doc_) \
    {.name = key, .type = BT_KEY_INT, .preset = preset_, .range = range_, .doc = doc_}
#define CHOICE(key, names, preset_, doc_) \
    {.name = key, .type = BT_KEY_CHOICE, .choices = names, .preset = preset_, .doc = doc_}

const bt_key bt_study_keys[] = {
    ROW("title", TEXT, "none", "one line for the reports; each member adds its condition and its field"),
    ROW("report", MAP, "none",
        "client, project, author, document (its number), revision and distribution for the title block of the "
        "report: {client: ..., revision: B}"),
    ROW("base", TEXT, NULL, "the case that is varied; relative to the folder of the study file"),
    ROW("set", MAP, "none", "keys of the case that are replaced in every member: {run.duration: 600 s}"),
    ROW("parameters", MAP, "none",
        "keys to vary, each with a list [0.2, 0.5] or a range {from: 0.1 m/s, to: 0.4 m/s, n: 3, scale: log}; in a "
        "Latin hypercube, also with a distribution (uniform, triangular; normal: 95 % from ... to) and a source"),
    ROW("variants", MAP, "none",
        "named sets of keys, varied as one more parameter; they cannot hold a key of `parameters`"),
    ROW("with", MAP, "none",
        "keys that belong to a value of a list, as in {ice.concentration=0.2: {domain.width: 5 km}}; they cannot be "
        "varied elsewhere"),
    CHOICE("sampling", samplings, "grid", "every combination of the values, or a Latin hypercube"),
    WHOLE("samples", "1", "[1, 100000]", "number of conditions of a Latin hypercube, needed there"),
    WHOLE("repeats", "1", "[1, 100000]",
          "number of fields of each condition; 1 if no ice depends on the seed, as when it is read from a file"),
    WHOLE("seed", "1", "[0, 9.2e18]", "determines the seeds of the fields and the Latin hypercube"),
    CHOICE("fields", fields, "own",
           "own: each condition has its own fields; common: all conditions have the same fields, made once, to compare "
           "them on the same ice; numbered: as common, and field r has the seed `seed` + r - 1, as a run with --set "
           "ice.seed"),
    WHOLE("ranks", "1", "[1, 1048576]", "MPI ranks that work on one member"),
};
const int bt_n_study_keys = sizeof bt_study_keys / sizeof *bt_study_keys;
