// SPDX-License-Identifier: MIT
// Helpers for tests that write case files to a temporary folder, read them and check the error messages.
#ifndef BT_CASE_TEXT_H
#define BT_CASE_TEXT_H

#include <unistd.h>

#include "test.h"
#include "bergtow/case.h"

static char folder[] = "/tmp/bt_test_case_XXXXXX";
static char path[64];

static inline int make_folder(void **state)
{
    (void)state;
    if (!mkdtemp(folder)) return -1;
    snprintf(path, sizeof path, "%s/a.yml", folder);
    return 0;
}

static inline int remove_folder(void **state)
{
    (void)state;
    remove(path);
    return rmdir(folder);
}

static inline void write_bytes(const char *text, size_t n)
{
    FILE *f = fopen(path, "wb");
    assert_non_null(f);
    assert_int_equal(fwrite(text, 1, n, f), n);
    assert_int_equal(fclose(f), 0);
}

static inline bt_status read_text_with(bt_case *c, const char *text, const char *const *set, int n, bt_errors *err)
{
    write_bytes(text, strlen(text));
    return bt_case_read(c, path, set, n, err);
}

static inline bt_status read_text(bt_case *c, const char *text, bt_errors *err)
{
    return read_text_with(c, text, NULL, 0, err);
}

static inline void fail_with(const bt_errors *err, const char *what)
{
    for (size_t i = 0; i < err->n; i++) print_message("  message: %s\n", err->text[i]);
    fail_msg("%s", what);
}

static inline bool has(const bt_errors *err, const char *fragment)
{
    for (size_t i = 0; i < err->n; i++)
        if (strstr(err->text[i], fragment)) return true;
    return false;
}

static const char base[] = "run: {dt: 0.1, duration: 10}\n";

#endif
