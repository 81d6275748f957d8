#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Scaling benchmark: the scenes of this folder over sizes, threads and ranks; writes bench.csv, bench.png and
machine.txt.

    make bench                 4 minutes on 2 quiet cores; BENCH=quick 1 minute; BENCH=full to 300,000 floes, 25 minutes
    bench.py --sizes 1000,2000 --scenes tow-80 --repeats 5 --out out/bench

The runs of one scene and size are interleaved (every configuration once, then again), so that a slow change of the
machine meets all of them alike, and medians are kept. What each column means: README.md.
"""
import argparse
import csv
import hashlib
import json
import math
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent

FLOE_AREA = math.pi / 4 * 30**2 * (1 + 0.23**2)  # m², mean of the scenes' floes: diameter 30 m, spread 23 %
BERG_AREA = 8 * 50**2 * math.sin(math.pi / 8)     # m², the 16-gon of the tow scenes
WALL_DISTANCE = 1500.0                           # m, of the compression scenes, the same in every size
#: steps of a run: long enough for the ice to be packed where it will be, short enough for the dense scenes, which cost
#: 30 times as much
STEPS = {"tow-80": 100, "tow-95": 20, "compression-80": 100, "compression-95": 30}
#: a size and its double give a weak-scaling figure
SIZES = {"quick": [1000, 2000, 4000], "default": [1000, 2000, 10000, 15000, 30000],
         "full": [1000, 2000, 10000, 15000, 30000, 60000, 100000, 150000, 300000]}
REPEATS = {"quick": 2, "default": 3, "full": 3}
ONCE_ABOVE = 50000                               # floes: larger fields are run once

PHASE_SHARE = "PHASE_share"  # in the place of a column for each phase of the summary
COLUMNS = [
    "scene", "asked", "floes", "ranks", "threads", "runs", "steps", "dt_s", "wall_s", "wall_min_s", "wall_max_s",
    "ns_per_floe_step",
    PHASE_SHARE, "mean_sweeps", "contacts", "contact_sweeps_per_s", "speedup", "step_speedup", "efficiency",
    "weak_efficiency", "weak_solve_efficiency", "imbalance", "edge_cut", "halo_share", "bytes_per_floe", "sweep_gb_s",
    "triad_gb_s", "sweep_of_triad", "round_trip_ns", "unconverged", "state_hash"
]
#: passed on from summary.json where it has them
FROM_SUMMARY = {
    "imbalance": "imbalance", "edge_cut": "edge_cut", "halo_share": "halo_share", "memory": "memory_per_floe_b",
    "sweep_bytes": "sweep_bytes_per_contact"
}


def fail(text):
    sys.exit(f"bench.py: {text}")


def say(text):
    print(text, flush=True)


# ---- what is run ----

def settings(scene, n):
    """--set arguments that give the scene n floes, all but the field."""
    concentration = int(scene.split("-")[1]) / 100
    area = n * FLOE_AREA / concentration
    if scene.startswith("compression"):
        return {"domain.width": f"{area / WALL_DISTANCE:.3f}"}
    side = math.sqrt(area + BERG_AREA)
    return {"domain.length": f"{side:.3f}", "domain.width": f"{side:.3f}", "body.x": f"{side / 4:.3f}",
            "body.y": f"{side / 2:.3f}"}


def flags(values):
    return [word for key, value in values.items() for word in ("--set", f"{key}={value}")]


def field_of(scene, n, o):
    """Field file of a scene, made unless it is there from an earlier benchmark of the same case and size."""
    case, values = HERE / f"{scene}.yml", settings(scene, n)
    key = hashlib.sha1((case.read_text() + str(sorted(values.items()))).encode()).hexdigest()[:10]
    path = o.out / "fields" / f"{scene}-{n}-{key}.h5"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        done = subprocess.run([o.bergtow, "field", case, "-o", path, *flags(values)], capture_output=True, text=True)
        if done.returncode:
            fail(f"no field for {scene} of {n} floes: {done.stderr.strip()}")
    return path


def command(scene, n, ranks, threads, steps, o):
    values = dict(settings(scene, n), **o.set_keys, **{"ice.field": field_of(scene, n, o).resolve()})
    folder = o.out / "runs" / f"{scene}-{n}-{ranks}x{threads}"
    words = [o.bergtow, "run", HERE / f"{scene}.yml", *flags(values), "-o", folder, "--force", "--quiet", "--threads",
             threads, "--steps", steps]
    if ranks > 1:
        words = ["mpirun", "-n", ranks, "--map-by", f"slot:PE={threads}", "--bind-to", "core", *words]
    return [str(w) for w in words], folder


def run_once(scene, n, ranks, threads, steps, o):
    """One run: what its summary and series say, as a dict; a text when it failed."""
    words, folder = command(scene, n, ranks, threads, steps, o)
    (folder / "summary.json").unlink(missing_ok=True)  # of an earlier benchmark
    env = dict(os.environ, OMP_NUM_THREADS=str(threads), OMP_PROC_BIND="true", OMP_PLACES="cores",
               OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1")
    with open(o.out / "last.log", "w+") as log:
        child = subprocess.Popen(words, env=env, stdout=log, stderr=log, stdin=subprocess.DEVNULL)
        _, status, usage = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        log.seek(0)
        lines = log.read().strip().splitlines()
    if child.returncode or not (folder / "summary.json").exists():
        # mpirun talks a lot
        said = [line for line in lines if line.startswith("bergtow")] or lines or ["without a word"]
        return f"{' '.join(words)} ended with {child.returncode}: " + "; ".join(said)
    summary = json.loads((folder / "summary.json").read_text())
    with h5py.File(folder / "result.h5") as h:
        contact_sweeps = float(np.dot(h["series/contacts"][:], h["series/sweeps"][:]))
    return record(scene, n, summary, contact_sweeps, usage.ru_maxrss * 1024 if ranks == 1 else None)


def record(scene, n, s, contact_sweeps, peak_memory):
    """The numbers of one run that the tables are made of."""
    r = {"scene": scene, "asked": n, "floes": s["n_floes"], "ranks": s["ranks"], "threads": s["threads"],
         "steps": s["n_steps"], "dt": s["dt_s"], "wall": s["wall_time_s"], "ns": s["ns_per_floe_step"],
         "phases": s["phases_s"], "sweeps": s["mean_sweeps"], "contacts": s["contacts_mean"],
         "unconverged": s["unconverged_steps"], "hash": s["state_hash"],
         "rate": contact_sweeps / s["phases_s"]["solve"] if s["phases_s"]["solve"] > 0 else None}
    r["step"] = sum(t for name, t in r["phases"].items() if name != "output") / max(1, r["floes"] * r["steps"])
    r.update({name: s.get(key) for name, key in FROM_SUMMARY.items()})
    if r["memory"] is None and peak_memory:
        r["memory"] = peak_memory / s["n_floes"]
    return r


def configurations(cores, with_ranks):
    """(ranks, threads): one core, then every power of two up to all of them, as threads and as ranks."""
    counts = [c for c in (2**k for k in range(1, 12)) if c <= cores]
    return [(1, 1)] + [x for c in counts for x in ([(1, c), (c, 1)] if with_ranks else [(1, c)])]


def ranks_work(o):
    """None if two ranks share one field here, or the reason why ranks are left out."""
    if o.cores < 2:
        return "one core only"
    r = run_once(o.scenes[0], o.sizes[0], 2, 1, 2, o)
    if isinstance(r, str):
        return "exit code " + r.split(" ended with ")[-1]
    if r["ranks"] == 2:
        return None
    return f"started on 2 ranks, the program reports {r['ranks']}: it does not divide the field over ranks"


# ---- the machine ----

def text_of(*words):
    try:
        return subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError) as e:
        return f"unknown ({e})"


def triad_size():
    """MiB of an array: four times the last cache, at most a tenth of the memory."""
    try:
        size = Path("/sys/devices/system/cpu/cpu0/cache/index3/size").read_text().strip()
        mib = 4 * int(size.rstrip("KM")) // (1024 if size.endswith("K") else 1)
    except (OSError, ValueError):
        mib = 256
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") >> 20
    return max(16, min(mib, memory // 10))


def triad_says(o, *words):
    """What triad prints, as numbers."""
    env = dict(os.environ, OMP_PROC_BIND="true", OMP_PLACES="cores")
    done = subprocess.run([o.triad, *map(str, words)], env=env, capture_output=True, text=True)
    if done.returncode:
        fail(f"{o.triad}: {done.stderr.strip() or done.returncode}")
    return [float(x) for x in done.stdout.split()]


def triad(threads, o):
    """GB/s of STREAM's triad, the best of 15 as STREAM reports it."""
    return triad_says(o, threads, o.triad_mib)[2]


