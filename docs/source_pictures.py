"""Draws the picture of maps and recordings of other tools: a small file of each format, as it is read.

python docs/source_pictures.py
"""

from __future__ import annotations

import json
import re
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib.pyplot as plt
import numpy as np

import interdrive as idr

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.axes import Axes

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "support")]

TARGET = ROOT / "docs" / "figures" / "sources.png"
TITLES = {
    "opendrive": "OpenDRIVE",
    "sumo": "SUMO net",
    "lanelet2": "Lanelet2",
    "argoverse2": "Argoverse 2",
    "womd": "Waymo scene in JSON",
    "neutral": "your own tracks",
    "interaction": "INTERACTION",
    "highd": "highD",
    "ind": "inD, rounD, exiD, uniD",
    "osi": "OSI trace",
}
SIGNALS = {"red": "#d0312d", "yellow": "#e0a100", "green": "#2a9d4a"}


def main() -> None:
    """Writes the picture."""
    import sind_files
    from tests.fuzz.sources import formats

    figure, axes = plt.subplots(4, 3, figsize=(10.0, 7.2))
    shown = iter(axes.flat)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "town.xodr")
        path.write_text(town())
        finish(next(shown), "OpenDRIVE: the town of the tutorial", idr.read_source(path))
        path = sind_files.written(Path(folder))
        finish(next(shown), "SinD: lights of the map", idr.read_source(path, map=Path(folder, "map.osm")))
    for name, title in TITLES.items():
        files, opened, options = formats()[name]
        with tempfile.TemporaryDirectory() as folder:
            for file, data in files.items():
                Path(folder, file).write_bytes(data)
            given = {key: str(Path(folder, value)) if key == "map" else value for key, value in options.items()}
            finish(next(shown), title, idr.read_source(Path(folder, opened), **given))
    figure.tight_layout()
    figure.savefig(TARGET, dpi=90, metadata={"Software": None})
    print(json.dumps({"written": str(TARGET.relative_to(ROOT))}))


def town() -> str:
    """The OpenDRIVE document that the tutorial makes."""
    text = (ROOT / "docs" / "tutorials" / "opendrive_town.md").read_text()
    [program] = re.findall(r"```python town\.py\n(.*?)```", text, re.DOTALL)
    names: dict[str, Callable[[], str]] = {}
    exec(program, names)  # a program of this repository
    return names["town"]()


def finish(axis: Axes, title: str, scenario: idr.Scenario) -> None:
    """A panel with its title."""
    draw(axis, scenario)
    axis.set_title(title, fontsize=9)
    axis.set_aspect("equal", adjustable="datalim")
    axis.tick_params(labelsize=6)


def draw(axis: Axes, scenario: idr.Scenario) -> None:
    """Lanelets, crosswalks, stop lines with what lights show first, and where participants went."""
    lanelets = scenario.lanelets
    for left, right, kinds in zip(lanelets.left, lanelets.right, lanelets.types, strict=True):
        face = "#ffe6a3" if "crosswalk" in kinds else "#e4e7ec"
        axis.fill(*np.vstack((left, right[::-1])).T, facecolor=face, edgecolor="#7a8699", linewidth=0.6)
    first = {light.id: light.phases[0][0] for light in scenario.traffic_lights if light.phases}
    for line in scenario.stop_lines:
        lights = [number for _, numbers in line.light_ids for number in numbers]
        colour = next((SIGNALS.get(first[number], "#111111") for number in lights if number in first), "#111111")
        axis.plot(*line.ends.T, color=colour, linewidth=2.4)
    for x, y, valid in zip(scenario.obstacles.x, scenario.obstacles.y, scenario.obstacles.valid, strict=True):
        axis.plot(x[valid], y[valid], color="#0a66c2", linewidth=1.6)
        axis.plot(x[valid][-1:], y[valid][-1:], marker="o", color="#0a66c2", markersize=3)


if __name__ == "__main__":
    main()
