// SPDX-License-Identifier: MIT
// The known word closest to a mistyped one, for "did you mean".
#ifndef BERGTOW_SUGGEST_H
#define BERGTOW_SUGGEST_H

/// Edit distance with insertions, deletions, substitutions and swaps of neighbours (optimal string alignment).
/// Words longer than 63 bytes, and those whose lengths alone put them `enough` or more apart, are at distance 64.
int bt_suggest_distance(const char *a, const char *b, int enough);

/// Largest distance at which a suggestion for this word still helps: a third of its length, at least 1.
int bt_suggest_limit(const char *word);

/// The entry of the NULL-terminated list closest to word, or NULL when none is near. Ties go to the first.
const char *bt_suggest(const char *word, const char *const *list);

#endif
