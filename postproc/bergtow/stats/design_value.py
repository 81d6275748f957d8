# SPDX-License-Identifier: MIT
"""The design statement of an ensemble: for each condition the tow force that is exceeded with a stated probability in a
tow of stated length, its interval over fields, where it holds, and warnings.

    p = 1 - exp(-T / return time):    5 % in 24 h is the level of 468 h

Warnings are facts about the model or the sample that an interval does not cover: rigid floes without a largest force, a
domain that is too narrow, windows that are not steady, a tail extrapolated far, a line that parted, a start-up (not
included in any number) with a load above the value, fields that are not alike. First of all stands that the tow holds
the body back.
"""
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bergtow import _library
from bergtow.result.members import short_key
from bergtow.result.origins import not_used, source_of_ice
from bergtow.result.origins import short as in_short
from bergtow.result.run import case_value
from bergtow.stats import loads
from bergtow.stats import alike as stat_alike
from bergtow.stats import extreme as stat_extreme
from bergtow.stats import load as stat_load
from bergtow.stats import mean as stat_mean
from bergtow.stats import profile as stat_profile
from bergtow.table import counted, hours_text, quantity, short, times_text

LONG = 2.0          # the tow of the statement / the simulated tow: above, the value is for a longer tow than simulated
FAR = 10.0          # times the simulated hours: an extrapolation beyond this is reported
WIDE = 3.0          # times the size of the value: with an upper end beyond it, it is only an order of magnitude
SHORT_FIELDS = stat_profile.LEAST_FIELDS
#: doubts about members (result/members.py: DOUBTS) that concern the value
DOUBTFUL = {
    "unconverged": "members with steps that did not converge", "jammed": "members in which the body stood still",
    "unsteady": "members whose window is not steady",
    "short": "members whose window is too short",
    "few": "members whose mean rests on contact worth fewer than 10 equal stretches, or on none",
    "stopped": "members that stopped early"
}
#: for the line "holds for": case key, words before and after its value
HOLDS_FOR = (("body.length", "body of", ""), ("body.draft", "draft", ""), ("body.drag.water_form", "form drag", ""),
             ("ice.size", "floes of", ""), ("ice.thickness", "", "thick"), ("ice.friction", "friction", ""),
             ("tow.speed", "", ""), ("domain.width", "domain", "wide"), ("run.dt", "time step", ""))
TOWED = {"speed": " prescribed", "line": " of the towing end of the line", "thrust": " asked of the vessel"}
#: keys of current and wind, with the words used if all of them are zero
STILL = {"no current": ("water.current_x", "water.current_y", "water.tide.major", "water.current_table"),
         "no wind": ("air.wind_x", "air.wind_y", "air.wind_table")}


@dataclass(frozen=True)
class Case:
    """Facts about a condition's case that a statement needs."""

    rigid: bool            #: nothing limits the force of a floe
    jams: bool             #: its rigid floes are dense enough to jam
    mode: str
    breaking_loads: dict   #: {series of a branch's tension: N}, of the branches that can part
    bollard_pull: float    #: N, NaN without a vessel
    ramp: float            #: s, over which the tow is accelerated to its speed
    texts: dict            #: {key: text}, of simulated()

    @property
    def breaking_load(self):
        """Breaking load of the weaker branch, N; NaN if none can part."""
        return min(self.breaking_loads.values(), default=np.nan)

    @property
    def breaking_words(self):
        """"150 kN", for a bridle "150 kN of branch 1, 120 kN of branch 2"; "" if no branch can part."""
        found = {name[len(loads.TENSION):]: quantity(load, "N") for name, load in self.breaking_loads.items()}
        return found["1"] if list(found) == ["1"] else ", ".join(f"{load} of branch {k}" for k, load in found.items())


