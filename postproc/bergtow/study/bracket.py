# SPDX-License-Identifier: MIT
"""Search along a value for the point where the success rate of random trials falls below a given share q, with as few
trials as possible.

At one value the trials are independent, and the question is whether the probability p of success is above or below q.
The likelihood ratio of any p against q, and so that of a mixture of them, is a fair bet while p <= q: the probability
that it ever exceeds 1/a is at most a [Ville 1939; Robbins 1970, Ann. Math. Stat. 41, 1397]. So one may test after each
trial, and stop when a side is established at 1 - LEVEL. The mixture is p = 1, and p of density (1 - p)^-1/2 in (q, 1]:
at q = 1/2 it takes 6 of 6 successes, or 11 of 12. Rejected: Wald's sequential test, which at p near q picks a side by
chance; an interval for a fixed number of trials, which is not valid after repeated tests.

A trial has no outcome if its run failed, possibly for the same reason that makes a tow fail. So a side is established
only if it would be with any outcomes of these trials.

Success is assumed to be monotonic along the value. Between a value that succeeds and a value that fails, the midpoint
is tried next; a value that stays undecided has p near q, and the gaps on both sides of it are narrowed.
"""
import itertools
from dataclasses import dataclass, field

import numpy as np
import scipy

LEVEL = 0.025
SURE = 0.3    # weight of p = 1
YES, NO, OPEN = "yes", "no", "open"


def log_evidence(good, bad, share):
    """Logarithm of the bet that p > share, after the given numbers of good and bad trials."""
    # the mixture of density (1 - p)^-1/2 over (share, 1]: the integral of p^good (1 - p)^(bad - 1/2), over its weight
    inside = scipy.special.betainc(bad + 0.5, good + 1, 1 - share)
    mixed = -np.inf if inside <= 0 else np.log(inside) + scipy.special.betaln(good + 1, bad + 0.5) - np.log(
        2 * np.sqrt(1 - share))
    bets = [np.log(1 - SURE) + mixed - good * np.log(share) - bad * np.log1p(-share)]
    if not bad:
        bets.append(np.log(SURE) - good * np.log(share))
    return float(scipy.special.logsumexp(bets))


def verdict(good, bad, share=0.5, level=LEVEL):
    """YES if p > share is certain, NO if p < share is, otherwise OPEN."""
    if log_evidence(good, bad, share) >= -np.log(level):
        return YES
    return NO if log_evidence(bad, good, 1 - share) >= -np.log(level) else OPEN


def least_trials(share=0.5):
    """The fewest trials that can decide, whichever side they are on: 6 for a share of one half, 82 for 95 %."""
    return next(n for n in itertools.count(1) if verdict(n, 0, share) == YES and verdict(0, n, share) == NO)


@dataclass
class Point:
    value: float
    good: int = 0
    bad: int = 0
    failed: int = 0      #: trials without an outcome
    spent: bool = False  #: no more trials are made there

    @property
    def n(self):
        return self.good + self.bad


