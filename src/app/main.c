// SPDX-License-Identifier: MIT
// The program bergtow: options that need no command, and the dispatch to the commands.
#include "bergtow/comm.h"
#include "app/cmd.h"
#include "revision.h"
#include "base/process.h"
#include "base/name.h"
#include "case/case_base.h"
#include "output/summary_keys.h"

#include <omp.h>
#include <sched.h>
#include <signal.h>
#include <string.h>
#include <sys/prctl.h>
#include <unistd.h>

#define PYTHON(name_, summary_) {name_, summary_, bt_cmd_python, false, false}
static const struct {
    const char *name, *summary;
    int (*run)(int argc, char **argv);
    bool parallel; ///< all ranks take part; otherwise rank 0 alone
    bool steps;    ///< it makes time steps, so that start_with_settings() applies
} commands[] = {
    {"run", "tow the body through the ice and write a result folder", bt_cmd_run, true, true},
    {"check", "validate a case or a study and print the numbers that follow from it", bt_cmd_check, false, false},
    {"field", "make the ice field of a case only", bt_cmd_field, false, true},
    {"ensemble",
        "run the members of a study, many fields and conditions; repeat the command to resume", bt_cmd_ensemble,
     true, true},
    PYTHON("converge",
           "find out how a result depends on numerical settings: domain width and length, time step, tolerance, "
           "start-up"),
    PYTHON("budget",
           "find out how much of the scatter comes from the fields, each assumed value, and numerical error"),
    PYTHON("capability", "find out how fast a vessel can tow in given ice, and what ice stops it"),
    PYTHON("design", "write the report of the design tow force of a case or a study, as a page and as PDF"),
    PYTHON("route", "plan the path and the speed of a tow through known ice, and verify them by simulated tows"),
    PYTHON("outlines", "convert a map of the ice (outlines or an image of labels) into floes for ice.outlines"),
    {"resume", "continue a run from its last checkpoint", bt_cmd_resume, true, true},
    {"diff", "name the first difference between two checkpoints, or print one", bt_cmd_diff, false, false},
    {"estimate", "print published estimates of the resistance for a case", bt_cmd_estimate, false, false},
    PYTHON("report", "write the report of a run, with a replay, or of an ensemble, as a page or as PDF"),
    PYTHON("statistics", "statistics of an ensemble: design force, loads, intervals, in tables and files"),
    PYTHON("export",
           "export floes, tracks and loads of a run to GIS formats: GeoPackage, GeoJSON, shapefile, trajectories"),
    PYTHON("contents", "list the contents of the folder of a run"),
    PYTHON("film", "make a film of a run"),
    PYTHON("plot-force", "draw the forces of a run against time"),
    PYTHON("plot-field", "draw the ice field before, during and after the tow"),
    PYTHON("plot-impacts", "draw the loads around the hull by panel, and the exceedance of peaks"),
    PYTHON("plot-resistance", "draw the mean ice resistance of runs against the concentration, beside the estimates"),
    PYTHON("plot-chains", "draw the force chains of one step"),
    PYTHON("plot-ensemble", "plot an ensemble: every picture for which its study has the data"),
};
enum { N_COMMANDS = sizeof commands / sizeof *commands };

/// The command of that name, −1 = none.
static int command_of(const char *word)
{
    for (int i = 0; i < N_COMMANDS; i++)
        if (!strcmp(word, commands[i].name)) return i;
    return -1;
}

static void print_version(FILE *out, struct argp_state *state)
{
    (void)state;
    char mpi[MPI_MAX_LIBRARY_VERSION_STRING];
    fprintf(out, "bergtow %s (%s, %s, %s)\n", BT_VERSION, BT_REVISION, BT_COMPILER, bt_comm_library(mpi));
}

