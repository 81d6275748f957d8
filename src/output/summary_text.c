// SPDX-License-Identifier: MIT
// The summary as JSON for scripts and as a table for readers.
#include <inttypes.h>
#include <math.h>
#include <stdio.h>

#include "output/estimate_text.h"
#include "base/units.h"
#include "output/impact_report.h"
#include "base/json.h"
#include "output/summary.h"
#include "output/summary_window.h"

typedef struct phase_row { const char *name; double seconds; } phase_row;
#define N_PHASES 7
enum { MAX_EVENTS = 40 }; // told one by one; all are in result.h5

static void phase_rows(const bt_phases *p, phase_row rows[N_PHASES])
{
    const phase_row all[N_PHASES] = {{"detect", p->detect}, {"colour", p->colour}, {"forces", p->forces},
                                     {"solve", p->solve}, {"advance", p->advance}, {"exchange", p->exchange},
                                     {"output", p->output}};
    for (int i = 0; i < N_PHASES; i++) rows[i] = all[i];
}

static const char *const lead_names[] = {"none", "channel", "managed"};

static void json_lead(bt_json *j, const bt_lead_stats *l)
{
    if (l->mode == BT_LEAD_NONE) {
        bt_json_string(j, "lead", NULL);
        return;
    }
    bt_json_open(j, "lead", '{');
    bt_json_string(j, "mode", lead_names[l->mode]);
    bt_json_number(j, "width_m", l->width);
    bt_json_number(j, "length_m", l->length);
    bt_json_int(j, l->mode == BT_LEAD_CHANNEL ? "floes_removed" : "floes_cut", l->taken);
    bt_json_number(j, l->mode == BT_LEAD_CHANNEL ? "area_removed_m2" : "area_cut_m2", l->area_taken);
    bt_json_int(j, "pieces", l->pieces);
    bt_json_number(j, "mean_piece_m", l->pieces > 0 ? l->mean_piece : NAN);
    bt_json_number(j, "concentration_before", l->concentration_before);
    bt_json_number(j, "concentration_after", l->concentration_after);
    bt_json_close(j, '}');
}

static void json_outlines(bt_json *j, const bt_outline_counts *o)
{
    bt_json_open(j, "outlines", '{');
    bt_json_int(j, "read", o->read);
    bt_json_int(j, "turned", o->turned);
    bt_json_int(j, "dropped_vertices", o->dropped);
    bt_json_int(j, "rounded", o->rounded);
    bt_json_int(j, "rounded_corners", o->rounded_corners);
    bt_json_number(j, "rounded_area_added_m2", o->rounded_area);
    bt_json_int(j, "hulled", o->hulled);
    bt_json_number(j, "hull_area_added_m2", o->hull_area);
    bt_json_int(j, "split", o->split);
    bt_json_int(j, "parts", o->parts);
    bt_json_number(j, "origin_lon_deg", o->read ? o->lon * 180 / BT_PI : NAN);
    bt_json_number(j, "origin_lat_deg", o->read ? o->lat * 180 / BT_PI : NAN);
    bt_json_number(j, "origin_east_m", o->read ? o->east : NAN);
    bt_json_number(j, "origin_north_m", o->read ? o->north : NAN);
    bt_json_string(j, "crs", o->read ? o->crs : "");
    bt_json_int(j, "nearly_thickness", o->unnamed);
    bt_json_close(j, '}');
}

/// Reported series that not every run has: which, in keys of summary.json, in the printed table.
static const struct { bt_reported_series series; const char *key, *label; } of_the_line[] = {
    {BT_REPORTED_TENSION_1, "line_tension", "  line tension"},
    {BT_REPORTED_TENSION_2, "line_tension_2", "  second branch"},
    {BT_REPORTED_THRUST, "vessel_thrust", "  vessel thrust"},
};
enum { N_OF_THE_LINE = sizeof of_the_line / sizeof *of_the_line };

/// Mean with standard error and 95 % interval: mean_KEY_n, mean_KEY_se_n, mean_KEY_low_n, mean_KEY_high_n.
static void json_mean(bt_json *j, const char *key, const bt_mean *m)
{
    const struct {
        const char *suffix;
        double value;
    } row[] = {{"", m->mean}, {"_se", m->se}, {"_low", m->low}, {"_high", m->high}};
    for (int k = 0; k < 4; k++) {
        char name[80];
        snprintf(name, sizeof name, "mean_%s%s_n", key, row[k].suffix);
        bt_json_number(j, name, row[k].value);
    }
}

