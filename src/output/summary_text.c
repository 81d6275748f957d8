// SPDX-License-Identifier: MIT
// The summary as a table for readers; as JSON: summary_keys.c.
#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "output/estimate_text.h"
#include "base/units.h"
#include "output/impact_count.h"
#include "output/summary.h"
#include "step/splitting.h"
#include "case/case_derived.h"
#include "case/warning.h"

/// Print the shares of the wall time in one line, and in another the share of each phase done by several threads.
static void print_phases(const bt_run_totals *totals)
{
#define NAME(name, text) #name,
#define SECONDS(name, text) totals->phases.name,
#define SHARED(name, text) totals->shared.name,
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
    if (totals->threads < 2) return;
    printf("  shared by threads  ");
    for (int i = 0; i < n; i++)
        printf(" %s %.0f %%%s", names[i], seconds[i] > 0 ? bt_min(100, 100 * shared[i] / seconds[i]) : 0.0,
               i + 1 < n ? "," : "\n");
}

/// Reported series that not every run has, and their labels in the table.
static const struct { bt_reported_series series; const char *label; } of_the_line[] = {
    {BT_REPORTED_TENSION_1, "  line tension"},
    {BT_REPORTED_TENSION_2, "  second branch"},
    {BT_REPORTED_THRUST, "  vessel thrust"},
};
enum { N_OF_THE_LINE = sizeof of_the_line / sizeof *of_the_line };

static void print_events(const bt_events *events)
{
    char text[160];
    for (int64_t i = 0; events && i < events->n && i < BT_EVENTS_REPORTED; i++) {
        bt_event_describe(&events->event[i], text);
        printf("  event               %g s: %s\n", events->event[i].time, text);
    }
    if (events && events->n > BT_EVENTS_REPORTED)
        printf("  event               and %" PRId64 " more, in /events of result.h5\n", events->n - BT_EVENTS_REPORTED);
}

static void print_mean(const char *label, const bt_mean *mean, bool at_least)
{
    char a[32], b[32], d[32], e[32];
    if (at_least) {
        printf("  %-19s at least %s\n", label, bt_force_text(a, mean->mean));
        return;
    }
    printf("  %-19s %s, 95 %% interval %s to %s, sd %s\n", label, bt_force_text(a, mean->mean),
           bt_force_text(b, mean->low), bt_force_text(d, mean->high), bt_force_text(e, mean->sd));
}

/// Print registered quantities: forces among the forces, all others after them.
static void print_added(const bt_summary *summary, bool forces)
{
    for (int k = 0; k < summary->n_added; k++) {
        const bt_quantity *quantity = bt_added(k);
        const bool force = quantity->role == BT_ROLE_BALANCE || quantity->role == BT_ROLE_FORCE ||
                           quantity->role == BT_ROLE_LOAD;
        if (force != forces || isnan(summary->added[k])) continue;
        const bool plain = !strcmp(quantity->units, "1");
        printf(force ? "    %-17s %.4g%s%s (%s)\n" : "  %-19s %.4g%s%s (%s)\n", quantity->label, summary->added[k],
               plain ? "" : " ", plain ? "" : quantity->units, bt_keep_names[quantity->keep]);
    }
}

static void print_reasons(const char *label, const bt_steady *steady)
{
    char *reasons = bt_warnings_text(&steady->reasons);
    printf("%s %s\n", label, reasons);
    free(reasons);
}

