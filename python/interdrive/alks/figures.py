"""Which cases are avoided: one figure per pair of speeds of cut-ins, per speed of cut-outs, and one of followings."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from interdrive.alks.verdicts import boundary, has_driver, is_comparable, reference

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from matplotlib.axes import Axes

    from interdrive.alks.verdicts import Verdicts
    from interdrive.array_types import Bools

#: What happens in a case with a planner, beside the careful and competent driver; and its colour.
CLASSES = {
    "neither hits": "#e3e3e3",
    "only cc hits": "#0072B2",
    "both hit": "#6f6f6f",
    "only {} hits": "#D55E00",
    "{} fails": "#000000",
}
_LINES = {"r157": "#009E73", "rss": "#CC79A7", "fsm": "#56B4E9"}
_OWN = "#000000"
#: What is said of `cc` itself.
_ALONE = {"neither hits": "cc does not hit", "both hit": "cc hits"}
#: By manoeuvre what is drawn over what, and of which numbers there is a figure each.
_AXES = {
    "cut_in": ("gap", "sideways", ("velocity", "other_velocity")),
    "cut_out": ("front_distance", "sideways", ("velocity",)),
    "following": ("deceleration", "velocity", ()),
}
_LABELS = {
    "gap": "gap [m]",
    "front_distance": "distance to what stands [m]",
    "deceleration": "deceleration of the leader [m/s²]",
    "sideways": "sideways speed [m/s]",
    "velocity": "speed [m/s]",
}
_SAME = 1e-6


def case_figures(found: Verdicts, bounds: Sequence[dict[str, float]] = ()) -> Iterator[tuple[str, Figure]]:
    """Figures of the cases with a driver, each with a name for its file.

    Cases are coloured by whether the driver and the careful and competent one hit the other; lines are the boundaries
    of the other reference drivers that begin where the driver does, to 0.1 m or 0.1 m/s².

    Args:
        found: The verdicts.
        bounds: The boundary of the driver, as `boundary` gives it, for a line of its own.
    """
    grid = found.grid
    along, over, each = _AXES[grid.manoeuvre]
    lines = {
        name: (boundary(reference(grid, name)), color)
        for name, color in _LINES.items()
        if has_driver(grid.manoeuvre, name) and is_comparable(found, name) and name != found.driver
    }
    if bounds:
        lines[found.driver] = (list(bounds), _OWN)
    cc = reference(grid, "cc").crash
    for key in sorted(set(zip(*(grid.cases[name].tolist() for name in each), strict=True))) or [()]:
        chosen = dict(zip(each, key, strict=True))
        of = np.ones(len(grid), dtype=np.bool_)
        for name, value in chosen.items():
            of &= np.abs(grid.cases[name] - value) < _SAME
        figure = Figure(figsize=(4.2, 3.8), layout="constrained")
        axes = figure.add_subplot()
        _scatter(axes, found, of, cc)
        for name, (rows, color) in lines.items():
            here = [row for row in rows if all(abs(row[what] - value) < _SAME for what, value in chosen.items())]
            values = np.array([row[along] for row in here])
            values[~np.isfinite(values)] = np.nan
            axes.plot([row[over] for row in here], values, color=color, linewidth=1.0, label=f"boundary of {name}")
        axes.set_xlabel(_LABELS[over])
        axes.set_ylabel(_LABELS[along])
        speeds = [f"{3.6 * value:.0f} km/h" for value in key]
        axes.set_title(" behind ".join(speeds) or "leaders that brake", fontsize=9)
        # Below the axes: points fill all of them.
        figure.legend(fontsize=7, loc="outside lower center", ncols=3, frameon=False)
        yield "_".join([grid.manoeuvre, *(f"{3.6 * value:g}" for value in key)]).replace(".", "p"), figure


def _scatter(axes: Axes, found: Verdicts, of: Bools, cc: Bools) -> None:
    """The cases `of` a figure as points, one colour per class."""
    along, over, _ = _AXES[found.grid.manoeuvre]
    labels = list(CLASSES)
    classes = np.where(found.failed, labels.index("{} fails"), 0)
    classes[~found.failed & ~found.crash & cc] = labels.index("only cc hits")
    classes[found.crash & cc] = labels.index("both hit")
    classes[found.crash & ~cc] = labels.index("only {} hits")
    for code, label in enumerate(labels):
        here = of & (classes == code)
        if here.any():
            said = label.format(found.driver)
            said = _ALONE.get(said, said) if found.driver == "cc" else said
            x, y = found.grid.cases[over][here], found.grid.cases[along][here]
            axes.scatter(x, y, s=9, c=CLASSES[label], label=said, linewidths=0)
