// SPDX-License-Identifier: MIT
// Preloaded into the program by tests: system calls that fail where a test asks for it.
//
//     BT_FAULT=NAME     opening or renaming a file of this name, without its folder, fails as on a full disk
//     BT_FAULT_HANGUP=1 a handler of SIGHUP, like that of UCX, is set as soon as the libraries are loaded
//     BT_FAULT_SIGNAL=1 SIGUSR1 arrives before the constructors of the libraries are done, and at the second start
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <unistd.h>

static int fails(const char *path)
{
    const char *name = getenv("BT_FAULT"), *slash = strrchr(path, '/');
    if (!name || strcmp(slash ? slash + 1 : path, name)) return 0;
    errno = ENOSPC;
    return 1;
}

static void *next(const char *name)
{
    void *f = dlsym(RTLD_NEXT, name);
    if (!f) abort();
    return f;
}

static int open_with(const char *name, const char *path, int flags, mode_t mode)
{
    if ((flags & O_ACCMODE) != O_RDONLY && fails(path)) return -1;
    int (*real)(const char *, int, ...);
    *(void **)&real = next(name);
    return real(path, flags, mode);
}

int open(const char *path, int flags, ...)
{
    va_list ap;
    va_start(ap, flags);
    const mode_t mode = flags & O_CREAT ? va_arg(ap, mode_t) : 0;
    va_end(ap);
    return open_with("open", path, flags, mode);
}

int open64(const char *path, int flags, ...)
{
    va_list ap;
    va_start(ap, flags);
    const mode_t mode = flags & O_CREAT ? va_arg(ap, mode_t) : 0;
    va_end(ap);
    return open_with("open64", path, flags, mode);
}

FILE *fopen(const char *path, const char *mode)
{
    if (*mode != 'r' && fails(path)) return NULL;
    FILE *(*real)(const char *, const char *);
    *(void **)&real = next("fopen");
    return real(path, mode);
}

int rename(const char *from, const char *to)
{
    if (fails(to)) return -1;
    int (*real)(const char *, const char *);
    *(void **)&real = next("rename");
    return real(from, to);
}

int execv(const char *path, char *const argv[])
{
    if (getenv("BT_FAULT_SIGNAL")) raise(SIGUSR1);
    int (*real)(const char *, char *const *);
    *(void **)&real = next("execv");
    return real(path, argv);
}

static void handler(int number) { (void)number; }

__attribute__((constructor)) static void begin(void)
{
    if (getenv("BT_FAULT_HANGUP")) signal(SIGHUP, handler);
    if (getenv("BT_FAULT_SIGNAL")) raise(SIGUSR1);
}
