# SPDX-License-Identifier: MIT
"""libbergtow as a program outside of the tree meets it: installed, found by pkg-config, stepped, taken away again."""
import json
import os
import pty
import re
import select
import shutil
import signal
import subprocess
import sys
import time

import h5py
import numpy as np
import pytest
from bergtow import cli
from harness import (BERGTOW, DONE, ROOT, TOW, Run, call, changed, differing, environment, make, quick, run,
                     without_make, write_case)

EXAMPLES = ROOT / "tests/examples"
EXTENDED = os.path.join(os.path.dirname(BERGTOW), "tests/examples/extended")
CASE = changed(TOW, run__duration=10, output__frame_interval=1.7)
WAVES = {"amplitude": 0.02, "period": 2, "direction": 30}


def test_makes_of_one_tree_side_by_side(tmp_path):
    """With a compiler that names itself when all have asked, so that they come to the line that writes at once."""
    n = 12
    compiler = tmp_path / "cc"
    compiler.write_text(f"""#!/bin/sh
        [ "$1" = --version ] || exit 0
        >"$0.$$"
        while [ $(ls "$0".* | wc -l) -lt {n} ]; do sleep 0.01; done
        echo "a compiler"
        """)
    compiler.chmod(0o755)
    build = tmp_path / "build"
    words = ["make", "-s", f"BUILD={build}", f"CC={compiler}", build / "revision.h"]
    started = [subprocess.Popen(words, cwd=ROOT, env=without_make()) for _ in range(n)]
    assert [s.wait(timeout=60) for s in started] == [0] * n
    assert '"a compiler"' in (build / "revision.h").read_text()
    assert [p.name for p in build.iterdir()] == ["revision.h"]


def everything(folder):
    return {str(p.relative_to(folder)) for p in folder.rglob("*")}


@pytest.fixture(scope="module")
def prefix(tmp_path_factory):
    """A prefix that holds something of another program."""
    folder = tmp_path_factory.mktemp("prefix")
    (folder / "lib").mkdir()
    (folder / "lib/other.txt").write_text("not ours\n")
    make("install", f"PREFIX={folder}")
    return folder


def flags(prefix, *what):
    return subprocess.run(["pkg-config", *what, "bergtow"], capture_output=True, text=True, check=True,
                          env=os.environ | {"PKG_CONFIG_PATH": str(prefix / "lib/pkgconfig")}).stdout.split()


@pytest.fixture(scope="module", params=["shared", "static"])
def built(request, prefix, tmp_path_factory):
    """Examples, outside of the tree, with the library as pkg-config has it."""
    folder = tmp_path_factory.mktemp(request.param)
    for name in ("simulation.c", "force_law.c", "measure.c", "quantity.c"):
        (folder / name).write_text((EXAMPLES / name).read_text())
    static = request.param == "static"
    libraries = flags(prefix, "--libs", *(["--static"] if static else []))
    if static:  # the linker takes a shared library where both are there
        libraries = [str(prefix / "lib/libbergtow.a") if word == "-lbergtow" else word for word in libraries]
    for name in ("simulation", "measure"):
        subprocess.run(["gcc", "-std=c17", "-Wall", "-Wextra", "-Werror", f"{name}.c", *flags(prefix, "--cflags"),
                        *libraries, f"-Wl,-rpath,{prefix / 'lib'}", "-lm", "-o", name], cwd=folder, check=True)
        needed = subprocess.run(["ldd", folder / name], capture_output=True, text=True, check=True).stdout
        assert ("libbergtow.so.0" in needed) != static
    return folder


@pytest.fixture(scope="module")
def program(built):
    return built / "simulation"


def stepped(program, case, *overrides):
    result = subprocess.run([program, case, *overrides], capture_output=True, text=True, timeout=120,
                            env=environment(OMP_NUM_THREADS=1))
    assert result.returncode == 0, result.stderr
    return re.search(r"state_hash (\w+)", result.stdout)[1]


def test_a_program_has_the_state_of_the_command(program, tmp_path):
    case = write_case(tmp_path, CASE)
    assert stepped(program, case) == run(tmp_path, case).hash


