// SPDX-License-Identifier: MIT
// The keys of a case file: one table that drives reading, --set, --list-keys, the resolved file and its documentation.
#ifndef BT_SCHEMA_H
#define BT_SCHEMA_H

#include "bergtow/case.h"
#include "base/units.h"

typedef enum {
    BT_KEY_REAL,   ///< double
    BT_KEY_INT,    ///< int64_t
    BT_KEY_BOOL,   ///< bool
    BT_KEY_TEXT,   ///< char *, owned; NULL = none
    BT_KEY_CHOICE, ///< an enum, index into choices
    BT_KEY_POINTS, ///< double *, owned, [count][2]; count is an int
    BT_KEY_MAP,    ///< keys with their values; in studies only
} bt_key_type;

typedef struct bt_key {
    const char *name;    ///< dotted, sections in the order of the table
    bt_key_type type;
    bt_unit unit;        ///< of a real or of points
    const char *preset;  ///< default as it would be written; "none"; "= ..." follows from other keys; NULL = required
    const char *range;   ///< "[lo, hi]" or "(lo, hi)" in the unit of a bare number, of a real, integer or point
    const char *const *choices; ///< NULL-terminated names of a choice
    size_t offset;       ///< of the member in bt_case (bt_floe_def for bt_floe_keys)
    size_t offset_count; ///< of the number of points
    int least, most;     ///< number of points; 0 = 3 and BT_MAX_VERTICES, a polygon
    bt_unit unit_first;  ///< of the first of each pair; used if range_first is not NULL
    const char *range_first;
    /// how to give the value at sea, if the default is a model basin's and the geographic frame has none; else NULL
    const char *at_sea;
    bool file;           ///< a text that names a file, relative to the file that gives the key
    const char *doc;     ///< one sentence with its source
} bt_key;

extern bt_key bt_case_keys[];        ///< the keys of bt_case; written by bt_schema_add alone
extern int bt_n_case_keys;
extern const bt_key bt_floe_keys[];  ///< the keys of one entry of the list `floes:`
extern const int bt_n_floe_keys;
extern const bt_key bt_study_keys[]; ///< the keys of a study file; read by src/run/study.c
extern const int bt_n_study_keys;

/// Add a key with a real value to bt_case_keys before any case is read; bt_case.extra[result] holds the value. The
/// texts remain the caller's and must outlive every case. offset and type are set here. Returns −1, with the reason in
/// err, if there is no room, or if the name, section, preset, range or sentence is not valid.
int bt_schema_add(const bt_key *key, bt_errors *err);
/// Number of keys added; and: remove the last of them until so many are left.
int bt_schema_added(void);
void bt_schema_take_back(int added);

/// Report tables that do not fit together, a fault of the program: every case is refused with these texts. Frees err.
void bt_keys_fault(bt_errors *err);
/// Append those texts to err. False if there are any.
bool bt_keys_sound(bt_errors *err);

/// Index of a key by its dotted name, or −1.
int bt_schema_find(const bt_key *keys, int n, const char *name);

/// True when name is a section: a dotted prefix of some key of bt_case_keys ("ice", "ice.drag").
bool bt_schema_is_section(const char *name);

/// The key or section closest to a mistyped dotted name, or NULL; a known last part in the wrong section counts as
/// close. The text is static or lies in buffer.
const char *bt_schema_suggest(const bt_key *keys, int n, const char *name, char buffer[64]);

/// The key for one column, 0 or 1, of a key of points, with the unit and range of the column.
bt_key bt_schema_column(const bt_key *k, int column);

/// Set the members of all keys to their defaults; NaN for those that follow from other keys.
void bt_schema_preset(const bt_key *keys, int n, void *base);

/// Release the texts and lists the keys own.
void bt_schema_release(const bt_key *keys, int n, void *base);

// --- values ----------------------------------------------------------------------------------------------------------

/// Bounds of a key in SI; ±infinity for a key without a range.
typedef struct bt_range {
    double lo, hi;
    bool lo_open, hi_open;
} bt_range;

/// The range of a key from its text. False when the text is malformed.
bool bt_value_range(const bt_key *key, bt_range *range);

/// Read a scalar into the member of the key under base. plain: not quoted, so that none means "no value". On refusal
/// the member keeps its value, and why gives the reason and the remedy. Not for points.
bool bt_value_read(const bt_key *key, void *base, const char *text, bool plain, char why[BT_WHY]);

/// The member of a key, by its type.
typedef struct bt_value {
    double number;        ///< of a number or a switch (0 or 1); NaN of other keys
    int64_t whole;        ///< of a whole number
    const char *text;     ///< of a choice its word; NULL = none
    const double *points; ///< [n][2]
    int n;
} bt_value;
bt_value bt_value_of(const bt_key *key, const void *base);
/// Its number.
double bt_value_number(const bt_key *key, const void *base);

/// Read the coordinate of a point, with the key's unit and range.
bool bt_value_read_coordinate(const bt_key *key, const char *text, double *value, char why[BT_WHY]);

/// Write the member as a YAML scalar (or flow list of points) that reads back to the same bits.
void bt_value_write(const bt_key *key, const void *base, FILE *out);

#endif
