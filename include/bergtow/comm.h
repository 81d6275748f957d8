// SPDX-License-Identifier: MIT
// The ranks of the program: all collective operations that are not part of the time step.
//
// Without MPI (a plain start, a unit test) there is one rank, and every call copies or does nothing. "Collective" as
// the first word of a comment: all ranks make the call, in the same order.
#ifndef BERGTOW_COMM_H
#define BERGTOW_COMM_H

// in C++: without the old C++ bindings of MPI, which cause warnings and need a separate library
#ifdef __cplusplus
#define OMPI_SKIP_MPICXX 1
#define MPICH_SKIP_MPICXX 1
#endif
#include <mpi.h>

#include "bergtow/base.h"
#include "bergtow/sum.h"

BT_BEGIN_C

typedef struct bt_comm {
    MPI_Comm mpi;    ///< MPI_COMM_NULL without MPI; never used when size is 1
    int rank, size;
    int ranks_here;  ///< ranks on this node
    bool divides;    ///< divide a field among all ranks even if one alone would be faster
} bt_comm;

/// All ranks of the program. Rank 0 of 1 before bt_comm_start and after bt_comm_end.
const bt_comm *bt_comm_world(void);

/// The MPI library in use and its version, as in "Open MPI v4.1.4"; written to text, which is returned.
const char *bt_comm_library(char text[MPI_MAX_LIBRARY_VERSION_STRING]);

/// A single rank, for work that a rank does by itself.
extern const bt_comm bt_comm_alone;

/// Collective. Use MPI if the program has started it, and then must also end it; otherwise start MPI if a launcher
/// (mpirun of any MPI, srun) started this process: a plain start must neither pay for MPI_Init nor need a network.
/// BERGTOW_MPI=yes or no in the environment decides instead. From here on an MPI error ends all ranks, and so does an
/// exit() of a single rank if MPI was started here; exit(0) and exit(BT_ERR_USAGE) are taken for exits of all ranks,
/// which have the same command line (with glibc; other C libraries do not give the code, and any exit ends all ranks).
/// argc, argv may be NULL. Errors: BT_ERR_USAGE, with a message on stderr; also if the launcher has started several
/// processes but MPI sees only one.
bt_status bt_comm_start(int *argc, char ***argv);

/// Collective. End the program: wait for all ranks without using their cores, stop MPI, and return the worst code: that
/// of bt_comm_agree, or the largest of those that are no bt_status, such as EXIT_FAILURE.
int bt_comm_end(int code);

/// End all ranks now, from any rank, without waiting for the others. Flushes stdout and stderr first.
void bt_comm_abort(int code) __attribute__((noreturn));

/// Collective. Make a separate communicator of the ranks of `comm` that name the same group. Release with
/// bt_comm_split_end.
void bt_comm_split(const bt_comm *comm, int group, bt_comm *part);
/// Collective over the group. Release a communicator made by bt_comm_split.
void bt_comm_split_end(bt_comm *part);

/// Collective. Return the worst status of all ranks, BT_OK if all succeeded. From bad to worse: signal, usage, case,
/// numeric, input/output: a file that cannot be written decides how the run can end, and what the user must do first.
bt_status bt_comm_agree(const bt_comm *comm, bt_status status);

/// Collective. Move all ranks' messages with their codes to rank 0, each text once, in the order of the ranks; the
/// other lists become empty.
void bt_comm_errors(const bt_comm *comm, bt_errors *err);

/// Collective. Copy bytes from rank 0 to all; any size.
void bt_comm_bcast(const bt_comm *comm, void *data, size_t bytes);

/// Collective. Do all ranks have the same text, read from `path` and the files that it names? On a cluster each node
/// may have a copy of its own. Errors: BT_ERR_CASE.
bt_status bt_comm_same(const bt_comm *comm, const char *path, const char *text, bt_errors *err);

/// Collective. Is `value` true on any rank?
bool bt_comm_any(const bt_comm *comm, bool value);

/// Collective. Returns when all ranks have called it; meanwhile the cores are free for the ranks that still work.
void bt_comm_rest(const bt_comm *comm);

/// Wait for n requests; if it takes long, the core is free for other work meanwhile.
void bt_comm_wait(int n, MPI_Request *request);

/// Collective. Sums, largest values and bitwise ors of all ranks in one message. Sums are exact and pass `bad` on; NaN
/// counts as the largest value. The result is the same on all ranks, for any distribution of the terms. NULL if n is 0.
void bt_comm_reduce(const bt_comm *comm, bt_sum *sums, int n_sums, double *maxima, int n_max, uint64_t *ors, int n_ors);

/// Collective. Sum over the ranks before this one; *total (may be NULL): sum over all.
int64_t bt_comm_before(const bt_comm *comm, int64_t value, int64_t *total);

/// First of n items in the block of a rank, if they are distributed in equal blocks; bt_comm_first(comm, comm->size, n)
/// = n.
static inline int64_t bt_comm_first(const bt_comm *comm, int rank, int64_t n)
{
    return (int64_t)((__extension__(__int128) n) * rank / comm->size);
}

/// Collective. Redistribute rows of bodies in the order of their ids. This rank has n rows: gid [n] and rows
/// [n][width]; rank k receives those with ids first[k] to first[k + 1] − 1 in block [first[k+1] − first[k]][width].
/// first: [size + 1], ascending, the same on all ranks; first[0] = 0. Every id below first[size] must come exactly
/// once. Errors (the same status on all ranks): BT_ERR_NUMERIC, naming missing, duplicate or invalid ids.
bt_status bt_comm_rows_by_gid(const bt_comm *comm, const int64_t *first, bt_idx n, const bt_gid *gid, int width,
                              const double *rows, double *block, bt_errors *err);

/// Collective. Gather rows of doubles [n][width] from all ranks on rank 0, in the order of the ranks: returns
/// [*total][width] there, to be freed by the caller; NULL and *total = 0 elsewhere.
double *bt_comm_gather(const bt_comm *comm, int64_t n, int width, const double *rows, int64_t *total);

BT_END_C

#endif
