# SPDX-License-Identifier: MIT
"""Several ranks leave what one leaves: the same values in every file, one console, one exit code, and no hang."""
import os
import re
import signal
import subprocess
import time

import h5py
import numpy as np
import pytest

from harness import (BERGTOW, CASE, DONE, IO, RANK, SIGNAL, TOW, USAGE, Run, call, changed, differing, environment,
                     launcher, machine_keys, quick, rank_of, run, write_case)
from resuming import children

# More frames than a chunk of the series, more floes than a rank's share, a body and walls; hand-made floes have the ids
# after the others.
SHORT = changed(TOW,
                run__duration=12,
                output__frame_interval=0.5,
                floes=[{"shape": "disc", "length": 0.8, "x": 13, "y": 3.4},
                       {"shape": "rectangle", "length": 0.9, "width": 0.5, "x": 14, "y": -3.5, "fixed": True}])
# Some seconds long, with all but free steps, so that there is a middle of the run to strike at.
LONG = changed(TOW, run__dt=0.0002, output__frame_interval=0.1)


def described(dataset):
    """Its attributes, without those that hold references into the file (its axes)."""
    references = "DIMENSION_LIST", "REFERENCE_LIST"
    return {k: np.asarray(v).tolist() for k, v in dataset.attrs.items() if k not in references}


def command(ranks, *arguments):
    return [*launcher(ranks), *map(str, arguments)]


def mpirun(ranks, *arguments, program=(BERGTOW,), options=(), timeout=60, env=None, **more):
    done = subprocess.run([*launcher(ranks, *options), *program, *map(str, arguments)],
                          env=env or environment(OMP_NUM_THREADS=1), capture_output=True, text=True, timeout=timeout,
                          **more)
    # prterun of Open MPI 5 puts null bytes into what it hands on when a program calls MPI_Abort
    done.stdout, done.stderr = done.stdout.replace("\0", ""), done.stderr.replace("\0", "")
    return done


def colon(words):
    """The words of mpirun for one more rank, with a command line of its own."""
    return [":", "-n", 1, BERGTOW, *words]


def ours(result):
    """What bergtow itself has written on stderr."""
    return [line for line in result.stderr.splitlines() if line.startswith("bergtow")]


@pytest.fixture(scope="module")
def one(tmp_path_factory):
    folder = tmp_path_factory.mktemp("one")
    return folder, run(folder, SHORT, "--threads", 1)


@pytest.mark.parametrize("differs", ["case.yml", "current.csv", "study.yml", "base of the study"])
def test_ranks_that_read_different_files_are_refused(tmp_path, differs):
    """Rank 1 works in a folder with other files of the same names."""
    for folder in (tmp_path, tmp_path / "alt"):
        other = differs if folder.name == "alt" else ""
        friction = 0.1 if other in ("case.yml", "base of the study") else 0.3
        write_case(folder, changed(SHORT, ice__friction=friction, water__current_table="/proc/self/cwd/current.csv"))
        (folder / "current.csv").write_text(f"t,u,v\n0,0,0\n100,{0.2 if other == 'current.csv' else 0.1},0\n")
        (folder / "study.yml").write_text(f"{{base: case.yml, repeats: {3 if other == 'study.yml' else 2}}}")
    words = ("ensemble", "study.yml") if "study" in differs else ("run", "case.yml")
    rank = ("sh", "-c", f'[ "{RANK}" != 1 ] || cd alt; exec "$0" "$@"', BERGTOW)
    result = mpirun(3, *words, "-o", tmp_path / "out", program=rank, cwd=tmp_path)
    assert result.returncode == CASE and len(ours(result)) == 1 and "ranks" in ours(result)[0], result.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("other", [
    ["run", "case.yml", "-o", "out", "-t", 1, "--steps", 20],
    ["run", "case.yml", "-o", "other", "-t", 1, "--steps", 10],
    ["resume", "out"],
    ["check", "case.yml"],
    ["run", "case.yml", "-o", "out", "-t", 1, "--steps", "ten"],
    ["run", "case.yml", "-o", "out", "-t", 1, "--steps", 10, "--dump-contacts", "5:contacts.h5"],
])  # yapf: disable
def test_ranks_with_different_commands_are_refused(tmp_path, other):
    write_case(tmp_path, SHORT)
    result = mpirun(1, "run", "case.yml", "-o", "out", "-t", 1, "--steps", 10, *colon(other), cwd=tmp_path, timeout=20)
    assert result.returncode == CASE and len(ours(result)) == 1 and "ranks" in ours(result)[0], result.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("threads", [["-t2"], ["-t", 2], ["--threads", 2], ["--threads=2"], ["--thr", 2], []])
