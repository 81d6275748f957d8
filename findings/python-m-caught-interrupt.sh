#!/bin/sh
# SPDX-License-Identifier: MIT
# A program that catches KeyboardInterrupt and ends with a code of its own, so that a batch system sees which jobs to
# queue again, keeps its code as a script. Started by `python3 -m`, it dies by SIGINT instead (130 for the shell) if the
# interrupt came while a string was executed, as the decorator of a dataclass does at import. A subclass of
# KeyboardInterrupt, raised by a handler of its own, keeps the code both ways.
# shellcheck source=findings/packages.sh
. "$(dirname "$0")/packages.sh"
fetch python3.11-minimal=3.11.2-6+deb12u8 libpython3.11-minimal=3.11.2-6+deb12u8 python3.11=3.11.2-6+deb12u8 \
  libpython3.11-stdlib=3.11.2-6+deb12u8

cat >job.py <<'PY'
import os
import signal
import sys


class Stop(KeyboardInterrupt):
    pass


def stop(*_):
    raise Stop


if sys.argv[1] == "own":
    signal.signal(signal.SIGINT, stop)
try:
    exec("os.kill(os.getpid(), signal.SIGINT)\nfor _ in range(10 ** 6): pass")
except KeyboardInterrupt:
    sys.exit(6)
PY
python=$root/usr/bin/python3.11
"$python" --version
code() { "$@" && echo 0 || echo $?; }
seen "the code of a script that has caught its interrupt" 6 6 "$(code "$python" job.py default)"
seen "the same as python3 -m" 6 130 "$(code "$python" -m job default)"
seen "as python3 -m, with a handler that raises a subclass" 6 6 "$(code "$python" -m job own)"
