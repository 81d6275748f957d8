# SPDX-License-Identifier: MIT
"""What holds for every valid case, whatever is in it: examples of hypothesis over the random cases of random_cases.py.

An example is a seed, the parts of its case that are kept, and how many floes; hypothesis takes parts and floes away
from one that fails until nothing more can go. `same_bits` runs a case as drawn, moving window and lead and all, in two
ways: at once, and on other ranks and threads, in legs, with kills. The other properties need scenes that can be turned
or moved: `by_hand` makes the field of a case and writes it as a list of floes.

Bit for bit: ranks, threads, legs, kills. Within rounding: a scene that is turned by quarters, mirrored, renumbered, or
seen by an observer who moves. There the order of the arithmetic, and so the last digit, is another one, and collisions
magnify that some tenfold each: compared are a few steps, solved to 1e-10 of the speed."""
import collections
import copy
import dataclasses
import math
import pathlib
import random
import signal
import subprocess
import tempfile

import h5py
import hypothesis
import numpy as np
from hypothesis import strategies as st

import faults
import random_cases
import scenes
from harness import BERGTOW, environment, launcher, overlap, placed, write_case
from random_cases import text, value_of

#: parts of a case that it can do without
PARTS = ("air", "water.tide", "water.tilt", "water.latitude", "water", "ice.crushing", "ice.rafting", "ice.drag",
         "ice.restitution", "ice.friction", "ice.thickness_law", "ice.size_law", "lead", "solver", "impact", "output",
         "estimate", "guard", "tow.line", "tow.branch2", "tow.waypoints", "body.restitution", "body.drag",
         "domain.ends_closing", "domain.sides_closing", "floes")
STEPS = 12
ROUNDING = 1e-5

seeds = st.integers(0, 2**32 - 1)
kept = st.one_of(st.frozensets(st.sampled_from(PARTS)), st.just(frozenset(PARTS)))
numbers = st.one_of(st.integers(1, 30), st.just(10**6))


class Refused(Exception):
    """A case that the program does not run: no finding here (judge.judge has them)."""


def called(folder, *words, ranks=1, env=None):
    mpi = launcher(ranks) if ranks > 1 else []
    p = subprocess.run([*mpi, BERGTOW, *map(str, words)], cwd=folder, capture_output=True, text=True, timeout=120,
                       env=env or environment(OMP_NUM_THREADS=1))
    return p.returncode, p.stderr


def drawn(table, seed, parts):
    """The case of a seed with some of its parts."""
    case = random_cases.draw(seed, table)
    for part in set(PARTS) - parts:
        *path, key = part.split(".")
        at = case
        for section in path:
            at = at.get(section, {})
        at.pop(key, None)
    if "water.latitude" not in parts and value_of(case, "water.tilt") == "geostrophic":
        del case["water"]["tilt"]
    return case


# ---- the same bits ----

legs = st.lists(st.tuples(st.integers(1, 3), st.integers(1, 2), st.integers(0, 12)), min_size=1, max_size=3)


