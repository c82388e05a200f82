"""The figure of an evaluation: distributions of recorded and simulated vehicles. Loads matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from interdrive.plots.style import AGENTS, FONT, MM, PAGE, RECORDED, add_legend, empty_figure
from interdrive.traffic_realism.measures import QUANTITIES
from interdrive.traffic_realism.summary import halves

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from interdrive.array_types import Floats
    from interdrive.traffic_realism.result import Realism

#: Rows of the tables that the figure leaves out: they say nothing about distributions.
_LEFT_OUT = ("constant_velocity",)
#: Heights: a panel, above and below it [inches].
_PANEL, _HEAD, _FOOT = 32.0 * MM, 9.0 * MM, 10.0 * MM
#: Bins of a histogram, and the share of samples that its range leaves out on each side.
_BINS, _TAIL = 40, 0.002
#: How opaque the recording and the floor are.
_AREA, _BAND = 0.3, 0.6


def draw_distributions(found: Realism) -> Figure:
    """A figure, 180 mm wide: for each place a row of histograms.

    The recording is an area, planners are lines, and the floor is a band: between its edges lie nine of ten halves of
    the recording.
    """
    places = list(dict.fromkeys(place for place, _, _ in found.windows))
    height = _HEAD + len(places) * (_PANEL + _FOOT)
    figure = empty_figure(PAGE, height)
    names = [name for name in found.measures if name not in (*_LEFT_OUT, "recorded")]
    colors = {name: AGENTS[i % len(AGENTS)] for i, name in enumerate(names)}
    width = 1.0 / len(QUANTITIES)
    for row, place in enumerate(places):
        bottom = 1.0 - (_HEAD + (row + 1) * (_PANEL + _FOOT) - _FOOT) / height
        for column, (quantity, unit) in enumerate(QUANTITIES.items()):
            panel = figure.add_axes((column * width + 0.008, bottom, width - 0.016, _PANEL / height))
            recorded = _samples(found, "recorded", place, quantity)
            rows = {name: np.concatenate(_samples(found, name, place, quantity)) for name in names}
            _draw(panel, recorded, rows, colors)
            panel.set_xlabel(f"{quantity.replace('_', ' ')} [{unit}]", fontsize=FONT)
            if column == 0:
                panel.set_title(place, fontsize=FONT, loc="left")
    panel = figure.axes[0]
    lines: list[Artist] = [
        panel.fill_between([], [], color=RECORDED, alpha=_AREA, label="recorded"),
        panel.fill_between([], [], color=RECORDED, alpha=_BAND, label="floor: halves of the recording"),
    ]
    lines += [panel.plot([], [], color=colors[name], linewidth=1.0, label=name)[0] for name in names]
    add_legend(figure, lines, "upper center", ncols=len(lines))
    return figure


def _samples(found: Realism, name: str, place: str, quantity: str) -> list[Floats]:
    """Of each window of a place."""
    return [
        part.samples[quantity]
        for (where, _, _), part in zip(found.windows, found.measures[name], strict=True)
        if where == place
    ]


def floor_band(windows: Sequence[Floats], edges: Floats) -> tuple[Floats, Floats] | None:
    """Between which shares nine of ten halves of a recording have a bin; None with fewer than two windows.

    Args:
        windows: Samples of each window.
        edges: Of the bins, shape (bins + 1,).

    Returns:
        The 5 and the 95 % quantile of the share of each bin, shape (bins,).
    """
    if len(windows) < 2:
        return None
    counts = np.array([np.histogram(values, edges)[0] for values in windows], dtype=np.float64)
    sizes = np.array([len(values) for values in windows], dtype=np.float64)
    shares = []
    for half in halves(len(windows), 0):
        shares += [counts[own].sum(axis=0) / sizes[own].sum() for own in (half, ~half) if sizes[own].sum() > 0.0]
    low, high = np.quantile(shares, (0.05, 0.95), axis=0)
    return low, high


def _draw(panel: Axes, windows: list[Floats], rows: dict[str, Floats], colors: dict[str, str]) -> None:
    panel.set_yticks([])
    panel.tick_params(labelsize=FONT)
    recorded = np.concatenate(windows) if windows else np.empty(0)
    if not recorded.size:
        return
    low, high = np.quantile(recorded, (_TAIL, 1.0 - _TAIL)).tolist()
    room = 0.15 * max(high - low, 1e-3)
    edges = np.linspace(low - room, high + room, _BINS + 1)
    middles = 0.5 * (edges[1:] + edges[:-1])
    panel.fill_between(
        middles, np.histogram(recorded, edges)[0] / len(recorded), color=RECORDED, alpha=_AREA, linewidth=0
    )
    band = floor_band(windows, edges)
    if band is not None:
        panel.fill_between(middles, *band, color=RECORDED, alpha=_BAND, linewidth=0)
    for name, values in rows.items():
        if values.size:
            panel.plot(middles, np.histogram(values, edges)[0] / len(values), color=colors[name], linewidth=1.0)
    panel.set_ylim(bottom=0.0)
