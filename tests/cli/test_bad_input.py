# SPDX-License-Identifier: MIT
"""Bad input from a user's hand: each kind must end with its exit code and a message that names it and says what to
do."""
import os
import subprocess

import pytest

from harness import environment, launcher

BERGTOW = os.path.abspath(os.environ.get("BERGTOW", "build/release/bergtow"))
DONE, USAGE, CASE, IO = 0, 2, 3, 4

# A small case that is done at once, for the kinds of bad input that need the rest to be good.
GOOD = """\
run: {dt: 0.1, duration: 1}
domain: {length: 12, width: 8}
ice: {concentration: 0.3, size: 1}
body: {x: 4}
"""


def call(*arguments, cwd, env=None):
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_", "PMIX_"))} | (env or {})
    return subprocess.run([BERGTOW, *map(str, arguments)], cwd=cwd, env=environment, capture_output=True, timeout=60)


def refused(result, code, *fragments):
    """The call ended with this code, and one line of stderr holds all the fragments."""
    text = result.stderr.decode("utf-8", "replace")
    assert result.returncode == code, f"exit code {result.returncode}, wanted {code}:\n{text}"
    assert any(all(f in line for f in fragments) for line in text.splitlines()), f"no line with {fragments} in:\n{text}"
    assert "Sanitizer" not in text and "runtime error" not in text, text


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "good.yml").write_text(GOOD)
    return tmp_path


def test_the_good_case_is_good(folder):
    """Otherwise every test below would pass for the wrong reason."""
    result = call("check", "good.yml", cwd=folder)
    assert result.returncode == DONE and not result.stderr, result.stderr
    assert b"good.yml: valid" in result.stdout


# ---- the text of a case ----

