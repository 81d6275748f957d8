// SPDX-License-Identifier: MIT
// Replacing the result in a folder; its states meanwhile are listed in folder.h.
#include "output/folder.h"

#include <dirent.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/checksum.h"
#include "base/fileio.h"
#include "bergtow/case.h"
#include "output/checkpoint.h"
#include "output/record_parts.h"
#include "output/xdmf.h"

#define NEW_CASE BT_FOLDER_CASE ".new"

static bool is_summary(const char *path) { return bt_file_begins(path, "{\n  \"title\": "); }
static bool is_frames(const char *path) { return bt_file_begins(path, BT_XDMF_HEAD); }
static bool is_case(const char *path) { return bt_file_begins(path, BT_CASE_RESOLVED_HEAD); }

static bool is_sealed(const char *path) { return bt_checksum_there(path, ""); }

/// Is the file sealed, or begun with a seal to come?
static bool is_begun(const char *path) { return is_sealed(path) || bt_checksum_to_come(path); }

static bool is_regular(const char *path)
{
    struct stat st;
    return lstat(path, &st) == 0 && S_ISREG(st.st_mode);
}

static bool is_request(const char *path)
{
    struct stat st;
    return lstat(path, &st) == 0 && S_ISREG(st.st_mode) && st.st_size == 0;
}

/// The files that a run leaves in its folder, or reacts to; the case is moved out first and back last. An HDF5 file
/// without a seal, or damaged beyond recognition, counts as ours if another file in the folder does.
static const struct {
    const char *name;
    bool (*ours)(const char *path);
    bool hdf5;
} files[] = {
    {BT_FOLDER_CASE, is_case, false},
    {"summary.json", is_summary, false},
    {BT_RESULT_FILE, is_regular, true},
    {BT_RESULT_PART, is_begun, true},
    {BT_RESULT_FILE ".tmp", is_begun, true},
    {"frames.xdmf", is_frames, false},
    {BT_CHECKPOINT_FILE, is_begun, true},
    {BT_CHECKPOINT_FILE ".tmp", is_begun, true},
    {BT_CHECKPOINT_BEFORE, is_begun, true},
    {BT_CHECKPOINT_DAMAGED, is_regular, true},
    {BT_FAILURE_FILE, is_begun, true},
    {"stop", is_request, false},
};
enum { N_FILES = sizeof files / sizeof *files };

/// Is file k in the folder, and this program's? A link is replaced and never followed: its target stays.
static bool holds(const char *dir, int k)
{
    const char *path = BT_PATH(dir, files[k].name);
    struct stat st;
    return lstat(path, &st) == 0 && (S_ISLNK(st.st_mode) || files[k].ours(path));
}

/// Has this program certainly written into the folder?
static bool is_known(const char *dir)
{
    bool known = false;
    for (int k = 0; k < N_FILES && !known; k++)
        known = files[k].ours != is_request && holds(dir, k) &&
                (!files[k].hdf5 || is_sealed(BT_PATH(dir, files[k].name)));
    return known;
}

/// Was the file under the name of file k written by something else?
static bool is_foreign(const char *dir, int k, const char *path)
{
    struct stat st;
    if (lstat(path, &st) != 0) return false;
    if (!holds(dir, k)) return true;
    return files[k].hdf5 && is_regular(path) && !is_sealed(path) && !is_known(dir);
}

bt_status bt_folder_check(const char *dir, bt_errors *err)
{
    bt_status status = BT_OK;
    for (int k = 0; k < N_FILES; k++) {
        const char *path = BT_PATH(dir, files[k].name);
        if (is_foreign(dir, k, path))
            status = bt_fail(err, BT_ERR_IO,
                "%s: was not written by this program, but a run would replace it; move it away, or give another folder "
                "with -o",
                path);
    }
    return status;
}

/// Does the folder hold a run that has begun but not ended?
static bool has_begun(const char *dir)
{
    return bt_file_there(dir, BT_RESULT_PART) || bt_checkpoint_there(dir) || bt_folder_keeps(dir);
}

bool bt_folder_keeps(const char *dir) { return bt_file_there(dir, BT_FOLDER_REPLACED); }

/// Move file k of one folder to the same name in another.
static bt_status move(const char *from, const char *to, int k, bt_errors *err)
{
    if (!holds(from, k)) return BT_OK;
    return bt_file_rename(BT_PATH(from, files[k].name), BT_PATH(to, files[k].name), err);
}

/// Remove all of the program's files.
static bt_status clear(const char *dir, bt_errors *err)
{
    bt_status status = BT_OK;
    for (int k = 0; k < N_FILES && status == BT_OK; k++)
        if (holds(dir, k)) status = bt_file_remove(BT_PATH(dir, files[k].name), err);
    return status;
}

static bool stands(const char *dir) { return bt_checkpoint_there(dir) || bt_file_there(dir, "summary.json"); }

