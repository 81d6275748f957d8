// SPDX-License-Identifier: MIT
// Shared by the harnesses.
#include "fuzz.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

void bt_fuzz_check(bool good, const char *text)
{
    if (good) return;
    fprintf(stderr, "broken promise: %s\n", text);
    abort();
}

bt_fuzz_file bt_fuzz_open(const uint8_t *data, size_t n)
{
    bt_fuzz_file f = {.fd = memfd_create("input", MFD_CLOEXEC)};
    bt_fuzz_check(f.fd >= 0, "memfd_create failed");
    for (size_t done = 0; done < n;) {
        const ssize_t wrote = write(f.fd, data + done, n - done);
        bt_fuzz_check(wrote > 0, "the input cannot be written to memory");
        done += (size_t)wrote;
    }
    snprintf(f.path, sizeof f.path, "/proc/self/fd/%d", f.fd);
    return f;
}

void bt_fuzz_close(bt_fuzz_file *f) { close(f->fd); }

void bt_fuzz_reported(bt_status status, bt_errors *err)
{
    bt_fuzz_check((status == BT_OK) == (err->n == 0), "status and messages do not agree");
    for (size_t i = 0; i < err->n; i++) {
        const unsigned char *s = (const unsigned char *)err->text[i];
        bt_fuzz_check(*s && strlen(err->text[i]) < 8000, "a message is empty or endless");
        for (; *s; s++) bt_fuzz_check(*s >= 0x20 && *s != 0x7F, "a message holds a control character");
    }
    bt_errors_free(err);
}
