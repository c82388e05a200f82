"""The look that all figures and the report share: colours, markers of outcomes, sizes on paper, axes."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from matplotlib import patheffects
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator, ScalarFormatter

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from matplotlib.axes import Axes

    from interdrive.run import RunRecord

#: A millimetre [in], and the width of a page [in].
MM = 1.0 / 25.4
PAGE = 180.0 * MM

#: Size of texts in figures as wide as a page [pt].
FONT = 7.5

INK = "#222222"
#: Recorded traffic: lines and frames, edges of footprints, fill of footprints, fill of static obstacles.
RECORDED, RECORDED_EDGE, TRAFFIC, STATIC = "#8c8c8c", "#5f5f5f", "#b4b4b4", "#6f6f6f"
#: Blinkers, as their light is on the road.
BLINKER = "#FFB000"
GOAL, PREDICTION, THRESHOLD, GRID = "#0072B2", "#7a3b8f", "#7a7a7a", "#e3e3e3"

#: Colours of agents, used in turn, on light and on dark ground. They can be told apart with every common kind of colour
#: blindness (Okabe and Ito; Tol).
_AGENTS = (
    ("#0072B2", "#4aa8e8"),
    ("#D55E00", "#f58a3c"),
    ("#009E73", "#2fcf9f"),
    ("#CC79A7", "#e8a0c8"),
    ("#E69F00", "#f5c04a"),
    ("#332288", "#9d92f0"),
    ("#56B4E9", "#9bd6f7"),
    ("#882255", "#d4679f"),
    ("#44AA99", "#7ad8c8"),
    ("#999933", "#cccc66"),
)
AGENTS = tuple(light for light, _ in _AGENTS)
ON_DARK = dict(_AGENTS)

#: A white rim around texts and lines on the map.
HALO = [patheffects.withStroke(linewidth=1.6, foreground="white")]


@dataclass(frozen=True)
class Mark:
    """Look of an outcome or event: matplotlib's marker, its size [pt], fill colour, hatch of bars, what legends say."""

    marker: str
    color: str
    size: float
    text: str
    hatch: str = ""


#: Outcomes from good to bad; shape and colour both tell them apart (colours: Okabe and Ito).
OUTCOME_MARKS = {
    "goal_reached": Mark("o", "#009E73", 4.0, "goal reached"),
    "goal_reached_late": Mark("^", "#56B4E9", 4.8, "goal reached late", "////"),
    "time_limit": Mark("s", "#E69F00", 4.0, "time limit", "...."),
    "goal_missed": Mark("D", "#CC79A7", 3.8, "goal missed", "\\\\\\\\"),
    "infeasible": Mark("v", "#F0E442", 5.0, "infeasible", "xxxx"),
    "planner_error": Mark("*", "#7f7f7f", 6.5, "planner error"),
    "collision": Mark("X", "#D55E00", 6.0, "collision"),
    "running": Mark("o", "#ffffff", 4.0, "still running"),
}

#: What else happens to agents during a run.
EVENT_MARKS = {
    "emergency_braking": Mark("8", "#E69F00", 4.0, "emergency plan"),
    "infeasible_plan": Mark("v", "#F0E442", 5.0, "infeasible plan"),
    "violation": Mark("D", "#D55E00", 4.0, "broken rule of the road"),
    "hold": Mark("s", "#56B4E9", 4.0, "holds for another agent"),
    "critical": Mark("P", "#CC79A7", 6.0, "critical moment"),
}

#: Stop lines by what their lights show, in the order of `interdrive.scenario.SIGNALS`: dark, green, yellow, red.
SIGNAL_COLORS = ("#ffffff", "#1a9850", "#f6c619", "#d73027")


def agent_colors(run: RunRecord) -> dict[int, str]:
    """The colour that each agent of a run has in every figure, by id."""
    return {agent.id: AGENTS[index % len(AGENTS)] for index, agent in enumerate(run.agents)}


