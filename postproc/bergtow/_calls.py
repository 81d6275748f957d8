# SPDX-License-Identifier: MIT
"""Call the program so that it writes checkpoints before it ends when the caller is asked to stop."""
from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Callable
from typing import Any

from ._interrupts import held


def called(command: list[str], line: Callable[[str], Any] | None = None, **options: Any) -> tuple[int, str]:
    """Run a command and return its exit code and messages. line: function called with each line of its standard output;
    options: passed to Popen. If an exception such as KeyboardInterrupt arrives meanwhile, the command is asked to stop,
    and the exception is raised again once it has written its checkpoints and ended. The signal is SIGTERM, because a
    process that a shell started in the background ignores SIGINT until its run has installed a handler.

    Rejected: subprocess.run, which kills its process a quarter of a second after Ctrl-C, so that all work since the
    last checkpoint is lost."""
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
            with held():  # wait as long as it takes, even if the user repeats Ctrl-C
                if process:
                    process.terminate()
                    for _ in process.stdout or ():  # otherwise a full pipe would block it
                        pass
                    process.wait()
            raise
        finally:
            if process and process.stdout:
                process.stdout.close()
        errors.seek(0)
        return process.returncode, errors.read()
