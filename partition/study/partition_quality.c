// SPDX-License-Identifier: MIT
// Quality of cuts of the cells of a large field: a table (CSV on stdout) over cell size, number of parts and floes.
//
// The field is not packed: floe centres are a square lattice with jitter at the given concentration, which has
// realistic counts and scatter. Floes of diameter d, spacing s = d √(π / 4 / 0.8), jitter ± 0.3 s in x and y. Contacts
// are pairs with centres nearer than 1.05 d. Work of a cell = its floes + 2 contact points × its contacts × (wake: 4).
// A berg of 100 m in the middle removes the floes under it and joins the cells that it touches; its wake is 10 berg
// lengths long and 2 wide.
//
// Cell T = (i, j) solves the contacts within its 2 × 2 block {T, T+x, T+y, T+x+y}; so its owner holds the floes of the
// other three as ghosts, and the floes of a cell B are held by the owners of {B, B−x, B−y, B−x−y}. Columns:
//   imbalance        heaviest part / mean − 1; metis_imbalance: the same of METIS alone (−1: METIS failed)
//   phase_imbalance  Σ over the four colours (parity of i, j) of the heaviest part's work in it / mean work of a part −
//                    1: if every rank waited for all others after each colour
//   halo             ghost floes / own floes of a part, mean over parts and largest
//   neighbours       parts that hold floes also held by this part
//   sent             floe velocities a part sends in one sweep if every floe is touched in each colour it can be:
//                    own or ghost floes of each cell, times the other parts that hold them
//   moved            share of the work that changes its part when the berg has moved by one cell
#include <string.h>

#include "bergtow/base.h"
#include "partition/cut.h"
#include "base/elementary.h"

static const double DIAMETER = 30, CONCENTRATION = 0.8, JITTER = 0.3, REACH = 1.05, BERG = 100, TOLERANCE = 0.03;
static const double POINTS = 2, WAKE = 4;

typedef struct field {
    int n;           // cells along one side; cell (i, j) is j n + i
    double side;     // m
    int64_t *floes, *contacts; // [n²]
    int64_t *edge;
    bt_cut_work *weight;
    int *start, *to, *group;
    double (*at)[2];
    bt_graph g;
} field;

