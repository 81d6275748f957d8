// SPDX-License-Identifier: MIT
// Does this processor support the instructions for which the program was compiled?
#ifndef BT_PROCESSOR_H
#define BT_PROCESSOR_H

/// Ends the program with a message and code 2 if not. May be called before the constructors of libraries.
void bt_processor_check(void);

#endif
