// SPDX-License-Identifier: MIT
// State and messages of an ensemble call about its members; private to src/run/ensemble*.c.
#ifndef BT_ENSEMBLE_LIST_H
#define BT_ENSEMBLE_LIST_H

#include "bergtow/ensemble.h"
#include "run/ensemble_record.h"
#include "run/study.h"

// --- a member --------------------------------------------------------------------------------------------------------

// The files that record the state of a member: lock, attempts, reasons of a failure; see bergtow/ensemble.h.

/// Result folder of a member of the ensemble in dir; the caller frees it.
char *bt_member_folder(const char *dir, const bt_member *member);

/// Lock an open file (wait: until it is free): the system releases the lock when the file is closed or the process
/// ends, however it ends.
bool bt_member_take_lock(int fd, bool wait);
/// Open and lock the file `lock` of the ensemble in dir; −1 with a message if it cannot be opened, is taken (without
/// wait), or the file system has no locks.
int bt_ensemble_take_lock(const char *dir, bool wait, bt_errors *err);

/// Is any process, this one included, at work on the member?
bool bt_member_held(const char *folder);

/// Starts of a member without an end since its last progress: a member that has written a checkpoint is not hopeless.
int bt_member_attempts(const char *folder);
void bt_member_note_attempt(const char *folder);

/// Record a failure in the folder, or beside it if no file can be made there. Errors: BT_ERR_IO if both fail.
bt_status bt_member_record_failure(const char *folder, bt_status code, const bt_errors *why, bt_errors *err);
void bt_member_forget_failure(const char *folder);

enum { BT_MAX_REPORTED = 10 }; ///< most failed members to report one by one

typedef struct bt_entry {
    bt_member m;
    int64_t index; ///< in the study
    char *folder;
    int64_t turn;  ///< repeat if wall time is limited, so that a stopped call leaves whole fields; otherwise 0
    double cost;   ///< estimated, s of one core
    /// within a turn the largest comes first: the cost; 0 if wall time is limited and the conditions are a random
    /// sample: the finished ones must be one too, while the expensive ones would have another mean
    double first;
    bool shares;   ///< another condition has the same field
    bool settled;  ///< finished or failed, as far as this process knows
    bool busy;     ///< a single run (bergtow resume) held the folder when this process wanted it
    bool paused;   ///< has done the steps asked of this call
    int attempts;  ///< starts without an end
} bt_entry;

typedef struct bt_ensemble {
    const bt_comm *world, *group;
    const bt_study *s;
    const bt_ensemble_options *o;
    bt_entry *list;     ///< [n] in the order in which they are run
    int64_t n, before;  ///< members; settled when this call began
    double cost_before; ///< of those
    double most_floes;  ///< in the largest member
    char *fields;       ///< folder of the fields that members share
    int64_t fixed;      ///< conditions whose ice does not depend on the seed
    int n_groups, of_group, threads, jobs;
    int lock, run_lock; ///< held for the present member: against ensembles, and against any run (base/fileio.h)
    /// lock of the only group that may run suspects, −1 = not this group
    int alone;
    int64_t lost;       ///< members whose failure could not be recorded
    bt_member_records records;
    bt_member_notes warnings; ///< of the members in ensemble.h5
    bt_study_files files; ///< on the first rank of a group
    double began, gathered, gathering; ///< gathered: last update of ensemble.h5; gathering: its duration, s
    bt_errors *err;
} bt_ensemble;

typedef enum {
    BT_EVENT_START, BT_EVENT_STOPPED, BT_EVENT_FINISHED, BT_EVENT_FAILED,
    BT_EVENT_UNSOUND ///< finished, but its result is damaged
} bt_member_event;

/// A line of journal.jsonl. wall: s, NAN = unknown.
void bt_ensemble_journal(const bt_ensemble *ensemble, bt_member_event event, const bt_member *member, double wall,
                         int code);

/// Remaining wall time, s; infinite without a limit.
double bt_ensemble_wall_left(const bt_ensemble *ensemble);

/// Has its process died so often that it must run alone?
bool bt_entry_is_suspect(const bt_entry *entry);

/// Check in the folder of a member whether it has been settled meanwhile.
void bt_entry_look(bt_entry *entry);

/// Collective. List the members in the order in which they are run, and check the finished ones.
void bt_ensemble_list(bt_ensemble *ensemble);

/// Count the members settled before the work begins.
void bt_ensemble_count_settled(bt_ensemble *ensemble);

/// Collective. Share among ranks which files are known to be sound, so that none reads them again.
void bt_ensemble_share_records(bt_ensemble *ensemble);

/// Print that a member has ended, after `wall` s, and how much is left.
void bt_ensemble_say(const bt_ensemble *ensemble, const bt_entry *entry, bt_status status, double wall);

/// Report the outcome: returns the worst status of failed members, each with its first reason in err; BT_OK without
/// holes.
bt_status bt_ensemble_tell_end(bt_ensemble *ensemble, bt_status status, bt_errors *err);

// --- the journal -----------------------------------------------------------------------------------------------------

// journal.jsonl in the folder of an ensemble: a line for each start and end of a member.

/// lacking [n], by the index of a member in a study with this many repeats: set to false for members whose last line
/// says that they have finished, and for all members if there is no readable journal.
void bt_journal_strike_ended(const char *dir, int64_t repeats, int64_t n, bool *lacking);

// --- the folder ------------------------------------------------------------------------------------------------------

/// Make the folder with its resolved study and the files that the study names. BT_ERR_CASE: it belongs to another
/// study, or a file has changed. digest: of the resolved study that the folder keeps. Called by one process only.
bt_status bt_ensemble_prepare_folder(const bt_study *study, const bt_ensemble_options *options,
                                     char digest[BT_DIGEST_TEXT], bt_errors *err);

#endif
