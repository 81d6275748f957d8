// SPDX-License-Identifier: MIT
// The contact problem of the step just solved, as a local problem in FCLIB's format.
//
// Rows in the order of the manifolds (the order of the ids), normal then tangent. W = J M⁻¹ Jᵀ couples contacts that
// share a movable body. q follows from the solution, q = u − W r with u = J U2 + b, so that the contribution of a tow
// line (not a contact) keeps its solved value. With a contact law the bounds of the normal impulses are those at the
// solution. Sheets (contact/raft.h) are also contacts; their two components lie in a disc about a separate centre.
#include "output/dump.h"

#include <string.h>
#include <unistd.h>

#include "bergtow/fclib.h"
#include "base/fileio.h"
#include "base/h5dataset.h"
#include "base/inside.h"
#include "contact/law.h"
#include "contact/pack.h"
#include "solve/limit.h"
#include "space/cells.h"
#include "step/splitting.h"

// --- the file --------------------------------------------------------------------------------------------------------

// The contact problem of one step in the file format of FCLIB, so that other solvers can check ours.
//
// Layout as expected by FCLIB's reader (github.com/FrictionalContactLibrary/fclib, src/fclib.h); every scalar is a
// dataset of one entry, integers have 32 bits:
//     /fclib_local/spacedim                       2
//     /fclib_local/W/{nzmax, m, n, nz, p, i, x}    nz = −2: compressed rows (p [m+1], i columns, x values)
//     /fclib_local/vectors/{q [m], mu [m/2]}
//     /fclib_local/info/{title, description, math_info}   fixed-length strings
//     /solution/{u, r}
//     /bound, /disc, /ends, /places                extensions: bounds of the normal impulses; of sheets (where mu is
//                                                  0), a disc given by its radius (NaN = another contact),
//                                                  and a line given by its half; places of contacts and bodies

#define COMPRESSED_ROWS (-2)

static bt_status refuse(const char *path, const char *reason, bt_errors *err)
{
    return bt_fail(err, BT_ERR_USAGE, "%s: the contact problem is not written: %s", path, reason);
}

static bt_status check_problem(const char *path, const bt_fclib_problem *p, bt_errors *err)
{
    if (p->n < 1) return refuse(path, "there are no contacts in this step; choose a step with contacts", err);
    if (p->n > INT32_MAX / 2) return refuse(path, "the format has 32-bit sizes; choose a smaller case", err);
    if (!p->u != !p->r) return refuse(path, "a solution needs both velocities and impulses", err);
    const int m = 2 * p->n;
    if (p->w_ptr[0] != 0 || p->w_ptr[m] > INT32_MAX)
        return refuse(path, "the format has 32-bit sizes; choose a smaller case", err);
    for (int i = 0; i < m; i++) {
        if (p->w_ptr[i + 1] < p->w_ptr[i]) return refuse(path, "the rows of W are out of order", err);
        for (int64_t k = p->w_ptr[i]; k < p->w_ptr[i + 1]; k++)
            if (p->w_col[k] < 0 || p->w_col[k] >= m) return refuse(path, "W has a column outside the problem", err);
    }
    return BT_OK;
}

static void put_int(bt_h5 *h5, const char *name, int value, const char *meaning)
{
    bt_h5_put(h5, name, H5T_NATIVE_INT, 1, 0, &value, "one", "1", meaning);
}

static void put_rows(bt_h5 *h5, const char *name, int m, const double *data, const char *units, const char *meaning)
{
    bt_h5_put(h5, name, H5T_NATIVE_DOUBLE, (hsize_t)m, 0, data, "row", units, meaning);
}

