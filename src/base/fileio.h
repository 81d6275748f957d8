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

/// Open an input for reading. Returns a descriptor; −1 with a message on error, which is BT_ERR_IO. what: its name in
/// messages, such as "a case file". Only regular files (and links to them) are opened: opening a FIFO would wait for a
/// writer, possibly for ever, and a device has no end.
int bt_file_open(const char *path, const char *what, bt_errors *err);

/// Read the whole text of a file of at most 16 MiB, zero-terminated; the caller frees it (also after an error). what:
/// its name in messages. Also accepts a pipe that the shell has opened for this process (/dev/stdin, /dev/fd/N:
/// `generate | bergtow check /dev/stdin`); no other input may be a pipe, since inputs are read by name, some more than
/// once. Errors: BT_ERR_IO, BT_ERR_CASE (too large).
bt_status bt_file_read(const char *path, const char *what, char **text, size_t *size, bt_errors *err);

/// The same for at most `most` bytes, and from a regular file only.
bt_status bt_file_read_to(const char *path, const char *what, size_t most, char **text, size_t *size, bt_errors *err);

/// May bergtow write a file of this name? It never replaces or removes a device, a pipe, a socket, a link to one of
/// these, or a descriptor that this process was given (/dev/stdout). bt_file_write, _remove, _copy and _rename, the
/// locks and bt_h5_create check this first. Errors: BT_ERR_IO.
bt_status bt_file_may_take(const char *path, bt_errors *err);

/// Write text to path by way of a temporary file and bt_file_rename: path holds the old text or the new, never a part.
bt_status bt_file_write(const char *path, const char *text, bt_errors *err);

// System calls that a signal may interrupt (EINTR) or cut short, repeated until done. TEMP_FAILURE_RETRY, which does
// the same, exists in glibc only.
/// Like open(), with O_CLOEXEC and mode 0666. Returns −1 and errno on error.
int bt_file_descriptor(const char *path, int flags);
/// Read n bytes at an offset of an open file. Returns how many there are before its end, or −1 and errno.
ssize_t bt_file_get(int fd, off_t at, void *bytes, size_t n);
// The next four return errno of a failure, or 0.
/// Write all n bytes at an offset of an open file.
int bt_file_put(int fd, off_t at, const void *bytes, size_t n);
int bt_file_sync(int fd);                ///< sync written data to disk
int bt_file_resize(int fd, off_t size);
int bt_file_close(int fd);               ///< no error if a signal interrupts it: Linux has then closed the file, too

/// Make a folder and its parents, and sync their names to disk; no error if it exists.
bt_status bt_file_make_dir(const char *path, bt_errors *err);

/// Remove a file; no error if there is none.
bt_status bt_file_remove(const char *path, bt_errors *err);

/// Copy a file to another name, by reference where the file system can. The copy is not synced: bt_checksum_write,
/// called next, does that. `to` is removed after an error.
bt_status bt_file_copy(const char *from, const char *to, bt_errors *err);

/// Give a complete file its final name, replacing any file of that name. The folder is synced to disk too, so that the
/// change lasts.
bt_status bt_file_rename(const char *from, const char *to, bt_errors *err);

/// Does the folder contain a file or folder of this name?
bool bt_file_there(const char *dir, const char *name);

/// Is this a regular file that begins with the text?
bool bt_file_begins(const char *path, const char *text);

/// dir/name in new memory; the caller frees it.
char *bt_file_join(const char *dir, const char *name);

/// One more than the system takes, so that it refuses a path that is cut off here (ENAMETOOLONG).
enum { BT_PATH_BYTES = 4098 };
/// The same in `out`, which is returned.
char *bt_file_path(char out[BT_PATH_BYTES], const char *dir, const char *name);
/// The same in memory that lasts to the end of the enclosing block.
#define BT_PATH(dir, name) bt_file_path((char[BT_PATH_BYTES]){""}, dir, name)
/// A path with this ending, in such memory.
char *bt_file_beside(char out[BT_PATH_BYTES], const char *path, const char *ending);
#define BT_BESIDE(path, ending) bt_file_beside((char[BT_PATH_BYTES]){""}, path, ending)

/// The folder of a path, "." for a bare name, in new memory; the caller frees it.
char *bt_file_folder(const char *path);

// --- locks -----------------------------------------------------------------------------------------------------------

/// Take the lock dir/run.lock, which names host and process; the system releases it when the process ends, in whatever
/// way. Returns a descriptor for bt_lock_drop; −1 with a message if another process holds it or it cannot be made.
/// *busy (may be NULL): another process holds it, so that a later attempt may succeed. On a file system without locks
/// it warns, and goes without: one run alone needs none.
int bt_lock_take(const char *dir, bool *busy, bt_errors *err);
/// The same with another file, since run.lock stands for a run. That file is not removed.
int bt_lock_take_file(const char *dir, const char *name, bool *busy, bt_errors *err);
void bt_lock_drop(const char *dir, int lock);

#endif