def one_of_many(table, folder, seed, parts, ways):
    """A case at once, and in legs of (ranks, threads, call that kills: 0 none): what differs of all that is left."""
    case = drawn(table, seed, parts)
    case["run"]["duration"] = value_of(case, "run.dt") * random.Random(seed).choice((20, 35, 50))
    case.get("output", {}).pop("window_start", None)
    write_case(folder, case)
    steps = round(case["run"]["duration"] / case["run"]["dt"])
    code, err = called(folder, "run", "case.yml", "-o", "one", "--quiet", "--threads", 1)
    if code == 3:
        raise Refused(err)
    early = False
    for k, (ranks, threads, at) in enumerate(ways):
        what = ["resume", "other"] if (folder / "other/case.resolved.yml").exists() else [
            "run", "case.yml", "-o", "other", "--force"]
        last = k + 1 == len(ways)
        words = [*what, "--quiet", "--threads", threads, *([] if last else ["--steps", steps * (k + 1) // len(ways)])]
        if at and ranks == 1 and not last:
            early = early or not list((folder / "other").glob("checkpoint*.h5"))
            called(folder, *words, env=faults.shim(folder, BT_CALLS="fsync,rename", BT_CALLS_AT=at,
                                                   BT_CALLS_SIGNAL=signal.SIGKILL.value))
            continue
        found, err = called(folder, *words, ranks=ranks)
        if found != 0:
            break
    assert found == code, f"exit codes {code} and {found}: {err}\n{text(case)}"
    if code == 0:
        one, other = scenes.items_of(folder / "one"), scenes.items_of(folder / "other")
        different = [n for n in scenes.differing(one, other) if not n.startswith("/case")]
        assert not different, f"{ways}: {different[:8]}\n{text(case)}"
        balances(case, folder / "one")
    return f"exit code {code}"


def balances(case, folder):
    """The momentum of every step, and contacts that add no energy: λᵀ(w* + w2)/2 is not positive but for what the
    solver leaves, here of steps that are solved."""
    with h5py.File(folder / "result.h5") as f:
        momentum, added = (f["series"][k][:] for k in ("momentum_residual", "added_energy"))
        solved = (f["series/unconverged"][:] + f["series/outrun"][:]) == 0
    assert momentum.max(initial=0) < 1e-9, f"momentum: {momentum.max()}\n{text(case)}"
    if value_of(case, "solver.tolerance", 1) <= 1e-10:
        assert not added[solved].any(), f"contacts add energy\n{text(case)}"


# ---- scenes that can be turned and moved ----

def floe_size(case):
    """Diameter of a typical floe; the power law has its two ends only."""
    ice = case["ice"]
    return ice["size"] if "size" in ice else math.sqrt(ice["size_min"] * ice["size_max"])


def by_hand(table, folder, seed, parts, number):
    """The scene of a seed as floes given by hand, with nothing left to defaults that know of an axis."""
    case = drawn(table, seed, parts - {"lead"})
    rng = random.Random(seed)
    if value_of(case, "domain.ends") == "moving":
        case["domain"]["ends"] = rng.choice(("periodic", "open"))
    d, ice, body = case["domain"], case["ice"], case["body"]
    ahead = d.pop("ahead", None)
    d.setdefault("x0", -d["length"] / 2 if d["frame"] == "geographic" else 0)
    d.setdefault("y0", -d["width"] / 2)
    if "shape" in body and body["shape"] != "none":
        body.setdefault("x", d["x0"] + (ahead or 0.5 * d["length"]))
        body.setdefault("yaw", 0)
    tow = case["tow"]
    if value_of(case, "tow.line.branches") == 2: # by default one is fastened on each side
        length = body.get("length") or np.ptp(np.array(body["vertices"])[:, 0])
        for at, side in ((tow, 1), (tow.setdefault("branch2", {}), -1)):
            at.setdefault("hull_x", 0.2 * length)
            at.setdefault("hull_y", 0.1 * side * length)
    write_case(folder, case, "field.yml")
    code, err = called(folder, "field", "field.yml", "-o", "field.h5")
    if code:
        raise Refused(err)
    with h5py.File(folder / "field.h5") as f:
        at, corners = f["floes/offsets"][:], f["floes/vertices"][:]
        pose, thickness = f["floes/pose"][:], f["floes/thickness"][:]
    speed = floe_size(case) / case["run"]["dt"] / 30
    floes = []
    for k, (x, y, yaw) in enumerate(pose):
        floes.append({"shape": "polygon", "vertices": corners[at[k]:at[k + 1]].tolist(), "x": x, "y": y,
                      "yaw": math.degrees(yaw), "thickness": thickness[k]})
    floes += case.pop("floes", [])
    for f in floes:
        f["vx"], f["vy"] = rng.uniform(-speed, speed), rng.uniform(-speed, speed)
        f["yaw_rate"] = rng.uniform(-1, 1) * min(360, math.degrees(speed / floe_size(case)))
        if f.get("fixed"):
            del f["vx"], f["vy"], f["yaw_rate"]
    x, y = body.get("x", d["x0"]), body.get("y", d["y0"])
    floes.sort(key=lambda f: math.hypot(f["x"] - x, f["y"] - y))
    case["floes"] = floes[:number]
    for key in ("x_min", "x_max", "y_min", "y_max", "extent"):
        ice.pop(key, None)
    ice["concentration"] = 0
    dt = case["run"]["dt"]
    case["run"]["duration"] = dt * STEPS
    case["output"] = {"frame_interval": dt}
    case["guard"] = {"overlap": 0, "energy": 0, "unconverged": 0, "escape": False}
    case["solver"] = {"tolerance": 1e-10, "reference_speed": speed, "max_sweeps": 2000, "position_sweeps": 2000,
                      "slop": 1e-9}
    return case


def moved_by(m, v):
    return [float(m[0][0] * v[0] + m[0][1] * v[1]), float(m[1][0] * v[0] + m[1][1] * v[1])]


@dataclasses.dataclass
class Turned:
    """A scene seen in a frame turned by quarters, in a mirror if said so."""

    quarters: int
    mirror: bool

    def __post_init__(self):
        c, s = [(1, 0), (0, 1), (-1, 0), (0, -1)][self.quarters]
        self.sign = -1 if self.mirror else 1
        self.angle = 90 * self.quarters
        self.m = np.array([[c, -s], [s, c]]) @ np.diag([1, self.sign])

    def pair(self, at, x, y):
        if x in at or y in at:
            at[x], at[y] = moved_by(self.m, (at.get(x, 0), at.get(y, 0)))

    def turn(self, at, key):
        if key in at:
            at[key] = math.remainder(self.sign * at[key] + self.angle, 360)

    def flip(self, at, *keys):
        for key in keys:
            if key in at:
                at[key] *= self.sign

    def outline(self, at):
        if "vertices" in at and self.sign < 0:
            at["vertices"] = [[x, -y] for x, y in reversed(at["vertices"])]

    def of(self, case):
        case = copy.deepcopy(case)
        d, body, tow, water = case["domain"], case["body"], case["tow"], case.setdefault("water", {})
        corners = [moved_by(self.m, (d["x0"] + i * d["length"], d["y0"] + j * d["width"])) for i in (0, 1) for j in
                   (0, 1)]
        d["x0"], d["y0"] = (min(c[k] for c in corners) for k in (0, 1))
        if self.angle % 180:
            d["length"], d["width"] = d["width"], d["length"]
            for a, b in (("ends", "sides"), ("ends_closing", "sides_closing")):
                x, y = d.pop(a, None), d.pop(b, None)
                d |= {k: v for k, v in ((a, y), (b, x)) if v is not None}
        for at in (body, *case["floes"]):
            for x, y in (("x", "y"), ("vx", "vy")):
                self.pair(at, x, y)
            self.turn(at, "yaw")
            self.flip(at, "yaw_rate")
            self.outline(at)
        tow.setdefault("direction", 0)
        self.turn(tow, "direction")
        self.flip(tow, "hull_y")
        self.flip(tow.get("branch2", {}), "hull_y")
        if "waypoints" in tow:
            tow["waypoints"] = [moved_by(self.m, p) for p in tow["waypoints"]]
            del tow["direction"]
        self.pair(water, "current_x", "current_y")
        self.pair(water, "slope_x", "slope_y")
        self.flip(water, "latitude")
        if "tide" in water:
            water["tide"].setdefault("inclination", 0)
            self.turn(water["tide"], "inclination")
            self.flip(water["tide"], "minor")
        self.pair(case.setdefault("air", {}), "wind_x", "wind_y")
        return case

    def expected(self, r):
        """The result of the scene as it is seen."""
        return {
            "place": r["place"] @ self.m.T, "yaw": self.sign * r["yaw"] + math.radians(self.angle),
            "force": r["force"] @ self.m.T, "moment": self.sign * r["moment"], "rate": self.sign * r["rate"],
            "speed": r["speed"] @ self.m.T, "tow": r["tow"]
        }


@dataclasses.dataclass
class Renumbered:
    seed: int

    def order(self, n):
        order = list(range(n))
        random.Random(self.seed).shuffle(order)
        return order

    def of(self, case):
        return case | {"floes": [case["floes"][k] for k in self.order(len(case["floes"]))]}

    def expected(self, r):
        order = self.order(r["place"].shape[1])
        return r | {"place": r["place"][:, order], "yaw": r["yaw"][:, order]}


@dataclasses.dataclass
class Passing:
    """A scene without walls and Coriolis seen by an observer who goes the other way: everything, the water too, has
    the same velocity on top, along the tow."""

    share: float

    def velocity(self, case):
        speed = self.share * value_of(case, "solver.reference_speed")
        angle = math.radians(value_of(case, "tow.direction", 0))
        return speed, (speed * math.cos(angle), speed * math.sin(angle))

    @staticmethod
    def prepared(case):
        """What an observer can pass: no walls, nothing fixed, no path over ground, no vessel under way."""
        case = copy.deepcopy(case)
        for k in ("ends", "sides"):
            if value_of(case, f"domain.{k}") == "wall":
                case["domain"][k] = "periodic"
            case["domain"].pop(f"{k}_closing", None)
        water, tow = case.setdefault("water", {}), case["tow"]
        water.pop("latitude", None)
        if water.get("tilt") == "geostrophic":
            del water["tilt"]
        if "waypoints" in tow or tow["mode"] == "thrust":
            tow.clear()
            tow["mode"] = "none"
        if tow["mode"] != "none" and "programme" not in tow:
            tow["programme"] = [[0, 0], [max(tow.get("ramp", 0), 1e-6), tow["speed"]]] if tow.get("ramp") else [
                [0, tow["speed"]]]
        for k in ("speed", "ramp"):
            tow.pop(k, None)
        for f in case["floes"]:
            f.pop("fixed", None)
            for k in ("vx", "vy"):
                f.setdefault(k, 0)
        if tow["mode"] != "speed":
            for k in ("vx", "vy"):
                case["body"].setdefault(k, 0)
        return case

    def of(self, case):
        speed, (u, v) = self.velocity(case)
        case = copy.deepcopy(case)
        for name, x, y in (("water", "current_x", "current_y"), ("air", "wind_x", "wind_y")):
            at = case.setdefault(name, {})
            at[x], at[y] = at.get(x, 0) + u, at.get(y, 0) + v
        for at in (case["body"], *case["floes"]):
            if "vx" in at:
                at["vx"] += u
                at["vy"] += v
        if "programme" in case["tow"]:
            case["tow"]["programme"] = [[t, s + speed] for t, s in case["tow"]["programme"]]
        self.shift = (u, v)
        return case

    def expected(self, r):
        return r | {"place": r["place"] + r["time"][:, None, None] * np.array(self.shift),
                    "speed": r["speed"] + np.array(self.shift)}


def result_of(folder, case, name):
    write_case(folder, case, f"{name}.yml")
    code, err = called(folder, "run", f"{name}.yml", "-o", name, "--quiet", "--threads", 1)
    if code == 3:
        raise Refused(err)
    assert code == 0, f"exit code {code}: {err}\n{text(case)}"
    with h5py.File(folder / name / "result.h5") as f:
        s = {k: v[:] for k, v in f["series"].items()}
        pose, time = f["frames/pose"][:], f["frames/time"][:]
    pair = lambda x, y: np.column_stack([s[x], s[y]])
    return {"place": pose[:, :, :2], "yaw": pose[:, :, 2], "time": time, "force": pair("ice_force_x", "ice_force_y"),
            "moment": s["ice_moment"], "speed": pair("body_vx", "body_vy"), "rate": s["body_yaw_rate"],
            "tow": s["tow_force"]}, s


def square(p, q):
    """Do two convex polygons have edges that face each other within 11.5 degrees (bt_contacts_parts: 0.98)?"""
    normals = []
    for v in (p, q):
        e = np.roll(v, -1, axis=0) - v
        normals.append(np.column_stack([e[:, 1], -e[:, 0]]) / np.hypot(*e.T)[:, None])
    return bool((normals[0] @ normals[1].T < -0.97).any())


def generic(case, folder, name):
    """Frames before two floes that are near have edges that face each other squarely. Which of the two edges is then
    the reference of the first contact is decided by the numbers of the floes, so results depend on them."""
    size, d = floe_size(case), case["domain"]
    with h5py.File(folder / name / "result.h5") as f:
        at, corners, pose = f["floes/offsets"][:], f["floes/vertices"][:], f["frames/pose"][:]
    own = [corners[at[k]:at[k + 1]] for k in range(len(at) - 1)]
    reach = np.array([np.hypot(*v.T).max() for v in own])
    box = [d[extent] if d[kind] == "periodic" else 1e9 * size for kind, extent in (("ends", "length"),
                                                                                   ("sides", "width"))]
    for n, now in enumerate(pose):
        gap = now[None, :, :2] - now[:, None, :2]
        gap = np.remainder(gap + np.divide(box, 2), box) - np.divide(box, 2)
        near = np.hypot(gap[..., 0], gap[..., 1]) < reach[:, None] + reach + 0.2 * size
        for i, j in zip(*np.nonzero(np.triu(near, 1))):
            p, q = placed(own[i], [0, 0, now[i, 2]]), placed(own[j], [*gap[i, j], now[j, 2]])
            if square(p, q) and overlap(p, q) > -0.2 * size:
                return n
    return len(pose)


def as_seen(table, folder, seed, parts, number, seen):
    """A scene, and the same as it is seen otherwise: what is farthest from what was expected."""
    case = by_hand(table, folder, seed, parts, number)
    if hasattr(seen, "prepared"):
        case = seen.prepared(case)
    one, series = result_of(folder, case, "one")
    balances(case, folder / "one")
    other, again = result_of(folder, seen.of(case), "other")
    frames = generic(case, folder, "one") if isinstance(seen, Renumbered) else len(one["time"])
    # A friction that is not unique, a step that is not solved, or one whose turns leave a corner in another floe, which
    # the projection finds or not by rounding: nothing can be said of what comes after it.
    for s in (series, again):
        left = np.append(s["overlap"][1:], 0) > 1e-4 * floe_size(case)
        unsolved = np.flatnonzero(s["unconverged"] + s["unprojected"] + s["restitution_cut"] + s["outrun"] + left)
        frames = min([frames, *(unsolved[:1] + 1)])
    steps = frames - 1
    cut = {k: v[:frames if k in ("place", "yaw", "time") else max(steps, 0)] for k, v in seen.expected(one).items()}
    found = {k: v[:frames if k in ("place", "yaw", "time") else max(steps, 0)] for k, v in other.items()}
    worst, what = apart(case, cut, found) if frames else (0, "")
    assert worst < ROUNDING, f"{what}: {worst} of its scale\n{text(case)}\n{text(seen.of(case))}"
    return "cut short" if frames < len(one["time"]) else "contacts" if series["contacts"].any() else "no contact"


def apart(case, one, other):
    """(quantity, share of its scale) of what is farthest from what was expected."""
    size = floe_size(case)
    speed = value_of(case, "solver.reference_speed")
    d = case["domain"]
    worst = []
    for k in one:
        if k == "time":
            continue
        x, y = one[k], other[k]
        gap = y - x
        if k == "place":
            for i, (kind, extent) in enumerate((("ends", "length"), ("sides", "width"))):
                if d[kind] == "periodic":
                    gap[..., i] = np.remainder(gap[..., i] + d[extent] / 2, d[extent]) - d[extent] / 2
            gap = gap / size
        elif k == "yaw":
            gap = np.remainder(gap + np.pi, 2 * np.pi) - np.pi
        elif k == "speed":
            gap = gap / speed
        elif k == "rate":
            gap = gap * size / speed
        else:
            gap = gap / max(np.nanmax(np.abs(x), initial=0), 1e-300)
        if gap.size:
            worst.append((float(np.nanmax(np.abs(gap), initial=0)), k))
    return max(worst)


# ---- what is tried ----

#: property -> (check, what an example has beside seed and parts)
PROPERTIES = {
    "same bits": (one_of_many, {"ways": legs}),
    "turned and mirrored": (as_seen, {"number": numbers, "seen": st.builds(Turned, st.integers(0, 3), st.booleans())}),
    "renumbered": (as_seen, {"number": st.integers(1, 30), "seen": st.builds(Renumbered, seeds)}),
    "passing": (as_seen, {"number": numbers, "seen": st.builds(Passing, st.floats(0.01, 2))}),
}


def hold(name, table, n, first=None):
    """A property on n examples, always the same for the same `first`; counts of what they were. One that the program
    refuses is none, and another takes its place."""
    check, what = PROPERTIES[name]
    tried = collections.Counter()

    @hypothesis.settings(max_examples=n, derandomize=first is None, database=None, deadline=None, print_blob=False,
                         suppress_health_check=list(hypothesis.HealthCheck))
    @hypothesis.given(st.fixed_dictionaries({"seed": seeds, "parts": kept, **what}))
    def example(e):
        with tempfile.TemporaryDirectory() as folder:
            try:
                tried[check(table, pathlib.Path(folder), **e)] += 1
            except Refused:
                tried["refused"] += 1
                hypothesis.reject()
            except AssertionError as wrong:
                if not tried["failed"]: # then hypothesis makes it smaller, for up to five minutes
                    print(f"{name}, as found: {e}: {str(wrong)[:300]}", flush=True)
                tried["failed"] += 1
                raise

    (example if first is None else hypothesis.seed(first)(example))()
    return tried
