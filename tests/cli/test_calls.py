# SPDX-License-Identifier: MIT
"""Commands that are scripts: what stops them stops the runs that they have started, and exit codes of the program."""
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from harness import BERGTOW, TOW, call, changed, environment, heard, quick, write_case

from bergtow import _calls
from bergtow._calls import called
from bergtow._interrupts import held
from bergtow.study import runs as case_runs

LONG = changed(TOW, run__dt=0.005, run__duration=60, output__window_start=15, domain__length=22, ice__concentration=0.5,
               estimate__length_scale=20)
STUDY = {"base": "case.yml", "repeats": 2, "sampling": "latin-hypercube", "samples": 8, "seed": 3,
         "parameters": {"ice.concentration": {"from": 0.4, "to": 0.5, "distribution": "uniform", "source": "a test"}}}
WORDS = {"design": ["case.yml", "--concentrations", 0.5, "--fields", 2, "--no-pdf", "--no-replay", "--keep-width"],
         "budget": ["study.yml"], "converge": ["case.yml", "--vary", "dt"],
         "capability": ["thrust.yml", "--from", 0.3, "--to", 0.5]}


def files(folder):
    write_case(folder, LONG)
    write_case(folder, STUDY, "study.yml")
    vessel = {"mass": 2000, "bollard_pull": 100, "free_speed": 0.5}
    write_case(folder, changed(LONG, tow={"mode": "thrust", "speed": 0.13, "line_length": 3, "line_stiffness": 2000,
                                          "line_damping": 100, "vessel": vessel}, body__x=6), "thrust.yml")


def at_work(folder):
    """Folders of the runs that hold their lock."""
    return [p.parent for p in folder.glob("out/**/run.lock")]


def until(true, what):
    end = time.monotonic() + 60
    while not true():
        assert time.monotonic() < end, what
        time.sleep(0.02)


def to_all(p):
    """As the terminal sends Ctrl-C."""
    os.killpg(p.pid, signal.SIGINT)


def to_it(number):
    return lambda p: p.send_signal(number)


WAYS = [("design", to_all), ("design", to_it(signal.SIGTERM)), ("budget", to_all), ("budget", to_it(signal.SIGTERM)),
        ("converge", to_all), ("converge", to_it(signal.SIGTERM)), ("converge", to_it(signal.SIGHUP)),
        ("capability", to_it(signal.SIGTERM))]


@pytest.mark.parametrize("command, stop", quick(WAYS, WAYS[0], WAYS[3], WAYS[5], WAYS[6]))
def test_a_stop_ends_the_runs_with_checkpoints(tmp_path, command, stop):
    """Red when they are killed, or go on without the command."""
    files(tmp_path)
    words = [BERGTOW, command, *map(str, WORDS[command]), "-o", "out", "--budget", "5", "--jobs", "2"]
    p = subprocess.Popen(words, cwd=tmp_path, env=environment(OMP_NUM_THREADS=1), stderr=subprocess.PIPE, text=True,
                         stdout=subprocess.DEVNULL, preexec_fn=heard, start_new_session=True)
    until(lambda: sum(bool(list(run.glob("result.part.h5"))) for run in at_work(tmp_path)) == 2, "two runs")
    runs = at_work(tmp_path)
    stop(p)
    _, said = p.communicate(timeout=60)
    assert p.returncode == 6 and said.endswith(f"bergtow {command}: stopped\n") and "raise --budget" not in said, said
    assert not at_work(tmp_path) and all((run / "checkpoint.h5").exists() for run in runs)


def test_nohup_holds(tmp_path):
    """What ignores SIGHUP goes on to do so."""
    write_case(tmp_path, changed(LONG, run__dt=0.05, run__duration=20, output__window_start=5))
    words = ["converge", "case.yml", "-o", "out", "--vary", "window", "--jobs", "2", "--margin", "50"]
    p = subprocess.Popen(["nohup", BERGTOW, *words], cwd=tmp_path, env=environment(OMP_NUM_THREADS=1), text=True,
                         stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, stdin=subprocess.DEVNULL)
    until(lambda: at_work(tmp_path), "a run")
    p.send_signal(signal.SIGHUP)
    _, said = p.communicate(timeout=60)
    assert p.returncode == 0 and (tmp_path / "out/converge.json").exists(), said


def test_a_stop_of_a_run_alone_is_one_of_the_call():
    """The budget is another matter: by it a run is stopped that may go on."""
    assert case_runs.stopped_by_limit(6, 3.01, 3.0)
    for code, took in ((0, 1.0), (0, 4.0), (5, 1.0), (5, 4.0)):
        assert not case_runs.stopped_by_limit(code, took, 3.0)
    for limit in (3.0, math.inf):
        with pytest.raises(KeyboardInterrupt):
            case_runs.stopped_by_limit(6, 2.9, limit)


def test_a_call_gives_its_code_its_messages_and_its_lines():
    code, said = called(["sh", "-c", "echo a; echo b >&2; exit 3"], (lines := []).append)
    assert (code, said, lines) == (3, "b\n", ["a\n"])