def round_trip(cores, o):
    """Time in which a cache line goes from one core to another and back, ns; None on one core."""
    return triad_says(o, 2, 1, 1)[4] if cores > 1 else None


def describe_machine(o, load_before, triads, ranks_reason):
    with h5py.File(next((o.out / "runs").glob("*/result.h5"))) as h:
        built = {k: h.attrs[k] for k in ("version", "revision", "compiler", "flags", "libraries")}
    built = {k: v.decode() if isinstance(v, bytes) else v for k, v in built.items()}
    lines = [f"date: {time.strftime('%Y-%m-%d %H:%M:%S %Z')}", f"host: {text_of('uname', '-srm')}"]
    wanted = ("Model name", "CPU(s)", "Thread(s) per core", "CPU max MHz", "L1d cache", "L1i cache", "L2 cache",
              "L3 cache", "NUMA node(s)", "Hypervisor vendor")
    lines += [line for line in text_of("lscpu").splitlines() if line.split(":")[0].strip() in wanted]
    lines += [f"set: {key}={value}" for key, value in o.set_keys.items()]
    lines += [
        f"cores used: {o.cores}", f"memory: {os.sysconf('SC_PAGE_SIZE') * os.sysconf('SC_PHYS_PAGES') / 2**30:.1f} GiB"
    ]
    lines += [f"bergtow {k}: {v}" for k, v in built.items()]
    lines += [f"mpirun: {text_of('mpirun', '--version').splitlines()[0]}", f"ranks: {ranks_reason or 'measured'}"]
    lines += [f"load average before: {load_before}", "load average after: %.2f %.2f %.2f" % os.getloadavg()]
    lines += [
        f"triad, {c} thread{'s' * (c > 1)}: median {statistics.median(v):.2f}, least {min(v):.2f}, most {max(v):.2f} "
        f"GB/s "
        f"({len(v)} times, arrays of {o.triad_mib} MiB)" for c, v in sorted(triads.items())
    ]
    (o.out / "machine.txt").write_text("\n".join(lines) + "\n")