static void write_problem(bt_h5 *h5, const bt_fclib_problem *x)
{
    const int m = 2 * x->n;
    int32_t *rows = bt_alloc((size_t)m + 1, sizeof *rows);
    for (int i = 0; i <= m; i++) rows[i] = (int32_t)x->w_ptr[i];
    bt_h5_group(h5, "/fclib_local");
    put_int(h5, "/fclib_local/spacedim", 2, "dimensions of space");
    bt_h5_group(h5, "/fclib_local/W");
    put_int(h5, "/fclib_local/W/nzmax", rows[m], "entries of W");
    put_int(h5, "/fclib_local/W/m", m, "rows of W");
    put_int(h5, "/fclib_local/W/n", m, "columns of W");
    put_int(h5, "/fclib_local/W/nz", COMPRESSED_ROWS, "kind of storage: -2, compressed rows");
    bt_h5_put(h5, "/fclib_local/W/p", H5T_NATIVE_INT32, (hsize_t)m + 1, 0, rows, "row_end", "1",
        "row i has the entries p[i] up to p[i + 1]");
    bt_h5_put(h5, "/fclib_local/W/i", H5T_NATIVE_INT32, (hsize_t)rows[m], 0, x->w_col, "entry", "1",
              "column of each entry");
    bt_h5_put(h5, "/fclib_local/W/x", H5T_NATIVE_DOUBLE, (hsize_t)rows[m], 0, x->w_val, "entry", "kg-1",
              "entries of W");
    bt_h5_group(h5, "/fclib_local/vectors");
    put_rows(h5, "/fclib_local/vectors/q", m, x->q, "m/s", "velocities without impulses: u = W r + q");
    bt_h5_put(h5, "/fclib_local/vectors/mu", H5T_NATIVE_DOUBLE, (hsize_t)x->n, 0, x->mu, "contact", "1", "friction");
    free(rows);
    bt_h5_group(h5, "/fclib_local/info");
    bt_h5_put_text(h5, "/fclib_local/info/title", x->title ? x->title : "", "title");
    bt_h5_put_text(h5, "/fclib_local/info/description", x->description ? x->description : "", "description");
    bt_h5_put_text(h5, "/fclib_local/info/math_info",
             "2-D Signorini-Coulomb: u = W r + q in m/s, r in N s; rows of a contact: normal, tangent",
             "what the problem is");
}

static void write_places(bt_h5 *h5, const bt_fclib_places *places, hsize_t n)
{
    bt_h5_group(h5, "/places");
    bt_h5_attr_double(h5, "/places", "time", places->time);
    bt_h5_attr_double(h5, "/places", "dt", places->dt);
    bt_h5_put(h5, "/places/body", H5T_NATIVE_INT64, n, 2, places->body, "contact pair", "1",
        "ids of the two bodies of each contact");
    bt_h5_put(h5, "/places/normal", H5T_NATIVE_DOUBLE, n, 2, places->normal, "contact xy", "1",
        "from the first body to the second, world frame");
    bt_h5_put(h5, "/places/lever", H5T_NATIVE_DOUBLE, n, 4, places->lever, "contact pair_xy", "m",
        "from the centroid of the first and of the second body to the contact point, world frame, at the start of the "
        "step");
    bt_h5_put(h5, "/places/pose", H5T_NATIVE_DOUBLE, (hsize_t)places->n_bodies, 3, places->pose, "any_body component",
        "m, m, rad",
        "x, y, yaw of every body at the end of the step, by id");
}

/// Write the extensions of the format, and the solution.
static void write_more(bt_h5 *h5, const bt_fclib_problem *p)
{
    const hsize_t n = (hsize_t)p->n;
    if (p->bound)
        bt_h5_put(h5, "/bound", H5T_NATIVE_DOUBLE, n, 0, p->bound, "contact", "N s",
                  "upper bound of the normal impulse");
    if (p->disc)
        bt_h5_put(h5, "/disc", H5T_NATIVE_DOUBLE, n, 0, p->disc, "contact", "N s",
            "sheets: their impulse is the sum of a point of the disc of this radius and of a point of the line from "
            "-ends to ends; NaN: another contact");
    if (p->ends) put_rows(h5, "/ends", 2 * p->n, p->ends, "N s", "half of that line; 0 of other contacts");
    if (p->places) write_places(h5, p->places, n);
    if (!p->r) return;
    bt_h5_group(h5, "/solution");
    put_rows(h5, "/solution/u", 2 * p->n, p->u, "m/s", "velocities of the solution");
    put_rows(h5, "/solution/r", 2 * p->n, p->r, "N s", "impulses of the solution");
}

bt_status bt_fclib_write(const char *path, const bt_fclib_problem *p, bt_errors *err)
{
    BT_PLAIN_NUMBERS;
    bt_status status = check_problem(path, p, err);
    if (status != BT_OK) return status;
    const char *temporary = BT_BESIDE(path, ".tmp");
    bt_h5 h5;
    status = bt_h5_create(&h5, temporary, err);
    if (status == BT_OK) {
        bt_h5_describe_file(&h5, p->title ? p->title : "contact problem");
        write_problem(&h5, p);
        write_more(&h5, p);
        status = bt_h5_close(&h5);
        if (status == BT_OK) status = bt_file_rename(temporary, path, err);
        if (status != BT_OK) unlink(temporary);
    }
    return status;
}

