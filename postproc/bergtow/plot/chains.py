# SPDX-License-Identifier: MIT
"""Force chains: the contact forces of one step as lines through the ice, with widths that show the force.

The contacts come from `bergtow run CASE -o RUN --dump-contacts STEP:FILE.h5`. A line goes from the centroid of one floe
through the contact point to that of the other, or ends at the contact point on a large body or a wall. Force = normal
impulse / time step, with the contact points of one pair of floes combined.
"""
from dataclasses import dataclass, replace
from pathlib import Path

from bergtow import arguments, writing
from bergtow.errors import RunError
from bergtow.plot import style
from bergtow.result.frames import place
from bergtow.result.run import Run

import h5py
import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import LogNorm

WIDEST = 5.0   # points
DECADES = 2.5  # decades below the largest force for which lines are drawn


@dataclass
class Contacts:
    time: float          #: s
    body: np.ndarray     #: [n, 2] ids
    normal: np.ndarray   #: [n, 2]
    lever: np.ndarray    #: [n, 2, 2] m, from each body's centroid to the contact point
    force: np.ndarray    #: [n] N, normal
    pose: np.ndarray     #: [N, 3]


def read(path):
    """The Contacts of a dumped step. Raises RunError."""
    try:
        with h5py.File(path, "r") as f:
            if "places" not in f or "solution" not in f:
                raise RunError(path, "does not give the places of its contacts",
                               "write it with --dump-contacts of this version")
            places = f["places"]
            dt = float(places.attrs["dt"])
            impulse, normal = f["solution/r"][()].reshape(-1, 2), places["normal"][()]
            # Floes that lie over each other have a separate kind of contact, without a normal.
            drawn = np.isnan(f["disc"][()]) if "disc" in f else np.ones(len(impulse), bool)
            return Contacts(float(places.attrs["time"]), places["body"][()][drawn], normal[drawn],
                            places["lever"][()].reshape(-1, 2, 2)[drawn], impulse[drawn, 0] / dt, places["pose"][()])
    except FileNotFoundError:
        raise RunError(path, "no such file",
                       "write it with `bergtow run CASE -o RUN --dump-contacts STEP:FILE.h5`") from None
    except (OSError, KeyError, ValueError) as error:
        raise RunError(path, f"is not a dumped contact problem ({str(error).splitlines()[0]})",
                       "write it with --dump-contacts") from None


def pairs(c):
    """The contacts of each pair of bodies combined: (body [m, 2], lever [m, 2, 2] at the centre of pressure, force
    [m]); pairs without force are left out."""
    some = c.force > 0
    body, lever, force = c.body[some], c.lever[some], c.force[some]
    unique, which = np.unique(body, axis=0, return_inverse=True)
    which = which.ravel()
    total = np.bincount(which, force, len(unique))
    centre = np.zeros((len(unique), 2, 2))
    np.add.at(centre, which, lever * force[:, None, None])
    return unique, centre / total[:, None, None] if len(unique) else centre, total


def segments(run, c):
    """(lines [k, 2, 2] m, force [k] N): from a floe's centroid to the contact; none on the side of a body that is not a
    floe."""
    body, lever, force = pairs(c)
    lines, values = [], []
    for side in (0, 1):
        floe = body[:, side] < run.n_floes
        start = run.wrap(c.pose[body[floe, side], :2])
        lines.append(np.stack([start, start + lever[floe, side]], axis=1))
        values.append(force[floe])
    return np.concatenate(lines), np.concatenate(values)


def outlines(run, c):
    """Floes and bodies at the end of the step: two lists of [n, 2] m."""
    pose = c.pose.copy()
    moves = [*range(run.n_floes), *(run.n_floes + k for k, b in enumerate(run.bodies) if b.towed)]
    pose[moves, :2] = run.wrap(pose[moves, :2])
    floes = [place(run.vertices[a:b], p) for a, b, p in zip(run.offsets[:-1], run.offsets[1:], pose)
             if np.isfinite(p[0])]
    bodies = [place(b.vertices, p) for b, p in zip(run.bodies, pose[run.n_floes:])]
    return floes, bodies


def with_images(run, shapes):
    """(copies of shapes [n, 2] m, the index of each) that reach into the domain: a shape that crosses a periodic end
    also appears at the other."""
    x0, x1, y0, y1 = run.box
    out, which = [], []
    for shift in run.images:
        for k, shape in enumerate(shapes):
            moved = np.asarray(shape) + shift
            if not shift.any() or (moved.max(axis=0) >= (x0, y0)).all() and (moved.min(axis=0) <= (x1, y1)).all():
                out.append(moved)
                which.append(k)
    return out, np.array(which, dtype=int)


