// SPDX-License-Identifier: MIT
// The launcher of this process, its memory, and the cores that it may use.
#include "base/process.h"

#include <omp.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#include "base/largest.h"

// --- the launcher ----------------------------------------------------------------------------------------------------

// MPI itself gives no answer before MPI_Init, and MPI_Init without a launcher wastes half a second at each call of the
// program (Open MPI 4.1). The process management interface of a launcher fixes the variables that it sets: PMI 1 and 2
// (Hydra of MPICH and Intel MPI, srun --mpi=pmi2, Cray), PMIx (PRRTE, srun --mpi=pmix), or its own names.
// BERGTOW_MPI=yes helps where none of them is set.

// In this order, since a launcher may itself have been started by another: mpirun within a job starts its servers with
// srun, whose variables then describe the servers.
static const struct {
    const char *rank, *size; ///< size: NULL if the launcher does not give it
} kinds[] = {
    {"OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"}, // Open MPI
    {"PMI_RANK", "PMI_SIZE"},                         // MPICH, Intel MPI, srun --mpi=pmi2
    {"PMI_ID", NULL},                                 // PMI by port: rank and size come later
    {"MV2_COMM_WORLD_RANK", "MV2_COMM_WORLD_SIZE"},   // MVAPICH2
    {"JSM_NAMESPACE_RANK", "JSM_NAMESPACE_SIZE"},     // IBM jsrun
    {"FLUX_TASK_RANK", "FLUX_JOB_SIZE"},              // Flux
    {"PALS_RANKID", NULL},                            // HPE Cray PALS
    {"ALPS_APP_PE", NULL},                            // Cray aprun
    {"PMIX_RANK", NULL},                              // PMIx: the size is known to its server
    {"SLURM_PROCID", "SLURM_STEP_NUM_TASKS"},         // srun
};
enum { N_KINDS = sizeof kinds / sizeof *kinds };

/// The value of a variable as a whole number; −1 if it has none.
static int number(const char *name)
{
    const char *text = name ? getenv(name) : NULL;
    char *end = NULL;
    const long n = text ? strtol(text, &end, 10) : -1;
    return text && *text && !*end && n >= 0 && n <= INT32_MAX ? (int)n : -1;
}

bt_launcher bt_launcher_find(void)
{
    bt_launcher by = {0};
    for (int i = 0; i < N_KINDS; i++) {
        const int rank = number(kinds[i].rank), size = number(kinds[i].size);
        if (rank < 0) continue;
        if (i == N_KINDS - 1 && size < 2) continue; // a job script, or a step of one task
        if (!by.found) by.first = rank == 0;
        by.found = true;
        if (size > 0) {
            by.size = size;
            break;
        }
    }
    return by;
}

void bt_launcher_forget(void)
{
    for (int i = 0; i < N_KINDS; i++) {
        unsetenv(kinds[i].rank);
        if (kinds[i].size) unsetenv(kinds[i].size);
    }
}

double bt_launcher_began(void)
{
    enum { BEFORE = 19 }; // fields of proc_pid_stat(5) between the name and starttime
    char text[1024] = "";
    FILE *f = fopen("/proc/self/stat", "r");
    if (f && !fgets(text, sizeof text, f)) *text = '\0';
    if (f) fclose(f);
    const char *p = strrchr(text, ')'); // a name may contain anything
    for (int k = 0; p && k <= BEFORE; k++) p = strchr(p + 1, ' ');
    const double now = bt_clock(), ticks = p ? strtod(p, NULL) : 0;
    struct timespec since_boot;
    if (!(ticks > 0) || clock_gettime(CLOCK_BOOTTIME, &since_boot) != 0) return now;
    const double age = (double)since_boot.tv_sec + 1e-9 * (double)since_boot.tv_nsec -
                       ticks / (double)sysconf(_SC_CLK_TCK);
    return now - bt_max(0, age);
}

// --- its memory ------------------------------------------------------------------------------------------------------

// getrusage keeps the peak of the process that forked this one, before it became this program: of a run that Python
// starts, that of Python. The system's own count of this image, VmHWM of proc(5), does not, and can begin anew.