TEXTS = {
    "unknown key": (GOOD + "tow: {sped: 1}\n", "bad.yml:5: tow.sped: unknown key; did you mean tow.speed?"),
    "unknown section": (GOOD + "iec: {size: 1}\n", "bad.yml:5: iec: unknown key; did you mean ice?"),
    "key in the wrong section": (GOOD + "tow: {friction: 1}\n",
                                 "bad.yml:5: tow.friction: unknown key; did you mean ice.friction?"),
    "duplicate key": (GOOD + "run: {dt: 0.2}\n", "bad.yml:5: run: duplicate key, first given in line 1"),
    "duplicate in two spellings": (GOOD + "run.dt: 0.2\n", "bad.yml:5: run.dt: duplicate key, first given in line 1"),
    "missing required key": ("run: {dt: 0.1}\n", "bad.yml: run.duration: missing"),
    "NaN": (GOOD + "tow: {speed: .nan}\n", 'bad.yml:5: tow.speed: ".nan" is not a number'),
    "infinity": (GOOD + "tow: {speed: .inf}\n", 'bad.yml:5: tow.speed: ".inf" is not a number'),
    "overflow": (GOOD + "tow: {speed: 1e999}\n", "bad.yml:5: tow.speed: 1e999 is too large"),
    "underflow": (GOOD + "tow: {speed: 1e-400}\n", "bad.yml:5: tow.speed: 1e-400 is too small"),
    "fixed floe that moves": (GOOD + "floes: [{length: 1, x: 9, y: 2, fixed: true, vy: 0.1}]\n",
                              "bad.yml:5: floes[0]: is fixed and has a velocity; remove vx, vy and yaw_rate, or fixed"),
    "tide of seconds": (GOOD + "water: {tide: {major: 0.1, period: 1.9}}\n",
                        "bad.yml:5: water.tide.period: 1.9 s is less than the time of 20 steps, 2 s"),
    "negative thickness": (GOOD.replace("size: 1", "thickness: -0.1 m"),
                           "bad.yml:3: ice.thickness: -0.1 m is out of range", "(0, 100] m"),
    "rafting of ice that does not float": (
        GOOD.replace("size: 1", "rafting: {kappa: 10}, density: 1000") + "\nwater: {density: 1000}\n",
        "ice.rafting.kappa: cannot be used with ice as heavy as water", "0 for rigid floes"),
    "rafting that gives energy": (GOOD.replace("size: 1", "rafting: {kappa: 1.5}"),
                                  "bad.yml:3: ice.rafting.kappa: 1.5 is less than 2", "give 0 for none"),
    "ice that sinks": (GOOD.replace("size: 1", "density: 1000") + "water: {density: 900}\n",
                       "bad.yml:3: ice.density: 1000 kg/m3 is more than water.density, 900 kg/m3", "correct one"),
    "concentration above one": (GOOD.replace("0.3",
                                             "1.2"), "bad.yml:3: ice.concentration: 1.2 is out of range", "[0, 0.95]"),
    "wrong unit": (GOOD + "tow: {speed: 3 kN}\n",
                   "bad.yml:5: tow.speed: kN is the unit of a force, but this is a speed", "m/s"),
    "unknown unit": (GOOD + "tow: {speed: 3 mph}\n", 'bad.yml:5: tow.speed: "mph" is not a unit of speed'),
    "trailing junk": (GOOD.replace("0.3", "0.8x"), 'bad.yml:3: ice.concentration: "x"'),
    "hexadecimal": (GOOD + "tow: {speed: 0x10}\n", 'bad.yml:5: tow.speed: "x10"'),
    "decimal comma": (GOOD + "tow: {speed: \"0,13\"}\n", "bad.yml:5: tow.speed: 0,13 has a comma; write decimals "
                      "with a point, as in 0.13, and thousands without a separator"),
    "decimal comma without braces": (GOOD + "tow:\n  speed: 0,13 m/s\n", "bad.yml:6: tow.speed: 0,13 m/s has a comma",
                                     "as in 0.13 m/s,"),
    "decimal comma in braces": (GOOD + "tow: {speed: 0,13 m/s, ramp: 1}\n",
                                "bad.yml:5: tow.speed: 0,13 m/s has a comma", "as in 0.13 m/s"),
    "decimal comma of a floe": (GOOD + "floes: [{x: 3, y: 1, length: 0,5}]\n",
                                "bad.yml:5: floes[0].length: 0,5 has a comma", "as in 0.5"),
    "comma between thousands": (GOOD + "tow:\n  ramp: 1,000 s\n", "bad.yml:6: tow.ramp: 1,000 s has a comma; "
                                "write decimals with a point, and thousands without a separator"),
    "concentration in tenths": (GOOD.replace("0.3", "8"), "bad.yml:3: ice.concentration: 8 is out of range",
                                "did you mean 0.8 (ice charts count tenths) or 8 %?"),
    "ten tenths": (GOOD.replace("0.3", "10"), "bad.yml:3: ice.concentration: 10 is out of range",
                   "ice charts count tenths, and 10 of them are 1; give a value in [0, 0.95]"),
    "concentration in percent": (GOOD.replace("0.3", "80"), "did you mean 0.8 or 80 %?"),
    "fraction for a whole number": (GOOD + "solver: {max_sweeps: 1.5}\n", "bad.yml:5: solver.max_sweeps",
                                    "whole number"),
    "integer overflow": (GOOD.replace("size: 1", "seed: 99999999999999999999"),
                         "bad.yml:3: ice.seed: 99999999999999999999 is too large"),
    "unknown choice": (GOOD.replace("x: 4", "shape: shipp"), "bad.yml:4: body.shape:", "did you mean ship?"),
    "neither true nor false": (GOOD + "solver: {warm_start: 2}\n", "bad.yml:5: solver.warm_start:", "true"),
    "empty value": (GOOD + "tow:\n  speed:\n", "bad.yml:6: tow.speed: has no value"),
    "list for a value": (GOOD + "tow: {speed: [1, 2]}\n", "bad.yml:5: tow.speed: is a list"),
    "value for a section": (GOOD + "tow: 1\n", "bad.yml:5: tow: is a section"),
    "body larger than the basin": (GOOD.replace("x: 4", "length: 20"), "bad.yml:4: body.length: the body spans",
                                   "domain.width"),
    "body outside": (GOOD.replace("x: 4", "x: 40"), "bad.yml:4: body.x:", "outside the domain"),
    "tow through the wall": (GOOD.replace("duration: 1}",
                                          "duration: 1000}"), "bad.yml:1: run.duration:", "in its way after"),
    "body that is not convex": (GOOD.replace("x: 4", "x: 4, shape: polygon, vertices: [[0,0],[2,0],[1,0.2],[0,2]]"),
                                "bad.yml:4: body.vertices: the waterline is refused"),
    "two points": (GOOD.replace("x: 4", "x: 4, shape: polygon, vertices: [[0,0],[2,0]]"),
                   "bad.yml:4: body.vertices: has 2 points"),
    "ice region outside": (GOOD.replace("size: 1", "x_max: 13"),
                           "bad.yml:3: ice.x_max: 13 m is more than the high end of the domain, 12 m; move it inside"),
    "empty ice region": (GOOD.replace("size: 1",
                                      "x_min: 5, x_max: 5"), "bad.yml:3: ice.x_min: 5 m is not below ice.x_max"),
    "floes larger than the basin": (GOOD.replace("size: 1", "size: 30"),
                                    "bad.yml:3: ice.size: 30 m is more than the short side of the ice region, 8 m"),
    "too many floes": (GOOD.replace("size: 1", "size: 0.1 mm"), "bad.yml:3: ice.size:", "more than the limit of"),
    "too many steps": (GOOD.replace("dt: 0.1", "dt: 1e-12"), "bad.yml:1: run.dt:", "steps"),
    "step longer than the run": (GOOD.replace("dt: 0.1",
                                              "dt: 2"), "bad.yml:1: run.dt: 2 s is more than run.duration"),
    "no line": (GOOD + "tow: {mode: line, line_stiffness: 0}\n", "bad.yml:5: tow.line_stiffness:", "needs a stiffness"),
    "floe by hand outside": (GOOD + "floes: [{x: 30, y: 0, length: 1}]\n",
                             "bad.yml:5: floes[0]: is outside the domain"),
    "floe by hand without place": (GOOD + "floes: [{x: 9, length: 1}]\n", "bad.yml:5: floes[0].y: missing"),
    "anchor": (GOOD.replace("run: {", "run: &a {"), "bad.yml:1: anchors and aliases"),
    "two documents": (GOOD + "---\n" + GOOD, "bad.yml:5: a second document"),
    "not YAML": (GOOD + "tow: {speed: 1\n", "not valid YAML"),
    "tab": ("run:\n\tdt: 1\n", "bad.yml:2: not valid YAML: the line begins with a tab", "write two spaces"),
    "tab behind blanks": ("run:\n  dt: 1\n  \tduration: 1\n", "bad.yml:3: not valid YAML: the line begins with a tab"),
    "no colon, first of its section": ("run:\n  dt 1 s\n\n  # one hour\n  duration: 1 h\n",
                                       "bad.yml:2: not valid YAML: a colon is missing", "write dt: 1 s"),
    "no colon, last of its section": ("run:\n  duration: 1 h\n  dt 1 s\nice: {size: 1}\n",
                                      "bad.yml:3: not valid YAML: a colon is missing", "write dt: 1 s"),
    "no colon, alone in its section": (GOOD + "tow:\n  speed 1 m/s\n", "bad.yml:6: tow.speed 1 m/s: a colon is missing",
                                       "write speed: and then the value"),
    "no colon, in braces": (GOOD + "tow: {speed 1 m/s, ramp: 2}\n", "bad.yml:5: tow.speed 1 m/s: a colon is missing"),
    "no colon after a section": ("run\n  dt: 1 s\n  duration: 1 h\n", "bad.yml:1: not valid YAML: a colon is missing",
                                 "write run:"),
    "no blank after a colon": ("run:\n  dt:1 s\n  duration: 1 h\n", "bad.yml:2: not valid YAML: a space is missing",
                               "write dt: 1 s"),
    "no blank after a colon, in braces": (GOOD + "tow: {speed:1}\n", "bad.yml:5: tow.speed:1: a colon with a space"),
    "two keys in a line": ("run:\n  dt: 1 s duration: 1 h\n", "bad.yml:2: not valid YAML: two keys on one line"),
    "indented below a value": ("run:\n  dt: 1 s\n    duration: 1 h\n",
                               "bad.yml:3: not valid YAML: indented deeper than line 2", "indent both lines alike"),
    "percent without its sign": (GOOD.replace("0.3", "80"), "bad.yml:3: ice.concentration: 80 is out of range",
                                 "did you mean 0.8 or 80 %?"),
    "deep nesting": ("[" * 1000, "nested deeper"),
    "empty file": ("", "bad.yml: holds no keys"),
    "a list": ("- 1\n", "is not a case"),
}


