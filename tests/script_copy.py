# SPDX-License-Identifier: MIT
"""Commands of the Python package, and scripts, in copies of a process that has loaded their libraries: half of what
most calls cost is the start of Python, HDF5, matplotlib and scipy. What the process of the tests holds is not in the
copies."""
import functools
import gc
import importlib
import multiprocessing
import multiprocessing.forkserver
import os
import runpy
import subprocess
import sys
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
for library in "h5py", "jinja2", "matplotlib.figure", "scipy.stats", "yaml":
    importlib.import_module(library)
if multiprocessing.current_process().name == "MainProcess":
    gc.freeze()  # else each copy would touch, and so copy, all of its memory


@functools.cache
def copies():
    """Starts the process that is copied; it imports this file, and with it the libraries."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([__name__])
    before = os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = HERE
    try:
        multiprocessing.forkserver.ensure_running()
    finally:
        os.environ.pop("PYTHONPATH")
        if before is not None:
            os.environ["PYTHONPATH"] = before
    return context


def undrawn(name, title, draw):
    """In place of bergtow.reporting.run.picture."""
    return {"kind": "figure", "name": name, "title": title, "why": "the test looks at no picture"}


def run(words, cwd, env, out, err, drawn):
    """In the copy: what Python does with a script."""
    for path, number in (out, 1), (err, 2):
        os.dup2(os.open(path, os.O_WRONLY), number)
    os.chdir(cwd)
    os.environ.clear()
    os.environ.update(env)
    others = [p for p in sys.path if p and not p.startswith(os.path.dirname(HERE))]
    if words[0].endswith(".py"):
        sys.argv, sys.path = words, [os.path.dirname(words[0]), *others]
        runpy.run_path(words[0], run_name="__main__")
    else:
        sys.argv, sys.path = ["bergtow", *words], [os.path.join(os.path.dirname(HERE), "postproc"), *others]
        if not drawn:
            importlib.import_module("bergtow.reporting.run").picture = undrawn
        runpy.run_module("bergtow", run_name="__main__", alter_sys=True)


def called(words, cwd, env, timeout, drawn):
    with tempfile.NamedTemporaryFile() as out, tempfile.NamedTemporaryFile() as err:
        p = copies().Process(target=run, args=(words, str(cwd or os.getcwd()), env, out.name, err.name, drawn))
        p.start()
        p.join(timeout)
        if p.exitcode is None:
            p.kill()
            raise subprocess.TimeoutExpired(words, timeout)
        return subprocess.CompletedProcess(words, p.exitcode, out.read().decode(), err.read().decode())
