# SPDX-License-Identifier: MIT
"""The contents of a run's report: numbers in words, tables, pictures. Its template is reporting/page/run.html."""
import re
from dataclasses import replace

from bergtow import progress
from bergtow import table as text_table
from bergtow.errors import RunError
from bergtow.plot import style, vector
from bergtow.plot import field as plot_field
from bergtow.plot import force as plot_force
from bergtow.plot import impacts as plot_impacts
from bergtow.plot import resistance as plot_resistance
from bergtow.reporting.replay import LIMIT, Replay
from bergtow.result import origins as report_case
from bergtow.result.at_least import AtLeast

import numpy as np

#: keys that the page shows directly; all others are in the collapsed table
KEY_VALUES = {
    "Ice": ["ice.concentration", "ice.shape", "ice.size", "ice.size_law", "ice.thickness", "ice.thickness_law",
            "ice.density", "ice.friction", "ice.restitution", "ice.crushing.pressure", "ice.rafting.kappa",
            "ice.splitting.toughness", "ice.field", "ice.outlines", "ice.seed", "lead.mode"],
    "Towed body": ["body.shape", "body.length", "body.width", "body.draft", "body.sail", "body.density", "body.mass",
                   "body.friction", "body.drag.water_form"],
    "Tow": ["tow.mode", "tow.speed", "tow.programme", "tow.waypoints", "tow.ramp", "tow.line.type", "tow.line.diameter",
            "tow.line_length", "tow.line_stiffness", "tow.line_damping", "tow.line.breaking_load", "tow.vessel.mass",
            "tow.vessel.bollard_pull", "tow.vessel.free_speed"],
    "Domain and environment": [
        "domain.length", "domain.width", "domain.ends", "domain.sides", "water.current_x", "water.current_y",
        "water.current_table", "water.tilt", "water.latitude", "air.wind_x", "air.wind_y", "air.wind_table"],
    "Numerical": [
        "run.dt", "run.duration", "output.window_start", "solver.tolerance", "solver.max_sweeps", "impact.conversion",
        "impact.duration", "impact.pressure"],
}
MAX_EVENTS = 40  #: rows in the table; a tow may have thousands of waypoints
UNSET = {"body.mass": "0 kg"}  #: values that mean "derived from other keys"


def force(value):
    """A force in words, a dash if there is none."""
    return style.quantity(value, "N")


def with_interval(mean, low, high):
    """(mean, 95 % interval) of a force in words, with the digits that the interval justifies."""
    if np.isfinite([mean, low, high]).all() and 0 <= high - low < 2e-6 * abs(mean):
        return force(mean), "no scatter" if high > low else "–"
    return text_table.stated(mean, low, high, "N")


def share(value):
    """A relative residual in words."""
    return f"{value:.1e}" if np.isfinite(value) else "–"


def picture(name, title, draw):
    """A figure as {"kind", "name", "title", "svg"}; {"kind", "name", "title", "why"} if draw() raises RunError; None if
    it returns None."""
    out = {"kind": "figure", "name": name, "title": title}
    with progress.doing(f"picture: {title}"):
        try:
            figure = draw()
        except RunError as error:
            return out | {"why": f"{error.reason}; {error.remedy}"}
        return out | {"svg": vector.of_figure(figure, name, title)} if figure else None


def pictures(run):
    field = [("field", "Ice field before, during and after", lambda: plot_field.draw(run)),
             ("loaded", "Contact force on the floes", lambda: plot_field.draw(run, "force"))]
    some = field if run.n_floes and run.n_frames else []
    if run.towed is not None:
        some = [("force", "Force on the towed body", lambda: plot_force.draw(run)), *some,
                ("impacts", "Loads around the hull, and how often a peak is exceeded", lambda: plot_impacts.draw(run)),
                ("resistance", "Resistance against concentration: this run and the estimates",
                 lambda: plot_resistance.draw([plot_resistance.read(run.path)])),
                ("solver", "Contact solver", lambda: plot_force.draw_diagnostics(run))]
    return [picture(*one) for one in some]


def start_peak(run, key="start_peak_line_tension_n"):
    """The largest value before the window, in words."""
    before = run.number(key)
    return f"; in the start before it {force(before)}" if np.isfinite(before) else ""


def ice_start_peak(run):
    """The same for the ice resistance, if it exceeds all values in the window."""
    key = "window.series.ice_resistance.start_peak_n"
    return start_peak(run, key) if run.number(key) > run.number("peak_ice_resistance_n") else ""


def line_tension(run):
    """[(label, number, text)] of the largest tension; none without a line."""
    n = run.number
    return [("largest line tension", force(n("peak_line_tension_n")), "mean over a step, within the window" +
             start_peak(run))] if np.isfinite([n("peak_line_tension_n"), n("start_peak_line_tension_n")]).any() else []


