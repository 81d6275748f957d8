// SPDX-License-Identifier: MIT
// The ranks of the program: everything collective that is not part of the time step goes through here.
//
// Without MPI (a plain start, a unit test) there is one rank, and every call is a copy or nothing. "Collective" as the
// first word of a comment: all ranks make the call, in the same order.
#ifndef BERGTOW_COMM_H
#define BERGTOW_COMM_H

// of a C++ program: without the old C++ bindings of MPI, which drop warnings and need a library of their own
#ifdef __cplusplus
#define OMPI_SKIP_MPICXX 1
#define MPICH_SKIP_MPICXX 1
#endif
#include <mpi.h>

#include "bergtow/base.h"
#include "bergtow/sum.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct bt_comm {
    MPI_Comm mpi;    ///< MPI_COMM_NULL without MPI; never used when size is 1
    int rank, size;
    int ranks_here;  ///< ranks on this node
    bool divides;    ///< a field is divided among all ranks even where one of them alone would be faster
} bt_comm;

/// All ranks of the program. Before bt_comm_start, and after bt_comm_end: rank 0 of 1.
const bt_comm *bt_comm_world(void);

/// The MPI library in use and its version, as in "Open MPI v4.1.4"; written into text, which is returned.
const char *bt_comm_library(char text[MPI_MAX_LIBRARY_VERSION_STRING]);

/// One rank, whatever else runs: for work of a rank by itself.
extern const bt_comm bt_comm_alone;

/// Collective. Use MPI as the program has started it, which ends it, too; otherwise start it if a launcher (mpirun of
/// any MPI, srun) started this process: a plain start must neither pay for MPI_Init nor need a network. BERGTOW_MPI=yes
/// or no in the environment decides instead. From here on an error of MPI ends all ranks, and so does an exit() of one
/// rank alone where MPI was started here; an exit(0) or exit(BT_ERR_USAGE) is taken for one of all ranks, since they
/// have the same command line (with glibc; other C libraries do not tell the code, and there any exit ends all ranks).
/// argc, argv may be NULL. Errors: BT_ERR_USAGE, with a message on stderr; also where the launcher has started several
/// processes and MPI knows of one.
bt_status bt_comm_start(int *argc, char ***argv);

/// Collective. The end of the program: waits for all ranks without using their cores, stops MPI, and returns the worst
/// code.
int bt_comm_end(int code);

/// Ends all ranks now, from any one, without waiting for the others. Flushes stdout and stderr first.
void bt_comm_abort(int code) __attribute__((noreturn));

/// Collective. The ranks of `comm` that name the same group, as ranks of their own. Release with
/// bt_comm_split_end.
void bt_comm_split(const bt_comm *comm, int group, bt_comm *part);
/// Collective over the group. The end of what bt_comm_split has made.
void bt_comm_split_end(bt_comm *part);

/// Collective. Returns the worst status of all ranks, BT_OK where all are done. From bad to worse: done, signal, usage,
/// case, numeric, input/output: a file that cannot be written decides how the run may end, and what the user has to do
/// first.
bt_status bt_comm_agree(const bt_comm *comm, bt_status status);

/// Collective. All ranks' messages to rank 0 with their codes, each text once, in the order of the ranks; the others'
/// lists become empty.
void bt_comm_errors(const bt_comm *comm, bt_errors *err);

/// Collective. Copy bytes from rank 0 to all; any size.
void bt_comm_bcast(const bt_comm *comm, void *data, size_t bytes);

/// Collective. True if it is on any rank.
bool bt_comm_any(const bt_comm *comm, bool value);

/// Collective. Returns when all ranks have called it; meanwhile the cores are free for the ranks that still work.
void bt_comm_rest(const bt_comm *comm);

/// Until n requests are done. One after the other: gcc takes MPI_STATUSES_IGNORE, the address 1 in MPICH, for an array
/// of no bytes that MPI_Waitall writes to.
static inline void bt_comm_wait(int n, MPI_Request *request)
{
    for (int i = 0; i < n; i++) MPI_Wait(&request[i], MPI_STATUS_IGNORE);
}

/// Collective. Sums, largest values and bitwise ors of all ranks in one message. Sums are exact and `bad` is handed on;
/// a NaN is the largest value. The result is the same on all ranks, in any distribution of the terms. NULL where n is
/// 0.
void bt_comm_reduce(const bt_comm *comm, bt_sum *sums, int n_sums, double *maxima, int n_max, uint64_t *ors, int n_ors);

/// Collective. Sum over the ranks before this one; *total (may be NULL): over all.
int64_t bt_comm_before(const bt_comm *comm, int64_t value, int64_t *total);

/// First of the n things that stand in the block of a rank when they are distributed in equal blocks;
/// bt_comm_first(comm, comm->size, n) = n.
static inline int64_t bt_comm_first(const bt_comm *comm, int rank, int64_t n)
{
    return (int64_t)((__extension__(__int128) n) * rank / comm->size);
}

/// Collective. Rows of bodies from wherever they are to the order of their ids. This rank has n rows: gid [n] and
/// rows [n][width]; rank k receives those of the ids first[k] up to first[k + 1] in block [first[k+1] −
/// first[k]][width].
/// first: [size + 1], ascending, the same on all ranks; first[0] = 0. Every id below first[size] must come exactly
/// once. Errors (the same status on all ranks): BT_ERR_NUMERIC, naming ids that are missing, doubled, or outside.
bt_status bt_comm_rows_by_gid(const bt_comm *comm, const int64_t *first, bt_idx n, const bt_gid *gid, int width,
                              const double *rows, double *block, bt_errors *err);

/// Collective. Rows of doubles [n][width] from all ranks to rank 0, in the order of the ranks: [*total][width] there,
/// to be freed; NULL and *total = 0 elsewhere.
double *bt_comm_gather(const bt_comm *comm, int64_t n, int width, const double *rows, int64_t *total);

#ifdef __cplusplus
}
#endif

#endif