@dataclass
class Bracket:
    """The search between two ends, in either order."""

    start: float
    end: float
    resolution: float            #: width of the bracket at which the search ends
    share: float = 0.5
    most: int = 24               #: trials per value
    points: dict = field(default_factory=dict)  #: by value

    def point(self, value):
        """The trials at a value; values that agree to eight digits are the same."""
        value = float(f"{value:.8g}")
        return self.points.setdefault(value, Point(value))

    def judged(self, value):
        p = self.point(value)
        return self.verdict(p.good, p.bad, p.failed)

    def verdict(self, good, bad, failed):
        """YES or NO if it is certain whatever the outcomes of the failed trials would have been."""
        if verdict(good, bad + failed, self.share) == YES:
            return YES
        return NO if verdict(good + failed, bad, self.share) == NO else OPEN

    def decidable(self, p, failed):
        """Can the remaining trials of a point decide it, given this many without an outcome?"""
        rest = max(0, self.most - p.n)
        return (self.verdict(p.good + rest, p.bad, failed) != OPEN or
                self.verdict(p.good, p.bad + rest, failed) != OPEN)

    def more(self, value):
        """Is the value undecided, and worth more trials? If some had no outcome, only while the rest may decide it. If
        all had one, its share is near q, and every trial is made: stopping early here, too, would save a quarter of the
        trials but double the scatter of the estimate."""
        p = self.point(value)
        return self.judged(value) == OPEN and p.n < self.most and not p.spent and (
            not p.failed or self.decidable(p, p.failed))

    def ends(self):
        """(value of a success, value of a failure) closest to each other; if there are none of one kind, None for it,
        and for the other kind the value next to an undecided end."""
        yes = [v for v in self.points if self.judged(v) == YES]
        no = [v for v in self.points if self.judged(v) == NO]
        if not yes or not no:
            last = self.start if self.judged(self.start) == OPEN else self.end
            near = min(yes + no, key=lambda v: abs(v - last), default=None)
            return (near if yes else None), (near if no else None)
        return min(((a, b) for a in yes for b in no), key=lambda pair: abs(pair[0] - pair[1]))

    def expected(self, value):
        """The verdict on a value that follows from the ends, if success is monotonic: YES or NO, OPEN between them."""
        yes, no = self.ends()
        if yes is None and no is None:
            return OPEN
        if yes is not None and no is not None:
            return YES if (value - yes) * (no - yes) <= 0 else NO if (value - no) * (yes - no) <= 0 else OPEN
        near, side = (yes, YES) if no is None else (no, NO)
        open_ends = [v for v in (self.start, self.end) if self.judged(v) == OPEN]
        return side if all((value - near) * (v - near) <= 0 for v in open_ends) else OPEN

    def against(self):
        """Points whose trials contradict expected()."""
        def other(p):
            side = self.expected(p.value)
            return p.good < self.share * p.n if side == YES else side == NO and p.good > self.share * p.n
        return [p for _, p in sorted(self.points.items()) if p.n and other(p)]

    def next(self):
        """The value to try next, None when the search is over."""
        if more := [v for v in (self.start, self.end) if self.more(v)]:
            return more[0]
        yes, no = self.ends()
        if yes is None or no is None:
            undecided = [v for v in (self.start, self.end) if self.judged(v) == OPEN]
            if len(undecided) != 1:
                return None
            # the limit is near that end, on either side of it: approach it from the other end
            yes, no = undecided[0], no if yes is None else yes
        low, high = min(yes, no), max(yes, no)
        inner = sorted(v for v in self.points if low < v < high)
        if more := [v for v in inner if self.more(v)]:
            return more[0]
        # all values in between were tried without a decision: the gaps next to them, the wider one first
        stops = [low, *inner, high]
        gaps = [(b - a, a, b) for a, b in zip(stops, stops[1:]) if not inner or a == low or b == high]
        width, a, b = max(gaps)
        return None if width <= self.resolution * (1 + 1e-6) else float(f"{0.5 * (a + b):.8g}")

    def estimate(self):
        """The value at which the share crosses q: shares made monotonic (pool adjacent violators), linear between
        values; NaN if they do not cross it."""
        rows = sorted((p for p in self.points.values() if p.n), key=lambda p: p.value)
        if len(rows) < 2:
            return np.nan
        # from the trials themselves: an end may be undecided, so that one side has no values
        overall = sum(p.good for p in rows) / sum(p.n for p in rows)
        falls = sum((p.good - overall * p.n) * p.value for p in rows) < 0
        blocks = []  # [share, trials, values]
        for p in rows:
            blocks.append([p.good / p.n, p.n, [p.value]])
            while len(blocks) > 1 and (blocks[-2][0] < blocks[-1][0]) == falls and blocks[-2][0] != blocks[-1][0]:
                b = blocks.pop()
                a = blocks.pop()
                blocks.append([(a[0] * a[1] + b[0] * b[1]) / (a[1] + b[1]), a[1] + b[1], a[2] + b[2]])
        v = np.array([x for _, _, some in blocks for x in some])
        above = np.array([s for s, _, some in blocks for _ in some]) - self.share
        for a, b, fa, fb in zip(v, v[1:], above, above[1:]):
            if fa * fb <= 0 and fa != fb:
                return float(a + (b - a) * fa / (fa - fb))
        return np.nan