// --- the contacts of a world -----------------------------------------------------------------------------------------

typedef struct {
    int32_t contact; ///< in the order of the manifolds
    int side;        ///< −1: the body is a, +1: it is b
} incidence;

/// One contact point.
typedef struct {
    bt_gid gid_a, gid_b;
    int point;
    bt_idx a, b;
    double nx, ny, ran, rbn, rat, rbt, bias, mu, ln, lt, bound, disc, ends[2];
} row;

static int by_gids(const void *p, const void *q)
{
    const row *a = p, *b = q;
    if (a->gid_a != b->gid_a) return a->gid_a < b->gid_a ? -1 : 1;
    if (a->gid_b != b->gid_b) return a->gid_b < b->gid_b ? -1 : 1;
    return (a->point > b->point) - (a->point < b->point);
}

/// Inverse-mass product of two rows' directions at the shared body: [n n', n t'; t n', t t'].
static void couple(const row *r, int sr, const row *q, int sq, bt_inv inv, double out[4])
{
    const double rn = sr > 0 ? r->rbn : r->ran, rt = sr > 0 ? r->rbt : r->rat;
    const double qn = sq > 0 ? q->rbn : q->ran, qt = sq > 0 ? q->rbt : q->rat;
    const double s = sr * sq, c = r->nx * q->nx + r->ny * q->ny, d = r->nx * q->ny - r->ny * q->nx;
    out[0] += s * (inv.m * c + inv.i * rn * qn);  // n·n'
    out[1] += s * (-inv.m * d + inv.i * rn * qt); // n·t' with t' = (−n'_y, n'_x)
    out[2] += s * (inv.m * d + inv.i * rt * qn);  // t·n'
    out[3] += s * (inv.m * c + inv.i * rt * qt);  // t·t'
}

/// What the rows of a contact have in common: of its point i, or (0) of its sheets.
static row begin_row(const bt_world *world, const bt_contact *contact, int i)
{
    return (row){.gid_a = world->bodies.gid[contact->a], .gid_b = world->bodies.gid[contact->b], .point = i,
                 .a = contact->a, .b = contact->b, .nx = contact->nx, .ny = contact->ny,
                 .ran = contact->ran[i], .rbn = contact->rbn[i], .rat = contact->rat, .rbt = contact->rbt,
                 .ln = contact->ln[i], .lt = contact->lt, .bound = INFINITY, .disc = NAN};
}

/// Normal and tangential row of every contact point, in the order of the gids.
static row *rows_of(const bt_world *world, int *n)
{
    const bt_cells *ts = world->cells;
    int64_t most = 0;
    for (bt_idx k = 0; k < ts->n; k++) most += ts->cell[k].n_points + ts->cell[k].n_contacts;
    row *rows = bt_alloc((size_t)most, sizeof *rows);
    *n = 0;
    for (bt_idx k = 0; k < ts->n; k++)
        for (bt_idx j = 0; j < ts->cell[k].n_contacts; j++) {
            const bt_contact *contact = &ts->cell[k].contacts[j];
            const double total = contact->ln[0] + contact->ln[1];
            if (ts->cell[k].gaps[j].row == BT_ROW_RELEASED) continue; // the two pass each other
            const bt_limit *limits = ts->cell[k].laws->limits;
            if (contact->n == 0) { // sheets: rows along x and y, after the points of the pair
                row *p = &rows[(*n)++];
                *p = begin_row(world, contact, 0);
                p->point = 2, p->disc = limits[j].flat[0];
                memcpy(p->ends, limits[j].ends, sizeof p->ends);
            }
            for (int i = 0; i < contact->n; i++) { // one friction impulse for both: shared like the normal impulses
                row *p = &rows[(*n)++];
                *p = begin_row(world, contact, i);
                p->bias = contact->bias[i], p->mu = contact->mu;
                p->lt = total > 0 ? contact->lt * (contact->ln[i] / total) : 0;
                if (limits) p->bound = bt_limit_bound(&limits[j], contact, i, world->bodies.vel);
            }
        }
    if (*n) qsort(rows, (size_t)*n, sizeof *rows, by_gids);
    return rows;
}

