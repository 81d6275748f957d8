# SPDX-License-Identifier: MIT
"""A film of a run: the ice field above, the ice resistance up to the current time below. MP4 through ffmpeg, GIF
through Pillow.

Static parts are drawn once; for each frame only floes, bodies and the moving parts of the curve are drawn over them (a
full redraw spends most of its time on text and ticks).
"""
import subprocess
import tempfile

from bergtow import arguments, writing
from bergtow.errors import RunError
from bergtow.plot import style
from bergtow.plot.force import draw_ice, running_mean, smoothing
from bergtow.plot.scene import Colouring, Scene, add_options, framed
from bergtow.result.run import Run
from bergtow.said import say

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.lines import Line2D
from PIL import Image


class Film:
    """The figure of a film. pixels(frame) returns the image of a frame."""

    def __init__(self, run, frames, kind="speed", width=1280, window="auto"):
        self.run = run
        follow, view = framed(run, window)
        wide, high = run.on_page([view[1] - view[0], view[3] - view[2]])
        left, right, head, between, curve, foot = 0.85, 1.15, 0.85, 0.95, 1.75, 0.58
        if wide >= high:
            field_w = 10.0
            field_h = field_w * high / wide
            if field_h > 5.2:
                field_w, field_h = 5.2 * wide / high, 5.2
        else:
            field_w, field_h = 5.6 * wide / high, 5.6
        panel_w = max(field_w, 6.2)
        size = (left + panel_w + right, head + field_h + between + curve + foot)
        # Both sides must be even numbers of pixels: the common video format halves the colour resolution.
        px = (width // 2 * 2, int(round(width * size[1] / size[0] / 2)) * 2)
        dpi = px[0] / size[0]
        size = (size[0], px[1] / dpi)
        self.size = px
        self.figure = style.Figure(figsize=(px[0] / dpi, px[1] / dpi), dpi=dpi)
        FigureCanvasAgg(self.figure)

        def box(x, y, w, h):
            return x / size[0], y / size[1], w / size[0], h / size[1]

        base = foot + curve + between
        field = self.figure.add_axes(box(left + (panel_w - field_w) / 2, base, field_w, field_h))
        colouring = Colouring(run, kind, frames[::max(1, len(frames) // 20)])
        self.scene = Scene(field, run, colouring, view, follow, animated=True)
        if run.n_floes:
            bar_h = min(field_h, 3.2)
            colouring.bar(self.figure, self.scene.mappable, self.figure.add_axes(
                box(left + (panel_w + field_w) / 2 + 0.2, base + (field_h - bar_h) / 2, 0.14, bar_h)))
        style.headline(self.figure, run, "ice field and ice resistance" if run.towed is not None else "ice field",
                       0.2 / size[0])
        self.clock = self.figure.text(1 - 0.25 / size[0], 1 - 0.14 / size[1], "", va="top", ha="right", fontsize=13.5,
                                      family="DejaVu Sans Mono", animated=True)
        self.curve = self.figure.add_axes(box(left, foot, panel_w, curve))
        self._draw_curve()
        self.figure.canvas.draw()
        self.ground = self.figure.canvas.copy_from_bbox(self.figure.bbox)

    def _draw_curve(self):
        """Plot the ice resistance against time; for a field without a towed body, the kinetic energy."""
        run, axes, self.time = self.run, self.curve, self.run["time"]
        if not len(self.time):
            raise RunError(run.result, "holds no samples", "the run ended before its first sample: run it for longer")
        if run.towed is None:
            self.factor, unit = style.scale(run["kinetic_energy"], "J")
            self.smooth = run["kinetic_energy"]
            axes.plot(self.time, self.smooth / self.factor, color=style.ICE, alpha=0.35)
            axes.set_ylabel(f"kinetic energy ({unit})")
            axes.set_ylim(bottom=0)
            axes.grid(axis="y")
        else:
            self.smooth = running_mean(run["ice_resistance"], smoothing(run)[0])
            self.factor, unit = style.scale(self.smooth, "N")
            draw_ice(axes, run, self.factor, unit)
        axes.set_xlabel("time (s)")
        for line in axes.lines:
            if line.get_gid() == "running mean":
                line.set_alpha(0.35)
        looks = ({"color": style.ICE, "linewidth": 2.2, "zorder": 5}, {"color": style.INK, "linewidth": 1, "zorder": 6},
                 {"color": style.ICE, "marker": "o", "markersize": 6, "markeredgecolor": "white", "zorder": 7})
        self.moving = [axes.add_line(Line2D([], [], animated=True, **look)) for look in looks]
        self.past, self.cursor, self.dot = self.moving

    def pixels(self, frame):
        """[height, width, 4] uint8 RGBA; valid until the next call."""
        canvas, now = self.figure.canvas, self.run.frame_times[frame]
        self.scene.show(frame)
        done = int(np.searchsorted(self.time, now, side="right"))
        self.past.set_data(self.time[:done], self.smooth[:done] / self.factor)
        self.cursor.set_data([now, now], self.curve.get_ylim())
        at = max(done - 1, 0)
        self.dot.set_data([self.time[at]], [self.smooth[at] / self.factor])
        self.clock.set_text(f"t = {style.fixed(now, self.time[-1])} s")
        canvas.restore_region(self.ground)
        for artist in self.scene.artists:
            self.scene.axes.draw_artist(artist)
        for line in self.moving:
            self.curve.draw_artist(line)
        self.figure.draw_artist(self.clock)
        return np.asarray(canvas.buffer_rgba())


def write_mp4(film, frames, fps, path):
    """Send the images to ffmpeg. Raises RunError."""
    width, height = film.size
    call = ["ffmpeg", "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgba", "-s", f"{width}x{height}",
            "-r", str(fps), "-i", "-", "-an", "-c:v", "libx264", "-preset", "fast", "-crf", "20", "-pix_fmt", "yuv420p",
            "-movflags", "+faststart", "-metadata", f"comment={writing.MARK}", "-f", "mp4", str(path)]
    with tempfile.TemporaryFile() as messages:
        try:
            coder = subprocess.Popen(call, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=messages)
        except FileNotFoundError:
            raise RunError("ffmpeg", "not installed", "apt-get install ffmpeg, or write a .gif") from None
        try:
            for frame in frames:
                coder.stdin.write(film.pixels(frame))
            coder.stdin.close()
        except BrokenPipeError:
            pass  # ffmpeg gives the reason
        finally:
            if coder.poll() is None and not coder.stdin.closed:
                coder.terminate()
            coder.wait()
        if coder.returncode:
            messages.seek(0)
            reason = messages.read().decode("utf-8", "replace").strip().splitlines() or ["no reason given"]
            raise RunError(path, f"ffmpeg failed ({reason[-1]})", "check the place and ffmpeg, or write a .gif")


def write_gif(film, frames, fps, path):
    """Write a GIF with one palette of 255 colours, taken from four frames, for the whole film; no dithering, which
    would flicker. Pixels that do not change get the 256th index, transparent: their long runs need almost no space."""
    picked = [film.pixels(frames[int(i)])[:, :, :3].copy()
              for i in np.linspace(0, len(frames) - 1, min(4, len(frames)))]
    palette = Image.fromarray(np.concatenate(picked)).quantize(255, method=Image.Quantize.MEDIANCUT)
    colours = palette.getpalette()[:765] + [0, 0, 0]

    def pictures():
        before = None
        for frame in frames:
            now = np.asarray(Image.fromarray(film.pixels(frame)[:, :, :3]).quantize(palette=palette,
                                                                                   dither=Image.Dither.NONE))
            picture = Image.fromarray(now if before is None else np.where(now == before, np.uint8(255), now))
            picture.putpalette(colours)
            before = now
            yield picture

    film_of = pictures()
    next(film_of).save(path, format="GIF", save_all=True, append_images=film_of, duration=max(20, round(1000 / fps)),
                       loop=0, optimize=False, comment=writing.MARK.encode(), transparency=255, disposal=1)


def options(p):
    arguments.add_run(p, "film.mp4")
    add_options(p)
    p.add_argument("--fps", type=arguments.between(0.1, 120), default=20, help="frames per second (default: 20)")
    p.add_argument("--frames", metavar="N", type=arguments.at_least_one,
                   help="at most N frames, evenly spaced (default: all, 120 for a GIF)")
    p.add_argument("--width", metavar="PX", type=arguments.whole_from(300, 8000),
                   help="width in pixels (default: 1280, 900 for a GIF)")


@style.look()
def perform(a):
    path = arguments.output(a, "film.mp4", (".mp4", ".gif"))
    gif = path.suffix.lower() == ".gif"
    with Run(a.run) as run:
        run.need_frames()
        count = min(a.frames or (120 if gif else run.n_frames), run.n_frames)
        frames = sorted({int(i) for i in np.linspace(0, run.n_frames - 1, count).round()})
        film = Film(run, frames, a.colour, a.width or (900 if gif else 1280), a.window)
        with writing.written(path, a.force) as new:
            (write_gif if gif else write_mp4)(film, frames, a.fps, new)
    say(path)
