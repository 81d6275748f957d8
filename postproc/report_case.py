# SPDX-License-Identifier: MIT
"""Where each value of a case comes from: given with a source, given and called assumed, given without a word, or a default.

What the case file says beside a value, as a comment on its line, is its origin; for a default it is what the resolved case says. Nothing
is inferred: a value without a word on it is shown as one without a stated source.
"""
import re
import shlex
from dataclasses import dataclass

import yaml

#: kind: what the label says
KINDS = {"assumed": "assumed", "memory": "from memory", "source": "source", "given": "given", "set": "command line", "default": "default"}


@dataclass(frozen=True)
class Value:
    """One key of the resolved case."""

    key: str
    value: str
    meaning: str
    kind: str     #: of KINDS
    origin: str   #: in words


def annotated(text):
    """{"section.key": (value as written, comment behind it)} of a case in YAML; {} where it cannot be parsed."""
    try:
        root = yaml.compose(text, Loader=yaml.SafeLoader)
    except yaml.YAMLError:
        return {}
    out = {}

    def walk(node, path):
        if isinstance(node, yaml.MappingNode):
            for key, value in node.value:
                walk(value, [*path, str(key.value)])
            return
        if path[:1] == ["floes"]:
            return
        rest = text[node.end_mark.index:].split("\n", 1)[0] if isinstance(node, yaml.ScalarNode) or node.flow_style else ""
        comment = re.match(r"[\s,}\]]*\s#\s*(.*)", rest)
        value = node.value if isinstance(node, yaml.ScalarNode) else " ".join(text[node.start_mark.index:node.end_mark.index].split())
        out[".".join(path)] = (value, comment[1].strip() if comment else "")

    if root is not None:
        walk(root, [])
    return out


def set_by_hand(command_line):
    """Keys of --set key=value in a command line."""
    try:
        words = shlex.split(command_line)
    except ValueError:
        words = command_line.split()
    return {(word[6:] if word.startswith("--set=") else after).split("=")[0]
            for word, after in zip(words, words[1:] + [""]) if word == "--set" or word.startswith("--set=")}


def classify(words):
    """Kind of a comment on a value: assumed, memory, source or, for none, None."""
    low = words.lower()
    if "assumed" in low:
        return "assumed"
    if "from memory" in low:
        return "memory"
    return "source" if words else None


def of_default(meaning):
    """(kind, origin) of a default from the meaning of its key: "..., assumed [Source]"."""
    kind = classify(meaning)
    source = re.search(r"\[([^\]]*[A-Za-z][^\]]*)\]\s*$", meaning)
    if kind in ("assumed", "memory"):
        return kind, f"default, {KINDS[kind]}" + (f" ({source[1]})" if source else "")
    return ("source", f"default: {source[1]}") if source else ("default", "default")


def values(run):
    """[Value] of every key of the resolved case, in its order."""
    given, by_hand, out = annotated(run.case_text), set_by_hand(str(run.attributes.get("command_line", ""))), []
    for key, (value, meaning) in annotated(run.resolved_text).items():
        if key in by_hand:
            kind, origin = "set", "set on the command line; no source stated"
        elif key in given:
            kind = classify(given[key][1]) or "given"
            origin = given[key][1] or "given in the case file; no source stated"
        else:
            kind, origin = of_default(meaning)
        out.append(Value(key, value, meaning, kind, origin))
    return out


def preface(text):
    """The comment at the head of a case file, without its marks: list of paragraphs."""
    lines = []
    for line in text.splitlines():
        if not line.startswith("#"):
            break
        lines.append(line.lstrip("#").strip())
    return [p for p in ("\n".join(lines)).split("\n\n") if p.strip()]
