// SPDX-License-Identifier: MIT
// All quantities: the program's own table (series.inc), then the registered ones, with those of force and contact laws:
// their tables may grow, and are read before quantities are counted.
#include "bergtow/quantity.h"

#include <ctype.h>
#include <string.h>

#include "bergtow/contact.h"
#include "bergtow/forces.h"
#include "base/inside.h"
#include "base/name.h"
#include "contact/law.h"
#include "output/sample.h"

// --- registered quantities -------------------------------------------------------------------------------------------

const char *const bt_keep_names[BT_KEEP_KINDS] = {"last", "mean", "max", "sum"};
const char *const bt_role_names[BT_ROLE_KINDS] = {"", "balance", "force", "load", "diagnostic"};
const char *const bt_applies_codes[BT_APPLIES_KINDS] = {
    [BT_APPLIES_ALWAYS] = "always", [BT_APPLIES_BODY] = "body",       [BT_APPLIES_LINE] = "line",
    [BT_APPLIES_BRIDLE] = "bridle", [BT_APPLIES_VESSEL] = "vessel",   [BT_APPLIES_IMPACTS] = "impacts",
    [BT_APPLIES_WINDOW] = "moving",
};
const char *const bt_applies_names[BT_APPLIES_KINDS] = {
    [BT_APPLIES_ALWAYS] = "always",
    [BT_APPLIES_BODY] = "with a towed body",
    [BT_APPLIES_LINE] = "with a tow line",
    [BT_APPLIES_BRIDLE] = "with a tow line of two branches",
    [BT_APPLIES_VESSEL] = "with a vessel",
    [BT_APPLIES_IMPACTS] = "where collisions are identified",
    [BT_APPLIES_WINDOW] = "with a moving window",
};

enum { MAX_NAME = 48, MAX_KEY = 80 }; // a force law may have 40 letters; with _force 46
static bt_quantity added[BT_MAX_ADDED];
static char added_keys[BT_MAX_ADDED][MAX_KEY];
static int n_added;

static bool is_taken(const char *name)
{
    for (int k = 0; k < bt_n_own_series; k++)
        if (!strcmp(bt_own_series[k].name, name)) return true;
    for (int law = 0; law < BT_LAWS; law++)
        for (int k = 0; k < bt_laws[law]->n_numbers; k++)
            if (!strcmp(bt_laws[law]->numbers[k].name, name)) return true;
    for (int k = 0; k < n_added; k++)
        if (!strcmp(added[k].name, name)) return true;
    return false;
}

/// Key mean_NAME_n for a mean in N, with the suffix for units of the other keys of summary.json.
static void make_key(const bt_quantity *quantity, char key[MAX_KEY])
{
    int n = snprintf(key, MAX_KEY, "%s_%s", bt_keep_names[quantity->keep], quantity->name);
    if (!strcmp(quantity->units, "1")) return;
    if (n + 1 < MAX_KEY) key[n++] = '_';
    for (const char *u = quantity->units; *u && n + 1 < MAX_KEY; u++)
        key[n++] = isalnum((unsigned char)*u) ? (char)tolower((unsigned char)*u) : '_';
    key[n] = '\0';
}

/// A name without underscores; kept to the end of the program, like all texts of a quantity.
static char *in_words(const char *name)
{
    char *words = bt_text_copy(name);
    for (char *p = words; *p; p++)
        if (*p == '_') *p = ' ';
    return words;
}

/// Report in err why there cannot be a series of this name, or `more` of them.
static void registry_check(const char *name, int more, bt_errors *err)
{
    bt_name_check("quantity", name, MAX_NAME, is_taken(name), err);
    if (n_added + more > BT_MAX_ADDED)
        bt_errors_add(err, "quantity %s: a program can add at most %d, and all are in use; use the name of a force "
                      "whose simulation has ended, or raise BT_MAX_ADDED", name, BT_MAX_ADDED);
}

