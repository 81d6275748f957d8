// SPDX-License-Identifier: MIT
// The commands of the Python package, which takes over with the whole command line. It calls this program only to start
// runs and ensembles, so that evaluation and pictures are in one language.
#include "app/cmd.h"
#include "base/fileio.h"
#include "base/process.h"
#include "run/halt.h"

#include <limits.h>
#include <string.h>
#include <unistd.h>

/// `name` in the folder `up` steps above a program; the caller frees it.
static char *beside(const char *program, int up, const char *name)
{
    char folder[PATH_MAX];
    snprintf(folder, sizeof folder, "%s", program);
    for (; up > 0; up--) {
        char *slash = strrchr(folder, '/');
        if (slash) *slash = 0;
    }
    return bt_file_join(folder, name);
}

/// The folder with the Python package: in BERGTOW_HOME, in share/bergtow of the prefix where this program is installed,
/// or in the source tree where it was built; the caller frees it.
static char *find_package(const char *program)
{
    const char *home = getenv("BERGTOW_HOME");
    if (home) return bt_file_join(home, "postproc");
    char *path = beside(program, 2, "share/bergtow/postproc"); // PREFIX/bin/bergtow
    if (access(path, R_OK) == 0) return path;
    free(path);
    return beside(program, 3, "postproc"); // build/release/bergtow
}

/// Put a folder in front of PYTHONPATH.
static void find_there_first(const char *folder)
{
    const char *others = getenv("PYTHONPATH");
    const size_t n = strlen(folder) + (others ? strlen(others) : 0) + 2;
    char *path = bt_alloc(n, 1);
    snprintf(path, n, others && *others ? "%s:%s" : "%s", folder, others);
    setenv("PYTHONPATH", path, 1);
    free(path);
}

int bt_cmd_python(int argc, char **argv)
{
    bt_errors err = {0};
    char program[PATH_MAX] = "";
    const char *python = getenv("PYTHON") ? getenv("PYTHON") : "/usr/bin/python3";
    if (bt_comm_world()->size > 1) {
        bt_errors_add(&err,
                      "%s: does not run under MPI; call it without mpirun or srun: it starts the runs that it needs, "
                      "--jobs at a time",
                      argv[0]);
        return bt_cmd_end(&bt_comm_alone, BT_ERR_USAGE, &err);
    }
    if (readlink("/proc/self/exe", program, sizeof program - 1) < 0) program[0] = 0;
    char *folder = find_package(program);
    const char *first = BT_PATH(folder, "bergtow/__main__.py");
    if (access(first, R_OK) == 0) {
        char **words = bt_alloc((size_t)argc + 4, sizeof *words);
        words[0] = (char *)python, words[1] = "-m", words[2] = "bergtow";
        for (int i = 0; i < argc; i++) words[i + 3] = argv[i];
        words[argc + 3] = NULL;
        setenv("BERGTOW", program, 1);
        find_there_first(folder);
        bt_launcher_forget(); // the launcher of this single rank
        bt_comm_end(BT_OK);   // a launcher waits for MPI to end
        fflush(NULL);
        // Until its guarded() (postproc/bergtow/cli/command.py) unblocks them: Python answers Ctrl-C with a traceback.
        bt_halt_block(&(sigset_t){0});
        execv(python, words); // in place of this process: signals sent to it reach the command
        free(words);
        bt_errors_add(&err, "%s: cannot be started; name a Python with numpy in PYTHON", python);
    } else {
        bt_errors_add(&err,
                      "%s: %s: cannot be read; install the Python package with pip install ./postproc and call its "
                      "command, or name the folder that holds postproc/ in BERGTOW_HOME",
                      argv[0], first);
    }
    free(folder);
    return bt_cmd_end(&bt_comm_alone, BT_ERR_IO, &err);
}
