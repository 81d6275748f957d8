// SPDX-License-Identifier: MIT
// An ensemble: the members of a study, run by groups of ranks and by any number of processes, and gathered in one file.
//
// Folder. DIR/study.resolved.yml defines the members, DIR/study.files has digests of the files that they name
// (src/run/study.h). DIR/members/cCCC-rRRR is an ordinary result folder; a member is finished if it has a file
// `finished` (written last: a stopped run has a summary too) that matches its other files, failed if it has failed.txt
// (first line: exit code, and the code of the reason if it has one; then the reasons; beside the folder, as
// cCCC-rRRR.failed.txt, if no file can be written there), and otherwise waits. The next call forgets failures of input
// and output (BT_ERR_IO), so that it continues after a full disk. DIR/journal.jsonl has a line for each
// start and end, with wall times (null if the process died before it wrote the line, which the next call adds).
// DIR/ensemble.h5 (src/run/ensemble_file.c) is made anew from the members' files: nothing in it depends on order,
// ranks, or interruptions.
//
// Fields. If conditions share their ice (`fields: common`, or ice from a file), DIR/fields holds each field that was
// made or read, under the digest of all its inputs (src/field/field_kept.h), until all members are finished.
//
// Soundness. `finished` is a record of the member's summary.json, result.h5 and case.resolved.yml, by length and digest
// (src/run/ensemble_record.h). Each call first reads and compares them all, shared among its ranks (at the speed of the
// disk: an hour of the study concentration.yml at full scale leaves 4 MB per member), and each maker of ensemble.h5
// checks members that others have finished since. A missing or damaged result is reported, removed and run again; an
// unreadable one is reported, left as it is, and is a hole. A call ends with 0 only if all are finished and sound.
//
// Scheduling. A process that works on a member holds a lock on members/NAME/lock, which the system releases when the
// process ends, however it ends, and the lock of its result folder (src/base/fileio.h): a member on which `bergtow
// resume` works stays open, and is waited for like a member of another call. So groups of ranks, jobs of an array on a
// cluster, and a call that resumes a killed one need no communication: each takes the next member that is neither
// finished, failed nor locked, the longest first by an estimate. With a limit of wall time they go field by field, so
// that a stopped call leaves whole fields, and within a field a Latin hypercube is run in the order of its conditions,
// so that a random sample of them is left. (Rejected: a counter in shared MPI memory; it does not include other jobs,
// and on some networks a computing rank does not serve it.) A stopped member resumes from its checkpoint; when it is
// finished its checkpoints are removed. A member whose process died is tried again after all others, and given up after
// some attempts without a checkpoint between them, so that it cannot stop the rest. Under mpirun a rank that dies ends
// all others, whose members then also have one more attempt without an end: from BT_SUSPECT_ATTEMPTS on, members are
// run one at a time, so that only the faulty one reaches the limit. (Not from the first attempt on: a job that reaches
// its time limit leaves as many such members as it had groups.)
#ifndef BERGTOW_ENSEMBLE_H
#define BERGTOW_ENSEMBLE_H

#include "bergtow/study.h"

BT_BEGIN_C

struct bt_comm;

enum {
    BT_MAX_ATTEMPTS = 20,     ///< most attempts of a member whose process dies each time
    BT_SUSPECT_ATTEMPTS = 10, ///< from here on it is run while no other such member is
    BT_MAX_JOBS = 1024,       ///< most processes of one call
};

/// How a call without a launcher starts further processes on this machine to share its members, each a separate call on
/// the same folder with `job`.
typedef struct bt_ensemble_helpers {
    void (*start)(void *of, int n, int threads); ///< start n processes with this many threads
    void (*end)(void *of, bool stop);            ///< wait until they have ended; stop: ask them to end first
    void *of;
} bt_ensemble_helpers;

typedef struct bt_ensemble_options {
    const char *dir;
    /// per rank, 0 = run.threads of the base case, or OMP_NUM_THREADS, or the cores of the node shared by its ranks
    int threads;
    /// processes on this machine, 0 = 1 if a number of threads was requested; otherwise as many as the cores allow,
    /// with the threads that the floes of a member keep busy
    int jobs;
    const bt_ensemble_helpers *helpers; ///< NULL = 1 job
    bool job;                           ///< this call was started by a helper: it reports only members
    bool quiet;
    bool retry;               ///< try all failed members again, not only those that failed with BT_ERR_IO
    /// end when nothing is left to begin, even if other processes still work on members
    bool leave;
    int64_t max_steps;        ///< most steps of each member in this call, 0 = all
    double max_wall;          ///< of this call, s; 0 = no limit
    const char *command_line;
} bt_ensemble_options;

typedef enum { BT_MEMBER_WAITING, BT_MEMBER_FINISHED, BT_MEMBER_FAILED } bt_member_state;

/// Collective. Run the rest of a study. Errors, the same on all ranks: BT_ERR_CASE (the folder belongs to another
/// study, a file that it names has changed, its members would be the same run, the study needs more ranks than there
/// are), BT_ERR_IO (also: a member is not sound, or the file system has no locks), BT_ERR_SIGNAL (stopped: another call
/// resumes, or other processes work on the rest); the worst status of a failed member if all others are done.
bt_status bt_ensemble_run(const struct bt_comm *comm, const bt_study *study, const bt_ensemble_options *options,
                          bt_errors *err);

/// State of a member by its marker files; for soundness see ensemble_record.h. *why: text of failed.txt without its
/// first line, or that the process of a waiting member died; *code, *failure: from the first line. The caller frees the
/// texts, which are NULL if there is none; the pointers may be NULL.
bt_member_state bt_ensemble_state(const char *folder, int *code, char **failure, char **why);

BT_END_C

#endif
