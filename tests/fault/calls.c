// SPDX-License-Identifier: MIT
// Preloaded into the program by tests: the n-th system call on files of one folder fails, or each is logged.
//
//     BT_CALLS_UNDER=FOLDER   only calls on paths that begin so, or on descriptors of such files, are counted
//     BT_CALLS_LOG=FILE       one line per call: name, path, second path or bytes, result
//     BT_CALLS=NAME,NAME      the calls counted for the fault, e.g. write,pwrite64 (all: every one known here)
//     BT_CALLS_AT=N           the N-th of them, from 1, meets the fault
//     BT_CALLS_ON=1           and so does every later one, as on a disk that stays full
//     BT_CALLS_WITH=FAULT     an errno as a number, or "short": half of the bytes are written
//     BT_CALLS_SIGNAL=NUMBER  the process gets this signal before that call, which is then made
//     BT_CALLS_IN=first|job   with `ensemble`: only in the process that was started, or only in those it starts; calls
//                             of the others are logged in FILE.other
//
// System calls, not functions of the C library: stdio writes from within the library, where a preloaded function of
// that name is not seen. A seccomp filter turns each call into SIGSYS, and the handler makes the call itself from
// bt_raw, which the filter recognises by address. Rejected: strace, whose injection has no short writes, which is not
// on every machine, and which costs ten times as much; functions alone, for the reason above.
//
// A filter survives exec but its handler does not, so a process started by a filtered one would die while loading. So
// posix_spawn asks a process forked before the filter was set, which makes the new process a child of the first one
// (CLONE_PARENT). This counts as a call, "posix_spawn", whatever the path.
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sched.h>
#include <signal.h>
#include <spawn.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <ucontext.h>
#include <unistd.h>

long bt_raw(long number, long a, long b, long c, long d, long e, long f);
extern const char bt_raw_end[];
#if defined __x86_64__
__asm__(".text\n.globl bt_raw\n.type bt_raw,@function\nbt_raw:\n"
        "mov %rdi,%rax\nmov %rsi,%rdi\nmov %rdx,%rsi\nmov %rcx,%rdx\nmov %r8,%r10\nmov %r9,%r8\nmov 8(%rsp),%r9\n"
        "syscall\n.globl bt_raw_end\nbt_raw_end:\nret\n");
#define ARGUMENTS(u)                                                                                                   \
    {(u)->uc_mcontext.gregs[REG_RDI], (u)->uc_mcontext.gregs[REG_RSI], (u)->uc_mcontext.gregs[REG_RDX],                \
     (u)->uc_mcontext.gregs[REG_R10], (u)->uc_mcontext.gregs[REG_R8],  (u)->uc_mcontext.gregs[REG_R9]}
#define RESULT(u) (u)->uc_mcontext.gregs[REG_RAX]
#elif defined __aarch64__
__asm__(".text\n.globl bt_raw\n.type bt_raw,@function\nbt_raw:\n"
        "mov x8,x0\nmov x0,x1\nmov x1,x2\nmov x2,x3\nmov x3,x4\nmov x4,x5\nmov x5,x6\n"
        "svc #0\n.globl bt_raw_end\nbt_raw_end:\nret\n");
#define ARGUMENTS(u)                                                                                                   \
    {(long)(u)->uc_mcontext.regs[0], (long)(u)->uc_mcontext.regs[1], (long)(u)->uc_mcontext.regs[2],                   \
     (long)(u)->uc_mcontext.regs[3], (long)(u)->uc_mcontext.regs[4], (long)(u)->uc_mcontext.regs[5]}
#define RESULT(u) (u)->uc_mcontext.regs[0]
#else
#error "say how a call of the system is made here"
#endif

/// Where a call names its file: FD, PATH or AT (folder and path) from argument 0 on; two of these for a rename.
enum { FD, PATH, AT };
enum { MOST = 4096 };

static const struct {
    const char *name;
    int number, kind;
    signed char pairs, size; ///< second path; argument that is the number of bytes to be written, 0 = none
} calls[] = {
    {"write", SYS_write, FD, 0, 2},
    {"pwrite64", SYS_pwrite64, FD, 0, 2},
    {"writev", SYS_writev, FD, 0, 0},
    {"fsync", SYS_fsync, FD, 0, 0},
    {"fdatasync", SYS_fdatasync, FD, 0, 0},
    {"ftruncate", SYS_ftruncate, FD, 0, 0},
    {"close", SYS_close, FD, 0, 0},
    {"read", SYS_read, FD, 0, 0},
    {"pread64", SYS_pread64, FD, 0, 0},
    {"openat", SYS_openat, AT, 0, 0},
    {"mkdirat", SYS_mkdirat, AT, 0, 0},
    {"unlinkat", SYS_unlinkat, AT, 0, 0},
    {"renameat", SYS_renameat, AT, 1, 0},
    {"flock", SYS_flock, FD, 0, 0},
    {"fcntl", SYS_fcntl, FD, 0, 0}, // locks only
#ifdef SYS_open
    {"open", SYS_open, PATH, 0, 0},
    {"mkdir", SYS_mkdir, PATH, 0, 0},
    {"unlink", SYS_unlink, PATH, 0, 0},
    {"rmdir", SYS_rmdir, PATH, 0, 0},
    {"rename", SYS_rename, PATH, 1, 0},
#endif
};
enum { N_CALLS = sizeof calls / sizeof *calls };

