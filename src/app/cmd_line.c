// SPDX-License-Identifier: MIT
// Shared by the commands: option parsing with suggestions, the case argument, the end of a command.
#include "app/cmd.h"
#include "bergtow/run.h"
#include "base/fileio.h"
#include "base/largest.h"
#include "base/name.h"
#include "base/units.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

// Long names of a parser and its children.
static int collect(const struct argp *argp, const char **names, int n, int cap)
{
    for (const struct argp_option *o = argp->options; o && (o->name || o->key || o->doc); o++)
        if (o->name && n < cap) names[n++] = o->name;
    for (const struct argp_child *child = argp->children; child && child->argp; child++)
        n = collect(child->argp, names, n, cap);
    return n;
}

// getopt says that an option is unknown and argp adds a usage line; neither suggests the right one. So long options are
// looked up here first. Unambiguous abbreviations stay allowed, as with getopt.
static void check_options(const struct argp *argp, int argc, char **argv)
{
    enum { CAP = 32 };
    const char *names[CAP + 1] = {"help", "usage", "version"};
    int n = collect(argp, names, 3, CAP);
    names[n] = NULL;
    for (int i = 1; i < argc && strcmp(argv[i], "--"); i++) {
        if (strncmp(argv[i], "--", 2)) continue;
        char name[64];
        size_t length = strcspn(argv[i] + 2, "=");
        snprintf(name, sizeof name, "%.*s", length < 60 ? (int)length : 60, argv[i] + 2);
        bool known = false;
        for (int j = 0; j < n && !known; j++) known = !strncmp(names[j], name, strlen(name));
        if (known) continue;
        const char *near = bt_suggest(name, names);
        if (near) fprintf(stderr, "bergtow %s: --%s: unknown option; did you mean --%s?\n", argv[0], name, near);
        else fprintf(stderr, "bergtow %s: --%s: unknown option; see bergtow %s --help\n", argv[0], name, argv[0]);
        exit(BT_ERR_USAGE);
    }
}

static bool parsing;

/// argp ends the program itself after --help, --usage and --version: see there, too, whether the text was lost.
static void leave_argp(void)
{
    const int code = parsing ? bt_cmd_end(&bt_comm_alone, BT_OK, &(bt_errors){0}) : BT_OK;
    if (code != BT_OK) _exit(bt_comm_end(code));
}

// All ranks have the same command line (checked in main.c), so they find the same errors in it and exit with the same
// code; one prints why.
static void parse_aloud(const struct argp *argp, int argc, char **argv, void *input)
{
    check_options(argp, argc, argv);
    // argp and getopt begin their messages with argv[0]
    static char name[32];
    snprintf(name, sizeof name, "bergtow %.20s", argv[0]);
    argv[0] = name;
    atexit(leave_argp);
    parsing = true;
    argp_parse(argp, argc, argv, 0, NULL, input);
    parsing = false;
}

void bt_cmd_parse(const struct argp *argp, int argc, char **argv, void *input)
{
    if (bt_comm_world()->rank == 0) {
        parse_aloud(argp, argc, argv, input);
        return;
    }
    // getopt writes to stderr whatever flags argp is given.
    int kept[2] = {dup(STDOUT_FILENO), dup(STDERR_FILENO)}, nowhere = open("/dev/null", O_WRONLY);
    for (int k = 0; k < 2; k++) dup2(nowhere, STDOUT_FILENO + k);
    parse_aloud(argp, argc, argv, input);
    for (int k = 0; k < 2; k++) {
        dup2(kept[k], STDOUT_FILENO + k);
        close(kept[k]);
    }
    close(nowhere);
}

