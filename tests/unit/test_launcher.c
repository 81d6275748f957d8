// SPDX-License-Identifier: MIT
// Launchers as the environment tells of them, and the cores of a process.
#include "test.h"

#include <omp.h>

#include "base/largest.h"
#include "base/process.h"
#include "bergtow/run.h"

extern char **environ;

/// The launcher in an environment of these variables alone: "NAME=VALUE", up to NULL.
static bt_launcher in(char *variables[])
{
    char **kept = environ;
    environ = variables;
    const bt_launcher by = bt_launcher_find();
    environ = kept;
    return by;
}
#define IN(...) in((char *[]){__VA_ARGS__, NULL})

static void expect(bt_launcher by, bool found, bool first, int size)
{
    assert_int_equal(by.found, found);
    assert_int_equal(by.first, first);
    assert_int_equal(by.size, size);
}

TEST(every_launcher_is_known)
{
    expect(IN("OMPI_COMM_WORLD_RANK=1", "OMPI_COMM_WORLD_SIZE=4", "PMIX_RANK=1"), true, false, 4);
    expect(IN("PMI_RANK=0", "PMI_SIZE=3", "PMI_FD=5"), true, true, 3);
    expect(IN("PMI_ID=0", "PMI_PORT=host:1"), true, true, 0);
    expect(IN("MV2_COMM_WORLD_RANK=0", "MV2_COMM_WORLD_SIZE=2"), true, true, 2);
    expect(IN("JSM_NAMESPACE_RANK=0", "JSM_NAMESPACE_SIZE=2"), true, true, 2);
    expect(IN("FLUX_TASK_RANK=0", "FLUX_JOB_SIZE=2"), true, true, 2);
    expect(IN("PALS_RANKID=3"), true, false, 0);
    expect(IN("ALPS_APP_PE=3"), true, false, 0);
    expect(IN("PMIX_RANK=1", "SLURM_PROCID=1", "SLURM_STEP_NUM_TASKS=2"), true, false, 2);
    expect(IN("SLURM_PROCID=0", "SLURM_STEP_NUM_TASKS=2"), true, true, 2);
}

TEST(nobody_has_launched_it)
{
    expect(IN("HOME=/root"), false, false, 0);
    expect(IN("SLURM_PROCID=0", "SLURM_NTASKS=8"), false, false, 0); // a job script
    expect(IN("SLURM_PROCID=0", "SLURM_STEP_NUM_TASKS=1"), false, false, 0);
    expect(IN("PMI_RANK=", "PMI_SIZE=2"), false, false, 0);
    expect(IN("PMI_RANK=x"), false, false, 0);
}

/// What a rank starts is told of no launcher, and of all else.
TEST(none_is_known_once_it_is_forgotten)
{
    char *variables[] = {"OMPI_COMM_WORLD_RANK=0", "OMPI_COMM_WORLD_SIZE=1", "PMI_RANK=0", "PMI_SIZE=1", "PMI_ID=0",
                         "MV2_COMM_WORLD_RANK=0", "MV2_COMM_WORLD_SIZE=1", "JSM_NAMESPACE_RANK=0",
                         "JSM_NAMESPACE_SIZE=1", "HOME=/root", "FLUX_TASK_RANK=0", "FLUX_JOB_SIZE=1", "PALS_RANKID=0",
                         "ALPS_APP_PE=0", "PMIX_RANK=0", "SLURM_PROCID=0", "SLURM_STEP_NUM_TASKS=2", NULL};
    char **kept = environ;
    environ = variables;
    bt_launcher_forget();
    const bt_launcher by = bt_launcher_find();
    environ = kept;
    assert_false(by.found);
    assert_string_equal(variables[0], "HOME=/root");
    assert_null(variables[1]);
}

// mpirun of a job has started its servers, one a node, with srun.
TEST(the_innermost_launcher_counts)
{
    expect(IN("SLURM_PROCID=0", "SLURM_STEP_NUM_TASKS=2", "PMI_RANK=5", "PMI_SIZE=8"), true, false, 8);
    expect(IN("SLURM_PROCID=0", "SLURM_STEP_NUM_TASKS=2", "OMPI_COMM_WORLD_RANK=1", "OMPI_COMM_WORLD_SIZE=1"), true,
           false, 1);
}

TEST(cores_are_those_that_were_given)
{
    unsetenv("SLURM_CPUS_PER_TASK");
    cpu_set_t before, one, seen;
    assert_int_equal(sched_getaffinity(0, sizeof before, &before), 0);
    assert_int_equal(bt_cores_share(&bt_comm_alone), CPU_COUNT(&before));
    CPU_ZERO(&one);
    for (int k = 0; CPU_COUNT(&one) == 0; k++)
        if (CPU_ISSET(k, &before)) CPU_SET(k, &one);
    assert_int_equal(sched_setaffinity(0, sizeof one, &one), 0);
    assert_true(bt_cores_given(&seen) && CPU_EQUAL(&seen, &one));
    assert_int_equal(bt_cores_share(&bt_comm_alone), 1);
    assert_int_equal(sched_setaffinity(0, sizeof before, &before), 0);
    setenv("SLURM_CPUS_PER_TASK", "1", 1);
    assert_int_equal(bt_cores_share(&bt_comm_alone), 1);
    unsetenv("SLURM_CPUS_PER_TASK");
}

TEST(threads_of_the_environment_are_limited)
{
    static const bt_case input;
    const int before = omp_get_max_threads();
    setenv("OMP_NUM_THREADS", "given", 1); // libgomp has read it already
    omp_set_num_threads(5000000);
    assert_int_equal(bt_run_threads(&bt_comm_alone, &input, 0), BT_MAX_THREADS);
    omp_set_num_threads(3);
    assert_int_equal(bt_run_threads(&bt_comm_alone, &input, 0), 3);
    unsetenv("OMP_NUM_THREADS");
    omp_set_num_threads(before);
}

TEST_MAIN(NULL, NULL)
