# SPDX-License-Identifier: MIT
"""The results of bergtow capability, as parts of bergtow/table.py and as a picture."""
from bergtow.result.members import reading
from bergtow.table import Table, Warned, number, quantity, scale, short, span

import numpy as np

FAR_LOAD = 2  # times the largest tension: a larger breaking load is not shown in the picture


def value(found, x):
    """A value of the searched key with its unit: concentration in %, angles in degrees."""
    if x is None:
        return "–"
    factor, unit = reading(found["search"], found["unit"])
    return quantity(x, "N") if unit == "N" else f"{short(factor * x)} {unit}".strip()


def condition(found, c):
    """Words for a condition, under a heading that names its key."""
    return c["label"].removeprefix(f"{found['for']} ")


def limits(found):
    head = [found["for"] or "case", "passes at", "fails at", "limit about", "runs", "verdict"]
    rows = []
    for c in found["conditions"]:
        verdict = ": ".join(w for w in ("resolved" if c["resolved"] else "not resolved", c["why"]) if w)
        ends = [value(found, c[k]) for k in ("makes_it", "does_not", "estimate")]
        rows.append([condition(found, c), *ends, str(c["runs"]), verdict])
    return Table(head, rows)


def least_of(values):
    """Lower limit for an interval of their mean: 0, unless some are below, as speeds of a body driven back."""
    return min((x for x in values if x is not None and x < 0), default=0.0)


def curve(found):
    head = [found["for"] or "case", found["search"], "succeed", "stood still", "failed runs", "line parted",
            "speed, m/s (95 %)", "mean tow force", "largest tension: mean", "of all"]
    rows = []
    for c in found["conditions"]:
        for p in c["points"]:
            low, high = p["mean_speed_95"]
            band = "" if low is None else f" ({number(max(low, least_of(p['speed'])))} to {number(high)})"
            tension = [x for x in p["tension"] if x is not None]
            made = f"{p['made']} of {p['fields']}"
            rows.append([condition(found, c), value(found, p["value"]), made, str(p.get("stood_still", "–")),
                         str(p["failed"]), str(p["parted"]),
                         number(p["mean_speed"]) + band, quantity(p["mean_tow_force"], "N"),
                         quantity(p["mean_tension"], "N"), quantity(max(tension, default=None), "N")])
    return Table(head, rows)


def breaking_loads(found):
    """The breaking load at each value of each condition, N; None or 0 where the line never parts."""
    return [[p.get("breaking_load", found["breaking_load"]) for p in c["points"]] for c in found["conditions"]]


def kept(found):
    """The speed to be kept, in words; a tow of an ordered speed of its own has a speed to keep of its own."""
    return "a tenth of its tow.speed" if found["speed"] is None else f"{number(found['speed'])} m/s"


def meaning(found):
    """The meaning of the words in the tables, and the cost of the study."""
    runs, failed = sum(c["runs"] for c in found["conditions"]), sum(
        p["failed"] for c in found["conditions"] for p in c["points"])
    line = ", and no branch of its line parts" if any(map(any, breaking_loads(found))) else ""
    more = (f" {failed} runs failed: other fields were run, and a value counts as decided where none of those that "
            "failed could have changed it.") if failed else ""
    if any(None in p["speed"] for c in found["conditions"] for p in c["points"]):
        more += (" Where nothing tows the body to the end of the window, a field has no speed and no tow force; its "
                 "tension, the largest of a step, the start included, is among the others.")
    return (f"A tow succeeds in a field if it keeps {kept(found)} along the ordered tow, on average "
            f"over the window (as far as it is ordered to be so fast there) and over the last quarter of that "
            f"time{line}. Stood still: tows that the ice held for a while. "
            f"A value passes if more than {100 * found['share']:g} % of all tows succeed, and fails if fewer do, each "
            f"with 97.5 % confidence over all interim analyses together. {runs} runs in {found['spent_min']:.3g} of "
            f"{found['budget_min']:g} min; a grid of this resolution with {found['most_fields']} fields has "
            f"{found['grid_runs']}.{more}")


def narrow(found):
    """A sentence where the domain is too narrow for its ice; "" if it is not, or if unknown."""
    few = [(p["value"], p["body_widths"], p["body_widths_needed"]) for c in found["conditions"] for p in c["points"]
           if (p.get("body_widths_needed") or 0) > (p.get("body_widths") or np.inf)]
    if not few:
        return ""
    at = span([v for v, _, _ in few], lambda v: value(found, v))
    return Warned(f"at {at} the domain is narrow for its ice ({min(w for _, w, _ in few):.3g} body widths; up to "
                  f"{max(n for _, _, n in few):.3g} are asked for): walls or periodic images carry part of the "
                  "resistance, and tows stop too early there; make domain.width larger.")


def wider(found):
    """A sentence where the domain was widened for its ice; "" if it was not."""
    made = [(p["value"], p["wider"]) for c in found["conditions"] for p in c["points"] if p.get("wider")]
    if not made:
        return ""
    values, widths = zip(*made)
    return (f"At {span(values, lambda v: value(found, v))} the domain was made "
            f"{span(widths, str, lambda v: float(v.split()[0]))} wide: narrower, its periodic images would carry part "
            "of the resistance (--keep-width leaves it).")


def content(found):
    return [limits(found), *([line] for line in (narrow(found), wider(found), meaning(found)) if line), curve(found)]


