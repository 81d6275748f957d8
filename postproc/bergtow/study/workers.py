# SPDX-License-Identifier: MIT
"""Run members of an ensemble on Dask workers.

Each task is a call of `bergtow ensemble --no-wait` on the same folder; the calls share the members through the locks of
the program, like the jobs of an array (cases/studies/slurm-array.sh). Rejected: one task per member, which would need a
second list of members, a second rule for finished members, and a start of the program for each member. Its advantage,
that Dask moves members between workers, is also provided by the locks.
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

#: seconds between two checks for the end of a call, and for a request to stop
_LOOK = 0.2


def _share(command: list[str], stop: str) -> tuple[int, str]:
    """On a worker: call the program. stop: a file whose removal asks it to end with checkpoints. Returns exit code and
    messages."""
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
    """Run calls of the program on the workers, until no member is left to start. The caller's final call reports the
    state of the members. Raises BergtowError if no call could be made at all."""
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
            running.unlink()  # on an interrupt, the calls end with checkpoints, which is awaited
            wrong = [f.exception() for f in futures]
    if all(wrong):
        raise BergtowError(f"no worker of the Dask client could run {command[0]}: {wrong[0]}", IO)