// Uniform in [0, 1): splitmix64 of a counter (Steele, Lea & Flood 2014).
static double uniform(uint64_t i)
{
    uint64_t z = (i + 1) * UINT64_C(0x9e3779b97f4a7c15);
    z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
    return (double)((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

static int cell_of(const field *f, const double x[2])
{
    int c[2];
    for (int k = 0; k < 2; k++) {
        c[k] = (int)(x[k] / f->side);
        c[k] = c[k] < 0 ? 0 : c[k] >= f->n ? f->n - 1 : c[k];
    }
    return c[1] * f->n + c[0];
}

static void count(field *f, int row, double spacing, bool berg)
{
    double (*x)[2] = bt_alloc((size_t)row * (size_t)row, sizeof *x), middle = row * spacing / 2;
    for (int j = 0, v = 0; j < row; j++)
        for (int i = 0; i < row; i++, v++) {
            x[v][0] = (i + 0.5 + JITTER * (2 * uniform(2 * (uint64_t)v) - 1)) * spacing;
            x[v][1] = (j + 0.5 + JITTER * (2 * uniform(2 * (uint64_t)v + 1) - 1)) * spacing;
            if (berg && bt_hypot(x[v][0] - middle, x[v][1] - middle) < BERG / 2) x[v][0] = -1e9;
            else f->floes[cell_of(f, x[v])]++;
        }
    static const int next[4][2] = {{1, 0}, {-1, 1}, {0, 1}, {1, 1}};
    for (int j = 0, v = 0; j < row; j++)
        for (int i = 0; i < row; i++, v++)
            for (int k = 0; k < 4; k++) {
                int a = i + next[k][0], b = j + next[k][1];
                if (a < 0 || a >= row || b >= row) continue;
                int u = b * row + a;
                if (!(bt_hypot(x[v][0] - x[u][0], x[v][1] - x[u][1]) < REACH * DIAMETER)) continue;
                int s = cell_of(f, x[v]), t = cell_of(f, x[u]); // the contact belongs to (min i, min j)
                int ti = s % f->n < t % f->n ? s % f->n : t % f->n, tj = s / f->n < t / f->n ? s / f->n : t / f->n;
                f->contacts[tj * f->n + ti]++;
            }
    free(x);
}

// Work of the cells and the group under the berg, which has moved by `steps` cells in x.
static void weigh(field *f, bool berg, int steps)
{
    double middle[2] = {f->n * f->side / 2 + steps * f->side, f->n * f->side / 2};
    for (int t = 0; t < f->n * f->n; t++) {
        double x = f->at[t][0] - middle[0], y = f->at[t][1] - middle[1];
        bool wake = berg && x < BERG && x > -10 * BERG && fabs(y) < BERG;
        f->weight[t].of[0] = f->floes[t] + (int64_t)(POINTS * (wake ? WAKE : 1)) * f->contacts[t];
        f->group[t] = berg && fabs(x) < BERG / 2 + f->side / 2 && fabs(y) < BERG / 2 + f->side / 2 ? 0 : -1;
    }
}

static field field_of(int n_floes, double diameters, bool berg)
{
    int row = (int)lround(sqrt(n_floes));
    double spacing = DIAMETER * sqrt(BT_PI / 4 / CONCENTRATION);
    field f = {.side = diameters * DIAMETER};
    f.n = (int)ceil(row * spacing / f.side);
    size_t n = (size_t)f.n * (size_t)f.n;
    f.floes = bt_alloc(n, sizeof *f.floes);
    f.contacts = bt_alloc(n, sizeof *f.contacts);
    f.weight = bt_alloc(n, sizeof *f.weight);
    f.group = bt_alloc(n, sizeof *f.group);
    f.at = bt_alloc(n, sizeof *f.at);
    f.start = bt_alloc(n + 1, sizeof *f.start);
    f.to = bt_alloc(6 * n, sizeof *f.to);
    f.edge = bt_alloc(6 * n, sizeof *f.edge);
    count(&f, row, spacing, berg);
    static const int step[6][2] = {{-1, -1}, {0, -1}, {-1, 0}, {1, 0}, {0, 1}, {1, 1}};
    int m = 0;
    for (int j = 0, t = 0; j < f.n; j++)
        for (int i = 0; i < f.n; i++, t++) {
            f.at[t][0] = (i + 0.5) * f.side, f.at[t][1] = (j + 0.5) * f.side;
            f.start[t] = m;
            for (int k = 0; k < 6; k++) {
                int a = i + step[k][0], b = j + step[k][1];
                if (a < 0 || a >= f.n || b < 0 || b >= f.n) continue;
                f.to[m] = b * f.n + a;
                f.edge[m++] = f.floes[k < 3 ? t : b * f.n + a]; // the floes of the cell on the plus side become ghosts
            }
        }
    f.start[n] = m;
    f.g = (bt_graph){(int)n, f.start, f.to, f.edge, f.weight, (const double(*)[2])f.at, f.group};
    weigh(&f, berg, 0);
    return f;
}

static void field_free(field *f)
{
    free(f->floes);
    free(f->contacts);
    free(f->weight);
    free(f->group);
    free(f->at);
    free(f->start);
    free(f->to);
    free(f->edge);
}

typedef struct halo {
    double share_mean, share_max, neighbours_mean, sent_mean, phase_imbalance;
    int64_t sent_max;
    int neighbours_max;
} halo;

static int by_value(const void *a, const void *b)
{
    int64_t p = *(const int64_t *)a, q = *(const int64_t *)b;
    return (p > q) - (p < q);
}

static int64_t unique(int64_t *v, int64_t n)
{
    qsort(v, (size_t)n, sizeof *v, by_value);
    int64_t m = 0;
    for (int64_t i = 0; i < n; i++)
        if (m == 0 || v[m - 1] != v[i]) v[m++] = v[i];
    return m;
}

static halo halo_of(const field *f, int n_parts, const int *part)
{
    int n = f->n;
    int64_t *own = bt_alloc((size_t)n_parts, sizeof *own), *ghost = bt_alloc((size_t)n_parts, sizeof *ghost);
    int64_t *sent = bt_alloc((size_t)n_parts, sizeof *sent), *work = bt_alloc(4 * (size_t)n_parts, sizeof *work);
    int64_t *pair = bt_alloc(12 * (size_t)n * (size_t)n, sizeof *pair), n_pairs = 0, sum = 0;
    for (int j = 0, b = 0; j < n; j++)
        for (int i = 0; i < n; i++, b++) {
            // owners of the blocks that b lies in; the same, each once
            int user[4], n_users = 0, holder[4], n_holders = 0;
            for (int k = 0; k < 4; k++)
                if (i >= (k & 1) && j >= (k >> 1)) user[n_users++] = part[b - (k & 1) - (k >> 1) * n];
            for (int k = 0; k < n_users; k++) {
                bool known = false;
                for (int h = 0; h < n_holders; h++) known = known || holder[h] == user[k];
                if (!known) holder[n_holders++] = user[k];
            }
            own[part[b]] += f->floes[b];
            for (int h = 0; h < n_holders; h++) {
                if (holder[h] != part[b]) ghost[holder[h]] += f->floes[b];
                for (int k = 0; k < n_holders; k++)
                    if (k != h) pair[n_pairs++] = (int64_t)holder[h] * n_parts + holder[k];
            }
            for (int k = 0; k < n_users; k++) sent[user[k]] += f->floes[b] * (n_holders - 1);
            work[4 * part[b] + 2 * (j % 2) + i % 2] += f->weight[b].of[0];
            sum += f->weight[b].of[0];
        }
    n_pairs = unique(pair, n_pairs);
    int *neighbours = bt_alloc((size_t)n_parts, sizeof *neighbours);
    for (int64_t k = 0; k < n_pairs; k++) neighbours[pair[k] / n_parts]++;
    halo h = {.neighbours_mean = (double)n_pairs / n_parts};
    int64_t most[4] = {0};
    for (int p = 0; p < n_parts; p++) {
        double share = own[p] ? (double)ghost[p] / (double)own[p] : 0;
        h.share_mean += share / n_parts;
        h.share_max = bt_max(h.share_max, share);
        h.sent_mean += (double)sent[p] / n_parts;
        if (sent[p] > h.sent_max) h.sent_max = sent[p];
        if (neighbours[p] > h.neighbours_max) h.neighbours_max = neighbours[p];
        for (int c = 0; c < 4; c++)
            if (work[4 * p + c] > most[c]) most[c] = work[4 * p + c];
    }
    h.phase_imbalance = (double)(most[0] + most[1] + most[2] + most[3]) * n_parts / (double)sum - 1;
    free(own);
    free(ghost);
    free(sent);
    free(work);
    free(pair);
    free(neighbours);
    return h;
}

static void row(field *f, const char *series, int n_floes, double diameters, bool berg, int n_parts)
{
    static const char *const method[] = {"none", "kept", "METIS", "bisection"};
    size_t n = (size_t)f->g.n;
    int *part = bt_alloc(n, sizeof *part);
    double metis = -1, start = bt_clock();
    if (n_parts > 1 && bt_cut_by_metis(&f->g, n_parts, TOLERANCE, part))
        metis = bt_cut_measure(&f->g, n_parts, part, NULL).imbalance;
    double metis_time = bt_clock() - start;
    if (n_parts == 1) metis = 0;
    for (size_t v = 0; v < n; v++) part[v] = -1;
    bt_cut_quality q, later = {0};
    start = bt_clock();
    bt_cut(&f->g, n_parts, TOLERANCE, part, &q);
    double time = bt_clock() - start;
    if (!bt_cut_is_valid(&f->g, n_parts, part)) fprintf(stderr, "%d parts: not a valid cut\n", n_parts), exit(5);
    halo h = halo_of(f, n_parts, part);
    int64_t sum = 0;
    for (size_t v = 0; v < n; v++) sum += f->weight[v].of[0];
    if (berg) {
        weigh(f, berg, 1);
        bt_cut(&f->g, n_parts, TOLERANCE, part, &later);
        weigh(f, berg, 0);
    }
    printf("%s,%d,%g,%d,%d,%s,%.4f,%.4f,%.4f,%lld,%.4f,%.4f,%.2f,%d,%.1f,%lld,%.4f,%.3f,%.3f\n", series, n_floes,
           diameters, n_parts, f->g.n, method[q.method], q.imbalance, metis, h.phase_imbalance, (long long)q.cut,
           h.share_mean, h.share_max, h.neighbours_mean, h.neighbours_max, h.sent_mean, (long long)h.sent_max,
           (double)later.moved / (double)sum, metis_time, time);
    fflush(stdout);
    free(part);
}

int main(void)
{
    puts("series,floes,cell_diameters,parts,cells,method,imbalance,metis_imbalance,phase_imbalance,cut,halo_mean,halo_"
         "max,"
         "neighbours_mean,neighbours_max,sent_mean,sent_max,moved,metis_s,cut_s");
    for (int berg = 0; berg <= 1; berg++)
        for (int diameters = 4; diameters <= 8; diameters += 2) {
            field f = field_of(1000000, diameters, berg);
            for (int n_parts = berg ? 64 : 1; n_parts <= 4096; n_parts *= 2)
                row(&f, berg ? "berg" : "strong", 1000000, diameters, berg, n_parts);
            field_free(&f);
        }
    static const int ranks[] = {1, 2, 4, 9, 16, 36, 64, 144, 256, 576, 1000};
    for (int diameters = 4; diameters <= 8; diameters += 2)
        for (size_t i = 0; i < sizeof ranks / sizeof *ranks; i++) {
            field f = field_of(10000 * ranks[i], diameters, false);
            row(&f, "weak", 10000 * ranks[i], diameters, false, ranks[i]);
            field_free(&f);
        }
    return 0;
}