def _curve(axes, c, name, colour, factor, unit):
    x = np.array([p["value"] for p in c["points"]], dtype=float) * factor
    mean = np.array([p[f"mean_{name}"] for p in c["points"]], dtype=float)
    low, high = np.array([np.array(p[f"mean_{name}_95"], dtype=float) for p in c["points"]]).reshape(-1, 2).T
    for at, p in zip(x, c["points"]):
        y, adrift = np.array(p[name], dtype=float) / unit, np.isnan(np.array(p["speed"], dtype=float))
        for some, mark in ((~adrift, "."), (adrift, "x")):
            axes.plot(np.full(np.sum(some), at), y[some], mark, color=colour, alpha=0.35, markersize=5)
    axes.plot(x, mean / unit, color=colour, label=c["label"])
    least = np.array([least_of(p[name]) for p in c["points"]])
    axes.fill_between(x, np.maximum(low, least) / unit, high / unit, color=colour, alpha=0.15, linewidth=0)


def figure(found):
    """Plot speed and largest tension against the searched key, and the limit against the values of --for if these are
    numeric."""
    from bergtow.plot import style

    colours = style.ICE, style.TOW, style.DRAG, style.INERTIA, style.CORIOLIS, style.TILT
    some, (factor, read_in) = found["conditions"], reading(found["search"], found["unit"])
    if found["unit"] == "N":
        times, read_in = scale(found["range"], "N")
        factor = 1 / times
    across = all(c["for"] is not None for c in some) and sum(
        c["estimate"] is not None or None not in (c["makes_it"], c["does_not"]) for c in some) > 1
    fig, grid = style.subplots(1, 3 if across else 2, figsize=(12.6 if across else 8.8, 4.4), squeeze=False)
    width, height = fig.get_size_inches()
    fig.subplots_adjust(left=0.75 / width, right=1 - 0.2 / width, top=1 - 1.0 / height, bottom=0.95 / height,
                        wspace=0.3)
    of = "concentration" if found["search"] == "ice.concentration" else found["search"]
    words = f"{of}, {read_in}".rstrip(", ")
    largest = [x for c in some for p in c["points"] for x in p["tension"] if x is not None]
    kilo, newton = scale(largest, "N")
    parted = any(None in p["speed"] for c in some for p in c["points"])
    loads = np.array(sum(breaking_loads(found), []), dtype=float)
    loads = loads[loads < FAR_LOAD * max(largest, default=0.0)]
    between = [c for c in some if c["makes_it"] is not None and c["does_not"] is not None]
    for axes, name, label, unit, line in (
            (grid[0, 0], "speed", "speed made good, m/s", 1.0, found["speed"] or 0.0),
            (grid[0, 1], "tension", f"largest line tension, {newton}", kilo, max(loads, default=0.0))):
        for c, colour in zip(some, colours * len(some)):
            if c["points"]:
                _curve(axes, c, name, colour, factor, unit)
            if c in between:
                axes.axvspan(factor * c["makes_it"], factor * c["does_not"], color=colour, alpha=0.10, linewidth=0)
        axes.set(xlabel=words, ylabel=label)
        shown = [0.0, line, *(x for c in some for p in c["points"] for x in p[name] if x is not None)]
        bands = np.array([p[f"mean_{name}_95"][1] for c in some for p in c["points"]], dtype=float)
        top = max(max(shown), min(2 * max(shown), max(bands[np.isfinite(bands)], default=0.0)))
        axes.set_ylim(min(shown) / unit, 1.06 * top / unit or 1.0)
        # also over values without a speed, whose line parted
        margin = 0.04 * factor * abs(np.subtract(*found["range"]))
        axes.set_xlim(min(found["range"]) * factor - margin, max(found["range"]) * factor + margin)
        axes.grid(True)
    if found["speed"] is not None:
        grid[0, 0].axhline(found["speed"], color=style.INK, linewidth=1, linestyle=(0, (4, 3)),
                           label=f"to be kept: {kept(found)}")
    if len(loads):
        dashed = {"linewidth": 1, "linestyle": (0, (4, 3)), "label": "breaking load"}
        if found["breaking_load"]:
            grid[0, 1].axhline(found["breaking_load"] / kilo, color=style.INK, **dashed)
        else:
            for c, of_values, colour in zip(some, breaking_loads(found), colours * len(some)):
                grid[0, 1].plot([factor * p["value"] for p in c["points"]],
                                np.array(of_values, dtype=float) / kilo, color=colour, **dashed)
        handles, labels, _ = style.legend_of(grid[0, 1])
        grid[0, 1].legend(handles, labels)
    grid[0, 0].legend()
    if across:
        axes, x = grid[0, 2], [c["for"] for c in some]
        for at, c in zip(x, some):
            ends = [v for v in (c["makes_it"], c["does_not"]) if v is not None]
            if len(ends) == 2:
                axes.plot([at, at], [factor * v for v in ends], color=style.INK, linewidth=2)
        axes.plot(x, factor * np.array([c["estimate"] for c in some], dtype=float), "o-", color=style.ICE, markersize=5)
        axes.set(xlabel=f"{found['for']}, {found['for_unit']}".rstrip(", "), ylabel=f"limit, {words}")
        axes.set_ylim(*sorted(factor * v for v in found["range"]))
        axes.grid(True)
    style.head(fig, f"{style.plain(found['title'] or found['case'])}: towing capability",
               "dots: fields" + ", crosses: those whose line parted" * parted +
               "; band: 95 % of their mean" + "; shaded: where the limit lies" * bool(between), left=0.15 / width)
    return fig
