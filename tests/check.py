#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""What a change can be held against within a minute, from a built tree: lint of what changed, every unit test, a dozen
scenes, the links and names of the documentation.

    tests/check.py              (make check)
    tests/check.py FILE...      (make check NEAR=FILE) lint, and the tests nearest to these files in place of the others

Nearest is what tests/mutants.py names with a file. For a source that it does not list: the test programs that include
its header, or else the tests of the other files of its folder; for a script: the Python tests that name it; a test
is nearest to itself. One line a job; what fails prints all that it said. Exit code 1 where anything fails.
"""
import concurrent.futures
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import time

import scenes
from harness import BERGTOW, ROOT
from mutants import MUTANTS
from mutate import LAYOUTS

PYTHON = sys.executable
PYTEST = [PYTHON, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-m", "not slow"]
BUILD = pathlib.Path(BERGTOW).parent
#: programs that wait for each other's threads or processes would take the core from the rest
ENVIRONMENT = {**os.environ, "OMP_NUM_THREADS": "1", "GOMP_SPINCOUNT": "5000", "PYTHONDONTWRITEBYTECODE": "1"}
PATIENCE = 900

#: as different from each other as a dozen can be: each layer, each mode of tow and ice, and cheap
DOZEN = ["speed_dense", "line_bridle_breaks", "thrust_waypoints", "window_backwards", "tables", "walls_closing",
         "solver_settings", "crushing_press", "rafting", "impacts_sine", "lead_managed", "body_in_parts_outlines"]
DOCS = ["tests/cli/test_docs.py", "-k", "links or files_named or architecture or names_of_the_code or make_targets"]


def called(words):
    """(did it end well, what it said)"""
    try:
        done = subprocess.run([*map(str, words)], cwd=ROOT, env=ENVIRONMENT, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, text=True, errors="replace", timeout=PATIENCE)
    except (OSError, subprocess.TimeoutExpired) as e:
        return False, str(e)
    return done.returncode == 0, done.stdout


def scene(name, layout):
    with tempfile.TemporaryDirectory() as folder:
        try:
            gone, new, moved = scenes.departed(name, scenes.run_scene(pathlib.Path(folder), name, layout))
        except (scenes.Failed, subprocess.TimeoutExpired) as e:
            return False, str(e)
    return not (gone or new or moved), (f"gone: {gone}\nnew: {new}\nchanged: {moved}\n"
                                        "tests/scenes.py --compare shows how, --record takes it over")


def job(test):
    """A test, as mutants.py names it, as a call."""
    kind, _, names = test.partition(":")
    if kind in LAYOUTS:
        return lambda: scene(names, LAYOUTS[kind][0])
    if test.startswith(("unit/", "physics/")):
        return lambda: called([BUILD / "tests" / test])
    return lambda: called([*PYTEST, f"tests/{test}"])


def parted(tests):
    """Each once; scenes one by one."""
    out = []
    for test in tests:
        kind, _, names = test.partition(":")
        out += [f"{kind}:{n}" for n in names.split(",")] if kind in LAYOUTS else [test]
    return list(dict.fromkeys(out))


def programs(pattern):
    """Test programs whose source holds this."""
    return [f"{p.parent.name}/{p.stem}" for p in sorted(ROOT.glob("tests/[up]*/test_*.c"))
            if re.search(pattern, p.read_text())]


def nearest(file):
    """Names of the tests nearest to a file of the sources."""
    path = pathlib.Path(file)
    if path.is_absolute():
        path = path.relative_to(ROOT)
    if not (ROOT / path).is_file():
        sys.exit(f"{file}: no such file; NEAR takes files of the sources, as src/contact/pack.c")
    name = path.as_posix()
    if re.match(r"tests/(unit|physics)/test_\w+\.c$", name):
        return [name.removeprefix("tests/").removesuffix(".c")]
    if re.match(r"tests/(cli|parallel|long)/test_\w+\.py$", name):
        return [name.removeprefix("tests/")]
    if name in MUTANTS:
        return MUTANTS[name][0]
    if path.suffix in (".c", ".h"):
        header = path.with_suffix(".h").as_posix().removeprefix("src/").removeprefix("include/")
        return programs(rf'#include [<"]{re.escape(header)}[>"]') or [
            t for other, (tests, _) in MUTANTS.items() if pathlib.Path(other).parent == path.parent for t in tests]
    return [f"{p.parent.name}/{p.name}" for p in sorted(ROOT.glob("tests/[cp]*/test_*.py"))
            if re.search(rf"\b(?:import|from)\b.*\b{re.escape(path.stem)}\b|\b{re.escape(path.name)}\b", p.read_text())]


def ready(tests):
    """What the tests need beyond the program."""
    wanted = [BUILD.relative_to(ROOT) / "tests" / t for t in tests if t.startswith(("unit/", "physics/"))]
    if any(".py" in t for t in tests):
        wanted += ["helpers"]
    if wanted:
        ok, said = called(["make", "-s", f"-j{os.cpu_count()}", f"CONFIG={BUILD.name}", *wanted])
        if not ok:
            sys.exit(said)


def main(files):
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it, and so would tests
    jobs = [("lint", lambda: called(["tests/lint.sh", "changed"]))]
    if files:
        tests = parted(t for f in files for t in nearest(f))
        if not tests:
            print("no test is near: make test has all of them")
        ready(tests)
    else:
        # those that take longest first
        tests = sorted((f"unit/{p.stem}" for p in (ROOT / "tests/unit").glob("test_*.c")),
                       key=lambda t: t not in ("unit/test_cells", "unit/test_checkpoint", "unit/test_field"))
        jobs += [("links", lambda: called([*PYTEST, *DOCS]))]
        tests += [f"scenes:{name}" for name in DOZEN]
    # ranks that wait for each other want the cores
    side = [t for t in tests if not t.startswith(("ranks:", "parallel/"))]
    began, failed, n = time.monotonic(), [], 0

    def timed(name, call):
        start = time.monotonic()
        return name, *call(), time.monotonic() - start

    for some, workers in ((jobs + [(t, job(t)) for t in side], os.cpu_count()),
                          ([(t, job(t)) for t in tests if t not in side], 1)):
        with concurrent.futures.ThreadPoolExecutor(workers) as pool:
            for done in concurrent.futures.as_completed([pool.submit(timed, *j) for j in some]):
                name, ok, said, seconds = done.result()
                n += 1
                failed += [] if ok else [name]
                if not ok or seconds > 1 or files:
                    print(f"{name:<40} {'passed' if ok else 'FAILED'}  {seconds:5.1f} s", flush=True)
                if not ok or (name == "lint" and said):
                    print(said, flush=True)
    print(f"{n - len(failed)} passed, {len(failed)} failed, {time.monotonic() - began:.0f} s"
          + "".join(f"\n  {name}" for name in failed))
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