/// Move the contents of the folder aside. If a folder aside exists already, it holds the last complete result, and the
/// run in its place never completed: that run is removed.
static bt_status make_room(const char *dir, bt_errors *err)
{
    if (stands(dir)) bt_folder_settle(dir);
    if (bt_folder_keeps(dir)) return clear(dir, err);
    bool any = false;
    for (int k = 0; k < N_FILES && !any; k++) any = holds(dir, k);
    if (!any) return BT_OK;
    const char *aside = BT_PATH(dir, BT_FOLDER_REPLACED);
    bt_status status = bt_file_make_dir(aside, err);
    for (int k = 0; k < N_FILES && status == BT_OK; k++) status = move(dir, aside, k, err);
    return status;
}

/// Move the old result back, the case last: until it is there, the next call continues this. A file renamed on a disk
/// that refuses to sync counts as moved; a file that cannot be moved stays, and the next call tries again.
static void move_back(const char *dir)
{
    if (!bt_folder_keeps(dir)) return;
    const char *aside = BT_PATH(dir, BT_FOLDER_REPLACED);
    bool moved = true;
    for (int k = N_FILES - 1; k >= 0 && moved; k--) {
        move(aside, dir, k, NULL);
        moved = !holds(aside, k);
    }
    rmdir(aside);
}

bt_status bt_folder_replace(const char *dir, const char *resolved, bt_errors *err)
{
    const char *ready = BT_PATH(dir, NEW_CASE), *path = BT_PATH(dir, BT_FOLDER_CASE);
    bt_status status = bt_file_write(ready, resolved, err); // if the disk is full, nothing has changed
    if (status == BT_OK) {
        status = make_room(dir, err);
        if (status != BT_OK) {
            move_back(dir); // a case that is there is still the old one
        } else if ((status = bt_file_rename(ready, path, err)) != BT_OK) {
            unlink(path); // now the new one, if it got its name on a disk that refuses to sync
            move_back(dir);
        }
    }
    unlink(ready);
    return status;
}

void bt_folder_put_back(const char *dir)
{
    if (!bt_folder_keeps(dir)) return;
    unlink(BT_PATH(dir, BT_FOLDER_CASE));
    unlink(BT_PATH(dir, BT_RESULT_PART));
    move_back(dir);
}

void bt_folder_recover(const char *dir)
{
    if (!bt_file_there(dir, BT_FOLDER_CASE)) bt_folder_put_back(dir);
    const char *ready = BT_PATH(dir, NEW_CASE);
    if (is_case(ready)) unlink(ready);
    rmdir(BT_PATH(dir, BT_FOLDER_REPLACED)); // it stays if not empty
}

void bt_folder_settle(const char *dir)
{
    if (!bt_folder_keeps(dir)) return;
    const char *aside = BT_PATH(dir, BT_FOLDER_REPLACED);
    clear(aside, NULL); // the next complete result tries again
    rmdir(aside);
}

#define MARK "made by bergtow postproc" // as in postproc/bergtow/writing.py

/// Is the file a page or a picture with the mark of the Python commands?
static bool is_page(const char *path)
{
    static const char *const ends[] = {".html", ".pdf", ".md", ".png", ".svg", ".mp4"};
    const char *end = strrchr(path, '.');
    bool page = false;
    for (size_t k = 0; end && k < sizeof ends / sizeof *ends; k++) page = page || !strcmp(end, ends[k]);
    struct stat st;
    FILE *f = page && is_regular(path) ? fopen(path, "rb") : NULL;
    page = f && fstat(fileno(f), &st) == 0 && st.st_size > 0;
    void *text = page ? mmap(NULL, (size_t)st.st_size, PROT_READ, MAP_PRIVATE, fileno(f), 0) : MAP_FAILED;
    page = text != MAP_FAILED && memmem(text, (size_t)st.st_size, MARK, strlen(MARK));
    if (text != MAP_FAILED) munmap(text, (size_t)st.st_size);
    if (f) fclose(f);
    return page;
}

void bt_folder_warn_pages(const char *dir)
{
    struct dirent **list = NULL;
    const int n = scandir(dir, &list, NULL, alphasort);
    bt_text text;
    bt_text_begin(&text);
    int pages = 0;
    for (int k = 0; k < n; k++) {
        if (is_page(BT_PATH(dir, list[k]->d_name))) fprintf(text.out, "%s%s", pages++ ? ", " : "", list[k]->d_name);
        free(list[k]);
    }
    free(list);
    char *names = bt_text_end(&text);
    if (pages) bt_errors_warn("warning: %s: %s: of an earlier result than the one here; make %s again", dir, names,
                              pages > 1 ? "them" : "it");
    free(names);
}

bt_status bt_folder_may_take(const char *dir, const char *remedy, bt_errors *err)
{
    if (bt_file_there(dir, BT_FOLDER_STUDY))
        return bt_fail(err, BT_ERR_IO, "%s: holds an ensemble; give the run another folder", dir);
    const bool finished = bt_file_there(dir, "summary.json"), begun = has_begun(dir);
    const bt_status foreign = bt_folder_check(dir, err);
    if (foreign != BT_OK || !remedy || (!finished && !begun && !bt_file_there(dir, "result.h5"))) return foreign;
    if (finished || !begun) return bt_fail(err, BT_ERR_IO, "%s: holds a result; %s", dir, remedy);
    return bt_fail(err, BT_ERR_IO, "%s: holds an unfinished run; continue it with `bergtow resume %s`, %s", dir, dir,
                   remedy);
}
