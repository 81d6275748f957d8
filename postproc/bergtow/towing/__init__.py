# SPDX-License-Identifier: MIT
"""Line, vessel and berg of a tow in closed form: the load that a line holds, how a start and a slack line load it, the
bollard pull that a force requires, and whether the berg stays upright. SI units throughout: N, m, s, kg, N/m, rad.

A line's pull is the horizontal component of its tension, which acts on the berg.
"""
from .catenary import Catenary
from .library import (Line, Vessel, find_line, find_vessel, lightest_line, lines, smallest_vessel, vessels)
from .stability import (RollStability, critical_ratio, heel_angle, metacentric_height, overturning_moment,
                        roll_stability)
from .start import (effective_mass, ramp_for, snap_load, snap_load_catenary, start_load, swing_after)
from .vessel import (IceResistance, ice_resistance, needed_bollard_pull, needed_breaking, pull_share, read_curve,
                     tonnes, utilisation)

__all__ = ["Catenary", "IceResistance", "Line", "RollStability", "Vessel", "critical_ratio", "effective_mass",
           "find_line", "find_vessel", "heel_angle", "ice_resistance", "lightest_line", "lines", "metacentric_height",
           "needed_bollard_pull", "needed_breaking", "overturning_moment", "pull_share", "ramp_for", "read_curve",
           "roll_stability", "smallest_vessel", "snap_load", "snap_load_catenary", "start_load", "swing_after",
           "tonnes", "utilisation", "vessels"]
