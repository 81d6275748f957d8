#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""documented.py HEADER...: functions without a comment of their own, above or beside; of those that return a bt_status
also comments that do not say which errors there are. Exit code 1 if there is one.

What is looked at is what the manual shows (docs/headers.py). "The same" refers to the function before.
"""
import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "docs"))
from headers import FOR_CPP, NAME, beside, parts, prototype  # noqa: E402

ERRORS = re.compile(r"BT_ERR|[Ee]rror|BT_OK|[Rr]efus|\b[Tt]he same\b")


def faults(path):
    """Sentences on what a header lacks."""
    for comment, declaration in parts(FOR_CPP.sub("", Path(path).read_text(encoding="utf-8"))):
        if declaration.startswith("static inline"):
            declaration = declaration.partition("{")[0]
        call = prototype(declaration)
        if not call:
            continue
        said = " ".join(comment + beside(declaration)).strip()
        name = NAME.search(call).group(1)
        if not said:
            yield f"{path}: {name}: no comment above or beside it"
        elif call.startswith("bt_status ") and not ERRORS.search(said):
            yield f"{path}: {name}: its comment does not say which errors there are"


def main(paths):
    bad = [line for path in paths for line in faults(path)]
    for line in bad:
        print(line)
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
