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
    ROW("title", TEXT, "none", "one line for the reports; a member has it with its condition and its field"),
    ROW("report", MAP, "none",
        "client, project, author, document (its number), revision and distribution for the title block of the "
        "report: {client: ..., revision: B}"),
    ROW("base", TEXT, NULL, "the case that is varied; relative to the folder of the study file"),
    ROW("set", MAP, "none", "keys of the case that are replaced in every member: {run.duration: 600 s}"),
    ROW("parameters", MAP, "none",
        "keys that are varied, each with a list [0.2, 0.5] or a range {from: 0.1 m/s, to: 0.4 m/s, n: 3, scale: log}, "
        "in a Latin hypercube with a distribution (uniform, triangular; normal: 95 % from ... to) and a source"),
    ROW("variants", MAP, "none",
        "names of sets of keys that go together, varied as one more parameter; none that `parameters` varies"),
    ROW("with", MAP, "none",
        "keys that go with a value of a list, as in {ice.concentration=0.2: {domain.width: 5 km}}; none that is varied "
        "otherwise"),
    CHOICE("sampling", samplings, "grid", "every combination of the values, or a Latin hypercube"),
    WHOLE("samples", "1", "[1, 100000]", "conditions of the Latin hypercube, which needs it"),
    WHOLE("repeats", "1", "[1, 100000]", "fields of each condition; 1 where no ice depends on the seed, as it is read"),
    WHOLE("seed", "1", "[0, 9.2e18]", "from it follow the seeds of the fields, and the Latin hypercube"),
    CHOICE("fields", fields, "own",
           "fields of each condition: its own, or the same in all, made once, to compare conditions on the same ice; "
           "numbered: the same, and field r has the seed `seed` + r - 1, as with --set ice.seed of a run"),
    WHOLE("ranks", "1", "[1, 1048576]", "MPI ranks that work on one member"),
};
const int bt_n_study_keys = sizeof bt_study_keys / sizeof *bt_study_keys;
