// SPDX-License-Identifier: MIT
// Where a file comes from: version, build, machine, command and time, as attributes of its root.
#ifndef BT_PROVENANCE_H
#define BT_PROVENANCE_H

#include "base/h5util.h"

/// The revision that this program was built from, "unknown" where the build did not know.
const char *bt_provenance_revision(void);

void bt_provenance_write(bt_h5 *h, const char *command_line);

#endif