static bt_status add_series(const bt_quantity *quantity, bt_errors *err)
{
    const size_t before = err->n;
    const char *name = quantity->name ? quantity->name : "";
    registry_check(name, 1, err);
    if (!quantity->units || !*quantity->units)
        bt_errors_add(err, "quantity %s: it has no units; give \"1\" for a plain number", name);
    if (!quantity->description || strlen(quantity->description) < 8)
        bt_errors_add(err, "quantity %s: describe it in one sentence (`description`)", name);
    if (!quantity->of_world == !quantity->of_floe)
        bt_errors_add(err, "quantity %s: give it one of `of_world` and `of_floe`", name);
    if ((unsigned)quantity->keep >= BT_KEEP_KINDS || (unsigned)quantity->applies >= BT_APPLIES_KINDS ||
        (unsigned)quantity->role >= BT_ROLE_KINDS)
        bt_errors_add(err, "quantity %s: `keep`, `applies` or `role` has an unknown value", name);
    if (err->n > before) return BT_ERR_USAGE;
    bt_quantity *own = &added[n_added];
    *own = *quantity;
    make_key(quantity, added_keys[n_added]);
    own->summary = added_keys[n_added];
    if (!own->label) own->label = in_words(own->name);
    own->offset = offsetof(bt_sample, added) + (size_t)n_added * sizeof(double);
    n_added++;
    return BT_OK;
}

bt_status bt_quantity_register(const bt_quantity *quantity, bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    bt_n_added(); // series of laws registered before, which are made when first needed, have their names
    return add_series(quantity, err);
}

// --- of force laws ---------------------------------------------------------------------------------------------------

/// Is its force one of the program's own series?
static bool has_series(const bt_force_series *of)
{
    for (int k = 0; k < bt_n_own_series; k++)
        if (bt_own_series[k].of_world == bt_force_of && !strcmp(bt_own_series[k].context, of->name)) return true;
    return false;
}

/// Add the quantity of a law. Its texts stay for the life of the program, like the law.
static void add_quantity(const bt_force_series *of)
{
    bt_errors err = {0};
    char *name = bt_text_of("%s_force", of->name),
         *text = bt_text_of("%s on the towed body against the tow direction", of->law ? of->law->doc : of->name);
    const bt_quantity quantity = {.name = name, .units = "N", .description = text, .label = of->name,
                                  .keep = BT_KEEP_MEAN, .applies = BT_APPLIES_BODY, .role = BT_ROLE_BALANCE,
                                  .of_world = bt_force_of, .context = of->name};
    if (add_series(&quantity, &err) != BT_OK) bt_errors_print(&err);
    bt_errors_free(&err);
}

/// Register, once, a quantity for each series of the table of force laws that is not one of the program's own.
static void force_quantities(void)
{
    static int known; // series of the table processed so far
    for (; known < bt_n_force_series; known++) {
        const bt_force_series *of = &bt_force_series_of[known];
        if (!of->part && !has_series(of)) add_quantity(of);
    }
}

// --- of contact laws -------------------------------------------------------------------------------------------------

static bt_quantity own[BT_MAX_LAW_NUMBERS];

static double own_number(const bt_world *world, const void *quantity)
{
    return world->stats.laws[(const bt_quantity *)quantity - own];
}

/// Number of series of the program's own contact laws.
static int n_law_series(void)
{
    static int n; // cached: needed for every quantity of every step
    if (n == 0) n = bt_law_first_number(BT_LAWS);
    return n;
}

static const bt_quantity *law_series(int k)
{
    for (int law = 0, i = 0; !own[k].name && law < BT_LAWS; law++)
        for (int j = 0; j < bt_laws[law]->n_numbers; j++, i++) {
            const bt_law_number *number = &bt_laws[law]->numbers[j];
            own[i] = (bt_quantity){.name = number->name, .units = number->units, .description = number->description,
                                   .keep = number->keep, .applies = BT_APPLIES_ALWAYS, .summary = number->key,
                                   .of_world = own_number, .context = &own[i],
                                   .offset = offsetof(bt_sample, laws) + (size_t)i * sizeof(double)};
        }
    return &own[k];
}

static double number(const bt_world *world, const void *place)
{
    return ((const double *)world->stats.added)[*(const int *)place];
}

/// Add the quantity of a law. Its texts stay for the life of the program, like the law.
static void add_number(const bt_quantity *like, int law, int k)
{
    static int place[BT_MAX_ADDED_LAWS][1 + BT_MAX_CONTACT_NUMBERS];
    place[law][k] = law * (1 + BT_MAX_CONTACT_NUMBERS) + k;
    bt_errors err = {0};
    bt_quantity quantity = *like;
    quantity.applies = BT_APPLIES_ALWAYS, quantity.role = BT_ROLE_NONE, quantity.of_world = number,
    quantity.context = &place[law][k];
    if (add_series(&quantity, &err) != BT_OK) bt_errors_print(&err);
    bt_errors_free(&err);
}

