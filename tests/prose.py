#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""prose.py [PAGE...]: file:line of every turn of phrase that makes a reader of the documentation stumble, and a better
one; exit code 1 if there is one. Without arguments: the pages of CLEAN.

Headings, code, quoted messages and questions are left out. A form is listed in FORMS only if it is never right in
these pages; "which" behind a comma, or "what" behind a verb of asking or telling, is.
"""
import re
import sys
from pathlib import Path

from columns import lines_of, outside_code

ROOT = Path(__file__).resolve().parent.parent
# Patterns of pages that are clean, from the root.
CLEAN = ("README.md", "docs/CONTRIBUTING.md", "docs/glossary.md", "docs/ice-from-an-image.md", "docs/index.md",
         "docs/install.md", "docs/library.md", "docs/manual.md", "docs/statistics.md", "docs/how-to-*.md",
         "docs/tutorials/*.md", "postproc/README.md")
# Sections of these pages that are still to be cleaned, by their headings.
OPEN = {}

VERBS = r"(?:say|tell|show|see|know|ask|explain|decide|determine|describe|learn|define)(?:s|d|ed|ing|n)?|said|told|knew"
FORMS = [
    (r"what (?:is|has|was|were|are|the|it|they)", 'name the thing: not "what is assumed" but "the assumed values"'),
    (r"(?:by|of|in|from|at|with|after|for|to|on|beyond|below|above) which",
     'use "where", "when" or "that", or begin a new sentence'),
    (r"go(?:es)? on", '"continues", "resumes"'),
    (r"(?<!there\s)(?:is|are) (?:none|no \w+) (?:that|of|which)", 'deny the verb: not "is no X that" but "does not"'),
    (r"of before|of earlier(?=[.,;:])", '"previous", "earlier" before the noun'),
    (r"one that", "repeat the noun"),
    (r"of (?:its|their) own", '"its own" before the noun'),
    (r"(?:is|are) told", "say who tells whom"),
    (r"(?:say|says|said) so|it is said", 'say what: "names the file", "prints a warning"'),
]
GAP = r"(?:[ \t]+|[ \t]*\n[ \t]*)"  # within a paragraph


def blank(match):
    return re.sub(r"[^\n]", "§", match[0])


def text_of(path, open_sections=()):
    """The page with its lines in their places, without headings, code, quotations and the sections left out."""
    lines = lines_of(path)
    kept, skipped = [""] * len(lines), 0
    for number, line in outside_code(lines):
        heading = re.match(r"(#+) (.*)", line)
        if heading and (not skipped or len(heading[1]) <= skipped):
            skipped = len(heading[1]) if heading[2] in open_sections else 0
        if not heading and not skipped:
            kept[number - 1] = line
    text = "\n".join(kept)
    for pattern in (r"``[^`]+``|`[^`]+`", r'"[^"\n|]*(?:\n[^"\n|]+)?"'):
        text = re.sub(pattern, blank, text)
    return text


def allowed(text, match):
    """Whether a form stands in a question, or a "what" behind a verb of asking or telling."""
    before = re.split(r"[.;:|]", text[max(0, match.start() - 40):match.start()])[-1]
    asked = match[0].lower().startswith("what") and re.search(rf"\b(?:{VERBS})(?:\s+\w+){{0,2}}\s+$", before)
    return asked or re.match(r"[^.!|]*\?", text[match.end():])


def faults(path, open_sections=()):
    """(line, phrase, remedy)"""
    text = text_of(path, open_sections)
    for form, remedy in FORMS:
        for match in re.finditer(rf"\b{form.replace(' ', GAP)}\b", text, re.IGNORECASE):
            if not allowed(text, match):
                yield text.count("\n", 0, match.start()) + 1, " ".join(match[0].split()), remedy


def main(names):
    paths = [ROOT / n for n in names] or sorted(p for pattern in CLEAN for p in ROOT.glob(pattern))
    bad = 0
    for path in paths:
        name = str(path.relative_to(ROOT)) if path.is_relative_to(ROOT) else str(path)
        for line, phrase, remedy in sorted(faults(path, OPEN.get(name, ()))):
            print(f'{name}:{line}: "{phrase}": {remedy}')
            bad += 1
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