def test_a_program_with_a_law_has_the_state_of_the_extended_one(program, tmp_path):
    case = write_case(tmp_path, CASE | {"wave_drift": WAVES})
    subprocess.run([EXTENDED, "run", case, "-o", tmp_path / "out", "-q"], check=True, env=environment())
    hash_of = re.search(r'"state_hash": "(\w+)"', (tmp_path / "out/summary.json").read_text())[1]
    assert stepped(program, case) == hash_of
    assert stepped(program, case, "wave_drift.amplitude=0") != hash_of


def test_a_program_with_quantities_has_them_on_the_way_and_in_its_result(built, tmp_path):
    """As the extended program has them, beside the state of one without."""
    case = write_case(tmp_path, CASE)
    done = subprocess.run([built / "measure", case, tmp_path / "out"], capture_output=True, text=True, timeout=120,
                          env=environment(OMP_NUM_THREADS=1))
    assert done.returncode == 0, done.stderr
    subprocess.run([EXTENDED, "run", case, "-o", tmp_path / "extended", "-q"], check=True, env=environment())
    ours, theirs = (json.loads((tmp_path / name / "summary.json").read_text()) for name in ("out", "extended"))
    plain = run(tmp_path, case, name="plain").hash
    assert re.search(r"state_hash (\w+)", done.stdout)[1] == ours["state_hash"] == plain
    names = {"moving_ice": "max_moving_ice_kg", "carried_water_force": "mean_carried_water_force_n"}
    on_the_way = re.findall(r"(\d+) steps, carried water (\S+) N, moving ice (\S+) kg", done.stdout)
    with h5py.File(tmp_path / "out/result.h5") as f, h5py.File(tmp_path / "extended/result.h5") as g:
        for name, key in names.items():
            series = f[f"series/{name}"]
            assert np.array_equal(series, g[f"series/{name}"]) and np.abs(series).max() > 0
            assert {"units", "description"} <= set(series.attrs) and ours[key] == theirs[key]
        steps, carried, moving = np.array(on_the_way, float).T
        assert len(steps) == len(f["series/time"]) // 10 > 5
        assert np.array_equal(carried, f["series/carried_water_force"][9::10])
        assert np.array_equal(moving, f["series/moving_ice"][9::10])


def test_a_quantity_that_was_zero_so_far_is_missed(built, tmp_path):
    """Only of the force of a law is it known that it is 0 where the law is not added."""
    case = write_case(tmp_path, {k: v for k, v in CASE.items() if k != "tow"} | {"body": {"shape": "none"}})
    subprocess.run([built / "measure", case, tmp_path / "out"], check=True, timeout=120)
    with h5py.File(tmp_path / "out/result.h5") as f:
        assert not f["series/moving_ice"][:].any() and np.isnan(f["series/carried_water_force"][:]).all()
    (tmp_path / "out/summary.json").unlink()
    done = subprocess.run([BERGTOW, "resume", tmp_path / "out"], capture_output=True, text=True)
    assert done.returncode == 3 and "the run had carried_water_force, " in done.stderr, done.stderr


def test_a_faulty_case_is_a_message_and_not_the_end(program, tmp_path):
    case = write_case(tmp_path, changed(CASE, tow__sped=1))
    result = subprocess.run([program, case], capture_output=True, text=True)
    assert result.returncode == 1 and "tow.sped: unknown key; did you mean tow.speed?" in result.stderr


@pytest.mark.parametrize("page, example", [("library", "simulation"), ("how-to-add-a-quantity", "measure")])
def test_the_page_shows_the_example(page, example):
    text = (ROOT / f"docs/{page}.md").read_text()
    assert (EXAMPLES / f"{example}.c").read_text() in re.findall(r"```c\n(.*?)```", text, re.DOTALL)


def test_the_library_exports_what_public_headers_name(prefix):
    out = subprocess.run(["nm", "-D", "--defined-only", prefix / "lib/libbergtow.so"], capture_output=True, text=True,
                         check=True).stdout
    names = [name.partition("@@") for *_, kind, name in map(str.split, out.splitlines()) if kind != "A"]
    assert {version for _, _, version in names} == {"BERGTOW_0"}
    exported = {name for name, _, _ in names}
    headers = " ".join(h.read_text() for h in (prefix / "include/bergtow").glob("*.h"))
    assert exported and all(re.search(rf"\b{name}\b", headers) for name in exported)
    declared = set(re.findall(r"\b(bt_\w+)\(", (prefix / "include/bergtow/simulation.h").read_text()))
    assert declared - {"bt_on_out_of_memory", "bt_comm_start"} <= exported
    assert {"bt_on_out_of_memory", "bt_comm_start", "bt_force_apply", "bt_quantity_register"} <= exported


