// SPDX-License-Identifier: MIT
// Identifiers, status codes and the list of messages that every fallible function appends to.
//
// Units, in all headers: SI, and radians. Quantities with a dimension are documented with their unit; coefficients,
// ratios and shares (friction, restitution, C_w, tolerance, μ, κ) have none.
#ifndef BERGTOW_BASE_H
#define BERGTOW_BASE_H

// Standard headers of what is declared and handed out below, FILE and free() too: who includes this one has them.
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#ifdef __cplusplus // declarations have the linkage of C
#define BT_BEGIN_C extern "C" {
#define BT_END_C }
#else
#define BT_BEGIN_C
#define BT_END_C
#endif

BT_BEGIN_C

#define BT_VERSION "0.1.0"

typedef int64_t bt_gid; ///< global id of a body: the same in every decomposition, never reused
typedef int32_t bt_idx; ///< position of a body (or pair, row) in this process's memory

/// Status of a call and exit code of the program.
typedef enum {
    BT_OK = 0,
    BT_ERR_USAGE = 2,   ///< command line
    BT_ERR_CASE = 3,    ///< case or field file
    BT_ERR_IO = 4,      ///< reading or writing a file
    BT_ERR_NUMERIC = 5, ///< the computation itself failed
    BT_ERR_SIGNAL = 6,  ///< stopped on a signal, with what was computed so far complete on disk
} bt_status;

/// Messages collected on the way, so that one call can report every error of a case file at once.
typedef struct bt_errors {
    char **text;
    size_t n, cap;
    struct bt_note *note; ///< [n] code and values of each, for scripts
} bt_errors;

/// A message for scripts: its code, which stays the same when the text changes, and its values as a JSON object.
typedef struct bt_note {
    char *code;   ///< NULL = none
    char *values; ///< NULL = none; only for warnings
} bt_note;

/// Append a message (printf-style); err = NULL here and in the next three: the message is discarded. Aborts only
/// when out of memory.
void bt_errors_add(bt_errors *err, const char *fmt, ...) __attribute__((format(printf, 2, 3)));
/// The same with a list of arguments.
void bt_errors_add_list(bt_errors *err, const char *fmt, va_list args) __attribute__((format(printf, 2, 0)));
/// Append a message. Errors: returns the given status.
bt_status bt_fail(bt_errors *err, bt_status status, const char *fmt, ...) __attribute__((format(printf, 3, 4)));
/// Set the code of the last message, if there is one. Codes of errors: no_solution, by guard.no_solution
/// (src/run/guard.h); other_study, the folder of an ensemble holds another study; one_field, no seed changes the ice of
/// a study with several fields.
void bt_errors_code(bt_errors *err, const char *code);
/// Print every message on stderr, one per line, prefixed "bergtow: ", followed by its code in brackets; if the
/// environment has BERGTOW_MESSAGES=json, as an object {"warning", "code", "text"} for programs.
void bt_errors_print(const bt_errors *err);
/// Print a message that begins with "warning: ".
void bt_errors_warn(const char *fmt, ...) __attribute__((format(printf, 1, 2)));
/// Release the messages; the list is empty then.
void bt_errors_free(bt_errors *err);
/// Append all messages of `from` to those of `to`, unless that is NULL; `from` is then empty.
void bt_errors_move(bt_errors *to, bt_errors *from);

/// Plural ending of a noun for the number n.
static inline const char *bt_plural(int64_t n)
{
    return n == 1 ? "" : "s";
}

/// malloc/realloc/calloc that end the program with a message and BT_ERR_NUMERIC when memory runs out.
void *bt_alloc(size_t n, size_t size);             ///< zeroed
void *bt_realloc(void *p, size_t n, size_t size);  ///< not zeroed beyond the old size
void *bt_alloc_aligned(size_t n, size_t size);     ///< zeroed, 64-byte aligned, release with free()
void *bt_alloc_unset(size_t n, size_t size);       ///< the same, not zeroed

/// Set a function to be called when memory has run out, before the program ends: to report it, or to save the caller's
/// own data. The end cannot be averted, and report must not call this library. NULL = a message on stderr.
void bt_on_out_of_memory(void (*report)(const char *message, void *user), void *user);

/// A text of any length, written like a file; if memory runs out the program ends as in bt_alloc.
typedef struct bt_text {
    FILE *out; ///< write to this stream
    char *text;
    size_t size;
    void *locale;
} bt_text;
/// Open text->out for writing. Until bt_text_end, numbers have a decimal point in this thread, whatever its locale.
void bt_text_begin(bt_text *text);
/// Close it. Returns the text, which the caller frees.
char *bt_text_end(bt_text *text);

/// Copy of a text; the caller frees it.
char *bt_text_copy(const char *text);
/// A printf-style text, with a decimal point in numbers; the caller frees it.
char *bt_text_of(const char *fmt, ...) __attribute__((format(printf, 1, 2)));

/// Wall clock in seconds from an arbitrary origin (CLOCK_MONOTONIC).
double bt_clock(void);

/// The smaller and the larger of two; b if either is NaN. fmin and fmax are function calls, and return the number.
static inline double bt_min(double a, double b) { return a < b ? a : b; }
/// See bt_min.
static inline double bt_max(double a, double b) { return a > b ? a : b; }

#define BT_PI 3.14159265358979323846

BT_END_C

#endif
