// SPDX-License-Identifier: MIT
// bergtow run: run a case and write a result folder.
#include "bergtow/run.h"
#include "app/cmd.h"
#include "base/inside.h"
#include "base/process.h"

#include <inttypes.h>
#include <string.h>

typedef struct {
    bt_cmd_case file;
    bt_run_options run;
    bool force;
} options;

enum { KEY_DUMP = 256, KEY_FORCE };

// STEP:FILE.h5
static void parse_dump(struct argp_state *state, char *arg, bt_run_options *run)
{
    char *colon = strchr(arg, ':');
    if (!colon || !colon[1]) {
        argp_error(state, "--dump-contacts %s: give STEP:FILE.h5, as in 100:contacts.h5", arg);
        return;
    }
    *colon = 0;
    run->dump_step = bt_cmd_number(state, "--dump-contacts: step", arg, INT64_MAX);
    run->dump_path = colon + 1;
}

static error_t parse(int key, char *arg, struct argp_state *state)
{
    options *opt = state->input;
    switch (key) {
    case ARGP_KEY_INIT: state->child_inputs[0] = &opt->file, state->child_inputs[1] = &opt->run; return 0;
    case 'o':
        if (!*arg) argp_error(state, "-o: the name of the folder is empty; give one");
        opt->run.dir = arg;
        return 0;
    case KEY_DUMP: parse_dump(state, arg, &opt->run); return 0;
    case KEY_FORCE: opt->force = true; return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option run_options[] = {
    {"output", 'o', "DIR", 0, "result folder, default out/ and the name of the case without .yml", 0},
    {"force", KEY_FORCE, NULL, 0, "replace the result in the folder, and the file of --dump-contacts", 0},
    {"dump-contacts", KEY_DUMP, "STEP:FILE.h5", 0, "write the contact problem of this step in the FCLIB format", 0},
    {0},
};
static const struct argp_child children[] = {{.argp = &bt_cmd_case_argp}, {.argp = &bt_cmd_steps_argp}, {0}};
static const struct argp run_argp = {.options = run_options,
                                     .parser = parse,
                                     .args_doc = "CASE.yml",
                                     .children = children,
                                     .doc = "Tow the body of a case through its ice and write a result folder."};

/// Refuse to write the contacts of a step that this call does not compute.
static bt_status check_dump(const bt_run_options *run, const bt_case *input, bt_errors *err)
{
    const int64_t all = bt_case_steps(input), last = run->max_steps > 0 && run->max_steps < all ? run->max_steps : all;
    if (run->dump_step <= last) return BT_OK;
    return bt_fail(err, BT_ERR_USAGE, "--dump-contacts: step %" PRId64 " is not computed: the last one is %" PRId64,
                   run->dump_step, last);
}

int bt_cmd_run(int argc, char **argv)
{
    options opt = {.run = {.dump_step = -1, .aloud = true, .began = bt_launcher_began()}};
    char *command_line = bt_cmd_join(argc, argv);
    opt.run.command_line = command_line;
    bt_cmd_parse(&run_argp, argc, argv, &opt);
    if (!opt.force) opt.run.remedy = "give another folder with -o, or --force to replace it";
    const bt_comm *comm = bt_comm_world();
    if (comm->rank != 0) opt.run.quiet = true;
    char *folder = opt.run.dir ? NULL : bt_cmd_default_folder(opt.file.path);
    if (folder) opt.run.dir = folder;

    bt_case input = {0};
    bt_errors err = {0};
    bt_status status = bt_cmd_each_may_read(comm, opt.file.path, &err);
    if (status == BT_OK) status = bt_case_read(&input, opt.file.path, opt.file.set, opt.file.n_set, &err);
    if (status == BT_OK) status = check_dump(&opt.run, &input, &err);
    if (status == BT_OK && comm->rank == 0 && opt.run.dump_path)
        status = bt_cmd_may_write(opt.run.dump_path, opt.file.path, false, opt.force, &err);
    status = bt_comm_agree(comm, status);
    if (status == BT_OK) status = bt_run(comm, &input, &opt.run, &err);
    bt_case_free(&input);
    BT_FREE(opt.file.set, folder, command_line);
    return bt_cmd_end(comm, status, &err);
}
