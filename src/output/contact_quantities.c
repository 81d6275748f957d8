// SPDX-License-Identifier: MIT
// Quantities of contact laws; see contact_quantities.h.
#include "output/contact_quantities.h"

#include <stdio.h>
#include <stdlib.h>

#include "bergtow/contact.h"
#include "bergtow/quantity.h"
#include "contact/law.h"
#include "output/record.h"

static bt_quantity own[BT_MAX_LAW_NUMBERS];

static double own_number(const bt_world *w, const void *quantity)
{
    return w->stats.laws[(const bt_quantity *)quantity - own];
}

int bt_n_law_series(void)
{
    static int n; // asked for every quantity of every step
    if (n == 0) n = bt_law_first_number(BT_LAWS);
    return n;
}

const bt_quantity *bt_law_series(int k)
{
    for (int law = 0, i = 0; !own[k].name && law < BT_LAWS; law++)
        for (int j = 0; j < bt_laws[law]->n_numbers; j++, i++) {
            const bt_law_number *n = &bt_laws[law]->numbers[j];
            own[i] = (bt_quantity){.name = n->name, .units = n->units, .description = n->description, .keep = n->keep,
                                   .applies = BT_APPLIES_ALWAYS, .summary = n->key, .of_world = own_number,
                                   .context = &own[i],
                                   .offset = offsetof(bt_sample, laws) + (size_t)i * sizeof(double)};
        }
    return &own[k];
}

static double number(const bt_world *w, const void *place)
{
    return ((const double *)w->stats.added)[*(const int *)place];
}

/// Its texts stay for the life of the program, as the law does.
static void add_quantity(const bt_quantity *like, int law, int k)
{
    static int place[BT_MAX_ADDED_LAWS][1 + BT_MAX_CONTACT_NUMBERS];
    place[law][k] = law * (1 + BT_MAX_CONTACT_NUMBERS) + k;
    bt_errors err = {0};
    bt_quantity q = *like;
    q.applies = BT_APPLIES_ALWAYS, q.role = BT_ROLE_NONE, q.of_world = number, q.context = &place[law][k];
    if (bt_quantity_register(&q, &err) != BT_OK) bt_errors_print(&err);
    bt_errors_free(&err);
}

static void add_law(int law)
{
    const bt_contact_law *l = bt_contact_law_of(law);
    char *name = bt_text_of("%s_work", l->name),
         *text = bt_text_of("work taken by contact points at their bound: %s", l->doc);
    add_quantity(&(bt_quantity){.name = name, .units = "J", .description = text, .keep = BT_KEEP_SUM}, law, 0);
    for (int k = 0; k < l->n_numbers; k++) {
        const bt_contact_number *n = &l->numbers[k];
        add_quantity(&(bt_quantity){.name = n->name, .units = n->units, .description = n->description,
                                    .keep = n->state ? BT_KEEP_LAST : BT_KEEP_SUM}, law, 1 + k);
    }
}

void bt_contact_quantities(void)
{
    static int known;
    for (; known < bt_n_contact_laws(); known++) add_law(known);
}
