// SPDX-License-Identifier: MIT
// On a processor without what the program was built for, it ends with a message and code 2; on any other it goes on.
//
// The check is compiled here as for SSE4.2 and BMI2, and asks a processor that lacks what `lacking` names.
#include <stdbool.h>
#include <sys/wait.h>
#include <unistd.h>
#include "test.h"

static const char *lacking = "nothing";

#ifdef __x86_64__
#undef __SSE4_2__
#undef __BMI2__
#define __SSE4_2__ 1
#define __BMI2__ 1
#define __builtin_cpu_supports(feature) (strcmp(feature, lacking) != 0)
#endif
#include "app/processor.c"

/// The exit code of a process that checks and goes on with code 7, and what it has written to stderr.
static int check_on(const char *processor_lacks, char *said, size_t size)
{
    int ends[2], status;
    lacking = processor_lacks;
    assert_int_equal(pipe(ends), 0);
    const pid_t child = fork();
    if (child == 0) {
        dup2(ends[1], STDERR_FILENO);
        bt_processor_check();
        _exit(7);
    }
    close(ends[1]);
    size_t n = 0;
    for (ssize_t got; (got = read(ends[0], said + n, size - 1 - n)) > 0;) n += (size_t)got;
    said[n] = 0;
    close(ends[0]);
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status));
    return WEXITSTATUS(status);
}

TEST(goes_on_where_nothing_is_missing)
{
    char said[400];
    assert_int_equal(check_on("nothing", said, sizeof said), 7);
    assert_string_equal(said, "");
    assert_int_equal(check_on("avx512bf16", said, sizeof said), 7); // which it was not built for
    assert_string_equal(said, "");
}

#ifdef __x86_64__
TEST(names_what_is_missing)
{
    char said[400];
    assert_int_equal(check_on("bmi2", said, sizeof said), BT_ERR_USAGE);
    assert_string_equal(said, "bergtow: built for processors with bmi2, which this one lacks; build it on this "
                              "machine, or without -march (make clean all)\n");
    assert_int_equal(check_on("sse4.2", said, sizeof said), BT_ERR_USAGE);
    assert_non_null(strstr(said, "with sse4.2, which"));
}
#endif

TEST_MAIN(NULL, NULL)
