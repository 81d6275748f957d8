# SPDX-License-Identifier: MIT
"""What must hold of a run of a random case (random_cases.py): judge() says what is wrong, tried() runs a seed."""
import json
import re
import shutil
import subprocess

import h5py
import numpy as np

from harness import ROOT, environment, write_case
from random_cases import STEPS, draw, text, value_of


# Numbers of summary.json that are null where they do not apply, and when that may be; `n`: steps of the steady window.
def may_be_null(path, case, summary):
    body = value_of(case, "body.shape") != "none"
    window = summary["window"]["n_samples"]
    reference = value_of(case, "reference.mean_force")
    rules = (
        (r"title|stopped|lead|splitting|reference|.*\.source", True),
        (r"estimate_labels", not body),
        (r"start_peak_.*|.*\.start_peak_n", True),  # no step before the window
        (r"outlines\.origin_.*", True),
        (r".*_force_n|.*_ice_resistance.*_n|.*_se_n|peak_line_tension_n|budget\..*|window\..*|estimates.*|impacts.*",
         not body),
        (r"(mean|peak)_line_tension.*_n", not body or value_of(case, "tow.mode") not in ("line", "thrust")
         or window == 0),
        (r"mean_ice_resistance(_se|_low|_high)?_n", value_of(case, "tow.mode") == "none"),
        (r"mean_line_tension_2.*_n", value_of(case, "tow.line.branches", 1) != 2),
        (r"(mean_|window\.series\.)line_tension_?\d?[._].*",
         any(e["kind"] == "line_broken" for e in summary["events"])),
        (r"mean_ice_resistance_.*_n|window\.series\.ice_resistance\.mean_.*_n", not summary["mean_ice_resistance_n"]),
        (r"mean_vessel_thrust.*_n", not body or value_of(case, "tow.mode") != "thrust" or window == 0),
        (r"window\.series\..*\.change.*", window < 12),
        (r"window\.series\..*\.quarters_n", window < 4),
        (r".*_low_n|.*_high_n", window < 2),
        (r".*_force_n|.*_ice_resistance.*_n|budget\..*|window\..*|reference\.ratio", window == 0),
        (r".*(ice_resistance|tow_force).*_(se|low|high)_n", summary["window"].get("at_least")),
        (r".*_se_n|sd_.*|window\.n_independent|window\.correlation_time_s", window < 3 or not body),
        (r"window\.n_contact_stretches", not body or window < 20
         or not (summary["sd_ice_resistance_n"] or 0) > 0.02 * abs(summary["mean_ice_resistance_n"] or 0)),
        (r"budget\..*relative", True),  # over the largest force, which may be 0
        (r"reference\.ratio", not body or reference == 0 or value_of(case, "tow.mode") == "none"),
        (r"domain", not body),
        (r"domain\.body_widths_needed", summary["concentration"] < 0.445 or value_of(case, "domain.sides") == "open"
         or summary["n_floes"] == 0),
        (r"(worst_)?(repartition_)?imbalance", True),  # nothing was checked
        (r"sweep_bytes_per_contact|lead\.mean_piece_m", True),  # no contact in the last step, no piece
        (r"memory_per_floe_b|ns_per_floe_step|max_overlap_relative", summary["n_floes"] == 0),
        (r"impacts.*", True),
        (r"estimates.*", True),
        (r"moving_window.*", value_of(case, "domain.ends") != "moving"),
    )
    return any(allowed and re.fullmatch(pattern, path) for pattern, allowed in rules)


def numbers(x, path=""):
    """(path, value) of all that is no text, map or list."""
    if isinstance(x, dict):
        for k, y in x.items():
            yield from numbers(y, f"{path}.{k}" if path else k)
    elif isinstance(x, list):
        for y in x:
            yield from numbers(y, path)
    elif not isinstance(x, str):
        yield path, x


