// SPDX-License-Identifier: MIT
// The cores that this process may use, and its part of those that several ranks share.
//
// A launcher binds each rank to cores of its own (mpirun --map-by slot:PE=4, srun -c 4 with task affinity), or gives
// all ranks of a node the same ones (mpirun --bind-to none, a container, a job's cgroup). The number of cores of the
// machine says nothing of either: a job may have a few of them.
#include "base/cores.h"

#include <omp.h>
#include <stdlib.h>
#include <string.h>

bool bt_cores_given(cpu_set_t *cores)
{
    // With OMP_PROC_BIND the runtime has bound this thread to one of the places by now. Without it libgomp knows no
    // places, while clang's libomp has one: the cores as they were when it started.
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

/// Of n sets, those of the ranks of a node: how much of the cores of set `mine` is for its rank.
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

/// No more than Slurm has promised a task; without affinity or cgroups nothing else keeps to it.
static int within_task(int n)
{
    const char *text = getenv("SLURM_CPUS_PER_TASK");
    const int most = text ? atoi(text) : 0;
    return most > 0 && n > most ? most : n > 1 ? n : 1;
}

int bt_cores_share(const bt_comm *c)
{
    cpu_set_t given;
    if (!bt_cores_given(&given)) { // more cores than a set holds
        CPU_ZERO(&given);
        for (int k = 0; k < omp_get_num_procs() && k < CPU_SETSIZE; k++) CPU_SET(k, &given);
    }
    if (c->size == 1) return within_task(CPU_COUNT(&given));
    MPI_Comm node;
    int rank, n;
    MPI_Comm_split_type(c->mpi, MPI_COMM_TYPE_SHARED, c->rank, MPI_INFO_NULL, &node);
    MPI_Comm_rank(node, &rank);
    MPI_Comm_size(node, &n);
    cpu_set_t *sets = bt_alloc((size_t)n, sizeof *sets);
    MPI_Allgather(&given, sizeof given, MPI_BYTE, sets, sizeof given, MPI_BYTE, node);
    MPI_Comm_free(&node);
    const double share = share_of(sets, n, rank);
    free(sets);
    return within_task((int)(share + 1e-9));
}
