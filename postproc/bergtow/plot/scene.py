# SPDX-License-Identifier: MIT
"""The ice field of one frame on one set of axes: water, floes, towed body, walls; for bergtow plot-field and bergtow
film.

Orientation. The basin frame is drawn as it is: x to the right, y upwards. The geographic frame (x north, y east) is
drawn as a map: the horizontal axis is y, the vertical axis is x.

A view is (x0, x1, y0, y1) in m of the world frame, or relative to the towed body when the scene follows it.
"""
import numpy as np
from matplotlib import patheffects
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import Normalize, PowerNorm
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from matplotlib.ticker import MaxNLocator

from bergtow.errors import RunError
from bergtow.plot import style
from bergtow.result import overlaps as rafted
from bergtow.result.frames import place

COLOURS = ("speed", "force", "thickness", "generation")


class Colouring:
    """The quantity that colours the floes: values of a frame, colour map, limits over the frames shown, label."""

    def __init__(self, run, kind, frames):
        self.run, self.kind = run, kind
        samples = np.concatenate([self._raw(i) for i in frames]) if run.n_floes else np.zeros(1)
        samples = samples[np.isfinite(samples)]
        unit = {"speed": "m/s", "force": "N", "thickness": "m", "generation": "1"}[kind]
        power, self.extend = 1.0, "neither"
        if kind == "generation":
            low, high = 0.0, max(1.0, float(run.generation.max(initial=0)))
        elif kind == "thickness":
            low, high = float(samples.min()), float(samples.max())
            if high - low < 1e-9 * high:  # uniform thickness: use the white end of the map
                low, high = 0.0, high
        else:
            # A few collisions are far above the rest; on a scale up to the maximum everything else would seem at rest.
            moving = samples[samples > 0]
            high = float(np.percentile(moving, 99)) if len(moving) else 1.0
            low = 0.0
            if kind == "speed" and run.value("tow.speed", 0) > 0:
                high = run.value("tow.speed")
            if kind == "force":
                power = 0.5
            if samples.max() > high:
                self.extend = "max"
        self.factor, unit = style.scale([high], unit) if kind == "force" else (1.0, unit)
        low, high = low / self.factor, (high or 1.0) / self.factor
        self.norm = Normalize(low, high, clip=True) if power == 1.0 else PowerNorm(power, low, high, clip=True)
        self.cmap = {"speed": style.SPEED_MAP, "force": style.FORCE_MAP}.get(kind, style.THICKNESS_MAP)
        self.label = {"speed": f"floe speed ({unit})", "force": f"largest contact force on the floe ({unit})",
                      "thickness": f"ice thickness ({unit})", "generation": "splits that made the floe"}[kind]

    def _raw(self, frame):
        if self.kind in ("thickness", "generation"):
            return getattr(self.run, self.kind)
        return self.run.speed(frame) if self.kind == "speed" else self.run.least_contact_force(frame)

    def values(self, frame):
        """[N] in the units of the label."""
        return self._raw(frame) / self.factor

    def bar(self, figure, mappable, cax, orientation="vertical"):
        bar = figure.colorbar(mappable, cax=cax, orientation=orientation, extend=self.extend,
                              extendfrac=0.03, label=self.label)
        bar.outline.set(linewidth=0.6, edgecolor=style.FAINT)
        bar.ax.tick_params(length=3)
        if self.kind == "force":
            ticks = _round_steps(self.norm.vmax)
            bar.set_ticks(ticks, labels=[f"{t:g}" for t in ticks])
        if self.kind == "generation":
            bar.locator = MaxNLocator(integer=True)
            bar.update_ticks()
        return bar


def _round_steps(top):
    """Four or five round numbers from 0 to top, well separated on a square-root scale."""
    ticks = {0.0}
    for fraction in (0.05, 0.2, 0.5, 1.0):
        step = 10 ** np.floor(np.log10(top * fraction))
        ticks.add(float(np.floor(top * fraction / step + 1e-9) * step))
    return sorted(ticks)


def tow_heading(run, time=0.0):
    """Unit vector (x, y) of the current leg of the towing end, or None for a drifting body."""
    if run.towed is None or run.case.get("tow.mode") == "none":
        return None
    passed = sum(e["kind"] == "waypoint" and e["time_s"] <= time for e in run.events)
    return run.headings[min(passed, len(run.headings) - 1)]


def body_size(run):
    """Largest extent of the towed body, m; 0 without one."""
    if run.towed is None:
        return 0.0
    return 2 * float(np.hypot(*run.bodies[run.towed].vertices.T).max())