static void print_help(FILE *out)
{
    fputs("Usage: bergtow COMMAND [OPTION...]\n"
          "Simulate a body, such as an iceberg, that is towed through broken sea ice.\n\n", out);
    for (int i = 0; i < N_COMMANDS; i++) fprintf(out, "  %-15s %s\n", commands[i].name, commands[i].summary);
    fputs("\n  --list-keys  the keys of a case file: unit, default, range, meaning; with --json for programs\n  "
          "--list-quantities  the numbers that a run writes: series, summary, estimates, with units and meaning; "
          "--json too\n  --version    version, revision, compiler and MPI\n  --help       this text; bergtow COMMAND "
          "--help, or bergtow help COMMAND, for the options of a command\n\n"
          "Exit codes: 0 done, 2 usage, 3 bad case or field file, 4 input or output failed, 5 numerical failure,\n"
          "6 stopped on a signal or a limit, with a checkpoint.\n",
          out);
}

static int refuse_word(const char *kind, const char *word, const char *const *known)
{
    const char *near = bt_suggest(word, known);
    if (near) fprintf(stderr, "bergtow: %s: unknown %s; did you mean %s?\n", word, kind, near);
    else fprintf(stderr, "bergtow: %s: unknown %s; see bergtow --help\n", word, kind);
    return BT_ERR_USAGE;
}

// With OMP_PROC_BIND libgomp has already bound this thread to one place, and a program started from here would run all
// its threads on that one core. Restore all the cores that this process was given.
static void unbind(void)
{
    cpu_set_t all;
    if (omp_get_num_places() > 0 && bt_cores_given(&all)) sched_setaffinity(0, sizeof all, &all);
}

// Disposition of SIGHUP at the start: ignored under nohup. UCX sets a handler for its debugger when it is loaded: with
// the program in Open MPI 5, in MPI_Init in Open MPI 4. A handler does not survive execv.
static struct sigaction hangup;
static bool hangup_known;

static void give_back_hangup(void)
{
    if (hangup_known) sigaction(SIGHUP, &hangup, NULL);
}

// Runs before the constructors of any library, some of which take milliseconds. Signals are ignored rather than
// handled: that survives the second start, a handler would not.
static void before_libraries(void)
{
    bt_processor_check();
    hangup_known = sigaction(SIGHUP, NULL, &hangup) == 0;
    // asks a run for a checkpoint (halt.h); there is nothing to write before its first step or in other commands
    signal(SIGUSR1, SIG_IGN);
    // a file at its size limit makes the write fail, with a message, and does not end the program
    signal(SIGXFSZ, SIG_IGN);
    // a reader of the output that ends, such as head, only loses text, and the command reports that at its end
    signal(SIGPIPE, SIG_IGN);
}
__attribute__((section(".preinit_array"), used)) static void (*const before_all)(void) = before_libraries;

// Threads that spin at a barrier, while another program has the core of the thread they wait for, made a run on two
// busy cores 20 times slower; threads that sleep at once pay a wake-up for every colour of a sweep. So spin for a few
// tenths of a millisecond, then sleep. Serial parts of a step must end within that: with a spin count of 5,000 instead
// of 20,000 two threads took 1.27 and 1.16 times as long through 80 and 90 % ice. Sweeps over memory miss the TLB with
// 4 kB pages: huge pages, if available, and the prefetching they allow saved 20 % with 300,000 floes. libgomp and the C
// library read their settings before main, hence the second start; the user's own prevail. Loading the libraries again
// takes 50 ms, which commands without time steps are spared.
static void start_with_settings(int argc, char **argv)
{
    const int command = argc > 1 ? command_of(argv[1]) : -1;
    if (command < 0 || !commands[command].steps) return;
    if (getenv("BERGTOW_STARTED")) {
        prctl(PR_SET_NAME, "bergtow"); // otherwise ps, top and killall show it as exe
        return;
    }
    bool set = setenv("BERGTOW_STARTED", "1", 1) == 0;
    if (!getenv("OMP_WAIT_POLICY")) set = setenv("GOMP_SPINCOUNT", "20000", 0) == 0 && set;
    set = setenv("GLIBC_TUNABLES", "glibc.malloc.hugetlb=1", 0) == 0 && set;
    unbind();
    if (set) execv("/proc/self/exe", argv);
}

static const struct {
    const char *option;
    void (*text)(void *), (*json)(void *);
} lists[] = {
    {"--list-keys", bt_case_list_keys, bt_case_list_keys_json},
    {"--list-quantities", bt_quantities_list, bt_quantities_list_json},
};

