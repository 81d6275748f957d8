# SPDX-License-Identifier: MIT
"""The statistics of an ensemble, section by section, in parts of bergtow/table.py."""
import numpy as np

from bergtow.result.members import listed
from bergtow.stats.extreme import FAR
from bergtow.table import Table, counted, number, pair, scale, written
from bergtow.text import converge as converge_text
from bergtow.text import loads as loads_text

DOUBT_LETTERS = {"unconverged": "U", "unbounded": "B", "jammed": "J", "unsteady": "N", "short": "S", "few": "F",
                 "stopped": "X", "other": "O"}


def doubts(c):
    """"2 U, 1 J": number of fields with each doubt."""
    counts = [f"{n} {DOUBT_LETTERS[kind]}" for kind, n in c["members"]["doubts"].items() if n]
    return ", ".join(counts) or "none"


def fields_cell(c):
    m = c["members"]
    extra = [f"{m[kind]} {kind}" for kind in ("failed", "waiting", "excluded") if m[kind]]
    return str(m["used"]) + (f" ({', '.join(extra)})" if extra else "")


def unit_of(s):
    """Factor and unit that suit the median of the conditions."""
    means = [c["resistance"]["mean"] for c in s["conditions"] if c["resistance"]["n"]]
    return scale([np.median(means)] if means else [], "N")


def means(s):
    factor, unit = unit_of(s)
    head = ["condition", "fields", f"mean, {unit}", "95 % (t)", "95 % (bootstrap)", "median", "trimmed", "sd between",
            "standard error in a run", "largest field's share", f"fields for {100 * s['wanted_error']:g} %", "doubts"]
    rows = []
    for c in s["conditions"]:
        r = c["resistance"]
        if not r["n"]:
            rows.append([c["label"], fields_cell(c)] + ["–"] * (len(head) - 3) + [doubts(c)])
            continue
        rows.append([c["label"], fields_cell(c), number(r["mean"] / factor), pair(r["t_95"], factor),
                     pair(r["bootstrap_95"], factor), number(r["median"] / factor),
                     number(r["trimmed_mean"] / factor) if r["trimmed_each_end"] else "–",
                     number(r["sd_between"] / factor), number(r["se_within"] / factor),
                     f"{100 * r['largest_share']:.0f} %" if np.isfinite(r["largest_share"]) else "–",
                     f"{r['fields_needed']:.0f}" if np.isfinite(r["fields_needed"]) else "–", doubts(c)])
    note = ("95 %: of the mean of all fields, by Student's t and by the studentised bootstrap. Trimmed: without an "
            "eighth of the fields at each end (from 8 fields on). Sd between: standard deviation between the means "
            "of runs; standard error in a run: of one run's mean, by its slowest cosine waves. Largest: share of the "
            "field with the largest mean in the sum of all. Doubts: U unconverged steps, B steps without a solution, "
            "so that its mean and peaks are at least these, J body stood still, N window not steady, S short window, F "
            "met little ice, X stopped early, O other warning.")
    drifting = [f"{c['label']}: {c['drift']['words']}" for c in s["conditions"]
                if c["drift"]["verdict"] == "not steady"]
    unsteady = ("NOT STEADY over all fields: the mean of the fields still changes within the window, by more than one "
                "run can see. " + "; ".join(drifting) + ". Begin the window later, or run longer.")
    return [Table(head, rows), [note], *[[unsteady]] * bool(drifting)]


def estimates(s):
    factor, unit = unit_of(s)
    labels = {name: e["label"] for c in s["conditions"] for name, e in c["estimates"].items()}
    head = ["condition", f"simulated, {unit}", *labels.values()]
    rows = []
    for c in s["conditions"]:
        cells = [c["label"], number(c["resistance"].get("mean", np.nan) / factor)]
        for name in labels:
            e = c["estimates"][name]
            text = number(e["force"] / factor) + ("" if e["valid"] or not np.isfinite(e["force"]) else "*")
            cells.append(text + (f" ({number(e['ratio'])})" if np.isfinite(e["ratio"]) else ""))
        rows.append(cells)
    on_top = [f"{label}: no ice resistance; add it to the others." for name, label in labels.items()
              if s["conditions"][0]["estimates"][name]["on_top"]]
    note = ("In brackets: simulated / estimate, where the estimate is meant for the conditions and depends on the "
            "concentration; none where it depends on a speed that changes in the window. * outside the range the "
            "estimate is meant for. –: no value there. The estimates were not made for each other's conditions and can "
            "differ tenfold; none has been checked against a measured tow here.")
    return [Table(head, rows), [" ".join([note, *on_top])]]


