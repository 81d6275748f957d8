#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Does the suite tell wrong lines from right ones? Each mutant of tests/mutants.py is built in a copy of the source,
and tests run until one fails: the quick ones of those named with it, then two dozen scenes on one rank, which take some
seconds; with --wide, for survivors, the slow ones named with it, all scenes and the wider suite.

    tests/mutate.py [-j N] [--only TEXT] [--first N] [--alone] [--again] [--wide] [--seconds S] [--report [FILE.csv]]

They are taken in an order drawn with a fixed seed, so that a part of the list is a fair sample of it. A test counts
only where it passes without a mutant, which is looked at as well. Results are kept in build/mutate/results.json, by
text: a call goes on where the last one ended, the first one in a new clone from the table in tests/. Exit code 1 where
a mutant survives that mutants.py does not explain.
Kept own rather than mull or universalmutator: those change operators at random, need a whole suite a mutant (15 minutes
here), and know of no barrier, order or sync; a list says why each line matters."""
import argparse
import collections
import csv
import json
import multiprocessing
import os
import pathlib
import random
import shutil
import resource
import signal
import subprocess
import sys
import tempfile
import time

from harness import ROOT, environment
from mutants import EQUIVALENT, MUTANTS

HERE = ROOT / "build/mutate"
RESULTS = HERE / "results.json"
SOUND = HERE / "sound.json"
PAST = HERE / "past.json"
TABLE = ROOT / "tests/mutants-result.csv"
SEED = 20
# Seconds of a clock, generous since a busy machine must not kill a mutant; what computes without an end is stopped by
# its processor time: scenes take half a second of it, the slowest test of a part twenty.
PATIENCE = {"build": 900, "program": 900, "pytest": 3600, "scene": 600}
PROCESSOR = {"program": 60, "scene": 15}
# (ranks, threads) of the legs of a run; what ranks break shows on three of them, threads alone hardly tell anything
LAYOUTS = {"scenes": [((1, 1),)], "legs": [((1, 1), (1, 1))], "ranks": [((3, 2), (2, 1)), ((1, 2),)]}
# Half the time of -O3 to compile, and the same bits.
MAKE = ["make", "-s", "--no-print-directory", "CONFIG=release", "OPT_release=-O1 -DNDEBUG",
        "REVISION=mutant"]
PROGRAMS = [f"{p.parent.name}/{p.stem}" for p in sorted(ROOT.glob("tests/*/test_*.c")) if p.parent.name != "fuzz"]
#: as different from each other as can be
SOME = ("scenes:rebounds,slope,drag_and_mass,few_sweeps,solver_settings,restitution,crushing_press,rafting_press,"
        "body_in_parts_outlines,window_backwards,thrust_waypoints,vessel_details,bridle_unequal,tilt_dynamic,tables,"
        "walls_closing,open_sides,lead_managed,cold_start,plain_schedule,floes_of_each_shape,heavy_body_against_wall")
AMONG = "ranks:walls_closing,rebounds,few_sweeps,line,window"
WIDE = ["scenes:", *PROGRAMS, "parallel/test_scenes.py", "parallel/test_same_bits.py", "parallel/test_ranks.py",
        "cli/test_balance.py", "cli/test_tow.py", "cli/test_resume.py", "cli/test_run.py", "cli/test_random_cases.py",
        "parallel/test_everything.py"]


def listed():
    """(file, text, in its place, why, tests)"""
    return [(path, *m, tests) for path, (tests, found) in MUTANTS.items() for m in found]


def name_of(mutant):
    return f"{mutant[0]}: {mutant[1]} -> {mutant[2]}"


def of_ranks(mutant):
    """Can only ranks tell it?"""
    return "domain" in mutant[1] or mutant[0].startswith("partition/")


def price(test, past):
    """Seconds that a kill by this test costs, by what it has told so far. A test that has not run is taken for one
    that takes 5 s, 30 on ranks, and kills every second mutant."""
    kills, seconds = past.get(test, (0, 0))
    return (seconds + (30 if test.startswith(("ranks:", "parallel/")) else 5)) / (kills + 0.5)


def order_of(mutant, wide, past=None):
    """What to run, the cheapest kill first. What only ranks can show is looked for on ranks first, and what one rank
    never calls on ranks alone."""
    tests = mutant[4]
    if of_ranks(mutant) and not any(t.startswith("ranks:") for t in tests):
        tests = [*tests, AMONG]
    quick = [t for t in tests if "::" in t or t.startswith((*LAYOUTS, "unit/", "physics/"))]
    if mutant[0].startswith("partition/"):
        quick = [t for t in quick if not t.startswith(("scenes:", "legs:"))]
    elif not any("::" in t for t in quick):
        quick.append(SOME)
    if wide:
        return [t for t in [*tests, *WIDE] if t not in quick]
    return sorted(quick, key=lambda t: (of_ranks(mutant) and not t.startswith("ranks:"), price(t, past or {})))


def limited(seconds):
    """Called in a new process: it is killed after so much processor time."""
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))


def run(words, tree, seconds, processor=None):
    """Exit code and output; a group that hangs is killed whole, and counts as failed."""
    binary = tree / "build/release/bergtow"
    env = environment(GOMP_SPINCOUNT=5000, BERGTOW=binary, BERGTOW_VALIDATE=binary)
    del env["OMP_WAIT_POLICY"]  # as tests/run.sh has it: threads that sleep do not race
    p = subprocess.Popen(words, cwd=tree, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
                         start_new_session=True, env=env, preexec_fn=processor and (lambda: limited(processor)))
    try:
        out, _ = p.communicate(timeout=seconds)
    except subprocess.TimeoutExpired:
        os.killpg(p.pid, signal.SIGKILL)
        p.communicate()
        return "hangs", ""
    return p.returncode, out


def make(tree, *targets):
    return run([*MAKE, *targets], tree, PATIENCE["build"])


def copy_source(tree):
    """What git knows, and what is new, with its times: make builds what has changed since the last copy."""
    known = subprocess.run(["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True,
                           check=True)
    for name in known.stdout.splitlines():
        source, to = ROOT / name, tree / name
        if not source.is_file() or (to.exists() and to.read_bytes() == source.read_bytes()):
            continue
        to.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(source, to)
        os.utime(to)


def prepare(n):
    for name in ("tree0", "clean", *(f"tree{k}" for k in range(1, n))):
        tree = HERE / name
        if name != "tree0" and not tree.exists():
            subprocess.run(["cp", "-a", HERE / "tree0", tree], check=True)
        copy_source(tree)
        preloaded = (f"build/release/tests/fault/{s}.so" for s in ("fault", "calls", "memory", "host"))
        code, out = make(tree, "all", *preloaded)
        assert code == 0, out
        short = tree / "build/release/limited"
        short.write_text(f'#!/bin/sh\nulimit -t {PROCESSOR["scene"]}\nexec "$(dirname "$0")/bergtow" "$@"\n')
        short.chmod(0o755)


def sound(by, test):
    """Does the test that failed pass where nothing is wrong? One that does not shows nothing. Looked at once each."""
    known = json.loads(SOUND.read_text()) if SOUND.exists() else {}
    if by not in known:
        scene = by.removeprefix("scene ").split(" ")[0]
        known[by] = not fails(HERE / "clean", f"{test.partition(':')[0]}:{scene}" if by.startswith("scene ") else test)
        SOUND.write_text(json.dumps(known, indent=1))
        if not known[by]:
            print(f"fails without a mutant, so it tells nothing: {by}", flush=True)
    return known[by]


def fails_scenes(tree, names, layout):
    """The first scene of those named, or of all, that is not what is stored of it."""
    import scenes  # reads BERGTOW as it is imported
    scenes.PATIENCE = PATIENCE["scene"]
    _, stored = scenes.stored()
    binary = tree / "build/release/limited"
    for name in names or scenes.SCENES:
        with tempfile.TemporaryDirectory() as folder:
            try:
                found = scenes.digests(scenes.run_scene(pathlib.Path(folder) / "run", name, layout, binary=binary))
            except (scenes.Failed, subprocess.TimeoutExpired, OSError, KeyError, ValueError):
                return name
        if any(found.get(i) != d for i, d in stored[name].items()):
            return name
    return None


def fails(tree, test):
    """Does the test tell? The word for what did, or None."""
    kind, _, names = test.partition(":")
    if kind in LAYOUTS:
        for layout in LAYOUTS[kind]:
            found = fails_scenes(tree, [n for n in names.split(",") if n], layout)
            if found:
                return f"scene {found}" + (f" {layout}" if kind != "scenes" else "")
        return None
    if test.startswith(("unit/", "physics/")):
        program = f"build/release/tests/{test}"
        code, out = make(tree, program)
        if code != 0:
            return f"{test} does not build"
        code, _ = run([tree / program], tree, PATIENCE["program"], PROCESSOR["program"])
        return None if code == 0 else test
    if "ranks" in test or "same_bits" in test or "broken" in test:
        make(tree, "build/release/tests/parallel/broken_division")
    if "copies" in test:
        make(tree, "build/release/tests/parallel/copies")
    if "edges" in test or "python" in test:
        make(tree, "lib")
    code, out = run(["/usr/bin/python3", "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "-m", "not slow",
                     f"tests/{test}"], tree, PATIENCE["pytest"])
    return None if code == 0 else test


def restore(tree, since):
    """The clean tree's files, with their times, in place of all that was written since; what it has not, goes. So the
    next make compiles the next mutant, and not the right lines of the last one, too."""
    for path in (*(tree / d for d in ("src", "partition", "include")), tree / "build/release"):
        for file in path.rglob("*"):
            if file.is_file() and file.stat().st_mtime >= since:
                kept = HERE / "clean" / file.relative_to(tree)
                if kept.exists():
                    shutil.copy2(kept, file)
                else:
                    file.unlink()


def killed_by(tree, mutant, wide, told):
    """told: (test, did it tell?, seconds) of each that ran."""
    path, text, instead = mutant[:3]
    target = tree / path
    source = target.read_text()
    assert source.count(text) == 1, f"{path}: {source.count(text)} times: {text}"
    since = time.time() - 0.1
    target.write_text(source.replace(text, instead))
    try:
        code, out = make(tree, "all")
        if code != 0:
            return "does not build: " + out.strip().splitlines()[-1][:200]
        past = json.loads(PAST.read_text()) if PAST.exists() else {}
        for test in order_of(mutant, wide, past):
            began = time.monotonic()
            found = fails(tree, test)
            told.append((test, bool(found), time.monotonic() - began))
            # Twice: the wider suite takes hours, and some test of it may fail on a busy machine.
            if found and sound(found, test) and not (wide and not fails(tree, test)):
                return found
        return None
    finally:
        restore(tree, since)


def worker(k, jobs, done, wide):
    tree = HERE / f"tree{k}"
    for mutant in iter(jobs.get, None):
        began, told = time.monotonic(), []
        try:
            by = killed_by(tree, mutant, wide, told)
        except Exception as e:  # reported with the mutant; the others go on
            by = f"does not build: {e}"
        done.put((mutant, by, told, time.monotonic() - began))


def verdict(mutant, kept):
    """(kind, words) of a mutant; kinds: not run, does not build, killed, equivalent, survives."""
    r = kept.get(name_of(mutant))
    if r is None:
        return "not run", ""
    if r["by"] is None:
        why = EQUIVALENT.get(mutant[:3])
        return ("equivalent", why) if why else ("survives", "")
    return ("does not build" if r["by"].startswith("does not build") else "killed"), r["by"]


def known_of_table():
    """What the table that is kept with the source says: killed and surviving mutants, by their reasons."""
    if not TABLE.exists():
        return {}
    with open(TABLE, newline="") as f:
        of = {(r["file"], r["mutant"]): {"by": r["by"] if r["outcome"] == "killed" else None, "seconds": 0}
              for r in csv.DictReader(f)}
    return {name_of(m): of[m[0], m[3]] for m in listed() if (m[0], m[3]) in of}


def report(mutants, kept, table):
    """Score, and what survives; as a table of all, too."""
    found = [(m, *verdict(m, kept)) for m in mutants]
    n = collections.Counter(kind for _, kind, _ in found)
    for (path, text, instead, why, _), kind, words in found:
        if kind == "does not build":
            print(f"does not build: {path}: {text} -> {instead}: {words}")
        elif kind == "survives":
            print(f"survives: {path}: {why}\n    - {text!r}\n    + {instead!r}")
    if table:
        with open(table, "w", newline="") as f:
            rows = csv.writer(f, lineterminator="\n")
            rows.writerow(["file", "mutant", "outcome", "by"])
            rows.writerows([m[0], m[3], kind, words] for m, kind, words in sorted(found, key=lambda r: r[0][:3])
                           if kind != "not run")
    run_, wrong = n.total() - n["not run"], n["killed"] + n["survives"]
    print(f"{n.total()} mutants, {run_} run, {n['killed']} killed, {n['survives']} survive, {n['equivalent']} "
          f"equivalent ({100 * n['killed'] / max(1, wrong):.1f} % of those that are wrong)")
    return n["survives"] == 0 and n["does not build"] == 0


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("-j", type=int, default=1, help="trees at work at a time")
    p.add_argument("--only", default="", help="mutants whose file, text or reason holds this")
    p.add_argument("--first", type=int, default=0, help="so many of those that are left")
    p.add_argument("--alone", action="store_true", help="without those that only ranks can tell: each may take minutes")
    p.add_argument("--wide", action="store_true", help="survivors alone, against the wider suite")
    p.add_argument("--again", action="store_true", help="survivors alone, after new tests")
    p.add_argument("--seconds", type=float, default=1e9, help="begin none after this time")
    p.add_argument("--report", nargs="?", const="", help="only print what is known; into a table, too")
    a = p.parse_args()
    HERE.mkdir(parents=True, exist_ok=True)
    kept = json.loads(RESULTS.read_text()) if RESULTS.exists() else known_of_table()
    mutants = [m for m in listed() if a.only in " ".join(m[:4])]
    random.Random(SEED).shuffle(mutants)
    alive = a.wide or a.again
    todo = [m for m in mutants if (kept.get(name_of(m), {}).get("by", 0) is None if alive else name_of(m) not in kept)]
    todo = [m for m in todo if not (a.alone and of_ranks(m))]
    if a.first:
        todo = todo[:a.first]
    if a.report is not None:
        return 0 if report(mutants, kept, a.report) else 1
    prepare(a.j)
    jobs, done = multiprocessing.Queue(), multiprocessing.Queue()
    end, waiting, at_work = time.monotonic() + a.seconds, list(todo), 0
    workers = [multiprocessing.Process(target=worker, args=(k, jobs, done, a.wide)) for k in range(a.j)]
    for w in workers:
        w.start()
    while waiting or at_work:
        while waiting and at_work < a.j and time.monotonic() < end:
            jobs.put(waiting.pop(0))
            at_work += 1
        if not at_work:
            break
        mutant, by, told, seconds = done.get()
        at_work -= 1
        past = json.loads(PAST.read_text()) if PAST.exists() else {}
        for test, killed, took in told:
            before = past.get(test, (0, 0))
            past[test] = before[0] + killed, round(before[1] + took, 1)
        PAST.write_text(json.dumps(past, indent=1))
        kept[name_of(mutant)] = {"by": by, "seconds": round(seconds, 1)}
        RESULTS.write_text(json.dumps(kept, indent=1))
        print(f"{seconds:5.0f} s  {by or 'SURVIVES':40.40}  {mutant[0]}: {mutant[3]}", flush=True)
    for w in workers:
        jobs.put(None)
    for w in workers:
        w.join()
    return 0 if report(mutants, kept, None) else 1


if __name__ == "__main__":
    sys.exit(main())