@pytest.mark.parametrize("compiler", quick(["gcc -std=c17", "g++ -std=c++17"], "gcc -std=c17"))
def test_each_header_stands_alone(prefix, tmp_path, compiler):
    names = sorted(h.name for h in (prefix / "include/bergtow").glob("*.h"))
    assert "simulation.h" in names and len(names) > 20
    shown = subprocess.run(["mpicc", "-show"], capture_output=True, text=True, check=True).stdout.split()
    mpi = [f"-isystem{word[2:]}" for word in shown if word.startswith("-I")]  # comm.h is for programs with MPI
    for name in names:
        source = tmp_path / ("x.c" if compiler.startswith("gcc") else "x.cpp")
        # twice, for the guard; and the functions have to have the names of C
        source.write_text(f'#include "bergtow/{name}"\n' * 2)
        result = subprocess.run([*compiler.split(), "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-fsyntax-only",
                                 *flags(prefix, "--cflags"), *(mpi if name == "comm.h" else []), source],
                                capture_output=True, text=True)
        assert result.returncode == 0, f"{name}: {result.stderr}"


CPP = """
#include "bergtow/simulation.h"
#include <cstdio>
#include <string>
// PROGRAM DIR CASE STEPS: so many steps, a frame and a checkpoint, and no end; PROGRAM DIR: on from there
int main(int argc, char **argv)
{
    bt_simulation_options o = {};
    bt_simulation *s = nullptr;
    o.dir = argv[1];
    o.path = argc > 2 ? argv[2] : nullptr;
    o.threads = 1;
    auto fail = [] { std::fprintf(stderr, "%s\\n", bt_last_error()); return 1; };
    if ((argc > 2 ? bt_simulation_create : bt_simulation_resume)(&s, &o) != BT_OK) return fail();
    if (bt_simulation_step(s, argc > 3 ? std::stoi(argv[3]) : 1 << 30) != BT_OK) return fail();
    if (argc > 3) {
        for (int i = 0; i < 2; i++)
            if (bt_simulation_frame(s) != BT_OK) return fail();
        if (bt_simulation_checkpoint(s) != BT_OK) return fail();
        bt_simulation_drop(s);
        return 0;
    }
    return bt_simulation_end(s) == BT_OK ? 0 : fail();
}
"""


@pytest.fixture(scope="module")
def going_on(prefix, tmp_path_factory):
    """A program in C++ that begins simulations and goes on with them."""
    folder = tmp_path_factory.mktemp("cpp")
    (folder / "x.cpp").write_text(CPP)
    subprocess.run(["g++", "-std=c++17", "-Wall", "-Werror", "x.cpp", *flags(prefix, "--cflags", "--libs"),
                    f"-Wl,-rpath,{prefix / 'lib'}", "-o", "x"], cwd=folder, check=True)

    def call_it(*arguments, code=0):
        result = subprocess.run([folder / "x", *map(str, arguments)], capture_output=True, text=True, timeout=60,
                                env=environment(OMP_NUM_THREADS=1))
        assert result.returncode == code, result.stderr
        return result.stderr
    return call_it


def frame_times(folder):
    with h5py.File(folder / "result.h5") as f:
        return f["frames/time"][:]


@pytest.mark.parametrize("steps", [1, 33, 50])
def test_a_program_goes_on_where_it_was(going_on, tmp_path, steps):
    """As the run that was never stopped; what was asked for in between, a frame, is there, once."""
    path = write_case(tmp_path, CASE)
    whole = run(tmp_path, path)
    going_on(tmp_path / "cpp", path, steps)
    going_on(tmp_path / "cpp")
    assert Run(tmp_path / "cpp", None).hash == whole.hash
    dt, times = CASE["run"]["dt"], frame_times(whole.dir)
    assert np.array_equal(frame_times(tmp_path / "cpp"), np.union1d(times, [steps * dt]))
    assert set(differing(whole.dir / "result.h5", tmp_path / "cpp/result.h5")) <= {
        "/case_as_given", *(f"/{group}" for group in ("xdmf", "frames")), "/frame"} | {
        n for n in differing(whole.dir / "result.h5", tmp_path / "cpp/result.h5") if n.startswith(("/frames", "/xdmf"))}
    assert "is finished" in going_on(tmp_path / "cpp", code=1)