@pytest.mark.parametrize("kind", TEXTS)
def test_text_of_a_case(folder, kind):
    text, *fragments = TEXTS[kind]
    (folder / "bad.yml").write_text(text)
    for command in ("check", "run"):
        refused(call(command, "bad.yml", cwd=folder), CASE, *fragments)
    assert not (folder / "out").exists(), "a refused case left a result folder"


def test_all_errors_of_a_file_come_at_once(folder):
    (folder / "bad.yml").write_text("run: {dt: x}\nice: {size: -1, sise: 2}\ntow: {mode: fast}\n")
    lines = call("check", "bad.yml", cwd=folder).stderr.decode().splitlines()
    assert len(lines) == 5, lines
    assert all(line.startswith("bergtow: bad.yml:") and ";" in line for line in lines), lines


def test_binary_garbage(folder):
    (folder / "bad.yml").write_bytes(bytes(range(256)) * 40)
    refused(call("check", "bad.yml", cwd=folder), CASE, "bad.yml", "not UTF-8")


def test_latin1_text(folder):
    (folder / "bad.yml").write_bytes(b"run: {title: \"is\xe5\", dt: 0.1, duration: 1}\n")
    refused(call("check", "bad.yml", cwd=folder), CASE, "bad.yml", "not UTF-8")


