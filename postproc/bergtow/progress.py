# SPDX-License-Identifier: MIT
"""Progress of a command: a line after every few seconds of silence, none if the command is quick. A thread prints it,
since long work is often a single call to NumPy or matplotlib.
"""
import sys
import threading
import time
from contextlib import contextmanager

EVERY = 8.0  # s

_at = []  # current tasks of the command, the innermost last


@contextmanager
def doing(what):
    """Name the current task: with doing("drawing the ice field"): ..."""
    _at.append(what)
    try:
        yield
    finally:
        _at.pop()


def each(what, items):
    """Yield the items of a list, each named with its index: "condition 2 of 5"."""
    for k, item in enumerate(items):
        with doing(f"{what} {k + 1} of {len(items)}"):
            yield item


@contextmanager
def told(name):
    """Within the block, print on standard error the task named by doing(). name: of the command."""
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
