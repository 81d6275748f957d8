// SPDX-License-Identifier: MIT
// The summary as a table for readers; as JSON: summary_keys.c.
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "output/estimate_text.h"
#include "base/units.h"
#include "output/impact_count.h"
#include "output/summary.h"
#include "step/splitting.h"
#include "case/case_derived.h"
#include "case/warning.h"

/// Shares of the wall time in one line, and in another how much of each phase several threads shared.
static void print_phases(const bt_run_totals *t)
{
#define NAME(name, text) #name,
#define SECONDS(name, text) t->phases.name,
#define SHARED(name, text) t->shared.name,
    const char *const names[] = {BT_WALL_PHASES(NAME)};
    const double seconds[] = {BT_WALL_PHASES(SECONDS)}, shared[] = {BT_WALL_PHASES(SHARED)};
#undef NAME
#undef SECONDS
#undef SHARED
    const int n = sizeof names / sizeof *names;
    double sum = 0;
    for (int i = 0; i < n; i++) sum += seconds[i];
    for (int i = 0; i < n; i++)
        printf(" %s %.1f %%%s", names[i], sum > 0 ? 100 * seconds[i] / sum : 0.0, i + 1 < n ? "," : "\n");
    if (t->threads < 2) return;
    printf("  shared by threads  ");
    for (int i = 0; i < n; i++)
        printf(" %s %.0f %%%s", names[i], seconds[i] > 0 ? bt_min(100, 100 * shared[i] / seconds[i]) : 0.0,
               i + 1 < n ? "," : "\n");
}

/// Reported series that not every run has, and what the table calls them.
static const struct { bt_reported_series series; const char *label; } of_the_line[] = {
    {BT_REPORTED_TENSION_1, "  line tension"},
    {BT_REPORTED_TENSION_2, "  second branch"},
    {BT_REPORTED_THRUST, "  vessel thrust"},
};
enum { N_OF_THE_LINE = sizeof of_the_line / sizeof *of_the_line };

static void print_events(const bt_events *e)
{
    char text[160];
    for (int64_t i = 0; e && i < e->n && i < BT_EVENTS_REPORTED; i++) {
        bt_event_describe(&e->event[i], text);
        printf("  event               %g s: %s\n", e->event[i].time, text);
    }
    if (e && e->n > BT_EVENTS_REPORTED)
        printf("  event               and %" PRId64 " more, in /events of result.h5\n", e->n - BT_EVENTS_REPORTED);
}

static void print_mean(const char *label, const bt_mean *m, bool at_least)
{
    char a[32], b[32], d[32], e[32];
    if (at_least) {
        printf("  %-19s at least %s\n", label, bt_force_text(a, m->mean));
        return;
    }
    printf("  %-19s %s, 95 %% interval %s to %s, sd %s\n", label, bt_force_text(a, m->mean), bt_force_text(b, m->low),
           bt_force_text(d, m->high), bt_force_text(e, m->sd));
}

/// Registered quantities: forces among the forces, all others after them.
static void print_added(const bt_summary *s, bool forces)
{
    for (int k = 0; k < s->n_added; k++) {
        const bt_quantity *q = bt_added(k);
        const bool force = q->role == BT_ROLE_BALANCE || q->role == BT_ROLE_FORCE || q->role == BT_ROLE_LOAD;
        if (force != forces || isnan(s->added[k])) continue;
        const bool plain = !strcmp(q->units, "1");
        printf(force ? "    %-17s %.4g%s%s (%s)\n" : "  %-19s %.4g%s%s (%s)\n", q->label, s->added[k],
               plain ? "" : " ", plain ? "" : q->units, bt_keep_names[q->keep]);
    }
}

static void print_reasons(const char *label, const bt_steady *w)
{
    char *reasons = bt_warnings_text(&w->reasons);
    printf("%s %s\n", label, reasons);
    free(reasons);
}

