// SPDX-License-Identifier: MIT
// The commands of the program, and the functions they share.
#ifndef BERGTOW_CMD_H
#define BERGTOW_CMD_H

#include "bergtow/case.h"
#include "bergtow/comm.h"

#include <argp.h>

/// A command: argv[0] is its name. Returns the exit code.
int bt_cmd_run(int argc, char **argv);
int bt_cmd_check(int argc, char **argv);
int bt_cmd_field(int argc, char **argv);
int bt_cmd_estimate(int argc, char **argv);
int bt_cmd_ensemble(int argc, char **argv);
int bt_cmd_python(int argc, char **argv);
int bt_cmd_resume(int argc, char **argv);
int bt_cmd_diff(int argc, char **argv);

/// The case file, or the study, and the overrides that every command takes.
typedef struct bt_cmd_case {
    bool study;       ///< messages ask for a study
    const char *path;
    const char **set; ///< [n_set]
    int n_set;
} bt_cmd_case;

/// Parse the arguments of a command: unknown options end the program with code 2 and a suggestion, from rank 0.
void bt_cmd_parse(const struct argp *argp, int argc, char **argv, void *input);

/// The argp parser of CASE.yml and --set; put it first among the children. Its input is a bt_cmd_case.
extern const struct argp bt_cmd_case_argp;
/// The children of a command that takes nothing else from a parser.
extern const struct argp_child bt_cmd_with_case[];
/// The argp parser of --threads, --steps, --max-wall and --quiet. Its input is a bt_run_options.
extern const struct argp bt_cmd_steps_argp;

/// A whole number from 1 to `most` in an option's text; anything else ends the program with code 2.
int64_t bt_cmd_number(const struct argp_state *state, const char *option, const char *text, int64_t most);

/// out/NAME for path/NAME.yml; the caller frees it.
char *bt_cmd_default_folder(const char *path);

/// Ends the program with a message and code 2 if this processor lacks instructions for which it was compiled. May be
/// called before the constructors of libraries.
void bt_processor_check(void);

/// The command as it could be typed again, for the provenance of the result. argv[0] is the command. The caller frees
/// it.
char *bt_cmd_join(int argc, char **argv);

/// May a command write this file? Never the case file itself, or anything but a regular file. A file that exists, is
/// not empty and was not written by this command (`ours`) needs --force. Errors: BT_ERR_IO.
bt_status bt_cmd_may_write(const char *path, const char *case_path, bool ours, bool force, bt_errors *err);

/// Collective over `comm`. Refuse a pipe, whose contents only one of the ranks would get. Errors: BT_ERR_USAGE.
bt_status bt_cmd_each_may_read(const bt_comm *comm, const char *path, bt_errors *err);

/// Collective over `comm`. Print all ranks' messages once, release them, and return the worst status as exit code.
int bt_cmd_end(const bt_comm *comm, bt_status status, bt_errors *err);

#endif
