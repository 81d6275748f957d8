// SPDX-License-Identifier: MIT
// Processes that share the members of an ensemble with the one that a user has started; see jobs.h.
//
// Members are independent, and a field of some thousand floes keeps one core busy: two processes of one thread each
// take less time for them than one of two threads, and half of the processor time, and on many cores the difference is
// a factor. That several calls may work on one folder is there for job arrays; so a call starts itself again. Rejected:
// members in the threads of one process, as the team of OpenMP, signals and the first error all are of a process.
#include "app/jobs.h"

#include <errno.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

static const char mark[] = "BERGTOW_JOB";

bool bt_jobs_is_one(void)
{
    const char *parent = getenv(mark);
    if (!parent) return false;
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (getppid() != (pid_t)atol(parent)) raise(SIGTERM); // it has ended meanwhile
    return true;
}

void bt_jobs_start(void *of, int n, int threads)
{
    bt_jobs *j = of;
    char **words = bt_alloc((size_t)j->argc + 5, sizeof *words);
    int k = 0;
    words[k++] = "bergtow";
    words[k++] = "ensemble";
    snprintf(j->threads, sizeof j->threads, "%d", threads);
    words[k++] = "--threads"; // before the user's words, among which -- may end the options
    words[k++] = j->threads;
    words[k++] = "--no-wait";
    for (int i = 1; i < j->argc; i++) words[k++] = j->argv[i];
    words[k] = NULL;

    char parent[24];
    snprintf(parent, sizeof parent, "%ld", (long)getpid());
    setenv(mark, parent, 1);
    // bound to the place of this thread, all would share one core
    char *bind = getenv("OMP_PROC_BIND") ? bt_text_copy(getenv("OMP_PROC_BIND")) : NULL;
    if (bind) setenv("OMP_PROC_BIND", "false", 1);
    for (int i = 0; i < n && i < BT_MAX_JOBS; i++) {
        pid_t pid;
        const int error = posix_spawn(&pid, "/proc/self/exe", NULL, NULL, words, environ);
        j->pid[j->n++] = error == 0 ? pid : 0;
        if (error != 0)
            fprintf(stderr,
                    "bergtow: warning: job %d of %d could not be started: %s; the others take its members; to have as "
                    "many, raise the limit on processes (ulimit -u), or ask for fewer with --jobs\n",
                    i + 2, n + 1, strerror(error));
    }
    unsetenv(mark);
    if (bind) setenv("OMP_PROC_BIND", bind, 1);
    free(bind);
    free(words);
}

void bt_jobs_end(void *of, bool stop)
{
    bt_jobs *j = of;
    for (int i = 0; i < j->n && stop; i++)
        if (j->pid[i] > 0) kill((pid_t)j->pid[i], SIGTERM);
    for (int i = 0; i < j->n; i++) {
        int how = 0;
        while (j->pid[i] > 0 && waitpid((pid_t)j->pid[i], &how, 0) < 0 && errno == EINTR) continue;
        // all else it has said itself
        if (!stop && WIFSIGNALED(how))
            fprintf(stderr,
                    "bergtow: warning: job %d of %d was ended by signal %d (%s); the others took its members over; "
                    "where memory is short, ask for fewer jobs with --jobs\n",
                    i + 2, j->n + 1, WTERMSIG(how), strsignal(WTERMSIG(how)));
    }
    j->n = 0;
}