/// The list that an option asks for, −1 = none.
static int list_of(const char *word)
{
    for (int i = 0; i < (int)(sizeof lists / sizeof *lists); i++)
        if (!strcmp(word, lists[i].option)) return i;
    return -1;
}

// Ranks with different commands or options (mpirun's colon form) would wait for each other for ever. So compare all
// words before any is parsed. Rejected: comparing only command, folder and number of steps, after parsing: by then a
// rank with an error in its options has left, and other options end one rank, too. Threads may differ, as nodes do.
static bool same_words(int argc, char **argv)
{
    char **words = bt_alloc((size_t)argc + 1, sizeof *words);
    int n = 0;
    for (int i = 1; i < argc; i++) {
        char *word = argv[i];
        const size_t length = strcspn(word, "=");
        const bool name = length > 2 && !strncmp(word, "--threads", length); // or the first letters of it
        if (!name && strncmp(word, "-t", 2)) words[n++] = word;
        else if (!word[name ? length : 2]) i++; // their number is the next word
    }
    char *text = bt_cmd_join(n, words);
    const bool same = bt_comm_same(bt_comm_world(), "", text, NULL) == BT_OK;
    free(text);
    free(words);
    return same;
}

// Exit code of this rank.
static int bergtow(int argc, char **argv)
{
    const bool first = bt_comm_world()->rank == 0;
    bt_errors err = {0};
    if (!same_words(argc, argv))
        return bt_cmd_end(bt_comm_world(),
                          bt_fail(&err, BT_ERR_CASE,
                                  "the command line is not the same on all of the %d ranks; give each the same words, "
                                  "but for the number of --threads", bt_comm_world()->size),
                          &err);
    if (argc < 2) {
        if (first) print_help(stderr);
        return BT_ERR_USAGE;
    }
    const char *word = argv[1];
    if (!strcmp(word, "help")) {
        if (argc == 2) word = "--help";
        else if (argv[2][0] != '-') return bergtow(3, (char *[]){argv[0], argv[2], "--help", NULL});
    }
    const int command = command_of(word);
    if (command >= 0)
        return first || commands[command].parallel ? commands[command].run(argc - 1, argv + 1) : BT_OK;
    if (!first) return BT_OK; // the rest only prints

    bool help = !strcmp(word, "--help") || !strcmp(word, "-h") || !strcmp(word, "-?"),
         version = !strcmp(word, "--version") || !strcmp(word, "-V");
    if (help) print_help(stdout);
    else if (version) print_version(stdout, NULL);
    const int list = list_of(word);
    if (list >= 0) {
        const bool json = argc == 3 && !strcmp(argv[2], "--json");
        if (argc > 2 && !json) return refuse_word("option", argv[2], (const char *const[]){"--json", NULL});
        (json ? lists[list].json : lists[list].text)(stdout);
    }
    if (help || version || list >= 0) return bt_cmd_end(&bt_comm_alone, BT_OK, &(bt_errors){0});

    if (word[0] == '-')
        return refuse_word("option", word,
                           (const char *const[]){"--help", "--version", "--list-keys", "--list-quantities", NULL});
    const bt_file_kind kind = bt_case_kind_of(word);
    if (kind != BT_FILE_OTHER) {
        const bool study = kind == BT_FILE_STUDY;
        fprintf(stderr, "bergtow: %s: this is a %s: bergtow %s %s\n", word, study ? "study" : "case",
                study ? "ensemble" : "run", word);
        return BT_ERR_USAGE;
    }
    const char *names[N_COMMANDS + 1] = {NULL};
    for (int i = 0; i < N_COMMANDS; i++) names[i] = commands[i].name;
    return refuse_word("command", word, names);
}

int main(int argc, char **argv)
{
    give_back_hangup();
    start_with_settings(argc, argv);
    bt_limit_threads();
    if (bt_comm_start(&argc, &argv) != BT_OK) return BT_ERR_USAGE;
    give_back_hangup();
    argp_err_exit_status = BT_ERR_USAGE;
    argp_program_version_hook = print_version;
    return bt_comm_end(bergtow(argc, argv));
}
