# SPDX-License-Identifier: MIT
"""The design loads of an ensemble, member by member and condition by condition.

    tow_force, ice_resistance     and every series that the program registers as a load of line or vessel
    floe_force                    largest force of one floe on the hull in a step, or the peak of a collision
    panel_load                    load on the hull panel where it is largest (cases with output.panels)

Names, units and labels come from the members' files. All except floe_force are filtered (stats/load.py). That load is
local and lasts as long as a collision; its value depends on impact.conversion, which is stated with it.

A line that parts. The tension of a branch counts until it parts, all other loads until no branch is left: after that
there is no tow, and its zeros would enter every number. Neither tow force nor tension then exceeds the strength of the
branches, and every load ends at its largest. So if a line parted in any tow there is no tail, and no design value.
Rejected: a lower bound, which would take the place of a design value but be below the breaking load.

A body that is held back, since current, wind or inertia carries it faster than the tow. The level that a force below
zero seldom exceeds is its smallest magnitude, the moment of least load: no design value. Nor is there one of line and
vessel, which cannot push. Rejected: the level of the force with its sign turned, since a tow that holds by a line from
behind is another tow than the simulated one.

Time scale. 30 s by default: a bollard pull trial averages its readings over this time for the largest static pull,
while the continuous pull, used to choose a towing vessel, is a mean over 10 min [IMO 1998, MSC/Circ.884, Guidelines for
safe ocean towing]. So the vessel must hold a tow force of 30 s by thrust and not by its inertia. Shorter loads reach
neither vessel nor line: a berg of 80 m on 600 m of line has a period of minutes. At model scale the time scale is
shorter by the square root of the length scale (estimate.length_scale), by Froude's law; so are the hours of a tow.
"""
from dataclasses import dataclass

import numpy as np

from bergtow.arguments import above_zero, share
from bergtow.errors import RunError
from bergtow.result.members import EXCLUDABLE
from bergtow.result.run import Run, least
from bergtow.stats import alike as stat_alike
from bergtow.stats import extreme as stat_extreme
from bergtow.stats import load as stat_load
from bergtow.table import counted, quantity

TIME_SCALE = 30.0     # s, full scale
TOW_HOURS = 24.0      # h, full scale
PROBABILITY = 0.05
ALWAYS = ("tow_force", "ice_resistance")
ROLE = "load"
LOCAL = ("floe_force", "panel_load")  # on a part of the hull
LINE = ("line", "bridle")             # the tension of a branch requires one of these
TENSION = "line_tension_"             # followed by the number of the branch
PARTED, ADRIFT = "line_broken", "adrift"  # events: a branch parts; none is left
TAILS = ("over_threshold", "block_maxima")
CONSTANT = "constant"                 # in place of the model of a tail


@dataclass(frozen=True)
class Load:
    """A load, as described in the files."""

    name: str
    label: str
    units: str
    description: str
    needs: str = ""       #: registry name of the part of a tow that it requires
    refused: str = ""     #: why there are no statistics for it
    conversion: str = ""  #: definition of the collision peaks in it; "" if it does not depend on a conversion


def filler(run):
    """Function that turns a series into a load: `least` if the run has steps without a solution; other NaN are kept."""
    return least if run.number("no_load_steps") > 0 else np.asarray


def _floe_force(run, filled):
    """[(Load, values)] of the largest force of one floe; none if collisions are not recorded separately."""
    names = "largest_quasi_static_load", "impact_peak"
    if not all(name in run and np.isfinite(run[name]).any() for name in names):
        return []
    steps, (push, peak) = run.steps_per_sample, (run[name] for name in names)
    return [(Load("floe_force", "force of one floe", run.units(names[0]),
                  "largest normal force of one floe or wall on the towed body: as the mean over a step, or the peak of "
                  "a collision", conversion=str(run.impacts["conversion"]),
                  refused=f"of every {steps} steps only the largest was kept; set output.sample_every: 1"
                  if steps > 1 else ""), np.maximum(filled(push), peak))]


def of_run(run):
    """[(Load, values)] of a run, and the times of the values; panel loads are [n, panels]."""
    filled, panels = filler(run), run.panel_series
    out = [(Load(name, run.label(name), run.units(name), run.description(name), run.attribute(name, "needs")),
            filled(run[name])) for name in [n for n in ALWAYS if n in run] + run.by_role(ROLE)
           if np.isfinite(run[name]).any()] + _floe_force(run, filled)
    if "load" in panels:
        load = Load("panel_load", "load on one hull panel", panels["units"],
                    "sum of the normal forces on a panel of the hull, the largest of them")
        out.append((load, filled(panels["load"])))
    return out, run["time"]


def of_member(e, m):
    """The same for a member of an ensemble; if its folder is missing, the loads in ensemble.h5."""
    try:
        with Run(e.folder(m)) as run:
            return of_run(run)
    except RunError:
        there = [name for name in ALWAYS if name in e.described]
        return [(Load(name, *e.described[name]), e.series(m, name)[1]) for name in there], e.series(m)[0]