static void print_forces(const bt_summary *s, const bt_case *c)
{
    static const char *const loud[] = {"steady", "NOT STEADY", "TOO SHORT"};
    const bt_steady *w = &s->window;
    char a[32], b[32], d[32];
    if (w->n == 0) {
        print_reasons("  window              none:", w);
        for (int k = 0; k < BT_N_REPORTED; k++)
            if (isfinite(w->series[k].start_peak))
                printf("    largest before it %s of the %s\n", bt_force_text(a, w->series[k].start_peak),
                       w->series[k].name);
        return;
    }
    printf("  window              %g to %g s (%s), %s; %.3g independent samples", w->start, w->end,
           w->given ? "given" : "found by MSER-5", loud[w->verdict], s->ice.n_eff);
    if (isfinite(w->correlation_time)) printf(", correlation time %.3g s", w->correlation_time);
    printf("\n");
    if (w->verdict == BT_NOT_STEADY) print_reasons("    not steady       ", w);
    if (w->verdict == BT_TOO_SHORT) print_reasons("    too short        ", w);
    printf("  %s\n",
           w->verdict == BT_STEADY ? "means of the steady tow" : "means over the window, not of a steady tow");
    if (c->tow.mode == BT_TOW_NONE) printf("    ice resistance    none: nothing tows the body\n");
    else if (w->met_no_ice) printf("    ice resistance    none: the body met no ice\n");
    else print_mean("  ice resistance", &s->ice, w->at_least);
    if (bt_case_reads_field(c) || bt_case_ice_is_random(c))
        printf("    one field         the interval knows this field alone: take several %s for a number to use\n",
               bt_case_reads_field(c) ? "maps, or make fields like this one," : "values of ice.seed");
    const double *quarter = w->series[BT_REPORTED_ICE].quarter;
    printf("    quarters          %s%s,", w->at_least ? "at least: " : "", bt_force_text(a, quarter[0]));
    printf(" %s, %s, %s\n", bt_force_text(a, quarter[1]), bt_force_text(b, quarter[2]), bt_force_text(d, quarter[3]));
    printf("    step means        %s95 %% below %s, 99 %% below %s, peak %s (impulse / dt)\n",
           w->at_least ? "at least: " : "", bt_force_text(a, s->p95),
           bt_force_text(b, s->p99), bt_force_text(d, s->peak));
    if (w->series[BT_REPORTED_ICE].start_peak > s->peak)
        printf("      start           the largest, %s, lies before the window\n",
               bt_force_text(a, w->series[BT_REPORTED_ICE].start_peak));
    if (!w->at_least) // neither balance is one of numbers
        printf("    from balances     %s by %s, %s by momentum\n", bt_force_text(a, s->balance),
               bt_balance_words(), bt_force_text(b, s->budget.mean));
    print_mean("  tow force", &s->tow, w->at_least && c->tow.mode == BT_TOW_SPEED);
    printf("    drag              %s\n", bt_force_text(a, s->drag.mean));
    print_added(s, true);
    for (int k = 0; k < N_OF_THE_LINE; k++) {
        const bt_reported *r = &w->series[of_the_line[k].series];
        if (isnan(r->peak) && isnan(r->start_peak)) continue;
        if (r->present) print_mean(of_the_line[k].label, &r->mean, false);
        else printf("  %-19s none over the window: it has parted\n", of_the_line[k].label);
        printf("      peak            %s in the window", bt_force_text(a, r->peak));
        if (isfinite(r->start_peak)) printf(", %s in the start before it", bt_force_text(b, r->start_peak));
        printf("\n");
    }
    if (!isnan(c->reference.mean_force))
        printf("  measured            %s (%s): computed / measured = %.3g\n", bt_force_text(a, c->reference.mean_force),
               c->reference.source ? c->reference.source : "no source given", s->reference_ratio);
}