def _breaking_loads(run, mode):
    keys = ("tow.line.breaking_load", "tow.branch2.breaking_load")[:int(run.value("tow.line.branches", 1.0))]
    found = {f"{loads.TENSION}{k + 1}": run.value(key, 0.0) for k, key in enumerate(keys)}
    return {name: load for name, load in found.items() if load > 0 and mode != "speed"}


def ice_as_read(run):
    """{key: actual value} for a run whose ice is read from a file, since the keys do not describe that ice."""
    if source_of_ice(run.case) is None or not run.ice.any():
        return {}
    return {"ice.concentration": f"{run.number('concentration'):.3g}", "ice.size": f"{run.sizes.mean():.3g} m",
            "ice.thickness": f"{run.mean_thickness:.3g} m"}


def tables_as_read(run):
    """{key: name of the table, with the range of speeds in the run}, of wind and current that are read from tables."""
    out = {}
    for key, name in (("air.wind_table", "wind"), ("water.current_table", "current")):
        if run.case.get(key, "none") != "none":
            file, speed = Path(run.case[key]).name, np.hypot(*(run[f"{name}_{a}"] for a in "xy"))
            out[key] = f"{file} ({speed.min():.3g} to {speed.max():.3g} m/s)" if len(speed) else file
    return out


def simulated(run):
    """{key: text} of what a run simulated: the keys of its case that had an effect, and for those of files what was
    read there. The keys that a file replaces can have any value."""
    unused = not_used(run, run.case)
    return {k: text for k, text in run.case.items() if k not in unused} | ice_as_read(run) | tables_as_read(run)


def case_of(e, rows):
    """Case of the first member of a condition that can be read, None if none can."""
    def of(run):
        limits = (run.value("ice.crushing.pressure", 0.0), run.value("ice.rafting.kappa", 0.0))
        mode, pull = run.case.get("tow.mode", ""), run.value("tow.vessel.bollard_pull", 0.0)
        return Case(not any(x > 0 for x in limits), unbounded(e, rows), mode, _breaking_loads(run, mode),
                    pull if mode == "thrust" and pull > 0 else np.nan, run.value("tow.ramp", 0.0),
                    simulated(run))
    return next(e.each(rows, of), None)


def cases(e, s):
    """[(condition of the statistics s, its Case)] for the conditions whose case can be read."""
    found = [(c, case_of(e, of.finished)) for c, of in zip(s["conditions"], e.conditions())]
    return [(c, case) for c, case in found if case]


def speed_made_good(e, rows):
    """Mean over fields of the speed in the window, m/s, with its interval; None if no member has one."""
    speeds = np.array([v for v in e.each(rows, lambda run: run.speed_made_good) if np.isfinite(v)])
    return {"value": speeds.mean(), "interval_95": stat_mean.t_interval(speeds) if len(speeds) > 1 else (np.nan, np.nan)
            } if len(speeds) else None


def _numbers(e, name, rows):
    return e.summary.get(name, np.full(e.n, np.nan))[rows]


def unbounded(e, rows):
    """Is there a member whose rigid floes jam?"""
    return bool(np.any(_numbers(e, "domain_load_unbounded", rows) == 1))


def domain(e, rows):
    """By how much the domain is too narrow, "" if it is not."""
    widths, needed = (_numbers(e, f"domain_body_widths{name}", rows) for name in ("", "_needed"))
    if np.any(few := widths < needed):
        return f"{widths[few].min():.3g} body widths; {needed[few].max():.3g} are asked for"
    return ""


