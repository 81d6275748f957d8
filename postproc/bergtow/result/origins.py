# SPDX-License-Identifier: MIT
"""The origin of each value of a case: given with a source, given and marked as assumed, given without comment, or a
default.

The origin of a value is the comment on its line in the case file; for a default it is the comment in the resolved case.
Nothing is inferred: a value without a comment is shown without a source.
"""
import re
import shlex
from dataclasses import dataclass
from datetime import datetime, timezone

from bergtow import _library

import numpy as np
import yaml

TITLE_BLOCK = ("client", "project", "author", "document", "revision", "distribution")
NAMES = {"document": "document number"}  #: names in the title block that differ from the key

#: {kind: its label}
KINDS = {"assumed": "assumed", "memory": "from memory", "reported": "reported", "source": "source", "given": "given",
         "set": "set",
         "study": "study", "default": "default", "field": "as read", "unused": "not used"}

BESIDE = "set."  #: in the text of a case as given, prefix of keys set in addition to its files (src/case/case_read.c)
LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  #: 20 times as fast, if the package was built with it
ZERO = 1e-12  #: no value of a key is this small

#: used for outlines without thicknesses; a field file always has them
THICKNESS = ("ice.thickness", "ice.thickness_law", "ice.thickness_spread", "ice.seed")


@dataclass(frozen=True)
class Value:
    """One key of the resolved case."""

    key: str
    value: str
    meaning: str
    kind: str     #: one of KINDS
    origin: str   #: in words


def annotated(text):
    """{"section.key": (value as written, comment after it)} of a case in YAML; {} if it cannot be parsed. A case with a
    base has one document for each of its files, and the first that contains a key takes precedence."""
    try:
        roots = list(yaml.compose_all(text, Loader=LOADER))
    except yaml.YAMLError:
        return {}
    out = {}

    def walk(node, path):
        if isinstance(node, yaml.MappingNode):
            for key, value in node.value:
                walk(value, [*path, str(key.value)])
            return
        if path[:1] in (["floes"], ["base"]):
            return
        scalar = isinstance(node, yaml.ScalarNode)
        rest = text[node.end_mark.index:].partition("\n")[0] if scalar or node.flow_style else ""
        comment = re.match(r"\s+#\s*(.*)", rest)
        value = node.value if scalar else " ".join(text[node.start_mark.index:node.end_mark.index].split())
        out.setdefault(".".join(path), (value, comment[1].strip() if comment else ""))

    for root in roots:
        if root is not None:
            walk(root, [])
    return out


def set_by_hand(command_line):
    """Keys set by --set key=value in a command line."""
    try:
        words = shlex.split(command_line)
    except ValueError:
        words = command_line.split()
    return {(word[6:] if word.startswith("--set=") else after).split("=")[0]
            for word, after in zip(words, words[1:] + [""]) if word == "--set" or word.startswith("--set=")}


def of_study(run, own):
    """{key: comment in the study} of the keys that the study of a member sets; {} for a run without a study. own: {key:
    value} set for this run in addition to its case; if it is {}, as in a result that does not record them, the keys
    that the study sets for any member are returned."""
    folder = run.path.resolve().parent
    try:
        text = (folder.parent / "study.yml").read_text(encoding="utf-8") if folder.name == "members" else ""
        study = yaml.safe_load(text)
    except (OSError, UnicodeDecodeError, yaml.YAMLError):
        return {}
    if not isinstance(study, dict):
        return {}
    said, out = annotated(text), {"ice.seed": ""} | dict.fromkeys(own, "")
    groups = {name: study.get(name) for name in ("set", "parameters")}
    for name in ("with", "variants"):
        some = study.get(name)
        groups |= {f"{name}.{which}": keys for which, keys in (some if isinstance(some, dict) else {}).items()}
    for name, keys in groups.items():
        for key, value in (keys if isinstance(keys, dict) else {}).items():
            written, comment = said.get(f"{name}.{key}", ("", ""))
            if name == "parameters" or not own or own.get(key) == written:
                source = str(value.get("source", "")) if isinstance(value, dict) else ""
                out[str(key)] = comment or source
    return out


def classify(words):
    """Kind of a comment on a value: assumed, memory, reported, source or, without a comment, None.

    It follows from the words, or from the marks of cases/field: [A] assumed, [R] reported without its original source,
    [P] published. If there are several marks, the least certain counts.
    """
    low = words.lower()
    if "assumed" in low or "[A]" in words:
        return "assumed"
    if "from memory" in low:
        return "memory"
    if "[R]" in words:
        return "reported"
    return "source" if words else None


def of_default(meaning):
    """(kind, origin) of a default from the description of its key: "..., assumed [Source]"."""
    kind = classify(meaning)
    source = re.search(r"\[([^\]]*[A-Za-z][^\]]*)\]\s*$", meaning)
    if kind in ("assumed", "memory"):
        return kind, f"default, {KINDS[kind]}" + (f" ({source[1]})" if source else "")
    return ("source", f"default: {source[1]}") if source else ("default", "")


def source_of_ice(case):
    """The key that names the file the ice was read from, or None for generated ice; case: {key: text}."""
    return next((key for key in ("ice.outlines", "ice.field") if case.get(key, "none") not in ("", "none")), None)