/// Lever of a row's contact point from r × n and r × t, with t = (−n_y, n_x): r = (r × t) n − (r × n) t.
static void lever_of(double nx, double ny, double rn, double rt, double out[2])
{
    out[0] = rt * nx + rn * ny;
    out[1] = rt * ny - rn * nx;
}

/// Places of the rows and of all bodies; the caller then owns the arrays.
static bt_fclib_places places_of(const bt_world *world, const row *rows, int n)
{
    const bt_bodies *bodies = &world->bodies;
    int64_t *body = bt_alloc(2 * (size_t)n, sizeof *body);
    double *normal = bt_alloc(2 * (size_t)n, sizeof *normal), *lever = bt_alloc(4 * (size_t)n, sizeof *lever);
    double *pose = bt_alloc(3 * (size_t)bodies->n_global, sizeof *pose);
    const bt_gid unborn = world->splitting ? world->splitting->reserve - 2 * world->splitting->n : 0;
    for (int k = 0; k < n; k++) {
        const row *p = &rows[k];
        body[2 * k] = bt_splitting_row(world, p->gid_a), body[2 * k + 1] = bt_splitting_row(world, p->gid_b);
        normal[2 * k] = p->nx, normal[2 * k + 1] = p->ny;
        lever_of(p->nx, p->ny, p->ran, p->rat, lever + 4 * k);
        lever_of(p->nx, p->ny, p->rbn, p->rbt, lever + 4 * k + 2);
    }
    for (bt_gid g = 0; g < bodies->n_global; g++) {
        const bt_idx i = bt_world_index(world, g);
        const double at[3] = {i < 0 ? NAN : bodies->pose[i].x, i < 0 ? NAN : bodies->pose[i].y,
                              i < 0 ? NAN : bodies->pose[i].yaw};
        memcpy(pose + 3 * bt_splitting_row(world, g), at, sizeof at);
    }
    return (bt_fclib_places){.time = (double)world->step * world->par.dt,
                             .dt = world->par.dt,
                             .body = body,
                             .normal = normal,
                             .lever = lever,
                             .n_bodies = bodies->n_global - unborn,
                             .pose = pose};
}

BT_ASCENDING(by_contact, incidence, contact)

/// The contacts at each movable body: those of body i are entries first[i] to first[i + 1] − 1 of the result.
static incidence *incidences_of(const bt_bodies *bodies, const row *rows, int n, int64_t *first)
{
    for (int k = 0; k < n; k++) {
        if (bodies->inv[rows[k].a].m > 0) first[rows[k].a + 1]++;
        if (bodies->inv[rows[k].b].m > 0) first[rows[k].b + 1]++;
    }
    for (bt_idx i = 0; i < bodies->n; i++) first[i + 1] += first[i];
    incidence *at = bt_alloc((size_t)first[bodies->n], sizeof *at);
    int64_t *next = bt_alloc((size_t)bodies->n, sizeof *next);
    for (bt_idx i = 0; i < bodies->n; i++) next[i] = first[i];
    for (int k = 0; k < n; k++) {
        if (bodies->inv[rows[k].a].m > 0) at[next[rows[k].a]++] = (incidence){k, -1};
        if (bodies->inv[rows[k].b].m > 0) at[next[rows[k].b]++] = (incidence){k, 1};
    }
    free(next);
    return at;
}

/// The problem under construction; bt_fclib_problem points to these arrays.
typedef struct {
    int64_t *ptr;
    int32_t *col;
    double *val, *q, *mu, *u, *r, *bound, *disc, *ends;
} problem;

/// Allocate the problem. most: largest number of blocks of W.
static problem problem_of(const bt_bodies *bodies, const row *rows, int n, int64_t most)
{
    const size_t m = (size_t)n;
    problem out = {0};
    out.ptr = bt_alloc(2 * m + 1, sizeof *out.ptr);
    out.col = bt_alloc(4 * (size_t)most, sizeof *out.col);
    out.val = bt_alloc(4 * (size_t)most, sizeof *out.val);
    double **const two[] = {&out.q, &out.u, &out.r, &out.ends}, **const one[] = {&out.mu, &out.bound, &out.disc};
    for (int i = 0; i < 4; i++) *two[i] = bt_alloc(2 * m, sizeof(double));
    for (int i = 0; i < 3; i++) *one[i] = bt_alloc(m, sizeof(double));
    for (int k = 0; k < n; k++) {
        const row *p = &rows[k];
        const bt_vel *va = &bodies->vel[p->a], *vb = &bodies->vel[p->b];
        const double dx = vb->x - va->x, dy = vb->y - va->y;
        out.u[2 * k] = p->nx * dx + p->ny * dy + p->rbn * vb->w - p->ran * va->w + p->bias;
        out.u[2 * k + 1] = p->nx * dy - p->ny * dx + p->rbt * vb->w - p->rat * va->w;
        out.r[2 * k] = p->ln;
        out.r[2 * k + 1] = p->lt;
        out.mu[k] = p->mu;
        out.bound[k] = p->bound;
        out.disc[k] = p->disc;
        out.ends[2 * k] = p->ends[0], out.ends[2 * k + 1] = p->ends[1];
    }
    return out;
}

