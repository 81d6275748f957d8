# SPDX-License-Identifier: MIT
"""columns.py FILE...: file:line of every line of more than 120 characters; exit code 1 if there is one.

Characters, not bytes: "ø" is one column. In Markdown a table row has to be one line, code stays as it is typed, and the
target of a link cannot be broken: rows and code blocks are left out, and a target does not count.
"""
import re
import sys

WIDTH = 120
FENCE = re.compile(r"\s*(```+|~~~+)")
ITEM = re.compile(r" *(?:[-*+]|\d+[.)]) +")
TARGET = re.compile(r"(?<=\])\([^()\s]*\)|^\s*\[[^]]+\]: .*|<?https?://[^\s<>)]+>?")


def lines_of(path):
    """(number, line) of the file."""
    with open(path, encoding="utf-8") as f:
        return list(enumerate(f.read().split("\n"), 1))


def outside_code(lines):
    """(number, line) of Markdown without code, whether fenced or indented, and without blank lines."""
    fence, code, after_blank, item = None, False, True, 0
    for number, line in lines:
        mark = FENCE.match(line)
        if fence:
            if mark and mark[1].startswith(fence):
                fence = None
            continue
        if mark:
            fence = mark[1]
            continue
        if not line.strip():
            after_blank = True
            continue
        indent = len(line) - len(line.lstrip(" "))
        if after_blank and indent < item:
            item = 0
        code = indent >= item + 4 and (code or after_blank)
        after_blank = False
        if code:
            continue
        bullet = ITEM.match(line)
        if bullet:
            item = bullet.end()  # where the text of a list's item begins: its code is indented from there
        yield number, line


def prose(lines):
    """(number, line) of Markdown without code, tables and targets of links."""
    for number, line in outside_code(lines):
        if not line.lstrip().startswith("|"):
            yield number, TARGET.sub("", line)


def main(paths):
    found = False
    for path in paths:
        lines = lines_of(path)
        for number, line in prose(lines) if path.endswith(".md") else lines:
            if len(line) > WIDTH:
                print(f"{path}:{number}: {len(line)} characters, {WIDTH} are allowed: wrap the line")
                found = True
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
