# SPDX-License-Identifier: MIT
"""Runs of a case with some keys replaced, each in a folder of its own; what is done is kept. For the scripts of cases/.

`a` is what their command lines share: case (file), out (folder of the results), set (KEY=VALUE for every run), threads,
bergtow (the program).
"""
import json
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "postproc"))

from bergtow.errors import RunError  # noqa: E402
from bergtow.result.run import Run  # noqa: E402


class Failed(Exception):
    """A run ended with an exit code other than 0."""

    def __init__(self, folder, code):
        super().__init__(f"{folder}: the run ended with exit code {code}; its message stands above")
        self.code = code if code > 0 else 6  # a signal


def same(folder, case, sets, bergtow):
    """Does the folder hold the whole result of this case by this build?"""
    try:
        with Run(folder) as run:
            revision = str(run.attributes.get("revision", ""))
            if not run.attributes.get("complete") or run.summary.get("stopped") or not revision:
                return False
    except RunError:
        return False
    version = subprocess.run([bergtow, "--version"], capture_output=True, text=True, check=True).stdout
    # The twin of scale 1 is the resolved case, below comments of its own.
    twin = subprocess.run([bergtow, "check", str(case), "--scale", "1", *sets], capture_output=True, text=True).stdout

    def keys(text):
        return [line for line in text.splitlines() if not line.startswith("#")]

    resolved = (folder / "case.resolved.yml").read_text(encoding="utf-8")
    of_commit = revision != "unknown" and "dirty" not in revision
    return of_commit and f"({revision}," in version and keys(twin) == keys(resolved)


def run(a, name, **values):
    """Run the case with keys (section__key) replaced, unless that has been done. Returns the folder."""
    folder = a.out / name
    replaced = [f"{key.replace('__', '.')}={value}" for key, value in values.items()] + a.set
    sets = [word for text in replaced for word in ("--set", text)]
    if same(folder, a.case, sets, a.bergtow):
        print(f"{folder}: kept", flush=True)
        return folder
    words = [a.bergtow, "run", str(a.case), "-o", str(folder), "--force", "--quiet", *sets]
    if a.threads:
        words += ["--threads", str(a.threads)]
    print(" ".join(words), flush=True)
    code = subprocess.run(words).returncode
    if code:
        raise Failed(folder, code)
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    mean, se = summary["mean_ice_resistance_n"], summary["mean_ice_resistance_se_n"]
    print(f"  {summary['n_floes']} floes, {summary['wall_time_s']:.0f} s of wall time, " +
          (f"{mean:.4g} N" +
           (f" +- {se:.2g} N" if se is not None else "") if mean is not None else "no steady window") +
          f", {summary['unconverged_steps']} of {summary['n_steps']} steps not converged",
          flush=True)
    return folder