/// What the verdict rests on: of each reported series the trend, the quarters, the independent samples, and the peaks
/// within and before the window.
static void json_reported(bt_json *j, const bt_steady *w)
{
    bt_json_open(j, "series", '{');
    for (int k = 0; k < BT_N_REPORTED; k++) {
        const bt_reported *r = &w->series[k];
        if (!r->present || w->n == 0) continue;
        bt_json_open(j, r->key, '{');
        bt_json_number(j, "mean_n", r->mean.mean);
        bt_json_number(j, "mean_low_n", r->mean.low);
        bt_json_number(j, "mean_high_n", r->mean.high);
        bt_json_number(j, "n_independent", r->mean.n_eff);
        bt_json_number(j, "change_n", r->trend.change);
        bt_json_number(j, "change_low_n", r->trend.low);
        bt_json_number(j, "change_high_n", r->trend.high);
        bt_json_open(j, "quarters_n", '[');
        for (int q = 0; q < 4; q++) bt_json_number(j, NULL, r->quarter[q]);
        bt_json_close(j, ']');
        bt_json_number(j, "peak_n", r->peak);
        bt_json_number(j, "start_peak_n", r->start_peak);
        bt_json_close(j, '}');
    }
    bt_json_close(j, '}');
}

static void json_window(bt_json *j, const bt_summary *s)
{
    const bt_steady *w = &s->window;
    const char *reason = s->body && w->verdict != BT_STEADY ? w->reason : NULL;
    bt_json_open(j, "window", '{');
    bt_json_string(j, "verdict", s->body ? bt_verdict_names[w->verdict] : NULL);
    bt_json_string(j, "reason", reason);
    bt_json_number(j, "earliest_s", s->body ? w->earliest : NAN);
    bt_json_number(j, "start_s", w->start);
    bt_json_number(j, "end_s", w->end);
    bt_json_int(j, "n_samples", w->n);
    bt_json_number(j, "n_independent", w->n ? s->ice.n_eff : NAN);
    bt_json_number(j, "correlation_time_s", w->correlation_time);
    bt_json_number(j, "unconverged_share", w->n ? w->unconverged : NAN);
    bt_json_number(j, "max_residual_m_s", w->n ? w->residual : NAN);
    bt_json_string(j, "rule", !s->body ? NULL : w->given ? "given" : "mser5");
    bt_json_string(j, "warning", reason);
    if (s->body) json_reported(j, w);
    bt_json_close(j, '}');
}

/// Largest of the two branches within the window, or before it.
static double peak_tension(const bt_steady *w, bool before)
{
    static const bt_reported_series branch[] = {BT_REPORTED_TENSION_1, BT_REPORTED_TENSION_2};
    double most = NAN;
    for (int k = 0; k < 2; k++) {
        const bt_reported *r = &w->series[branch[k]];
        const double x = before ? r->start_peak : r->peak;
        if (r->present && !(x <= most)) most = x;
    }
    return most;
}

static void json_forces(bt_json *j, const bt_summary *s, const bt_case *c)
{
    const bt_steady *w = &s->window;
    const bt_mean none = bt_stats_mean(NULL, 0);
    json_mean(j, "ice_resistance", &s->ice);
    bt_json_number(j, "sd_ice_resistance_n", s->ice.sd);
    bt_json_number(j, "p95_ice_resistance_n", s->p95);
    bt_json_number(j, "p99_ice_resistance_n", s->p99);
    bt_json_number(j, "peak_ice_resistance_n", s->peak);
    bt_json_string(j, "peak_conversion", "mean over a step, impulse / dt");
    json_mean(j, "tow_force", &s->tow);
    bt_json_number(j, "peak_tow_force_n", s->body && w->n ? w->series[BT_REPORTED_TOW].peak : NAN);
    bt_json_number(j, "start_peak_tow_force_n", s->body ? w->series[BT_REPORTED_TOW].start_peak : NAN);
    for (int k = 0; k < N_OF_THE_LINE; k++) {
        const bt_reported *r = &w->series[of_the_line[k].series];
        json_mean(j, of_the_line[k].key, s->body && r->present ? &r->mean : &none);
    }
    bt_json_number(j, "peak_line_tension_n", s->body ? peak_tension(w, false) : NAN);
    bt_json_number(j, "start_peak_line_tension_n", s->body ? peak_tension(w, true) : NAN);
    bt_json_number(j, "mean_drag_force_n", s->drag.mean);
    bt_json_number(j, "mean_coriolis_force_n", s->coriolis.mean);
    bt_json_number(j, "mean_tilt_force_n", s->tilt.mean);
    for (int k = 0; k < bt_n_law_series(); k++) {
        char key[80];
        snprintf(key, sizeof key, "mean_%s_force_n", bt_force_series_of[bt_law_series(k)].name);
        bt_json_number(j, key, s->law[k].mean);
    }
    bt_json_number(j, "mean_inertia_force_n", s->inertia.mean);
    bt_json_number(j, "mean_ice_resistance_budget_n", s->budget.mean);
    bt_json_open(j, "budget", '{');
    bt_json_number(j, "tow_minus_other_forces_n", s->balance);
    bt_json_number(j, "closure_n", s->closure);
    bt_json_number(j, "closure_relative", s->closure_relative);
    bt_json_number(j, "ice_momentum_closure_relative", s->budget_closure_relative);
    bt_json_close(j, '}');
    json_window(j, s);
    if (isnan(c->reference.mean_force)) {
        bt_json_string(j, "reference", NULL);
        return;
    }
    bt_json_open(j, "reference", '{');
    bt_json_number(j, "mean_force_n", c->reference.mean_force);
    bt_json_string(j, "source", c->reference.source);
    bt_json_number(j, "ratio", s->reference_ratio);
    bt_json_close(j, '}');
}

