// SPDX-License-Identifier: MIT
// journal.jsonl in the folder of an ensemble: a line for each start and end of a member.
#ifndef BT_ENSEMBLE_JOURNAL_H
#define BT_ENSEMBLE_JOURNAL_H

#include "bergtow/base.h"

/// Add a line, in one write: lines of several processes do not mix. wall: s, NAN = not known. A line that cannot be
/// written is left out.
void bt_journal_add(const char *dir, const char *event, const char *member, double wall, int code);

/// lacking [n], by the place of a member in a study of so many repeats: set to false for those whose last line says
/// that they have finished, and for all where there is no journal, or where it cannot be read.
void bt_journal_strike_ended(const char *dir, int64_t repeats, int64_t n, bool *lacking);

#endif