static void add_law(int law)
{
    const bt_contact_law *l = bt_contact_law_of(law);
    char *name = bt_text_of("%s_work", l->name),
         *text = bt_text_of("work taken by contact points at their bound: %s", l->doc);
    add_number(&(bt_quantity){.name = name, .units = "J", .description = text, .keep = BT_KEEP_SUM}, law, 0);
    for (int k = 0; k < l->n_numbers; k++) {
        const bt_contact_number *number = &l->numbers[k];
        add_number(&(bt_quantity){.name = number->name, .units = number->units, .description = number->description,
                                  .keep = number->state ? BT_KEEP_LAST : BT_KEEP_SUM}, law, 1 + k);
    }
}

/// Register a quantity for each number of the added laws, once.
static void contact_quantities(void)
{
    static int known;
    for (; known < bt_n_contact_laws(); known++) add_law(known);
}

// --- all of them -----------------------------------------------------------------------------------------------------

int bt_n_program_series(void) { return bt_n_own_series + n_law_series(); }
int bt_n_series(void) { return bt_n_program_series() + bt_n_added(); }

const bt_quantity *bt_series(int k)
{
    const int before = bt_n_own_series - BT_SERIES_AFTER_LAWS, laws = n_law_series();
    if (k < before) return &bt_own_series[k];
    if (k < before + laws) return law_series(k - before);
    return k < bt_n_program_series() ? &bt_own_series[k - laws] : &added[k - bt_n_program_series()];
}

int bt_n_added(void)
{
    force_quantities();
    contact_quantities();
    return n_added;
}

const bt_quantity *bt_added(int k) { return &added[k]; }

/// Check for a law about to be registered; its series are registered when first needed.
static bool may_be(const char *name, int more, bt_errors *err)
{
    const size_t before = err->n;
    bt_n_added(); // register those of earlier laws
    registry_check(name, more, err);
    return err->n == before;
}

__attribute__((constructor(101))) static void begin(void) { bt_series_may_be = may_be; }

const bt_quantity *bt_series_find(const char *name)
{
    for (int k = 0; k < bt_n_series(); k++)
        if (!strcmp(bt_series(k)->name, name)) return bt_series(k);
    return NULL;
}

/// Does the balance name this series itself: at its beginning (tow), as its result (ice), at its end (inertia)?
static bool is_end_of_balance(const bt_quantity *quantity)
{
    return quantity->offset == offsetof(bt_sample, tow_force) ||
           quantity->offset == offsetof(bt_sample, ice_resistance) ||
           quantity->offset == offsetof(bt_sample, inertia_force);
}

const char *bt_balance_words(void)
{
    static char *words;
    free(words);
    bt_text text;
    bt_text_begin(&text);
    fputs("tow", text.out);
    for (int k = 0; k < bt_n_series(); k++)
        if (bt_series(k)->role == BT_ROLE_BALANCE && !is_end_of_balance(bt_series(k)))
            fprintf(text.out, " - %s", bt_series(k)->label);
    fputs(" - inertia", text.out);
    return words = bt_text_end(&text);
}

/// Loads by contacts on the towed body: not numbers in a step without a valid load.
static const size_t loads[] = {
    offsetof(bt_sample, ice_resistance), offsetof(bt_sample, ice_force_x), offsetof(bt_sample, ice_force_y),
    offsetof(bt_sample, ice_moment), offsetof(bt_sample, ice_resistance_budget),
    offsetof(bt_sample, largest_quasi_static_load), offsetof(bt_sample, tow_force), // the last one not on a line
};
enum { N_LOADS = sizeof loads / sizeof *loads };

void bt_sample_lose_load(bt_sample *sample, bool prescribed)
{
    for (int k = 0; k < N_LOADS - !prescribed; k++)
        memcpy((char *)sample + loads[k], &(double){NAN}, sizeof(double));
}

static bool is_load(const bt_quantity *quantity)
{
    bool found = false;
    for (int k = 0; k < N_LOADS; k++) found = found || quantity->offset == loads[k];
    return found;
}

const bt_quantity *bt_sample_fault(const bt_sample *sample, unsigned has)
{
    for (int k = 0, n = bt_n_series(); k < n; k++) {
        const bt_quantity *quantity = bt_series(k);
        const double x = bt_sample_value(sample, quantity);
        if (sample->no_load != 0 && isnan(x) && is_load(quantity)) continue;
        if (sample->locked != 0 && isnan(x) && quantity->offset == offsetof(bt_sample, contact_work)) continue;
        if (has & 1u << quantity->applies ? !(fabs(x) < BT_SAMPLE_MOST) : !isnan(x)) return quantity;
    }
    return NULL;
}
