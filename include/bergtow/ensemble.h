// SPDX-License-Identifier: MIT
// An ensemble: the members of a study, run by groups of ranks and by any number of processes, and gathered in one file.
//
// Folder. DIR/study.resolved.yml says what the members are, DIR/study.files what is in the files that they name
// (src/run/study.h). DIR/members/cCCC-rRRR is an ordinary result folder; a member is finished when it holds a
// file `finished` (the last thing written: a run that was stopped has a summary too) that its other files fit,
// failed when it holds failed.txt (first line: exit code, and the code of a reason that has one; then the reasons;
// beside the folder, cCCC-rRRR.failed.txt, where that takes no file), and else waits. DIR/journal.jsonl has a line
// for each start and end, with wall times (null where the process died before it wrote the line; the next call adds
// that). DIR/ensemble.h5 (src/run/ensemble_file.c) is made anew from the members' files: nothing in it depends on
// order, ranks, or how often the ensemble was stopped.
//
// Fields. Where conditions have their ice in common (`fields: common`, or ice from a file), DIR/fields holds each field
// that was made or read, under the digest of all it follows from (src/field/field_kept.h), until all is finished.
//
// Soundness. `finished` is a record of the member's summary.json, result.h5 and case.resolved.yml, by length and digest
// (src/run/ensemble_record.h). Each call reads them all and compares them, shared among its ranks, before it begins (as
// fast as the disk is: an hour of the study concentration.yml at full scale leaves 4 MB a member), and each maker of
// ensemble.h5 what others have finished since. What is missing or damaged is reported, removed and run again; what the
// system does not let us read is reported, left as it is, and is a hole. A call ends with 0 only when every member is
// finished and sound.
//
// Who does what. Whoever works on a member holds a lock on members/NAME/lock, which the system releases when the
// process ends, however it ends, and the lock of its result folder (src/base/fileio.h): a member that a `bergtow
// resume` is at stays open, and is waited for as for one of another call. So groups of ranks, jobs of an array on a
// cluster, and a call that resumes a killed one need no word between them: each takes the next member that is
// neither finished, failed nor locked, the longest first by an estimate, with a limit of wall time field by field,
// so that a call that is stopped leaves whole fields, and within a field a Latin hypercube in the order of its
// conditions, so that it leaves a random sample of them. (Rejected: a counter in shared MPI memory; it knows nothing
// of other jobs, and a rank that computes does not serve it on every network.) A member that was stopped goes on
// from its checkpoint; when it is finished its checkpoints are removed. One whose process died is tried again after
// all others, and given up after some attempts without a checkpoint between them, so that it cannot stop the rest.
// Under mpirun a rank that dies takes all others with it, and their members have one more attempt without an end:
// from BT_SUSPECT_ATTEMPTS on members are run one at a time, so that only the one at fault goes on to the limit.
// (Not from the first on: a job that ends with its time limit leaves as many such members as it had groups.)
#ifndef BERGTOW_ENSEMBLE_H
#define BERGTOW_ENSEMBLE_H

#include "bergtow/comm.h"
#include "bergtow/study.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
    BT_MAX_ATTEMPTS = 20,     ///< of a member whose process dies each time
    BT_SUSPECT_ATTEMPTS = 10, ///< from here on it is run while no other of its kind is
    BT_MAX_JOBS = 1024,       ///< processes of one call
};

/// How a call without a launcher gets further processes on this machine to share its members, each a call of its own
/// on the same folder with `job`.
typedef struct bt_ensemble_helpers {
    void (*start)(void *of, int n, int threads); ///< n processes of so many threads
    void (*end)(void *of, bool stop);            ///< wait until they have ended; stop: and ask them to
    void *of;
} bt_ensemble_helpers;

typedef struct bt_ensemble_options {
    const char *dir;
    /// of each rank, 0 = run.threads of the base case, or OMP_NUM_THREADS, or the cores of the node shared by its ranks
    int threads;
    /// processes on this machine, 0 = without threads that somebody has asked for, as many as the cores are enough for
    /// with the threads that the floes of a member keep busy; otherwise 1
    int jobs;
    const bt_ensemble_helpers *helpers; ///< NULL = 1 job
    bool job;                           ///< this call is one of a helper: it reports members alone
    bool quiet;
    bool retry;               ///< failed members are tried again
    /// end when nothing is left to begin, even if other processes are still at work on members
    bool leave;
    int64_t max_steps;        ///< of each member in this call, 0 = all
    double max_wall;          ///< of this call, s; 0 = no limit
    const char *command_line;
} bt_ensemble_options;

typedef enum { BT_MEMBER_WAITING, BT_MEMBER_FINISHED, BT_MEMBER_FAILED } bt_member_state;

/// Collective. Run what is left of a study. Errors, the same on all ranks: BT_ERR_CASE (the folder belongs to another
/// study, a file that it names has changed, its members would be the same run, the study asks for more ranks than there
/// are), BT_ERR_IO (also: a member is not sound), BT_ERR_SIGNAL (the call resumes, or others are at work on the rest);
/// the worst status of a failed member when all others are done.
bt_status bt_ensemble_run(const bt_comm *comm, const bt_study *study, const bt_ensemble_options *options,
                          bt_errors *err);

/// State of a member by the files that mark it; whether a finished one is sound: ensemble_record.h. why: text of
/// failed.txt without its first line, or that the process of a waiting one died; *code, *failure: the first line.
/// Texts are freed by the caller, and NULL where there is none; the pointers may be NULL.
bt_member_state bt_ensemble_state(const char *folder, int *code, char **failure, char **why);

#ifdef __cplusplus
}
#endif

#endif
