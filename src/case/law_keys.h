// SPDX-License-Identifier: MIT
// Names of what a program adds: laws, shapes, their keys (bergtow/law_key.h).
#ifndef BERGTOW_LAW_KEYS_H
#define BERGTOW_LAW_KEYS_H

#include "bergtow/case.h"
#include "bergtow/law_key.h"

/// Lower-case letters, digits and _, at most 40.
bool bt_law_is_name(const char *s);

#endif