static struct {
    char under[MOST];
    size_t n_under;
    int log, error, writes_short, on, signal;
    long at;
    char counted[N_CALLS], spawns;
} how = {.log = -1};
static atomic_long count;
static int spawner = -1; // socket to the process that starts others

/// The path of an argument, "" where there is none.
static void path_of(int kind, const long *a, char out[MOST])
{
    *out = 0;
    if (kind == FD) {
        char link[40];
        snprintf(link, sizeof link, "/proc/self/fd/%ld", a[0]);
        const long n = bt_raw(SYS_readlinkat, AT_FDCWD, (long)link, (long)out, MOST - 1, 0, 0);
        out[n > 0 ? n : 0] = 0;
    } else {
        const char *path = (const char *)a[kind == AT];
        if (path) strncpy(out, path, MOST - 1)[MOST - 1] = 0;
    }
}

static long make(int number, const long *a) { return bt_raw(number, a[0], a[1], a[2], a[3], a[4], a[5]); }

/// Make the call with the fault. A descriptor is gone after any close, whatever that returns.
static long fail(int k, const long *a)
{
    if (how.signal) {
        bt_raw(SYS_kill, bt_raw(SYS_getpid, 0, 0, 0, 0, 0, 0), how.signal, 0, 0, 0, 0);
        return make(calls[k].number, a);
    }
    if (how.writes_short && calls[k].size) {
        long less[6];
        memcpy(less, a, sizeof less);
        if (less[2] > 1) less[2] /= 2;
        return make(calls[k].number, less);
    }
    if (how.writes_short) return make(calls[k].number, a);
    if (calls[k].number == SYS_close) make(SYS_close, a);
    return -how.error;
}

/// Does the next call meet the fault? counted: it is one of the selected calls.
static int meets(int counted)
{
    const long n = counted ? atomic_fetch_add(&count, 1) + 1 : 0;
    return how.at > 0 && (n == how.at || (how.on && n > how.at));
}

static void note(const char *name, const char *path, const char *second, long result, int met)
{
    char line[2 * MOST + 80];
    if (how.log < 0) return;
    const int size = snprintf(line, sizeof line, "%s\t%s\t%s\t%ld%s\n", name, path, second, result,
                              met ? "\tfault" : "");
    bt_raw(SYS_write, how.log, (long)line, size, 0, 0, 0);
}

static long take(int k, const long *a)
{
    char path[MOST], second[MOST];
    const int locks = a[1] == F_OFD_SETLK || a[1] == F_OFD_SETLKW || a[1] == F_OFD_GETLK;
    if (calls[k].number == SYS_fcntl && !locks) return make(SYS_fcntl, a);
    path_of(calls[k].kind, a, path);
    *second = 0;
    if (calls[k].pairs) path_of(calls[k].kind, a + 1 + (calls[k].kind == AT), second);
    if (strncmp(*second ? second : path, how.under, how.n_under)) return make(calls[k].number, a);
    const int met = meets(how.counted[k]);
    if (met && how.signal == SIGKILL) note("killed", path, second, 0, met);
    const long result = met ? fail(k, a) : make(calls[k].number, a);
    note(calls[k].name, path, second, result, met);
    return result;
}

static void on_call(int number, siginfo_t *info, void *context)
{
    (void)number;
    const int before = errno;
    ucontext_t *u = context;
    const long a[6] = ARGUMENTS(u);
    for (int k = 0; k < N_CALLS; k++)
        if (calls[k].number == info->si_syscall) {
            const long result = take(k, a);
            RESULT(u) = (__typeof__(RESULT(u)))result;
        }
    errno = before;
}

/// Turn each call of the table into SIGSYS, unless made from bt_raw.
static void filter(void)
{
    enum { AHEAD = 3 };
    struct sock_filter f[N_CALLS + 8];
    int n = 0;
    const uint64_t end = (uint64_t)(uintptr_t)bt_raw_end;
    const unsigned short load = BPF_LD | BPF_W | BPF_ABS, equal = BPF_JMP | BPF_JEQ | BPF_K, end_with = BPF_RET | BPF_K;
    const unsigned ip = offsetof(struct seccomp_data, instruction_pointer);
    f[n++] = (struct sock_filter)BPF_STMT(load, ip);
    f[n++] = (struct sock_filter)BPF_JUMP(equal, (uint32_t)end, 0, AHEAD - 1);
    f[n++] = (struct sock_filter)BPF_STMT(load, ip + 4);
    f[n++] = (struct sock_filter)BPF_JUMP(equal, (uint32_t)(end >> 32), N_CALLS + 1, 0);
    f[n++] = (struct sock_filter)BPF_STMT(load, offsetof(struct seccomp_data, nr));
    for (int k = 0; k < N_CALLS; k++, n++)
        f[n] = (struct sock_filter)BPF_JUMP(equal, (uint32_t)calls[k].number, (unsigned char)(N_CALLS - k), 0);
    f[n++] = (struct sock_filter)BPF_STMT(end_with, SECCOMP_RET_ALLOW);
    f[n++] = (struct sock_filter)BPF_STMT(end_with, SECCOMP_RET_TRAP);
    const struct sock_fprog program = {(unsigned short)n, f};
    if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0 || prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) != 0) {
        perror("calls.so: seccomp");
        _exit(99);
    }
}