def has(case):
    """Which series apply, by the condition that the file names for each."""
    body, mode = value_of(case, "body.shape") != "none", value_of(case, "tow.mode")
    line = body and mode in ("line", "thrust")
    return {
        "always": True,
        "with a towed body": body,
        "with a tow line": line,
        "with a tow line of two branches": line and value_of(case, "tow.line.branches", 1) == 2,
        "with a vessel": line and mode == "thrust",
        "where collisions are identified": body and value_of(case, "impact.conversion", "duration") != "none",
        "with a moving window": value_of(case, "domain.ends") == "moving",
    }


#: contact forces on the body, NaN in steps without a load
NO_NUMBERS = ("ice_resistance", "ice_force_x", "ice_force_y", "ice_moment", "ice_resistance_budget", "tow_force",
              "largest_quasi_static_load")


def judge_result(case, folder, whole=True):
    """What is wrong with a result folder; whole: the run came to its end."""
    wrong = []
    applies = has(case)
    with h5py.File(folder / "result.h5") as f:
        for name, series in f["series"].items():
            x = series[:]
            good = np.isfinite(x) if applies[series.attrs["applies"]] else np.isnan(x)
            if name in NO_NUMBERS:
                good |= f["series/no_load"][:] > 0
            if not good.all():
                wrong.append(f"series {name}, {series.attrs['applies']}: {x[~good][:3]}")
        there = np.isfinite(f["frames/pose"][()]).all(axis=2)  # but for floes that have split
        split = [p for p in f["splits/parent"][()] if p < there.shape[1]] if "splits" in f else []
        if set((~there).any(axis=0).nonzero()[0].tolist()) - set(map(int, split)):
            wrong.append("frames pose: not finite")
        for name in ("pose", "contact_force", "net_force", "body_pose", "speed"):
            x = f["frames"][name][()]
            floes = x[:, :there.shape[1]] if name != "body_pose" else x[:, :0]
            if not (np.isfinite(floes[there[:, :floes.shape[1]]]).all()
                    and np.isfinite(x[:, floes.shape[1]:]).all()):
                wrong.append(f"frames {name}: not finite")
        pose, floes = f["frames/pose"][()], f["floes/offsets"].shape[0] - 1
        for name in ("impacts", "panels"):
            group = f.get(name)
            none = group is not None and name == "panels" and group.attrs.get("steps") == 0 # means of no step
            for key, item in (group.items() if group else ()):
                if isinstance(item, h5py.Dataset) and item.dtype.kind == "f" and not np.isfinite(
                        item[()]).all() and not (none and key.startswith("mean_")):
                    wrong.append(f"{name}/{key}: not finite")
    if pose.shape[1] != floes:
        wrong.append(f"{pose.shape[1]} floes in the frames, {floes} outlines")
    if not whole:
        return wrong
    summary = json.loads((folder / "summary.json").read_text(), parse_constant=lambda c: wrong.append(f"summary: {c}"))
    if summary["n_floes"] != floes:
        wrong.append(f"{summary['n_floes']} floes in the summary, {floes} outlines")
    wrong += [f"summary {p}: null" for p, x in numbers(summary) if x is None and not may_be_null(p, case, summary)]
    last = pose[-1][np.isfinite(pose[-1][:, 0])] if len(pose) else pose[-1]
    return wrong + judge_guards(case, folder, summary, last)


def resolved(folder, key):
    """A number of case.resolved.yml by the last part of its name, the first there is."""
    return float(re.search(rf"^ *{key}: (\S+)", (folder / "case.resolved.yml").read_text(), re.M)[1])


def judge_guards(case, folder, summary, pose):
    """Guards that a run of exit code 0 has let through; pose: of the floes at the end."""
    wrong = []
    if summary["max_overlap_m"] > value_of(case, "guard.overlap", 1) * summary["mean_size_m"]:
        wrong.append(f"overlap of {summary['max_overlap_m']} m, mean floe size {summary['mean_size_m']} m")
    x0, y0 = resolved(folder, "x0"), resolved(folder, "y0")
    length, width = value_of(case, "domain.length"), value_of(case, "domain.width")
    bounds = ((value_of(case, "domain.ends"), x0, length), (value_of(case, "domain.sides"), y0, width))
    beyond = [
        np.abs(pose[:, k] - low - extent / 2) > extent / 2 + 1e-9 * (abs(low) + extent)
        for k, (_, low, extent) in enumerate(bounds)
    ]
    for k, (bound, _, _) in enumerate(bounds):
        # Whoever has left by an open side may go round the end of a wall, as the guard has it.
        out = np.sum(beyond[k] & ~(beyond[1 - k] & (bounds[1 - k][0] == "open")))
        if bound != "open" and out:
            wrong.append(f"{out} floes outside in {'xy'[k]}, boundary {bound}")
    if summary["floes_outside"] and "open" not in (value_of(case, "domain.ends"), value_of(case, "domain.sides")):
        wrong.append(f"{summary['floes_outside']} floes outside")
    return wrong


