# SPDX-License-Identifier: MIT
"""Signals whose extremes are known, and how often intervals of their return levels hold them.

A stationary Markov chain stays below z for n steps with a probability that falls like exp(-n rate(z)), where
exp(-rate(z)) is the largest eigenvalue of its transitions within (-inf, z]: found here on a grid of cells. A level is
exceeded once in T steps, by clusters, where T rate(z) = 1.
"""
import functools

import numpy as np
from scipy import optimize, signal, stats

from bergtow.stats import load as stat_load

CELLS, TURNS = 400, 200


class Chain:
    """A Markov chain in steps of 1 s: low end of the grid, bracket of levels, distribution of the next value."""

    low, bracket = 0.0, (0.5, 80.0)

    def rate(self, z):
        """Rate at which the chain first exceeds z, per step."""
        edges = np.linspace(self.low, z, CELLS + 1)
        middle = 0.5 * (edges[1:] + edges[:-1])
        step = np.diff(self.cdf(edges[None, :], middle[:, None]), axis=1)
        step[:, 0] += self.cdf(edges[0], middle)
        v = np.full(CELLS, 1 / CELLS)
        for _ in range(TURNS):
            w = v @ step
            stay = w.sum()
            v = w / stay
        return max(-np.log(stay), 1e-15)

    def level(self, hours):
        return optimize.brentq(lambda z: np.log(3600 * hours * self.rate(z)), *self.bracket, xtol=1e-3)


class AR1(Chain):
    """x' = phi x + noise, normal of mean 0 and variance 1."""

    low, bracket = -6.0, (1.0, 8.0)

    def __init__(self, phi):
        self.phi, self.name = phi, f"AR(1) of {phi:g}"

    def cdf(self, y, x):
        return stats.norm.cdf((y - self.phi * x) / np.sqrt(1 - self.phi ** 2))

    def sample(self, fields, n, rng):
        noise, first = rng.normal(0, np.sqrt(1 - self.phi ** 2), (fields, n)), rng.standard_normal((fields, 1))
        return signal.lfilter([1], [1, -self.phi], noise, axis=1, zi=self.phi * first)[0]


class EAR1(Chain):
    """x' = phi x, and with probability 1 - phi more by an exponential of mean 1: exponential of mean 1 [Gaver & Lewis
    1980, Adv. Appl. Probab. 12]. Shots that decay; phi = 0: independent."""

    def __init__(self, phi):
        self.phi, self.chance, self.name = phi, 1 - phi, f"EAR(1) of {phi:g}"

    def cdf(self, y, x):
        above = y - self.phi * x
        return np.where(above >= 0, 1 - self.chance * np.exp(-np.maximum(above, 0)), 0.0)

    def sample(self, fields, n, rng):
        def shots(shape):
            return rng.exponential(1, shape) * (rng.random(shape) < self.chance)
        x = signal.lfilter([1], [1, -self.phi], shots((fields, n + 200)), axis=1)
        return x[:, 200:]


class POISSON(EAR1):
    """Poisson shots, rare and exponential, that decay by half a step: mostly zero, as collisions are."""

    def __init__(self, chance):
        self.phi, self.chance, self.name = 0.5, chance, f"filtered Poisson process of {chance:g}"


class UNLIKE(Chain):
    """Fields of AR(1) that differ in level: each is multiplied by exp(s g), or raised by s g, with a normal g of its
    own. In the long run a level is exceeded at the mean of the rates of all fields, drawn or not."""

    GRID = np.linspace(1.0, 9.0, 60)  # levels of AR(1): below the first there are no rare clusters, beyond nothing

    def __init__(self, phi, s, raised=False):
        self.process, self.s, self.raised = AR1(phi), s, raised
        self.name = f"AR(1) of {phi:g} {f'+ {s:g} g' if raised else f'x exp({s:g} g)'}"
        self.bracket = (1.0, 60.0 if raised else 400.0)

    @functools.cached_property
    def logs(self):
        return np.log([self.process.rate(z) for z in self.GRID])

    def rate(self, z):
        g = stats.norm.ppf((np.arange(20000) + 0.5) / 20000)
        own = z - self.s * g if self.raised else z / np.exp(self.s * g)
        return np.mean(np.exp(np.interp(own, self.GRID, self.logs, right=-60.0)))

    def sample(self, fields, n, rng):
        x, g = self.process.sample(fields, n, rng), rng.standard_normal((fields, 1))
        return x + self.s * g if self.raised else x * np.exp(self.s * g)


def fields_of(process, fields, n, rng):
    """Fields as stat_load has them; the time scale is a sample."""
    time = np.arange(1.0, n + 1)
    return [stat_load.field_of(time, x, 1.0, float(n), 1.0) for x in process.sample(fields, n, rng)]


def coverage(process, fields, n, trials, times, seed):
    """{model: (how many intervals hold the level of each of `times` x the hours simulated, median of estimate / level,
    trials with one)}."""
    rng, hours = np.random.default_rng(seed), [k * fields * n / 3600 for k in times]
    true = np.array([process.level(T) for T in hours])
    inside = {"over_threshold": [], "block_maxima": []}
    ratio = {kind: [] for kind in inside}
    for _ in range(trials):
        some = fields_of(process, fields, n, rng)
        found = stat_load.extremes(some, stat_load.gap_of(some), hours, 1)
        for kind in inside:
            if "refused" in found[kind]:
                raise AssertionError(f"{process.name}: {found[kind]['refused']}")
            levels = found[kind]["levels"]
            inside[kind].append([x["level_95"][0] <= z <= x["level_95"][1] for x, z in zip(levels, true)])
            ratio[kind].append([x["level"] for x in levels] / true)
    return {kind: (np.sum(inside[kind], axis=0), np.median(ratio[kind], axis=0)) for kind in inside}
