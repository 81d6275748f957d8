// SPDX-License-Identifier: MIT
// bergtow ensemble: the members of a study.
#include <errno.h>
#include <signal.h>
#include <spawn.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "bergtow/ensemble.h"
#include "bergtow/run.h"
#include "app/cmd.h"
#include "base/inside.h"

// --- processes -------------------------------------------------------------------------------------------------------

// Members are independent, and a field of a few thousand floes keeps one core busy. Two processes of one thread each
// need less time for them than one of two threads, and half of the processor time; on many cores the gain is a factor.
// Several calls may work on one folder, for job arrays, so a call starts itself again. Rejected: members in threads of
// one process, because the OpenMP team, signals and the first error belong to a process.

/// Helper processes for bt_ensemble_run. argv: of the command `ensemble`; it must outlive the calls.
typedef struct bt_jobs {
    int argc;
    char **argv;
    int n;
    long pid[BT_MAX_JOBS]; ///< [n] 0: could not be started
    char threads[16];
} bt_jobs;

static const char mark[] = "BERGTOW_JOB";

/// Is this process a helper? Then it also ends, with checkpoints, when the process that started it has ended.
static bool jobs_is_one(void)
{
    const char *parent = getenv(mark);
    if (!parent) return false;
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (getppid() != (pid_t)atol(parent)) raise(SIGTERM); // the parent has ended already
    return true;
}

/// `start` and `end` of bt_ensemble_helpers; of: a bt_jobs. A helper that cannot be started, or is killed, is reported,
/// and the others do without it.
static void jobs_start(void *of, int n, int threads)
{
    bt_jobs *jobs = of;
    char **words = bt_alloc((size_t)jobs->argc + 5, sizeof *words);
    int k = 0;
    words[k++] = "bergtow";
    words[k++] = "ensemble";
    snprintf(jobs->threads, sizeof jobs->threads, "%d", threads);
    words[k++] = "--threads"; // before the user's words, where -- may end the options
    words[k++] = jobs->threads;
    words[k++] = "--no-wait";
    for (int i = 1; i < jobs->argc; i++) words[k++] = jobs->argv[i];
    words[k] = NULL;

    char parent[24];
    snprintf(parent, sizeof parent, "%ld", (long)getpid());
    setenv(mark, parent, 1);
    // if bound to the place of this thread, all helpers would share one core
    char *bind = getenv("OMP_PROC_BIND") ? bt_text_copy(getenv("OMP_PROC_BIND")) : NULL;
    if (bind) setenv("OMP_PROC_BIND", "false", 1);
    for (int i = 0; i < n && i < BT_MAX_JOBS; i++) {
        pid_t pid;
        const int error = posix_spawn(&pid, "/proc/self/exe", NULL, NULL, words, environ);
        jobs->pid[jobs->n++] = error == 0 ? pid : 0;
        if (error != 0)
            bt_errors_warn("warning: job %d of %d could not be started: %s; the others take over its members; raise "
                           "the limit on processes (ulimit -u), or use fewer --jobs",
                           i + 2, n + 1, strerror(error));
    }
    unsetenv(mark);
    if (bind) setenv("OMP_PROC_BIND", bind, 1);
    free(bind);
    free(words);
}

static void jobs_end(void *of, bool stop)
{
    bt_jobs *jobs = of;
    for (int i = 0; i < jobs->n && stop; i++)
        if (jobs->pid[i] > 0) kill((pid_t)jobs->pid[i], SIGTERM);
    for (int i = 0; i < jobs->n; i++) {
        int how = 0;
        while (jobs->pid[i] > 0 && waitpid((pid_t)jobs->pid[i], &how, 0) < 0 && errno == EINTR) continue;
        // it has reported any other error itself
        if (!stop && WIFSIGNALED(how))
            bt_errors_warn("warning: job %d of %d was ended by signal %d (%s); the others took over its members; if "
                           "memory is short, use fewer --jobs",
                           i + 2, jobs->n + 1, WTERMSIG(how), strsignal(WTERMSIG(how)));
    }
    jobs->n = 0;
}

