// SPDX-License-Identifier: MIT
// The commands that are scripts: `bergtow NAME` becomes postproc/NAME.py, which runs this program for its members and
// judges them with the statistics of the ensembles. Those are Python's; a second copy in C would be one too many.
#include "app/cmd.h"
#include "base/fileio.h"
#include "base/launcher.h"

#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/// The folder that is `up` steps above a program, with a name below it; the caller frees it.
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

/// The script of a command in BERGTOW_HOME, in share/bergtow of the prefix that this program was installed in, or in
/// the source tree that it was built in; the caller frees it.
static char *find_script(const char *program, const char *command)
{
    const char *home = getenv("BERGTOW_HOME");
    char script[NAME_MAX], installed[NAME_MAX];
    snprintf(script, sizeof script, "postproc/%s.py", command);
    snprintf(installed, sizeof installed, "share/bergtow/%.200s", script);
    if (home) return bt_file_join(home, script);
    char *path = beside(program, 2, installed); // PREFIX/bin/bergtow
    if (access(path, R_OK) == 0) return path;
    free(path);
    return beside(program, 3, script); // build/release/bergtow
}

int bt_cmd_script(int argc, char **argv)
{
    bt_errors err = {0};
    char program[PATH_MAX] = "";
    const char *python = getenv("PYTHON") ? getenv("PYTHON") : "/usr/bin/python3";
    char *path = NULL;
    if (bt_comm_world()->size > 1) {
        bt_errors_add(&err,
                      "%s: is no program of ranks; call it without mpirun or srun: what runs it needs it starts "
                      "itself, as many at a time as --jobs says",
                      argv[0]);
        return bt_cmd_end(&bt_comm_alone, BT_ERR_USAGE, &err);
    }
    if (readlink("/proc/self/exe", program, sizeof program - 1) > 0) path = find_script(program, argv[0]);
    if (path && access(path, R_OK) == 0) {
        char **arguments = bt_alloc((size_t)argc + 2, sizeof *arguments);
        arguments[0] = (char *)python, arguments[1] = path;
        for (int i = 1; i < argc; i++) arguments[i + 1] = argv[i];
        arguments[argc + 1] = NULL;
        setenv("BERGTOW", program, 1);
        bt_launcher_forget(); // of one rank
        bt_comm_end(BT_OK);   // a launcher waits for it
        fflush(NULL);
        execv(python, arguments); // in place of this process: what is sent to it reaches the script
        free(arguments);
        bt_errors_add(&err, "%s: cannot be started; name a Python with numpy in PYTHON", python);
    } else {
        bt_errors_add(&err, "%s: cannot be read; name the folder that holds postproc/ in BERGTOW_HOME",
                      path ? path : argv[0]);
    }
    free(path);
    return bt_cmd_end(&bt_comm_alone, BT_ERR_IO, &err);
}
