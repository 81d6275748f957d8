// SPDX-License-Identifier: MIT
// Prints the state hash of a thousand floes that are stirred and blown together between walls, after some steps, to
// compare C libraries (tests/machines.sh). Needs no other library.
#include "scene.h"

#include <inttypes.h>
#include <stdio.h>

#ifndef _OPENMP // a C library for which this machine has no OpenMP
int omp_get_max_threads(void) { return 1; }
int omp_get_thread_num(void) { return 0; }
int omp_get_num_threads(void) { return 1; }
#endif

enum { NX = 40, NY = 25, STEPS = 400 };

int main(void)
{
    bt_params p = scene_params(0.05, 1);
    p.tolerance = 1e-4;
    p.max_sweeps = 300;
    p.rest_speed = 1e-3;
    p.coriolis = 1e-4;
    p.air_u = 8;
    p.air_v = -3;
    bt_world *w = bt_world_create(&p);
    uint64_t rng = 1;
    for (int k = 0; k < NX * NY; k++) {
        double v[16];
        const int n = 4 + k % 5;
        bt_shape_regular(n, 0.7 + 0.3 * scene_uniform(&rng), v);
        bt_body_def d = scene_prism(n, v, 90);
        d.x = 1.15 * (k % NX), d.y = 1.15 * (k / NX), d.yaw = 6 * scene_uniform(&rng);
        d.vx = 2 * scene_uniform(&rng) - 1, d.vy = 2 * scene_uniform(&rng) - 1, d.yaw_rate = scene_uniform(&rng) - 0.5;
        d.friction = 0.3, d.restitution = 0.2;
        d.drag = (bt_drag){.water_skin = 3, .water_form = 10, .air_skin = 0.02, .air_form = 0.1, .yaw = 0.5};
        bt_world_add(w, &d);
    }
    scene_wall(w, -3, -2, 1.15 * NX + 2, -1, 0.2);
    scene_wall(w, -3, 1.15 * NY, 1.15 * NX + 2, 1.15 * NY + 1, 0.2);
    for (int s = 0; s < STEPS; s++) bt_world_step(w);
    printf("%016" PRIx64 "\n", bt_world_hash(w));
    bt_world_free(w);
    return 0;
}
