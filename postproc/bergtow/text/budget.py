# SPDX-License-Identifier: MIT
"""The result of bergtow budget as one table, in parts of bergtow/table.py, and one picture."""
from bergtow.result.members import listed
from bergtow.table import Table, Warned, number, percent, quantity, scale
from bergtow.text.converge import effect

import numpy as np

TRUSTED_Q2 = 0.7  # below this, shares are only a rough guide


def _ends(found, ends):
    if ends is None or None in ends:
        return ""
    return f" ({' to '.join(quantity(x, found['units']) for x in ends)})"


def of_mean(found, x, say=percent):
    """A number as a share of the mean, "–" beside a mean of 0."""
    return say(x / abs(found["mean"])) if x is not None and found["mean"] else "–"


def _index(i, what):
    low, high = i[f"{what}_95"]
    ends = "" if low is None else f" ({number(low, 2)} to {number(high, 2)})"
    return number(i[what], 2) + ends


def rows(found):
    out = [["mean", quantity(found["mean"], found["units"]) + _ends(found, found["mean_95"]), "", "", "", "", ""]]
    one = found["fields"]["sd"] is None
    parts = [("fields: one tow", found["fields"]), ("parameters" + (" and fields" if one else ""), found["parameters"])]
    for name, p in parts[one:]:
        out.append([name, quantity(p["sd"], found["units"]) + _ends(found, p["sd_95"]), of_mean(found, p["sd"]),
                    percent(p["share"]), "", "", ""])
    indices = found["shares"].get("indices", {})
    for name in sorted(found["assumed"], key=lambda k: -(indices.get(k, {}).get("total") or 0.0)):
        i, given = indices.get(name), found["assumed"][name]
        out.append([f"- {name}", "", "", "", *((_index(i, "first"), _index(i, "total")) if i else ("–", "–")),
                    "; ".join(filter(None, (given["distribution"], given["source"] or "assumed")))])
    out += _numerics(found)
    together = found["together"]["sd"]
    out.append(["together", quantity(together, found["units"]), of_mean(found, together), "", "", "", ""])
    return out


def _numerics(found):
    """Two lines: the scatter that the computation may add, and its known bias."""
    n = found["numerics"]
    if not n or "refused" in n:
        return [["numerics", "not known" if n else "not studied", *[""] * 5]]
    bound = "" if n["unknown"] else "at most "
    known = n["sd"] is not None and np.isfinite(n["sd"])
    out = [["numerics", bound + quantity(n["sd"], found["units"]) if known else "not known",
            of_mean(found, n["sd"]) if known else "", percent(n["share"]) if known else "", "", "", ""]]
    if n.get("bias"):
        out.append([f"bias of {', '.join(n['biases'])}", quantity(abs(n["bias"]), found["units"]),
                    of_mean(found, abs(n["bias"])), percent(n["bias_share"]), "", "", ""])
    return out


def numerics_notes(found):
    """Sentences on the known and the unknown numerical errors."""
    n = found["numerics"]
    if not n:
        return " Numerics: run `bergtow converge` on the base case and name its file with --converge." \
            if found["of"] == "mean_ice_resistance_n" else \
            " Numerics: `bergtow converge` knows only what the computation adds to the mean ice resistance."
    if "refused" in n:
        return f" Numerics: {n['refused']}."
    said = ""
    if n.get("bias"):
        each = ", ".join(f"{name} by {effect(b)}" for name, b in n["biases"].items())
        said = (f" Bias: the values to which it was converged change the mean, {each}; together "
                f"{of_mean(found, n['bias'], effect)}. It is not scatter: no number here is corrected for it, and "
                "its square is in the last line and the shares.")
    within = n.get("within", ())
    for words, there in (("with what is known so far of", True), ("without", False)):
        some = [f"{name} ({why})" for name, why in n["unknown"].items() if (name in within) == there]
        said += f" Numerics {words} {', '.join(some)}." if some else ""
    return said


def notes(found):
    s = found["shares"]
    if "refused" in s:
        shares = f"The parameters' part is not divided: {s['refused']}."
    else:
        trust = "" if s["q2"] >= TRUSTED_Q2 else (
            " That is little: use the shares as a rough guide, and run more conditions for better ones.")
        shares = (f"Shares of {s['scale']}: polynomial expansion of degree {s['degree']}, {s['terms']} terms; it "
                f"predicts {100 * s['q2']:.0f} % of the variance of unseen conditions (Q²).{trust}")
    return (f"{found['meaning']}; standard deviations, 95 % in brackets. {found['conditions']} conditions, "
            f"{found['members']} tows. {shares}{numerics_notes(found)}")