def source_of_reference(run):
    return run.summary["reference"].get("source") or "source not stated"


def figures(run):
    """The few numbers at the top of the page: (label, number, text below it)."""
    if run.towed is None:
        return []
    n = run.number
    window = f"{run.window_name} {style.times_text(*run.window)}" if run.window else "no window"
    name = run.mean_name
    (ice, ice_range), (tow, tow_range) = (with_interval(*run.interval(key)) for key in ("ice_resistance", "tow_force"))
    out = [(f"ice resistance, {name}", ice,
            (f"95 % interval {ice_range}; " if ice_range != "–" else "no interval; ") + window),
           (f"tow force, {name}", tow, f"95 % interval {tow_range}"),
           ("largest ice resistance in a step", force(n("peak_ice_resistance_n")),
            (run.summary.get("peak_conversion") or "") + ice_start_peak(run))]
    out += line_tension(run)
    if np.isfinite([n("impacts.largest.peak_n"), n("impacts.start_largest_peak_n")]).any():
        out.append(("largest peak of a collision", force(n("impacts.largest.peak_n")),
                    f"{run.summary['impacts']['conversion']}, within the window" +
                    start_peak(run, "impacts.start_largest_peak_n")))
    if np.isfinite(n("reference.mean_force_n")):
        out.append(("simulated / measured", style.short(n("reference.ratio")),
                    f"measured {force(n('reference.mean_force_n'))}: {source_of_reference(run)}"))
    return out


# by the first word of a summary key: how a quantity is taken together over the window
RULES = {"mean": "mean", "max": "largest", "sum": "sum", "last": "last value"}


def forces(run):
    """Rows (quantity, value, interval, remark) over the window."""
    if run.towed is None:
        return []
    n, rows = run.number, []
    for name in run.by_role("balance", "force", "load"):
        key = run.attribute(name, "summary") or f"mean_{name}_n"
        mean = n(key)
        if not np.isfinite(mean) and name not in ("ice_resistance", "tow_force"):
            peaks = [n(f"window.series.{name}.{when}peak_n") for when in ("", "start_")]
            if np.isfinite(peaks).any():
                rows.append((f"{run.label(name)}, largest step mean", force(peaks[0]), "",
                             "no mean over the window: it parted" +
                             start_peak(run, f"window.series.{name}.start_peak_n")))
            continue
        rule, unit = key.partition("_")[0], run.attribute(name, "units")
        if rule != "mean" or unit != "N":  # of a program
            rows.append((f"{run.label(name)}, {RULES[rule]} over the window", style.quantity(mean, unit), "",
                         run.description(name)))
            continue
        known = re.fullmatch(r"mean_(.*)_n", key)
        value, interval = with_interval(*run.interval(known[1])) if known else (force(mean), "–")
        bounded = run.at_least and not isinstance(mean, AtLeast)  # drag, inertia
        rows.append((f"{run.label(name)}, {'mean over the window' if bounded else run.mean_name}", value,
                     interval if interval != "–" else "", run.description(name)))
    quarters = ((run.summary.get("window") or {}).get("series") or {}).get("ice_resistance", {}).get("quarters_n")
    if quarters:
        rows.append(("ice resistance by quarters of the window", ", ".join(force(q) for q in quarters), "", ""))
    conversion = run.summary.get("peak_conversion") or ""
    rows += [("standard deviation of the ice resistance", force(n("sd_ice_resistance_n")), "", conversion),
             ("95 % of the step means are below", force(n("p95_ice_resistance_n")), "", conversion),
             ("99 % of the step means are below", force(n("p99_ice_resistance_n")), "", conversion),
             ("largest step mean", force(n("peak_ice_resistance_n")), "", conversion + ice_start_peak(run))]
    rows += [(what, value, "", remark) for what, value, remark in line_tension(run)]
    if np.isfinite(n("reference.mean_force_n")):
        rows += [("measured mean force (reference)", force(n("reference.mean_force_n")), "", source_of_reference(run)),
                 ("simulated / measured", style.short(n("reference.ratio")), "", "")]
    return rows


def estimates(run):
    """Rows of the published and derived estimates."""
    rows = []
    for estimate in run.estimates.values():
        e = estimate.numbers
        spread = None not in (e["force_n"], e["high_n"], e["low_n"]) and e["high_n"] > e["low_n"]
        ratio = e["simulated_over_estimate"] if estimate.compares else None
        rows.append({"label": estimate.label, "force": force(e["force_n"]),
                     "range": f"{force(e['low_n'])} to {force(e['high_n'])}" if spread else "",
                     "ratio": style.short(ratio) if ratio is not None else "–", "valid": estimate.valid,
                     **{key: e[key] for key in ("note", "formula", "source")}})
    return rows