void bt_memory_forget_peak(void)
{
    FILE *f = fopen("/proc/self/clear_refs", "w");
    if (!f) return;
    fputs("5", f);
    fclose(f);
}

double bt_memory_peak(void)
{
    double kilobytes = 0;
    char text[256];
    FILE *f = fopen("/proc/self/status", "r");
    while (f && kilobytes == 0 && fgets(text, sizeof text, f))
        if (!strncmp(text, "VmHWM:", 6)) kilobytes = strtod(text + 6, NULL);
    if (f) fclose(f);
    struct rusage use;
    if (kilobytes == 0 && getrusage(RUSAGE_SELF, &use) == 0) kilobytes = (double)use.ru_maxrss;
    return 1024 * kilobytes;
}

// --- the cores -------------------------------------------------------------------------------------------------------

// A launcher binds each rank to its own cores (mpirun --map-by slot:PE=4, srun -c 4 with task affinity), or gives all
// ranks of a node the same cores (mpirun --bind-to none, a container, a job's cgroup). The number of cores of the
// machine tells neither: a job may have only a few of them.

bool bt_cores_given(cpu_set_t *cores)
{
    // With OMP_PROC_BIND the runtime has already bound this thread to one of the places. Without it libgomp has no
    // places, while clang's libomp has one: the cores that it was given at its start.
    const int n_places = omp_get_proc_bind() == omp_proc_bind_false ? 0 : omp_get_num_places();
    if (n_places == 0) return sched_getaffinity(0, sizeof *cores, cores) == 0;
    CPU_ZERO(cores);
    for (int p = 0; p < n_places; p++) {
        int ids[CPU_SETSIZE];
        const int n = omp_get_place_num_procs(p);
        if (n > CPU_SETSIZE) continue;
        omp_get_place_proc_ids(p, ids);
        for (int k = 0; k < n; k++) CPU_SET(ids[k], cores);
    }
    return CPU_COUNT(cores) > 0;
}

/// Cores for the rank of sets[mine], of the n sets of a node's ranks: a core given to k ranks counts as 1/k for each.
static double share_of(const cpu_set_t *sets, int n, int mine)
{
    double share = 0;
    for (int core = 0; core < CPU_SETSIZE; core++) {
        if (!CPU_ISSET(core, &sets[mine])) continue;
        int users = 0;
        for (int k = 0; k < n; k++) users += CPU_ISSET(core, &sets[k]) != 0;
        share += 1.0 / users;
    }
    return share;
}

/// Limit n to the cores that Slurm has promised a task, at least 1: without affinity or cgroups nothing else does.
static int within_task(int n)
{
    const char *text = getenv("SLURM_CPUS_PER_TASK");
    const int most = text ? atoi(text) : 0;
    return most > 0 && n > most ? most : n > 1 ? n : 1;
}

int bt_cores_share(const bt_comm *comm)
{
    cpu_set_t given;
    if (!bt_cores_given(&given)) { // more cores than a cpu_set_t holds
        CPU_ZERO(&given);
        for (int k = 0; k < omp_get_num_procs() && k < CPU_SETSIZE; k++) CPU_SET(k, &given);
    }
    if (comm->size == 1) return within_task(CPU_COUNT(&given));
    MPI_Comm node;
    int rank, n;
    MPI_Comm_split_type(comm->mpi, MPI_COMM_TYPE_SHARED, comm->rank, MPI_INFO_NULL, &node);
    MPI_Comm_rank(node, &rank);
    MPI_Comm_size(node, &n);
    cpu_set_t *sets = bt_alloc((size_t)n, sizeof *sets);
    MPI_Allgather(&given, sizeof given, MPI_BYTE, sets, sizeof given, MPI_BYTE, node);
    MPI_Comm_free(&node);
    const double share = share_of(sets, n, rank);
    free(sets);
    return within_task((int)(share + 1e-9));
}

void bt_limit_threads(void)
{
    const int n = omp_get_max_threads(); // negative if OMP_NUM_THREADS is more than an int holds
    if (n < 1 || n > BT_MAX_THREADS) omp_set_num_threads(BT_MAX_THREADS);
}
