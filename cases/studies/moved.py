# SPDX-License-Identifier: MIT
"""How far does the ice move about a towed body? The extent of moved ice over time, and its slack.

    moved.py RUN [RUN ...] [-o moved.png]

Between two frames a floe has moved when its mean speed was above LEAST. Half of the width of what has moved, Y, is the
99th percentile of the distance from the body's path; if a disc of it takes up what a body of width b displaced on its
way s, ice gives up the share of its area

    δ = b s / (π Y²)

before it locks (src/case/arch.h). The tow goes along x; frames must lie minutes apart.
"""
import argparse
from pathlib import Path

import h5py
import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

LEAST = 0.01  # m/s


def read(folder):
    """Times of frames, poses of floes and path of the body, and the body's width."""
    with h5py.File(Path(folder) / "result.h5") as f:
        time, pose = f["frames/time"][:], f["frames/pose"][:]
        body = f["frames/body_pose"][:].reshape(len(time), -1)[:, 0]
        v = f["bodies/vertices"][:] if "bodies/vertices" in f else None
    return time, pose, body, None if v is None else np.ptp(v[:, 1])


def speeds(time, pose, k):
    return np.hypot(*(pose[k, :, :2] - pose[k - 1, :, :2]).T) / (time[k] - time[k - 1])


def table(folder, width):
    time, pose, body, own = read(folder)
    b = width or own
    for k in range(1, len(time)):
        moved = speeds(time, pose, k) > LEAST
        way = body[k] - body[0]
        y = np.percentile(np.abs(pose[k, moved, 1]), 99)
        slack = b * way / np.pi / y**2
        print(f"{folder}  {time[k]:6.0f} s  way {way:6.0f} m  half width {y:6.0f} m  slack {slack:.4f}")


def draw(folder, path):
    time, pose, body, _ = read(folder)
    at = sorted({len(time) // 3, 2 * len(time) // 3, len(time) - 1})
    size = np.ptp(pose[0, :, :2], axis=0)
    figure, axes = plt.subplots(1, len(at), figsize=(9, 2 + 9 / len(at) * size[0] / size[1]), sharey=True,
                                layout="compressed")
    for ax, k in zip(np.atleast_1d(axes), at):
        dots = ax.scatter(pose[k, :, 1] / 1e3, pose[k, :, 0] / 1e3, c=np.minimum(speeds(time, pose, k), 0.1), s=0.3,
                          linewidths=0, vmin=0, vmax=0.1, cmap="viridis", rasterized=True)
        ax.set_title(f"{time[k] / 60:.0f} min", fontsize=9)
        ax.set(aspect="equal", xlabel="across, km")
    np.atleast_1d(axes)[0].set_ylabel("along the tow, km")
    figure.colorbar(dots, ax=axes, label="speed since the last frame, m/s (0.1 and more)", orientation="horizontal",
                    shrink=0.5)
    figure.savefig(path, dpi=110)


def main():
    p = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    p.add_argument("runs", nargs="+", metavar="RUN")
    p.add_argument("-o", "--output", metavar="FILE", help="draw the first run")
    p.add_argument("--width", type=float, metavar="M", help="of the body across the tow, m (default: from the run)")
    a = p.parse_args()
    for folder in a.runs:
        table(folder, a.width)
    if a.output:
        draw(a.runs[0], a.output)


if __name__ == "__main__":
    main()