def _of_the_case(e, rows, case, tow):
    """Warnings that follow from the simulated case: pairs of problem and amount."""
    out = []
    if case is None:
        out.append(("the members' cases cannot be read: it is not known whether anything limits the force", ""))
    elif case.jams:
        splits = case_value(case.texts, "ice.splitting.toughness", 0.0) > 0
        out.append((f"{'pieces of floes' if splits else 'rigid floes'} so dense that they jam: nothing in the model "
                    "limits the force of a jam, so the value has no upper bound; set ice.crushing.pressure or "
                    "ice.rafting.kappa",
                    f"{100 * np.nanmax(_numbers(e, 'concentration', rows), initial=0.0):.0f} %"))
    if case is not None and case.mode == "speed":
        out.append(("the speed is prescribed: neither vessel nor line yields", ""))
    if narrow := domain(e, rows):
        out.append(("the domain is narrow for this ice, and floes can arch to walls or to the periodic image: the "
                    "value can be too large", narrow))
    left = e.summary.get("floes_outside", np.zeros(e.n))[rows]
    if np.nanmax(left, initial=0.0) > 0:
        out.append(("floes left through the open ends of the domain and no longer resist: the value can be too small",
                    f"{np.sum(left > 0)} of {counted(len(rows))}, up to {counted(int(np.nanmax(left)), 'floe')}"))
    if case is not None and np.isfinite(case.bollard_pull) and tow and tow.get("value", 0) > case.bollard_pull:
        out.append(("the value is above the bollard pull: the vessel cannot hold it, and the tow stops first",
                    quantity(case.bollard_pull, "N")))
    return out


def _of_the_sample(e, rows, c, load):
    """Warnings about the amount of simulation and about the tail."""
    out, d = [], load["design"]
    for kind, words in DOUBTFUL.items():
        some = [words + (f", since {e.why_unsteady(m)}" if kind == "unsteady" else "")
                for m in rows if kind in e.doubts(m)]
        out += [(what, f"{some.count(what)} of {counted(len(rows))}") for what in dict.fromkeys(some)]
    if c["drift"]["verdict"] == "not steady":
        out.append(("not steady over all fields", "the mean ice resistance " + c["drift"]["words"]))
    if load["fields"] < load["members"]:
        out.append((f"members without a {load['label']}, or without a window of {stat_load.LEAST_SCALES} time scales "
                    "where it is known throughout, are left out of its numbers",
                    f"{load['members'] - load['fields']} of {counted(load['members'])}"))
    if d.get("model") == loads.CONSTANT:  # without a tail or an interval nothing else can be wrong with it
        return out
    if load["fields"] < SHORT_FIELDS:
        out.append((f"fewer than {SHORT_FIELDS} fields: the scatter between fields is not in the interval",
                    f"{load['fields']}"))
    if load["step_mean"]:
        out.append(("the time scale is not above the time step: a step mean is not a peak",
                    f"{load['time_scale_s']:g} s"))
    if "refused" in d:  # that the tow holds the body back has a warning of its own, the first
        return out + [("no value", d["refused"])] * (not d.get("below_zero"))
    out += _of_unlike_fields(load)
    hours, simulated = d["tow_hours"], np.nanmax(_numbers(e, "sim_time_s", rows), initial=0.0) / 3600
    needed = np.nanmax(_numbers(e, "domain_body_widths_needed", rows), initial=0.0)
    if hours > LONG * simulated > 0 and needed >= _library.limit("locking_body_widths"):
        out.append(("the load of ice as dense as this can grow with the length of the tow, while the value treats a "
                    "tow as a series of tows of the simulated length",
                    f"{hours_text(hours)} against {hours_text(simulated)}"))
    if d["times_the_hours_simulated"] > FAR:
        more = int(np.ceil(load["fields"] * d["times_the_hours_simulated"] / FAR))
        out.append(("extrapolated far beyond the simulated hours", f"{short(d['times_the_hours_simulated'], 2)} times; "
                    f"{counted(more, 'field')} would reduce this to {FAR:g}"))
    if d["irregular"]:
        out.append(("the fitted tail ends just above the largest value simulated: the interval cannot be relied on, "
                    "and the value can be too small", f"shape {d['shape']:.2g}"))
    if stat_extreme.beyond(d["interval_95"][1], WIDE, d["value"], load["mean"]["value"]):
        out.append((f"the interval reaches above {WIDE:g} times the value: an order of magnitude at best", ""))
    return out + _of_the_models(load)


