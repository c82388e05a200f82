"""Single frames of a film: the road is drawn once, each frame only what moves."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import font_manager
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from PIL import Image, ImageDraw, ImageFont

from interdrive.plots.road import road_artists
from interdrive.plots.style import (
    BLINKER,
    INK,
    OUTCOME_MARKS,
    RECORDED_EDGE,
    STATIC,
    TRAFFIC,
    agent_colors,
    others_named,
)
from interdrive.plots.trajectories import plan_points
from interdrive.plots.vehicles import Footprints, goal_outlines
from interdrive.plots.view import view_of
from interdrive.run.goals import said_time

if TYPE_CHECKING:
    from collections.abc import Iterator

    from interdrive.array_types import Floats
    from interdrive.plots.view import View
    from interdrive.run import RunRecord

#: Size of a frame [px]; even, because video codecs want it so. The height follows the view.
_WIDTH, _ASPECT_MIN, _ASPECT_MAX = 1200, 0.22, 0.66

#: An agent that is done leaves its marker for this long; a collision stays marked [s].
_MARK_TIME = 2.0

#: Height of the strip with the legend [px].
_STRIP = 30

_WRECK = OUTCOME_MARKS["collision"].color


@dataclass
class _Layers:
    """What moves, in drawing order; every layer is refilled for each frame."""

    plans: Any = field(default_factory=lambda: LineCollection([], linewidths=1.8, capstyle="round", alpha=0.9))
    bodies: Any = field(default_factory=lambda: PolyCollection([], linewidths=0.6))
    noses: Any = field(default_factory=lambda: PolyCollection([], facecolors=[(1, 1, 1, 0.85)], edgecolors="none"))
    blinkers: Any = field(
        default_factory=lambda: PolyCollection([], facecolors=BLINKER, edgecolors=INK, linewidths=0.4)
    )
    wrecks: Any = field(
        default_factory=lambda: PolyCollection([], facecolors="none", edgecolors=_WRECK, linewidths=0.9)
    )

    def __iter__(self) -> Iterator[Any]:
        return iter((self.plans, self.wrecks, self.bodies, self.noses, self.blinkers))


class Stage:
    """Draws single frames of a run: of all agents, or of a view of the world."""

    def __init__(self, run: RunRecord, view: View | None = None) -> None:
        self.run = run
        self.footprints = Footprints(run)
        self.colors = agent_colors(run)
        self.crowded = len(run.agents) > 30
        self.row = {number: row for row, number in enumerate(run.states.participant_id.tolist())}
        self.plan_rows = _rows_by_time_step(run.plans.time_step)
        self.view = view or view_of(run).shaped(_ASPECT_MIN, _ASPECT_MAX)
        height = 2 * round(0.5 * _WIDTH * self.view.height / self.view.width)
        self.size = (_WIDTH, height + _STRIP)
        self.scale = _WIDTH / self.view.width  # px per metre
        figure = Figure(figsize=(_WIDTH / 100, height / 100), dpi=100)
        self.canvas = FigureCanvasAgg(figure)
        self.axes = figure.add_axes((0, 0, 1, 1))
        self.axes.set_axis_off()
        figure.set_facecolor("white")
        self.layers = _Layers()
        for layer in self.layers:
            self.axes.add_collection(layer, autolim=False)
            layer.set_animated(True)
        for artist in (*road_artists(run.scenario.lanelets, self.view, 0.9), *self._goals()):
            self.axes.add_collection(artist, autolim=False)
        self.axes.set(xlim=self.view.x_limits, ylim=self.view.y_limits)
        self.canvas.draw()
        self.background = self.canvas.copy_from_bbox(figure.bbox)
        self.fonts = {
            size: ImageFont.truetype(font_manager.findfont("DejaVu Sans"), size) for size in (10, 11, 13, 14, 17)
        }
        self.legend = self._legend()

    def frame(self, column: int) -> Image.Image:
        """The picture of one column of the states, as RGB."""
        self.canvas.restore_region(self.background)
        labels = self._fill(column)
        renderer = self.canvas.get_renderer()
        for layer in self.layers:
            layer.draw(renderer)
        picture = Image.fromarray(np.asarray(self.canvas.buffer_rgba())).convert("RGB")
        frame = Image.new("RGB", self.size, "white")
        frame.paste(picture, (0, 0))
        frame.paste(self.legend, (0, picture.height))
        self._write_texts(ImageDraw.Draw(frame), labels, column)
        return frame

    def _goals(self) -> list[Any]:
        return [
            PolyCollection(
                goal_outlines([agent], self.view),
                facecolors="none",
                edgecolors=self.colors[agent.id],
                linewidths=0.7,
                linestyles=[(0, (3, 2))],
            )
            for agent in self.run.agents
        ]

    def _fill(self, column: int) -> list[tuple[Floats, str, str, str]]:
        """Fills all layers; returns what is to be written: place in the picture [m], text, colour, marker."""
        states, now = self.run.states, self.run.states.first_time_step + column
        areas, fills, edges, noses, blinkers, labels = [], [], [], [], [], []
        shown = self._shown(now)
        for row in np.flatnonzero(states.valid[:, column]).tolist():
            number = int(states.participant_id[row])
            color = self.colors.get(number)
            for outline in self.footprints.outlines(row, column, self.view):
                areas.append(outline)
                fills.append(color or (STATIC if states.is_static[row] else TRAFFIC))
                edges.append(INK if color else RECORDED_EDGE)
            if not states.is_static[row] and states.kinds[row] != "pedestrian":
                noses.append(self.footprints.heading_mark(row, column, self.view))
            blinkers += self.footprints.blinker_marks(row, column, self.view, shown.get(number, 0.0))
            if not states.is_static[row]:
                labels.append((self._beside(row, column), str(number), color or RECORDED_EDGE, ""))
        self.layers.bodies.set_verts(areas)
        self.layers.bodies.set(facecolors=fills, edgecolors=edges)
        self.layers.noses.set_verts(noses)
        self.layers.blinkers.set_verts(blinkers)
        self._fill_plans(now)
        return labels + self._fill_ended(now)

    def _shown(self, now: int) -> dict[int, float]:
        """What agents show by their blinkers at a time step, by their ids."""
        plans = self.run.plans
        return {int(plans.agent_id[i]): float(plans.turn[i]) for i in self.plan_rows.get(now, ())}

    def _beside(self, row: int, column: int) -> Floats:
        """Where the id goes: above the footprint in the picture."""
        states = self.run.states
        center = self.view.picture_from_world(np.array([states.x[row, column], states.y[row, column]]))
        angle = states.orientation[row, column] - self.view.angle
        up = 0.5 * (abs(np.sin(angle)) * states.length[row] + abs(np.cos(angle)) * states.width[row])
        place: Floats = center + np.array([0.0, up + 8.0 / self.scale])
        return place

    def _fill_plans(self, now: int) -> None:
        plans, lines, colors = self.run.plans, [], []
        for index in self.plan_rows.get(now, ()):
            points = plan_points(plans, index)
            if len(points) > 1:
                lines.append(self.view.picture_from_world(points))
                colors.append(self.colors.get(int(plans.agent_id[index]), INK))
        self.layers.plans.set_segments(lines)
        self.layers.plans.set_color(colors)

    def _fill_ended(self, now: int) -> list[tuple[Floats, str, str, str]]:
        """Marks agents that are done; a crashed one stays as an outline."""
        states, ended, labels, wrecks = self.run.states, self.run.outcomes, [], []
        for number, outcome, at in zip(ended.agent_id.tolist(), ended.outcome, ended.time_step.tolist(), strict=True):
            age = (now - at) * self.run.scenario.dt
            row = self.row.get(number)
            if row is None or age < 0 or outcome == "running" or (age > _MARK_TIME and outcome != "collision"):
                continue
            columns = np.flatnonzero(states.valid[row])
            if not len(columns):
                continue
            last, mark = int(columns[-1]), OUTCOME_MARKS[outcome]
            place = self.view.picture_from_world(np.array(self.footprints.pose(row, last)[:2]))
            labels.append((place, "", mark.color, mark.marker))
            if outcome == "collision":
                wrecks += self.footprints.outlines(row, last, self.view)
                labels.append((self._beside(row, last), str(number), _WRECK, ""))
        self.layers.wrecks.set_verts(wrecks)
        return labels

    def _write_texts(self, draw: ImageDraw.ImageDraw, labels: list[tuple[Floats, str, str, str]], column: int) -> None:
        (x0, _), (_, y1) = self.view.x_limits, self.view.y_limits
        for place, text, color, marker in labels:
            x, y = (place[0] - x0) * self.scale, (y1 - place[1]) * self.scale
            if not (-20 < x < self.size[0] + 20 and -20 < y < self.size[1] - _STRIP):
                continue
            if marker:
                _draw_marker(draw, x, y, marker, color)
            else:
                font = self.fonts[
                    (10 if self.crowded else 11) if color == RECORDED_EDGE else (11 if self.crowded else 13)
                ]
                draw.text((x, y), text, fill=color, font=font, anchor="mm", stroke_width=2, stroke_fill="white")
        clock = f"{said_time(self.run, self.run.states.first_time_step + column)} s"
        draw.text((12, 10), clock, fill=INK, font=self.fonts[17], anchor="la", stroke_width=3, stroke_fill="white")

    def _legend(self) -> Image.Image:
        """The strip below the picture: what colours mean, and the scale."""
        strip = Image.new("RGB", (self.size[0], _STRIP), "white")
        draw = ImageDraw.Draw(strip)
        draw.line((0, 0, self.size[0], 0), fill="#cccccc")
        middle, x = _STRIP // 2 + 1, 12
        agents = list(self.colors.values())[:4] or [INK]
        named = [([color], name) for name, color in others_named(self.run)]
        if self.run.agents:
            named.append((agents, "agents and their plans"))
        for colors, text in named:
            for step in range(24):
                fill = colors[step * len(colors) // 24]
                draw.line((x + step, middle - 2, x + step, middle + 2), fill=fill)
            draw.text((x + 30, middle), text, fill=INK, font=self.fonts[14], anchor="lm")
            x += 30 + int(draw.textlength(text, font=self.fonts[14])) + 18
        nice = np.array([1, 2, 5, 10, 20, 50, 100, 200, 500, 1000])
        metres = int(nice[np.argmin(np.abs(np.log(nice / (0.08 * self.view.width))))])
        right = self.size[0] - 14
        left = right - metres * self.scale
        for line in (
            (left, middle, right, middle),
            (left, middle - 4, left, middle + 4),
            (right, middle - 4, right, middle + 4),
        ):
            draw.line(line, fill=INK, width=1)
        draw.text((left - 6, middle), f"{metres} m", fill=INK, font=self.fonts[14], anchor="rm")
        for outcome in dict.fromkeys(self.run.outcomes.outcome):
            mark = OUTCOME_MARKS[outcome]
            width = 16 + int(draw.textlength(mark.text, font=self.fonts[14])) + 18
            if outcome != "running" and x + width < left - 60:
                _draw_marker(draw, x + 5, middle, mark.marker, mark.color)
                draw.text((x + 16, middle), mark.text, fill=INK, font=self.fonts[14], anchor="lm")
                x += width
        return strip


def _rows_by_time_step(time_step: Any) -> dict[int, range]:  # noqa: ANN401 - sorted integer array
    steps, first = np.unique(time_step, return_index=True)
    last = np.append(first[1:], len(time_step))
    return {int(step): range(int(a), int(b)) for step, a, b in zip(steps, first, last, strict=True)}


def _draw_marker(draw: ImageDraw.ImageDraw, x: float, y: float, marker: str, color: str) -> None:
    """The marker of an outcome, with the shapes of the still picture."""
    r = 6.0
    if marker in "XP*":
        ways = {"X": [45, 135], "P": [0, 90], "*": [0, 60, 120]}[marker]
        for width, fill in ((6, "white"), (3, color)):
            for way in np.radians(ways):
                dx, dy = (r + 1) * np.cos(way), (r + 1) * np.sin(way)
                draw.line((x - dx, y - dy, x + dx, y + dy), fill=fill, width=width)
    elif marker == "o":
        draw.ellipse((x - r, y - r, x + r, y + r), fill=color, outline=INK)
    else:
        corners = {"s": [45, 135, 225, 315], "D": [0, 90, 180, 270], "^": [-90, 30, 150], "v": [90, 210, 330]}[marker]
        draw.polygon(
            [(x + 1.3 * r * np.cos(a), y + 1.3 * r * np.sin(a)) for a in np.radians(corners)], fill=color, outline=INK
        )