def warnings(found):
    """Lines on members and effects that the numbers do not include."""
    wanted, out = found["wanted"], []
    left = found.get("waiting", wanted - found["members"])
    if left:
        beyond = found.get("left_out")
        out.append(f"{left} of {wanted} members are still to come: this uses the first {found['conditions']} "
                   "conditions, which are a fair sample, and its intervals are wider than those of the whole study."
                   + (f" Complete but not used yet: {beyond} after the first unfinished condition. Which of those "
                      "finish early depends on the run time, so they are not a random sample." if beyond else ""))
    if failed := found.get("failed"):
        name, why = next(iter(failed.items()))
        within = set(failed) - set(found.get("failed_beyond", []))
        out.append(f"{len(failed)} of {wanted} members failed ({listed(list(failed))}; {name}: {why}). " + (
            "The cause of their failure may be an effect that the budget is to measure: there are no "
            "intervals." if within else
            "They lie after the first unfinished condition, and are not in this sample."))
    if lacking := found.get("without_number"):
        out.append(f"{len(lacking)} of {wanted} members have no such number ({listed(lacking)}): there are no "
                   "intervals.")
    if doubtful := found.get("doubtful"):
        kinds = ", ".join(f"{n} {kind}" for kind, n in sorted(found["doubts"].items()))
        out.append(f"{doubtful} of {found['members']} tows carry warnings and are in the numbers ({kinds}; "
                   "`bergtow statistics` says what each means).")
    if copies := found.get("copies"):
        out.append(f"{len(copies)} of {wanted} members are the same run as another one of their condition, and count "
                   "with it once.")
    if builds := found.get("builds"):
        out.append(builds)
    return [[Warned(line)] for line in out]


def content(found):
    head = ["part", "standard deviation", "relative to the mean", "share of the variance", "Sobol, first order",
            "total", "range and source"]
    return [part for one in (found, *found.get("more", []))
            for part in (*warnings(one), Table(head, rows(one)), [notes(one)])]


def figure(found):
    """Plot the standard deviations of the parts, and the indices of the parameters."""
    from bergtow.plot import style

    indices = found["shares"].get("indices", {})
    names = sorted(indices, key=lambda k: indices[k]["total"] or 0.0)
    fig, (left, right) = style.subplots(1, 2, figsize=(10.4, 2.3 + 0.36 * max(4, len(names))))
    width, height = fig.get_size_inches()
    fig.subplots_adjust(left=1.2 / width, right=1 - 0.25 / width, top=1 - 0.95 / height, bottom=0.7 / height,
                        wspace=0.55)
    some = [(k, found[k]) for k in ("fields", "parameters", "numerics") if found[k] and found[k].get("sd") is not None]
    if (n := found["numerics"]) and n.get("bias"):
        some.append(("bias", {"sd": abs(n["bias"])}))
    factor, unit = scale([found["together"]["sd"]], found["units"])
    for y, (name, p) in enumerate([*reversed(some), ("together", found["together"])]):
        left.barh(y, p["sd"] / factor, height=0.6, color=style.FAINT if name == "together" else style.ICE)
        ends = p.get("sd_95")
        if ends and None not in ends:
            left.plot(np.array(ends) / factor, [y, y], color=style.INK, linewidth=1.2)
    left.set_yticks(range(len(some) + 1), [*(k for k, _ in reversed(some)), "together"])
    left.set_xlabel(f"standard deviation, {unit}")
    for y, name in enumerate(names):
        for what, colour, at in (("total", style.TOW, y - 0.18), ("first", style.DRAG, y + 0.18)):
            i = indices[name]
            right.barh(at, i[what] or 0.0, height=0.32, color=colour, label={"total": "total", "first": "alone"}[what]
                       if y == 0 else None)
            if None not in i[f"{what}_95"]:
                right.plot(i[f"{what}_95"], [at, at], color=style.INK, linewidth=1.2)
    right.set_yticks(range(len(names)), names)
    right.set_xlabel("share of the parameters' part (Sobol index)")
    if names:
        right.legend(loc="lower right")
    else:
        right.text(0.5, 0.5, "not attributed", transform=right.transAxes, ha="center", color=style.FAINT)
    for axes in (left, right):
        axes.set_xlim(left=0)
        axes.grid(True, axis="x")
    style.head(fig, f"{style.plain(found['title'])}: uncertainty budget",
               f"{found['meaning']}: {quantity(found['mean'], found['units'])} on average; black: 95 %",
               left=0.15 / width)
    return fig
