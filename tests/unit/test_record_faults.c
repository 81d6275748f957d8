// SPDX-License-Identifier: MIT
// The recorder when things go wrong: killed, without permission, without space.
//
//     test_record_faults                the tests
//     test_record_faults length FILE    print the lengths of two series and of the frames (a reader in another process)
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>

#include "made_up_run.h"

static const char *self = "test_record_faults";

TEST(a_failed_run_leaves_no_old_summary)
{
    bt_errors err = {0};
    const bt_case c = made_up_case();
    assert_int_equal(write_run(in_folder("again"), &c, 10, 0, &err), BT_OK);
    assert_int_equal(access(in_folder("again/summary.json"), F_OK), 0);
    const bt_record_bodies b = bodies();
    bt_record *r;
    assert_int_equal(bt_record_open(&r, &bt_comm_alone, in_folder("again"), &c, &b, NULL, NULL, true, &err), BT_OK);
    assert_int_not_equal(access(in_folder("again/summary.json"), F_OK), 0);
    const bt_sample s = sample(0);
    bt_record_sample(r, &s, &err);
    assert_int_equal(bt_record_close(r, NULL, NULL, false, &err), BT_OK);
    assert_int_not_equal(access(in_folder("again/summary.json"), F_OK), 0);
    const hid_t f = H5Fopen(in_folder("again/result.h5"), H5F_ACC_RDONLY, H5P_DEFAULT);
    assert_int_equal(int_attribute(f, "/", "complete"), 0);
    H5Fclose(f);
}

/// Lengths of two series and of the frames as another process reads them now.
static void lengths_seen_by_others(const char *path, int seen[3])
{
    char command[1000];
    const char *emulator = getenv("EMULATOR"); // where this program is of another machine: tests/machines.sh
    snprintf(command, sizeof command, "%s %s length %s", emulator ? emulator : "", self, path);
    FILE *p = popen(command, "r");
    assert_int_equal(fscanf(p, "%d %d %d", &seen[0], &seen[1], &seen[2]), 3);
    assert_int_equal(pclose(p), 0);
}

/// Two whole buffers of the series; with frames all of it, and no less than all but the last 15 of 33 frames.
static void check_killed(bool frames)
{
    int ready[2], seen[3];
    assert_int_equal(pipe(ready), 0);
    const pid_t child = fork();
    if (child == 0) {
        bt_errors err = {0};
        const bt_case c = made_up_case();
        const bt_record_bodies b = bodies();
        bt_record *r;
        if (bt_record_open(&r, &bt_comm_alone, in_folder("killed"), &c, &b, NULL, NULL, true, &err) != BT_OK) _exit(1);
        for (int i = 0; i < 700; i++) {
            const bt_sample s = sample(i);
            bt_record_sample(r, &s, &err);
            if (i == 400) record_frame(r, 0, &err);
        }
        for (int i = 1; i <= 32 * frames; i++) record_frame(r, i, &err);
        if (write(ready[1], "x", 1) != 1) _exit(1);
        pause();
    }
    char go;
    close(ready[1]); // so that a child that fails ends the wait
    assert_int_equal(read(ready[0], &go, 1), 1);
    for (int again = 0; again < 2; again++) { // first the writer lives and has the file open
        lengths_seen_by_others(in_folder("killed/result.part.h5"), seen);
        assert_int_equal(seen[0], seen[1]);
        assert_in_range(seen[0], frames ? 700 : 512, 700);
        assert_in_range(seen[2], frames ? 18 : 1, frames ? 33 : 1);
        kill(child, SIGKILL);
        waitpid(child, NULL, 0);
    }
}

TEST(a_running_and_a_killed_run_can_be_read)
{
    check_killed(false);
    check_killed(true);
}

static void check_refused(const char *dir, const char *reason)
{
    bt_errors err = {0};
    const bt_case c = made_up_case();
    assert_int_equal(write_run(dir, &c, 10, 1, &err), BT_ERR_IO);
    assert_int_equal(err.n, 1);
    if (!strstr(err.text[0], dir) || !strstr(err.text[0], reason)) fail_msg("%s", err.text[0]);
    assert_non_null(strchr(err.text[0], ';')); // the remedy
    bt_errors_free(&err);
}

