// SPDX-License-Identifier: MIT
// The entry point of libFuzzer for the harness that the build names in BT_FUZZ.
#include "fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n);
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t n)
{
    BT_FUZZ(data, n);
    return 0;
}
