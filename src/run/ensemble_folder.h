// SPDX-License-Identifier: MIT
// The folder of an ensemble: which study it holds, and the files that this is made of.
#ifndef BERGTOW_ENSEMBLE_FOLDER_H
#define BERGTOW_ENSEMBLE_FOLDER_H

#include "bergtow/ensemble.h"
#include "run/ensemble_record.h"

/// Make the folder with its resolved study and the files that the study names. BT_ERR_CASE: it is of another study, or
/// a file has changed. digest: of the resolved study that the folder keeps. By one process of a call.
bt_status bt_ensemble_prepare_folder(const bt_study *s, const bt_ensemble_options *o, char digest[BT_DIGEST_TEXT],
                                     bt_errors *err);

#endif
