// SPDX-License-Identifier: MIT
// Names: of what a program adds (laws, shapes, quantities), and lists of names.
#ifndef BT_NAME_H
#define BT_NAME_H

#include "bergtow/base.h"

enum { BT_LONGEST_KEY = 64 };   ///< bytes of a name of a key with its end
enum { BT_MOST_LAW_NAME = 40 }; ///< characters: the names of its series append a word to it, and 48 fit

/// Lower-case letters, digits and _, beginning with no digit, at most `most` of them.
bool bt_is_name(const char *s, int most);

/// Can a law have `more` series, one of them of this name? Set by what keeps the series (output/quantity.c),
/// which stands above the laws; NULL where nobody keeps any. Otherwise: why not, into err.
extern bool (*bt_series_may_be)(const char *name, int more, bt_errors *err);

/// The next of names with blanks between them, such as those of keys, cut to its room; false after the last.
bool bt_next_name(const char **names, char name[BT_LONGEST_KEY]);

/// Bytes of the valid UTF-8 sequence at s (RFC 3629), which ends with a 0; 0 when there is none.
size_t bt_utf8_length(const unsigned char *s);

// --- the closest word ------------------------------------------------------------------------------------------------

// The known word closest to a mistyped one, for "did you mean".

/// Edit distance with insertions, deletions, substitutions and swaps of neighbours (optimal string alignment).
/// Words longer than 63 bytes, and those whose lengths alone put them `enough` or more apart, are at distance 64.
int bt_suggest_distance(const char *a, const char *b, int enough);

/// Largest distance at which a suggestion for this word still helps: a third of its length, at least 1.
int bt_suggest_limit(const char *word);

/// The entry of the NULL-terminated list closest to word, or NULL when none is near. Ties go to the first.
const char *bt_suggest(const char *word, const char *const *list);

#endif