def view(run, lines, bodies, whole):
    """(x0, x1, y0, y1) m: the domain, or the part of it around the towed body and the forces, with a margin of a tenth
    of its shorter side."""
    x0, x1, y0, y1 = run.box
    points = np.concatenate([lines.reshape(-1, 2)] + ([bodies[run.towed]] if run.towed is not None else []))
    if whole or not len(points):
        return run.box
    margin = 0.1 * min(x1 - x0, y1 - y0)
    low, high = np.maximum(points.min(axis=0) - margin, (x0, y0)), np.minimum(points.max(axis=0) + margin, (x1, y1))
    return low[0], high[0], low[1], high[1]


def joined(run, c):
    """The contacts with pieces of floes directly behind the floes, as a run stores them, NaN before they exist; a dump
    stores them behind the bodies. Raises RunError."""
    n, bodies = run.n_start, len(run.bodies)
    pieces = len(c.pose) - n - bodies
    if not 0 <= pieces <= run.n_pieces:
        raise RunError(run.path, f"has {n + bodies} bodies and {run.n_pieces} pieces of floes, the contacts are of "
                       f"{len(c.pose)}", "give the file that this run dumped")
    row = np.concatenate([np.arange(n), run.n_floes + np.arange(bodies), n + np.arange(pieces)])
    pose = np.full((run.n_floes + bodies, 3), np.nan)
    pose[row] = c.pose
    return replace(c, body=row[c.body], pose=pose)


def draw(run, c, whole=False):
    c = joined(run, c)
    lines, force = segments(run, c)
    floes, bodies = outlines(run, c)
    x0, x1, y0, y1 = view(run, lines, bodies, whole)
    across, up = (y1 - y0, x1 - x0) if run.geographic else (x1 - x0, y1 - y0)
    width = 11.0
    height = float(np.clip((width - 2.2) * up / across + 1.7, 4.0, 12.0))
    figure = style.Figure(figsize=(width, height))
    axes = figure.add_axes((0.7 / width, 0.6 / height, (width - 2.1) / width, (height - 1.5) / height))
    axes.set_facecolor(style.WATER)
    axes.add_collection(PolyCollection([run.on_page(p) for p in with_images(run, floes)[0]], facecolor="#dfe9ef",
                                       edgecolor="#8fa3b3", linewidth=0.5))
    for shape, k in zip(*with_images(run, bodies)):
        body = run.bodies[k]
        colour = style.BODY if body.towed else style.WALL if body.wall else style.FIXED
        axes.add_collection(PolyCollection([run.on_page(shape)], facecolor=colour, linewidth=0.8, zorder=2,
                                           edgecolor=style.BODY_EDGE if body.towed else colour))
    top = force.max(initial=0.0)
    if top > 0:
        lines, which = with_images(run, lines)
        lines, force = np.array(lines), force[which]
        least = top * 10 ** -DECADES
        seen = [k for k in np.argsort(force) if force[k] >= least]
        lines, force = lines[seen], force[seen]
        drawn = LineCollection(run.on_page(lines), array=force, cmap=style.FORCE_MAP, norm=LogNorm(least, top),
                               linewidths=np.maximum(WIDEST * (force / top) ** 0.5, 0.4), capstyle="round", zorder=3)
        axes.add_collection(drawn)
        factor, unit = style.scale([top], "N")
        bar = figure.add_axes(((width - 1.15) / width, 0.6 / height, 0.16 / width, (height - 1.5) / height))
        figure.colorbar(drawn, cax=bar, format=lambda v, _: f"{v / factor:g}", label=f"impulse / time step ({unit})")
    axes.set_aspect("equal")
    low, high = run.on_page([[x0, y0], [x1, y1]])
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel="y, east (m)" if run.geographic else "x (m)",
             ylabel="x, north (m)" if run.geographic else "y (m)")
    words = (f"{len(pairs(c)[2])} pairs with a force, largest {style.quantity(top, 'N')}; width by the root of the "
             f"force, none below {10 ** -DECADES:.1g} of the largest" if top > 0 else "no contact bears a force")
    figure.text(0.02, 1 - 0.14 / height, f"{style.title(run)}: force chains at {c.time:g} s", va="top", fontsize=13.5,
                fontweight="bold")
    figure.text(0.02, 1 - 0.42 / height, f"{style.conditions(run)}\n{words}", va="top", fontsize=10, color=style.FAINT)
    return figure


def options(p):
    p.add_argument("run", metavar="RUN", help="output folder of a run")
    p.add_argument("contacts", metavar="FILE.h5", type=Path, help="the file that --dump-contacts STEP:FILE.h5 of that "
                   "run wrote; without one, bergtow plot-field --colour force shows the largest force on each floe")
    p.add_argument("-o", "--output", metavar="FILE", type=Path, help="file to write (default: RUN/chains.png)")
    p.add_argument("--whole", action="store_true",
                   help="draw the whole domain (default: the part with the towed body and the forces)")
    arguments.add_force(p)


@style.look()
def perform(a):
    path = arguments.output(a, "chains.png", writing.PICTURES)
    with Run(a.run) as run:
        writing.save(draw(run, read(a.contacts), a.whole), path, a.force)
