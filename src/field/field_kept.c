// SPDX-License-Identifier: MIT
// Fields kept for other runs; design in field_kept.h.
//
//     head: magic, digest of everything after it, name (the digest of the case), numbers of the field
//     its arrays, in the order of bt_field_arrays
#include "field/field_kept.h"

#include <dirent.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/fileio.h"
#include "base/largest.h"
#include "bergtow/shape.h"
#include "base/h5dataset.h"
#include "case/case_files.h"
#include "case/schema.h"
#include "field/field_make.h"

#define MAGIC "bergtow kept field 3\n"

/// Keys of these sections that do not affect the ice field, generated or read.
static const char *const idle[] = {
    "ice.added_mass", "ice.added_inertia", "ice.crushing.", "ice.density", "ice.drag.", "ice.friction", "ice.rafting.",
    "ice.restitution", "ice.splitting.", "ice.start", "domain.wall_", "body.added_", "body.density", "body.draft",
    "body.drag.", "body.friction", "body.mass", "body.restitution", "body.sail", "body.vx", "body.vy",
    "body.yaw_rate"};
static const char *const sections[] = {"ice.", "domain.", "body."};

static bool begins(const char *name, const char *const *with, size_t n)
{
    for (size_t k = 0; k < n; k++)
        if (!strncmp(name, with[k], strlen(with[k]))) return true;
    return false;
}

#define BEGINS(name, with) begins(name, with, sizeof with / sizeof *with)

static void write_keys(FILE *out, const bt_key *keys, int n, const void *base)
{
    for (int k = 0; k < n; k++) {
        fprintf(out, "%s: ", keys[k].name);
        bt_value_write(&keys[k], base, out);
        fputc('\n', out);
    }
}

void bt_field_digest(const bt_case *input, char digest[BT_CHECKSUM_DIGEST])
{
    bt_text t;
    bt_text_begin(&t);
    fprintf(t.out, "bergtow %s %s\n", BT_VERSION, bt_provenance_revision());
    for (int k = 0; k < bt_n_case_keys - bt_schema_added(); k++) {
        const bt_key *key = &bt_case_keys[k];
        if (!BEGINS(key->name, sections) || BEGINS(key->name, idle)) continue;
        write_keys(t.out, key, 1, input);
        const char *path = bt_case_file(input, key);
        int64_t bytes; // the reader of the file reports its errors
        if (path && bt_checksum_digest_file(path, digest, &bytes, NULL) == BT_OK) fprintf(t.out, "%s\n", digest);
    }
    for (bt_idx i = 0; i < input->n_floes; i++) write_keys(t.out, bt_floe_keys, bt_n_floe_keys, &input->floes[i]);
    double v[2 * BT_MAX_VERTICES]; // keys only name a shape that a program adds
    const int n = bt_case_waterline(input, v);
    for (int k = 0; k < 2 * n; k++) fprintf(t.out, "%a\n", v[k]);
    char *text = bt_text_end(&t);
    bt_checksum_digest_text(text, strlen(text), digest);
    free(text);
}

typedef struct head {
    char magic[32], digest[BT_CHECKSUM_DIGEST], name[BT_CHECKSUM_DIGEST];
    bt_field field; ///< its numbers
} head;

static const size_t sealed = offsetof(head, name); ///< the digest covers everything from here on

/// A field as the bytes of a file; the caller frees them.
static char *packed(const bt_field *field, const char *name, size_t *size)
{
    bt_field_array p[BT_FIELD_ARRAYS];
    bt_field_arrays(field, field->offsets[field->n], p);
    *size = sizeof(head);
    for (int k = 0; k < BT_FIELD_ARRAYS; k++) *size += p[k].bytes;
    char *bytes = bt_alloc(*size, 1), *to = bytes + sizeof(head);
    head *h = (head *)bytes; // zeros, its padding, too: the digest covers it
    memcpy(h->magic, MAGIC, sizeof MAGIC);
    memcpy(h->name, name, sizeof h->name);
    h->field = bt_field_numbers(field);
    for (int k = 0; k < BT_FIELD_ARRAYS; to += p[k++].bytes)
        if (p[k].bytes > 0) memcpy(to, p[k].at, p[k].bytes);
    bt_checksum_digest_text(bytes + sealed, *size - sealed, h->digest);
    return bytes;
}

