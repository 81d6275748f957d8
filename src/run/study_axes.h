// SPDX-License-Identifier: MIT
// What a study gives to some of its members alone: keys of parameters, of variants, and of `with`.
#ifndef BT_STUDY_AXES_H
#define BT_STUDY_AXES_H

#include "bergtow/study.h"

/// A key that some members get. The texts are the study's.
typedef struct {
    const char *text;    ///< the key, or "key=value"
    int length;          ///< of the key
    const char *at;      ///< where it stands, "FILE:LINE: "
    const char *section; ///< parameters, variants or with
    int axis;            ///< the parameter that decides who gets it
} bt_study_setting;

/// All of them, those of parameters first; the caller frees the list.
bt_study_setting *bt_study_settings(const bt_study *s, int *n);

/// The section in which a key is given to some members alone, NULL = none.
const char *bt_study_varied(const bt_study *s, const char *key);

/// A member has one value of a key: an error for each key that two parameters decide, of which the study would run one
/// and record the other.
void bt_study_check_axes(const bt_study *s, bt_errors *err);

/// Errors for what makes members that are the same run: more than one field where no condition has ice that depends on
/// the seed, and keys of how ice is made where all conditions read theirs. Reads conditions until one has neither; what
/// is wrong with a case is not said here.
void bt_study_check_ice(const bt_study *s, bt_errors *err);

#endif