def test_a_message_has_its_code_beside_its_text(tmp_path):
    """With BERGTOW_MESSAGES=json; what is none of the program's own is an error, too."""
    write_case(tmp_path, changed(LONG, run__dt=0.05, run__duration=1, output__window_start=0.5))
    (tmp_path / "study.yml").write_text("base: case.yml\nrepeats: 1\nseed: 1\n")
    words = BERGTOW, "ensemble", "study.yml", "-o", "out", "--quiet"
    said = [subprocess.run([*words, *more], cwd=tmp_path, env=environment(OMP_NUM_THREADS=1, **case_runs.MESSAGES),
                           capture_output=True, text=True).stderr for more in ([], ["--set", "tow.speed=0.3 m/s"])]
    (tmp_path / "out/members/c001-r001/summary.json").write_text("{}")
    said.append(call(*words[1:], cwd=tmp_path, env=environment(OMP_NUM_THREADS=1, **case_runs.MESSAGES)).stderr)
    assert said[0] == ""
    (other,), (damaged,) = (case_runs.messages(text) for text in said[1:])
    assert (other.code, other.warning) == ("other_study", False) and str(other).endswith("base case [other_study]")
    assert damaged.warning and not damaged.code and str(damaged).startswith("warning: member c001-r001 is not sound")
    for line in ("MPI: no", '{"jobid": 3}', "{", "5"):
        assert case_runs.messages(f"{line}\n\n") == [case_runs.Message(line, None, False)]


def test_ctrl_c_while_python_loads(tmp_path):
    """Red with a traceback: it comes before the package is there, and the command answers it."""
    (tmp_path / "sitecustomize.py").write_text("import os\nos.kill(os.getpid(), 2)\n")
    p = call("report", "nothing", env=environment(PYTHONPATH=tmp_path), preexec_fn=heard)
    assert (p.returncode, p.stderr) == (6, "bergtow report: stopped\n")


#: a stop where Python executes a text, as in the making of a dataclass, and in a callback of h5py, whose exception is
#: SystemError
WITHIN = {"text": 'exec("os.kill(os.getpid(), 15)")',
          "h5py": 'h5py.h5a.iterate(file.id, lambda _: os.kill(os.getpid(), 15))'}


@pytest.mark.parametrize("within", WITHIN)
def test_a_stop_has_its_code_wherever_it_arrives(tmp_path, within):
    """Red at death by SIGINT, and at a traceback with code 1."""
    (tmp_path / "stopped.py").write_text(f"""
import os
import h5py
from bergtow.cli import command
def main():
    with h5py.File("of-memory", "w", driver="core", backing_store=False) as file:
        file.attrs["some"] = 1
        {WITHIN[within]}
command.guarded("bergtow", main)
""")
    package = os.pathsep.join(map(str, (tmp_path, Path(_calls.__file__).parents[1])))
    p = subprocess.run([sys.executable, "-m", "stopped"], env=environment(PYTHONPATH=package), capture_output=True,
                       text=True, preexec_fn=heard)
    assert (p.returncode, p.stderr) == (6, "bergtow: stopped\n")


def test_a_second_stop_leaves_no_run_behind(tmp_path):
    """The program takes its time, and is waited for; it is asked once."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    slow = """
import os, signal, sys, time
asked = []
signal.signal(signal.SIGTERM, lambda *_: asked.append(1))
print("ready", flush=True)
while not asked: time.sleep(0.01)
for _ in range(5):
    os.kill(os.getppid(), signal.SIGINT)
    time.sleep(0.1)
print("x" * 100_000, flush=True)
with open(sys.argv[1], "w") as file: file.write(f"asked {len(asked)} times")
os._exit(0)
"""
    try:
        with pytest.raises(KeyboardInterrupt):
            called([sys.executable, "-c", slow, str(tmp_path / "ended")],
                   lambda text: os.kill(os.getpid(), signal.SIGINT))
        assert (tmp_path / "ended").read_text() == "asked 1 times"
        with pytest.raises(KeyboardInterrupt), held():
            os.kill(os.getpid(), signal.SIGINT)
            there = True
        assert there and signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize("command", WORDS)
def test_a_case_that_is_refused_is_told_in_the_words_of_the_program(tmp_path, command):
    files(tmp_path)
    checks = "ensemble" if command == "budget" else "check"
    file = WORDS[command][0]
    wrong = "--set", "ice.sise=1", "--set", "tow.speed=fast"
    said = call(checks, file, *wrong, cwd=tmp_path)
    done = call(command, *WORDS[command], "-o", "out", *wrong, cwd=tmp_path)
    assert done.returncode == said.returncode == 3 and len(said.stderr.splitlines()) > 1
    theirs = [line for line in said.stderr.splitlines() if not line.startswith("bergtow: warning:")]
    told = [line.replace("bergtow:", f"bergtow {command}:", 1) for line in theirs]
    assert done.stderr.split() == " ".join(told).split()  # lines are broken elsewhere
    assert not (tmp_path / "out").exists()