def scaling(e, rows):
    """Time at full scale / time in a condition: the square root of its length scale."""
    return e.scaling(rows[0]) if len(rows) else 1.0


def until(e, m, name):
    """Time until which a load of a member belongs to a tow, s: for a tension until its branch parts, for any other load
    until no branch is left."""
    return min((v["time_s"] for v in e.events(m) if v["kind"] == PARTED and name == f"{TENSION}{v['subject']}"),
               default=e.adrift(m))


def tows_with(e, rows, *kinds):
    """How many of the members' tows had an event of these kinds."""
    return sum(any(v["kind"] in kinds for v in e.events(m)) for m in rows)


def cut_off(e, rows, load):
    """Why a load has no tail, "" if it may have one: steps without a solution, or parted lines if the load depends on
    them. Excluded tows count, because the remaining ones are those that the line survived."""
    through_the_line, tows = load.name == ALWAYS[0] or load.needs in LINE, e.tows(rows)
    if without := e.without_bound(rows):
        return str(without)
    n = tows_with(e, tows, *[PARTED] * through_the_line, ADRIFT)
    return f"the line parted in {n} of {counted(len(tows), 'tow')}" if n else ""


def bounded(found, without):
    """Names of the loads of a condition that a line bounds, even in steps without a solution: tensions, and with them
    the tow force. Empty if tows ended because of such steps: which tows are left then depends on their loads."""
    tensions = {name for name, x in found.items() if x["needs"] in LINE}
    return set() if without.ended or not tensions else tensions | {ALWAYS[0]}


def in_window(e, m, time_scale):
    """[(Load, field, start)] of a member: every load in the window, as long as it belongs to a tow, and before the
    window, in the formats of stat_load.field_of and start_up, None where undefined."""
    out, (some, time) = [], of_member(e, m)
    start, end = e.window(m, time)
    for load, x in some if np.isfinite([start, end]).all() else []:
        scale, last = 0.0 if load.conversion else time_scale, min(end, until(e, m, load.name))
        out.append((load, stat_load.field_of(time, x, start, last, scale),
                    stat_load.start_up(time, x, start, last, scale)))
    return out


def gather(e, rows, options):
    """({name: (Load, [field, ...], start)}, {name: {"label", "why"}}) of a condition: the fields from
    stat_load.field_of; the largest start-up of all its tows, including those whose line parts in it; and the loads that
    are left out, because they are refused, or contain collisions that the members convert differently. A field with a
    constant load counts like any other: ice that the tow does not meet gives a load of zero, and its hours count.
    options: time_scale (None: the default)."""
    out, starts, why = {}, {}, {}
    time_scale = options.time_scale or TIME_SCALE / scaling(e, rows)
    for m in e.tows(rows, excluded=False):
        for load, field, start in in_window(e, m, time_scale):
            if load.refused:
                why[load.name] = {"label": load.label, "why": load.refused}
                continue
            if start is not None:
                starts.setdefault(load.name, []).append(start | {"member": int(m)})
            if field is not None and m in rows:
                out.setdefault(load.name, []).append((load, field | {"member": int(m)}))
    found = {}
    for name, some in out.items():
        load, fields = some[0][0], [field for _, field in some]
        if len({load.conversion for load, _ in some}) > 1:
            why[name] = {"label": load.label, "why": "members convert its collisions in different ways"}
        else:
            found[name] = load, fields, max(starts.get(name, []), key=lambda s: s["largest"], default=None)
    return found, why


def held_back(mean):
    """Does the tow hold the body back, by its mean force?"""
    return mean < 0


def _below_zero(load, mean, tow):
    """Why a load has no design value, "" if the signs of the mean load and the mean tow force, NaN if unknown, allow
    one."""
    if held_back(tow) and (load.needs or load.name == ALWAYS[0]):
        return "the tow holds the body back"
    return "its mean is below zero, so the level that it seldom exceeds is its least" if mean < 0 else ""


def _design(found, hours, total):
    """The level of the last return time from peaks over a threshold, or from block maxima if there are too few. There
    is none if its interval is not bounded: the sample then does not determine the tail, and such a level
    has been a hundred times the largest simulated load."""
    for kind, model in (("over_threshold", "GPD"), ("block_maxima", "GEV")):
        level = found[kind].get("levels", [{"level": np.nan}])[-1]
        if np.isfinite(level["level"]):
            if np.isinf(level["level_95"][1]):
                return {"refused": "the sample does not determine the tail: the interval of its level has no upper "
                                   "bound; run more fields", "return_hours": hours, "unbounded": True}
            return {"value": level["level"], "interval_95": level["level_95"], "model": model, "return_hours": hours,
                    "times_the_hours_simulated": hours / total, "beyond_data": bool(hours > total),
                    "shape": found[kind]["shape"], "irregular": found[kind]["irregular"]}
    return {"refused": "; ".join(dict.fromkeys(found[kind].get("refused", "no level") for kind in TAILS)),
            "return_hours": hours}


