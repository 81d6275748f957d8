// SPDX-License-Identifier: MIT
// Where a file comes from: version, build, machine, command and time, as attributes of its root.
#ifndef BT_PROVENANCE_H
#define BT_PROVENANCE_H

#include "base/h5util.h"

void bt_provenance_write(bt_h5 *h, const char *command_line);

#endif
