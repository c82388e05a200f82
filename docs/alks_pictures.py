"""Draws the figures of the pages on UN R157: cut-ins at 110 behind 40 km/h, with `idm` and with a reference driver.

python docs/alks_pictures.py
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path

from interdrive import alks

ROOT = Path(__file__).parents[1]
FIGURES = ROOT / "docs" / "figures"
GRID = """
[cut_in]
velocity_kmh = [110]
other_velocity_kmh = [40]
gap = {from = 2, to = 82, step = 4}
sideways = {from = 0.1, to = 1.7, step = 0.2}
"""


def main(target: Path = FIGURES, text: str = GRID) -> None:
    """Writes the figures into a folder."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "cases.toml")
        file.write_text(text, encoding="utf-8")
        grid = alks.grid("cut_in", str(file))
    for name, found in (
        ("alks_idm", alks.driven(grid, "idm", predictor="lane_following")),
        ("alks_cc", alks.reference(grid, "cc")),
    ):
        ((_, figure),) = alks.case_figures(found)
        path = target / f"{name}.png"
        figure.savefig(path, dpi=110, metadata={"Software": None})
        print(json.dumps({"written": str(path)}))


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
