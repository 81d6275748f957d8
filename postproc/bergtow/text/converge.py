# SPDX-License-Identifier: MIT
"""The verdicts of bergtow converge, as parts of bergtow/table.py."""
from bergtow.table import Table, Warned, change, number

WORDS = {"none": "resolved: no effect that matters", "matters": "resolved: it matters", "open": "not resolved"}


def effect(x):
    """A change to a tenth of a percent below 20 %, where the margin lies, and to two digits above."""
    return change(x) if x is None or abs(100 * x) < 20 else f"{float(f'{100 * x:.1e}'):+.0f} %"


def interval(ends):
    return "–" if ends is None or None in ends else f"{effect(ends[0])} to {effect(ends[1])}"


def value(row, which):
    at = row.get(which)
    return "–" if at is None else f"{at:.4g} {row.get('unit') or ''}".strip()


def advice(row):
    at = value(row, "recommended")
    if row["name"] == "fields":
        return f"{at} fields for {100 * row['wanted_error']:g} %"
    if row["judged"] == "none":
        return f"{at} will do"
    if row["judged"] == "open" or row.get("recommended") is None:
        return row.get("why") or "–"
    return f"the walls are felt; without them, take {at} or {row['finer']}" if row.get("walls") else \
        f"take {at}, or {row['finer']}"


def without(share):
    """"in at least 47 % of fields", those without an effect; "" if the share is not known."""
    return "" if share is None else f" in at least {100 * share:.0f} % of fields"


def cells(row):
    if "mean" in row:
        return ["fields", "–", f"mean {number(row['mean'])} N", "–", f"{row['fields']}", WORDS[row["judged"]],
                advice(row)]
    if "from" not in row:
        return [row["name"], "–", "–", "–", "–", WORDS[row["judged"]], row.get("why", "–")]
    on = f"{row['fields']}, {'the same ice' if row['same_ice'] else 'other ice'}"
    if row.get("pairing") is not None:
        on += f", error x {row['pairing']:.2g}"
    # equal for a start whose ramp cannot be made longer
    values = " -> ".join(dict.fromkeys((value(row, "from"), value(row, "to"))))
    return [row["name"], values, row["quantity"],
            f"{effect(row['effect'])} ({interval(row['interval_95'])})", on,
            WORDS[row["judged"]] + without(row.get("share_without")), advice(row)]


def doubtful(found):
    """[[a line on windows of the case whose tow is not steady]]; [] if there are none."""
    verdicts = found.get("verdicts") or {}
    some = [f"{verdicts[kind]} {kind}" for kind in ("not steady", "too short") if verdicts.get(kind)]
    if not some:
        return []
    return [[Warned(f"of the {sum(verdicts.values())} tows of the case as it is, {' and '.join(some)}: an effect on "
                    "their mean is an effect on the mean of that stretch of time.")]]


def content(found):
    head = ["varied", "value", "quantity", "effect (95 %)", "fields", "verdict", "recommended"]
    note = (f"Effect: on the mean over fields, relative; 95 % over {found['looks']} interim analyses together; error "
            "x: ratio of its error to the error with other ice for each value. Effects below "
            f"{100 * found['margin']:g} % do not matter; an effect in the other fields may have gone unseen. "
            f"{found['spent_min']:.3g} of {found['budget_min']:g} min.")
    return [*doubtful(found), Table(head, [cells(row) for row in found["rows"]]), [note]]
