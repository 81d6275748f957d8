# SPDX-License-Identifier: MIT
"""Cases drawn at random from the table of keys: draw(seed) gives one; judge.py says what is wrong with what the program
makes of it.

Every key of `bergtow --list-keys --json` stands in exactly one of three places: FREE (drawn by itself, log-uniform
within a sub-range of its range where a run still means something, now and then at a bound of the range), SCENE (drawn
with others, so that the case holds together), LEFT_OUT (with the reason). A new key has to be entered in one of them:
cli/test_random_cases.py compares. Enumerations are uniform. Fields are small: tens of floes.

A seed gives the same case for ever, as long as the tables are the same. For runs of another kind (ranks, threads,
kills, resumes) take `Draw` on a seed of their own, and leave the case alone.
"""
import json
import math
import random

STEPS = 50  # of the run that judge.py makes of a case

LEFT_OUT = {
    "tow.line.weight": "a line that sags breaks by its length; tests/cli/test_towing.py and a scene have it",
    "run.title": "text",
    "ice.drag.sheltering": "on by default; tests/cli/test_exposure.py and the scenes vary it",
    "guard.no_solution": "its default ends jams without a solution, and most of them within 50 steps",
    "reference.source": "text",
    "report.client": "text",
    "report.project": "text",
    "report.author": "text",
    "report.document": "text",
    "report.revision": "text",
    "report.distribution": "text",
    "run.threads": "said on the command line",
    "ice.field": "file",
    "ice.outlines": "file",
    "ice.outlines_crs": "of a file",
    "ice.origin_lon": "of a file",
    "ice.origin_lat": "of a file",
    "ice.origin_east": "of a file",
    "ice.origin_north": "of a file",
    "ice.nonconvex": "of a file",
    "water.current_table": "file",
    "air.wind_table": "file",
}

# Low, high; and the bounds of the range that are drawn, too: "" none, "l" the least, "m" the most, "lm" both. A bound
# is left out where it asks for hours (sweeps), or where no run can end well (a tolerance of 1, a wind of 100 m/s over
# floes of 10 cm).
FREE = {
    "domain.wall_friction": (1e-3, 1, "lm"),
    "domain.wall_restitution": (1e-2, 1, "lm"),
    "ice.density": (700, 1000, "lm"),
    "ice.friction": (1e-3, 1, "lm"),
    "ice.restitution": (1e-2, 1, "lm"),
    "ice.crushing.least_length": (1e-2, 10, "lm"),
    "ice.rafting.kappa": (2, 30, "l"),
    "ice.splitting.strength": (1e4, 1e6, "m"),
    "ice.splitting.generations": (1, 8, "lm"),
    "ice.splitting.aspect": (2, 10, "lm"),
    "ice.splitting.reserve": (1, 1000, "l"),
    "ice.splitting.scatter": (2, 30, "lm"),
    "ice.added_mass": (1e-2, 1, "lm"),
    "ice.added_inertia": (1e-2, 1, "lm"),
    "ice.drag.water_form": (0.01, 10, "lm"),
    "ice.drag.water_skin": (1e-4, 0.1, "lm"),
    "ice.drag.air_form": (0.01, 10, "l"),
    "ice.drag.air_skin": (1e-4, 0.1, "l"),
    "ice.drag.tangential": (0.01, 1, "l"),
    "ice.seed": (1, 1e6, "lm"),
    "ice.shake": (0.1, 100, "l"),
    "ice.thickness_spread": (0.01, 1, "l"),
    "body.density": (300, 2000, ""),
    "body.added_mass": (0.01, 2, "lm"),
    "body.added_inertia": (0.01, 2, "lm"),
    "body.friction": (1e-3, 1, "lm"),
    "body.restitution": (1e-2, 1, "lm"),
    "body.drag.water_form": (0.01, 10, "lm"),
    "body.drag.water_skin": (1e-5, 0.1, "lm"),
    "body.drag.air_form": (0.01, 10, "l"),
    "body.drag.air_skin": (1e-5, 0.1, "l"),
    "body.drag.tangential": (0.01, 1, "l"),
    "body.yaw": (1, 360, "lm"),
    "water.density": (900, 1100, "lm"),
    "air.density": (0.5, 2, "lm"),
    "water.tide.inclination": (1, 360, "lm"),
    "water.tide.phase": (1, 360, "lm"),
    "solver.tolerance": (1e-5, 1e-1, ""),
    "solver.max_sweeps": (10, 500, ""),
    "solver.inner_sweeps": (1, 10, "l"),
    "solver.cell_size": (2, 10, "lm"),
    "solver.plain": None,
    "solver.plain_schedule": None,
    "solver.warm_start": None,
    "solver.slop": (1e-5, 1e-2, "l"),
    "solver.position_sweeps": (10, 300, "l"),
    "solver.rest_speed": (1e-5, 1e-2, "lm"),
    "guard.overlap": (0.5, 100, "m"),
    "guard.energy": (1e3, 1e12, "m"),
    "guard.unconverged": (100, 1e9, "m"),
    "guard.escape": [True],
    "impact.conversion": None,
    "impact.corner": None,
    "impact.pressure": (1e4, 1e8, "m"),
    "impact.corner_angle": (10, 170, "m"),
    "impact.panels": (1, 100, "l"),
    "output.sample_every": (1, 60, "l"),
    "output.progress": (0.01, 100, "l"),
    "output.checkpoint_steps": (5, 60, "l"),
    "output.checkpoint_wall": (0.1, 600, "l"),
    "output.panels": None,
    "estimate.p_star": (1e2, 1e5, "lm"),
    "estimate.p_s": (1e2, 1e5, "lm"),
    "estimate.c_si": (0.1, 10, "lm"),
    "estimate.phi_j": (0.1, 1, "m"),
    "estimate.length_scale": (1, 100, "m"),
    "reference.mean_force": (1, 1e6, "lm"),
}

