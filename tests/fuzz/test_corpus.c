// SPDX-License-Identifier: MIT
// Every kept input through its harness: those that reach most of the readers, and those that once broke something.
#include <dirent.h>

#include "test.h"
#include "base/fileio.h"
#include "fuzz.h"

/// Run every input of a folder; their number, 0 without the folder.
static int replay_folder(const char *folder, void (*harness)(const uint8_t *, size_t))
{
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
    return done;
}

static void replay(const char *name, void (*harness)(const uint8_t *, size_t))
{
    char named[64], unpacked[64];
    snprintf(named, sizeof named, "tests/fuzz/corpus/%s", name);
    snprintf(unpacked, sizeof unpacked, "build/corpus/%s", name);
    replay_folder(named, harness);
    const int done = replay_folder(unpacked, harness);
    if (done < 50)
        fail_msg("%s: %d inputs of tests/fuzz/corpus/%s.tar.gz; run make build/corpus, and start this from the root of "
                 "the project",
                 unpacked, done, name);
}

TEST(case_files) { replay("case", bt_fuzz_case); }
TEST(worlds_of_cases) { replay("setup", bt_fuzz_setup); }
TEST(keys_within_their_ranges) { replay("values", bt_fuzz_values); }
TEST(study_files) { replay("study", bt_fuzz_study); }
TEST(tables) { replay("table", bt_fuzz_table); }
TEST(outline_files) { replay("outlines", bt_fuzz_outlines); }
TEST(field_files) { replay("field", bt_fuzz_field); }
TEST(checkpoints) { replay("checkpoint", bt_fuzz_checkpoint); }

TEST_MAIN(NULL, NULL)
