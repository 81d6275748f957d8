// SPDX-License-Identifier: MIT
// Every kept input through its harness: those that reach most of the readers, and those that once broke something.
#include <dirent.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
// cmocka.h wants the five above first
#include <cmocka.h>

#include "base/fileio.h"
#include "fuzz.h"

static void replay(const char *name, void (*harness)(const uint8_t *, size_t), int least)
{
    char folder[64];
    snprintf(folder, sizeof folder, "tests/fuzz/corpus/%s", name);
    struct dirent **entry;
    const int n = scandir(folder, &entry, NULL, alphasort);
    int done = 0;
    for (int i = 0; i < n; i++) {
        if (entry[i]->d_name[0] != '.') {
            char *path = bt_file_join(folder, entry[i]->d_name), *text;
            size_t size;
            bt_errors err = {0};
            assert_int_equal(bt_file_read(path, "an input", &text, &size, &err), BT_OK);
            fprintf(stderr, "%s\n", path); // the last one named is the one that aborts
            harness((const uint8_t *)text, size);
            free(text);
            free(path);
            done++;
        }
        free(entry[i]);
    }
    if (n >= 0) free(entry);
    if (done < least)
        fail_msg("%s: %d inputs, at least %d are kept; start this from the root of the project", folder, done, least);
}

static void case_files(void **state) { (void)state; replay("case", bt_fuzz_case, 1); }
static void worlds_of_cases(void **state) { (void)state; replay("setup", bt_fuzz_setup, 1); }
static void keys_within_their_ranges(void **state) { (void)state; replay("values", bt_fuzz_values, 1); }
static void study_files(void **state) { (void)state; replay("study", bt_fuzz_study, 1); }
static void tables(void **state) { (void)state; replay("table", bt_fuzz_table, 1); }
static void outline_files(void **state) { (void)state; replay("outlines", bt_fuzz_outlines, 1); }
static void field_files(void **state) { (void)state; replay("field", bt_fuzz_field, 1); }
static void checkpoints(void **state) { (void)state; replay("checkpoint", bt_fuzz_checkpoint, 1); }

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(case_files),    cmocka_unit_test(worlds_of_cases), cmocka_unit_test(study_files),
        cmocka_unit_test(keys_within_their_ranges),
        cmocka_unit_test(tables),        cmocka_unit_test(outline_files),   cmocka_unit_test(field_files),
        cmocka_unit_test(checkpoints),
    };
    return cmocka_run_group_tests_name("corpus", tests, NULL, NULL);
}
