# SPDX-License-Identifier: MIT
"""bergtow in Python: cases, simulations run step by step, user-defined forces, results as xarray datasets.

    import bergtow

    case = bergtow.Case("cases/basin/basin-80.yml")
    case["tow.speed"] = "0.2 m/s"
    with bergtow.Simulation(case) as sim:
        while sim.steps_left:
            sim.step(100)
            print(sim.time, sim["ice_resistance"])

The library libbergtow does the computing; see docs/library.md.
"""
import sys as _sys

try:
    __import__("numpy")
except ImportError:
    _text = (f"bergtow needs numpy, which {_sys.executable} (Python {_sys.version.split()[0]}) lacks; install "
             f"python3-numpy (Debian) or `{_sys.executable} -m pip install numpy`, or use /usr/bin/python3")
    if _sys.argv[:1] != ["-m"]:
        raise ImportError(_text) from None
    print(f"bergtow: {_text}", file=_sys.stderr)  # python3 -m bergtow: a command ends with one line and its exit code
    raise SystemExit(4) from None
from ._library import library_path, start_mpi
from .case import Case, quantities
from .errors import BergtowError, CaseError
from .force import Bodies, Force
from .functions import (Outlines, Picture, budget, capability, converge, design, export, outlines, plot_chains,
                        plot_ensemble, plot_field, plot_force, plot_impacts, plot_resistance, report, route, statistics)
from .result.dataset import Result, open_result
from .simulation import Simulation, run
from .study.ensemble import Ensemble
from . import towing

__version__ = "0.1.0"
__all__ = ["BergtowError", "Bodies", "Case", "CaseError", "Ensemble", "Force", "Outlines", "Picture", "Result",
           "Simulation", "budget", "capability", "converge", "design", "export", "library_path", "open_result",
           "outlines", "plot_chains", "plot_ensemble", "plot_field", "plot_force", "plot_impacts", "plot_resistance",
           "quantities", "report", "route", "run", "start_mpi", "statistics", "towing"]
