# SPDX-License-Identifier: MIT
"""The library within a program with a locale, as window systems set it, and a rounding mode of its own: the files are
those of the program `bergtow`. Rounding, traps and threads by themselves: tests/unit/test_plain_numbers.c."""
import json
import subprocess
import sys

import h5py
import pytest

from harness import DONE, FAULT, ROOT, TOW, call, changed, datasets, environment, run, script, write_case

HOST = FAULT.with_name("host.so")  # tests/fault/host.c
#: A drag that rises over the window, a place on the earth, and a conversion of loads: texts with fractions.
GEOGRAPHIC = changed(TOW, run__duration=10, output__window_start=5, ice__origin_lon="10.25 deg",
                     ice__origin_lat="70.5 deg")


@pytest.fixture(scope="module")
def comma(tmp_path_factory):
    """Environment of a program whose locale has a decimal comma."""
    folder = tmp_path_factory.mktemp("locale")
    charmap = ["<code_set_name> ANSI_X3.4-1968", "<comment_char> %", "<escape_char> /", "CHARMAP",
               *(f"<U{c:04X}> /x{c:02x} C{c}" for c in range(128)), "END CHARMAP"]
    (folder / "ascii").write_text("\n".join(charmap) + "\n")
    (folder / "numbers").write_text('LC_NUMERIC\ndecimal_point "<U002C>"\nthousands_sep ""\ngrouping -1\n'
                                    "END LC_NUMERIC\n")
    subprocess.run(["localedef", "-c", "-f", "./ascii", "-i", "./numbers", "./comma"], cwd=folder, capture_output=True)
    return {"LOCPATH": folder, "LC_NUMERIC": "comma"}


PROGRAM = """
import json, locale, sys
sys.path.insert(0, {postproc!r})
locale.setlocale(locale.LC_NUMERIC, "")
assert locale.localeconv()["decimal_point"] == ","
import bergtow
result = bergtow.run("case.yml", "out", threads=1)
assert isinstance(result.summary["mean_ice_resistance_n"], float)
try:
    bergtow.Simulation(bergtow.Case("case.yml", {{"body.x": 71.5}}))
except bergtow.BergtowError as e:
    assert "71.5" in str(e) and ",5" not in str(e), e
else:
    assert False
assert locale.localeconv()["decimal_point"] == ","
"""


def strings(tree, path=""):
    """{path: text} of all texts in JSON."""
    if isinstance(tree, str):
        return {path: tree}
    items = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    return {name: text for key, item in items for name, text in strings(item, f"{path}/{key}").items()}


def attributes(path):
    """{name: value} of all attributes of an HDF5 file."""
    with h5py.File(path) as f:
        found = {f"/{k}": str(v) for k, v in f.attrs.items()}
        f.visititems(lambda name, item: found.update({f"{name}/{k}": str(v) for k, v in item.attrs.items()}))
        return found


def compare(found, wanted):
    """Is the result folder the same, except for the times of the clock and the command?"""
    texts = [strings(json.loads((folder / "summary.json").read_text())) for folder in (found, wanted)]
    assert texts[0] == texts[1]
    of_file = [attributes(folder / "result.h5") for folder in (found, wanted)]
    for a in of_file:
        del a["/command_line"], a["/start_time"], a["/wall_time"]
    assert of_file[0] == of_file[1]
    assert datasets(found / "result.h5") == datasets(wanted / "result.h5")
    for name in ("frames.xdmf", "case.resolved.yml"):
        assert (found / name).read_text() == (wanted / name).read_text()


def test_python(comma, tmp_path):
    """Red when a writer takes the locale of the program: the summary is no JSON then, ParaView reads other times, and
    the map lies at another place."""
    write_case(tmp_path, GEOGRAPHIC)
    plain = run(tmp_path, tmp_path / "case.yml", name="plain")
    (tmp_path / "program.py").write_text(PROGRAM.format(postproc=str(ROOT / "postproc")))
    done = subprocess.run([sys.executable, "program.py"], cwd=tmp_path, capture_output=True, text=True, timeout=120,
                          env=environment(OMP_NUM_THREADS=1, **comma))
    assert done.returncode == 0, done.stderr
    compare(tmp_path / "out", plain.dir)
    for name in ("out", "plain"):
        made = script("export", name, "-o", f"{name}.geojson", "--time", 5, cwd=tmp_path)
        assert made.returncode == DONE, made.stderr
    assert (tmp_path / "out.geojson").read_text() == (tmp_path / "plain.geojson").read_text()


@pytest.mark.parametrize("threads", [1, 2])
def test_a_run(comma, tmp_path, threads):
    assert HOST.exists(), "make tests builds it"
    plain = run(tmp_path, GEOGRAPHIC, name="plain")
    host = run(tmp_path, GEOGRAPHIC, "--threads", threads, name="host", env=environment(LD_PRELOAD=HOST, **comma))
    if threads == 1:
        compare(host.dir, plain.dir)
        assert [line for line in host.result.stderr.splitlines() if "warning" in line] == \
            [line for line in plain.result.stderr.splitlines() if "warning" in line]
    assert host.hash == plain.hash


def test_an_ensemble(comma, tmp_path):
    """Red with fractions in the journal that follow the locale: it was no JSON, and a later call counted its members
    again."""
    write_case(tmp_path, GEOGRAPHIC)
    write_case(tmp_path, {"base": "case.yml", "repeats": 2, "parameters": {"tow.speed": [0.1, 0.15]}}, "study.yml")
    for name, env in ("plain", environment()), ("host", environment(LD_PRELOAD=HOST, **comma)):
        result = call("ensemble", "study.yml", "-o", name, "--threads", 1, cwd=tmp_path, env=env)
        assert result.returncode == DONE, result.stderr
    events = [json.loads(line) for line in (tmp_path / "host/journal.jsonl").read_text().splitlines()]
    assert all(isinstance(e["time"], float) for e in events)
    of_file = [datasets(tmp_path / name / "ensemble.h5") for name in ("host", "plain")]
    assert of_file[0] == of_file[1]
    for member in sorted((tmp_path / "plain/members").iterdir()):
        compare(tmp_path / "host/members" / member.name, member)