def test_ranks_may_have_different_threads(tmp_path, threads):
    words = ["run", write_case(tmp_path, SHORT), "-o", "out", "--steps", 3]
    result = mpirun(1, *words, "--threads", 1, *colon([*words, *threads]), cwd=tmp_path)
    assert result.returncode == DONE and ours(result) == [], result.stderr


@pytest.mark.parametrize("ranks", quick([1, 2, 3, 4], 3))
def test_values_do_not_depend_on_ranks(one, ranks):
    folder, alone = one
    result = mpirun(ranks, "run", "case.yml", "-o", f"out{ranks}", "--threads", 1, cwd=folder)
    assert result.returncode == DONE, result.stderr
    many = Run(folder / f"out{ranks}", result)
    assert differing(alone.dir / "result.h5", many.dir / "result.h5") == []
    assert len(many.dataset("/frames/time")) == 25 and many.dataset("/frames/pose").shape[1] == alone.summary["n_floes"]
    assert many.summary.keys() == alone.summary.keys() and "exchange" in many.summary["phases_s"]
    for key in many.summary.keys() - machine_keys():
        assert many.summary[key] == alone.summary[key], key
    assert many.summary["ranks"] == ranks
    for name in "case.resolved.yml", "frames.xdmf":
        assert (many.dir / name).read_text() == (alone.dir / name).read_text(), name
    assert sorted(p.name for p in many.dir.iterdir()) == sorted(p.name for p in alone.dir.iterdir())
    with h5py.File(alone.dir / "result.h5") as a, h5py.File(many.dir / "result.h5") as b:
        assert b.attrs["ranks"] == ranks and b.attrs["complete"] == 1
        for name in "pose", "contact_force", "net_force", "velocity", "speed", "body_pose", "time":
            assert described(a["frames"][name]) == described(b["frames"][name])
    # The table once, and the same but for times.
    assert result.stdout.count("state hash") == 1 and result.stdout.count("mean floe size") == 1
    numbers = [[line
                for line in r.stdout.splitlines()
                if "wall time" not in line and "detect" not in line]
               for r in (alone.result, result)]
    assert numbers[0] == numbers[1]
    assert ours(result) == []


def test_more_ranks_than_floes(tmp_path):
    case = {
        "run": {"dt": 0.1, "duration": 1}, "ice": {"concentration": 0}, "body": {"x": 3, "length": 2},
        "tow": {"speed": 0.1}, "floes": [{"shape": "disc", "length": 0.8, "x": 8, "y": 1}]
    }
    for name, changes in {"one floe": {}, "none": {"floes": None}, "no body": {"body": {"shape": "none"},
                                                                               "tow": None}}.items():
        folder = tmp_path / name
        alone = run(folder, changed(case, **changes))
        result = mpirun(3, "run", "case.yml", "-o", "many", cwd=folder)
        assert result.returncode == DONE, (name, result.stderr)
        assert differing(alone.dir / "result.h5", folder / "many/result.h5") == [], name


def test_rows_that_span_several_pieces(tmp_path):
    """Of more than 1 MB, so that the blocks of the ranks and the pieces of the file do not match."""
    n = 47000
    x, y = np.meshgrid(np.arange(235), np.arange(200))
    with h5py.File(tmp_path / "field.h5", "w") as f:
        f["floes/offsets"] = np.arange(n + 1) * 3
        f["floes/vertices"] = np.tile([[-0.2, -0.1], [0.2, -0.1], [0, 0.2]], (n, 1))
        f["floes/pose"] = np.column_stack([x.ravel() + 3, y.ravel() - 99.5, np.arange(n) % 7])
        f["floes/thickness"] = 0.1 + np.arange(n) * 1e-6
        f["floes"].attrs["ice_area"] = 48000.0
        f["floes"].attrs["concentration"] = 0.06
    case = {
        "run": {"dt": 0.1, "duration": 0.2}, "domain": {"length": 240, "width": 202,
                                                        "y0": -101}, "body": {"shape": "none"},
        "ice": {"field": "field.h5"}, "water": {"current_x": 0.1}, "output": {"frame_interval": 0.1}
    }
    alone = run(tmp_path, case)
    with h5py.File(alone.dir / "result.h5") as f:
        assert f["frames/pose"].chunks[1] < n and f["xdmf/000001/floe_points"].chunks[0] < 3 * n
        np.testing.assert_allclose(f["frames/pose"][0, :, 0], x.ravel() + 3)
        np.testing.assert_allclose(f["floes/thickness"][:], 0.1 + np.arange(n) * 1e-6)
    result = mpirun(3, "run", "case.yml", "-o", "many", cwd=tmp_path)
    assert result.returncode == DONE, result.stderr
    assert differing(alone.dir / "result.h5", tmp_path / "many/result.h5") == []


