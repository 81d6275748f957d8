// SPDX-License-Identifier: MIT
// Checks of a contact law that is to be added; bergtow/contact.h.
#include <stdio.h>
#include <string.h>

#include "base/name.h"
#include "base/inside.h"
#include "contact/added.h"

static bool is_known(const char *name)
{
    for (int law = 0; law < BT_LAWS; law++)
        if (!strcmp(bt_laws[law]->name, name)) return true;
    for (int k = 0; k < bt_n_contact_laws(); k++)
        if (!strcmp(bt_contact_law_of(k)->name, name)) return true;
    return false;
}

static void check_numbers(const bt_contact_law *law, const char *name, bt_errors *err)
{
    if (law->n_numbers < 0 || law->n_numbers > BT_MAX_CONTACT_NUMBERS)
        bt_errors_add(err, "contact law %s: it has %d numbers, at most %d fit", name, law->n_numbers,
                      BT_MAX_CONTACT_NUMBERS);
    else
        for (int k = 0; k < law->n_numbers; k++)
            if (law->numbers[k].state ? !law->count : !law->remember)
                bt_errors_add(err, "contact law %s: nothing adds to its number %s; give it `%s`", name,
                              law->numbers[k].name, law->numbers[k].state ? "count" : "remember");
}

/// Has number k of the law the name of its work, or of an earlier number?
static bool is_named_before(const bt_contact_law *law, int k, const char *work)
{
    const char *name = law->numbers[k].name;
    bool found = !strcmp(name, work);
    for (int j = 0; j < k; j++) found = found || !strcmp(name, law->numbers[j].name);
    return found;
}

/// Check the series of the law: its work and its numbers.
static void check_series(const bt_contact_law *law, const char *name, bt_errors *err)
{
    char work[BT_MAX_LAW_NAME + sizeof "_work"];
    snprintf(work, sizeof work, "%.*s_work", BT_MAX_LAW_NAME, name);
    if (!bt_series_may_be || !bt_series_may_be(work, 1 + law->n_numbers, err)) return;
    for (int k = 0; k < law->n_numbers; k++) {
        const bt_contact_number *number = &law->numbers[k];
        if (!number->name || !number->units || !*number->units || !number->description ||
            strlen(number->description) < 8)
            bt_errors_add(err, "contact law %s: its number %d needs name, units (\"1\" for a plain number) and a "
                          "description", name, k + 1);
        else if (is_named_before(law, k, work))
            bt_errors_add(err, "contact law %s: two of its series are named %s; rename one number", name, number->name);
        else bt_series_may_be(number->name, 1, err);
    }
}

bt_status bt_contact_register(const bt_contact_law *law, bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    const size_t before = err->n;
    const char *name = law->name ? law->name : "";
    bt_name_check("contact law", name, BT_MAX_LAW_NAME, is_known(name), err);
    if (!law->on || !law->bound) bt_errors_add(err, "contact law %s: it needs the functions `on` and `bound`", name);
    if (!law->doc || strlen(law->doc) < 8) bt_errors_add(err, "contact law %s: describe it in one line (`doc`)", name);
    if (law->n_keys < 0 || law->n_keys > BT_MAX_CONTACT_OWN)
        bt_errors_add(err, "contact law %s: it has %d keys, at most %d fit", name, law->n_keys, BT_MAX_CONTACT_OWN);
    check_numbers(law, name, err);
    if (bt_n_contact_laws() == BT_MAX_ADDED_LAWS)
        bt_errors_add(err, "contact law %s: there are %d added laws; raise BT_MAX_ADDED_LAWS", name,
                      BT_MAX_ADDED_LAWS);
    if (err->n == before) check_series(law, name, err);
    if (err->n > before || !bt_keys_add(name, law->keys, law->n_keys, err)) return BT_ERR_USAGE;
    bt_added_add(law); // there is room: checked above
    return BT_OK;
}
