# SPDX-License-Identifier: MIT
"""Calls of the program that end with checkpoints when the caller is asked to stop."""
from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Callable
from typing import Any

from ._interrupts import held


def called(command: list[str], line: Callable[[str], Any] | None = None, **options: Any) -> tuple[int, str]:
    """Exit code and messages of a call. line: function that gets each line of its standard output; options: of Popen.
    An exception that arrives meanwhile, such as KeyboardInterrupt, asks the call to stop. It is raised again when the
    call has written its checkpoints and ended. By SIGTERM, because a process that a shell has started in the background
    ignores SIGINT until its run has a handler.

    Rejected: subprocess.run, which kills its process a quarter of a second after Ctrl-C; all work since the last
    checkpoint is lost then."""
    if line:
        options["stdout"] = subprocess.PIPE
    process: subprocess.Popen[str] | None = None
    with tempfile.TemporaryFile("w+", errors="replace") as errors:
        try:
            with held():
                process = subprocess.Popen(command, stderr=errors, text=True, **options)
            for text in process.stdout or ():
                assert line
                line(text)
            process.wait()
        except BaseException:
            with held():  # wait as long as it takes, also if the user repeats Ctrl-C
                if process:
                    process.terminate()
                    for _ in process.stdout or ():  # else a full pipe would hold it up
                        pass
                    process.wait()
            raise
        finally:
            if process and process.stdout:
                process.stdout.close()
        errors.seek(0)
        return process.returncode, errors.read()