def fits(s):
    # for few fields no means are fitted
    of_means = any("refused" not in f for c in s["conditions"] for f in c["fits_of_means"][:2])
    head = ["condition", *["means: best fit", "p", "second", "p"] * of_means, "samples: best fit", "p", "second", "p",
            "samples", "at or below 0"]
    rows = []
    for c in s["conditions"]:
        cells = [c["label"]]
        for fitted in [c["fits_of_means"]] * of_means + [c["samples"]["fits"]]:
            for f in fitted[:2]:
                cells += ["–", "–"] if "refused" in f else [f["name"], number(f["p_value"], 2)]
        share = c["samples"]["not_above_zero"]
        rows.append(cells + [str(c["samples"]["independent"]), f"{100 * share:.0f} %" if np.isfinite(share) else "–"])
    return [Table(head, rows),
            ["Best two by AICc of normal, lognormal, Weibull, gamma and GEV. p: Anderson–Darling with parametric "
             "bootstrap, small = does not fit. "
             "Samples: step means of the resistance, two correlation times apart; those above 0 are fitted."]]


def extremes(s):
    some = [c for c in s["conditions"] if "refused" not in c["extremes"]]
    if not some:
        return [["No peaks: " + s["conditions"][0]["extremes"]["refused"] + "."]]
    hours = sorted({level["hours"] for c in some for kind in loads_text.NAMES
                    for level in c["extremes"][kind].get("levels", [])})
    factor, unit = scale([c["extremes"]["exceedance"][0]["peak"] for c in some if c["extremes"]["exceedance"]], "N")
    head = ["condition", "model", "hours", "collisions/h", f"largest, {unit}", "shape", "p",
            *(f"once in {T:g} h" for T in hours)]
    rows, short, refused = [], [], set()
    for c in some:
        x = c["extremes"]
        first = [f"{x['hours']:.3g}", number(x["collisions_per_hour"]),
                 number(x["exceedance"][0]["peak"] / factor) if x["exceedance"] else "–"]
        for kind, label in loads_text.NAMES.items():
            f = x[kind]
            if "refused" in f:
                refused.add(f"{c['label']}, {kind.replace('_', ' ')}: {f['refused']}")
                rows.append([c["label"], label, *first, *["–"] * (2 + len(hours))])
                continue
            short += loads_text.cut(c["label"], f, x["hours"])
            rows.append([c["label"], label, *first, *loads_text.fitted(f, hours, factor)])
    conversions = sorted({c["extremes"]["conversion"] for c in some})
    text = (f"Peaks of collisions by {'; '.join(conversions)}: another conversion of impulse to force gives other "
            "peaks. GPD: peaks over a threshold; GEV: block maxima. Brackets: 95 %. * beyond the hours simulated. ! "
            "shape below -0.5: the levels are little more than the largest peak seen. No bound: the upper end is more "
            f"than {FAR:g} times the level.")
    return [Table(head, rows), [text, *loads_text.cut_note(short), *(f"No fit for {r}." for r in sorted(refused))]]


def sensitivity(s):
    x = s["sensitivity"]
    if "refused" in x:
        return [[f"No sensitivity: {x['refused']}."]]
    if len(set(x["ranks"]).union(x["sobol"].get("indices", ()))) == 1:
        return [["One parameter was varied: there is nothing to divide."]]
    kinds = (("mean", x["sobol"]), ("logarithm", x["sobol_of_logarithm"]))
    given = [(of, k["indices"]) for of, k in kinds if "refused" not in k]
    names = set(x["ranks"]).union(*(i for _, i in given))
    def weight(name):
        return -max([i[name]["total"] for _, i in given if name in i], default=0.0), -abs(
            np.nan_to_num(x["ranks"].get(name, {}).get("prcc", 0.0)))
    rows = []
    def with_interval(found, what):
        return f"{number(found[what], 2)} ({pair(found[f'{what}_95'])})" if found else "–"
    for name in sorted(names, key=weight):
        r = x["ranks"].get(name)
        rows.append([name, number(r and r["spearman"], 2), with_interval(r, "prcc"), *(
            with_interval(indices.get(name), what) for _, indices in given for what in ("first", "total"))])
    head = ["parameter", "Spearman", "PRCC",
            *(f"Sobol {what}, of the {of}" for of, _ in given for what in ("first", "total"))]
    notes = [(f"{counted(x['members'])}. " if x["of"] == "members" else
              f"Means of {counted(x['samples'], 'condition')}, of {counted(x['members'])}. ") + "Brackets: 95 %."]
    notes += [f"No Sobol indices of the {of}: {k['refused']}." if "refused" in k else
              f"Sobol indices of the {of}: polynomial expansion of degree {k['degree']}, {k['terms']} terms, "
              f"{k['samples']} samples; R² {k['r2']:.3f}, cross-validated Q² {k['q2']:.3f}. They divide the part that "
              f"it explains; the rest, {100 * (1 - k['r2']):.0f} % of the variance, is scatter of the fields and error "
              "of the expansion." for of, k in kinds]
    return [Table(head, rows), [" ".join(notes)]]


