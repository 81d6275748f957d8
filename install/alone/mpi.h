// SPDX-License-Identifier: MIT
// MPI of one process, for a program built without an MPI (make MPI=no): what src/ and partition/ call, and no more.
//
// With one rank bergtow leaves out every exchange. So here is what starts and ends, who is there, and copies of
// communicators; an exchange ends the program.
#ifndef BERGTOW_ALONE_MPI_H
#define BERGTOW_ALONE_MPI_H

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef int MPI_Comm, MPI_Datatype, MPI_Op, MPI_Request, MPI_Errhandler, MPI_Info;
typedef struct MPI_Status { int unused; } MPI_Status;
typedef void MPI_User_function(void *, void *, int *, MPI_Datatype *);
typedef void MPI_Comm_errhandler_function(MPI_Comm *, int *, ...);

enum { MPI_SUCCESS, MPI_COMM_NULL = 0, MPI_COMM_WORLD, MPI_THREAD_FUNNELED, MPI_COMM_TYPE_SHARED, MPI_INFO_NULL,
       MPI_BYTE, MPI_CHAR, MPI_INT, MPI_INT64_T, MPI_UINT64_T, MPI_DOUBLE, MPI_SUM, MPI_MAX };
enum { MPI_MAX_LIBRARY_VERSION_STRING = 64, MPI_MAX_ERROR_STRING = 64 };
#define MPI_IN_PLACE NULL
#define MPI_STATUS_IGNORE NULL

#define BT_ALONE static inline __attribute__((unused)) int

BT_ALONE MPI_Initialized(int *begun) { return *begun = 0; }
BT_ALONE MPI_Init_thread(int *argc, char ***argv, int wanted, int *provided)
{
    return (void)argc, (void)argv, *provided = wanted, MPI_SUCCESS;
}
BT_ALONE MPI_Finalize(void) { return MPI_SUCCESS; }
BT_ALONE MPI_Abort(MPI_Comm c, int code) { (void)c, _Exit(code); }
BT_ALONE MPI_Get_library_version(char *text, int *length) { return *length = sprintf(text, "no MPI"), MPI_SUCCESS; }
BT_ALONE MPI_Error_string(int code, char *text, int *length)
{
    return *length = sprintf(text, "error %d", code), MPI_SUCCESS;
}

BT_ALONE MPI_Comm_rank(MPI_Comm c, int *rank) { return (void)c, *rank = 0; }
BT_ALONE MPI_Comm_size(MPI_Comm c, int *size) { return (void)c, *size = 1, MPI_SUCCESS; }
BT_ALONE MPI_Comm_dup(MPI_Comm c, MPI_Comm *copy) { return *copy = c, MPI_SUCCESS; }
BT_ALONE MPI_Comm_split(MPI_Comm c, int group, int key, MPI_Comm *part)
{
    return (void)group, (void)key, *part = c, MPI_SUCCESS;
}
BT_ALONE MPI_Comm_split_type(MPI_Comm c, int type, int key, MPI_Info info, MPI_Comm *part)
{
    return (void)type, (void)info, MPI_Comm_split(c, 0, key, part);
}
BT_ALONE MPI_Comm_free(MPI_Comm *c) { return *c = MPI_COMM_NULL; }
BT_ALONE MPI_Comm_create_errhandler(MPI_Comm_errhandler_function *f, MPI_Errhandler *h)
{
    return (void)f, *h = 0;
}
BT_ALONE MPI_Comm_set_errhandler(MPI_Comm c, MPI_Errhandler h) { return (void)c, (void)h, MPI_SUCCESS; }
BT_ALONE MPI_Errhandler_free(MPI_Errhandler *h) { return *h = 0; }
BT_ALONE MPI_Type_contiguous(int n, MPI_Datatype of, MPI_Datatype *type) { return (void)n, *type = of, MPI_SUCCESS; }
BT_ALONE MPI_Type_commit(MPI_Datatype *type) { return (void)type, MPI_SUCCESS; }
BT_ALONE MPI_Type_free(MPI_Datatype *type) { return *type = 0; }
BT_ALONE MPI_Op_create(MPI_User_function *f, int commutes, MPI_Op *op)
{
    return (void)f, (void)commutes, *op = 0;
}
BT_ALONE MPI_Op_free(MPI_Op *op) { return *op = 0; }

// Exchanges, of whatever arguments.
#define BT_EXCHANGE(name, first_type)                                                   \
    BT_ALONE name(first_type first, ...)                                                \
    {                                                                                   \
        (void)first;                                                                    \
        fprintf(stderr, "bergtow: " #name " in a program without MPI; please report\n"); \
        abort();                                                                        \
    }
BT_EXCHANGE(MPI_Allreduce, const void *)
BT_EXCHANGE(MPI_Allgather, const void *)
BT_EXCHANGE(MPI_Allgatherv, const void *)
BT_EXCHANGE(MPI_Alltoall, const void *)
BT_EXCHANGE(MPI_Alltoallv, const void *)
BT_EXCHANGE(MPI_Bcast, const void *)
BT_EXCHANGE(MPI_Exscan, const void *)
BT_EXCHANGE(MPI_Gather, const void *)
BT_EXCHANGE(MPI_Gatherv, const void *)
BT_EXCHANGE(MPI_Irecv, const void *)
BT_EXCHANGE(MPI_Isend, const void *)
BT_EXCHANGE(MPI_Ibarrier, MPI_Comm)
BT_EXCHANGE(MPI_Test, const MPI_Request *)
BT_EXCHANGE(MPI_Wait, const MPI_Request *)

#endif