// --- the command -----------------------------------------------------------------------------------------------------

typedef struct {
    bt_cmd_case file; ///< the study, and overrides of its values
    bt_run_options steps;
    bt_ensemble_options run;
} options;

enum { KEY_RETRY = 256, KEY_LEAVE };

static error_t parse(int key, char *arg, struct argp_state *state)
{
    options *opt = state->input;
    switch (key) {
    case ARGP_KEY_INIT: state->child_inputs[0] = &opt->file, state->child_inputs[1] = &opt->steps; return 0;
    case 'o':
        if (!*arg) argp_error(state, "-o: the name of the folder is empty; give one");
        opt->run.dir = arg;
        return 0;
    case 'j': opt->run.jobs = (int)bt_cmd_number(state, "--jobs", arg, BT_MAX_JOBS); return 0;
    case KEY_RETRY: opt->run.retry = true; return 0;
    case KEY_LEAVE: opt->run.leave = true; return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option ensemble_options[] = {
    {"output", 'o', "DIR", 0, "folder of the ensemble, default out/ and the name of the study without .yml", 0},
    {"jobs", 'j', "N", 0,
     "processes on this machine that share the members; default: as many as fit on the cores, with one thread per "
     "15,000 floes of a member unless the number of threads is given; always 1 under mpirun or srun, and with --steps",
     0},
    {"retry-failed", KEY_RETRY, NULL, 0,
     "try all failed members again; without it only those that failed for want of a file or of disk space", 0},
    {"no-wait", KEY_LEAVE, NULL, 0,
     "end when no member is left to start; exit code 6 if other calls are still running members of the folder", 0},
    {0},
};
static const struct argp_child children[] = {{.argp = &bt_cmd_case_argp}, {.argp = &bt_cmd_steps_argp}, {0}};
static const struct argp ensemble_argp = {
    .options = ensemble_options,
    .parser = parse,
    .args_doc = "STUDY.yml",
    .children = children,
    .doc = "Run the members of a study. Repeat the command to continue where it ended, for whatever reason, and to run "
           "members with missing or damaged results again. The exit code is 0 only when every member is finished and "
           "sound. Under mpirun the members are assigned to groups of ranks (`ranks` of the study); several calls may "
           "work on one folder."};

int bt_cmd_ensemble(int argc, char **argv)
{
    options opt = {.file = {.study = true}};
    char *command_line = bt_cmd_join(argc, argv);
    opt.run.command_line = command_line;
    bt_cmd_parse(&ensemble_argp, argc, argv, &opt);
    opt.run.threads = opt.steps.threads, opt.run.quiet = opt.steps.quiet;
    opt.run.max_steps = opt.steps.max_steps, opt.run.max_wall = opt.steps.max_wall;
    const bt_comm *comm = bt_comm_world();
    char *folder = opt.run.dir ? NULL : bt_cmd_default_folder(opt.file.path);
    if (folder) opt.run.dir = folder;
    bt_jobs jobs = {.argc = argc, .argv = argv};
    opt.run.helpers = &(bt_ensemble_helpers){.start = jobs_start, .end = jobs_end, .of = &jobs};
    opt.run.job = jobs_is_one();
    bt_study study = {0};
    bt_errors err = {0};
    bt_status status = bt_cmd_each_may_read(comm, opt.file.path, &err);
    if (status == BT_OK) status = bt_comm_agree(comm, bt_study_read(&study, opt.file.path, &err));
    if (status == BT_OK) status = bt_comm_agree(comm, bt_study_override(&study, opt.file.set, opt.file.n_set, &err));
    if (status == BT_OK) status = bt_ensemble_run(comm, &study, &opt.run, &err);
    bt_study_free(&study);
    BT_FREE(opt.file.set, folder, command_line);
    return bt_cmd_end(comm, status, &err);
}
