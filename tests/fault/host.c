// SPDX-License-Identifier: MIT
// Preloaded into the program by tests, which then begins with the locale of the environment and rounds upward, as a
// program may that uses the library.
#include <fenv.h>
#include <locale.h>

__attribute__((constructor)) static void begin(void)
{
    setlocale(LC_ALL, "");
    fesetround(FE_UPWARD);
}