SCENE = set("""
run.dt run.duration domain.frame domain.length domain.width domain.x0 domain.y0 domain.ends domain.sides
domain.ends_closing domain.sides_closing domain.ahead ice.concentration ice.x_min ice.x_max ice.y_min ice.y_max
ice.extent.x_min ice.extent.x_max ice.extent.y_min ice.extent.y_max
ice.shape ice.sides ice.aspect ice.size ice.size_law ice.size_spread ice.size_min ice.size_max ice.size_exponent
ice.thickness ice.thickness_law ice.crushing.pressure ice.splitting.toughness ice.splitting.least_size ice.start
body.shape body.length body.width body.vertices body.x body.y body.vx body.vy body.yaw_rate body.draft body.sail
body.mass tow.mode tow.speed tow.direction tow.ramp tow.programme tow.waypoints tow.turn_radius tow.line_length
tow.line_stiffness tow.line_damping tow.hull_x tow.hull_y tow.line.type tow.line.diameter tow.line.branches
tow.line.breaking_load tow.branch2.hull_x tow.branch2.hull_y tow.branch2.length tow.branch2.stiffness
tow.branch2.damping tow.branch2.breaking_load tow.vessel.mass tow.vessel.added_mass tow.vessel.bollard_pull
tow.vessel.free_speed tow.vessel.free_resistance tow.vessel.lateral_drag tow.vessel.lookahead lead.mode lead.width
lead.length lead.floe_size water.current_x water.current_y water.tide.major water.tide.minor water.tide.period
water.latitude water.tilt water.slope_x water.slope_y air.wind_x air.wind_y solver.reference_speed impact.duration
impact.least_speed output.frame_interval output.window_start estimate.kappa estimate.kappa_low estimate.kappa_high
""".split())


class Draw:
    """Draws from one stream; numbers of six digits, which a person can read."""

    def __init__(self, seed):
        self.rng = random.Random(seed)

    def flat(self, low, high):
        return float(f"{self.rng.uniform(low, high):.6g}")

    def log(self, low, high):
        return float(f"{math.exp(self.rng.uniform(math.log(low), math.log(high))):.6g}")

    def sign(self, value):
        return self.rng.choice((-1, 1)) * value

    def one(self, values):
        return self.rng.choice(list(values))

    def chance(self, p):
        return self.rng.random() < p


def free_value(d, key, spec):
    """A value of a key that stands by itself."""
    if key["type"] == "bool":
        return d.one(spec or (True, False))
    if key["type"] == "choice":
        return d.one(spec or key["choices"])
    low, high, bounds = spec
    if bounds and d.chance(0.04):
        bound = key["least" if d.one(bounds) == "l" else "most"]
        return int(bound) if key["type"] == "integer" else bound
    value = min(d.log(low, high), key["most"])
    if key["type"] == "integer":
        return int(round(value))
    return d.sign(value) if key["least"] < 0 else value


