// SPDX-License-Identifier: MIT
// What those arrays of a checkpoint are that no row of a saved member describes, for readers of the file.
#ifndef BT_CHECKPOINT_NAMES_H
#define BT_CHECKPOINT_NAMES_H

/// Meaning of an array "group/name", its units (NULL: it is text) and axes; NULL where it has none.
const char *bt_checkpoint_meaning(const char *name, const char **units, const char **axes);

#endif
