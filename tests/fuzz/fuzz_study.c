// SPDX-License-Identifier: MIT
// Any bytes as a study file, and the members of what is accepted. The base case is not read.
#include <string.h>

#include "bergtow/study.h"
#include "fuzz.h"

static void check_member(const bt_study *s, int64_t m)
{
    bt_member member;
    bt_study_member(s, m, &member);
    bt_fuzz_check(!strchr(member.name, '/') && !strchr(member.name, '.'), "the folder of a member leads elsewhere");
    for (int i = 0; i < member.n_set; i++)
        bt_fuzz_check(strchr(member.set[i], '=') != NULL, "an override is not key=value");
    bt_fuzz_check(member.seed >= 0, "a seed is out of range");
    bt_member_free(&member);
}

void bt_fuzz_study(const uint8_t *data, size_t n)
{
    bt_fuzz_file f = bt_fuzz_open(data, n);
    bt_study s;
    bt_errors err = {0};
    const bt_status status = bt_study_read(&s, f.path, &err);
    bt_fuzz_reported(status, &err);
    const int64_t members = status == BT_OK ? bt_study_n_members(&s) : 0;
    bt_fuzz_check(status != BT_OK || (members > 0 && members <= BT_MAX_MEMBERS), "a study of no or too many members");
    for (int64_t m = 0; m < members && m < 5; m++) check_member(&s, m);
    if (members > 5) check_member(&s, members - 1);
    bt_study_free(&s);
    bt_fuzz_close(&f);
}