def members(s, markdown):
    """The lines on the members."""
    n, whole = (sum(c["members"][key] for c in s["conditions"]) for key in ("used", "all"))
    lines = [(f"{n} of " if n < whole else "") + f"{counted(whole)} in {counted(len(s['conditions']), 'condition')}."]
    if s["waiting"]:
        lines.append(f"The ensemble is not complete: {counted(len(s['waiting']))} to come, and left out "
                     f"({listed(s['waiting'])}). Until then conditions may have different numbers of fields.")
    if s["unsound"]:
        name, why = next(iter(s["unsound"].items()))
        lines.append(f"{counted(len(s['unsound']))} not sound, and left out ({listed(list(s['unsound']))}); the "
                     f"first: {name}: {why}. Call `bergtow ensemble` again to rerun damaged members.")
    if s["without_mean"]:
        lines.append(f"{counted(len(s['without_mean']))} without a mean, and left out "
                     f"({listed(s['without_mean'])}): no window, nothing that is towed, or a line that parted before "
                     "the window or early in it.")
    if s["behind"]:
        lines.append(f"{counted(len(s['behind']))} of these finished after ensemble.h5 was made: run `bergtow "
                     "ensemble` again, which takes them in.")
    for kind, words in (("failed", "failed, and left out"), ("died", "whose process died")):
        if s[kind]:
            name, why = next(iter(s[kind].items()))
            lines.append(f"{counted(len(s[kind]))} {words}{f' ({listed(list(s[kind]))})' if len(s[kind]) > 1 else ''}; "
                         f"the first: {name}: {why}")
    if s["excluded"]:
        lines.append(f"Left out as asked ({', '.join(s['exclude'])}): " +
                     ", ".join(f"{name} ({', '.join(kinds)})" for name, kinds in s["excluded"].items()) + ".")
    if s["copies"]:
        lines.append(f"{counted(len(s['copies']))} ended in the same state as another one of the same condition, and "
                     f"count once with it ({listed([f'{name} as {other}' for name, other in s['copies'].items()])}): "
                     "no seed changes ice that is read, or water without floes.")
    if s["builds"]:
        lines.append(s["builds"])
    doubtful = sum(c["members"]["doubtful"] for c in s["conditions"])
    if doubtful:
        lines.append(f"{doubtful} of {counted(n)} {'carries' if doubtful == 1 else 'carry'} warnings and "
                     f"{'is' if doubtful == 1 else 'are'} in the numbers" +
                     ("." if markdown else "; --exclude leaves them out."))
    if s["members_without_folder"]:
        lines.append(f"{counted(len(s['members_without_folder']))} "
                     f"{'has' if len(s['members_without_folder']) == 1 else 'have'} no folder here "
                     f"({listed(s['members_without_folder'])}): the peaks of their collisions are not known.")
    heavy = [c["label"] for c in s["conditions"]
             if c["resistance"].get("n", 0) > 3 and c["resistance"]["largest_share"] > 0.5]
    if heavy:
        lines.append(f"More than half of the mean comes from one field: {'; '.join(heavy)}. Read the median there.")
    return lines


def sections(s, markdown):
    """{heading: parts}; markdown: omit advice on options, which is for a terminal."""
    return {"Design tow force": loads_text.design(s), "Members": [members(s, markdown)],
            **({"Convergence": converge_text.content(s["convergence"])} if s["convergence"] else {}),
            "Loads": loads_text.signals(s), "Quantiles of loads": loads_text.quantiles(s),
            "Return levels of loads": loads_text.returns(s, markdown), "Mean ice resistance": means(s),
            "Comparison with published estimates": estimates(s), "Distributions": fits(s),
            "Peaks of collisions": extremes(s), "Sensitivity of the mean ice resistance": sensitivity(s)}


def report(s, markdown=False):
    def heading(text, level):
        return ["#" * level * markdown + " " * markdown + text]
    return written([heading(s["title"], 2), *(part for title, some in sections(s, markdown).items()
                                              for part in (heading(title, 3), *some))], markdown)