def polygon(d, size):
    """Convex and anticlockwise: points on an ellipse, none too near the next."""
    n, squeeze = d.one(range(3, 13)), d.flat(0.4, 1)
    angles = [2 * math.pi * (k + d.flat(-0.3, 0.3)) / n for k in range(n)]
    return [[float(f"{0.5 * size * math.cos(a):.6g}"),
             float(f"{0.5 * size * squeeze * math.sin(a):.6g}")] for a in angles]


class Scene:
    """What a case is made of, as a map of dotted keys."""

    def __init__(self, d, choices):
        self.d, self.choices, self.value, self.floes = d, choices, {}, []
        self.size = d.log(0.2, 60)
        self.place_domain()
        self.drive()
        self.clock()
        self.fill_with_ice()
        self.tow()
        self.surround()
        self.lead()
        self.close_walls()
        self.by_hand()
        self.rest()

    def choose(self, key, but=()):
        self.value[key] = self.d.one(c for c in self.choices[key] if c not in but)
        return self.value[key]

    def outline(self, shape, length):
        """Keys of an outline, and the radius of a circle about the centroid that holds it."""
        d = self.d
        if shape == "polygon":
            return {"vertices": polygon(d, length)}, length
        if shape in ("rectangle", "ship"):
            width = d.flat(0.25, 1) * length
            return {"length": length, "width": width}, 0.55 * math.hypot(length, width)
        return {"length": length}, length * (0.71 if shape == "square" else 0.5)

    def place_domain(self):
        d, v, size = self.d, self.value, self.size
        v["domain.frame"] = d.one(self.choices["domain.frame"])
        shape = self.choose("body.shape")
        self.body_length, self.radius = size * d.log(0.6, 4), 0
        v["body.length"] = self.body_length
        if shape != "none":
            keys, self.radius = self.outline(shape, self.body_length)
            v.update({f"body.{k}": x for k, x in keys.items()})
        ends, sides = self.choose("domain.ends"), self.choose("domain.sides")
        self.mode = self.choose("tow.mode") if shape != "none" else "none"
        v["tow.mode"] = self.mode
        if ends == "moving" and self.mode == "none":
            ends = v["domain.ends"] = d.one(("wall", "periodic", "open"))
        self.ends, self.sides = ends, sides
        # Of floes, whatever their law: twice the mean diameter, and an aspect.
        self.aspect = d.log(1, 3)
        floe = size * (1 + 0.3 * self.aspect)
        least = 2.5 * (self.radius + floe)
        self.width = max(d.flat(4, 9) * size, least if sides == "periodic" else 2.5 * self.radius)
        self.length = max(d.flat(6, 12) * size, least if ends in ("periodic", "moving") else 5 * self.radius)
        if ends == "moving":
            self.length = max(self.length, d.flat(2.6, 3.2) * (self.radius + 4.5 * size))
        self.way = d.one((1, 1, -1)) # of the tow along x
        self.x0 = -self.length / 2 if v["domain.frame"] == "geographic" else 0
        self.y0 = -self.width / 2
        if d.chance(0.2):
            self.x0 = v["domain.x0"] = d.flat(-10, 10) * self.length
            self.y0 = v["domain.y0"] = d.flat(-10, 10) * self.width
        v["domain.length"], v["domain.width"] = self.length, self.width
        self.x, self.y = self.x0 + d.flat(0.3, 0.6) * self.length, self.y0 + 0.5 * self.width
        if ends == "moving": # and the default of its ends in the geographic frame is about the body
            v["domain.x0"] = self.x0
            self.x = self.x0 + 0.5 * self.length
        slack = 0.45 * self.width - self.radius
        if slack > 0:
            self.y += d.flat(-slack, slack)
        if shape != "none":
            v["body.x"], v["body.y"] = self.x, self.y
            v["body.draft"] = self.body_length * d.log(0.05, 1)
            if d.chance(0.3):
                v["body.sail"] = self.body_length * d.log(0.01, 0.5)
            self.mass = 700 * (1.5 * self.radius) ** 2 * v["body.draft"]
            if d.chance(0.3):
                self.mass = v["body.mass"] = self.mass * d.log(0.1, 10)

    def drive(self):
        """Speeds of the scene: tow, current, wind."""
        d, v = self.d, self.value
        self.speed = min(3, self.size * d.log(0.01, 0.5))
        most = self.speed
        if d.chance(0.4):
            share = 0.4 if self.ends == "moving" else 2
            for key in ("water.current_x", "water.current_y"):
                v[key] = d.sign(self.speed * d.log(0.01, share))
                most = max(most, abs(v[key]))
        if d.chance(0.25):
            v["water.tide.major"] = self.speed * d.log(0.01, 0.5 if self.ends == "moving" else 2)
            v["water.tide.minor"] = d.sign(v["water.tide.major"] * d.flat(0, 1))
            most = max(most, v["water.tide.major"])
        if d.chance(0.4):
            for key in ("air.wind_x", "air.wind_y"):
                v[key] = d.sign(d.log(0.1, 20))
                most = max(most, 0.03 * abs(v[key]))
        self.most = most

    def clock(self):
        d, v = self.d, self.value
        dt = v["run.dt"] = self.size / self.most * d.log(0.003, 0.5 if d.chance(0.1) else 0.1)
        self.duration = v["run.duration"] = dt * round(d.log(STEPS, 8 * STEPS))
        if "water.tide.major" in v and d.chance(0.7):
            v["water.tide.period"] = max(20 * dt, self.duration * d.log(0.1, 100)) # at least 20 steps

    def fill_with_ice(self):
        d, v, size = self.d, self.value, self.size
        v["ice.size"], v["ice.thickness"] = size, min(100, size * d.log(0.005, 0.3))
        v["ice.concentration"] = d.flat(0.05, 0.85)
        if d.chance(0.1):
            v["ice.concentration"] = d.one((0, 0.9, 0.95))
        if self.choose("ice.shape") == "rectangles":
            v["ice.aspect"] = self.aspect
        if v["ice.shape"] == "polygons": # which do not tile the plane
            if d.chance(0.9):
                v["ice.concentration"] = min(v["ice.concentration"], d.flat(0.4, 0.6))
            v["ice.sides"] = d.one((3, 4, 5, 6, 8, 12, 32))
        law = self.choose("ice.size_law")
        if law == "power":
            v["ice.size_min"], v["ice.size_max"], v["ice.size_exponent"] = size * d.flat(0.4, 0.8), size * d.flat(
                1, 1.8), d.flat(0.5, 4)
            del v["ice.size"] # without effect, and refused
        elif d.chance(0.7):
            v["ice.size_spread"] = d.flat(0, 0.4)
        self.choose("ice.thickness_law")
        # A quarter of the cases crush: from what gives way at once to what never does.
        if d.chance(0.25):
            v["ice.crushing.pressure"] = d.log(1e2, 1e7)
        if self.ends != "moving" and d.chance(0.25):
            v["ice.splitting.toughness"] = d.log(1e1, 1e5)
            v["ice.splitting.least_size"] = size * d.flat(0.1, 0.38)

    def room(self):
        """Way that the body has before a wall, m."""
        x = min(self.x - self.x0, self.x0 + self.length - self.x) if self.ends == "wall" else math.inf
        y = min(self.y - self.y0, self.y0 + self.width - self.y) if self.sides == "wall" else math.inf
        return min(x, y) - self.radius

    def tow(self):
        d, v = self.d, self.value
        v["tow.speed"] = 0
        if self.mode == "none":
            if v["body.shape"] != "none" and d.chance(0.5):
                self.kick()
            return
        # Along the domain there is room; across it, and on a bent way, what the nearest wall leaves.
        along = d.chance(0.6) or self.ends == "moving"
        bent = d.chance(0.25)
        ahead = (self.x0 + self.length - self.x if self.way > 0 else self.x -
                 self.x0) - self.radius if self.ends == "wall" else math.inf
        back = 0 if self.way > 0 else 180
        angle = back + d.flat(-8, 8) if along else d.flat(-180, 180)
        free = ahead if along and not bent and self.sides != "wall" else self.room()
        if along and not bent and self.sides == "wall":
            angle, free = back, ahead
        speed = min(self.speed, max(0, 0.8 * free) / self.duration)
        ramp = self.duration * d.log(0.01, 0.5) if d.chance(0.8) else 0
        if d.chance(0.25) and speed > 0:
            times = sorted({0, ramp, self.duration * d.flat(0.2, 0.9), self.duration})
            v["tow.programme"] = [[t, speed * d.one((0, 0.5, 1)) if k else 0] for k, t in enumerate(times)]
            v["tow.programme"][-1][1] = speed
            del v["tow.speed"]
        else:
            v["tow.speed"], v["tow.ramp"] = speed, ramp
        self.angle, self.tow_speed = math.radians(angle), speed
        if self.mode in ("line", "thrust"):
            self.line()
        if bent:
            self.way_points()
        else:
            v["tow.direction"] = angle
        if self.mode == "line" and d.chance(0.3):
            self.kick()
        if self.mode == "thrust":
            self.vessel()

    def kick(self):
        d, v = self.d, self.value
        v["body.vx"], v["body.vy"] = d.sign(self.speed * d.log(0.01, 1)), d.sign(self.speed * d.log(0.01, 1))
        v["body.yaw_rate"] = max(-360, min(360, d.sign(math.degrees(self.speed / self.radius) * d.log(0.01, 1))))

    def way_points(self):
        d, v = self.d, self.value
        at = [self.x, self.y]
        angle = self.angle
        step = v.get("tow.line_length", 0) + 2 * self.radius
        legs, points = d.one((1, 2, 3)), []
        for k in range(legs):
            way = self.duration * max(self.tow_speed, 0.1 * self.speed) * d.flat(0.2, 1) + (step if k == 0 else 0)
            at = [at[0] + way * math.cos(angle), at[1] + way * math.sin(angle)]
            points.append(at)
            angle += math.radians(d.flat(-20, 20) if self.ends == "moving" else d.flat(-100, 100))
        v["tow.waypoints"] = points
        if d.chance(0.4):
            v["tow.turn_radius"] = 0.05 * self.duration * self.speed * d.flat(0, 1)

    def line(self):
        d, v = self.d, self.value
        two = d.chance(0.4)
        length = v["tow.line_length"] = self.body_length * d.log(1.5, 15)
        kind = self.choose("tow.line.type")
        # As stiff as makes periods of 1 to 300 steps.
        k = self.mass * (2 * math.pi / (v["run.dt"] * d.log(1, 300))) ** 2
        if kind == "numbers":
            v["tow.line_stiffness"] = min(1e12, k * length)
        else:
            v["tow.line.diameter"] = d.log(5e-3, 0.15)
        v["tow.line_damping"] = 2 * math.sqrt(k * self.mass) * d.log(1e-3, 1)
        v["tow.line.branches"] = 2 if two else 1
        pull = min(1e11, k * length)
        if d.chance(0.5):
            v["tow.line.breaking_load"] = pull * d.log(1e-5, 1)
        inside = 0.3 * self.radius
        if d.chance(0.3):
            v["tow.hull_x"], v["tow.hull_y"] = d.flat(-inside, inside), d.flat(-inside, inside)
        if two and d.chance(0.5):
            v["tow.branch2.length"], v["tow.branch2.stiffness"], v["tow.branch2.damping"] = length * d.flat(
                0.9, 1.3), pull * d.log(0.1, 10), v["tow.line_damping"] * d.log(0.1, 10)
            v["tow.branch2.breaking_load"] = pull * d.log(1e-5, 1)
            v["tow.branch2.hull_x"], v["tow.branch2.hull_y"] = d.flat(-inside, inside), d.flat(-inside, inside)

    def vessel(self):
        d, v = self.d, self.value
        v["tow.vessel.mass"] = self.mass * d.log(0.05, 10)
        v["tow.vessel.bollard_pull"] = min(1e9, self.mass * self.speed / (v["run.dt"] * d.log(3, 300)))
        v["tow.vessel.free_speed"] = min(50, self.speed * d.log(0.5, 10))
        if d.chance(0.5):
            v["tow.vessel.added_mass"], v["tow.vessel.lateral_drag"] = d.log(0.01, 1), d.log(1, 100)
        if d.chance(0.5):
            v["tow.vessel.free_resistance"] = v["tow.vessel.bollard_pull"] * d.flat(0, 1)
        if d.chance(0.5):
            v["tow.vessel.lookahead"] = v["tow.line_length"] * d.log(0.3, 5)

    def surround(self):
        d, v = self.d, self.value
        if d.chance(0.5):
            v["water.latitude"] = d.sign(d.log(1, 90))
        tilt = self.choose("water.tilt", () if "water.latitude" in v else ("geostrophic",))
        if tilt == "slope":
            v["water.slope_x"], v["water.slope_y"] = d.sign(d.log(1e-7, 1e-3)), d.sign(d.log(1e-7, 1e-3))

    def lead(self):
        d, v = self.d, self.value
        if self.mode == "none" or self.tow_speed == 0 or d.chance(0.6):
            return
        mode = self.choose("lead.mode")
        if mode != "none":
            if d.chance(0.5):
                v["lead.width"] = self.body_length * d.log(0.5, 2)
            if d.chance(0.5):
                v["lead.length"] = self.length * d.log(0.05, 1)
            if self.ends == "moving": # beyond its front a lead has to lie along x
                v["lead.length"] = min(v.get("lead.length", self.length), 0.45 * self.length)
            if mode == "managed":
                v["lead.floe_size"] = self.size * d.flat(0.3, 1)

    def close_walls(self):
        d, v = self.d, self.value
        for name, bound, extent in (("ends", self.ends, self.length), ("sides", self.sides, self.width)):
            if bound != "wall" or self.ends == "moving" or d.chance(0.7):
                continue
            free = 0.4 * extent if v["body.shape"] == "none" else 0.15 * max(0, self.room())
            if self.mode == "speed":
                free = 0 # on its way it may come near a wall that is not there yet
            v[f"domain.{name}_closing"] = min(10, free / self.duration * d.flat(0, 1))

    def by_hand(self):
        """Floes given by hand, in a part of the domain that the field leaves free; circles apart from each other, the
        body and the walls."""
        d, v = self.d, self.value
        alone = d.chance(0.3) or self.ends == "moving"
        split = self.x0 + (0 if alone else 0.65) * self.length
        if d.chance(0.3):
            # No room is kept for them, only for the ice: it ends where they begin.
            if alone:
                v["ice.concentration"] = 0
            else:
                v["ice.x_max"] = split
        else:
            if d.chance(0.15):
                v["ice.x_min"], v["ice.x_max"] = self.x0 + d.flat(0.01, 0.2) * self.length, self.x0 + d.flat(
                    0.7, 0.99) * self.length
                v["ice.y_min"], v["ice.y_max"] = self.y0 + d.flat(0.01, 0.2) * self.width, self.y0 + d.flat(
                    0.7, 0.99) * self.width
            if d.chance(0.15): # the field of a wider or longer domain, cut to this one
                v["ice.extent.x_min"] = self.x0 - d.flat(0, 0.3) * self.length
                v["ice.extent.x_max"] = self.x0 + d.flat(1, 1.3) * self.length
                v["ice.extent.y_min"] = self.y0 - d.flat(0, 0.3) * self.width
                v["ice.extent.y_max"] = self.y0 + d.flat(1, 1.3) * self.width
            return
        taken = [(self.x, self.y, self.radius)] if self.radius else []
        for _ in range(d.one(range(1, 7))):
            shape = d.one(self.floe_shapes())
            keys, radius = self.outline(shape, self.size * d.log(0.3, 1.5))
            low = split + (radius + (0 if alone else 1.6 * self.size))
            high = self.x0 + self.length - radius
            bottom, top = self.y0 + radius, self.y0 + self.width - radius
            if low >= high or bottom >= top:
                continue
            x, y = d.flat(low, high), d.flat(bottom, top)
            if any(math.hypot(x - a, y - b) < radius + r for a, b, r in taken):
                continue
            taken.append((x, y, radius))
            floe = {"shape": shape, "x": x, "y": y, "yaw": d.flat(-180, 180), **keys}
            if d.chance(0.5):
                floe |= {"vx": d.sign(self.speed * d.log(0.01, 1)), "vy": d.sign(self.speed * d.log(0.01, 1)),
                         "yaw_rate": max(-360, min(360, d.sign(math.degrees(self.speed / radius) * d.log(0.01, 1))))}
            if d.chance(0.3):
                floe["thickness"] = min(100, self.size * d.log(0.005, 0.5))
            if d.chance(0.2) and self.ends != "moving" and self.mode != "speed" and not any(f"domain.{n}_closing" in v
                                                                                            for n in ("ends", "sides")):
                floe = {k: x for k, x in floe.items() if k not in ("vx", "vy", "yaw_rate")} | {"fixed": True}
            self.floes.append(floe)

    def floe_shapes(self):
        return [s for s in self.choices["body.shape"] if s != "none"]

    def rest(self):
        d, v, dt = self.d, self.value, self.value["run.dt"]
        if v["domain.frame"] == "basin" and self.ends == "moving" and self.x == self.x0 + 0.5 * self.length and not {
                "tow.waypoints", "lead.mode"
        } & set(v):
            v["domain.ahead"] = 0.5 * self.length # says where the body stands
            del v["body.x"]
        low, middle, high = sorted(d.flat(1, 30) for _ in range(3))
        v["estimate.kappa_low"], v["estimate.kappa"], v["estimate.kappa_high"] = low, middle, high
        for key, value in (("solver.reference_speed", self.most * d.log(0.1, 10)),
                           ("impact.duration", dt * d.log(0.01, 10)), ("impact.least_speed",
                                                                       self.speed * d.log(1e-3, 1)),
                           ("output.frame_interval", self.duration * d.log(0.01, 2)), ("output.window_start",
                                                                                       self.duration * d.flat(0, 0.9))):
            if d.chance(0.3):
                v[key] = value


