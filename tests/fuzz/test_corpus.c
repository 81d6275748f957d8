// SPDX-License-Identifier: MIT
// Every kept input through its harness: those that reach most of the readers, and those that once broke something.
#include <dirent.h>

#include "test.h"
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

TEST(case_files) { replay("case", bt_fuzz_case, 1); }
TEST(worlds_of_cases) { replay("setup", bt_fuzz_setup, 1); }
TEST(keys_within_their_ranges) { replay("values", bt_fuzz_values, 1); }
TEST(study_files) { replay("study", bt_fuzz_study, 1); }
TEST(tables) { replay("table", bt_fuzz_table, 1); }
TEST(outline_files) { replay("outlines", bt_fuzz_outlines, 1); }
TEST(field_files) { replay("field", bt_fuzz_field, 1); }
TEST(checkpoints) { replay("checkpoint", bt_fuzz_checkpoint, 1); }

TEST_MAIN(NULL, NULL)