# ---- one message, one code ----

@pytest.mark.parametrize("arguments, code, fragment", [
    (["run", "--tread", 3], USAGE, "--tread: unknown option"),
    (["run"], USAGE, "no case file given"),
    (["rum"], USAGE, "did you mean run?"),
    (["check", "--treads"], USAGE, "--treads: unknown option"),
    (["run", "case.yml", "--set", "ice.concentration=3"], CASE, "3 is out of range"),
    (["check", "case.yml", "--set", "ice.concentration=3"], CASE, "3 is out of range"),
    (["run", "case.yml", "--set", "ice.field=/nowhere.h5"], IO, "/nowhere.h5"),
    (["run", "case.yml", "-o", "/proc/nowhere/out"], IO, "/proc/nowhere/out: cannot make the folder"),
    (["run", "case.yml", "-o", "taken"], IO, "holds a result"),
], ids=lambda v: "_".join(map(str, v)).replace("/", "") if isinstance(v, list) else "")
def test_an_error_is_reported_once_and_all_leave_with_its_code(tmp_path, arguments, code, fragment):
    write_case(tmp_path, SHORT)
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken/summary.json").write_text('{\n  "title": "a result"}')
    result = mpirun(3, *arguments, cwd=tmp_path)
    assert result.returncode == code, result.stderr
    assert len(ours(result)) == 1 and fragment in ours(result)[0], result.stderr


@pytest.mark.parametrize("arguments", [["--version"], ["--help"], ["run", "--help"], ["--list-keys"],
                                       ["check", "case.yml"], ["field", "case.yml", "-o", "f.h5"]])
def test_what_needs_one_rank_is_done_by_one(tmp_path, arguments):
    write_case(tmp_path, SHORT)
    alone, result = call(*arguments, cwd=tmp_path), mpirun(2, *arguments, cwd=tmp_path)
    assert result.returncode == alone.returncode == DONE, result.stderr
    said, wanted = (re.sub(r"^(memory|disk) .*", r"\1", r.stdout.split(" made in ")[0], flags=re.M)
                    for r in (result, alone))
    assert said == wanted != ""  # memory and disk are those of the ranks


@pytest.mark.parametrize("rank", [0, 1])
def test_a_disk_that_fills_up_in_the_run(tmp_path, rank):
    """For one rank only: the others must hear of it. Without shared memory, whose files would be too large too."""
    write_case(tmp_path, changed(SHORT, output__frame_interval=0.1))
    limited = f'[ "{RANK}" != {rank} ] || ulimit -f 1600; exec "$@"'
    result = mpirun(3, "run", "case.yml", "-o", "out", program=("bash", "-c", limited, "bash", BERGTOW),
                    options=("--mca", "btl", "self,tcp", "--mca", "btl_tcp_if_include", "lo"), cwd=tmp_path)
    assert result.returncode == IO, result.stderr
    assert len(ours(result)) == 1 and "out/result.part.h5: cannot write the file: File too large; raise" in ours(
        result)[0], result.stderr
    assert not (tmp_path / "out/summary.json").exists()
    with h5py.File(tmp_path / "out/result.part.h5") as f: # as the last flush left it
        n = len(f["frames/time"])
        assert f.attrs["complete"] == 0 and 10 < n < 121 and f["frames/pose"].shape[0] == n
        assert np.all(f["frames/pose"][n - 1, :, 0] != 0) and len(f["series/time"]) >= n - 1
        assert sum(name.isdigit() for name in f["xdmf"]) == n


