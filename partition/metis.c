// SPDX-License-Identifier: MIT
// METIS behind a guard: k-way cut of a weighted graph (Karypis & Kumar 1998, J. Parallel Distrib. Comput. 48).
//
// Behaviour of METIS 5.1 without guards, each item observed on Debian 12:
//   - one part: division by zero (SIGFPE). The caller avoids that.
//   - weights that add up to 2³¹ or more, or all zero: METIS_OK with every vertex in one part. Weights are scaled so
//     that their sum stays below 2³⁰, nonzero ones to at least 1.
//   - a vertex above a part's share of one of two kinds of work: errors on standard output under METIS_OK. Refused.
//   - few vertices per part: empty parts under METIS_OK. Every part is checked.
//   - contiguous parts of a disconnected graph: an error. Contiguity is not requested.
//   - it sets its own handlers of SIGTERM and SIGABRT and afterwards puts the caller's back as one-shot
//     ones (SA_RESETHAND); the actions are saved and restored here.
//   - its handler of SIGTERM jumps out of whatever METIS was doing: the caller never learns of the signal, and a jump
//     out of malloc leaves the heap locked (seen: a hang in the next free). So SIGTERM is blocked meanwhile and
//     delivered later. METIS raises it itself only for arguments that cannot occur here. In another thread the handler
//     would jump to an invalid place: see cut.h. Rejected: letting it return METIS_ERROR and raising the signal again.
#include "partition/cut.h"

#include <limits.h>
#include <metis.h>
#include <signal.h>

#include "bergtow/base.h"
#include "base/inside.h"

enum { SUM_MAX = 1 << 30 };

// Divisor that brings the sum of n weights down to SUM_MAX, including the rounding up to 1.
static int64_t divisor_of(int64_t sum, int64_t n)
{
    int64_t room = SUM_MAX > 2 * n ? SUM_MAX - n : SUM_MAX / 2;
    return sum / room + 1;
}

static idx_t scaled(int64_t weight, int64_t divisor) { return (idx_t)(weight / divisor + (weight % divisor != 0)); }

static int call_metis(idx_t n, idx_t *start, idx_t *to, idx_t kinds, idx_t *weight, idx_t *edge, idx_t n_parts,
                      real_t *balance, idx_t *part)
{
    idx_t options[METIS_NOPTIONS], cut;
    METIS_SetDefaultOptions(options);
    options[METIS_OPTION_SEED] = 1;
    options[METIS_OPTION_NUMBERING] = 0;
    options[METIS_OPTION_CONTIG] = 0;

    struct sigaction term, abrt;
    sigset_t set, mask;
    sigemptyset(&set);
    sigaddset(&set, SIGTERM);
    pthread_sigmask(SIG_BLOCK, &set, &mask);
    sigaction(SIGTERM, NULL, &term);
    sigaction(SIGABRT, NULL, &abrt);
    int status =
        METIS_PartGraphKway(&n, &kinds, start, to, weight, NULL, edge, &n_parts, NULL, balance, options, &cut, part);
    sigaction(SIGTERM, &term, NULL);
    sigaction(SIGABRT, &abrt, NULL);
    pthread_sigmask(SIG_SETMASK, &mask, NULL);
    return status;
}

bool bt_cut_by_metis(const bt_graph *graph, int n_parts, double tolerance, int *part)
{
    _Static_assert(sizeof(idx_t) == sizeof(int), "METIS with 64-bit indices: copy start, to and part");
    int n = graph->n, n_edges = graph->start[n];
    if (n > SUM_MAX / 4 || n_edges > SUM_MAX / 4) return false;
    bt_cut_work sum = {{0}};
    int64_t sum_edge = 0;
    int kinds = 0, kind[BT_CUT_KINDS] = {0}; // that there are
    for (int i = 0; i < n; i++) bt_cut_add(&sum, graph->weight[i], 1);
    for (int e = 0; e < n_edges; e++) sum_edge += graph->edge[e];
    for (int k = 0; k < BT_CUT_KINDS; k++)
        if (sum.of[k] > 0) kind[kinds++] = k;
    for (int i = 0; i < n; i++)
        for (int k = 0; kinds > 1 && k < kinds; k++)
            if (graph->weight[i].of[kind[k]] > sum.of[kind[k]] / n_parts) return false;

    idx_t *start = bt_alloc((size_t)n + 1, sizeof *start), *to = bt_alloc((size_t)n_edges, sizeof *to);
    idx_t *weight = bt_alloc((size_t)n * (size_t)kinds, sizeof *weight),
          *edge = bt_alloc((size_t)n_edges, sizeof *edge);
    const int64_t edge_divisor = divisor_of(sum_edge, n_edges);
    real_t balance[BT_CUT_KINDS]; // heaviest part / mean
    for (int i = 0; i <= n; i++) start[i] = graph->start[i];
    for (int k = 0; k < kinds; k++) {
        const int64_t own = sum.of[kind[k]], divisor = divisor_of(own, n);
        for (int i = 0; i < n; i++) weight[i * kinds + k] = scaled(graph->weight[i].of[kind[k]], divisor);
        balance[k] = (real_t)(1 + bt_max(0.001, tolerance * (double)bt_cut_sum(sum) / kinds / (double)own));
    }
    for (int e = 0; e < n_edges; e++) {
        to[e] = graph->to[e];
        edge[e] = graph->edge[e] ? scaled(graph->edge[e], edge_divisor) : 1; // METIS wants edges > 0
    }
    int status = call_metis(n, start, to, kinds, weight, edge, n_parts, balance, part);
    BT_FREE(start, to, weight, edge);

    bool good = status == METIS_OK;
    int *count = bt_alloc((size_t)n_parts, sizeof *count);
    for (int i = 0; good && i < n; i++) {
        good = part[i] >= 0 && part[i] < n_parts;
        if (good) count[part[i]]++;
    }
    for (int p = 0; good && p < n_parts; p++) good = count[p] > 0;
    free(count);
    return good;
}