def _of_unlike_fields(load):
    """Warning if the fields differ by more than chance; a single field gets another warning."""
    p = load["alike_p"]
    if np.isnan(p):
        return [("the windows are too short to tell whether the fields are alike, as the interval assumes", "")
                ] if load["fields"] > 1 else []
    return [] if p >= stat_alike.LEVEL else [(
        "the fields differ by more than chance within a field: the interval holds for fields that are alike, and the "
        "value can be too small, since fields worse than any of these bear the load of a longer time",
        f"{load['fields']} fields, p {'< 0.0001' if p < 1e-4 else f'= {short(p, 2)}'}")]


def start_exceeds(d):
    """Does the start-up exceed the design value or, without one, the largest value of the window? Below zero neither is
    the more to bear."""
    return d["start_up"] is not None and bool(
        stat_extreme.exceeds(d["start_up"]["largest"], max(d.get("value", d["largest"]), 0.0)))


def _of_the_start(case, load):
    """Warnings about the start-up, which no level of the windows includes. While the ramp accelerates the body, its
    inertia adds to ice and drag, and a longer ramp reduces the load; a peak at another time may have any cause."""
    found, d = load["start_up"], load["design"]
    if not start_exceeds(d | {"start_up": found, "largest": load["largest"]}):
        return []
    than = "their design value" if "value" in d else "the largest value of the window"
    words, force = f"as the largest mean over {load['time_scale_s']:.3g} s", quantity(found["largest"], load["units"])
    ramp = case.ramp if case else 0.0
    if 0 < ramp and found["time_s"] <= ramp + load["time_scale_s"]:
        # no share: the other forces may have the other sign
        inertia = f", with {quantity(found['inertia'], load['units'])} of inertia" if np.isfinite(
            found.get("inertia", np.nan)) else ""
        return [(f"the start, which the windows leave out, takes more than {than}, {words}, while the ramp of "
                 f"{ramp:.3g} s accelerates the body; a longer ramp takes less", force + inertia)]
    return [(f"the start, which the windows leave out, takes more than {than}, {words}",
             f"{force} at {times_text(found['time_s'])}")]


def steps(e, rows):
    """({series of a branch's tension: largest mean over a step in the members' whole runs, N}, {series: label}).
    Numbers of the summaries are included, which cover the steps between samples and members without their folder."""
    out, labels = {}, {}
    for found in e.each(rows, lambda run: {name: (np.fmax.reduce(run[name], initial=-np.inf), run.label(name))
                                           for name in run.series_names if name.startswith(loads.TENSION)}):
        for name, (top, label) in found.items():
            out[name], labels[name] = np.fmax(out.get(name, np.nan), top), label
    out = {name: top for name, top in out.items() if np.isfinite(top)}
    for name in (f"{loads.TENSION}{k}" for k in (1, 2)):
        some = [_numbers(e, f"window_series_{name}_{when}peak_n", rows) for when in ("", "start_")]
        top = np.fmax.reduce(np.concatenate(some), initial=-np.inf)
        if np.isfinite(top):
            out[name] = max(top, out.get(name, top))
    return out, labels


def branches(e, rows, case, found):
    """For each branch of the line its breaking load (NaN: none), the largest tension in a step, start included, and the
    design tension (NaN: none), N. found: statistics of the loads."""
    largest, labels = steps(e, rows)
    def row(name):
        load = found.get(name)
        return {"series": name, "label": labels.get(name, "line tension"), "largest_step": largest[name],
                "breaking_load": case.breaking_loads.get(name, np.nan) if case else np.nan,
                "design": load["design"].get("value", np.nan) if load else np.nan}
    return [row(name) for name in sorted(largest)]