def test_programs_and_commands_take_up_each_other(going_on, tmp_path):
    path = write_case(tmp_path, CASE)
    whole = run(tmp_path, path)
    going_on(tmp_path / "cpp", path, 40)
    assert call("resume", tmp_path / "cpp", "--threads", 2).returncode == DONE
    assert call("run", path, "-o", tmp_path / "ours", "--steps", 40).returncode == DONE
    going_on(tmp_path / "ours")
    assert {Run(tmp_path / name, None).hash for name in ("cpp", "ours")} == {whole.hash}


def test_what_cannot_go_on_is_a_message(going_on, tmp_path):
    assert "there is no such folder" in going_on(tmp_path / "none", code=1)
    (tmp_path / "empty").mkdir()
    assert "holds no" in going_on(tmp_path / "empty", code=1)


@pytest.mark.slow
def test_man_page_and_completions_know_every_option(prefix):
    page = (prefix / "share/man/man1/bergtow.1").read_text().replace("\\-", "-")
    bash = (prefix / "share/bash-completion/completions/bergtow").read_text()
    zsh = (prefix / "share/zsh/site-functions/_bergtow").read_text()
    commands = re.findall(r"^  ([a-z]+)  ", call("--help").stdout, re.MULTILINE)
    assert len(commands) >= 9
    for name in commands:
        said = call(name, "--help").stdout
        options = set(re.findall(r"(?<![\w-])--[a-z][\w-]*", re.sub(r"(?m)^.*\[-h\].*(\n {5,}.*)*", "", said)))
        options = {o for o in options if re.search(rf"(?m)^ +(?:-\S(?: \S+)?, )?{o}\b", said)}
        assert {"--help"} <= options
        section = page[page.index(f".SS bergtow {name} "):].split(".SS", 2)[1]
        in_bash = re.search(rf"^    {name}\) options='(.*)' ;;$", bash, re.MULTILINE)[1].split()
        in_zsh = re.search(rf"^  {name}\) (.*?);;$", zsh, re.MULTILINE | re.DOTALL)[1]
        for option in options:
            assert f"\\fB{option}\\fR" in section and option in in_bash, (name, option)
            assert re.search(rf"'{option}[=\[]", in_zsh), (name, option)
    subprocess.run(["bash", "-n", prefix / "share/bash-completion/completions/bergtow"], check=True)


@pytest.mark.parametrize("command", cli.COMMANDS)
def test_a_debian_build_has_what_the_man_page_is_made_of(command):
    """A command that lacks a module has no --help, and the page would be without its options."""
    control = (ROOT / "install/debian/control").read_text()
    there = re.split(r",\s*", re.search(r"Build-Depends: (.*?)\n(?! )", control, re.DOTALL)[1])
    packages = {"numpy": "numpy", "scipy": "scipy", "h5py": "h5py", "yaml": "yaml", "matplotlib": "matplotlib",
                "jinja2": "jinja2", "osgeo": "gdal", "pyproj": "pyproj", "shapely": "shapely", "pandas": "pandas",
                "xarray": "xarray"}
    lacking = [module for module, name in packages.items() if f"python3-{name}" not in there]
    code = f"import sys\nsys.modules.update(dict.fromkeys({lacking}))\nfrom bergtow.cli import main\nmain()"
    done = subprocess.run([sys.executable, "-c", code, command, "--help"], capture_output=True, text=True,
                          env=os.environ | {"PYTHONPATH": str(ROOT / "postproc")})
    assert done.returncode == 0 and "--help" in done.stdout, done.stderr


def test_completion_offers_commands_and_options(prefix):
    def offered(*words):
        script = (f"source {prefix}/share/bash-completion/completions/bergtow; COMP_WORDS=({' '.join(words)}); "
                  f"COMP_CWORD={len(words) - 1}; _bergtow; echo ${{COMPREPLY[@]}}")
        return subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True).stdout.split()

    assert offered("bergtow", "re") == ["resume", "report"]
    assert offered("bergtow", "run", "--st") == ["--steps"]
    assert offered("bergtow", "check", "--st") == []