def test_huge_file(folder):
    (folder / "bad.yml").write_bytes(b"#" * (17 << 20))
    refused(call("check", "bad.yml", cwd=folder), CASE, "bad.yml", "16 MiB")


# ---- files and folders ----

@pytest.mark.parametrize("command", ["run", "check"])
def test_missing_file(folder, command):
    refused(call(command, "absent.yml", cwd=folder), IO, "absent.yml: cannot be read: No such file")


def test_folder_as_case(folder):
    (folder / "cases").mkdir()
    refused(call("check", "cases", cwd=folder), IO, "cases: is a folder")


def field_case(folder, name):
    (folder / "bad.yml").write_text(GOOD.replace("concentration: 0.3, size: 1", f"field: {name}"))


@pytest.mark.parametrize("command", ["run", "check"])
def test_missing_field_file(folder, command):
    field_case(folder, "absent.h5")
    result = call(command, "bad.yml", cwd=folder)
    refused(result, result.returncode, "absent.h5")
    assert result.returncode in (CASE, IO)


def test_text_as_field_file(folder):
    (folder / "field.h5").write_text("no field\n" * 100)
    field_case(folder, "field.h5")
    refused(call("check", "bad.yml", cwd=folder), CASE, "field.h5")


def test_empty_field_file(folder):
    (folder / "field.h5").write_bytes(b"")
    field_case(folder, "field.h5")
    refused(call("check", "bad.yml", cwd=folder), CASE, "field.h5")


def test_hdf5_without_field(folder):
    h5py = pytest.importorskip("h5py")
    with h5py.File(folder / "field.h5", "w") as f:
        f["something"] = [1, 2, 3]
    field_case(folder, "field.h5")
    refused(call("check", "bad.yml", cwd=folder), CASE, "field.h5")


def make_field(folder):
    result = call("field", "good.yml", "-o", "field.h5", cwd=folder)
    assert result.returncode == DONE, result.stderr
    field_case(folder, "field.h5")
    return folder / "field.h5"


def test_a_field_is_read_back(folder):
    make_field(folder)
    result = call("check", "bad.yml", cwd=folder)
    assert result.returncode == DONE, result.stderr
    assert b"read from the field file" in result.stdout


@pytest.mark.parametrize("keep", [0.1, 0.5, 0.9])
def test_truncated_field_file(folder, keep):
    path = make_field(folder)
    data = path.read_bytes()
    path.write_bytes(data[:int(keep * len(data))])
    refused(call("check", "bad.yml", cwd=folder), CASE, "field.h5")


@pytest.mark.parametrize("name, value", [("pose", float("nan")), ("vertices", float("inf")), ("thickness", -1.0),
                                         ("offsets", 10**12)])
def test_field_file_with_a_bad_value(folder, name, value):
    h5py = pytest.importorskip("h5py")
    path = make_field(folder)
    with h5py.File(path, "r+") as f:
        data = f["floes"][name]
        data[(1,) * data.ndim] = value
    refused(call("check", "bad.yml", cwd=folder), CASE, "field.h5")


def test_impossible_packing(folder):
    (folder / "bad.yml").write_text(GOOD.replace("concentration: 0.3", "shape: polygons, concentration: 0.95"))
    for arguments in (("run", "bad.yml"), ("field", "bad.yml", "-o", "x.h5")):
        refused(call(*arguments, cwd=folder), CASE, "bad.yml", "concentration")


def test_unwritable_output_folder(folder):
    refused(call("run", "good.yml", "-o", "good.yml/out", cwd=folder), IO, "good.yml/out")


def test_unwritable_field_file(folder):
    refused(call("field", "good.yml", "-o", "absent/field.h5", cwd=folder), IO, "absent/field.h5")


