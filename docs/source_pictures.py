"""Draws the picture of the page on maps and recordings of other tools: a small file of each format, as it is read.

python docs/source_pictures.py
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib.pyplot as plt
import numpy as np

import interdrive as idr

if TYPE_CHECKING:
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
    "osi": "OSI trace",
}


def main() -> None:
    """Writes the picture."""
    from tests.fuzz.sources import formats

    figure, axes = plt.subplots(3, 3, figsize=(10.0, 5.0))
    for axis, (name, title) in zip(axes.flat, TITLES.items(), strict=True):
        files, opened, options = formats()[name]
        with tempfile.TemporaryDirectory() as folder:
            for file, data in files.items():
                Path(folder, file).write_bytes(data)
            given = {key: str(Path(folder, value)) if key == "map" else value for key, value in options.items()}
            draw(axis, idr.read_source(Path(folder, opened), **given))
        axis.set_title(title, fontsize=9)
    figure.tight_layout()
    figure.savefig(TARGET, dpi=90, metadata={"Software": None})
    print(json.dumps({"written": str(TARGET.relative_to(ROOT))}))


def draw(axis: Axes, scenario: idr.Scenario) -> None:
    """Lanelets, and where participants went."""
    for left, right in zip(scenario.lanelets.left, scenario.lanelets.right, strict=True):
        axis.fill(*np.vstack((left, right[::-1])).T, facecolor="#e4e7ec", edgecolor="#7a8699", linewidth=0.6)
    for x, y, valid in zip(scenario.obstacles.x, scenario.obstacles.y, scenario.obstacles.valid, strict=True):
        axis.plot(x[valid], y[valid], color="#0a66c2", linewidth=1.6)
        axis.plot(x[valid][-1:], y[valid][-1:], marker="o", color="#0a66c2", markersize=3)
    axis.set_aspect("equal", adjustable="datalim")
    axis.tick_params(labelsize=6)


if __name__ == "__main__":
    main()
