# SPDX-License-Identifier: MIT
"""Progress of a command: a line after every few seconds of silence, none if the command is quick. A thread prints it,
since long work is often a single call of NumPy or matplotlib.
"""
import sys
import threading
import time
from contextlib import contextmanager

EVERY = 8.0  # s

_at = []  # current work of the command, the innermost last


@contextmanager
def doing(what):
    """with doing("drawing the ice field"): ..."""
    _at.append(what)
    try:
        yield
    finally:
        _at.pop()


def each(what, items):
    """The items of a list, one after the other, each with its place among them: "condition 2 of 5"."""
    for k, item in enumerate(items):
        with doing(f"{what} {k + 1} of {len(items)}"):
            yield item


@contextmanager
def told(name):
    """Print the work named by doing() on standard error, within the block. name: of the command."""
    over, began = threading.Event(), time.monotonic()
    def tell():
        while not over.wait(EVERY):
            if at := list(_at):
                print(f"{name}: {time.monotonic() - began:.0f} s: {', '.join(at)}", file=sys.stderr, flush=True)
    teller = threading.Thread(target=tell, daemon=True)
    teller.start()
    try:
        yield
    finally:
        over.set()
        teller.join()