def test_a_result_is_not_replaced_unasked(folder):
    old = folder / "out" / "good" / "result.h5"
    assert call("run", "good.yml", "--quiet", cwd=folder).returncode == DONE
    old.write_text("damaged")
    refused(call("run", "good.yml", cwd=folder), IO, "out/good: holds a result", "--force")
    study = "base: good.yml\nrepeats: 1\nseed: 1\n"
    (folder / "study.yml").write_text(study)
    refused(call("ensemble", "study.yml", "-o", "out/good", cwd=folder), IO, "out/good: holds a run; give the ensemble")
    assert not (folder / "out/good/members").exists()
    assert call("ensemble", "study.yml", "-o", "out/study", cwd=folder).returncode == DONE
    refused(call("run", "good.yml", "-o", "out/study", "--force", cwd=folder), IO, "out/study: holds an ensemble")
    assert old.read_text() == "damaged"
    result = call("run", "good.yml", "--force", "--quiet", cwd=folder)
    assert result.returncode == DONE, result.stderr
    assert old.read_bytes()[:4] == b"\x89HDF"


def test_open_water_needs_no_limits_of_a_law(folder):
    """Red: "about nan floes and 600 steps need some nan GB"."""
    result = call("check", "good.yml", "--set", "ice.concentration=0", "--set", "ice.size_law=power", cwd=folder)
    assert result.returncode == DONE and b"nan" not in result.stdout, result.stderr


# ---- the command line ----

def test_a_file_of_another_kind_is_told_its_command(folder):
    """A case for a study, a study for a command or a result. Red with a list of unknown keys, or of no checkpoint."""
    (folder / "study.yml").write_text("base: good.yml\nrepeats: 2\n")
    done = call("ensemble", "good.yml", cwd=folder)
    refused(done, CASE, "bergtow: good.yml: this is a case: bergtow run good.yml")
    assert done.stderr.count(b"\n") == 1
    refused(call("study.yml", cwd=folder), USAGE, "study.yml: this is a study: bergtow ensemble study.yml")
    refused(call("resume", "study.yml", cwd=folder), USAGE, "study.yml: this is a study", "bergtow ensemble study.yml")
    refused(call("run", "study.yml", cwd=folder), CASE, "study.yml: is a study", "bergtow ensemble")


@pytest.mark.parametrize("name", ["budget", "capability", "converge", "design", "outlines"])
def test_a_command_of_a_script_calls_itself_by_its_name(folder, name):
    done = call(name, "--help", cwd=folder)
    assert done.returncode == DONE and done.stdout.startswith(f"usage: bergtow {name} ".encode()), done.stdout
    more = ["-o", "x.geojson"] if name == "outlines" else []
    assert call(name, "none.yml", *more, cwd=folder).stderr.startswith(f"bergtow {name}: none.yml: ".encode())


USAGES = {
    "no arguments": ([], "Usage: bergtow"),
    "unknown command": (["rum", "good.yml"], "rum: unknown command; did you mean run?"),
    "unlike any command": (["banana"], "banana: unknown command; see bergtow --help"),
    "a case in place of a command": (["good.yml"], "bergtow: good.yml: this is a case: bergtow run good.yml"),
    "a case in place of a result": (["resume", "good.yml"], "good.yml: this is a case: bergtow run good.yml"),
    "unknown option": (["--verison"], "--verison: unknown option; did you mean --version?"),
    "unknown option of a command": (["run", "good.yml", "--thread-count", "3"], "--thread-count: unknown option"),
    "mistyped option of a command": (["run", "good.yml", "--quite"], "--quite: unknown option; did you mean --quiet?"),
    "unknown letter": (["run", "good.yml", "-z"], "invalid option -- 'z'"),
    "option of another command": (["check", "good.yml", "--steps", "3"], "--steps: unknown option"),
    "no case": (["run"], "no case file given"),
    "two cases": (["run", "good.yml", "good.yml"], "one case at a time"),
    "threads: a word": (["run", "good.yml", "--threads", "two"], "--threads two: give a whole number"),
    "threads: none": (["run", "good.yml", "--threads", "0"], "--threads 0: give a whole number"),
    "threads: negative": (["run", "good.yml", "--threads=-1"], "--threads -1: give a whole number"),
    "threads: too many": (["run", "good.yml", "--threads", "99999999999999999999"], "give a whole number"),
    "steps: a fraction": (["run", "good.yml", "--steps", "1.5"], "--steps 1.5: give a whole number"),
    "option without value": (["run", "good.yml", "-o"], "requires an argument"),
    "empty folder name": (["run", "good.yml", "-o", ""], "name of the folder is empty"),
    "dump without file": (["run", "good.yml", "--dump-contacts", "3"], "--dump-contacts 3: give STEP:FILE.h5"),
    "dump of step 0": (["run", "good.yml", "--dump-contacts", "0:a.h5"], "give a whole number"),
    "dump after the end": (["run", "good.yml", "--dump-contacts", "11:a.h5"], "step 11 is not computed: the last"),
    "dump after the last step": (["run", "good.yml", "--steps", "3", "--dump-contacts", "4:a.h5"],
                                 "step 4 is not computed: the last one is 3"),
    "dump of no step": (["run", "good.yml", "--dump-contacts", "x:a.h5"], "give a whole number"),
    "field without output": (["field", "good.yml"], "no output file given"),
    "field of another format": (["field", "good.yml", "-o", "ice.shp"], "-o ice.shp: the name must end in .h5"),
}


