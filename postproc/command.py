# SPDX-License-Identifier: MIT
"""What the scripts share at the command line: arguments, exit codes, messages in place of tracebacks.

Exit codes: 0 done, 2 usage, 4 a file cannot be read or written, 6 stopped by the user.
"""
import argparse
import os
import sys
from pathlib import Path

from bergtow_read import RunError

PICTURES = (".png", ".pdf", ".svg")


def parser(description, output):
    """An argument parser with RUN and -o/--output (default: RUN/output)."""
    p = argparse.ArgumentParser(description=description)
    p.add_argument("run", metavar="RUN", help="output folder of a run")
    p.add_argument("-o", "--output", metavar="FILE", type=Path, help=f"file to write (default: RUN/{output})")
    return p


def output(p, arguments, default, allowed):
    """Path to write to. Ends with a usage error when its name does not end in one of the allowed suffixes."""
    path = arguments.output or Path(arguments.run) / default
    if path.suffix.lower() not in allowed:
        p.error(f"{path}: unknown kind of file; end the name in {', '.join(allowed)}")
    return path


def save(figure, path):
    """Write a figure; its folder is made if missing. Errors: RunError."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path)
    except OSError as error:
        raise RunError(path, f"cannot be written ({error.strerror or error})",
                       "choose another place with -o") from None
    print(path)


def guarded(main):
    """Run main() and leave the program with the exit code of what happened."""
    name = Path(sys.argv[0]).name
    try:
        main()
        sys.stdout.flush()
    except RunError as error:
        sys.exit(_say(name, error, 4))
    except BrokenPipeError:  # the reader of our output has gone, e.g. `| head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except OSError as error:
        sys.exit(_say(name, error, 4))
    except KeyboardInterrupt:
        sys.exit(_say(name, "stopped", 6))


def _say(name, message, code):
    print(f"{name}: {message}", file=sys.stderr)
    return code
