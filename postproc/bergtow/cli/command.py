# SPDX-License-Identifier: MIT
"""Messages and exit codes in place of tracebacks."""
import argparse
import errno
import os
import signal
import sys
from pathlib import Path

from bergtow import progress
from bergtow._interrupts import STOPS
from bergtow.cli import missing_packages
from bergtow.errors import IO, SIGNAL, USAGE, BergtowError


class Parser(argparse.ArgumentParser):
    """A parser that raises BergtowError where argparse would print a message and exit. An option has one name: by its
    abbreviations a function would take what it refuses by name (functions.py), and a new option would change theirs."""

    def __init__(self, *arguments, **options):
        super().__init__(*arguments, **options | {"allow_abbrev": False})

    def error(self, message):
        raise BergtowError(f"{message}; see {self.prog} --help", USAGE)


class _Stream:
    """A text stream that may fail because its reader has gone (`| head`) or the disk is full. Text is then discarded,
    and the work continues."""

    def __init__(self, stream):
        # None: the descriptor was closed when Python started
        self._stream, self.lost = stream or open(os.devnull, "w"), stream is None

    def __getattr__(self, name):
        return getattr(self._stream, name)

    def _try(self, call, *arguments):
        try:
            call(*arguments)
        except OSError:
            self.lost = True
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self._stream.fileno())  # for buffered text, and for child processes
            os.close(nowhere)

    def write(self, text):
        self._try(self._stream.write, text)
        return len(text)

    def flush(self):
        self._try(self._stream.flush)


class _Stop(KeyboardInterrupt):
    """A request to stop. A class of its own, because python -m kills itself by SIGINT at its end, whatever its exit
    code, once a bare KeyboardInterrupt has left the exec() of a text, as in the making of a dataclass, even if caught.
    Rejected: os._exit, which leaves out what modules do at the end; a start with -c, which mends only one start."""


def guarded(name, main):
    """Run main() and exit with the matching code. SIGTERM and SIGHUP act like Ctrl-C, so that runs started by main()
    write checkpoints before they end; nohup still works. Whatever ends main() after a stop is that stop: a library may
    make another exception of it, as h5py makes SystemError of one that arrives in its callbacks. Once the outcome is
    known these signals are ignored, because they would kill Python while it shuts down. name: prefix of messages."""
    stops = []

    def stop(number, frame):
        stops.append(number)
        raise _Stop

    for number in STOPS:
        if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
            signal.signal(number, stop)
    for stream in (sys.stdout, sys.stderr):  # a terminal whose encoding has no dash still gets its table
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")
    sys.stdout, sys.stderr = _Stream(sys.stdout), _Stream(sys.stderr)
    code = 0
    try:
        try:
            signal.pthread_sigmask(signal.SIG_SETMASK, ())  # blocked by src/app/cmd_python.c while Python loads
            with progress.told(name):
                main()
        except BaseException as error:
            if stops:
                raise _Stop from error
            raise
        finally:
            for number in STOPS:
                signal.signal(number, signal.SIG_IGN)
    except BergtowError as error:
        code = _say(name, error, error.status)
    except ModuleNotFoundError as error:
        code = _say(name, missing_packages.message(error), IO)
    except OSError as error:
        code = _say(name, of_system(error), IO)
    except KeyboardInterrupt:
        code = _say(name, "stopped", SIGNAL)
    except SystemExit as end:
        code = end.code
    sys.stdout.flush()
    if sys.stdout.lost and not code:
        code = _say(name, "standard output: cannot be written; free some disk space, or do not close the pipe early; "
                    "every file is written", IO)
    if code:
        sys.exit(code)


def of_system(error):
    """Describe an operating-system error by its path and a remedy instead of its number."""
    if error.filename is None:
        return error.strerror or str(error)
    path = Path(os.fsdecode(error.filename))
    if error.errno in (errno.EEXIST, errno.ENOTDIR):
        path = next((part for part in (*reversed(path.parents), path) if part.is_file()), path)
        return f"{path}: is a file where a folder is needed; give another folder with -o DIR"
    return f"{path}: {error.strerror}; check the path and its permissions"


def _say(name, message, code):
    print("\n".join(f"{name}: {line}" for line in str(message).splitlines()), file=sys.stderr)
    return code
