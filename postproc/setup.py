# SPDX-License-Identifier: MIT
"""What pyproject.toml cannot say: a wheel made in the sources brings libbergtow and the program, of one process.

Elsewhere, as in an installed prefix, or where BERGTOW_LIB names the library to be used, it is the package alone. The
wheel is of no version of Python: the library is loaded by ctypes.
"""
import os
import shutil
import subprocess
from pathlib import Path

from setuptools import Distribution, setup
from setuptools.command.build_py import build_py

try:
    from setuptools.command.bdist_wheel import bdist_wheel
except ImportError:  # before setuptools 70.1
    from wheel.bdist_wheel import bdist_wheel

SOURCES = Path(__file__).resolve().parents[1]
COMPILES = (SOURCES / "Makefile").is_file() and (SOURCES / "src").is_dir() and not os.environ.get("BERGTOW_LIB")
BUILD = "build/alone"


class BuildWithLibrary(build_py):
    def run(self):
        super().run()
        if not COMPILES or self.editable_mode:
            return
        subprocess.run(["make", f"-j{os.cpu_count()}", "MPI=no", f"BUILD={BUILD}", f"{BUILD}/bergtow",
                        f"{BUILD}/libbergtow.so"], cwd=SOURCES, check=True)
        place = Path(self.build_lib) / "bergtow/_lib"
        place.mkdir(parents=True, exist_ok=True)
        for name in "bergtow", "libbergtow.so.0":
            shutil.copy(SOURCES / BUILD / name, place / name)
            subprocess.run(["strip", "--strip-debug", place / name], check=True)


class Compiled(Distribution):
    def has_ext_modules(self):
        return COMPILES


class WheelOfTheMachine(bdist_wheel):
    def get_tag(self):
        return ("py3", "none", super().get_tag()[2]) if COMPILES else super().get_tag()


setup(distclass=Compiled, cmdclass={"build_py": BuildWithLibrary, "bdist_wheel": WheelOfTheMachine})
