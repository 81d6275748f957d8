# SPDX-License-Identifier: MIT
"""Small inputs that ask for too much, and inputs that try to lead output elsewhere."""
import json
import os
import resource

import pytest
from harness import BERGTOW, CASE, DONE, IO, ROOT, TOW, call, changed, run, write_case

SMALL = changed(TOW, run__duration=1, output=None)


def frugal():
    """What a refusal may use: 20 s and 1.5 GB, so that asking for everything is an error of the test and not of the
    machine."""
    resource.setrlimit(resource.RLIMIT_CPU, (20, 20))
    if "ASAN_OPTIONS" not in os.environ:  # its shadow takes terabytes of addresses
        resource.setrlimit(resource.RLIMIT_AS, (3 << 29, 3 << 29))


def refusal(folder, case, *fragments, code=CASE, command="run"):
    path = case if not isinstance(case, dict) else write_case(folder, case)
    result = call(command, path, cwd=folder, preexec_fn=frugal)
    assert result.returncode == code, f"exit code {result.returncode}:\n{result.stderr[-2000:]}"
    assert any(all(f in line for f in fragments) for line in result.stderr.splitlines()), result.stderr[-2000:]
    return result


GREEDY = {
    "floes": ({"ice__size": 1e-4}, "ice.size:", "floes, more than the limit of 20000000", "use larger floes"),
    "floes of a power law": ({"ice": {"size_law": "power", "size_min": 1e-5,
                                      "size_max": 1}}, "ice.size_min:", "floes, more than the limit of 20000000"),
    "steps": ({"run": {"dt": 1e-6, "duration": 1000},
               "tow__speed": 0}, "run.dt:", "steps of run.duration, more than the limit of 100000000", "lengthen"),
    "frames": ({"output__frame_interval": 1e-7}, "output.frame_interval:",
               "frames, more than the limit of 1000000", "lengthen it"),
    "work": ({
        "run": {"dt": 0.1, "duration": 9e6}, "domain": {"length": 4000, "width": 4000, "ends": "periodic"},
        "ice": {"concentration": 0.95, "size": 1}
    }, "run.duration:", "s on one core, more than the limit of 3e+09", "shorten the run"),
    "disk": ({
        "run": {"dt": 1, "duration": 1e5}, "domain": {"length": 2000, "width": 2000, "ends": "periodic"},
        "output__frame_interval": 0.1
    }, "output.frame_interval:", "bytes, more than the limit of 2e+13", "lengthen output.frame_interval"),
    "pieces of a lead": ({"lead": {"mode": "managed",
                                   "floe_size": 1e-6}}, "lead.floe_size:", "pieces, more than the limit of 20000000"),
    "floes by hand": ({"floes": [{"x": 9, "y": 0, "length": 1}] * 10001},
                      "floes: has 10001 entries, more than the limit of 10000"),
    "way-points": ({"tow__waypoints": [[4, 0]] * 10001}, "tow.waypoints:", "10001 points", "1 to 10000"),
    "text": ({"run__title": "x" * 5000}, "run.title:", "5000 bytes; give at most 4096"),
    "keys": ({f"k{i}": 1
              for i in range(300)}, "more than 256 keys in one map"),
}


@pytest.mark.parametrize("kind", GREEDY)
def test_greedy_case(tmp_path, kind):
    changes, *fragments = GREEDY[kind]
    refusal(tmp_path, changed(SMALL, **changes), *fragments)
    assert not (tmp_path / "out").exists(), "something was begun"


@pytest.mark.slow
def test_wrong_floes_are_not_reported_for_ever(tmp_path):
    """10,000 floes of 250 unknown keys: 2.5 million messages, with a search for the nearest key each."""
    case = changed(SMALL, floes=[{f"k{i}": 0 for i in range(250)}] * 3000)
    result = refusal(tmp_path, case, "the rest is not checked after 200 errors")
    assert len(result.stderr.splitlines()) < 1000


YAML = {
    "aliases": ("a: &a [x]\nb: &b [*a, *a]\nc: [*b, *b]\n", "anchors and aliases"),
    "depth": ("[" * 100000, "nested deeper than 16"),
    "values": ("floes: [" + "1," * 2100000 + "]\n", "more than 2 million values"),
    "quotes": ("run: {title: " + "'" * 40000 + "}", "run.title: the text has 19999 bytes; give at most 4096"),
}


@pytest.mark.parametrize("kind", YAML)
def test_hostile_yaml(tmp_path, kind):
    text, fragment = YAML[kind]
    (tmp_path / "bad.yml").write_text(text)
    refusal(tmp_path, "bad.yml", "bad.yml", fragment)


def test_text_of_an_input_does_not_steer_the_terminal(tmp_path):
    (tmp_path / "bad.yml").write_text('run: {dt: 0.1, duration: 1}\n"ice\\e[31m": 1\nbody: {shape: "x\\r\\x07"}\n')
    result = refusal(tmp_path, "bad.yml", "ice?[31m: unknown key")
    assert all(c.isprintable() for line in result.stderr.split("\n") for c in line)


# ---- files that a case names ----

TABLES = {
    "bytes": ("t,u,v\n" + "#" * (64 << 20), "t.csv", "larger than 64 MiB"),
    "rows": ("t,u,v\n" +"".join(f"{i},1,1\n" for i in range(2000002)), "t.csv",
             "t.csv:2000002: more than 2000000 rows"),
    "a long row": ("t,u,v\n0,1," + "1" * 300 + "\n", "t.csv", "t.csv:2: is too long for a row"),
    "NUL": ("t,u,v\n0,1\0,1\n", "t.csv", "t.csv:2: contains a NUL character"),
}


