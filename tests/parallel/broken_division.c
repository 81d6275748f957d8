// SPDX-License-Identifier: MIT
// A division among ranks that is spoilt on purpose: the program must end at once and say which body it is about.
//
//     mpirun -n 2 broken_division sound|lost|doubled|changed|missing
//
// sound: nothing is done to it. lost: nobody owns a floe any more. doubled: two ranks own one. changed: a ghost differs
// in one bit.
// missing: a rank that needs a floe does not hold it under its name. The floe is one that both ranks hold; its gid goes
// to stdout.
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "contact/contacts.h"
#include "bergtow/shape.h"
#include "partition/division.h"
#include "partition/domain.h"
#include "tests/parallel/squares.h"

static bt_world *make_world(void)
{
    bt_world *w = squares_world();
    for (int k = 0; k < 600; k++) {
        bt_body_def d = square_at(0.5 + k % 30, 0.5 + k / 30);
        d.vx = k % 7 == 0;
        bt_world_add(w, &d);
    }
    return w;
}

/// Least gid of a floe that both ranks hold; *mine: this rank owns it. The halo lies on one side: either rank may have
/// all of it.
static bt_gid shared_floe(const bt_world *w, bool *mine)
{
    for (bt_gid g = 0; g < w->bodies.n_global; g++) {
        const bt_idx i = bt_world_index(w, g);
        if (bt_comm_any(w->domain->comm, i < 0)) continue;
        *mine = bt_domain_owns(w, i);
        return g;
    }
    fprintf(stderr, "no floe is held by both ranks\n");
    bt_comm_abort(1);
}

int main(int argc, char **argv)
{
    bt_comm_start(&argc, &argv);
    const bt_comm *c = bt_comm_world();
    if (argc != 2 || c->size != 2) {
        fprintf(stderr, "start me with: mpirun -n 2 broken_division sound|lost|doubled|changed|missing\n");
        return bt_comm_end(BT_ERR_USAGE);
    }
    const char *how = argv[1];
    bt_world *w = make_world();
    bt_domain_create(w, c);
    for (int n = 0; n < 5; n++) bt_world_step(w);
    bool mine;
    const bt_gid g = shared_floe(w, &mine);
    const bt_idx i = bt_world_index(w, g);
    if (c->rank == 0) {
        printf("%d\n", (int)g);
        fflush(stdout);
    }
    if (!strcmp(how, "lost") && mine) w->domain->owned[i] = 0;
    if (!strcmp(how, "doubled") && !mine) w->domain->owned[i] = 1;
    if (!strcmp(how, "changed") && !mine) w->bodies.vel[i].w = nextafter(w->bodies.vel[i].w, 1);
    if (!strcmp(how, "missing") && !mine) w->bodies.index_of[g] = -1;
    if (!strcmp(how, "changed") || !strcmp(how, "missing")) bt_domain_validate(w);
    w->cells->relabel = true;
    bt_cells_begin(w);
    bt_domain_validate(w);
    if (c->rank == 0) printf("sound\n");
    bt_world_free(w);
    return bt_comm_end(BT_OK);
}