TEST(folders_that_cannot_be_written_are_named)
{
    check_refused("/proc/bergtow/out", "No such file");
    check_refused("/dev/null/out", "Not a directory");
    check_refused(in_folder("again/result.h5"), "Not a directory");
    assert_int_equal(mkdir(in_folder("blocked"), 0755), 0);
    assert_int_equal(mkdir(in_folder("blocked/result.h5"), 0755), 0);
    check_refused(in_folder("blocked"), "Is a directory"); // out of HDF5's error stack
    assert_int_equal(mkdir(in_folder("text"), 0755), 0);
    assert_int_equal(mkdir(in_folder("text/case.resolved.yml"), 0755), 0);
    check_refused(in_folder("text"), "Is a directory");
    assert_int_not_equal(access(in_folder("text/case.resolved.yml.tmp"), F_OK), 0); // nothing half-written is left
    if (geteuid() != 0) {
        assert_int_equal(mkdir(in_folder("closed"), 0555), 0);
        check_refused(in_folder("closed"), "Permission denied");
    }
}

/// In a process of its own whose files cannot grow beyond `limit` bytes: exit code 0 when the recorder ended in order
/// with BT_ERR_IO, one message, and no summary.
static int run_without_space(rlim_t limit)
{
    const pid_t child = fork();
    if (child == 0) {
        signal(SIGXFSZ, SIG_IGN);
        const struct rlimit l = {limit, limit};
        setrlimit(RLIMIT_FSIZE, &l);
        bt_errors err = {0};
        const bt_case c = made_up_case();
        const bt_status status = write_run(in_folder("full"), &c, 20000, 100, &err);
        int code = 0;
        if (status != BT_ERR_IO) code = 10;
        else if (err.n != 1) code = 11;
        else if (!strstr(err.text[0], "result.part.h5") && !strstr(err.text[0], "case.resolved.yml")) code = 12;
        else if (!strstr(err.text[0], "File too large")) code = 13;
        else if (access(in_folder("full/summary.json"), F_OK) == 0) code = 14;
        else if (limit > 300000) { // what was flushed before is still there, in series of one length
            int seen[3];
            lengths_seen_by_others(in_folder("full/result.part.h5"), seen);
            if (seen[0] != seen[1]) code = 15;
        }
        if (code && err.n) fprintf(stderr, "%s\n", err.text[0]);
        exit(code); // with HDF5's own exit handler
    }
    int status;
    waitpid(child, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 1000 + WTERMSIG(status);
}

TEST(a_full_disk_is_an_error_and_no_crash)
{
    for (rlim_t limit = 0; limit < 3000000; limit = limit ? limit * 3 : 20) {
        const int code = run_without_space(limit);
        if (code) fail_msg("limit %lu bytes: code %d", (unsigned long)limit, code);
    }
}

static int print_lengths(const char *path)
{
    const hid_t f = H5Fopen(path, H5F_ACC_RDONLY, H5P_DEFAULT);
    static const char *const sets[] = {"/series/time", "/series/moving", "/frames/time"};
    for (int k = 0; k < 3; k++) {
        const hid_t d = H5Dopen2(f, sets[k], H5P_DEFAULT);
        hsize_t n = 0;
        static double x[100000];
        if (d < 0 || H5Sget_simple_extent_dims(H5Dget_space(d), &n, NULL) != 1 || n > 100000 ||
            H5Dread(d, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, x) < 0)
            return 1;
        for (hsize_t i = 0; k == 0 && i < n; i++)
            if (x[i] != sample((int)i).time) return 2;
        printf("%d ", (int)n);
    }
    return 0;
}

int main(int argc, char **argv)
{
    self = argv[0];
    if (argc == 3 && strcmp(argv[1], "length") == 0) return print_lengths(argv[2]);
    return run_in_folder();
}