def view_whole(run):
    """The domain with a margin that shows the walls."""
    x0, x1, y0, y1 = run.box
    margin = 0.02 * max(x1 - x0, y1 - y0) if any(b.wall for b in run.bodies) else 0.0
    margin = min(margin, 0.08 * min(x1 - x0, y1 - y0))
    px, py = run.period
    mx, my = (0.0 if px else margin), (0.0 if py else margin)
    return x0 - mx, x1 + mx, y0 - my, y1 + my


def needs_window(run):
    """Is the domain too long, or the body too small in it, for a picture of the whole?"""
    x0, x1, y0, y1 = run.box
    long, short = max(x1 - x0, y1 - y0), min(x1 - x0, y1 - y0)
    return run.towed is not None and (long > 12 * short or long > 60 * body_size(run))


def view_body(run):
    """A window that follows the body: 20 bodies long or more, 9 wide, or the domain's size; more behind than ahead."""
    x0, x1, y0, y1 = run.box
    size, heading = body_size(run), tow_heading(run)
    heading = np.array([1.0, 0.0]) if heading is None else heading
    along_x = abs(heading[0]) >= abs(heading[1])
    reach = np.array([20.0, 9.0] if along_x else [9.0, 20.0]) * size
    reach = np.minimum(reach, 1.04 * np.array([x1 - x0, y1 - y0]))
    along, across = (0, 1) if along_x else (1, 0)
    reach[along] = min(max(reach[along], 3.4 * reach[across]), (x1 - x0, y1 - y0)[along])
    shift = -0.15 * heading * reach
    left, right = shift[0] - reach[0] / 2, shift[0] + reach[0] / 2
    if run.case.get("domain.ends") == "moving":  # ice beyond that distance comes from the other end of the domain
        ahead = run.value("domain.ahead", (x1 - x0) / 2)
        low, high = (x1 - x0 - ahead, ahead) if heading[0] >= 0 else (ahead, x1 - x0 - ahead)
        left, right = max(left, -low), min(right, high)
    return left, right, shift[1] - reach[1] / 2, shift[1] + reach[1] / 2


def framed(run, window):
    """(does the view follow the towed body, the view) for a --window. Raises RunError."""
    follow = window == "body" or (window == "auto" and needs_window(run))
    if follow and run.towed is None:
        raise RunError(run.result, "has no towed body", "use --window whole")
    return follow, view_body(run) if follow else view_whole(run)


def add_options(p):
    p.add_argument("--colour", "--color", choices=COLOURS, default="speed",
                   help="quantity that colours the floes (default: speed)")
    p.add_argument("--window", choices=("auto", "whole", "body"), default="auto",
                   help="draw the whole domain, or a window that moves with the body (default: auto, the body in long "
                   "domains)")


def tow_line(run, frame, position):
    """[n, 2] m: hull, towing end and, with two branches, hull again, for a towed body at a position; only the towing
    end if all branches have broken. None without a line."""
    at = run.frame_times[frame]
    needed = {"carriage_x", "carriage_y", "body_x", "body_y"}
    if run.case.get("tow.mode") not in ("line", "thrust") or not needed <= set(run.series_names):
        return None
    sample = max(int(np.searchsorted(run["time"], at * (1 + 1e-9), side="right")) - 1, 0)
    if sample >= len(run["time"]):
        return None
    end, points = position + [run[f"carriage_{k}"][sample] - run[f"body_{k}"][sample] for k in "xy"], []
    broken = {e["subject"]: e["time_s"] for e in run.events if e["kind"] == "line_broken"}
    for branch, name in enumerate(("tow.", "tow.branch2.")[:1 + (run.case.get("tow.line.branches") == "2")]):
        if broken.get(branch + 1, np.inf) > at:
            hull, = place([[run.value(name + "hull_x", 0.0), run.value(name + "hull_y", 0.0)]],
                          [*position, run.body_pose(frame)[run.towed, 2]])
            points += [hull] if points else [hull, end]
    return np.array(points or [end])