/// The field from the bytes of a file; false unless they are those of a complete file of this name.
static bool unpacked(bt_field *field, const char *name, const char *bytes, size_t size)
{
    head h;
    char digest[BT_CHECKSUM_DIGEST];
    if (size < sizeof h) return false;
    memcpy(&h, bytes, sizeof h);
    bt_checksum_digest_text(bytes + sealed, size - sealed, digest);
    if (memcmp(h.magic, MAGIC, sizeof MAGIC) || memcmp(h.digest, digest, sizeof digest) ||
        memcmp(h.name, name, sizeof h.name) || h.field.n < 0 || h.field.n > BT_MAX_FLOES || h.field.cap_vertices < 0 ||
        h.field.cap_vertices > BT_MAX_FLOES * (int64_t)BT_MAX_VERTICES)
        return false;
    bt_field_room(field, &h.field);
    bt_field_array p[BT_FIELD_ARRAYS];
    bt_field_arrays(field, h.field.cap_vertices, p);
    const char *from = bytes + sizeof h;
    for (int k = 0; k < BT_FIELD_ARRAYS; from += p[k++].bytes)
        if (p[k].bytes > 0) memcpy(p[k].at, from, p[k].bytes);
    return true;
}

static bool take(const char *path, const char *name, bt_field *field)
{
    if (access(path, F_OK) != 0) return false;
    char *bytes = NULL;
    size_t size;
    const bool whole = bt_file_read_to(path, "a kept field", SIZE_MAX / 2, &bytes, &size, NULL) == BT_OK &&
                       unpacked(field, name, bytes, size);
    free(bytes);
    if (!whole)
        bt_errors_warn("warning: %s: is damaged, or not a field of this program; the field is made again", path);
    return whole;
}

/// Write under a name of this process, then rename. No fsync: a file that is not complete is made again.
static void keep(const char *path, const char *name, const bt_field *field)
{
    size_t size;
    char *bytes = packed(field, name, &size), *part = bt_text_of("%s.%ld.part", path, (long)getpid());
    const int fd = bt_file_descriptor(part, O_WRONLY | O_CREAT | O_TRUNC | O_NOFOLLOW);
    const bool written = fd >= 0 && bt_file_put(fd, 0, bytes, size) == 0;
    if (fd >= 0 && (bt_file_close(fd) != 0 || !written || rename(part, path) != 0)) unlink(part);
    free(part);
    free(bytes);
}

bt_status bt_field_load_kept(const char *dir, const bt_case *input, bt_field *field, bt_errors *err)
{
    if (!dir) return bt_field_load(input, field, err);
    char name[BT_CHECKSUM_DIGEST];
    bt_field_digest(input, name); // before loading: if a file of the ice changes later, its digest differs
    const char *path = BT_PATH(dir, name);
    const bool room = bt_file_make_dir(dir, NULL) == BT_OK;
    bt_status status = BT_OK;
    if (!room || !take(path, name, field)) {
        status = bt_field_load(input, field, err);
        if (status == BT_OK && room) keep(path, name, field);
    }
    return status;
}

void bt_field_forget_kept(const char *dir)
{
    DIR *d = opendir(dir);
    for (const struct dirent *entry; d && (entry = readdir(d));) {
        const char *name = entry->d_name;
        const size_t digits = strspn(name, "0123456789abcdef");
        if (digits != BT_CHECKSUM_DIGEST - 1 || (name[digits] && name[digits] != '.')) continue;
        unlink(BT_PATH(dir, name));
    }
    if (d) closedir(d);
    rmdir(dir);
}