static void print_forces(const bt_summary *summary, const bt_case *input)
{
    static const char *const loud[] = {"steady", "NOT STEADY", "TOO SHORT"};
    const bt_steady *steady = &summary->window;
    char a[32], b[32], d[32];
    if (steady->n == 0) {
        print_reasons("  window              none:", steady);
        for (int k = 0; k < BT_N_REPORTED; k++)
            if (isfinite(steady->series[k].start_peak))
                printf("    largest before it %s of the %s\n", bt_force_text(a, steady->series[k].start_peak),
                       steady->series[k].name);
        return;
    }
    printf("  window              %g to %g s (%s), %s; %.3g independent sample%s", steady->start, steady->end,
           steady->given ? "given" : "found by MSER-5", loud[steady->verdict], summary->ice.n_eff,
           summary->ice.n_eff == 1 ? "" : "s");
    if (isfinite(steady->correlation_time)) printf(", correlation time %.3g s", steady->correlation_time);
    printf("\n");
    if (steady->verdict == BT_NOT_STEADY) print_reasons("    not steady       ", steady);
    if (steady->verdict == BT_TOO_SHORT) print_reasons("    too short        ", steady);
    printf("  %s\n",
           steady->verdict == BT_STEADY ? "means of the steady tow" : "means over the window, not of a steady tow");
    if (input->tow.mode == BT_TOW_NONE) printf("    ice resistance    none: nothing tows the body\n");
    else if (steady->met_no_ice) printf("    ice resistance    none: the body met no ice\n");
    else print_mean("  ice resistance", &summary->ice, steady->at_least);
    if (bt_case_reads_field(input) || bt_case_ice_is_random(input))
        printf("    one field         the interval excludes the scatter between ice fields; repeat with other %s "
               "before using this mean\n",
               bt_case_reads_field(input) ? "maps, or fields made like this one," : "values of ice.seed");
    const double *quarter = steady->series[BT_REPORTED_ICE].quarter;
    printf("    quarters          %s%s,", steady->at_least ? "at least: " : "", bt_force_text(a, quarter[0]));
    printf(" %s, %s, %s\n", bt_force_text(a, quarter[1]), bt_force_text(b, quarter[2]), bt_force_text(d, quarter[3]));
    printf("    step means        %s95 %% below %s, 99 %% below %s, peak %s (impulse / dt)\n",
           steady->at_least ? "at least: " : "", bt_force_text(a, summary->p95),
           bt_force_text(b, summary->p99), bt_force_text(d, summary->peak));
    if (steady->series[BT_REPORTED_ICE].start_peak > summary->peak)
        printf("      start           the largest, %s, lies before the window\n",
               bt_force_text(a, steady->series[BT_REPORTED_ICE].start_peak));
    if (!steady->at_least) // neither balance has valid numbers
        printf("    from balances     %s by %s, %s by momentum\n", bt_force_text(a, summary->balance),
               bt_balance_words(), bt_force_text(b, summary->budget.mean));
    print_mean("  tow force", &summary->tow, steady->at_least && input->tow.mode == BT_TOW_SPEED);
    printf("    drag              %s\n", bt_force_text(a, summary->drag.mean));
    print_added(summary, true);
    for (int k = 0; k < N_OF_THE_LINE; k++) {
        const bt_reported *reported = &steady->series[of_the_line[k].series];
        if (isnan(reported->peak) && isnan(reported->start_peak)) continue;
        if (reported->present) print_mean(of_the_line[k].label, &reported->mean, false);
        else printf("  %-19s none over the window: it has parted\n", of_the_line[k].label);
        printf("      peak            %s in the window", bt_force_text(a, reported->peak));
        if (isfinite(reported->start_peak))
            printf(", %s in the start before it", bt_force_text(b, reported->start_peak));
        printf("\n");
    }
    if (!isnan(input->reference.mean_force))
        printf("  measured            %s (%s): computed / measured = %.3g\n",
               bt_force_text(a, input->reference.mean_force), input->reference.source
               ? input->reference.source : "no source given", summary->reference_ratio);
}

static void print_splits(const bt_splitting *splitting, int64_t n_steps)
{
    const bt_split_totals *totals = &splitting->total;
    const long long opened = totals->by_mode[BT_SPLIT_OPENED], bent = totals->by_mode[BT_SPLIT_BENT],
                    burst = totals->by_mode[BT_SPLIT_BURST];
    printf("  splits              %lld: %lld opened at a contact, %lld bent, %lld burst; cracks of %.4g m, work %.4g "
           "J\n",
           (long long)splitting->n, opened, bent, burst, totals->crack_length, totals->work);
    if (splitting->n > 0)
        printf("    sizes             floes of %.3g m (median) into pieces of %.3g m, the smallest of %.3g m; in "
               "%.2g %% of the steps\n",
               bt_splitting_size(splitting, true, 50), bt_splitting_size(splitting, false, 50),
               bt_splitting_size(splitting, false, 0), 100.0 * (double)totals->steps / (double)n_steps);
    printf("    times not split   %lld piece too small or slender, %lld last generation, %lld rafted, %lld out of ids; "
           "%lld left to the next step\n",
           (long long)totals->refused_size, (long long)totals->refused_generation, (long long)totals->refused_rafted,
           (long long)totals->refused_reserve, (long long)totals->deferred);
}

