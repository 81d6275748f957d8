// SPDX-License-Identifier: MIT
// Names of things that a program adds (laws, shapes, quantities), and lists of names.
#ifndef BT_NAME_H
#define BT_NAME_H

#include <string.h>

#include "bergtow/base.h"

enum { BT_LONGEST_KEY = 64 };   ///< bytes of the longest name of a key, with the 0 at its end
enum { BT_MAX_LAW_NAME = 40 }; ///< characters: names of its series append a word to it, and may have 48

/// Is s a name: 1 to `most` lower-case letters, digits and _, not beginning with a digit?
bool bt_is_name(const char *s, int most);

/// Report in err why a thing that a program adds, of this kind, cannot have this name, of `most` characters at most, or
/// that one of its kind has it already.
void bt_name_check(const char *kind, const char *name, int most, bool taken, bt_errors *err);

/// May a law add `more` series, one of them with this name? If not, err says why. Set by output/quantity.c, which keeps
/// the series and stands above the laws; NULL if nobody keeps any.
extern bool (*bt_series_may_be)(const char *name, int more, bt_errors *err);

/// Take the next of several names separated by blanks, such as those of keys, cut to the room; false after the last.
bool bt_next_name(const char **names, char name[BT_LONGEST_KEY]);

/// The part of a name after its last dot.
static inline const char *bt_last_part(const char *name)
{
    const char *dot = strrchr(name, '.');
    return dot ? dot + 1 : name;
}

/// Bytes of the valid UTF-8 sequence at s (RFC 3629), a zero-terminated text; 0 if there is none.
size_t bt_utf8_length(const unsigned char *s);

// --- the closest word ------------------------------------------------------------------------------------------------

/// Edit distance with insertions, deletions, substitutions and swaps of neighbours (optimal string alignment).
/// Words longer than 63 bytes, and those whose lengths alone put them `enough` or more apart, are at distance 64.
int bt_suggest_distance(const char *a, const char *b, int enough);

/// Largest distance at which a suggestion for this word still helps: a third of its length, at least 1.
int bt_suggest_limit(const char *word);

/// The entry of the NULL-terminated list closest to word, or NULL when none is near. Ties go to the first.
const char *bt_suggest(const char *word, const char *const *list);

#endif
