# SPDX-License-Identifier: MIT
"""Members of an ensemble on the workers of Dask.

Each task is a call of `bergtow ensemble --no-wait` on the one folder; the calls share the members by the locks of the
program, as the jobs of an array do (cases/studies/slurm-array.sh). Rejected: a task for each member, which would need a
second list of members, a second rule for finished members, and a start of the program for each member. Its advantage,
that Dask moves members between workers, the locks give as well.
"""
from __future__ import annotations

import os
import signal
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

from bergtow.errors import IO, BergtowError

#: seconds between two looks for the end of a call, and for the wish to stop
_LOOK = 0.2


def _share(command: list[str], stop: str) -> tuple[int, str]:
    """On a worker: a call of the program. stop: a file that asks it to end with checkpoints when it goes away. Returns
    exit code and messages."""
    with tempfile.TemporaryFile("w+") as errors:
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=errors, stdin=subprocess.DEVNULL,
                              start_new_session=True) as process:
            asked = False
            while process.poll() is None:
                time.sleep(_LOOK)
                if not asked and not os.path.exists(stop):
                    process.send_signal(signal.SIGINT)
                    asked = True
        errors.seek(0)
        return process.returncode, errors.read().strip()


def _finished(out: Path) -> int:
    return sum(1 for _ in Path(out).glob("members/*/finished"))


def on_workers(client: Any, command: list[str], out: str | os.PathLike[str], tasks: int, threads: int,
               progress: bool) -> None:
    """Run calls of the program on the workers, until no member is left to begin. The last call of the caller reports
    the state of the members. Errors: BergtowError when no call could be made at all."""
    if not client.nthreads():
        raise BergtowError("the Dask client has no workers; start some, or leave out client", IO)
    count = tasks or max(sum(client.nthreads().values()) // max(threads, 1), 1)
    out = Path(out).absolute()
    out.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{out.name}-", dir=out.parent) as here:
        running = Path(here) / "running"
        running.touch()
        futures = [client.submit(_share, command, str(running), pure=False) for _ in range(count)]
        try:
            said = _finished(out)
            while not all(f.done() for f in futures):
                time.sleep(_LOOK)
                now = _finished(out)
                if progress and now != said:
                    print(f"{now} members finished", flush=True)
                    said = now
        finally:
            running.unlink()  # an interrupt: the calls end with checkpoints, and are waited for
            wrong = [f.exception() for f in futures]
    if all(wrong):
        raise BergtowError(f"no worker of the Dask client could run {command[0]}: {wrong[0]}", IO)
