// SPDX-License-Identifier: MIT
// bergtow resume: continue a run from its last checkpoint. bergtow diff: compare two checkpoints.
#include "output/checkpoint.h"
#include "bergtow/run.h"
#include "app/cmd.h"
#include "base/fileio.h"
#include "base/inside.h"
#include "base/process.h"
#include "case/case_base.h"

#include <sys/stat.h>

typedef struct {
    char *dir;
    const char *file; ///< a checkpoint instead of a folder
    bt_run_options run;
} options;

static bool is_folder(const char *path)
{
    struct stat st;
    return stat(path, &st) == 0 && S_ISDIR(st.st_mode);
}

// A file is used as the checkpoint of the folder that it is in.
static void take_place(options *opt, char *arg)
{
    struct stat st;
    if (stat(arg, &st) != 0 || S_ISDIR(st.st_mode)) {
        opt->dir = bt_text_copy(arg);
        return;
    }
    opt->file = arg;
    opt->dir = bt_file_folder(arg);
}

static void refuse_case(const struct argp_state *state, const char *path)
{
    const bt_file_kind kind = bt_case_kind_of(path);
    if (kind == BT_FILE_CASE) argp_error(state, "%s: this is a case: bergtow run %s", path, path);
    if (kind == BT_FILE_STUDY)
        argp_error(state, "%s: this is a study; resume it with bergtow ensemble %s", path, path);
}

static error_t parse(int key, char *arg, struct argp_state *state)
{
    options *opt = state->input;
    switch (key) {
    case ARGP_KEY_INIT: state->child_inputs[0] = &opt->run; return 0;
    case ARGP_KEY_ARG:
        if (opt->dir)
            argp_error(state, "%s: one folder at a time; options with a value are written --option value", arg);
        take_place(opt, arg);
        if (opt->file) refuse_case(state, arg);
        return 0;
    case ARGP_KEY_END:
        if (!opt->dir) argp_error(state, "no folder given; name the result folder of a run, as in out/basin-80");
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_child children[] = {{.argp = &bt_cmd_steps_argp}, {0}};
static const struct argp resume_argp = {.children = children,
                                        .parser = parse,
                                        .args_doc = "DIR",
                                        .doc =
                                            "Continue the run in the result folder DIR from its last checkpoint, on "
                                            "any number of ranks and threads. The result is that of a run that was "
                                            "never stopped. DIR may also be a checkpoint file in the folder."};

int bt_cmd_resume(int argc, char **argv)
{
    options opt = {.run = {.dump_step = -1, .aloud = true, .began = bt_launcher_began()}};
    char *command_line = bt_cmd_join(argc, argv);
    bt_cmd_parse(&resume_argp, argc, argv, &opt);
    const bt_comm *comm = bt_comm_world();
    opt.run.dir = opt.dir;
    opt.run.from = opt.file;
    opt.run.command_line = command_line;
    if (comm->rank != 0) opt.run.quiet = true;
    bt_errors err = {0};
    const bt_status status = bt_run_resume(comm, &opt.run, &err);
    free(opt.dir);
    free(command_line);
    return bt_cmd_end(comm, status, &err);
}

// --- diff ------------------------------------------------------------------------------------------------------------

typedef struct {
    char *path[2];
    int n;
} two_files;

static error_t parse_two(int key, char *arg, struct argp_state *state)
{
    two_files *f = state->input;
    switch (key) {
    case ARGP_KEY_ARG:
        if (f->n == 2) argp_error(state, "%s: at most two checkpoints are compared", arg);
        f->path[f->n++] = is_folder(arg) ? bt_file_join(arg, BT_CHECKPOINT_FILE) : bt_text_copy(arg);
        return 0;
    case ARGP_KEY_END:
        if (f->n == 0) argp_error(state, "no checkpoint given; name one to print, or two to compare");
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp diff_argp = {
    .parser = parse_two,
    .args_doc = "A [B]",
    .doc = "Name the first difference between the states of two checkpoints (files or their folders), or print the "
           "contents of one. Exit code 0: the same, 1: different."};

int bt_cmd_diff(int argc, char **argv)
{
    two_files f = {0};
    bt_cmd_parse(&diff_argp, argc, argv, &f);
    bt_errors err = {0};
    char *difference = NULL;
    const bt_status status = f.n == 1 ? bt_checkpoint_print(f.path[0], &err)
                                      : bt_checkpoint_compare(f.path[0], f.path[1], &difference, &err);
    if (difference) printf("%s\n", difference);
    else if (f.n == 2 && status == BT_OK) puts("the states are the same");
    const bool differs = difference != NULL;
    BT_FREE(difference, f.path[0], f.path[1]);
    const int code = bt_cmd_end(bt_comm_world(), status, &err);
    return code == BT_OK && differs ? 1 : code;
}
