// SPDX-License-Identifier: MIT
// What a call of an ensemble knows of its members, and what it says of them; private to src/run/ensemble*.c.
#ifndef BT_ENSEMBLE_LIST_H
#define BT_ENSEMBLE_LIST_H

#include "bergtow/base.h"
#include "bergtow/ensemble.h"
#include "run/ensemble_record.h"
#include "run/study.h"

// --- a member --------------------------------------------------------------------------------------------------------

// The files by which members of an ensemble are told apart: lock, attempts, reasons of a failure. What they mean:
// bergtow/ensemble.h.

/// Open folder/name; −1 and errno.
int bt_member_open(const char *folder, const char *name, int flags);

/// Lock of an open file: the system lifts it when the file is closed and when the process ends, however it ends.
bool bt_member_take_lock(int fd, bool wait);

/// Is somebody, this process too, at work on the member?
bool bt_member_held(const char *folder);

/// Starts of a member that had no end, since it last came on: one that has written a checkpoint since is no hopeless
/// one.
int bt_member_attempts(const char *folder);
void bt_member_note_attempt(const char *folder);
void bt_member_forget_attempts(const char *folder);

/// In the folder, or beside it where the folder takes no file. Errors: BT_ERR_IO, when neither does.
bt_status bt_member_record_failure(const char *folder, bt_status code, const bt_errors *why, bt_errors *err);
void bt_member_forget_failure(const char *folder);

enum { BT_MOST_REPORTED = 10 }; ///< failed members that are reported one by one

typedef struct bt_entry {
    bt_member m;
    int64_t index; ///< among the members of the study
    char *folder;
    int64_t turn;  ///< repeat where wall time is limited: a call that is stopped leaves whole fields; otherwise 0
    double cost;   ///< estimated, s of one core
    /// within a turn the largest comes first: the cost; 0 where wall time is limited and the conditions are a random
    /// sample: those that are done are to be one, too, and the costly ones alone have another mean
    double first;
    bool shares;   ///< another condition has the same field
    bool settled;  ///< finished or failed, as far as this process knows
    bool busy;     ///< a run of another kind (bergtow resume) had the folder when this process wanted it
    bool paused;   ///< has done the steps that this call was to do
    int attempts;  ///< starts without an end
} bt_entry;

typedef struct bt_ensemble {
    const bt_comm *world, *group;
    const bt_study *s;
    const bt_ensemble_options *o;
    bt_entry *list;     ///< [n] in the order in which they are taken
    int64_t n, before;  ///< members; settled when this call began
    double cost_before; ///< of those
    double most_floes;  ///< of the member with the most
    char *fields;       ///< folder of the fields that members share
    int64_t fixed;      ///< conditions whose ice does not depend on the seed
    int n_groups, of_group, threads, jobs;
    int lock, run_lock; ///< held for the member at hand: among ensembles, and as that of any run (base/fileio.h)
    /// descriptor held by the one group that may work on members that look hopeless, −1 = not this one
    int alone;
    int64_t lost;       ///< members whose failure could not be recorded
    bt_member_records records;
    bt_member_notes warnings; ///< of the members in ensemble.h5
    bt_study_files files; ///< on the first rank of a group
    double began, gathered, gathering; ///< gathered: when ensemble.h5 was last looked at; gathering: s that took
    bt_errors *err;
} bt_ensemble;

typedef enum {
    BT_EVENT_START, BT_EVENT_STOPPED, BT_EVENT_FINISHED, BT_EVENT_FAILED,
    BT_EVENT_UNSOUND ///< it had finished, and its result is damaged
} bt_member_event;

/// A line of journal.jsonl. wall: s, NAN = unknown.
void bt_ensemble_journal(const bt_ensemble *ensemble, bt_member_event event, const bt_member *member, double wall,
                         int code);

/// The wall time that is left, s; infinite where none was given.
double bt_ensemble_wall_left(const bt_ensemble *ensemble);

/// Has its process died so often that it is run alone?
bool bt_entry_is_suspect(const bt_entry *entry);

/// Look at the folder of a member whether it has been settled meanwhile.
void bt_entry_look(bt_entry *entry);

/// Collective. The members in the order in which they are taken; each that has finished is checked.
void bt_ensemble_list(bt_ensemble *ensemble);

/// What is settled when the work begins.
void bt_ensemble_count_settled(bt_ensemble *ensemble);

/// Collective. Each rank makes what it knows of sound files known to the others, so that none reads them again.
void bt_ensemble_share_records(bt_ensemble *ensemble);

/// Print that a member has ended, after `wall` s, and what is left.
void bt_ensemble_say(const bt_ensemble *ensemble, const bt_entry *entry, bt_status status, double wall);

/// What became of the members: the worst status of the failed, each with its first reason. BT_OK only where there is no
/// hole.
bt_status bt_ensemble_tell_end(bt_ensemble *ensemble, bt_status status, bt_errors *err);

// --- the journal -----------------------------------------------------------------------------------------------------

// journal.jsonl in the folder of an ensemble: a line for each start and end of a member.

/// lacking [n], by the place of a member in a study of so many repeats: set to false for those whose last line says
/// that they have finished, and for all where there is no journal, or where it cannot be read.
void bt_journal_strike_ended(const char *dir, int64_t repeats, int64_t n, bool *lacking);

// --- the folder ------------------------------------------------------------------------------------------------------

// The folder of an ensemble: which study it holds, and the files that this is made of.

/// Make the folder with its resolved study and the files that the study names. BT_ERR_CASE: it is of another study, or
/// a file has changed. digest: of the resolved study that the folder keeps. By one process of a call.
bt_status bt_ensemble_prepare_folder(const bt_study *study, const bt_ensemble_options *options,
                                     char digest[BT_DIGEST_TEXT], bt_errors *err);

#endif