static void json_events(bt_json *j, const bt_events *e)
{
    bt_json_open(j, "events", '[');
    for (int64_t i = 0; e && i < e->n && i < MAX_EVENTS; i++) {
        bt_json_open(j, NULL, '{');
        bt_json_number(j, "time_s", e->event[i].time);
        bt_json_string(j, "kind", bt_event_names[e->event[i].kind]);
        bt_json_int(j, "subject", e->event[i].subject);
        bt_json_number(j, "value", e->event[i].value);
        bt_json_close(j, '}');
    }
    bt_json_close(j, ']');
    bt_json_int(j, "n_events", e ? e->n : 0);
}

static void print_events(const bt_events *e)
{
    char text[160];
    for (int64_t i = 0; e && i < e->n && i < MAX_EVENTS; i++) {
        bt_event_describe(&e->event[i], text);
        printf("  event               %g s: %s\n", e->event[i].time, text);
    }
    if (e && e->n > MAX_EVENTS)
        printf("  event               and %" PRId64 " more, in /events of result.h5\n", e->n - MAX_EVENTS);
}

char *bt_summary_json(const bt_summary *s, const bt_history *h, const bt_case *c, const bt_run_totals *t,
                      bt_idx n_floes)
{
    bt_json j = {0};
    bt_json_open(&j, NULL, '{');
    bt_json_string(&j, "title", c->run.title);
    bt_json_string(&j, "version", BT_VERSION);
    bt_json_int(&j, "n_floes", n_floes);
    bt_json_int(&j, "n_steps", t->n_steps);
    bt_json_number(&j, "dt_s", t->dt);
    bt_json_number(&j, "sim_time_s", s->sim_time);
    bt_json_number(&j, "wall_time_s", t->wall_time);
    bt_json_int(&j, "ranks", t->ranks);
    bt_json_int(&j, "threads", t->threads);
    bt_json_int(&j, "divisions", t->divisions);
    bt_json_int(&j, "moved_floes", t->moved_floes);
    bt_json_number(&j, "imbalance", t->imbalance);
    bt_json_number(&j, "worst_imbalance", t->worst_imbalance);
    bt_json_number(&j, "dealt_imbalance", t->dealt_imbalance);
    bt_json_number(&j, "worst_dealt_imbalance", t->worst_dealt_imbalance);
    bt_json_number(&j, "edge_cut", t->edge_cut);
    bt_json_number(&j, "halo_share", t->halo_share);
    bt_json_number(&j, "memory_per_floe_b", n_floes > 0 ? t->memory / (double)n_floes : NAN);
    bt_json_number(&j, "sweep_bytes_per_contact", t->sweep_bytes_per_contact);
    bt_json_number(&j, "concentration", t->concentration);
    bt_json_number(&j, "mean_size_m", t->mean_size);
    json_lead(&j, &t->lead);
    json_outlines(&j, &t->outlines);
    json_forces(&j, s, c);
    bt_impacts_json(&j, s->impacts);
    if (s->body) bt_estimates_json(&j, "estimates", &s->estimate, s->ice.mean);
    else bt_json_string(&j, "estimates", NULL);
    bt_json_number(&j, "max_overlap_m", h->max_overlap);
    bt_json_number(&j, "max_overlap_relative", t->mean_size > 0 ? h->max_overlap / t->mean_size : NAN);
    bt_json_int(&j, "unconverged_steps", h->unconverged);
    bt_json_number(&j, "max_residual_m_s", h->max_residual);
    bt_json_number(&j, "tolerance_m_s", t->tolerance);
    bt_json_number(&j, "mean_sweeps", s->sweeps);
    bt_json_number(&j, "mean_unit_updates", s->updates);
    bt_json_number(&j, "mean_momentum_moves", s->moves);
    bt_json_int(&j, "unprojected_steps", h->unprojected);
    bt_json_number(&j, "contacts_mean", s->contacts);
    bt_json_number(&j, "contact_work_j", h->contact_work);
    bt_json_number(&j, "crushed_work_j", h->crushed_work);
    bt_json_number(&j, "max_crushed_depth_m", h->max_crushed_depth);
    bt_json_int(&j, "crushing_steps", h->crushing_steps);
    bt_json_number(&j, "max_crushing_contacts", h->max_crushing);
    bt_json_number(&j, "rafting_pairs", h->rafting);
    bt_json_number(&j, "rafted_area_m2", h->rafted_area);
    bt_json_number(&j, "rafted_share_of_ice", t->ice_area > 0 ? h->rafted_area / t->ice_area : 0);
    bt_json_number(&j, "max_rafted_area_m2", h->max_rafted_area);
    bt_json_number(&j, "largest_rafted_pair_m2", h->rafted_largest);
    bt_json_number(&j, "rafted_energy_j", h->rafted_energy);
    bt_json_number(&j, "raft_edge_work_j", h->raft_edge_work);
    bt_json_number(&j, "raft_friction_work_j", h->raft_friction_work);
    bt_json_number(&j, "stalled_s", t->stall.time);
    bt_json_int(&j, "stalled_windows", t->stall.windows);
    bt_json_int(&j, "positive_work_steps", h->positive_work);
    bt_json_int(&j, "repeated_solves", h->repeats);
    bt_json_int(&j, "outrun_steps", h->outrun);
    bt_json_int(&j, "restitution_cut_steps", h->restitution_cut);
    bt_json_number(&j, "momentum_residual", h->max_momentum_residual);
    bt_json_int(&j, "floes_outside", t->floes_outside);
    bt_summary_window_json(&j, t->window);
    bt_json_number(&j, "ns_per_floe_step", s->ns_per_floe_step);
    phase_row rows[N_PHASES];
    phase_rows(&t->phases, rows);
    bt_json_open(&j, "phases_s", '{');
    for (int i = 0; i < N_PHASES; i++) bt_json_number(&j, rows[i].name, rows[i].seconds);
    bt_json_close(&j, '}');
    char hash[17];
    snprintf(hash, sizeof hash, "%016" PRIx64, t->state_hash);
    bt_json_string(&j, "state_hash", hash);
    bt_json_string(&j, "stopped", t->stopped);
    json_events(&j, t->events);
    bt_json_open(&j, "warnings", '[');
    for (size_t i = 0; i < s->warnings.n; i++) bt_json_string(&j, NULL, s->warnings.text[i]);
    bt_json_close(&j, ']');
    bt_json_close(&j, '}');
    return j.text;
}

