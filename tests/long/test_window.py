# SPDX-License-Identifier: MIT
"""The mean resistance in a moving window is that in one long domain, within the standard errors of both."""
import numpy as np
import pytest

from harness import changed, run

# An 80 m berg through 30 m floes, a tow of 4.6 km.
LONG = {
    "run": {"dt": 5, "duration": 9200},
    "domain": {
        "frame": "geographic", "length": 7500, "x0": -1200, "width": 1500, "ends": "periodic", "sides": "periodic"
    },
    "ice": {"concentration": 0.8, "size": 30, "thickness": 0.5},
    "body": {"length": 80, "draft": 30},
    "tow": {"speed": 0.5, "ramp": 60},
    "output": {"window_start": 1000},
}
WINDOW = changed(LONG,
                 domain={"frame": "geographic", "length": 3000, "width": 1500, "ends": "moving", "sides": "periodic"})


@pytest.mark.parametrize("concentration", [0.3, 0.5])
def test_the_mean_is_that_of_a_long_domain(tmp_path, concentration):
    mean, error = [], []
    for seed in 1, 2:
        for name, case in ("long", LONG), ("window", WINDOW):
            r = run(tmp_path, changed(case, ice__concentration=concentration, ice__seed=seed), "--quiet",
                    name=f"{name}{seed}", timeout=600)
            s = r.summary
            print(name, concentration, seed, s["mean_ice_resistance_n"], s["mean_ice_resistance_se_n"],
                  s["moving_window"])
            mean.append(s["mean_ice_resistance_n"])
            error.append(s["mean_ice_resistance_se_n"])
            if name == "window":
                w = s["moving_window"]
                assert w["laps"] > 1.4 and w["kept"] + w["missed"] < 0.01 * w["renewed"]
    long, window = np.array(mean)[0::2].mean(), np.array(mean)[1::2].mean()
    # The second lap is not independent of the first: its part of the error counts double.
    combined = np.hypot(np.hypot(*error[0::2]), 1.4 * np.hypot(*error[1::2])) / 2
    assert abs(window - long) < 2.5 * combined, (long, window, combined)
    assert combined < 0.08 * long # otherwise the comparison says nothing