@pytest.mark.parametrize("kind", USAGES)
def test_command_line(folder, kind):
    arguments, fragment = USAGES[kind]
    refused(call(*arguments, cwd=folder), USAGE, fragment)
    assert not (folder / "out").exists()


SETS = {
    "unknown key": ("tow.sped=1", "--set tow.sped=1: unknown key; did you mean tow.speed?"),
    "no value": ("tow.speed", "--set tow.speed: is not key=value"),
    "empty value": ("tow.speed=", "--set tow.speed=: has no value"),
    "a section": ("tow=1", "--set tow=1: tow is a section"),
    "junk": ("ice.friction=0.3x", '--set ice.friction=0.3x: "x"'),
    "out of range": ("ice.concentration=1.2", "--set ice.concentration=1.2: 1.2 is out of range"),
    "against another key": ("run.dt=2", "--set run.dt=2: 2 s is more than run.duration"),
    "list": ("floes=[]", "--set floes=[]: the list of floes cannot be set"),
}


@pytest.mark.parametrize("kind", SETS)
def test_set(folder, kind):
    override, fragment = SETS[kind]
    refused(call("check", "good.yml", "--set", override, cwd=folder), CASE, fragment)


def test_a_pipe_feeds_one_rank(folder):
    words = [*launcher(2), BERGTOW, "run", "/dev/stdin", "--quiet"]
    result = subprocess.run(words, cwd=folder, input=GOOD.encode(), capture_output=True, timeout=60,
                            env=environment())
    refused(result, USAGE, "/dev/stdin: is not a regular file, but each of the 2 ranks must read it")


# ---- what must work ----

def test_the_mark_of_a_spreadsheet(folder):
    """A mark of the byte order before the first letter, and the ends of lines that go with it."""
    (folder / "marked.csv").write_text("t,u,v\r\n0,0.1,0\r\n9,0.2,0\r\n", encoding="utf-8-sig")
    (folder / "marked.yml").write_text(GOOD + "water: {current_table: marked.csv}\n", encoding="utf-8-sig")
    assert call("check", "marked.yml", cwd=folder).returncode == DONE


def test_numbers_at_their_ends(folder):
    """A spread so small that its square is none; numbers of 0 in all spellings."""
    for word in ("ice.size_spread=1e-300", "ice.size_spread=0", "ice.size_spread=0.0e5", "ice.size_spread=-0"):
        assert call("field", "good.yml", "-o", "field.h5", "--force", "--set", word, cwd=folder).returncode == DONE


def test_a_step_without_contacts_is_no_failure(folder):
    result = call("run", "good.yml", "--set", "ice.concentration=0", "--dump-contacts", "3:a.h5", "--quiet", cwd=folder)
    assert result.returncode == DONE and b"step 3 has no contacts; no file is written" in result.stderr
    assert not (folder / "a.h5").exists()



@pytest.mark.parametrize("arguments, fragment", [(["--help"], b"Usage: bergtow"), (["help"], b"Usage: bergtow"),
                                                 (["help", "resume"], b"Usage: bergtow resume"),
                                                 (["--version"], b"bergtow "),
                                                 (["--list-keys"], b"ice.concentration"),
                                                 (["run", "--help"], b"--dump-contacts"),
                                                 (["check", "--help"], b"--set"), (["field", "--help"], b"--output")])
def test_help(folder, arguments, fragment):
    result = call(*arguments, cwd=folder)
    assert result.returncode == DONE and fragment in result.stdout and not result.stderr
