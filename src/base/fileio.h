// SPDX-License-Identifier: MIT
// Text files that are complete or absent, folders, and the wording of input/output errors.
#ifndef BT_FILEIO_H
#define BT_FILEIO_H

#include <sys/types.h>

#include "bergtow/base.h"

/// Append "path: cannot ACTION: reason; remedy" for an errno value; returns BT_ERR_IO.
bt_status bt_file_fail(const char *path, const char *action, int errnum, bt_errors *err);

/// What a user can do about an errno value of a failed file operation.
const char *bt_file_remedy(int errnum);

/// Open an input for reading; −1 and a message otherwise, the error is BT_ERR_IO. what: "a case file", for the
/// messages. Only regular files (and links to them) are opened: to open a FIFO would wait for a writer, for ever if
/// there is none, and a device has no end.
int bt_file_open(const char *path, const char *what, bt_errors *err);

/// Whole text of a file of at most 16 MiB, terminated; the caller frees it (also after an error). what: "a case file",
/// for the messages. Also from a pipe that the shell has opened for this process (/dev/stdin, /dev/fd/N: `generate |
/// bergtow check /dev/stdin`), which no other input is: they are read by name, some of them more than once. Errors:
/// BT_ERR_IO, BT_ERR_CASE (too large).
bt_status bt_file_read(const char *path, const char *what, char **text, size_t *size, bt_errors *err);

/// The same of at most so many bytes, from a regular file alone.
bt_status bt_file_read_to(const char *path, const char *what, size_t most, char **text, size_t *size, bt_errors *err);

/// May a file of ours take this name? A device, a pipe or a socket, or a link to one, is never replaced nor removed,
/// nor is what this process was given open (/dev/stdout). All that follows here, and bt_h5_create, asks this first.
/// Errors: BT_ERR_IO.
bt_status bt_file_may_take(const char *path, bt_errors *err);

/// Write text to path by way of a temporary name and bt_file_rename: path holds the old or the new text, never a part.
bt_status bt_file_write(const char *path, const char *text, bt_errors *err);

// Calls of the system that a signal may interrupt (EINTR) or cut short: they are made again. TEMP_FAILURE_RETRY, which
// does this anywhere, is glibc's alone.
/// As open, with O_CLOEXEC and the mode 0666; −1 and errno.
int bt_file_descriptor(const char *path, int flags);
/// Read n bytes at a place of an open file. Returns how many there are before its end, or −1 and errno.
ssize_t bt_file_get(int fd, off_t at, void *bytes, size_t n);
// These return errno of a failure, or 0.
/// Write n bytes at a place of an open file, all of them.
int bt_file_put(int fd, off_t at, const void *bytes, size_t n);
int bt_file_sync(int fd);                ///< bring what was written to the disk
int bt_file_resize(int fd, off_t size);
int bt_file_close(int fd);               ///< Linux has closed it, too, where a signal interrupts the call

/// Make a folder with its parents, and their names last; no error when it is there.
bt_status bt_file_make_dir(const char *path, bt_errors *err);

/// Remove a file; no error when it is not there.
bt_status bt_file_remove(const char *path, bt_errors *err);

/// Copy a file to another name, by reference where the file system can. bt_checksum_write, which follows, brings it to
/// the disk. `to` is removed after an error.
bt_status bt_file_copy(const char *from, const char *to, bt_errors *err);

/// Give a complete file its final name, in place of what has it, and make the change last: the folder is brought to the
/// disk too.
bt_status bt_file_rename(const char *from, const char *to, bt_errors *err);

/// Is there something of this name in the folder?
bool bt_file_there(const char *dir, const char *name);

/// Is this a regular file that begins with the text?
bool bt_file_begins(const char *path, const char *text);

/// dir/name in new memory; the caller frees it.
char *bt_file_join(const char *dir, const char *name);

/// The folder that a path is in, "." for a bare name, in new memory; the caller frees it.
char *bt_file_folder(const char *path);

// --- locks -----------------------------------------------------------------------------------------------------------

// One process at a time in a result folder.

/// Take dir/run.lock, which names host and process; the system lifts it when the process ends, however. Returns a
/// descriptor for bt_lock_drop, −1 with a message when another process has it or it cannot be made. *busy: another
/// process has it, which passes; or NULL.
int bt_lock_take(const char *dir, bool *busy, bt_errors *err);
/// The same of another file than run.lock, which tells of a run. It stays.
int bt_lock_take_file(const char *dir, const char *name, bool *busy, bt_errors *err);
void bt_lock_drop(const char *dir, int lock);

#endif