# ---- tables ----

def median(values):
    values = [v for v in values if v is not None]
    return statistics.median(values) if values else None


def ratio(a, b):
    return a / b if a is not None and b else None


def tables(records, triads):
    """Rows of bench.csv, one per scene, size and configuration, from the records of all runs."""
    groups = {}
    for r in records:
        groups.setdefault((r["scene"], r["asked"], r["ranks"], r["threads"]), []).append(r)
    ns = {key: median([r["ns"] for r in runs]) for key, runs in groups.items()}
    rate = {key: median([r["rate"] for r in runs]) for key, runs in groups.items()}
    step = {key: median([r["step"] for r in runs]) for key, runs in groups.items()}
    rows = []
    for (scene, n, ranks, threads), runs in groups.items():
        first, cores, mid = runs[0], ranks * threads, lambda name: median([r[name] for r in runs])  # noqa: B023
        own = ns[scene, n, ranks, threads]
        row = {name: first[name] for name in ("scene", "asked", "floes", "ranks", "threads", "steps")}
        row.update({
            "runs": len(runs), "dt_s": first["dt"], "wall_s": mid("wall"), "wall_min_s": min(r["wall"] for r in runs),
            "wall_max_s": max(r["wall"] for r in runs), "ns_per_floe_step": own
        })
        row.update({p + "_share": median([r["phases"][p] / r["wall"] for r in runs]) for p in first["phases"]})
        row.update({
            "mean_sweeps": mid("sweeps"), "contacts": mid("contacts"), "contact_sweeps_per_s": rate[scene, n, ranks,
                                                                                                    threads]
        })
        row["speedup"] = ratio(ns.get((scene, n, 1, 1)), own)
        row["efficiency"] = ratio(row["speedup"], cores)
        row["step_speedup"] = ratio(step.get((scene, n, 1, 1)), step[scene, n, ranks, threads])
        part = (scene, n // cores, 1, 1) if cores > 1 and n % cores == 0 else None  # one core's share, alone
        row["weak_efficiency"] = ratio(ns.get(part), cores * own)
        row["weak_solve_efficiency"] = ratio(rate[scene, n, ranks, threads], cores * (rate.get(part) or 0))
        row.update({name: mid(name) for name in ("imbalance", "edge_cut", "halo_share")})
        row["bytes_per_floe"] = mid("memory")
        sweep = mid("sweep_bytes")
        row["sweep_gb_s"] = (1e-9 * sweep * row["contact_sweeps_per_s"]
                             if sweep and row["contact_sweeps_per_s"] else None)
        row["triad_gb_s"] = median(triads.get(cores, []))
        row["sweep_of_triad"] = ratio(row["sweep_gb_s"], row["triad_gb_s"])
        row["round_trip_ns"] = median([r.get("round_trip") for r in runs])
        row.update({"unconverged": first["unconverged"], "state_hash": first["hash"]})
        rows.append(row)
    return rows


def differing(records):
    """Scenes and sizes whose runs did not all end in the same state."""
    seen = {}
    for r in records:
        seen.setdefault((r["scene"], r["asked"]), set()).add((r["steps"], r["hash"]))
    return [key for key, states in seen.items() if len(states) > 1]


def cell(value):
    return "" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)


