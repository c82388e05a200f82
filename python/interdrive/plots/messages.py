"""Messages of a run: how old the plans are that agents have of each other, and how far messages get."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.errors import InputError
from interdrive.plots.paper import WIDTHS
from interdrive.plots.style import AGENTS, MM, empty_figure, plain
from interdrive.run import SERVICES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from interdrive.array_types import Floats
    from interdrive.run import RunRecord

_FONT, _HEIGHT = 7.0, 80.0 * MM
#: Number of bins of the distance.
_BINS = 12


def draw_messages(run: RunRecord, *, columns: int = 1) -> Figure:
    """Age of the newest plan that an agent has of another one over time, and share of messages received over distance.

    Args:
        run: The run, with the setting `record.messages=links`.
        columns: Width: 1 (88 mm) or 2 (180 mm).

    Raises:
        InputError: The run kept no links of messages, or no plan was sent.
    """
    if run.messages is None or not (run.messages.receiver_id >= 0).any():
        raise InputError("this run kept no links of messages; simulate it with `--set record.messages=links` and V2X")
    time, ages = plan_ages(run)
    distance, share = received_share(run)
    figure = empty_figure(WIDTHS[columns] * MM, _HEIGHT, layout="constrained")
    above, below = figure.subplots(2, 1)
    colour = AGENTS[0]
    if np.isfinite(ages).any():
        known = np.isfinite(ages).any(axis=0)
        above.plot(time[known], np.nanmean(ages[:, known], axis=0), color=colour, linewidth=1.0, label="mean")
        low, high = np.nanquantile(ages[:, known], [0.05, 0.95], axis=0)
        above.fill_between(time[known], low, high, color=colour, alpha=0.2, linewidth=0, label="5 to 95 %")
        above.legend(fontsize=_FONT, frameon=False, ncols=2, loc="upper right")
    above.set_ylim(0.0, 1.25 * max(above.get_ylim()[1], run.scenario.dt))
    above.set_xlabel("time [s]", fontsize=_FONT)
    above.set_ylabel("age of a plan [s]", fontsize=_FONT)
    below.plot(distance, share, "o-", color=colour, linewidth=1.0, markersize=2.5)
    below.set_ylim(0.0, 1.05)
    below.set_xlim(left=0.0)
    below.set_xlabel("distance [m]", fontsize=_FONT)
    below.set_ylabel("received", fontsize=_FONT)
    for axes in (above, below):
        plain(axes, _FONT, ticks=5)
    return figure


def plan_ages(run: RunRecord) -> tuple[Floats, Floats]:
    """How old the newest plan is that an agent has received from another one, while both are there.

    Returns:
        Times [s], shape (steps,); ages [s], shape (pairs, steps), nan where all plans are forgotten.

    Raises:
        InputError: No messages were kept.
    """
    if run.messages is None:
        raise InputError("this run kept no messages")
    found, states = run.messages, run.states
    arrived = (found.service == SERVICES.index("mcm")) & (found.arrived >= 0)
    pairs, pair = np.unique(
        np.column_stack([found.receiver_id[arrived], found.sender_id[arrived]]), axis=0, return_inverse=True
    )
    steps = np.arange(states.first_time_step, states.first_time_step + states.n_steps)
    newest = np.full((len(pairs), states.n_steps), -np.inf)
    column = found.arrived[arrived] - states.first_time_step
    inside = column < states.n_steps
    np.maximum.at(newest, (pair.ravel()[inside], column[inside]), found.time_step[arrived][inside].astype(np.float64))
    ages = run.scenario.dt * (steps - np.maximum.accumulate(newest, axis=1))
    rows = np.searchsorted(states.participant_id, pairs)
    there = states.valid[rows[:, 0]] & states.valid[rows[:, 1]]
    oldest: Any = run.settings["settings"]["v2x.age_max"]
    time: Floats = run.scenario.dt * steps.astype(np.float64)
    return time, np.where(there & (ages < oldest + 1e-9), ages, np.nan)


def received_share(run: RunRecord) -> tuple[Floats, Floats]:
    """Which share of the messages got through at which distance, up to the range: beyond it losses are not kept.

    Returns:
        Distances, the middle of each bin [m], and shares; bins without a message are left out.

    Raises:
        InputError: No messages were kept.
    """
    if run.messages is None:
        raise InputError("this run kept no messages")
    reach: Any = run.settings["settings"]["v2x.range"]
    link = (run.messages.receiver_id >= 0) & (run.messages.distance <= reach)
    distance, got = run.messages.distance[link], run.messages.arrived[link] >= 0
    edges = np.linspace(0.0, max(1.0, float(distance.max(initial=0.0))) * (1.0 + 1e-9), _BINS + 1)
    number, _ = np.histogram(distance, edges)
    received, _ = np.histogram(distance[got], edges)
    filled = number > 0
    middle: Floats = 0.5 * (edges[1:] + edges[:-1])
    share: Floats = received[filled] / number[filled]
    return middle[filled], share