def impacts(run):
    """Collisions with the body: {"conversion", "rows", "exceedance"}, None if they were not recorded separately."""
    i = run.summary.get("impacts")
    if not isinstance(i, dict):
        return None
    rows = [("collisions in the window", f"{i['collisions']:.0f} in {style.short(60 * run.number('impacts.hours'))} "
             f"min; {i['collisions_whole_run']:.0f} in the whole run"),
            ("mean ice resistance by collisions", force(run.number("impacts.mean_collision_resistance_n"))),
            ("mean ice resistance, quasi-static", force(run.number("impacts.mean_quasi_static_resistance_n"))),
            ("largest quasi-static normal load of a floe, wall or shore",
             force(run.number("impacts.largest_quasi_static_load_n")) +
             start_peak(run, "impacts.start_largest_quasi_static_load_n"))]
    big = i.get("largest")
    if isinstance(big, dict):
        body = int(big["floe"]) - run.n_start
        struck = run.bodies[body].name if 0 <= body < len(run.bodies) else f"floe {big['floe']}"
        rows.append(("largest peak", f"{force(big['peak_n'])} (mean {force(big['mean_n'])} over "
                     f"{style.short(big['duration_s'])} s, impulse {style.short(big['impulse_ns'])} N s, approach "
                     f"{style.short(big['approach_m_s'])} m/s), {struck} at {style.times_text(big['time_s'])}" +
                     start_peak(run, "impacts.start_largest_peak_n")))
    elif np.isfinite(run.number("impacts.start_largest_peak_n")):
        rows.append(("largest peak", "none in the window" + start_peak(run, "impacts.start_largest_peak_n")))
    return {"conversion": i["conversion"], "rows": rows,
            "exceedance": [(f"{e['rank']:.0f}", style.short(e["per_hour"]), force(e["peak_n"]))
                           for e in i.get("exceedance") or []]}


def quality(run):
    """Rows (what, value, remark) that show how reliable the numbers are: window, balances, solver."""
    n, rows = run.number, []
    if run.window:
        rule = {"given": "begin given in the case",
                "mser5": "begin found from the series (MSER-5)"}.get(run.summary["window"].get("rule"), "")
        rows += [("verdict", *run.verdict),
                 (run.window_name, f"{style.times_text(*run.window)}, {n('window.n_samples'):.0f} samples", rule),
                 ("independent samples in it", style.short(n("window.n_independent")),
                  f"correlation time {style.short(n('window.correlation_time_s'))} s"
                  if np.isfinite(n("window.correlation_time_s")) else "")]
    if run.towed is not None:
        rows += [(f"balance of the body: ice − ({run.balance})", share(n("budget.closure_relative")),
                  "relative to the largest of them"),
                 ("ice resistance by momentum", share(n("budget.ice_momentum_closure_relative")),
                  "without the contacts of the body, relative to the largest of them")]
    rows += [("momentum residual", share(n("momentum_residual")),
              "largest of all steps, relative to what a step exchanges"),
             ("steps not converged", f"{n('unconverged_steps'):.0f} of {n('n_steps'):.0f}",
              f"largest residual {n('max_residual_m_s'):.2g} m/s, tolerance {n('tolerance_m_s'):.2g} m/s"),
             ("largest overlap", f"{style.short(1000 * n('max_overlap_m'), 2)} mm",
              f"{100 * n('max_overlap_relative'):.2g} % of the mean floe size"
              if np.isfinite(n("max_overlap_relative")) else ""),
             ("contact work", f"{style.short(n('contact_work_j'))} J" if np.isfinite(n("contact_work_j")) else "–",
              f"{n('positive_work_steps'):.0f} steps in which the contacts added energy")]
    if n("crushing_steps", 0):
        rows.append(("crushed", f"{style.short(n('crushed_work_j'))} J",
                     f"in {n('crushing_steps'):.0f} steps, deepest {style.short(n('max_crushed_depth_m'))} m"))
    if n("max_rafted_area_m2", 0):
        rows.append(("rafted", f"{style.short(n('rafted_area_m2'))} m²",
                     f"{100 * n('rafted_share_of_ice'):.2g} % of the ice, {n('rafting_pairs'):.0f} pairs; edges took "
                     f"{style.short(n('raft_edge_work_j'))} J, {style.short(n('rafted_energy_j'))} J of it in the "
                     f"sheets' height, friction {style.short(n('raft_friction_work_j'))} J"))
    if run.summary.get("splitting"):
        at, bent, burst, steps, small, old = (n(f"splitting.{name}") for name in (
            "near", "far", "burst", "steps", "refused_size", "refused_generation"))
        sizes = (f"floes of {style.short(n('splitting.size_before_m'))} m (median √A) into pieces of "
                 f"{style.short(n('splitting.piece_size_m'))} m; " if n("splitting.splits") else "")
        rows.append(("splits", f"{n('splitting.splits'):.0f}",
                     f"{at:.0f} opened at a contact, {bent:.0f} bent, {burst:.0f} burst, in {steps:.0f} steps; cracks "
                     f"of {style.short(n('splitting.crack_length_m'))} m; {sizes}times not split: {small:.0f} because "
                     f"a piece would have been too small or slender, {old:.0f} in the last generation"))
    if n("stalled_s", 0):
        rows.append(("body stood still", f"{style.short(n('stalled_s'))} s", "while the tow asked for motion"))
    return rows