# ---- signals ----

def lives(process):
    try:
        with open(f"/proc/{process}/stat") as s:
            return s.read().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def wait_for(condition, seconds=10):
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.02)
    return condition()


@pytest.fixture
def start(tmp_path):
    """Start LONG on three ranks; returns mpirun and the processes of the ranks once the run has written some frames."""
    running = []

    def begin():
        write_case(tmp_path, LONG)
        p = subprocess.Popen(command(3, BERGTOW, "run", "case.yml", "-o", "out", "--threads", 1), cwd=tmp_path,
                             env=environment(OMP_NUM_THREADS=1), stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                             text=True)
        running.append(p)

        def has_frames():
            try:
                with h5py.File(tmp_path / "out/result.part.h5") as f:
                    return len(f["frames/time"]) > 2
            except (OSError, KeyError):
                return False

        assert wait_for(has_frames, 120)
        ranks = {}
        for name in children(p.pid):
            try:
                with open(f"/proc/{name}/environ") as e:
                    variables = dict(v.split("=", 1) for v in e.read().split("\0") if "=" in v)
            except (OSError, ValueError):
                continue
            if rank_of(variables) is not None:
                ranks[rank_of(variables)] = name
        assert sorted(ranks) == [0, 1, 2]
        return p, ranks

    yield begin
    for p in running:
        p.kill()
        p.communicate()


def assert_stopped_well(folder, number):
    r = Run(folder / "out", None)
    n = r.summary["n_steps"]
    assert f"signal {int(number)} after step {n}" == r.summary["stopped"] and 0 < n < 150000
    with h5py.File(r.dir / "result.h5") as f:
        assert f.attrs["complete"] == 1 and {len(v) for v in f["series"].values()} == {n}


@pytest.mark.parametrize("number, rank", [(signal.SIGTERM, 0), (signal.SIGTERM, 2), (signal.SIGINT, 1)])
def test_a_signal_to_one_rank_stops_all_after_the_same_step(tmp_path, start, number, rank):
    p, ranks = start()
    os.kill(ranks[rank], number)
    out, err = p.communicate(timeout=120)
    assert p.returncode == SIGNAL, err
    assert_stopped_well(tmp_path, number)
    assert err.count("bergtow: stopped by signal") == 1 and out.count("state hash") == 1


def test_mpirun_hands_on_sigusr1_and_sigusr2(tmp_path, start):
    """The first: a checkpoint, and a result that can be read, while the run goes on. The second: a stop."""
    p, _ = start()
    p.send_signal(signal.SIGUSR1)
    assert wait_for((tmp_path / "out/checkpoint.h5").exists, 120)
    with h5py.File(tmp_path / "out/result.h5") as f:
        assert f.attrs["complete"] == 0 and len(f["frames/time"]) > 2
    assert p.poll() is None
    p.send_signal(signal.SIGUSR2)
    _, err = p.communicate(timeout=120)
    assert p.returncode == SIGNAL, err
    assert_stopped_well(tmp_path, signal.SIGUSR2)


def test_sigterm_to_mpirun(tmp_path, start):
    """mpirun gives the ranks a second, which is enough here, and has an exit code of its own."""
    p, _ = start()
    p.send_signal(signal.SIGTERM)
    p.communicate(timeout=120)
    assert p.returncode not in (DONE, None)
    assert_stopped_well(tmp_path, signal.SIGTERM)


@pytest.mark.parametrize("rank", [pytest.param(0, marks=pytest.mark.slow), 2])
def test_a_killed_rank_ends_the_run(tmp_path, start, rank):
    p, ranks = start()
    os.kill(ranks[rank], signal.SIGKILL)
    _, err = p.communicate(timeout=120)
    assert p.returncode not in (DONE, None)
    assert f"rank {rank}" in err and "signal 9 (Killed)" in err
    assert wait_for(lambda: not any(map(lives, ranks.values())))
    assert not (tmp_path / "out/summary.json").exists()
    with h5py.File(tmp_path / "out/result.part.h5") as f: # what was flushed can be read
        n = len(f["frames/time"])
        assert f.attrs["complete"] == 0 and n > 2 and len(f["frames/pose"]) == n and len(
            {len(v)
             for v in f["series"].values()}) == 1