static void print_mean(const char *label, const bt_mean *m)
{
    char a[32], b[32], d[32], e[32];
    printf("  %-19s %s, 95 %% interval %s to %s, sd %s\n", label, bt_force_text(a, m->mean), bt_force_text(b, m->low),
           bt_force_text(d, m->high), bt_force_text(e, m->sd));
}

static void print_forces(const bt_summary *s, const bt_case *c)
{
    static const char *const loud[] = {"steady", "NOT STEADY", "TOO SHORT"};
    const bt_steady *w = &s->window;
    char a[32], b[32], d[32];
    if (w->n == 0) {
        printf("  window              none: %s\n", w->reason);
        return;
    }
    printf("  window              %g to %g s (%s), %s; %.3g independent samples, correlation time %.3g s\n", w->start,
           w->end, w->given ? "given" : "found by MSER-5", loud[w->verdict], s->ice.n_eff, w->correlation_time);
    if (w->verdict != BT_STEADY) printf("    %-17s %s\n", bt_verdict_names[w->verdict], w->reason);
    printf("  %s\n",
           w->verdict == BT_STEADY ? "means of the steady tow" : "means over the window, not of a steady tow");
    print_mean("  ice resistance", &s->ice);
    printf("    one field         the interval knows this field alone: take several values of ice.seed for a number to "
           "use\n");
    const double *quarter = w->series[BT_REPORTED_ICE].quarter;
    printf("    quarters          %s,", bt_force_text(a, quarter[0]));
    printf(" %s, %s, %s\n", bt_force_text(a, quarter[1]), bt_force_text(b, quarter[2]), bt_force_text(d, quarter[3]));
    printf("    step means        95 %% below %s, 99 %% below %s, peak %s (impulse / dt)\n", bt_force_text(a, s->p95),
           bt_force_text(b, s->p99), bt_force_text(d, s->peak));
    printf("    from balances     %s by tow - drag - Coriolis - tilt - inertia, %s by the momentum of the ice\n",
           bt_force_text(a, s->balance), bt_force_text(b, s->budget.mean));
    print_mean("  tow force", &s->tow);
    printf("    drag              %s\n", bt_force_text(a, s->drag.mean));
    for (int k = 0; k < bt_n_law_series(); k++)
        printf("    %-17s %s\n", bt_force_series_of[bt_law_series(k)].name, bt_force_text(a, s->law[k].mean));
    for (int k = 0; k < N_OF_THE_LINE; k++) {
        const bt_reported *r = &w->series[of_the_line[k].series];
        if (!r->present) continue;
        print_mean(of_the_line[k].label, &r->mean);
        printf("      peak            %s in the window", bt_force_text(a, r->peak));
        if (isfinite(r->start_peak)) printf(", %s in the start before it", bt_force_text(b, r->start_peak));
        printf("\n");
    }
    if (!isnan(c->reference.mean_force))
        printf("  measured            %s (%s): computed / measured = %.3g\n", bt_force_text(a, c->reference.mean_force),
               c->reference.source ? c->reference.source : "no source given", s->reference_ratio);
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
    bt_impacts_print(s->impacts);
    if (s->body && !isnan(s->estimate.along)) {
        printf("  estimates           at %.4g m/s through the ice: force, ice resistance of this run / estimate where "
               "that knows the concentration and holds, regime\n",
               s->estimate.along);
        bt_estimates_print(&s->estimate, s->ice.mean, "    ", false);
    }
    if (h->n)
        printf("  contacts            %.4g points, %.3g sweeps a step, %lld steps unconverged\n", s->contacts,
               s->sweeps, (long long)h->unconverged);
    print_events(t->events);
    printf("  largest overlap     %.3g m (%.2g %% of the mean floe size)\n", h->max_overlap,
           t->mean_size > 0 ? 100 * h->max_overlap / t->mean_size : 0.0);
    printf("  momentum residual   %.2g; contact work %.4g J\n", h->max_momentum_residual, h->contact_work);
    if (c->ice.crushing_pressure > 0)
        printf("  crushed             %.4g J in %lld steps, at most %.0f contact points at once, deepest %.3g m\n",
               h->crushed_work, (long long)h->crushing_steps, h->max_crushing, h->max_crushed_depth);
    if (c->ice.rafting_kappa > 0)
        printf("  rafted              %.4g m2 at the end, %.3g %% of the ice, in %.0f pairs; edges took %.4g J, %.4g J "
               "of it in the sheets' height, friction between sheets %.4g J\n",
               h->rafted_area, t->ice_area > 0 ? 100 * h->rafted_area / t->ice_area : 0.0, h->rafting,
               h->raft_edge_work, h->rafted_energy, h->raft_friction_work);
    bt_summary_window_print(t->window);
    printf("  wall time           %.4g s on %d x %d (ranks x threads)", t->wall_time, t->ranks, t->threads);
    if (isfinite(s->ns_per_floe_step)) printf(", %.4g ns per floe and step", s->ns_per_floe_step);
    printf("\n ");
    phase_row rows[N_PHASES];
    phase_rows(&t->phases, rows);
    double sum = 0;
    for (int i = 0; i < N_PHASES; i++) sum += rows[i].seconds;
    for (int i = 0; i < N_PHASES; i++)
        printf(" %s %.1f %%%s", rows[i].name, sum > 0 ? 100 * rows[i].seconds / sum : 0.0,
               i + 1 < N_PHASES ? "," : "\n");
    printf("  state hash          %016" PRIx64 "\n", t->state_hash);
    for (size_t i = 0; i < s->warnings.n; i++) printf("  warning: %s\n", s->warnings.text[i]);
}