/// Form the two rows of W of contact k. near [m]: the contacts at its two bodies, in the order of the contacts.
static void couple_all(problem *out, const bt_bodies *bodies, const row *rows, int k, const incidence *near, size_t m)
{
    const row *p = &rows[k];
    int64_t blocks = 0;
    for (size_t i = 0; i < m; i++) blocks += i == 0 || near[i].contact != near[i - 1].contact;
    int64_t e0 = out->ptr[2 * k], e1 = e0 + 2 * blocks;
    out->ptr[2 * k + 1] = e1;
    out->ptr[2 * k + 2] = e1 + 2 * blocks;
    for (size_t i = 0; i < m;) {
        const int o = near[i].contact;
        double block[4] = {0};
        for (; i < m && near[i].contact == o; i++) {
            const bt_idx body = near[i].side > 0 ? rows[o].b : rows[o].a;
            couple(p, body == p->b ? 1 : -1, &rows[o], near[i].side, bodies->inv[body], block);
        }
        for (int t = 0; t < 2; t++) {
            out->col[e0] = out->col[e1] = 2 * o + t;
            out->val[e0++] = block[t];
            out->val[e1++] = block[2 + t];
        }
    }
}

bt_status bt_solver_dump(const bt_world *world, const char *path, bt_errors *err)
{
    const bt_bodies *bodies = &world->bodies;
    int n;
    row *rows = rows_of(world, &n);
    int64_t *first = bt_alloc((size_t)bodies->n + 1, sizeof *first), most = 0, widest = 0;
    incidence *at = incidences_of(bodies, rows, n, first);
    for (int k = 0; k < n; k++) {
        const int64_t m = first[rows[k].a + 1] - first[rows[k].a] + first[rows[k].b + 1] - first[rows[k].b];
        most += m;
        widest = m > widest ? m : widest;
    }
    problem x = problem_of(bodies, rows, n, most);
    incidence *near = bt_alloc((size_t)widest, sizeof *near);
    for (int k = 0; k < n; k++) {
        const bt_idx ends[2] = {rows[k].a, rows[k].b};
        size_t m = 0;
        for (int e = 0; e < 2; e++)
            for (int64_t i = first[ends[e]]; i < first[ends[e] + 1]; i++) near[m++] = at[i];
        if (m) qsort(near, m, sizeof *near, by_contact);
        couple_all(&x, bodies, rows, k, near, m);
    }
    for (int i = 0; i < 2 * n; i++) {
        double wr = 0;
        for (int64_t e = x.ptr[i]; e < x.ptr[i + 1]; e++) wr += x.val[e] * x.r[x.col[e]];
        x.q[i] = x.u[i] - wr;
    }
    const bt_fclib_places places = places_of(world, rows, n);
    const bool rafts = bt_law_on(&world->par, BT_LAW_RAFTING);
    const bt_fclib_problem out = {
        .n = n, .w_ptr = x.ptr, .w_col = x.col, .w_val = x.val, .q = x.q, .mu = x.mu, .u = x.u, .r = x.r,
        .bound = bt_laws_on(&world->par) ? x.bound : NULL, .disc = rafts ? x.disc : NULL,
        .ends = rafts ? x.ends : NULL, .places = &places, .title = "bergtow",
        .description = "contact problem of one time step of broken sea ice, 2-D, with its solution"};
    const bt_status status = bt_fclib_write(path, &out, err);
    BT_FREE(rows, first, at, near, x.ptr, x.col, x.val, x.q, x.mu, x.u, x.r, x.bound, x.disc, x.ends);
    BT_FREE((void *)places.body, (void *)places.normal, (void *)places.lever, (void *)places.pose);
    return status;
}
