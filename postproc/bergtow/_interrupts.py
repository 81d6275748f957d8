# SPDX-License-Identifier: MIT
"""Hold back Ctrl-C and other requests to stop until a block has ended."""
from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator
from typing import Any

#: signals that ask a program to stop, and that raise an exception where Python has a handler for them
STOPS = signal.SIGINT, signal.SIGTERM, signal.SIGHUP


@contextlib.contextmanager
def held(let_through: Callable[[], bool] = lambda: False) -> Iterator[None]:
    """Raise a request to stop only at the end of the block. Otherwise it could arrive inside a call from C and be lost,
    or between a call and the assignment of its result. let_through: is a second request raised at once?"""
    handlers: dict[int, Callable[[int, Any], Any]] = {}
    for stop in STOPS:
        if callable(handler := signal.getsignal(stop)):
            handlers[stop] = handler
    if threading.current_thread() is not threading.main_thread() or not handlers:
        yield
        return
    came: list[tuple[int, Any]] = []

    def hold(number: int, frame: Any) -> None:
        came.append((number, frame))
        if len(came) > 1 and let_through():
            handlers[number](number, frame)

    for number in handlers:
        signal.signal(number, hold)
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        if came:
            handlers[came[0][0]](*came[0])