class Scene:
    """Artists of the ice field on one set of axes. view: (x0, x1, y0, y1) m; follow: the view and the axes are relative
    to the towed body; animated: artists are left out of the figure's own drawing (for blitting)."""

    def __init__(self, axes, run, colouring, view, follow=False, animated=False):
        self.axes, self.run, self.colouring, self.follow = axes, run, colouring, follow
        x0, x1, y0, y1 = run.box
        # everything within half a period of it is shown
        self._middle = np.array([view[0] + view[1], view[2] + view[3]]) / 2
        view = run.on_page(np.array([[view[0], view[2]], [view[1], view[3]]]))
        axes.set_xlim(*view[:, 0])
        axes.set_ylim(*view[:, 1])
        axes.set(aspect="equal", facecolor=style.WATER if run.period[0] or run.period[1] or follow else style.PAPER)
        for spine in axes.spines.values():
            spine.set_visible(False)
        relative = " from the body" if follow else ""
        names = (f"y east{relative} (m)", f"x north{relative} (m)") if run.geographic else \
            (f"x{relative} (m)", f"y{relative} (m)")
        wide, high = view[1] - view[0]
        axes.xaxis.set_major_locator(MaxNLocator(9 if wide > 2 * high else 5, steps=(1, 2, 5, 10)))
        axes.yaxis.set_major_locator(MaxNLocator(9 if high > 2 * wide else 5, steps=(1, 2, 5, 10)))
        axes.set(xlabel=names[0], ylabel=names[1])

        # Walls are endless along a periodic direction. The towed body and its line extend across a seam, but in a view
        # that follows the body not across the ends of a moving window.
        self._images = run.images
        self._towed = [a for a in self._images if not (follow and a[0] and run.case.get("domain.ends") == "moving")]
        self._corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
        middle = self._corners.mean(axis=0)
        #: the water, extended without end along periodic directions
        self._sea = middle + (self._corners - middle) * np.where(np.array(run.period) > 0, 1e3, 1.0)
        kept = dict(animated=animated)
        self._water = Polygon(run.on_page(self._corners), closed=True, facecolor=style.WATER, edgecolor="none",
                              zorder=0, **kept)
        width_pt = axes.get_window_extent().width * 72 / axes.figure.dpi
        floe_pt = np.sqrt(run.area.mean()) / wide * width_pt if run.n_floes else 10
        self._floes = PolyCollection([], cmap=colouring.cmap, norm=colouring.norm, edgecolors=style.WATER,
                                     linewidths=float(np.clip(0.035 * floe_pt, 0.1, 0.6)), zorder=2, **kept)
        self.rafted = False  #: do floes in the current frame lie over each other?
        self._rafted = PolyCollection([], facecolors=style.RAFTED, linewidths=0, zorder=2.5, **kept)
        self._rafts = run.value("ice.rafting.kappa", 0) > 0
        for collection in (self._floes, self._rafted):
            collection.set_rasterized(run.n_floes > style.MANY / 6)
        self.cracked = False  #: have floes split since the frame before the current one?
        self._cracks = LineCollection([], colors=style.CRACK, linewidths=float(np.clip(0.12 * floe_pt, 0.8, 2.0)),
                                      zorder=2.7, **kept)
        self._solid = PolyCollection([], zorder=4, linewidths=0, **kept)
        self._solid.set_facecolors([style.WALL if b.wall else style.FIXED for b in run.bodies if not b.towed]
                                   * len(self._images))
        self._track = Line2D([], [], color=style.TRACK, linewidth=1.1, dashes=(1, 2.2), dash_capstyle="round",
                             alpha=0.9, zorder=3, **kept)
        self._line = Line2D([], [], color=style.BODY_EDGE, linewidth=1.3, marker="s", markersize=4.5, markevery=[1],
                            path_effects=[patheffects.withStroke(linewidth=3, foreground=style.HALO)], zorder=5.5,
                            **kept)
        self._body = PolyCollection([], facecolors=style.BODY, edgecolors=style.BODY_EDGE, linewidths=1.2, zorder=6,
                                    visible=run.towed is not None, **kept)
        self._arrow = PolyCollection([], facecolors=style.TRACK, edgecolors=style.BODY_EDGE, linewidths=1.0, zorder=7,
                                     **kept)
        self._heading = tow_heading(run)
        if run.case.get("tow.mode") == "line":
            self._heading = None  # the line itself shows the direction
        self._arrow_length = max(0.75 * body_size(run), 0.035 * wide)
        edges = [] if follow else self._edges(**kept)
        #: in the order of drawing
        self.artists = [self._water, self._floes, self._rafted, self._cracks, self._track, self._solid, *edges,
                        self._line, self._body, self._arrow]
        for artist in self.artists:
            axes.add_artist(artist)

    @property
    def mappable(self):
        return self._floes

    def show(self, frame):
        run = self.run
        run.need_frames()
        position, centre = np.zeros(2), None
        if run.towed is not None:
            position = run.wrap(run.body_pose(frame)[run.towed:run.towed + 1, :2])[0]
        origin = np.zeros(2)
        if self.follow:
            origin, centre = position, position
        outlines, index = run.polygon_array(frame, position + self._middle if self.follow else None)
        self._floes.set_verts(run.on_page(outlines - origin))
        self._floes.set_array(self.colouring.values(frame)[index])
        if self._rafts:
            over = rafted.overlaps(outlines)
            self._rafted.set_verts([run.on_page(p - origin) for p in over])
            self.rafted = len(over) > 0
        if run.n_pieces:
            cracks = self._new_cracks(frame, position + self._middle if self.follow else None)
            self._cracks.set_segments(run.on_page(cracks - origin))
            self.cracked = len(cracks) > 0
        bodies = run.body_polygons(frame, centre)
        self._solid.set_verts([run.on_page(p + shift - origin) for shift in self._images
                               for p, b in zip(bodies, run.bodies) if not b.towed])
        self._water.set_xy(run.on_page(self._sea - origin))
        if run.towed is None:
            return
        self._body.set_verts(self._everywhere(bodies[run.towed] - origin))
        self._show_track(frame, origin)
        self._show_line(frame, position - origin)
        if self._heading is not None:
            self._heading = tow_heading(run, run.frame_times[frame])
            self._show_arrow(position - origin, bodies[run.towed] - origin)

    def _everywhere(self, points):
        """[n, 2] m, of the towed body or its line: all images on the page."""
        return [self.run.on_page(points + shift) for shift in self._towed]

    def _new_cracks(self, frame, centre):
        """[K, 2, 2] m, ends of the cracks that opened since the previous frame, at the positions where they opened.
        Older cracks show as gaps between the pieces, which have drifted."""
        run = self.run
        frame %= run.n_frames
        after, until = run.frame_times[frame - 1] if frame else -np.inf, run.frame_times[frame]
        some = (run.splits["time"] > after) & (run.splits["time"] <= until)
        cracks = run.splits["crack"][some].reshape(-1, 2, 2)
        middle = cracks.mean(axis=1)
        return cracks + (run.wrap(middle, centre) - middle)[:, None]

    def _edges(self, **kept):
        """Dashed lines along the open or periodic edges of the domain."""
        a, b, c, d = self._corners
        lines = []
        if self.run.case.get("domain.ends") in ("open", "periodic", "moving"):
            lines += [(a, d), (b, c)]
        if self.run.case.get("domain.sides") in ("open", "periodic"):
            lines += [(a, b), (d, c)]
        return [Line2D(*self.run.on_page(line).T, color=style.FAINT, linewidth=1.0, linestyle=(0, (4, 3)), zorder=5,
                       clip_on=False, **kept) for line in lines]

    def _show_track(self, frame, origin):
        """Draw the track of the body so far, interrupted where it crossed a periodic end of the domain."""
        run = self.run
        if "body_x" not in run or "body_y" not in run:
            return
        time = run["time"]
        done = time <= run.frame_times[frame] + 1e-9 * max(time[-1:], default=0)
        step = max(1, int(done.sum()) // 400)
        way = np.stack([run["body_x"][done], run["body_y"][done]], axis=1)[::-1][::step][::-1]
        if self.follow:
            period = np.array(run.period)
            last = way[-1] if len(way) else origin
            way = way + np.where(period > 0, np.round((origin - last) / np.where(period > 0, period, 1)), 0) * period
        elif len(way):
            wrapped = run.wrap(way)
            jump = np.flatnonzero((np.abs(np.diff(wrapped, axis=0)) > 0.5 * np.abs(self._corners[2] - self._corners[0]))
                                  .any(axis=1)) + 1
            way = np.insert(wrapped, jump, np.nan, axis=0)
        self._track.set_data(*self.run.on_page(way - origin).T)

    def _show_line(self, frame, position):
        """Draw the line from the hull to its towing end, a square, where two branches meet; omit broken branches."""
        points = tow_line(self.run, frame, position)
        if points is not None:
            apart = np.concatenate(self._everywhere(np.vstack([points, np.full(2, np.nan)])))[:-1]
            # only the towing end if all branches have broken
            self._line.set_markevery(list(range(min(1, len(points) - 1), len(apart), len(points) + 1)))
            self._line.set_data(*apart.T)

    def _show_arrow(self, position, outline):
        """Draw an arrow ahead of the body, along the tow."""
        u = self._heading
        n = np.array([-u[1], u[0]])
        ahead = position + u * (((outline - position) @ u).max() + 0.22 * self._arrow_length)
        size = self._arrow_length
        shape = size * np.array([[0, -0.07], [0.58, -0.07], [0.52, -0.24], [1, 0], [0.52, 0.24], [0.58, 0.07],
                                 [0, 0.07]])
        self._arrow.set_verts(self._everywhere(ahead + shape[:, :1] * u + shape[:, 1:] * n))