def judge(case, folder, checked, ran):
    """What is wrong with `bergtow check` and `bergtow run` of a case, each a completed process; folder: of the
    result."""
    wrong = []
    for p in (checked, ran):
        if re.search(r"runtime error|Sanitizer|Assertion|MPI_ABORT|Signal:", p.stderr):
            wrong.append(f"{p.args[1]}: {p.stderr[-3000:]}")
    if ran.returncode not in (0, 3, 5):
        wrong.append(f"run: exit code {ran.returncode}: {ran.stderr[-2000:]}")
    if checked.returncode not in (0, 3):
        wrong.append(f"check: exit code {checked.returncode}: {checked.stderr[-2000:]}")
    if checked.returncode == 3 and ran.returncode != 3:
        wrong.append(f"check refuses and run ends with {ran.returncode}: {checked.stderr}")
    # What shows only when the field is made.
    if checked.returncode == 0 and ran.returncode == 3 and not re.search(
            r"cannot pack|has no room for the two largest|overlap by .* at the start", ran.stderr):
        wrong.append(f"check does not refuse, and run does: {ran.stderr}")
    if ran.returncode and "bergtow: " not in ran.stderr:
        wrong.append(f"run: exit code {ran.returncode} without a message")
    if wrong or ran.returncode == 3:
        return wrong
    if ran.returncode == 5:
        if not re.search(r"step \d+: .*(guard\.|not a number|larger than any run can give)", ran.stderr):
            wrong.append(f"exit code 5 without a guard's message: {ran.stderr}")
        if not (folder / "failure.h5").exists():
            wrong.append(f"exit code 5 without failure.h5: {ran.stderr}")
        if (folder / "summary.json").exists():
            wrong.append("exit code 5 and a summary")
        if not (folder / "result.h5").exists():
            return wrong + [f"exit code 5 without a result: {ran.stderr}"]
    return wrong + judge_result(case, folder, ran.returncode == 0)


def call_on(program, *arguments, timeout=120):
    """One thread unless said otherwise; a leak is a finding, but for those of Open MPI."""
    env = environment(OMP_NUM_THREADS=1, ASAN_OPTIONS="allocator_may_return_null=1:detect_leaks=1",
                      LSAN_OPTIONS=f"suppressions={ROOT}/tests/lsan.supp:print_suppressions=0")
    return subprocess.run([str(program), *map(str, arguments)], env=env, capture_output=True, text=True,
                          timeout=timeout)


def tried(seed, table, program, folder):
    """Exit code of the run of a seed's case on one or two threads, and what is wrong with it, each with the case to
    paste."""
    case = draw(seed, table)
    here = folder / f"seed{seed}"
    path = write_case(here, case)
    try:
        checked = call_on(program, "check", path)
        ran = call_on(program, "run", path, "-o", here / "out", "--quiet", "--steps", STEPS, "--threads", 1 + seed % 2)
        code, wrong = ran.returncode, judge(case, here / "out", checked, ran)
        again = here / "out/case.resolved.yml"  # what `resume` reads, and users pass on
        read = call_on(program, "check", again) if code in (0, 6) else ran
        wrong += [] if read is ran or read.returncode == 0 else [f"its case.resolved.yml is refused: {read.stderr}"]
    except subprocess.TimeoutExpired as e:
        code, wrong = None, [f"{e.cmd[1]}: still at work after {e.timeout} s"]
    if not wrong:
        shutil.rmtree(here)
    return code, [f"seed {seed}: {w}\n{text(case)}" for w in wrong]