def not_used(run, case):
    """{key: why} of the keys that have no effect on a run; case: {key: text}."""
    found = {key: f"not used: no effect {why}" for key, why in _library.unused(run.resolved_text).items()}
    ice = source_of_ice(case)
    asked = ice == "ice.outlines" and (case.get("ice.thickness_law") != "constant" or bool(
        np.any(np.isclose(run.thickness[:run.n_start], run.value("ice.thickness"), rtol=1e-12, atol=0))))
    if ice and not asked:
        found |= dict.fromkeys(THICKNESS, f"not used: {ice} supplies the ice with its thickness")
    return found


def spread(values, unit, mean):
    """Mean and range of a quantity over the floes, in words."""
    low, high = np.min(values), np.max(values)
    return f"{mean:.3g} {unit}" + (f", {low:.3g} to {high:.3g} {unit}" if high - low > 1e-9 * abs(high) else "")


def of_field(run):
    """[Value] of the actual ice, if it was read from a file: the keys for generated ice do not describe it."""
    ice = source_of_ice(run.case)
    if ice is None or not run.ice.any():
        return []
    said, size = f"counted in the ice that {ice} read", run.sizes
    rows = (("floes", str(len(size)), "number of floes"), ("concentration", f"{run.number('concentration'):.4g}",
                                  "area fraction of ice in the ice region at the start, before a lead"),
            ("floe size", spread(size, "m", np.mean(size)), "diameter of the circle of a floe's area: mean and range"),
            ("floe thickness", spread(run.thickness[run.ice], "m", run.mean_thickness),
             "mean weighted with area, and range"))
    return [Value(name, value, meaning, "field", said) for name, value, meaning in rows]


def values(run):
    """[Value] of every key of the resolved case, in its order."""
    resolved, out = annotated(run.resolved_text), []
    unused = not_used(run, {key: value for key, (value, _) in resolved.items()})
    given = annotated(run.case_text)
    own = {key[len(BESIDE):]: value for key, (value, _) in given.items() if key.startswith(BESIDE)}
    study = of_study(run, own)
    # the command line of a study belongs to all its members; only in results that do not record `own` does it count
    by_hand = set_by_hand(str(run.attributes.get("command_line", ""))) | set({} if study else own)
    for key, (value, meaning) in resolved.items():
        if key in unused:
            kind, origin = "unused", unused[key]
        elif key in by_hand:
            kind, origin = "set", "set beside the case file, as by --set; no source stated"
        elif key in study:
            kind = classify(study[key]) or "study"
            origin = "set by the study" + (f": {study[key]}" if study[key] else "; no source stated")
        elif key in given:
            kind = classify(given[key][1]) or "given"
            origin = given[key][1] or "no source stated"
        else:
            kind, origin = of_default(meaning)
        out.append(Value(key, value, meaning, kind, origin))
    return out


def title_block(case, attributes, given):
    """Rows (what, value) of the title block: values from the command line (given), or from the section `report` of a
    case, {key: text}; the date; and the program, from its attributes."""
    rows = [(name, given.get(name) or case.get(f"report.{name}", "")) for name in TITLE_BLOCK]
    return [(NAMES.get(name, name), scrubbed(" ".join(value.split())) if value not in ("", "none") else "–")
            for name, value in rows] + [
        ("date", datetime.now(timezone.utc).strftime("%Y-%m-%d")),
        ("program", f"bergtow {attributes.get('version', '')}, revision {attributes.get('revision', 'unknown')}")]


def marked(block):
    """The number and revision of title_block(), which distinguish the issues of a document, for every page."""
    found = dict(block)
    number, revision = found[NAMES["document"]], found["revision"]
    return ", ".join([number] * (number != "–") + [f"revision {revision}"] * (revision != "–"))


def scrubbed(text):
    """The text without paths of the machine that made it: only the last part of each path is left."""
    return re.sub(r"(?<![\w./])(?:~|\.\.?)?/(?:[^\s/:'\"]+/)+([^\s/:'\"]*)", r"\1", text)


def short(value, digits=4):
    """A value of the resolved case, rounded to four digits; rounding residue near zero becomes zero. Angles, in radians
    there, are in degrees, as the keys ask for them."""
    value = re.sub(r"(?<![\w.])(-?\d+\.?\d*(?:e[-+]?\d+)?) rad\b",
                   lambda found: f"{np.degrees(float(found[1])):.{digits}g} deg", value)
    def rounded(found):
        number = float(found[0])
        if abs(number) < ZERO:
            return "0"
        if len(found[0]) < digits + 2:
            return found[0]
        return f"{number:.0f}" if 10 ** digits <= abs(number) < 1e6 else f"{number:.{digits}g}"
    return re.sub(r"(?<![\w.])-?\d+\.?\d*(?:e[-+]?\d+)?(?![\w.])", rounded, value)


def preface(text):
    """The comment at the top of a case file, without its marks: list of paragraphs. Lines of a sentence are joined;
    items of a list, tables and indented lines stay separate."""
    paragraphs = [""]
    for line in text.splitlines():
        if not line.startswith("#"):
            break
        line = line.lstrip("#").removeprefix(" ").rstrip()
        if not line:
            paragraphs.append("")
        elif paragraphs[-1]:
            paragraphs[-1] += ("\n" if re.match(r"\s|[-*|] ", line) else " ") + line
        else:
            paragraphs[-1] = line
    return [p for p in paragraphs if p.strip()]