static error_t parse_case(int key, char *arg, struct argp_state *state)
{
    bt_cmd_case *file = state->input;
    switch (key) {
    case 's':
        file->set = bt_realloc(file->set, (size_t)file->n_set + 1, sizeof *file->set);
        file->set[file->n_set++] = arg;
        return 0;
    case ARGP_KEY_ARG:
        if (file->path)
            argp_error(state, "%s: one %s at a time; options with a value are written --option value", arg,
                       file->study ? "study" : "case");
        file->path = arg;
        return 0;
    case ARGP_KEY_END:
        if (!file->path)
            argp_error(state, "no %s file given; name one, as in cases/%s", file->study ? "study" : "case",
                       file->study ? "studies/basin.yml" : "basin/basin-80.yml");
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option case_options[] = {
    {"set", 's', "KEY=VALUE", 0, "replace a value of the case; may be given several times (see bergtow --list-keys)",
     0},
    {0},
};
const struct argp bt_cmd_case_argp = {.options = case_options, .parser = parse_case};
const struct argp_child bt_cmd_with_case[] = {{.argp = &bt_cmd_case_argp}, {0}};

int64_t bt_cmd_number(const struct argp_state *state, const char *option, const char *text, int64_t most)
{
    char *end;
    errno = 0;
    long long v = strtoll(text, &end, 10);
    if (end == text || *end || errno || v < 1 || v > most)
        argp_error(state, "%s %s: give a whole number from 1 to %lld", option, text, (long long)most);
    return v;
}

/// A time of more than 0, s: "2 h", "90 min", "600"; anything else ends the program with code 2.
static double duration(const struct argp_state *state, const char *option, const char *text)
{
    double seconds = 0;
    char why[BT_WHY] = "";
    if (!bt_units_parse(text, BT_UNIT_TIME, &seconds, why)) argp_error(state, "%s %s: %s", option, text, why);
    if (!(seconds > 0)) argp_error(state, "%s %s: give a time above 0, as in 2h, 90min or 600", option, text);
    return seconds;
}

enum { KEY_STEPS = 256, KEY_WALL };

static error_t parse_steps(int key, char *arg, struct argp_state *state)
{
    bt_run_options *run = state->input;
    switch (key) {
    case 't': run->threads = (int)bt_cmd_number(state, "--threads", arg, BT_MAX_THREADS); return 0;
    case 'q': run->quiet = true; return 0;
    case KEY_STEPS: run->max_steps = bt_cmd_number(state, "--steps", arg, 1000000000); return 0;
    case KEY_WALL: run->max_wall = duration(state, "--max-wall", arg); return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const struct argp_option steps_options[] = {
    {"threads", 't', "N", 0,
     "OpenMP threads of each rank, default run.threads of the case (of a study, of its base case), or OMP_NUM_THREADS, "
     "or the cores of the node divided among its ranks; results do not depend on it",
     0},
    {"steps", KEY_STEPS, "N", 0, "stop after N steps of this call; in an ensemble, stop each member after N", 0},
    {"max-wall", KEY_WALL, "TIME", 0,
     "write a checkpoint and stop after this wall time, as in 2h, 90min or 600; continue with bergtow resume or, for "
     "an ensemble, by repeating the command",
     0},
    {"quiet", 'q', NULL, 0, "print neither progress nor the final table", 0},
    {0},
};
const struct argp bt_cmd_steps_argp = {.options = steps_options, .parser = parse_steps};

char *bt_cmd_default_folder(const char *path)
{
    const char *slash = strrchr(path, '/'), *name = slash ? slash + 1 : path, *dot = strrchr(name, '.');
    bool yaml = dot && dot != name && (!strcmp(dot, ".yml") || !strcmp(dot, ".yaml"));
    const int n = yaml ? (int)(dot - name) : (int)strlen(name);
    const bool dots = (int)strspn(name, ".") >= n; // "...yml" would be the folder above out/
    return bt_text_of("out/%.*s", dots ? 4 : n, dots ? "case" : name);
}

char *bt_cmd_join(int argc, char **argv)
{
    bt_text text;
    bt_text_begin(&text);
    FILE *out = text.out;
    fputs("bergtow", out);
    for (int i = 0; i < argc; i++) {
        bool safe =
            *argv[i] && strspn(argv[i], "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+=./,:%@") ==
                            strlen(argv[i]);
        fputs(safe ? " " : " '", out);
        for (const char *s = argv[i]; *s; s++) {
            if (*s == '\'') fputs("'\\''", out);
            else fputc(*s, out);
        }
        if (!safe) fputc('\'', out);
    }
    return bt_text_end(&text);
}

bt_status bt_cmd_may_write(const char *path, const char *case_path, bool ours, bool force, bt_errors *err)
{
    struct stat there, input;
    if (bt_file_may_take(path, err) != BT_OK) return BT_ERR_IO;
    if (stat(path, &there) != 0) return BT_OK; // an unusable place shows when it is written to
    if (stat(case_path, &input) == 0 && there.st_dev == input.st_dev && there.st_ino == input.st_ino)
        bt_errors_add(err, "%s: is the case file itself; give the output another name", path);
    else if (!ours && !force && !(S_ISREG(there.st_mode) && there.st_size == 0))
        bt_errors_add(err, "%s: already exists and is not a file of this command; give another name, or --force to "
                           "replace it", path);
    else return BT_OK;
    return BT_ERR_IO;
}

bt_status bt_cmd_each_may_read(const bt_comm *comm, const char *path, bt_errors *err)
{
    struct stat s;
    const bool pipe = comm->size > 1 && stat(path, &s) == 0 && !S_ISREG(s.st_mode) && !S_ISDIR(s.st_mode);
    if (pipe)
        bt_errors_add(err, "%s: is not a regular file, but each of the %d ranks must read it; write it to a file "
                           "first", path,
                      comm->size);
    return bt_comm_agree(comm, pipe ? BT_ERR_USAGE : BT_OK);
}

int bt_cmd_end(const bt_comm *comm, bt_status status, bt_errors *err)
{
    const bool lost = fflush(stdout) != 0 || ferror(stdout);
    if (lost)
        bt_errors_add(err,
                      "standard output: cannot be written; free some disk space, do not close the pipe early, or read "
                      "the result files instead");
    if (lost && status == BT_OK) status = BT_ERR_IO;
    status = bt_comm_agree(comm, status);
    bt_comm_errors(comm, err);
    bt_errors_print(err);
    bt_errors_free(err);
    return status;
}