def columns(rows):
    """COLUMNS with the phases that the runs name."""
    shares = [name for name in rows[0] if name.endswith("_share") and name not in COLUMNS]
    return [name for column in COLUMNS for name in (shares if column == PHASE_SHARE else [column])]


def write_csv(path, rows):
    names = columns(rows)
    with open(path, "w", newline="") as f:
        w = csv.writer(f)
        w.writerow(names)
        w.writerows([cell(row[name]) for name in names] for row in rows)


# ---- all of it ----

def options():
    p = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    p.add_argument("set", nargs="?", default="default", choices=sorted(SIZES), help="which sizes and repeats")
    p.add_argument("--sizes", help="numbers of floes, with commas, instead of those of the set")
    p.add_argument("--scenes", default=",".join(STEPS), help="of " + ", ".join(STEPS))
    p.add_argument("--steps", type=int, help="steps of every run, instead of the scene's own number")
    p.add_argument("--repeats", type=int, help="runs of each configuration")
    p.add_argument("--cores", type=int, default=len(os.sched_getaffinity(0)), help="use at most so many (default: all)")
    p.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="set_keys",
                   help="a case key for every run, not for its field; "
                   "solver.max_sweeps=50 with solver.tolerance=1e-9 gives every size the same sweeps")
    p.add_argument("--out", type=Path, default=ROOT / "build/bench", help="folder of tables, plot and cached fields")
    p.add_argument("--bergtow", type=Path, default=Path(os.environ.get("BERGTOW", ROOT / "build/release/bergtow")))
    p.add_argument("--triad", type=Path, default=ROOT / "build/release/triad")
    p.add_argument("--triad-mib", type=int, default=triad_size(), help="MiB of each array of the triad")
    o = p.parse_args()
    try:
        o.sizes = sorted({int(x) for x in o.sizes.split(",")}) if o.sizes else SIZES[o.set]
    except ValueError:
        p.error(f"--sizes {o.sizes}: give whole numbers with commas, as in 1000,2000")
    if not all("=" in x for x in o.set_keys):
        p.error(f"--set {' '.join(o.set_keys)}: give KEY=VALUE")
    o.set_keys = dict(x.split("=", 1) for x in o.set_keys)
    o.scenes = o.scenes.split(",")
    unknown = [s for s in o.scenes if s not in STEPS]
    if unknown:
        p.error(f"--scenes {','.join(unknown)}: no such scene; there are {', '.join(STEPS)}")
    if min(o.sizes) < 300 or (o.repeats or 1) < 1 or (o.steps or 1) < 1 or o.cores < 1 or o.triad_mib < 1:
        p.error("sizes are at least 300; repeats, steps, cores and MiB at least 1")
    for program in (o.bergtow, o.triad):
        if not program.exists():
            p.error(f"{program}: is missing; run `make bench`, which builds it")
    o.bergtow, o.triad, o.out = o.bergtow.resolve(), o.triad.resolve(), o.out.resolve()
    return o


