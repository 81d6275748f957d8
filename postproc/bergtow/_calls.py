# SPDX-License-Identifier: MIT
"""Calls of the program that end with checkpoints when the caller is asked to stop."""
from __future__ import annotations

import subprocess
import tempfile
import threading
from collections.abc import Callable
from typing import Any

from ._interrupts import held


class Calls:
    """Calls of the program, by one thread or by several at a time.

    Rejected: subprocess.run, which kills its process a quarter of a second after Ctrl-C; all work since the last
    checkpoint is lost then.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._under_way: set[subprocess.Popen[str]] = set()
        self._stopped = False

    def run(self, command: list[str], line: Callable[[str], Any] | None = None, **options: Any) -> tuple[int, str]:
        """Exit code and messages of a call. line: function that gets each line of its standard output; options: of
        Popen. An exception that arrives meanwhile, such as KeyboardInterrupt, asks all calls to stop. It is raised
        again when this call has written its checkpoints and ended."""
        if line:
            options["stdout"] = subprocess.PIPE
        process = None
        with tempfile.TemporaryFile("w+", errors="replace") as errors:
            try:
                with held():
                    process = self._begin(command, stderr=errors, text=True, **options)
                for text in process.stdout or ():
                    assert line
                    line(text)
                process.wait()
            except BaseException:
                with held():  # wait as long as it takes, also if the user repeats Ctrl-C
                    self.stop()
                    if process:
                        _wait(process)
                raise
            finally:
                self._end(process)
            errors.seek(0)
            return process.returncode, errors.read()

    def stop(self) -> None:
        """Ask all calls to stop, once, and begin no others. By SIGTERM, because a process that a shell has started in
        the background ignores SIGINT until its run has a handler."""
        with self._lock:
            if not self._stopped:
                self._stopped = True
                for process in self._under_way:
                    process.terminate()

    def _begin(self, command: list[str], **options: Any) -> subprocess.Popen[str]:
        with self._lock:
            if self._stopped:
                raise KeyboardInterrupt
            process = subprocess.Popen(command, **options)
            self._under_way.add(process)
            return process

    def _end(self, process: subprocess.Popen[str] | None) -> None:
        with held(), self._lock:
            if process:
                self._under_way.discard(process)
                if process.stdout:
                    process.stdout.close()


def _wait(process: subprocess.Popen[str]) -> None:
    for _ in process.stdout or ():  # else a full pipe would hold it up
        pass
    process.wait()
