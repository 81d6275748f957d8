# SPDX-License-Identifier: MIT
"""What a command prints. A function that runs a command collects this text for its own thread only; replacing
sys.stdout would also take what other threads print."""
import io
from contextlib import contextmanager
from contextvars import ContextVar

_collected: ContextVar = ContextVar("collected", default=None)  # None: standard output


def say(text):
    """Print on standard output, or add to the text being collected."""
    print(text, file=_collected.get())


@contextmanager
def collected():
    """with collected() as text: text.getvalue() is what the block says."""
    text = io.StringIO()
    token = _collected.set(text)
    try:
        yield text
    finally:
        _collected.reset(token)
