// SPDX-License-Identifier: MIT
// The program with the quantities, the estimate, the laws, the body shape and the keys of the examples: what a
// user of the library has, as a test of what reads them (tests/cli/test_quantities.py, test_contact_law.py,
// test_added.py). The same main, and nothing else added.
#include "examples/body_shape.c"
#include "examples/contact_law.c"
#include "examples/estimate.c"
#include "examples/force_law.c"
#include "examples/key.c"
#include "examples/quantity.c"

__attribute__((constructor)) static void register_examples(void)
{
    bt_errors err = {0};
    for (int k = 0; k < N_EXAMPLE_QUANTITIES; k++) bt_quantity_register(&example_quantities[k], &err);
    bt_estimate_register(&strip_energy_estimate, &err);
    bt_force_register(&wave_drift_law, &err);
    bt_contact_register(&fender_law, &err);
    bt_shape_register("capsule", capsule, &err);
    bt_keys_add("pilot", pilot_keys, N_PILOT_KEYS, &err);
    bt_errors_print(&err);
    bt_errors_free(&err);
}