def others_named(run: RunRecord, moving: str | None = None) -> list[tuple[str, str]]:
    """What participants that are not agents are called, with their colours: those that move, and those that never do.

    Args:
        run: The run.
        moving: What those that move are called; None: recorded traffic, or vehicles of SUMO.
    """
    others, stand = ~run.states.is_agent, run.states.is_static
    usual = "recorded traffic" if run.sumo is None else "vehicles of SUMO"
    found = [(moving or usual, TRAFFIC)] if (others & ~stand).any() else []
    return [*found, ("static obstacles", STATIC)] if (others & stand).any() else found


def pair_colors(runs: Sequence[RunRecord], pair: tuple[int, int]) -> tuple[str, str]:
    """Two different colours for two vehicles; agents have those of the run with the most agents."""
    known = agent_colors(max(runs, key=lambda run: len(run.agents)))
    first = known.get(pair[0]) or next(color for color in AGENTS if color != known.get(pair[1]))
    second = known.get(pair[1], first)
    return first, second if second != first else next(color for color in AGENTS if color != first)


def line_style(index: int, dashes: Sequence[Any] = ("-", (0, (4.5, 1.6)), (0, (1.2, 1.2)))) -> dict[str, Any]:
    """Colour and dashes of the agent with that index in its run; together they tell the lines apart."""
    return {"color": AGENTS[index % len(AGENTS)], "linestyle": dashes[index // len(AGENTS) % len(dashes)]}


class _Figure(Figure):
    """A figure that notebooks show without pyplot."""

    def _repr_png_(self) -> bytes:
        drawn = io.BytesIO()
        self.savefig(drawn, format="png")
        return drawn.getvalue()


def empty_figure(width: float, height: float, **options: Any) -> Figure:  # noqa: ANN401 - of matplotlib
    """A figure of that size [in], without pyplot."""
    figure = _Figure(figsize=(width, height), dpi=300, **options)
    FigureCanvasAgg(figure)
    return figure


def plain(axes: Axes, font: float = FONT, *, ticks: int | None = None) -> None:
    """Quiet axes with a grid; with a number of ticks on the vertical axis, or matplotlib's choice."""
    axes.grid(visible=True, color=GRID, linewidth=0.5)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=font - 0.5, length=2.5, width=0.5, pad=2)
    if ticks is not None:
        axes.yaxis.set_major_locator(MaxNLocator(ticks, steps=[1, 2, 5, 10]))
        axes.yaxis.set_major_formatter(ScalarFormatter(useOffset=False))
    for name, side in axes.spines.items():
        side.set(linewidth=0.5, color=RECORDED, visible=name in ("left", "bottom"))


def mark_style(outcome: str) -> dict[str, Any]:
    """Arguments of a line that is only the marker of an outcome."""
    mark = OUTCOME_MARKS[outcome]
    return {"ls": "", "marker": mark.marker, "ms": mark.size, "mfc": mark.color, "mec": INK, "mew": 0.5}


def mark_handles(outcomes: Sequence[str], *, count: bool = False) -> list[Line2D]:
    """Entries of a legend for the outcomes that occur, from good to bad."""
    return [
        Line2D([], [], label=mark.text + (f" ({outcomes.count(name)})" if count else ""), **mark_style(name))
        for name, mark in OUTCOME_MARKS.items()
        if name in outcomes
    ]


def add_legend(figure: Figure, handles: Iterable[Any], place: str, **options: Any) -> None:  # noqa: ANN401 - of matplotlib
    """A legend without frame at an edge of a figure ("upper center", "lower center", "lower left")."""
    anchor = (0.5 if "center" in place else 0.0, 1.0 if "upper" in place else 0.0)
    style: dict[str, Any] = {"fontsize": FONT, "frameon": False, "borderpad": 0.3, **options}
    figure.legend(handles=list(handles), loc=place, bbox_to_anchor=anchor, **style)
