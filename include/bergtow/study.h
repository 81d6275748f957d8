// SPDX-License-Identifier: MIT
// A study: a base case, the values to vary, and the number of fields of each condition. Read from a YAML file.
//
//     title: resistance against concentration
//     report: {client: ..., project: ..., author: ..., revision: A}   # title block of the report
//     base: ../basin/basin-80.yml          # relative to the study file
//     set: {run.duration: 600 s}           # keys of the base that are replaced in every member
//     parameters:
//       ice.concentration: [0.2, 0.5, 0.8]                                    # a list
//       tow.speed: {from: 0.1 m/s, to: 0.4 m/s, n: 3, scale: log}             # a range
//       ice.friction: {from: 0.05, to: 0.5, distribution: triangular, source: Sukhorukov & Løset 2013}
//     variants:                            # sets of keys that go together, as one more parameter
//       squares: {ice.shape: rectangles}
//       hexagons: {ice.shape: polygons, ice.sides: 6}
//     with:                                # keys that go with a value, as written in its list
//       ice.concentration=0.2: {domain.width: 5 km}
//     sampling: grid                       # every combination; or latin-hypercube
//     samples: 100                         # conditions of the Latin hypercube
//     repeats: 20                          # fields of each condition
//     seed: 1
//     fields: own                          # of each condition; common: the same seeds, and so the same ice, in all;
//                                          # numbered: the same, and the seeds are seed, seed + 1, ...
//     ranks: 1                             # MPI ranks that work on one member
//
// A key may be set only once: not under two of parameters, variants and with, and under `with` for values of only one
// parameter; otherwise a member would run with one value and be recorded with another.
//
// The keys, with defaults and ranges: src/case/study_keys.c, bergtow --list-keys. Members write no frames unless the
// study sets output.frame_interval: eighty members of 300,000 floes with the frames of a single run would fill 630 GB.
//
// A range is a distribution from which a Latin hypercube draws: uniform between its ends; triangular, with its peak in
// the middle; normal, with 95 % between its ends and nothing beyond three standard deviations; each on the linear scale
// or, with scale log, of the logarithm. The source is recorded in ensemble.h5 and in the reports.
//
// A condition is a combination of values; a member is one field of a condition, named cCCC-rRRR. Its ice.seed follows
// from (seed, condition, repeat) alone (with common and numbered fields from (seed, repeat)), so repeats can be added
// later without changing a member.
#ifndef BERGTOW_STUDY_H
#define BERGTOW_STUDY_H

#include "bergtow/case.h"

BT_BEGIN_C

typedef enum { BT_SAMPLING_GRID, BT_SAMPLING_LATIN_HYPERCUBE } bt_sampling;
/// Seeds of the fields: from seed, condition and repeat; from seed and repeat; seed + repeat.
typedef enum { BT_FIELDS_OWN, BT_FIELDS_COMMON, BT_FIELDS_NUMBERED } bt_study_fields;
typedef enum { BT_UNIFORM, BT_TRIANGULAR, BT_NORMAL } bt_distribution;

enum { BT_MAX_PARAMETERS = 32, BT_MAX_MEMBERS = 100000 };

/// A parameter to vary. A value is a text as for --set.
typedef struct bt_study_parameter {
    char *name;          ///< case key, or "variant"
    char *at;            ///< its place, "FILE:LINE: "
    int key;             ///< index into the keys of a case, −1 = the variants
    bool continuous;     ///< a range: a Latin hypercube draws from all of it
    bool logarithmic;
    bt_distribution distribution; ///< of a range, in a Latin hypercube
    double from, to;     ///< of a range, SI
    char *source;        ///< of a range: its source; or NULL
    int n;               ///< values of a list, or of a range in a grid
    char **value;        ///< [n] texts; of the variants: their names
    int64_t *stratum;    ///< [n_conditions] stratum of each condition in a Latin hypercube; NULL in a grid
} bt_study_parameter;

/// Keys that only the members with one value of a parameter get: a variant, or an entry of `with`.
typedef struct bt_study_variant {
    char *name;          ///< that value; in `with`, "key=value"
    char **set;          ///< [n_set] "key=value"
    char **at;           ///< [n_set] place of each
    int n_set;
    int axis;            ///< the parameter
} bt_study_variant;

typedef struct bt_study {
    char *path, *text;   ///< as read
    char *title;         ///< or NULL
    char *base_name;     ///< as written
    char *base;          ///< path of the base case
    char **set;          ///< [n_set] "key=value"
    char **set_at;       ///< [n_set] place of each, "FILE:LINE: "
    int n_set;
    bt_study_parameter parameter[BT_MAX_PARAMETERS];
    int n_parameters;
    bt_study_variant *variant; ///< [n_variants] those of `variants`, then those of `with`
    int n_variants;
    bt_sampling sampling;
    bt_study_fields fields;
    int64_t samples, repeats, seed, ranks;
    int64_t n_conditions;
} bt_study;

/// One run of the study.
typedef struct bt_member {
    int64_t condition, repeat; ///< from 0
    char name[56];             ///< of its folder
    int64_t seed;              ///< ice.seed
    int n_set;
    char **set;                ///< [n_set] overrides of the base
    const char **at;           ///< [n_set] place of each in the study, "FILE:LINE: ", or NULL; texts of the study
    char *value[BT_MAX_PARAMETERS]; ///< text of each parameter
} bt_member;

/// Read and check a study file; every error of the file is appended with file, line, key and remedy. Errors:
/// BT_ERR_CASE, BT_ERR_IO.
bt_status bt_study_read(bt_study *study, const char *path, bt_errors *err);

/// Replace values of the study or its base, [n] "key=value", for all members. It is then another study. Errors:
/// BT_ERR_CASE, also for a key that the study varies.
bt_status bt_study_override(bt_study *study, const char *const *set, int n, bt_errors *err);

/// Release the contents of a study.
void bt_study_free(bt_study *study);

/// The distribution of a parameter in words, "" if it has none; the caller frees it.
char *bt_study_distribution(const bt_study_parameter *parameter);

/// Are there enough ranks for a member? Errors: BT_ERR_CASE.
bt_status bt_study_fits(const bt_study *study, int ranks, bt_errors *err);

/// Number of members of a study: its conditions times its repeats.
static inline int64_t bt_study_n_members(const bt_study *study) { return study->n_conditions * study->repeats; }

/// Member m of 0 ... n − 1: repeats of condition 0 first, then those of condition 1. Release with bt_member_free.
void bt_study_member(const bt_study *study, int64_t m, bt_member *out);
/// Release the contents of a member.
void bt_member_free(bt_member *member);

/// The case of a member: the base with its overrides, titled by the study, its condition and its field unless the study
/// sets run.title; messages give their places in the study. Errors:
/// BT_ERR_CASE, BT_ERR_IO.
bt_status bt_member_case(const bt_study *study, const bt_member *member, bt_case *input, bt_errors *err);

/// The base with only `set`. Errors: BT_ERR_CASE, BT_ERR_IO.
bt_status bt_study_base_case(const bt_study *study, bt_case *input, bt_errors *err);

/// Everything that determines a member, without the number of repeats: the study's text as parsed and the resolved base
/// case. Two studies with the same text have the same members. Caller frees. NULL with a message if the base is
/// unreadable.
char *bt_study_resolved(const bt_study *study, bt_errors *err);
/// Are two such texts equal apart from comments, which describe keys and may differ between program versions?
bool bt_study_resolved_alike(const char *a, const char *b);

BT_END_C

#endif
