# SPDX-License-Identifier: MIT
"""Ensembles on the workers of Dask: the same ensemble.h5, whatever becomes of the workers."""
import json
import os
import signal
import subprocess
import sys
import threading
import time

import pytest
from harness import BERGTOW, ROOT, TOW, call, changed, differing, environment, heard, write_case

import bergtow  # noqa: E402

import distributed  # noqa: E402


def study(folder, duration=3):
    write_case(folder, changed(TOW, run__duration=duration, output={"checkpoint_steps": 20}), "base.yml")
    said = {"base": "base.yml", "repeats": 3, "parameters": {"tow.speed": [0.1, 0.15]}}
    (folder / "study.yml").write_text(json.dumps(said))
    return folder / "study.yml"


@pytest.fixture
def client(monkeypatch):
    monkeypatch.setenv("BERGTOW", str(BERGTOW))
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster, \
            distributed.Client(cluster) as c:
        yield c


@pytest.mark.slow
def test_workers_make_the_same_file(client, tmp_path, capfd):
    path = study(tmp_path)
    assert call("ensemble", path, "-o", tmp_path / "alone", "--set", "ice.friction=0.1").returncode == 0
    e = bergtow.Ensemble.run(path, tmp_path / "dask", client=client, tasks=3, overrides={"ice.friction": 0.1})
    assert differing(tmp_path / "alone/ensemble.h5", tmp_path / "dask/ensemble.h5") == []
    assert e.counts["finished"] == 6 and "6 members finished" in capfd.readouterr().out
    assert [p.name for p in tmp_path.iterdir() if p.name.startswith(".")] == []
    begun = os.stat(tmp_path / "dask/members/c001-r001/result.h5").st_mtime_ns
    bergtow.Ensemble.run(path, tmp_path / "dask", client=client, overrides={"ice.friction": 0.1}, progress=False)
    assert os.stat(tmp_path / "dask/members/c001-r001/result.h5").st_mtime_ns == begun


def calls_at_work(out):
    """Process ids of the calls of the program on a folder."""
    found = []
    for p in os.listdir("/proc"):
        try:
            words = open(f"/proc/{p}/cmdline").read().split("\0") if p.isdigit() else []
        except OSError:
            continue
        if "ensemble" in words and str(out) in words:
            found.append(int(p))
    return found


def until(what, seconds=60):
    end = time.monotonic() + seconds
    while not (found := what()):
        assert time.monotonic() < end
        time.sleep(0.02)
    return found


@pytest.mark.slow
def test_a_worker_that_dies_costs_nothing(client, tmp_path):
    """The worker and its call of the program are killed in the middle of a member; another goes on with it."""
    path, out = study(tmp_path, 20), tmp_path / "out"
    assert call("ensemble", path, "-o", tmp_path / "alone").returncode == 0
    killed = []

    def kill():
        until(lambda: list(out.glob("members/*/checkpoint.h5")))
        for pid in calls_at_work(out)[:1]:
            parent = int(open(f"/proc/{pid}/stat").read().rsplit(")", 1)[1].split()[1])
            os.kill(pid, signal.SIGKILL)
            os.kill(parent, signal.SIGKILL)
            killed.append(pid)

    thread = threading.Thread(target=kill)
    thread.start()
    e = bergtow.Ensemble.run(path, out, client=client, tasks=2, progress=False)
    thread.join()
    assert killed and e.counts["finished"] == 6
    assert differing(tmp_path / "alone/ensemble.h5", out / "ensemble.h5") == []


@pytest.mark.slow
def test_ctrl_c_reaches_the_workers(tmp_path):
    path, out = study(tmp_path, 50), tmp_path / "out"
    script = f"""
import sys; sys.path.insert(0, {str(ROOT / 'postproc')!r})
import bergtow, distributed
if __name__ == "__main__":
    with distributed.LocalCluster(1, 2, processes=False, dashboard_address=None) as cluster:
        with distributed.Client(cluster) as client:
            bergtow.Ensemble.run({str(path)!r}, {str(out)!r}, client=client, progress=False)
"""
    p = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                         env=environment(BERGTOW=str(BERGTOW)), preexec_fn=heard)
    until(lambda: len(list(out.glob("members/*/result.part.h5"))) == 2)
    p.send_signal(signal.SIGINT)
    _, err = p.communicate(timeout=60)
    assert "KeyboardInterrupt" in err and calls_at_work(out) == []
    assert len(list(out.glob("members/*/checkpoint.h5"))) == 2
    assert call("ensemble", path, "-o", out, "--quiet").returncode == 0  # and goes on


def test_what_is_wrong_is_said(client, tmp_path, monkeypatch):
    path = study(tmp_path)
    (tmp_path / "bad.yml").write_text(json.dumps({"base": "base.yml", "repeats": 1, "parameters": {"tow.sped": [1]}}))
    with pytest.raises(bergtow.BergtowError, match="tow.sped: unknown key"):
        bergtow.Ensemble.run(tmp_path / "bad.yml", tmp_path / "bad", client=client)
    monkeypatch.setattr(bergtow.study.ensemble, "program_path", lambda: "/nowhere/bergtow")
    with pytest.raises(bergtow.BergtowError, match="no worker of the Dask client could run /nowhere/bergtow"):
        bergtow.Ensemble.run(path, tmp_path / "out", client=client)
    client.retire_workers()
    until(lambda: not client.nthreads())
    with pytest.raises(bergtow.BergtowError, match="has no workers"):
        bergtow.Ensemble.run(path, tmp_path / "out", client=client)
    assert not (tmp_path / "out").exists()