def _of_the_line(e, rows, lines):
    """Warnings about lines that parted, or would part. A line parts by the tension in one step, while the design
    tension is a mean over the time scale, so both are compared with the breaking load; lines: from branches()."""
    out, tows = [], e.tows(rows)
    broken = [v for m in tows for v in e.events(m) if v["kind"] == loads.PARTED]
    if broken:
        parted, adrift = (loads.tows_with(e, tows, kind) for kind in (loads.PARTED, loads.ADRIFT))
        each = [f"branch {k} in {sum(v['subject'] == k for v in broken)}"
                for k in sorted({v["subject"] for v in broken} - {0})]
        first = min((v["time_s"] for v in broken if np.isfinite(v["time_s"])), default=np.nan)
        out.append(("tow force and tension have no design value where a line parts: they are cut off there, or, where "
                    "one branch of two holds, continue as those of a different tow, whose body lies differently and "
                    "can load that branch more. Means and largest values cover each tow until nothing tows it (a "
                    "tension until its branch parts), and mix the two; for a design value simulate without "
                    "breaking_load",
                    ", ".join([f"the line parted in {parted} of {counted(len(tows), 'tow')}", *each,
                               *[f"the first at {times_text(first)}"] * bool(np.isfinite(first))])
                    + f"; in {adrift} of them nothing towed the body then"))
    known = {f"{loads.TENSION}{v['subject']}" for v in broken}  # these are reported above
    for words, key, some in (("the design tension is", "design", lines),
                             ("the largest mean tension over one step, which decides when a line parts, is",
                              "largest_step",
                              [x for x in lines if x["series"] not in known])):
        above = [f"{quantity(x['breaking_load'], 'N')} of the {x['label']}, which reaches {quantity(x[key], 'N')}"
                 for x in some if x[key] > x["breaking_load"]]
        if above:
            out.append((f"{words} above the breaking load of the line", "; ".join(above)))
    return out


def _of_the_models(load):
    """Warning if the two models of the tail disagree."""
    over, blocks = (load[kind].get("levels", [None])[-1] for kind in ("over_threshold", "block_maxima"))
    if not over or not blocks or not np.isfinite([over["level"], blocks["level"]]).all():
        return []
    low, high = over["level_95"]
    if low <= blocks["level"] <= high:
        return []
    return [("peaks over a threshold and block maxima disagree on the tail",
             f"{quantity(over['level'], load['units'])} and {quantity(blocks['level'], load['units'])}")]


