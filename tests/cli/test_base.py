# SPDX-License-Identifier: MIT
"""Case files with a base: what they mean, what is refused, and that every command and script takes them."""
import json
import random

import h5py
import pytest
import yaml

import random_cases
from harness import CASE, DONE, IO, ROOT, TOW, call, changed, differing, run, write_case

from bergtow.result import origins as report_case
from bergtow.result.run import Run
from bergtow.study import case_file

SHORT = changed(TOW, run__duration=4, run__title="the base", output={"window_start": 2})
NEARER = {"base": "sub/middle.yml", "run": {"title": "the nearest"}, "tow.speed": 0.2}
MIDDLE = {"base": "../far.yml", "tow": {"speed": 0.15, "ramp": 1}}
WHOLE = changed(SHORT, run__title="the nearest", tow__speed=0.2, tow__ramp=1)


@pytest.fixture
def folder(tmp_path):
    """near.yml, based on sub/middle.yml, based on far.yml; whole.yml says the same by itself."""
    write_case(tmp_path, NEARER, "near.yml")
    write_case(tmp_path / "sub", MIDDLE, "middle.yml")
    write_case(tmp_path, SHORT, "far.yml")
    write_case(tmp_path, WHOLE, "whole.yml")
    return tmp_path


def resolved(path, *more):
    done = call("check", path, "--scale", "1", *more)
    assert done.returncode == DONE, done.stderr
    return "\n".join(line for line in done.stdout.splitlines() if line and line[0] != "#")  # the head names the file


# ---- what they mean ----


def test_the_nearest_file_holds(folder):
    assert resolved(folder / "near.yml") == resolved(folder / "whole.yml")
    assert resolved(folder / "near.yml", "--set", "tow.speed=0.3") == resolved(folder / "whole.yml", "--set",
                                                                             "tow.speed=0.3")
    assert "near.yml: valid" in call("check", folder / "near.yml").stdout


def test_any_case_cut_into_a_chain_is_the_case(tmp_path):
    """Random cases, their keys spread over three files, some of them to two with another value in the farther."""
    table, tried = json.loads(call("--list-keys", "--json").stdout), 0
    for seed in range(12):
        case = random_cases.draw(seed, table)
        whole = write_case(tmp_path, case, "whole.yml")
        if call("check", whole).returncode != DONE:
            continue
        tried += 1
        rng, files = random.Random(seed), [{"base": "1.yml"}, {"base": "2.yml"}, {}]
        for name, value in random_cases.flat(case):
            nearest = rng.randrange(3)
            files[nearest][name] = value
            if rng.random() < 0.3 and not isinstance(value, (list, str, bool)):
                files[rng.randrange(nearest, 3)].setdefault(name, 12345)
        if "floes" in case:
            files[1]["floes"] = case["floes"]
            files[2]["floes"] = [{"x": 1e9, "y": 0, "length": 1}]
        files[0].setdefault("run", {})  # a section, so that no draw makes the file a study
        for i, content in enumerate(files):
            write_case(tmp_path, content, f"{i}.yml")
        assert resolved(tmp_path / "0.yml") == resolved(whole), seed
    assert tried >= 8


def test_files_lie_beside_the_file_that_names_them(folder):
    (folder / "sub/wind.csv").write_text("t,u,v\n0,1,0\n9,1,0\n")
    write_case(folder / "sub", MIDDLE | {"air": {"wind_table": "wind.csv"}}, "middle.yml")
    assert f'wind_table: "{folder}/sub/wind.csv"' in run(folder, folder / "near.yml").dir.joinpath(
        "case.resolved.yml").read_text()
    write_case(folder, NEARER | {"air": {"wind_table": "wind.csv"}}, "near.yml")
    refused = call("check", folder / "near.yml")
    assert refused.returncode == IO and f"{folder}/wind.csv" in refused.stderr


def test_a_list_of_floes_is_replaced_as_a_whole(folder):
    far = changed(SHORT, floes=[{"x": 10, "y": 1, "length": 1}, {"x": 99, "y": 1, "length": 1}])
    write_case(folder, far, "far.yml")
    refused = call("check", folder / "near.yml").stderr
    line = (folder / "far.yml").read_text().splitlines().index('   "x": 99,')
    assert f"far.yml:{line}: floes[1]: is outside the domain" in refused
    write_case(folder, NEARER | {"floes": [{"x": 12, "y": 1, "length": 1}]}, "near.yml")
    assert call("check", folder / "near.yml").returncode == DONE
    write_case(folder, NEARER | {"floes": []}, "near.yml")
    assert resolved(folder / "near.yml") == resolved(folder / "whole.yml")


def test_it_is_listed():
    assert "\nbase " in call("--list-keys").stdout
    assert [k["name"] for k in json.loads(call("--list-keys", "--json").stdout)["file_keys"]] == ["base"]