def events(run):
    """(rows of events, their total number)."""
    units = {"line_broken": "N", "adrift": "m/s", "waypoint": "m"}
    some = sorted(run.events, key=lambda e: e["kind"] == "waypoint")[:MAX_EVENTS]  # a broken line comes before corners
    rows = [(style.times_text(e["time_s"]), e["kind"].replace("_", " "), str(e["subject"]),
             f"{style.short(e['value'])} {units.get(e['kind'], '')}".strip() if e["value"] is not None else "")
            for e in sorted(some, key=lambda e: e["time_s"])]
    return rows, len(run.events)


def provenance(run):
    """Rows (what, value) on how the run was made."""
    a = run.attributes
    rows = [("program", f"{a.get('program', 'bergtow')} {a.get('version', '')}, revision "
             f"{a.get('revision', 'unknown')}"), *((what, a.get(what)) for what in ("compiler", "flags", "libraries")),
            ("command line", re.sub(r"\S*/(?=[^\s/])", "", str(a.get("command_line", "")))),
            ("ranks × threads", f"{a.get('ranks', '?')} × {a.get('threads', '?')}"), ("started", a.get("start_time")),
            ("host", a.get("host")), ("wall time", f"{style.short(run.number('wall_time_s'))} s"),
            ("state hash", run.summary.get("state_hash")), ("folder", run.path.resolve().name)]
    return [(name, report_case.scrubbed(str(value))) for name, value in rows if value not in (None, "")]


def stamp(run):
    """One line that identifies this run uniquely."""
    a = run.attributes
    return (f"bergtow {a.get('version', '')} (revision {a.get('revision', 'unknown')}), "
            f"started {a.get('start_time', 'at an unknown time')}, "
            f"state hash {run.summary.get('state_hash', 'unknown')}")


def key_values(run, values):
    """{heading: [Value]}: the values that distinguish runs."""
    by_key, out = {v.key: v for v in values}, {}
    for heading, keys in KEY_VALUES.items():
        if heading in ("Towed body", "Tow") and run.towed is None or heading == "Ice" and not run.n_floes:
            continue
        out[heading] = (report_case.of_field(run) if heading == "Ice" else []) + [
            v for v in map(by_key.get, keys) if v and v.kind != "unused" and v.value not in
            ("", "none", UNSET.get(v.key))]
    return out


def breakable(text):
    """A title on one line."""
    return re.sub(r"\s+", " ", str(text)).strip()


def context(run, limit=LIMIT, compress=True, given=None):
    """The template variables of page/run.html. Raises RunError."""
    values = [replace(v, value=report_case.short(v.value)) for v in report_case.values(run)]
    with progress.doing(f"replay of {run.n_frames} frames"):
        replay = Replay(run, limit, compress) if run.n_frames else None
    happened, n_events = events(run)
    block = report_case.title_block(run.case, run.attributes, given or {})
    return {
        "block": block if any(value != "–" for _, value in block[:len(report_case.TITLE_BLOCK)]) else [],
        "marked": report_case.marked(block), "title": breakable(run.summary.get("title") or run.path.resolve().name),
        "stamp": stamp(run), "conditions": style.conditions(run),
        "verdict": run.verdict[0], "reason": run.verdict[1], "window_name": run.window_name,
        "warnings": [warning["text"] for warning in run.warnings] if isinstance(run.summary.get("warnings"), list)
        else ["summary.json holds no list of warnings"],
        "figures": figures(run), "forces": forces(run), "estimates": estimates(run),
        "conditions_of_estimates": run.summary.get("estimates") or {}, "impacts": impacts(run), "quality": quality(run),
        "events": happened, "n_events": n_events, "provenance": provenance(run), "key_values": key_values(run, values),
        "values": values, "kinds": report_case.KINDS,
        "n_assumed": sum(v.kind in ("assumed", "memory", "reported") for v in values),
        "preface": report_case.preface(run.case_text), "case_text": run.case_text, "resolved_text": run.resolved_text,
        "pictures": pictures(run), "replay": replay}