def statement(e, rows, c):
    """The design statement for a condition c, a dict of bergtow statistics: {"tow", "tension", "branches", "warnings",
    "speed", "holds_for", "breaking_load", "bollard_pull"}; "tow" is None if there is no tow force."""
    there = np.flatnonzero(e.condition == c["index"])
    towed = e.tows(there, excluded=False)  # including tows whose line parted before the window, not among the rows
    case, found = case_of(e, towed), c["loads"]
    tow, lines = found.get("tow_force"), branches(e, towed, case, found)
    tensions = [(load["design"], load) for load in found.values()
                if load["needs"] in loads.LINE and "value" in load["design"]]
    worst = max(tensions, key=lambda found: found[0]["value"], default=None)
    # a branch without a value may carry more than the branch with one
    if worst and any(load["largest"] > worst[0]["value"] for load in found.values()
                     if load["needs"] in loads.LINE and "value" not in load["design"]):
        worst = None
    warned = _of_the_case(e, rows, case, tow and tow["design"])
    if not len(rows):
        counts = [f"{c['members'][kind]} {kind}" for kind in ("failed", "waiting", "excluded") if c["members"][kind]]
        warned = [("nothing is known of a condition without a member in the numbers", ", ".join(counts))]
    elif tow is None:
        warned.append((f"no tow force: no member has a window of {stat_load.LEAST_SCALES} time scales in which "
                       "something is towed", ""))
    else:
        warned = _of_the_start(case, tow) + warned + _of_the_sample(e, rows, c, tow)
    for load in found.values() if len(rows) else ():
        if load["needs"] in loads.LINE:  # warnings about the sample of the tow force apply here, too
            said = _of_the_start(case, load) + _of_the_sample(e, rows, c, load)
            warned += [(f"{load['label']}: {what}", detail) for what, detail in said if (what, detail) not in warned]
    warned = _of_the_line(e, there, lines) + warned
    if c["without_bound"]["words"]:
        warned = [("means, peaks and quantiles are at least those given, and there is no design value, since nothing "
                   "bounds some loads: let ice give way (ice.rafting.kappa, ice.crushing.pressure)",
                   c["without_bound"]["words"])] + warned
    if tow and loads.held_back(tow["mean"]["value"]):
        warned = [("the tow holds the body back: current, wind or inertia carries it faster than the tow, so there is "
                   "no design value of tow, line or vessel, and the load to hold it is the smallest tow force",
                   f"down to {quantity(tow['smallest'], tow['units'])}")] + warned
    return {
        "tow": tow and {**tow["design"], "time_scale_s": tow["time_scale_s"], "fields": tow["fields"],
                        "hours": tow["hours"], "units": tow["units"], "mean": tow["mean"]["value"],
                        "mean_95": tow["mean"]["interval_95"],
                        "largest": tow["largest"], "smallest": tow["smallest"], "start_up": tow["start_up"]},
        "speed": speed_made_good(e, rows),
        "tension": worst and {**worst[0], "label": worst[1]["label"], "largest": worst[1]["largest"],
                              "mean": worst[1]["mean"]["value"]},
        "warnings": [{"what": what, "detail": detail} for what, detail in warned], "branches": lines,
        "breaking_load": case.breaking_load if case else np.nan,
        "bollard_pull": case.bollard_pull if case else np.nan, "holds_for": _holds_for(e, case)}


def in_words(case, key):
    """The value of a key of a Case; a table is in words already, with its name, which may contain numbers."""
    return case.texts[key] if key.endswith("_table") else in_short(case.texts[key])


def moves(case, key):
    """Is a key of current or wind set?"""
    return case.texts.get(key, "none").split(" ")[0] not in ("0", "none")


def named(key, words):
    return f"{short_key(key).replace('.', ' ')} {words}"


def _moved(e, case):
    """Current and wind in words: "no current", or the values of the case, unless the study varies them. They must be
    stated, because a current changes the speed of the tow through the water."""
    for words, keys in STILL.items():
        there = [key for key in keys if moves(case, key)]
        yield from (named(key, in_words(case, key)) for key in there if key not in e.parameters)
        if not there and not any(key in e.parameters for key in keys):
            yield words


def _lead(e, case):
    """The lead ahead of the body in words; none if the study varies whether there is one. With a lead, ice was removed
    or cut and no longer has the floes described here."""
    mode, size = case.texts.get("lead.mode", "none"), case.texts.get("lead.floe_size", "")
    if mode == "none" or "lead.mode" in e.parameters:
        return []
    sides = [f"{in_short(case.texts[key])} {word}" for key, word in (("lead.width", "wide"), ("lead.length", "long"))
             if key in case.texts and key not in e.parameters]
    pieces = "without floes" if mode == "channel" else "of pieces" if "lead.floe_size" in e.parameters else \
        f"of pieces up to {in_short(size)}"
    return [" ".join(["a lead", *" and ".join(sides).split(), pieces])]


def _holds_for(e, case):
    """"floes of 30 m, 1 m thick, ...": the keys that the study does not vary, with the values of the case."""
    if case is None:
        return ""
    said = [(in_words(case, key), before, behind + (TOWED.get(case.mode, "") if key == "tow.speed" else ""))
            for key, before, behind in HOLDS_FOR if key in case.texts and key not in e.parameters
            and (key != "body.length" or case.texts.get("body.shape") != "polygon")]
    return ", ".join([" ".join(part for part in (before, value, behind.strip()) if part)
                      for value, before, behind in said] + _lead(e, case) + list(_moved(e, case)))