def test_a_shipped_case_has_a_base():
    near, far = (resolved(ROOT / f"cases/basin/{name}.yml") for name in ("basin-80-rafting", "basin-80"))
    differ = {line.split("#")[0].strip() for line in set(near.splitlines()) ^ set(far.splitlines())}
    assert {line.split(":")[0] for line in differ} == {"title", "kappa"}


# ---- what is refused ----

REFUSED = {
    "missing": ({"near": "base: none.yml\ntow: {speed: 1}\n"}, IO, "near.yml:1: base: ", "none.yml: cannot"),
    "missing base of a base": ({"near": "tow: {speed: 1}\nbase: far.yml\n", "far": "\nbase: gone.yml\nrun: {dt: 1}\n"},
                               IO, "far.yml:2: base: ", "gone.yml: cannot"),
    "itself": ({"near": "tow: {speed: 1}\nbase: ./near.yml\n"}, CASE, "near.yml:2: base: ", "is being read already"),
    "circle": ({"near": "base: far.yml\ntow: {speed: 1}\n", "far": "run: {dt: 1}\nbase: near.yml\n"}, CASE,
               "far.yml:2: base: ", "near.yml is being read already"),
    "a folder": ({"near": "base: .\ntow: {speed: 1}\n"}, IO, "near.yml:1: base: "),
    "a list": ({"near": "base: [a.yml, b.yml]\ntow: {speed: 1}\n"}, CASE, "near.yml:1: base: needs the name of one"),
    "nothing": ({"near": "base:\ntow: {speed: 1}\n"}, CASE, "near.yml:1: base: needs the name of one"),
    "a study": ({"near": "base: far.yml\ntow: {speed: 1}\n", "far": "base: whole.yml\nrepeats: 2\n"}, CASE,
                "far.yml: is a study"),
    "YAML of the base": ({"near": "base: far.yml\ntow: {speed: 1}\n", "far": "run:\n\tdt: 1\n"}, CASE,
                         "far.yml:2: not valid YAML: the line begins with a tab"),
    "unknown key of the base": ({"near": "base: far.yml\ntow: {speed: 1}\n",
                                 "far": "run: {dt: 0.1, duration: 1}\nice: {sise: 1}\n"}, CASE,
                                "far.yml:2: ice.sise: unknown key; did you mean ice.size?"),
    "value of the base": ({"near": "base: far.yml\ntow: {speed: 1}\n", "far": "run: {dt: 0.1, duration: -1}\n"}, CASE,
                          "far.yml:1: run.duration: -1 is out of range"),
    "value across files": ({"near": "base: far.yml\nice: {x_max: 90}\n", "far": "run: {dt: 0.1, duration: 1}\n"}, CASE,
                           "near.yml:2: ice.x_max: 90 m is more than the high end of the domain"),
    "twice in one file": ({"near": "base: far.yml\ntow: {speed: 1}\ntow.speed: 2\n",
                           "far": "run: {dt: 0.1, duration: 1}\n"}, CASE, "near.yml:3: tow.speed: duplicate key"),
    "base of a section": ({"near": "tow: {base: far.yml}\n"}, CASE, "near.yml:1: tow.base: unknown key"),
    "a study is meant": ({"near": "base: whole.yml\nparamters: {tow.speed: [1, 2]}\n"}, CASE, "near.yml: is a study"),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_refused(folder, kind):
    files, code, *fragments = REFUSED[kind]
    for name, text in files.items():
        (folder / f"{name}.yml").write_text(text)
    done = call("run", folder / "near.yml", "-o", folder / "out")
    assert done.returncode == code, done.stderr
    assert any(all(f in line for f in fragments) for line in done.stderr.splitlines()), done.stderr
    assert not (folder / "out").exists()


def test_a_long_chain_ends(folder):
    for i in range(18):
        (folder / f"{i}.yml").write_text(f"base: {i + 1}.yml\ntow: {{speed: 1}}\n")
    (folder / "18.yml").write_text("run: {dt: 0.1, duration: 1}\n")
    done = call("check", folder / "0.yml")
    assert done.returncode == CASE and "16.yml:1: base: more than 16 files" in done.stderr
    assert call("check", folder / "2.yml").returncode == DONE


def test_not_from_the_command_line(folder):
    done = call("check", folder / "near.yml", "--set", "base=far.yml")
    assert done.returncode != DONE and "the base of a case cannot be set here" in done.stderr


def test_a_case_is_no_study(folder):
    done = call("ensemble", folder / "near.yml", "-o", folder / "out")
    assert done.returncode == CASE and ": this is a case: bergtow run " in done.stderr


# ---- every command and script takes them ----


def test_the_record_is_complete(folder):
    """The resolved case needs no other file; the case as given is all its texts; a resumed run says the same."""
    one, other = run(folder, folder / "near.yml"), run(folder, folder / "whole.yml", name="whole")
    assert one.hash == other.hash
    assert "base" not in yaml.safe_load((one.dir / "case.resolved.yml").read_text())
    stopped = call("run", folder / "near.yml", "-o", folder / "stopped", "--steps", "20")
    assert stopped.returncode == DONE, stopped.stderr
    texts = [p.read_text() for p in (folder / "near.yml", folder / "sub/middle.yml", folder / "far.yml")]
    for path in folder.glob("**/*.yml"):
        if path.parent in (folder, folder / "sub"):
            path.unlink()
    again = run(folder, one.dir / "case.resolved.yml", name="again")
    assert again.hash == one.hash
    done = call("resume", folder / "stopped")
    assert done.returncode == DONE, done.stderr
    assert differing(one.dir / "result.h5", folder / "stopped/result.h5") == []
    with h5py.File(folder / "stopped/result.h5") as f:
        given = f["case_as_given"][()].decode()
    documents = [d for d in yaml.safe_load_all(given)]
    assert documents == [yaml.safe_load(text) for text in texts]
    assert [line for line in given.splitlines() if line.startswith("---")] == [
        "--- # near.yml", "--- # middle.yml", "--- # far.yml"]


def test_a_study_of_it(folder):
    """One condition, one field: the member has the state of the case with its seed."""
    write_case(folder, {"base": "near.yml", "seed": 3, "set": {"output.frame_interval": 2}}, "study.yml")
    assert "study.yml: valid" in call("check", folder / "study.yml").stdout
    done = call("ensemble", folder / "study.yml", "-o", folder / "e", "--threads", 1)
    assert done.returncode == DONE, done.stderr
    member = folder / "e/members/c001-r001"
    seed = yaml.safe_load((member / "case.resolved.yml").read_text())["ice"]["seed"]
    same = run(folder, folder / "whole.yml", "--set", f"ice.seed={seed}", "--set", "output.frame_interval=2")
    assert same.hash == json.loads((member / "summary.json").read_text())["state_hash"]
    write_case(folder, changed(SHORT, ice__friction=0.1), "far.yml")
    done = call("ensemble", folder / "study.yml", "-o", folder / "e", "--threads", 1)
    assert done.returncode == CASE and "members of another study" in done.stderr


def test_scripts_read_all_files(folder):
    (folder / "far.yml").write_text("run: {dt: 0.1, duration: 3, title: far}  # of the base\n"
                                    "ice:\n  size: 1  # measured\n  thickness: 5 cm  # assumed\n")
    (folder / "near.yml").write_text("base: far.yml\nice: {outlines: none}\nice.thickness: 4 cm  # here\n")
    layers = case_file.files(folder / "near.yml")
    assert case_file.section(layers, "ice") == {"outlines": "none", "size": 1, "thickness": "5 cm"}
    assert [p.name for p, _ in layers] == ["near.yml", "far.yml"]
    (folder / "far.yml").write_text("base: near.yml\n")
    with pytest.raises(case_file.RunError, match="based on itself"):
        case_file.files(folder / "near.yml")


@pytest.mark.parametrize("text", ["base: a.yml\n", "base: a.yml\nreport: {client: b}\n", "base: a.yml\nset: {}\n",
                                  "base: a.yml\ntow: {}\n", "base: a.yml\ntow.speed: 1\n", "base: a.yml\nfloes: []\n",
                                  "base: a.yml\ntow: {}\nrepeats: 2\n", "base: a.yml\nunheard_of: 1\n", "tow: {}\n"])
def test_scripts_and_program_tell_studies_alike(folder, text):
    (folder / "try.yml").write_text(text)
    said = call("run", folder / "try.yml", "-o", folder / "out").stderr
    assert case_file.is_study(folder / "try.yml") == ("is a study" in said)


def test_the_report_knows_where_values_come_from(folder):
    (folder / "far.yml").write_text("""\
run: {dt: 0.1, duration: 4}
domain: {length: 15, width: 8}
ice:
  size: 0.7      # measured in the photographs
  friction: 0.3  # assumed
  concentration: 0.5
body: {x: 3, length: 2, draft: 0.5}
tow: {speed: 0.13, ramp: 1}
output: {window_start: 2}
""")
    (folder / "near.yml").write_text("base: far.yml\nice:\n  friction: 0.2  # Sukhorukov\n")
    result = run(folder, folder / "near.yml")
    with Run(result.dir) as r:
        kinds = {v.key: (v.kind, v.origin) for v in report_case.values(r)}
    assert kinds["ice.size"] == ("source", "measured in the photographs")
    assert kinds["ice.friction"] == ("source", "Sukhorukov") and kinds["ice.concentration"][0] == "given"
