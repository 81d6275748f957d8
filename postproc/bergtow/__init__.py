# SPDX-License-Identifier: MIT
"""bergtow in Python: cases, simulations that are stepped, forces of one's own, results as xarray datasets.

    import bergtow
    case = bergtow.Case("cases/basin/basin-80.yml")
    case["tow.speed"] = "0.2 m/s"
    with bergtow.Simulation(case) as sim:
        while sim.steps_left:
            sim.step(100)
            print(sim.time, sim["ice_resistance"])

What computes is libbergtow; see docs/library.md.
"""
import sys as _sys

try:
    __import__("numpy")
except ImportError:
    raise ImportError(f"bergtow needs numpy, which {_sys.executable} (Python {_sys.version.split()[0]}) lacks; install "
                      f"python3-numpy (Debian) or `{_sys.executable} -m pip install numpy`, or use /usr/bin/python3"
                      ) from None
from ._library import BergtowError, CaseError, library_path, start_mpi
from .case import Case, quantities
from .ensemble import Ensemble
from .force import Bodies, Force
from .maps import Outlines, outlines
from .pictures import (Picture, plot_chains, plot_ensemble, plot_field, plot_force, plot_impacts, plot_resistance,
                       report, statistics)
from .results import Result, open_result
from .simulation import Simulation, run

__version__ = "0.1.0"
__all__ = ["BergtowError", "Bodies", "Case", "CaseError", "Ensemble", "Force", "Outlines", "Picture", "Result",
           "Simulation", "library_path", "open_result", "outlines", "plot_chains", "plot_ensemble", "plot_field",
           "plot_force", "plot_impacts", "plot_resistance", "quantities", "report", "run", "start_mpi", "statistics"]