static void print_window(const bt_window *window)
{
    if (!window) return;
    printf("  moving window       %.3g times its length; %lld floes renewed, %lld kept; %lld floes found no place, "
           "%lld wait to enter\n",
           bt_window_laps(window), (long long)window->renewed, (long long)window->kept, (long long)window->missed,
           (long long)window->waiting);
}

void bt_summary_print(const bt_summary *summary, const bt_history *history, const bt_case *input,
                      const bt_run_totals *totals, bt_idx n_floes)
{
    if (input->run.title && *input->run.title) printf("%s\n", input->run.title);
    printf("  run                 %d floes, concentration %.3g, %lld steps of %g s = %g s\n", (int)n_floes,
           totals->concentration, (long long)totals->n_steps, totals->dt, summary->sim_time);
    bt_lead_stats_print(&totals->lead);
    const bt_outline_counts *counts = &totals->outlines;
    if (counts->read) printf("  outlines            %lld, coordinates %s\n", (long long)counts->read, counts->crs);
    if (counts->rounded)
        printf("  outlines            %lld not convex by rounding alone, %lld corners left out, which adds %.3g m2\n",
               (long long)counts->rounded, (long long)counts->rounded_corners, counts->rounded_area);
    if (counts->hulled)
        printf("  outlines            %lld not convex and replaced by their hulls, which adds %.4g m2\n",
               (long long)counts->hulled, counts->hull_area);
    if (counts->split)
        printf("  outlines            %lld not convex, in %lld convex parts\n", (long long)counts->split,
               (long long)counts->parts);
    if (summary->body) print_forces(summary, input);
    bt_impacts_print(summary->impacts, summary->window.at_least);
    if (summary->body && !isnan(summary->estimate.along)) {
        const bt_estimate_input *in = &summary->estimate;
        printf("  estimates           at %.4g m/s through the ice", in->along);
        if (fabs(in->along - in->ordered) > 0.01 * fabs(in->ordered)) printf(" (%.4g ordered)", in->ordered);
        printf(": estimate; simulated / estimate (where valid and dependent on concentration%s%s); validity\n",
               in->channel ? "; none accounts for the channel" : "",
               in->changes_speed ? "; none accounts for a speed that changes in the window" : "");
        bt_estimates_print(in, bt_summary_held_against(summary), "    ", false);
    }
    if (history->n)
        printf("  contacts            %.4g points, %.3g sweeps a step, %lld steps unconverged\n", summary->contacts,
               summary->sweeps, (long long)history->unconverged);
    print_added(summary, false);
    print_events(totals->events);
    printf("  largest overlap     %.3g m (%.2g %% of the mean floe size)\n", history->max_overlap,
           totals->mean_size > 0 ? 100 * history->max_overlap / totals->mean_size : 0.0);
    printf("  momentum residual   %.2g; ", history->max_momentum_residual);
    if (isnan(history->contact_work)) printf("contact work is undefined, since some steps have no solution\n");
    else printf("contact work %.4g J\n", history->contact_work);
    for (int law = 0; law < BT_LAWS; law++) {
        char *line =
            bt_laws[law]->result
            ? bt_laws[law]->result(input, history->laws + bt_law_first_total(law), totals->ice_area) : NULL;
        if (line) fputs(line, stdout);
        free(line);
    }
    if (totals->splitting) print_splits(totals->splitting, totals->n_steps);
    print_window(totals->window);
    printf("  wall time           %.4g s on %d x %d (ranks x threads)", totals->wall_time, totals->ranks,
           totals->threads);
    if (isfinite(summary->ns_per_floe_step)) printf(", %.4g ns per floe and step", summary->ns_per_floe_step);
    printf("\n ");
    print_phases(totals);
    printf("  state hash          %016" PRIx64 "\n", totals->state_hash);
    for (size_t i = 0; i < summary->warnings.n; i++) printf("  warning: %s\n", summary->warnings.text[i]);
}