static void print_splits(const bt_splitting *p)
{
    const bt_split_totals *t = &p->total;
    printf("  splits              %lld: %lld at a load, %lld bent, %lld burst; cracks of %.4g m, work %.4g J\n",
           (long long)p->n, (long long)t->by_mode[BT_SPLIT_NEAR], (long long)t->by_mode[BT_SPLIT_FAR],
           (long long)t->by_mode[BT_SPLIT_BURST], t->crack_length, t->work);
    printf("    could not split   %lld by size, %lld by generation, %lld rafted, %lld without an id; %lld deferred\n",
           (long long)t->too_small, (long long)t->too_old, (long long)t->rafted, (long long)t->no_id,
           (long long)t->deferred);
}

void bt_summary_print(const bt_summary *s, const bt_history *h, const bt_case *c, const bt_run_totals *t,
                      bt_idx n_floes)
{
    if (c->run.title && *c->run.title) printf("%s\n", c->run.title);
    printf("  run                 %d floes, concentration %.3g, %lld steps of %g s = %g s\n", (int)n_floes,
           t->concentration, (long long)t->n_steps, t->dt, s->sim_time);
    bt_lead_stats_print(&t->lead);
    const bt_outline_counts *o = &t->outlines;
    if (o->read) printf("  outlines            %lld, coordinates %s\n", (long long)o->read, o->crs);
    if (o->rounded)
        printf("  outlines            %lld not convex by rounding alone, %lld corners left out, which adds %.3g m2\n",
               (long long)o->rounded, (long long)o->rounded_corners, o->rounded_area);
    if (o->hulled)
        printf("  outlines            %lld not convex and replaced by their hulls, which adds %.4g m2\n",
               (long long)o->hulled, o->hull_area);
    if (o->split)
        printf("  outlines            %lld not convex, in %lld convex parts\n", (long long)o->split,
               (long long)o->parts);
    if (s->body) print_forces(s, c);
    bt_impacts_print(s->impacts, s->window.at_least);
    if (s->body && !isnan(s->estimate.along)) {
        const bt_estimate_input *in = &s->estimate;
        printf("  estimates           at %.4g m/s through the ice", in->along);
        if (fabs(in->along - in->ordered) > 0.01 * fabs(in->ordered)) printf(" (%.4g ordered)", in->ordered);
        printf(": force, ice resistance of this run / estimate where that knows the concentration%s and holds, "
               "regime\n",
               in->channel ? " (none knows the channel)" : "");
        bt_estimates_print(in, bt_summary_held_against(s), "    ", false);
    }
    if (h->n)
        printf("  contacts            %.4g points, %.3g sweeps a step, %lld steps unconverged\n", s->contacts,
               s->sweeps, (long long)h->unconverged);
    print_added(s, false);
    print_events(t->events);
    printf("  largest overlap     %.3g m (%.2g %% of the mean floe size)\n", h->max_overlap,
           t->mean_size > 0 ? 100 * h->max_overlap / t->mean_size : 0.0);
    printf("  momentum residual   %.2g; ", h->max_momentum_residual);
    if (isnan(h->contact_work)) printf("contact work is no number, since some steps have no solution\n");
    else printf("contact work %.4g J\n", h->contact_work);
    for (int law = 0; law < BT_LAWS; law++) {
        char *line =
            bt_laws[law]->result ? bt_laws[law]->result(c, h->laws + bt_law_first_total(law), t->ice_area) : NULL;
        if (line) fputs(line, stdout);
        free(line);
    }
    if (t->splitting) print_splits(t->splitting);
    bt_summary_window_print(t->window);
    printf("  wall time           %.4g s on %d x %d (ranks x threads)", t->wall_time, t->ranks, t->threads);
    if (isfinite(s->ns_per_floe_step)) printf(", %.4g ns per floe and step", s->ns_per_floe_step);
    printf("\n ");
    print_phases(t);
    printf("  state hash          %016" PRIx64 "\n", t->state_hash);
    for (size_t i = 0; i < s->warnings.n; i++) printf("  warning: %s\n", s->warnings.text[i]);
}