@pytest.mark.parametrize("kind", TABLES)
def test_greedy_table(tmp_path, kind):
    text, name, fragment = TABLES[kind]
    (tmp_path / name).write_text(text)
    refusal(tmp_path, changed(SMALL, water__current_table=name), fragment, command="check")


@pytest.mark.slow
def test_outlines_without_end(tmp_path):
    (tmp_path / "deep.json").write_text("[" * 1000000)
    refusal(tmp_path, changed(SMALL, ice={"outlines": "deep.json"}), "deep.json", "JSON")
    (tmp_path / "many.json").write_text("[]," * 40000001)
    refusal(tmp_path, changed(SMALL, ice={"outlines": "many.json"}), "many.json: holds 40000001 lists",
            "more than the limit of 40000000", "simplify")


def test_values_of_a_study(tmp_path):
    """Each is compared with those before it: a million of them took hours."""
    write_case(tmp_path, SMALL)
    (tmp_path / "study.yml").write_text("base: case.yml\nparameters: {ice.friction: [" +
                                        ", ".join(f"0.{i:06}" for i in range(10001)) + "]}\n")
    refusal(tmp_path, "study.yml", "study.yml:2: ice.friction: 10001 values, more than the limit of 10000",
            command="ensemble")
    (tmp_path / "study.yml").write_text("base: case.yml\nrepeats: 100000\nparameters: {ice.friction: [0.1, 0.2]}\n")
    refusal(tmp_path, "study.yml", "more than 100000 members", "fewer repeats", command="ensemble")


def test_every_limit_is_listed():
    listed = call("--list-keys").stdout
    for line in ("floes, made or read                          20000000 floes",
                 "steps                                       100000000 steps"):
        assert line in listed
    assert "refuses anything beyond these limits" in listed


# ---- output stays where it was asked for ----

READ = {"base", "ice.field", "ice.outlines", "water.current_table", "air.wind_table"}  # files that are read
SHOWN = {"run.title", "reference.source", "report.client", "report.project", "report.author",
         "report.document", "report.revision", "report.distribution"}            # texts that are shown


def contents(folder):
    return {p.relative_to(folder): (p.lstat().st_mode, p.lstat().st_mtime_ns) for p in folder.rglob("*")}


@pytest.mark.slow
def test_no_key_of_a_case_names_output(tmp_path):
    """Every text key, pointed outside in turn: nothing changes there. A new text key has to be put into one of the two
    sets."""
    listed = call("--list-keys").stdout.split("A study file")[0]
    texts = {line.split()[0] for line in listed.splitlines() if line[25:].startswith("text ")}
    assert texts == READ | SHOWN
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "victim").write_text("dear to somebody")
    before = contents(outside)
    for key in sorted(texts):
        for value in ("../outside/victim", "../outside/new", str(outside / "new"), "../outside"):
            name = key.replace(".", "__")
            result = call("run", write_case(tmp_path / "in", changed(SMALL, **{name: value})), "-o", tmp_path / "out",
                          "--force", "--steps", 2, "--quiet")
            assert result.returncode == (DONE if key in SHOWN else result.returncode), result.stderr
            assert key in SHOWN or result.returncode in (CASE, IO), (key, value)
    assert contents(outside) == before


def test_links_in_the_output_folder_are_not_followed(tmp_path):
    """Somebody's links under the names that a run writes: they are replaced."""
    names = [
        "result.h5", "result.part.h5", "result.h5.tmp", "checkpoint.h5", "checkpoint.h5.tmp", "checkpoint.previous.h5",
        "stop", "summary.json", "summary.json.tmp", "frames.xdmf", "frames.xdmf.tmp", "case.resolved.yml",
        "case.resolved.yml.new", "case.resolved.yml.new.tmp"
    ]
    outside, out = tmp_path / "outside", tmp_path / "out"
    outside.mkdir()
    out.mkdir()
    for name in names:
        (outside / name).write_text("dear to somebody")
        (out / name).symlink_to(outside / name)
    before = contents(outside)
    r = run(tmp_path, SMALL, "--force", "--steps", 2)
    assert r.summary["n_steps"] == 2
    assert contents(outside) == before
    assert not [p.name for p in out.iterdir() if p.is_symlink()]


@pytest.mark.parametrize("name, folder", [("...yml", "case"), ("..yml", "case"), (".yml", ".yml"), ("a.b.yml", "a.b")])
def test_folder_by_the_name_of_the_case(tmp_path, name, folder):
    """out/ and the name without .yml: of "...yml" that was out/.., the folder above."""
    (tmp_path / name).write_text(json.dumps(SMALL))
    result = call("run", name, "--steps", 1, "--quiet", cwd=tmp_path)
    assert result.returncode == DONE, result.stderr
    assert (tmp_path / "out" / folder / "summary.json").exists()
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([name, "out"])


def test_a_study_writes_into_its_folder_only(tmp_path):
    """Names of variants are texts of the study; the members' folders are numbered."""
    write_case(tmp_path / "in", SMALL)
    (tmp_path / "in" / "study.yml").write_text(
        'base: case.yml\nset: {run.duration: 0.2}\nvariants: {"../../escape": {ice.friction: 0.1}, "/tmp/x": '
        '{ice.friction: 0.2}}\n'
    )
    result = call("ensemble", "study.yml", "-o", tmp_path / "out", cwd=tmp_path / "in")
    assert result.returncode == DONE, result.stderr
    assert sorted(p.name for p in tmp_path.iterdir()) == ["in", "out"]
    assert sorted(p.name for p in (tmp_path / "out" / "members").iterdir()) == ["c001-r001", "c002-r001"]


def test_shipped_cases_are_far_below_the_limits():
    assert os.access(BERGTOW, os.X_OK) and (ROOT / "cases/scaling/tow-95.yml").exists()
    assert call("check", ROOT / "cases/scaling/tow-95.yml").returncode == DONE