@pytest.mark.skipif(not shutil.which("zsh"), reason="zsh is missing (make deps-test)")
def test_zsh_reads_its_completion(prefix):
    """In a shell on a terminal, found by compinit: what a tab makes of the beginning of a word."""
    pid, terminal = pty.fork()
    if pid == 0:
        os.execvpe("zsh", ["zsh", "-f", "-i"], os.environ | {"TERM": "dumb"})
    seen = ""

    def typed(text, answer):
        nonlocal seen
        os.write(terminal, text.encode())
        seen, end = "", time.monotonic() + 60
        while not re.search(answer, seen):
            assert time.monotonic() < end, f"{text!r} gave {seen!r}, not {answer}"
            if select.select([terminal], [], [], 1)[0]:
                seen += os.read(terminal, 65536).decode(errors="replace")

    try:
        typed(f"fpath=({prefix}/share/zsh/site-functions $fpath); autoload -Uz compinit && compinit -D -u; "
              "print $_comps[bergtow] is read\n", r"(?m)^_bergtow is read")
        for begun, whole in {"bergtow re": "bergtow resume ", "bergtow run --st": "bergtow run --steps=",
                             "bergtow check --st": "bergtow check --stX"}.items():
            typed(begun, re.escape(begun))
            typed("\tX" if whole.endswith("X") else "\t", re.escape(whole.removeprefix(begun)))
            assert "_arguments" not in seen and "_describe" not in seen, seen  # what they say of a wrong table
            typed("\x15", "")
    finally:
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
        os.close(terminal)


def test_installed_commands_find_their_scripts(prefix, tmp_path):
    result = subprocess.run([prefix / "bin/bergtow", "converge", "--help"], capture_output=True, text=True,
                            cwd=tmp_path, env={k: v for k, v in os.environ.items() if k != "BERGTOW_HOME"})
    assert result.returncode == 0 and "CASE.yml" in result.stdout


@pytest.mark.slow
def test_uninstall_leaves_what_is_not_ours(tmp_path):
    (tmp_path / "lib").mkdir()
    (tmp_path / "lib/other.txt").write_text("not ours\n")
    before = everything(tmp_path)
    make("install", f"PREFIX={tmp_path}")
    subprocess.run([tmp_path / "bin/bergtow", "converge", "--help"], stdout=subprocess.DEVNULL, check=True,
                   env={k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"})
    assert (tmp_path / "share/bergtow/postproc/bergtow/__pycache__").exists()  # what Python adds goes, too
    make("install", f"PREFIX={tmp_path}")  # over an older one
    assert {"bin/bergtow", "lib/libbergtow.so.0", "share/man/man1/bergtow.1"} <= everything(tmp_path) - before
    make("uninstall", f"PREFIX={tmp_path}")
    assert everything(tmp_path) == before


def library_of(pythonpath):
    """The library that a Python loads which finds the package by that."""
    env = {k: v for k, v in os.environ.items() if k != "BERGTOW_LIB"} | {"PYTHONPATH": str(pythonpath)}
    done = subprocess.run([sys.executable, "-c", "import bergtow; print(bergtow._library.library_path())"],
                          capture_output=True, text=True, cwd="/", env=env)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.slow
def test_python_finds_the_package_as_make_install_says(tmp_path):
    said = make("install", f"PREFIX={tmp_path}")
    assert library_of(re.search(r"export PYTHONPATH=(\S+)", said)[1]) == f"{tmp_path}/lib/libbergtow.so.0"


@pytest.mark.slow
def test_the_link_of_the_debian_package_is_to_the_python_package(tmp_path):
    assert "PYTHONPATH" not in make("install", "PREFIX=/usr", f"DESTDIR={tmp_path}")
    place, link = (tmp_path / p for p in (ROOT / "install/debian/python3-bergtow.links").read_text().split())
    link.parent.mkdir(parents=True)
    link.symlink_to(place)
    assert library_of(link.parent) == f"{tmp_path}/usr/lib/libbergtow.so.0"


@pytest.mark.slow
def test_destdir_is_no_part_of_what_is_installed(tmp_path):
    make("install", "PREFIX=/usr", f"DESTDIR={tmp_path}")
    assert str(tmp_path) not in (tmp_path / "usr/lib/pkgconfig/bergtow.pc").read_text()
    make("uninstall", "PREFIX=/usr", f"DESTDIR={tmp_path}")
    assert everything(tmp_path) == set()
