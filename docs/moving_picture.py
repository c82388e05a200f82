"""Draws docs/figures/reacting.gif, the moving picture of the README.

python docs/moving_picture.py

A car brakes to a standstill in the shipped lane merge. Above, all others replay their recording; below, they plan.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib import font_manager
from PIL import Image, ImageDraw, ImageFont

import interdrive as idr
from interdrive.plots.frames import Stage

FILE = Path(__file__).parent / "figures" / "reacting.gif"
#: The car that brakes, from when on [s], and how hard [m/s²].
BRAKING, START, DECELERATION = 1001, 1.5, 5.0
#: Width of the picture [px], what is cut off a frame above and below (shares of its height), frames per second, their
#: number, colours.
WIDTH, CUT, RATE, FRAMES, COLORS = 760, (0.35, 0.41), 10, 95, 48


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


def strip(run: idr.Run, title: str) -> list[Image.Image]:
    """The middle of all frames of a film that follows the braking car, with a title."""
    stage, found = Stage(run, BRAKING, follow=True), []
    font = ImageFont.truetype(font_manager.findfont("DejaVu Sans"), 15)
    for k in range(FRAMES):
        column = min(round(k / RATE / run.scenario.dt), run.states.n_steps - 1)
        frame = stage.frame(column)
        part = frame.crop((0, round(CUT[0] * frame.height), frame.width, round((1.0 - CUT[1]) * frame.height)))
        part = part.resize((WIDTH, round(WIDTH * part.height / part.width)), Image.Resampling.LANCZOS)
        whole = Image.new("RGB", (WIDTH, part.height + 26), "white")
        whole.paste(part, (0, 26))
        ImageDraw.Draw(whole).text((8, 4), title, fill="#222222", font=font)
        found.append(whole)
    return found


def main() -> None:
    """Drives both and writes the picture."""
    replayed = idr.simulate("lane_merge", agents=[BRAKING], planner=Brakes)
    planned = idr.simulate("lane_merge", agents="all", planner={"default": "rollout", BRAKING: Brakes})
    upper = strip(replayed, "recorded: the car in front brakes, the recording drives through it")
    lower = strip(planned, "interdrive: every car plans for itself")
    frames = []
    for above, below in zip(upper, lower, strict=True):
        whole = Image.new("RGB", (WIDTH, above.height + below.height), "white")
        whole.paste(above, (0, 0))
        whole.paste(below, (0, above.height))
        frames.append(whole)
    palette = frames[FRAMES // 2].quantize(COLORS, method=Image.Quantize.MEDIANCUT)
    first, *others = (frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames)
    durations = [1000 // RATE] * (FRAMES - 1) + [2000]
    first.save(FILE, save_all=True, append_images=others, duration=durations, loop=0, optimize=True)
    print(planned, replayed, FILE.stat().st_size)


if __name__ == "__main__":
    main()
