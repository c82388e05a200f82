"""The speed of one agent over time, with its phases shaded and named."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from interdrive.plots.style import FONT, INK, MM, PAGE, empty_figure, mark_style, plain
from interdrive.results.story import agent_named, ending
from interdrive.run.phases import phases

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from interdrive.array_types import Floats
    from interdrive.run import RunRecord

#: Shades of phases; driving has none.
_SHADES = {"slowing": "#F5DFA8", "standing": "#BFD7EA", "reversing": "#D8CBE6", "emergency braking": "#F2B8A0"}

#: Colour of drives of others in its place.
_INSTEAD = "#D55E00"

#: Narrower phases have no text in them, as a part of the whole.
_NARROW = 0.04


def draw_story(run: RunRecord, agent_id: int, instead: Sequence[tuple[str, Floats, Floats]] = ()) -> Figure:
    """A figure, 180 mm wide: speed over time, shaded phases with the vehicle ahead, the outcome as a marker.

    Args:
        run: The run.
        agent_id: The agent.
        instead: Drives of others in its place, as dashed lines: name, times [s] and speeds [m/s].

    Raises:
        InputError: It is not an agent of the run.
    """
    agent, dt = agent_named(run, agent_id), run.scenario.dt
    figure = empty_figure(PAGE, 70.0 * MM, layout="constrained")
    axes = figure.add_subplot()
    states = run.states
    row = int(np.searchsorted(states.participant_id, agent_id))
    columns = np.flatnonzero(states.valid[row])
    time, speed = (columns + states.first_time_step) * dt, states.velocity[row, columns]
    done = phases(run, agent)
    top = 1.25 * max(float(np.max(speed, initial=0.0)), 1.0)
    for phase in done:
        start, end = phase.first_time_step * dt, (phase.last_time_step + 1) * dt
        if phase.kind in _SHADES:
            axes.axvspan(start, end, color=_SHADES[phase.kind], linewidth=0.0)
        if end - start > _NARROW * (time[-1] - time[0]):
            text = phase.kind.replace(" ", "\n") + (f"\nbehind {phase.leader_id}" if phase.leader_id >= 0 else "")
            axes.text(0.5 * (start + end), 0.98 * top, text, ha="center", va="top", fontsize=FONT - 1.5, color=INK)
    axes.plot(time, speed, color=INK, linewidth=1.0)
    for name, when, speeds in instead:
        axes.plot(when, speeds, color=_INSTEAD, linewidth=1.0, linestyle="--", label=name)
    if instead:
        axes.legend(fontsize=FONT - 1.5, loc="lower left", frameon=False)
    if len(columns):
        outcome = run.outcomes.outcome[int(np.searchsorted(run.outcomes.agent_id, agent_id))]
        axes.plot(time[-1:], speed[-1:], clip_on=False, **mark_style(outcome))
    axes.set_ylim(min(0.0, float(np.min(speed, initial=0.0))), top)
    axes.set_xlabel("time [s]", fontsize=FONT)
    axes.set_ylabel("speed [m/s]", fontsize=FONT)
    title = ending(run, agent_id).replace("$", r"\$")  # foreign text is no formula
    axes.set_title(title, fontsize=FONT, loc="left", wrap=True)
    plain(axes)
    return figure