def statistics(e, rows, options, gathered=None):
    """{name: all statistics of a load} of the members of a condition; options: time_scale and tow_hours (None: the
    default), probability, hours, resamples. gathered: the result of gather(), if known."""
    gathered = gather(e, rows, options)[0] if gathered is None else gathered
    tow_hours = options.tow_hours or TOW_HOURS / scaling(e, rows)
    design_hours, out = stat_extreme.return_hours(options.probability, tow_hours), {}
    means = {name: np.mean([f["peak"].mean() for f in fields]) for name, (_, fields, _) in gathered.items()}
    for name, (load, fields, start) in gathered.items():
        gap, total = stat_load.gap_of(fields), sum(f["hours"] for f in fields)
        start_up = start and {what: start[what] for what in ("largest", "time_s")}
        if start and name == ALWAYS[0]:
            start_up |= {"inertia": _inertia(e, start["member"], start["time_s"], start["scale"])}
        why, constant = cut_off(e, rows, load), stat_load.constant(fields)
        # where there are floes, a tow that meets none of them does not know the load of one that does
        itself = constant and not why and bool(np.all(e.summary.get("n_floes", np.full(e.n, np.nan))[rows] == 0))
        if constant and not why:
            why = f"constant, {quantity(fields[0]['peak'][0], load.units)}, in {counted(len(fields), 'field')}"
        found = {kind: {"refused": why} for kind in TAILS} if why else stat_load.extremes(
            fields, gap, [*options.hours, design_hours], options.resamples)
        below = _below_zero(load, means[name], means.get(ALWAYS[0], np.nan))
        out[name] = {
            "label": load.label, "units": load.units, "description": load.description, "needs": load.needs,
            "conversion": load.conversion,
            "time_scale_s": float(np.median([f["scale"] for f in fields])),
            "step_mean": bool(not load.conversion and any(f["scale"] < 1.5 * f["dt"] for f in fields)),
            "fields": len(fields), "members": len(e.tows(rows, excluded=False)), "hours": total, "gap_s": gap,
            **stat_load.summary(fields), "constant": constant,
            "alike_p": np.nan if constant else stat_alike.p_value(fields, stat_load.LEAST_GAPS * gap),
            "start_up": start_up,
            "exceedance": stat_load.exceedance(fields, gap), **found, "design": {
                "probability": options.probability, "tow_hours": tow_hours,
                **({"refused": below, "below_zero": True, "return_hours": design_hours} if below else
                   # nothing makes it vary: its value is itself, and there is no tail to extrapolate
                   {"value": fields[0]["peak"][0], "interval_95": (fields[0]["peak"][0],) * 2, "model": CONSTANT,
                    "return_hours": design_hours, "times_the_hours_simulated": design_hours / total,
                    "beyond_data": False, "shape": np.nan, "irregular": False} if itself else
                   _design(found, design_hours, total))}}
    return out


def _inertia(e, m, end, scale):
    """Mean inertia force of a member's body over the time scale before `end`, N; NaN if its folder is missing."""
    def mean(run):
        some = (run["time"] > end - scale + 1e-9) & (run["time"] <= end + 1e-9)
        return float(run["inertia_force"][some].mean()) if "inertia_force" in run and some.any() else np.nan
    return next(e.each([m], mean), np.nan)


def panels(e, rows):
    """Means over the window and largest step means for every panel of the hull, over the fields that were towed to the
    end of the window: {"mean", "mean_95", "mean_of_largest", "mean_of_largest_95", "largest" [P], "bearing_deg" [P] of
    panel midpoints from the body's x axis towards y, "units", "fields"}; None if members have no panels, or different
    numbers of them."""
    found = list(e.each([m for m in rows if not e.cut(m)], lambda run: run.panels | {
        "units": run.panel_series["units"]}))
    mean, largest = ([x[name] for x in found] for name in ("mean_load", "max_load"))
    if not mean or len({len(x) for x in mean}) > 1 or not np.isfinite(mean).all():
        return None
    def over(x):
        return np.array([stat_load.mean_over_fields(column, 0.0) for column in np.array(x).T])
    middle = found[0]["middle"]
    return {"units": found[-1]["units"], "fields": len(mean), "mean": np.mean(mean, axis=0), "mean_95": over(mean),
            "largest": np.max(largest, axis=0), "mean_of_largest": np.mean(largest, axis=0),
            "mean_of_largest_95": over(largest),
            "bearing_deg": np.degrees(np.arctan2(middle[:, 1], middle[:, 0])) % 360}


def add_options(p):
    """Add the options of the statistics of loads, and --exclude."""
    p.add_argument("--exclude", action="append", choices=EXCLUDABLE, default=[],
                   help="leave out members with this doubt, and list them; may be repeated")
    p.add_argument("--time-scale", type=above_zero, metavar="S",
                   help="loads are moving means over this time, s (default: 30 at full scale, by Froude's law at model "
                        "scale: stats/loads.py says why)")
    p.add_argument("--tow-hours", type=above_zero, metavar="H",
                   help="length of the tow for the design values, h (default: 24 at full scale)")
    p.add_argument("--probability", type=share, default=PROBABILITY, metavar="P",
                   help="probability that the design value is exceeded in such a tow (default %(default)s)")
