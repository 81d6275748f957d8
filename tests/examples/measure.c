// SPDX-License-Identifier: MIT
// Example of a program that measures: the quantities of quantity.c, step by step and in the result folder that it
// writes.
//
//     cc measure.c $(pkg-config --cflags --libs bergtow) -lm -o measure
//     ./measure CASE.yml DIR
#include "bergtow/simulation.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "quantity.c"

static int fail(void)
{
    fprintf(stderr, "%s\n", bt_last_error());
    return EXIT_FAILURE;
}

int main(int argc, char **argv)
{
    bt_errors err = {0};
    for (int k = 0; k < N_EXAMPLE_QUANTITIES; k++) bt_quantity_register(&example_quantities[k], &err);
    if (argc != 3 || err.n > 0) {
        bt_errors_print(&err);
        return EXIT_FAILURE;
    }
    bt_simulation *s;
    const bt_simulation_options o = {.path = argv[1], .dir = argv[2], .threads = 1};
    if (bt_simulation_create(&s, &o) != BT_OK) return fail();
    while (bt_simulation_steps_left(s) > 0) {
        double carried, moving;
        if (bt_simulation_step(s, 10) != BT_OK || bt_simulation_quantity(s, "moving_ice", &moving) != BT_OK ||
            bt_simulation_quantity(s, "carried_water_force", &carried) != BT_OK)
            return fail();
        printf("%" PRId64 " steps, carried water %.17g N, moving ice %.17g kg\n", bt_simulation_steps(s), carried,
               moving);
    }
    printf("state_hash %016" PRIx64 "\n", bt_simulation_hash(s));
    return bt_simulation_end(s) == BT_OK ? EXIT_SUCCESS : fail(); // writes summary.json, and closes result.h5
}
