# SPDX-License-Identifier: MIT
"""A result gives way only to one that stands, and what the program has not written stays: full disks at each file of
the start and of the end, kills between them, files of the user's under names of the program."""
import os
import shutil
import signal
import subprocess

import pytest

from faults import CALLS, shim
from harness import (BERGTOW, CLOSING, DONE, IO, NUMERIC, TOW, Run, call, changed, environment, faulty, run,
                     write_case)
from resuming import assert_same_result

from bergtow import writing  # noqa: E402

SHORT = changed(TOW, run__duration=3)
OTHER = changed(SHORT, ice__friction=0.1)
STANDING = ("case.resolved.yml", "result.h5", "checkpoint.h5", "summary.json", "frames.xdmf")
FIRST = ("case.resolved.yml.new.tmp", "case.resolved.yml", "result.part.h5")  # what a new run writes first


def contents(folder):
    return {p.relative_to(folder): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    folder = tmp_path_factory.mktemp("both")
    return run(folder, SHORT, name="first"), run(folder, OTHER, name="other")


@pytest.fixture
def old(tmp_path, both):
    shutil.copytree(both[0].dir, tmp_path / "out")
    return tmp_path / "out"


# ---- the old result stays ----

def test_a_result_made_meanwhile_stays(tmp_path):
    """A run stops at its first call in the folder, after its ice is made, until another has finished there."""
    words = [BERGTOW, "run", write_case(tmp_path, OTHER, "late.yml"), "-o", tmp_path / "out", "--quiet"]
    late = subprocess.Popen(words, env=shim(tmp_path, BT_CALLS="mkdir,mkdirat", BT_CALLS_AT=1,
                                            BT_CALLS_SIGNAL=signal.SIGSTOP.value), stderr=subprocess.PIPE, text=True)
    assert os.WIFSTOPPED(os.waitpid(late.pid, os.WUNTRACED)[1])
    first = run(tmp_path, SHORT)
    before = contents(first.dir)
    late.send_signal(signal.SIGCONT)
    assert "holds a result" in late.communicate(timeout=60)[1] and late.returncode == IO
    assert contents(first.dir) == before


def test_pages_of_the_result_before_are_named(tmp_path, old):
    """By a run that replaces it, and by a resume; not those of others, and not where nothing was. Red: the folder holds
    two answers in silence."""
    for name, text in (("report.html", writing.MARK), ("force.png", writing.MARK), ("mine.png", "by hand"),
                       ("input.yml", writing.MARK)):
        (old / name).write_text(f"<!-- {text} -->")
    case = write_case(tmp_path, OTHER)
    result = call("run", case, "-o", old, "--force", "--quiet", "--steps", 5)
    assert result.returncode == DONE and f"{old}: force.png, report.html: of an earlier result" in result.stderr
    again = call("resume", old, "--quiet", "--steps", 5)
    assert "force.png, report.html: of an earlier" in again.stderr
    assert "mine" not in result.stderr and "input" not in result.stderr
    (tmp_path / "new").mkdir()
    (tmp_path / "new/report.html").write_text(writing.MARK)
    assert call("run", case, "-o", tmp_path / "new", "--quiet", "--steps", 5).stderr == ""
    (old / "report.html").unlink()
    (old / "force.png").unlink()
    assert call("resume", old, "--quiet", "--steps", 5).stderr == ""


@pytest.mark.parametrize("name", FIRST)
def test_a_failed_start_changes_nothing(tmp_path, old, name):
    before = contents(old)
    result = call("run", write_case(tmp_path, OTHER), "-o", old, "--force", env=faulty(BT_FAULT=name))
    assert result.returncode == IO and "No space left on device; free some space" in result.stderr
    assert "is finished" in call("resume", old).stdout
    assert contents(old) == before and not (old / "replaced").exists()


@pytest.mark.parametrize("name", STANDING)
def test_a_name_that_cannot_be_moved_aside(tmp_path, old, name):
    """What has been moved before it is back when the call ends."""
    before = contents(old)
    result = call("run", write_case(tmp_path, OTHER), "-o", old, "--force", env=faulty(BT_FAULT=name))
    assert result.returncode == IO and "No space left on device" in result.stderr
    assert contents(old) == before and not (old / "replaced").exists()


@pytest.mark.parametrize("name, before_rename, code", [("case.resolved.yml.new.tmp", 1, IO), ("checkpoint.h5", 7, -9)])
def test_killed_after_a_fault(tmp_path, old, name, before_rename, code):
    """On a disk that is full from the first byte on nothing is moved, so no kill meets a move; on one that refuses a
    name later, the case is the last to come back, and the next call goes on with the rest."""
    before = contents(old)
    env = faulty(BERGTOW_STARTED=1, BT_FAULT=name, BT_CALLS_UNDER=old, BT_CALLS="rename,renameat",
                 BT_CALLS_AT=before_rename, BT_CALLS_SIGNAL=9)
    env["LD_PRELOAD"] += f" {CALLS}"
    result = call("run", write_case(tmp_path, OTHER), "-o", old, "--force", env=env)
    assert result.returncode == code
    assert (old / "replaced").exists() == (code != IO)
    assert "is finished" in call("resume", old).stdout
    assert contents(old) == before and not (old / "replaced").exists()


def test_a_failed_end_keeps_the_old_result_aside(tmp_path, old, both):
    """The first checkpoint fails: the folder is the new run's, and the old result is kept; the third call succeeds."""
    before = contents(old)
    words = ["run", write_case(tmp_path, OTHER), "-o", old, "--force", "--quiet"]
    result = call(*words, env=faulty(BT_FAULT="checkpoint.h5.tmp"))
    assert result.returncode == IO and f"{old}/replaced until a new result is complete" in result.stderr
    kept = contents(old / "replaced")
    assert all(kept[p] == before[p] for p in before) and not (old / "summary.json").exists()
    again = call(*words, env=faulty(BT_FAULT="checkpoint.h5.tmp"))
    assert again.returncode == IO and contents(old / "replaced") == kept
    result = call("resume", old)
    assert result.returncode == DONE and "starts at time zero" in result.stdout, result.stderr
    assert Run(old, result).hash == both[1].hash
    assert not (old / "replaced").exists()


@pytest.mark.parametrize("moved", range(len(STANDING) + 1))
def test_killed_while_the_old_result_is_moved(old, both, moved):
    """Some names in one folder and some in the other, and no case: the next call puts them back."""
    (old / "replaced").mkdir()
    for name in STANDING[:moved]:
        (old / name).rename(old / "replaced" / name)
    (old / "case.resolved.yml").unlink(missing_ok=True)
    if moved == 0:
        shutil.copy(both[0].dir / "case.resolved.yml", old / "replaced")
    assert "is finished" in call("resume", old).stdout
    assert contents(old) == contents(both[0].dir) and not (old / "replaced").exists()


def test_a_new_result_that_stands_is_not_taken_for_the_old_one(tmp_path, old, both):
    """Killed after its checkpoint and before what it replaced was gone: that is the older, whatever is called next."""
    shutil.copytree(both[1].dir, old / "replaced")
    before = contents(both[0].dir)
    result = call("run", write_case(tmp_path, OTHER), "-o", old, "--force", env=faulty(BT_FAULT="checkpoint.h5.tmp"))
    assert result.returncode == IO
    assert contents(old / "replaced") == before


# ---- the end ----

ENDS = ["result.h5", "frames.xdmf.tmp", "checkpoint.h5.tmp", "checkpoint.h5", "summary.json.tmp"]


@pytest.mark.parametrize("name", ENDS)
@pytest.mark.parametrize("stop", [[], ["--max-wall", "1e-9"]])
def test_an_end_that_fails_is_made_again(tmp_path, both, name, stop):
    """Each file of the end in turn cannot be written, at the end of the case and of --max-wall."""
    out = tmp_path / "out"
    result = call("run", write_case(tmp_path, SHORT), "-o", out, "--quiet", *stop, env=faulty(BT_FAULT=name))
    assert result.returncode == IO and name.removesuffix(".tmp") in result.stderr, result.stderr
    assert not (out / "summary.json").exists() and not list(out.glob("checkpoint*.tmp"))
    result = call("resume", out, "--quiet")
    assert result.returncode == DONE and Run(out, result).hash == both[0].hash, result.stderr


def test_without_its_summary_a_run_is_not_finished(tmp_path, both):
    """Killed between its last checkpoint and the summary."""
    shutil.copytree(both[0].dir, tmp_path / "out")
    (tmp_path / "out/summary.json").unlink()
    assert call("resume", tmp_path / "out", "--quiet").returncode == DONE
    assert_same_result(both[0].dir, tmp_path / "out")


def test_signals_before_the_first_instruction_of_main(tmp_path):
    """SIGUSR1 while the libraries are made ready, in both starts of the program, and as it starts itself again."""
    env = faulty(BT_FAULT_SIGNAL=1)
    del env["BERGTOW_STARTED"]
    r = run(tmp_path, SHORT, env=env)
    assert r.summary["n_steps"] == 30


def test_a_failed_run_keeps_its_series(tmp_path):
    """What is made again for failure.h5 leaves result.h5 where no checkpoint was."""
    r = run(tmp_path, changed(CLOSING, run__duration=0.7, guard__overlap=0.02), code=NUMERIC)
    assert (r.dir / "failure.h5").exists() and len(r.series("time")) > 0


# ---- files of the user's ----

FOREIGN = ["failure.h5", "frames.xdmf", "case.resolved.yml", "stop", "summary.json", "checkpoint.h5",
           "result.part.h5", "checkpoint.previous.h5", "result.h5", "checkpoint.damaged.h5"]


@pytest.mark.parametrize("force", [[], ["--force"]])
@pytest.mark.parametrize("name, dear", [(name, b"dear to somebody") for name in FOREIGN] +
                         [(name, b"\x89HDF\r\n\x1a\ndear to somebody") for name in FOREIGN if name.endswith("h5")])
def test_a_file_of_the_users_is_refused_by_name(tmp_path, name, dear, force):
    out = tmp_path / "out"
    out.mkdir()
    (out / name).write_bytes(dear)
    result = call("run", write_case(tmp_path, SHORT), "-o", out, *force)
    assert result.returncode == IO and f"{out / name}: was not written by this program" in result.stderr
    assert contents(out) == {(out / name).relative_to(out): dear}


@pytest.mark.parametrize("damage", [b"", b"\0" * 4096])
def test_a_result_beyond_knowing_is_replaced_beside_its_case(tmp_path, old, damage):
    (old / "result.h5").write_bytes(damage)
    r = run(tmp_path, OTHER, "--force")
    assert r.summary["n_steps"] == 30 and (old / "result.h5").stat().st_size > 4096


def test_an_old_request_to_stop_is_taken_away(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out/stop").touch()
    r = run(tmp_path, SHORT)
    assert not (r.dir / "stop").exists() and r.summary["n_steps"] == 30


def test_nothing_else_is_touched(tmp_path, old):
    (old / "notes.txt").write_text("dear to somebody")
    (old / "field.h5").write_bytes(b"\x89HDF\r\n\x1a\n")
    run(tmp_path, OTHER, "--force")
    assert (old / "notes.txt").read_text() == "dear to somebody" and (old / "field.h5").stat().st_size == 8


@pytest.mark.parametrize("output", ["field.h5", "field.geojson"])
def test_a_field_replaces_fields_alone(tmp_path, output):
    path, to = write_case(tmp_path, SHORT), tmp_path / output
    assert [call("field", path, "-o", to).returncode for _ in range(2)] == [DONE, DONE]
    made = to.read_bytes()
    to.write_text('{"type":"FeatureCollection"}')
    result = call("field", path, "-o", to)
    assert result.returncode == IO and str(to) in result.stderr and "--force" in result.stderr
    assert to.read_text() == '{"type":"FeatureCollection"}'
    assert call("field", path, "-o", to, "--force").returncode == DONE and to.read_bytes() == made


@pytest.mark.parametrize("words", [["field", "a.yml", "-o", "a.yml"], ["field", "a.yml", "-o", "./a.yml", "--force"],
                                   ["run", "a.yml", "--dump-contacts", "5:a.yml"],
                                   ["run", "a.yml", "--force", "--dump-contacts", "5:a.yml"]])
def test_the_case_is_never_replaced(tmp_path, words):
    path = write_case(tmp_path, SHORT, "a.yml")
    before = path.read_bytes()
    result = call(*words, cwd=tmp_path)
    assert result.returncode == IO and "a.yml: is the case file itself" in result.stderr
    assert path.read_bytes() == before and os.listdir(tmp_path) == ["a.yml"]


def test_contacts_replace_nothing_without_force(tmp_path):
    path, to = write_case(tmp_path, SHORT), tmp_path / "c.h5"
    to.write_text("dear to somebody")
    words = ["run", path, "-o", tmp_path / "out", "--quiet", "--dump-contacts", f"20:{to}"]
    result = call(*words)
    assert result.returncode == IO and f"{to}: already exists" in result.stderr
    assert to.read_text() == "dear to somebody" and not (tmp_path / "out").exists()
    assert call(*words, "--force").returncode == DONE and to.read_bytes()[:4] == b"\x89HDF"


def pipe(path):
    os.mkfifo(path)


def link_to_a_device(path):
    path.symlink_to("/dev/null")


WRITTEN = {"field.h5": ["field", "case.yml", "-o", "field.h5"],
           "field.h5.part": ["field", "case.yml", "-o", "field.h5"],
           "field.geojson": ["field", "case.yml", "-o", "field.geojson"],
           "field.geojson.tmp": ["field", "case.yml", "-o", "field.geojson"],
           "c.h5": ["run", "case.yml", "--dump-contacts", "20:c.h5"],
           "c.h5.tmp": ["run", "case.yml", "--dump-contacts", "20:c.h5"],
           "out/case/run.lock": ["run", "case.yml"], "out/case/case.resolved.yml.new.tmp": ["run", "case.yml"],
           "all/ensemble.h5": ["ensemble", "study.yml", "-o", "all"],
           "all/ensemble.h5.tmp": ["ensemble", "study.yml", "-o", "all"],
           "all/study.resolved.yml": ["ensemble", "study.yml", "-o", "all"]}


@pytest.mark.parametrize("kind", [pipe, link_to_a_device])
@pytest.mark.parametrize("name", WRITTEN)
def test_what_is_no_regular_file_is_never_replaced(tmp_path, name, kind):
    """With --force or without, under the name of the output and under those on the way to it. Red: it becomes a file,
    or is gone."""
    write_case(tmp_path, SHORT)
    (tmp_path / "study.yml").write_text('{"base": "case.yml", "parameters": {"tow.speed": [0.1, 0.2]}}')
    path = tmp_path / name
    path.parent.mkdir(parents=True, exist_ok=True)
    kind(path)
    words = WRITTEN[name]
    for force in ([], ["--force"])[:2 if words[0] != "ensemble" else 1]:
        result = call(*words, *force, cwd=tmp_path, timeout=60)
        assert result.returncode == IO and f"{path.name}: " in result.stderr and "regular file" in result.stderr, (
            result.returncode, result.stderr)
        assert os.readlink(path) == "/dev/null" if kind is link_to_a_device else path.is_fifo()


def test_standard_output_is_no_place_for_a_file(tmp_path):
    """A link of the system's, which root could replace."""
    with open(tmp_path / "taken.h5", "wb") as file:
        result = subprocess.run([BERGTOW, "field", write_case(tmp_path, SHORT), "-o", "/dev/stdout", "--force"],
                                stdout=file, stderr=subprocess.PIPE, text=True, env=environment())
    assert result.returncode == IO and "/dev/stdout: is an open descriptor, not a regular file" in result.stderr
    assert os.path.islink("/dev/stdout")


def test_an_empty_file_is_replaced(tmp_path):
    """As mktemp leaves it."""
    (tmp_path / "field.h5").touch()
    assert call("field", write_case(tmp_path, SHORT), "-o", tmp_path / "field.h5").returncode == DONE
    assert (tmp_path / "field.h5").stat().st_size > 0
