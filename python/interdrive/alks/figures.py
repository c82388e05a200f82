"""Which cut-ins are avoided: gap over sideways speed, one figure per pair of speeds."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from interdrive.alks.verdicts import reference

if TYPE_CHECKING:
    from collections.abc import Iterator

    from interdrive.alks.verdicts import Verdicts
    from interdrive.array_types import Floats

#: What happens in a case with a planner, beside the careful and competent driver; and its colour.
CLASSES = {
    "neither hits": "#e3e3e3",
    "only cc hits": "#0072B2",
    "both hit": "#6f6f6f",
    "only {} hits": "#D55E00",
}
_LINES = {"r157": "#009E73", "rss": "#CC79A7", "fsm": "#56B4E9"}
_SAME = 1e-6


def cut_in_figures(found: Verdicts) -> Iterator[tuple[str, Figure]]:
    """One figure per pair of speeds of cut-ins with a driver, with a name for its file.

    Cases are coloured by whether the driver and the careful and competent one hit the other; lines show the largest gap
    at which each other reference driver does.

    Args:
        found: The verdicts; its grid is of cut-ins.
    """
    cases = found.grid.cases
    pairs = sorted(set(zip(cases["velocity"].tolist(), cases["other_velocity"].tolist(), strict=True)))
    hit = {name: reference(found.grid, name).crash for name in ("cc", *_LINES)}
    for velocity, other in pairs:
        of = (np.abs(cases["velocity"] - velocity) < _SAME) & (np.abs(cases["other_velocity"] - other) < _SAME)
        figure = Figure(figsize=(4.2, 3.2), layout="constrained")
        axes = figure.add_subplot()
        classes = 2 * found.crash[of].astype(int) + hit["cc"][of].astype(int)
        gap, sideways = cases["gap"][of], cases["sideways"][of]
        for code, label in ((0, "neither hits"), (1, "only cc hits"), (3, "both hit"), (2, "only {} hits")):
            here = classes == code
            if found.driver == "cc" and code == 3:
                label = "cc hits"  # noqa: PLW2901 - one driver beside itself
            if here.any():
                color = CLASSES.get(label, CLASSES["both hit"])
                axes.scatter(sideways[here], gap[here], s=9, c=color, label=label.format(found.driver), linewidths=0)
        for name, color in _LINES.items():
            speeds = np.unique(sideways)
            crash = hit[name][of]
            largest = [_largest(gap[(sideways == speed) & crash]) for speed in speeds]
            axes.plot(speeds, largest, color=color, linewidth=1.0, label=f"largest gap hit by {name}")
        axes.set_xlabel("sideways speed [m/s]")
        axes.set_ylabel("gap [m]")
        axes.set_title(f"{3.6 * velocity:.0f} km/h behind {3.6 * other:.0f} km/h", fontsize=9)
        axes.legend(fontsize=6, loc="upper right")
        yield f"cut_in_{3.6 * velocity:g}_{3.6 * other:g}".replace(".", "p"), figure


def _largest(gap: Floats) -> float:
    return float(gap.max()) if len(gap) else math.nan