static const char *given(const char *name)
{
    const char *value = getenv(name);
    return value ? value : "";
}

// --- processes that are started --------------------------------------------------------------------------------------

enum { ROOM = 1 << 16, WORDS = 2000 };

/// Words, ended by an empty one, which occurs in no command or environment.
static char *packed(char *at, const char *end, char *const *words)
{
    for (; *words && at + strlen(*words) + 2 < end; words++) at = stpcpy(at, *words) + 1;
    *at++ = 0;
    return at;
}

static char *unpacked(char *at, char **words)
{
    int n = 0;
    for (; *at && n < WORDS; at += strlen(at) + 1) words[n++] = at;
    words[n] = NULL;
    return at + 1;
}

/// A message holds words and environment; the answer is the pid.
static _Noreturn void start_others(int s)
{
    static char message[ROOM + 1];
    static char *words[WORDS + 1], *env[WORDS + 1];
    while (recv(s, message, ROOM, 0) > 0) {
        unpacked(unpacked(message, words), env);
        const int pid = (int)syscall(SYS_clone, CLONE_PARENT | SIGCHLD, 0, 0, 0, 0);
        if (pid == 0) {
            execve("/proc/self/exe", words, env);
            _exit(127);
        }
        if (send(s, &pid, sizeof pid, 0) < 0) break;
    }
    _exit(0);
}

static void fork_spawner(void)
{
    int ends[2];
    if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) != 0) _exit(99);
    if (fork() == 0) {
        close(ends[0]);
        start_others(ends[1]);
    }
    close(ends[1]);
    spawner = ends[0];
}

int posix_spawn(pid_t *pid, const char *path, const posix_spawn_file_actions_t *actions, const posix_spawnattr_t *attr,
                char *const argv[], char *const envp[])
{
    static char message[ROOM];
    if (spawner < 0) {
        int (*real)(pid_t *, const char *, const posix_spawn_file_actions_t *, const posix_spawnattr_t *, char *const *,
                    char *const *);
        *(void **)&real = dlsym(RTLD_NEXT, "posix_spawn");
        return real(pid, path, actions, attr, argv, envp);
    }
    const int met = meets(how.spawns);
    int started = -1;
    if (!met) {
        const char *last = message + ROOM, *end = packed(packed(message, last, argv), last, envp);
        if (send(spawner, message, (size_t)(end - message), 0) < 0 || recv(spawner, &started, sizeof started, 0) < 0)
            return EIO;
        *pid = started;
    }
    note("posix_spawn", path, "", met ? -how.error : started, met);
    return met ? how.error : started < 0 ? EAGAIN : 0;
}

__attribute__((constructor)) static void begin(void)
{
    // the filter survives the second start of the program, and its handler does not
    if (!*given("BERGTOW_STARTED") || !*given("BT_CALLS_UNDER")) return;
    snprintf(how.under, sizeof how.under, "%s", given("BT_CALLS_UNDER"));
    how.n_under = strlen(how.under);
    const char *names = given("BT_CALLS");
    for (int k = 0; k < N_CALLS; k++) {
        const size_t n = strlen(calls[k].name);
        for (const char *at = names; (at = strstr(at, calls[k].name)); at += n)
            how.counted[k] |= (at == names || at[-1] == ',') && (at[n] == ',' || !at[n]);
        how.counted[k] |= !strcmp(names, "all");
    }
    how.spawns = strstr(names, "posix_spawn") != NULL;
    const char *in = given("BT_CALLS_IN");
    const int job = *given("BERGTOW_JOB") != 0, struck = !*in || job == !strcmp(in, "job");
    how.at = struck ? atol(given("BT_CALLS_AT")) : 0;
    how.on = *given("BT_CALLS_ON") != 0;
    how.signal = atoi(given("BT_CALLS_SIGNAL"));
    how.writes_short = !strcmp(given("BT_CALLS_WITH"), "short");
    how.error = atoi(given("BT_CALLS_WITH"));
    if (*given("BT_CALLS_LOG")) {
        char path[MOST];
        snprintf(path, sizeof path, "%s%s", given("BT_CALLS_LOG"), struck ? "" : ".other");
        how.log = open(path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
    }
    if (*in && !job) fork_spawner();
    struct sigaction act = {.sa_sigaction = on_call, .sa_flags = SA_SIGINFO | SA_NODEFER};
    sigaction(SIGSYS, &act, NULL);
    filter();
}
