"""Every figure of a run by its name."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from interdrive.criticality import evaluate
from interdrive.errors import InputError
from interdrive.plots.messages import draw_messages
from interdrive.plots.paper import LINES_MAX, chosen_agents, draw_measures, draw_scene, draw_trajectories, draw_velocity
from interdrive.plots.still import draw_run

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from interdrive.run import RunRecord

#: Kinds of figures of a run; a scene is at a time in seconds.
KINDS = ("run", "trajectories", "velocity", "criticality", "messages", "scene@SECONDS")


def draw_figure(
    run: RunRecord,
    kind: str = "run",
    *,
    agents: Sequence[int] | None = None,
    measures: Sequence[str] = ("ttc", "thw"),
    columns: int | None = None,
) -> Figure:
    """A figure of a run, as wide as one or two columns of a paper.

    Args:
        run: What happened.
        kind: One of `KINDS`, such as "velocity" or "scene@3.5".
        agents: Ids of the agents to draw; all by default ("run" always shows all).
        measures: Of "criticality", one panel each.
        columns: Width: one is 88 mm, two are 180 mm; by default what suits the kind.

    Raises:
        InputError: No such kind; an id that is not an agent of the run; too many agents for lines; an impossible width.
    """
    if columns not in (None, 1, 2):
        raise InputError(f"columns must be 1 or 2, not {columns!r}")
    if agents is not None:
        chosen_agents(run, agents)
    measures = (measures,) if isinstance(measures, str) else measures
    name, seconds = figure_kind(kind)
    if seconds is not None:
        return draw_scene(run, run.plans, seconds, agents, columns=columns or 1)
    if name == "velocity":
        return draw_velocity(run, agents, columns=columns or 1)
    if name == "criticality":
        shown = chosen_agents(run, agents, LINES_MAX)
        return draw_measures(evaluate(run), shown, measures, columns=columns or 1)
    if name == "messages":
        if agents is not None:
            raise InputError("the figure of messages shows all agents; leave them out")
        return draw_messages(run, columns=columns or 1)
    if name == "trajectories":
        return draw_trajectories(run, agents, columns=columns or 2)
    return draw_run(run)


def figure_kind(kind: str) -> tuple[str, float | None]:
    """A kind without its time, and the time of a scene [s].

    Raises:
        InputError: No such kind, or a time that is not a number.
    """
    name, _, moment = kind.partition("@")
    if name != "scene":
        if kind not in KINDS:
            raise InputError(f"kind {kind}", f"no such figure; the kinds are {', '.join(KINDS)}")
        return kind, None
    try:
        seconds = float(moment)
    except ValueError:
        seconds = math.nan
    if not math.isfinite(seconds):
        raise InputError(f"kind {kind}", "write the time in seconds, for instance scene@3.5")
    return name, seconds
