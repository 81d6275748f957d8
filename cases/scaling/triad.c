// SPDX-License-Identifier: MIT
// STREAM's triad a[i] = b[i] + s c[i]: the memory bandwidth that this machine gives to a loop (McCalpin 1995, IEEE
// TCCA).
//
//     triad THREADS MIB [REPEATS]      arrays of MIB mebibytes each; prints
//                                      "threads mib best_gb_s median_gb_s round_trip_ns"
//
// The last number, 0 for one thread, is the time in which a cache line goes from one core to another and back: what two
// threads pay for every floe that both of them move. On a virtual machine it may change fivefold within minutes, with
// the places where the host runs its cores.
//
// Counted as STREAM counts: 24 bytes an element, without the read that a store of a whole cache line may cost. Arrays
// four times the last cache, as STREAM asks; each thread touches its own part first.
#include <errno.h>
#include <omp.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/// Whole number lo..hi, or the end of the program.
static long number(const char *name, const char *text, long lo, long hi)
{
    char *end;
    errno = 0;
    const long v = strtol(text, &end, 10);
    if (end == text || *end || errno || v < lo || v > hi) {
        fprintf(stderr, "triad: %s %s: give a whole number from %ld to %ld\n", name, text, lo, hi);
        exit(2);
    }
    return v;
}

/// Time of one exchange of a cache line between two threads and back, ns; 0 if there are no two.
static double round_trip(void)
{
    enum { TRIPS = 20000, SPINS = 2000 };
    static _Atomic long turn;
    double time = 0;
#pragma omp parallel num_threads(2)
    if (omp_get_num_threads() == 2) {
        const int me = omp_get_thread_num();
        const double t0 = omp_get_wtime();
        for (long i = 0; i < TRIPS; i++) {
            for (long n = 0; atomic_load_explicit(&turn, memory_order_acquire) != 2 * i + me; n++)
                if (n > SPINS) sched_yield();
            atomic_store_explicit(&turn, 2 * i + me + 1, memory_order_release);
        }
        if (me == 1) time = 1e9 * (omp_get_wtime() - t0) / TRIPS;
    }
    return time;
}

int main(int argc, char **argv)
{
    if (argc < 3 || argc > 4) {
        fprintf(stderr, "usage: triad THREADS MIB [REPEATS]\n");
        return 2;
    }
    const int threads = (int)number("THREADS", argv[1], 1, 1024);
    const long mib = number("MIB", argv[2], 1, 65536), repeats = argc > 3 ? number("REPEATS", argv[3], 1, 1000) : 15;
    const size_t n = (size_t)mib * (1 << 20) / sizeof(double);
    double *restrict a = malloc(n * sizeof *a), *restrict b = malloc(n * sizeof *b),
                     *restrict c = malloc(n * sizeof *c);
    double *rate = malloc((size_t)repeats * sizeof *rate);
    if (!a || !b || !c || !rate) {
        fprintf(stderr, "triad: no memory for three arrays of %ld MiB; take smaller ones\n", mib);
        return 4;
    }
    const double s = 3;
    omp_set_num_threads(threads);
#pragma omp parallel for schedule(static)
    for (size_t i = 0; i < n; i++) {
        a[i] = 0;
        b[i] = 1;
        c[i] = 2;
    }
    for (long r = 0; r < repeats; r++) {
        const double t0 = omp_get_wtime();
#pragma omp parallel for schedule(static)
        for (size_t i = 0; i < n; i++) a[i] = b[i] + s * c[i];
        rate[r] = 24e-9 * (double)n / (omp_get_wtime() - t0);
        // keeps the loop from being done once for all; the value stays 1
        b[(size_t)r % n] = a[n - 1 - (size_t)r % n] - 6;
    }
    for (size_t i = 0; i < n; i++) {
        if (a[i] != 7) {
            fprintf(stderr, "triad: element %zu is %g, not 7: the machine or the compiler is at fault\n", i, a[i]);
            return 5;
        }
    }
    qsort(rate, (size_t)repeats, sizeof *rate, ascending);
    printf("%d %ld %.3f %.3f %.0f\n", threads, mib, rate[repeats - 1], rate[repeats / 2],
           threads > 1 ? round_trip() : 0);
    free(a);
    free(b);
    free(c);
    free(rate);
    return 0;
}
