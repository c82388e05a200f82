"""Draws docs/figures/reacting.gif, the moving picture of the README.

python docs/moving_picture.py [--out FILE] [--frames NUMBER]

A car brakes to a standstill in the shipped lane merge. Above, all others replay their recording; below, they plan.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from matplotlib import font_manager
from PIL import Image, ImageDraw, ImageFont

import interdrive as idr
from interdrive.plots.frames import Stage
from interdrive.plots.view import View

FILE = Path(__file__).parent / "figures" / "reacting.gif"
#: The car that brakes, from when on [s], and how hard [m/s²].
BRAKING, START, DECELERATION = 1001, 1.5, 5.0
#: What a strip shows [m]: the road where the car brakes.
SHOWN = View(angle=0.0, center=(-45.0, 1.75), width=110.0, height=14.0)
#: Width of the picture and height of a title [px], frames per second, their number, colours.
WIDTH, TITLE, RATE, FRAMES, COLORS = 760, 26, 10, 95, 48


class Brakes:
    """Follows its route, then brakes to a standstill."""

    def plan(self, view: idr.View, predictions: idr.Predictions) -> idr.Trajectory:
        """Constant speed at first, constant deceleration from `START` on."""
        ego, route = view.ego, view.ego.route
        deceleration = DECELERATION if view.time_step * view.dt >= START else 0.0
        time = np.arange(31) * view.dt
        moving = np.minimum(time, ego.velocity / deceleration) if deceleration else time
        velocity = ego.velocity - deceleration * moving
        along = ego.velocity * moving - 0.5 * deceleration * moving**2
        path, heading = route.reference_path, np.unwrap(route.reference_orientation)
        knots = np.linspace(0.0, route.length, len(path))
        at = ego.s + ego.vehicle.rear_axle_to_center + along
        x, y, theta = (np.interp(at, knots, values) for values in (path[:, 0], path[:, 1], heading))
        fade = np.exp(-along / 10.0)
        turn = np.angle(np.exp(1j * (ego.orientation - theta[0])))
        return idr.Trajectory(x + fade * (ego.x - x[0]), y + fade * (ego.y - y[0]), theta + fade * turn, velocity)


def strip(run: idr.Run, title: str, frames: int) -> list[Image.Image]:
    """The first frames of a film of the road where the car brakes, with a title."""
    stage, found = Stage(run, SHOWN), []
    road = (0, 0, stage.size[0], round(SHOWN.height * stage.scale))
    size = (WIDTH, round(WIDTH * road[3] / road[2]))
    font = ImageFont.truetype(font_manager.findfont("DejaVu Sans"), 15)
    for k in range(frames):
        column = min(round(k / RATE / run.scenario.dt), run.states.n_steps - 1)
        whole = Image.new("RGB", (WIDTH, size[1] + TITLE), "white")
        whole.paste(stage.frame(column).crop(road).resize(size, Image.Resampling.LANCZOS), (0, TITLE))
        ImageDraw.Draw(whole).text((8, 4), title, fill="#222222", font=font)
        found.append(whole)
    return found


def main() -> None:
    """Drives both and writes the picture."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=FILE)
    parser.add_argument("--frames", type=int, default=FRAMES)
    options = parser.parse_args()
    replayed = idr.simulate("lane_merge", agents=[BRAKING], planner=Brakes)
    planned = idr.simulate("lane_merge", agents="all", planner={"default": "rollout", BRAKING: Brakes})
    upper = strip(replayed, "recorded: the car in front brakes, the recording drives through it", options.frames)
    lower = strip(planned, "interdrive: every car plans for itself", options.frames)
    frames = []
    for above, below in zip(upper, lower, strict=True):
        whole = Image.new("RGB", (WIDTH, above.height + below.height), "white")
        whole.paste(above, (0, 0))
        whole.paste(below, (0, above.height))
        frames.append(whole)
    palette = frames[len(frames) // 2].quantize(COLORS, method=Image.Quantize.MEDIANCUT)
    first, *others = (frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames)
    durations = [1000 // RATE] * (len(frames) - 1) + [2000]
    first.save(options.out, save_all=True, append_images=others, duration=durations, loop=0, optimize=True)
    print(planned, replayed, options.out.stat().st_size)


if __name__ == "__main__":
    main()