def measure(o, with_ranks):
    """All runs: records, and the triad's rates by number of cores, taken between the sizes."""
    records, triads = [], {}
    configs = configurations(o.cores, with_ranks)
    for n in o.sizes:
        for cores in sorted({r * t for r, t in configs}):
            triads.setdefault(cores, []).append(triad(cores, o))
        for scene in o.scenes:
            repeats = o.repeats or (1 if n > ONCE_ABOVE else REPEATS[o.set])
            steps = o.steps or STEPS[scene]
            field_of(scene, n, o)
            group = []
            for _ in range(repeats):
                for ranks, threads in configs:
                    trip = round_trip(ranks * threads, o)
                    r = run_once(scene, n, ranks, threads, steps, o)
                    if isinstance(r, str):
                        fail(r)
                    r["round_trip"] = trip
                    if (r["ranks"], r["threads"]) != (ranks, threads):
                        fail(f"asked for {ranks} ranks × {threads} threads, the program used {r['ranks']} × "
                             f"{r['threads']}")
                    group.append(r)
            records += group
            for row in tables(group, triads):
                say(f"{scene:15s} {row['floes']:7d} floes {row['ranks']}x{row['threads']}  "
                    f"{row['ns_per_floe_step']:9.0f} ns a floe and step  "
                    f"speed-up {row['speedup']:.2f}, of the steps {row['step_speedup']:.2f}  "
                    f"sweeps {row['mean_sweeps']:6.1f}  contacts {row['contacts']:.0f}")
            write_csv(o.out / "bench.csv", tables(records, triads))  # what there is, should the rest be interrupted
    return records, triads


def main():
    o = options()
    o.out.mkdir(parents=True, exist_ok=True)
    load = "%.2f %.2f %.2f" % os.getloadavg()
    if os.getloadavg()[0] > 0.5:
        say(f"bench.py: load average {load}: others use this machine, times will be too long")
    reason = ranks_work(o)
    if reason:
        say(f"bench.py: no figures for MPI ranks: {reason}")
    start = time.time()
    records, triads = measure(o, reason is None)
    describe_machine(o, load, triads, reason)
    sys.path.insert(0, str(HERE))
    import bench_plot  # the pictures need matplotlib, the figures do not
    bench_plot.draw(o.out / "bench.csv", o.out / "bench.png")
    say(f"{len(records)} runs in {time.time() - start:.0f} s; {o.out}/bench.csv, bench.png, machine.txt")
    bad = differing(records)
    if bad:
        fail("the final state depends on threads, ranks or chance in " + ", ".join(f"{s} of {n} floes" for s, n in bad)
             + "; it must not: compare state_hash in bench.csv and report it")


if __name__ == "__main__":
    main()
