// SPDX-License-Identifier: MIT
// Does this processor support the instructions for which the program was compiled?
//
// As built by the Makefile, the program runs on any x86-64 or ARM, and uses AVX2 if available. If
// EXTRA_CFLAGS=-march=native or a packager's flags allow more, an older processor of the same cluster would end it at
// the first instruction that it does not know, with SIGILL and no message.
#include "app/cmd.h"

#include <string.h>
#include <unistd.h>

#include "bergtow/base.h"

#ifdef __x86_64__
#define NEEDS(feature) \
    if (!__builtin_cpu_supports(feature)) return feature

/// The first extension allowed to the compiler that this processor lacks, or NULL.
static const char *missing(void)
{
    __builtin_cpu_init();
#ifdef __SSE4_1__
    NEEDS("sse4.1");
#endif
#ifdef __SSE4_2__
    NEEDS("sse4.2");
#endif
#ifdef __POPCNT__
    NEEDS("popcnt");
#endif
#ifdef __AVX__
    NEEDS("avx");
#endif
#ifdef __AVX2__
    NEEDS("avx2");
#endif
#ifdef __BMI2__
    NEEDS("bmi2");
#endif
#ifdef __FMA__
    NEEDS("fma");
#endif
#ifdef __AVX512F__
    NEEDS("avx512f");
#endif
#ifdef __AVX512VL__
    NEEDS("avx512vl");
#endif
#ifdef __AVX512BW__
    NEEDS("avx512bw");
#endif
#ifdef __AVX512DQ__
    NEEDS("avx512dq");
#endif
    return NULL;
}
#else
static const char *missing(void) { return NULL; }
#endif

static void say(const char *text)
{
    if (write(STDERR_FILENO, text, strlen(text)) < 0) return; // stderr is closed
}

void bt_processor_check(void)
{
    const char *what = missing();
    if (!what) return;
    say("bergtow: built for processors with ");
    say(what);
    say(", which this one lacks; build it on this machine, or without -march (make clean all)\n");
    _exit(BT_ERR_USAGE);
}
