// SPDX-License-Identifier: MIT
// Harnesses for hostile input: each takes the bytes of one input, lets the program read them, and aborts when a promise
// is broken.
//
// libFuzzer makes the inputs (tests/fuzz/fuzz.sh); tests/fuzz/test_corpus.c runs those that are kept, with any
// compiler.
#ifndef BERGTOW_TESTS_FUZZ_H
#define BERGTOW_TESTS_FUZZ_H

#include <stddef.h>
#include <stdint.h>

#include "bergtow/base.h"

void bt_fuzz_case(const uint8_t *data, size_t n);     ///< case file: read, resolve, read again
void bt_fuzz_setup(const uint8_t *data, size_t n);    ///< case file: field, world, three steps
/// keys set to values within their ranges: field, world, three steps
void bt_fuzz_values(const uint8_t *data, size_t n);
void bt_fuzz_study(const uint8_t *data, size_t n);    ///< study file and its members
void bt_fuzz_table(const uint8_t *data, size_t n);    ///< CSV table
void bt_fuzz_outlines(const uint8_t *data, size_t n); ///< GeoJSON; the first byte chooses how it is read
void bt_fuzz_field(const uint8_t *data, size_t n);    ///< numbers of an HDF5 field file
/// arrays of a checkpoint, past the checksum: resumed, three steps
void bt_fuzz_checkpoint(const uint8_t *data, size_t n);

/// A case file with overrides: field, world, three steps, everything finite.
void bt_fuzz_begin_run(const uint8_t *text, size_t n, const char *const *set, int n_set);

/// An input as a file in memory: its path, and a descriptor to close.
typedef struct {
    int fd;
    char path[32];
} bt_fuzz_file;
bt_fuzz_file bt_fuzz_open(const uint8_t *data, size_t n);
void bt_fuzz_close(bt_fuzz_file *f);

/// Abort unless a status and its messages agree: none with BT_OK, at least one otherwise, each a line of printable
/// text. Clears err.
void bt_fuzz_reported(bt_status status, bt_errors *err);

/// Abort with the text unless good.
void bt_fuzz_check(bool good, const char *text);

#endif
