// SPDX-License-Identifier: MIT
// Preloaded into the program by tests: the n-th memory request of the program itself fails.
//
//     BT_MEMORY_AT=N      the N-th request, from 1, is refused
//     BT_MEMORY_LOG=FILE  receives the number of requests at the end
//     BT_CALLS_IN         as in calls.c: selects the process
//
// Only requests from the program's own code count, recognised by their return address. Requests of libraries do not:
// the program could not mend what MPI does without memory.
#include <fcntl.h>
#include <dlfcn.h>
#include <errno.h>
#include <link.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

void *__libc_malloc(size_t size);
void *__libc_calloc(size_t n, size_t size);
void *__libc_realloc(void *p, size_t size);
void *__libc_memalign(size_t alignment, size_t size);

static uintptr_t from, to; // the program's code; 0 while nothing is counted
static atomic_long count;
static long refused;

static int fails(const void *caller)
{
    const uintptr_t at = (uintptr_t)caller;
    if (at < from || at >= to || atomic_fetch_add(&count, 1) + 1 != refused) return 0;
    errno = ENOMEM;
    return 1;
}
#define FAILS() fails(__builtin_return_address(0))

void *malloc(size_t size) { return FAILS() ? NULL : __libc_malloc(size); }
void *calloc(size_t n, size_t size) { return FAILS() ? NULL : __libc_calloc(n, size); }
void *realloc(void *p, size_t size) { return FAILS() ? NULL : __libc_realloc(p, size); }
void *aligned_alloc(size_t alignment, size_t size) { return FAILS() ? NULL : __libc_memalign(alignment, size); }

static void *next(const char *name)
{
    void *f = dlsym(RTLD_NEXT, name);
    if (!f) abort();
    return f;
}

int vasprintf(char **text, const char *format, va_list ap)
{
    if (FAILS()) return -1;
    int (*real)(char **, const char *, va_list);
    *(void **)&real = next("vasprintf");
    return real(text, format, ap);
}

FILE *open_memstream(char **text, size_t *size)
{
    if (FAILS()) return NULL;
    FILE *(*real)(char **, size_t *);
    *(void **)&real = next("open_memstream");
    return real(text, size);
}

/// The first object is the program.
static int take_program(struct dl_phdr_info *info, size_t size, void *data)
{
    (void)size, (void)data;
    for (int k = 0; k < info->dlpi_phnum; k++) {
        const ElfW(Phdr) *p = &info->dlpi_phdr[k];
        if (p->p_type != PT_LOAD || !(p->p_flags & PF_X)) continue;
        to = info->dlpi_addr + p->p_vaddr + p->p_memsz;
        from = info->dlpi_addr + p->p_vaddr;
    }
    return 1;
}

__attribute__((constructor)) static void begin(void)
{
    const char *at = getenv("BT_MEMORY_AT"), *in = getenv("BT_CALLS_IN");
    if (!getenv("BERGTOW_STARTED")) return;
    if (in && (getenv("BERGTOW_JOB") != NULL) != !strcmp(in, "job")) return;
    refused = at ? atol(at) : 0;
    dl_iterate_phdr(take_program, NULL);
}

__attribute__((destructor)) static void end(void)
{
    const char *path = getenv("BT_MEMORY_LOG");
    const int fd = path && from ? open(path, O_WRONLY | O_CREAT | O_TRUNC, 0666) : -1;
    if (fd < 0) return;
    dprintf(fd, "%ld\n", atomic_load(&count));
    close(fd);
}
