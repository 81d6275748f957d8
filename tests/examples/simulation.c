// SPDX-License-Identifier: MIT
// Example of a program that steps a simulation: the force law of force_law.c, a case file, and what the tow is like on
// the way.
//
//     cc simulation.c $(pkg-config --cflags --libs bergtow) -lm -o simulation
//     ./simulation CASE.yml [KEY=VALUE...]
#include "bergtow/simulation.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "force_law.c"

static int fail(void)
{
    fprintf(stderr, "%s\n", bt_last_error());
    return EXIT_FAILURE;
}

/// Contacts of the last step that bear a load.
static int64_t pushing(const bt_simulation *s)
{
    const int64_t n = bt_simulation_contacts(s, NULL, 0);
    double(*row)[BT_CONTACT_COLUMNS] = calloc(n ? (size_t)n : 1, sizeof *row);
    int64_t found = 0;
    bt_simulation_contacts(s, *row, n);
    for (int64_t k = 0; k < n; k++) found += row[k][BT_CONTACT_NORMAL_1] > 0 || row[k][BT_CONTACT_NORMAL_2] > 0;
    free(row);
    return found;
}

int main(int argc, char **argv)
{
    bt_errors err = {0};
    bt_simulation *s;
    if (argc < 2 || bt_force_register(&wave_drift_law, &err) != BT_OK) {
        bt_errors_print(&err);
        return EXIT_FAILURE;
    }
    const bt_simulation_options o = {
        .path = argv[1], .set = (const char *const *)argv + 2, .n_set = argc - 2, .threads = 1};
    if (bt_simulation_create(&s, &o) != BT_OK) return fail();
    while (bt_simulation_steps_left(s) > 0) {
        double ice, waves;
        if (bt_simulation_step(s, 50) != BT_OK || bt_simulation_quantity(s, "ice_resistance", &ice) != BT_OK ||
            bt_simulation_quantity(s, "wave_drift_force", &waves) != BT_OK)
            return fail();
        printf("%6.1f s  ice %10.3g N  waves %10.3g N  %" PRId64 " contacts\n", bt_simulation_time(s), ice, waves,
               pushing(s));
    }
    printf("state_hash %016" PRIx64 "\n", bt_simulation_hash(s));
    return bt_simulation_end(s) == BT_OK ? EXIT_SUCCESS : fail();
}
