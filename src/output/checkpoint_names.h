// SPDX-License-Identifier: MIT
// What each array of a checkpoint is, for readers of the file.
#ifndef BT_CHECKPOINT_NAMES_H
#define BT_CHECKPOINT_NAMES_H

/// Meaning of an array "group/name", and its units (NULL: it is text); NULL where it has none.
const char *bt_checkpoint_meaning(const char *name, const char **units);

#endif