def idle(values):
    """Keys without effect beside the others."""
    if values["ice.thickness_law"] == "constant":
        yield "ice.thickness_spread"
    if "ice.crushing.pressure" not in values:
        yield "ice.crushing.least_length"
    if "ice.splitting.toughness" not in values:
        yield from ("ice.splitting.strength", "ice.splitting.generations", "ice.splitting.aspect",
                    "ice.splitting.reserve", "ice.splitting.scatter")
    if "water.tide.major" not in values:
        yield from ("water.tide.inclination", "water.tide.phase")
    conversion = values.get("impact.conversion", "duration")
    if conversion != "duration":
        yield "impact.duration"
    if conversion != "crushing":
        yield from ("impact.pressure", "impact.corner", "impact.corner_angle")
    if conversion == "none":
        yield "impact.least_speed"
    if "wall" not in (values["domain.ends"], values["domain.sides"]):
        yield from ("domain.wall_friction", "domain.wall_restitution")
    if values["body.shape"] == "polygon":
        yield from ("body.length", "body.width")
    if values["body.shape"] == "none":
        yield from (key for key in list(values) if key.startswith("body.") and key != "body.shape")
    if values["tow.mode"] == "none":
        yield "tow.ramp"


def draw(seed, table):
    """The case of a seed as a nested map; table: what --list-keys --json prints."""
    d = Draw(seed)
    keys = {k["name"]: k for k in table["keys"]}
    scene = Scene(d, {k["name"]: k["choices"] for k in table["keys"] if k["type"] == "choice"})
    values = dict(scene.value)
    for name, spec in FREE.items():
        if d.chance(0.35):
            values[name] = free_value(d, keys[name], spec)
    values["ice.start"] = d.one(keys["ice.start"]["choices"]) # last: the draws of before stay
    if "ice.splitting.toughness" in values:  # must be equal then
        values["ice.added_inertia"] = values["ice.added_mass"] = values.get("ice.added_mass", 0.0)
    for key in idle(values): # without effect, and refused
        values.pop(key, None)
    case = {}
    for name, value in values.items():
        *sections, key = name.split(".")
        at = case
        for section in sections:
            at = at.setdefault(section, {})
        at[key] = float(f"{value:.6g}") if isinstance(value, float) else value
    if scene.floes:
        case["floes"] = scene.floes
    return case


def text(case):
    """JSON is YAML: what is printed can be pasted into a file."""
    return json.dumps(case, indent=1) + "\n"


def flat(case, path=""):
    """(dotted key, value) of all keys but the floes given by hand."""
    for key, value in case.items():
        if isinstance(value, dict):
            yield from flat(value, f"{path}{key}.")
        elif key != "floes":
            yield path + key, value


def value_of(case, name, otherwise=None):
    for part in name.split("."):
        case = case.get(part, {})
    return otherwise if case == {} else case
