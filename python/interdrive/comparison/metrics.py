"""What planners are compared by: one number per agent and metric, and how agents are put together."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.comparison.intervals import mean_of_files
from interdrive.criticality import Measure, measure_named
from interdrive.run import VIOLATIONS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from interdrive.array_types import Floats


@dataclass(frozen=True)
class Metric:
    """One metric.

    Attributes:
        name: In tables.
        heading: For people, with unit.
        column: Of the data set; an outcome counts the agents that ended so.
        better: +1: more is better, -1: less is better, 0: neither by itself.
        outcome: Whether `column` is an outcome.
        off_lanelets_max: It counts only if the body never reached further beyond the lanelets [m].
        scale: Values are multiplied by this.
        absent: Value of agents without one; nan: they do not count.
        median: Agents are put together by their median, otherwise by their mean.
        by_file: The mean is over files of the means of their agents, as `interdrive score` and `benchmark` have it.
        rule: Whether it counts violations of one rule of the road.
        traffic: Whether it is about the generated traffic around agents, which few batches have.
        digits: Behind the point.
        measure: The criticality measure whose texts its values have; None for other numbers.
    """

    name: str
    heading: str
    column: str
    better: int
    outcome: bool = False
    off_lanelets_max: float = float("inf")
    scale: float = 1.0
    absent: float = float("nan")
    median: bool = False
    by_file: bool = False
    rule: bool = False
    traffic: bool = False
    digits: int = 1
    measure: Measure | None = None

    @property
    def title(self) -> str:
        """The heading without unit."""
        return re.sub(r" (\[[^\]]+\]|%)$", "", self.heading)

    @property
    def unit(self) -> str:
        """Unit of the values: what the heading has in brackets, or how many they are of 100."""
        found = re.search(r"\[([^\]]+)\]$", self.heading)
        return found[1] if found else "1" if self.scale == 1.0 else "%"

    def values(self, columns: Mapping[str, NDArray[Any]]) -> Floats:
        """One value per agent.

        Args:
            columns: Of the data set, as numpy arrays; absent numbers are nan.
        """
        if self.outcome:
            ended = columns["outcome"] == self.column
            if self.off_lanelets_max < float("inf"):
                ended = ended & (np.asarray(columns["off_lanelets"], dtype=np.float64) <= self.off_lanelets_max)
            share: Floats = self.scale * ended.astype(np.float64)
            return share
        found = np.asarray(columns[self.column], dtype=np.float64)
        values: Floats = self.scale * np.where(np.isnan(found), self.absent, found)
        return values


#: A body that never reaches further beyond the lanelets stays on them, whatever the judge of the road allows [m].
ON_LANELETS = 0.1

#: In the order of tables. Shares and rates are per agent under test.
METRICS = (
    Metric("score", "score", "score", better=1, scale=100.0, by_file=True),
    Metric("pace", "pace", "pace", better=1, digits=2),
    Metric("hindrance", "hindrance", "hindrance", better=1, digits=2),
    Metric("score_1", "score 1", "score_1", better=1, scale=100.0, by_file=True),
    Metric("at_fault", "at fault per 100", "fault", better=-1, scale=100.0, digits=2),
    Metric("goal_reached", "reached %", "goal_reached", better=1, outcome=True, scale=100.0),
    Metric(
        "goal_reached_on_lanelets",
        "reached on lanelets %",
        "goal_reached",
        better=1,
        outcome=True,
        off_lanelets_max=ON_LANELETS,
        scale=100.0,
    ),
    Metric("goal_reached_late", "late %", "goal_reached_late", better=0, outcome=True, scale=100.0),
    Metric("time_limit", "time limit %", "time_limit", better=-1, outcome=True, scale=100.0),
    Metric("goal_missed", "missed %", "goal_missed", better=-1, outcome=True, scale=100.0),
    Metric("infeasible", "infeasible %", "infeasible", better=-1, outcome=True, scale=100.0),
    Metric("planner_error", "broken %", "planner_error", better=-1, outcome=True, scale=100.0),
    Metric("collisions", "collisions per 100", "collision", better=-1, outcome=True, scale=100.0, digits=2),
    Metric(
        "preventable_cc", "of them cc avoids per 100", "preventable_cc", better=-1, scale=100.0, absent=0.0, digits=2
    ),
    Metric("violations", "violations per 100", "violations", better=-1, scale=100.0),
    *(
        Metric(f"n_{name}", name.replace("_", " "), f"n_{name}", better=-1, scale=100.0, rule=True)
        for name in VIOLATIONS
    ),
    Metric("harm", "harm per 100", "harm", better=-1, scale=100.0, absent=0.0, digits=3),
    Metric("ttc_min", "min TTC [s]", "ttc_min", better=1, median=True, digits=2, measure=measure_named("ttc")),
    Metric("ttc_critical", "TTC < 2 s %", "ttc_critical", better=-1, scale=100.0, digits=2),
    Metric("jerk_rms", "jerk [m/s³]", "jerk_rms", better=-1, digits=2),
    Metric("lateral_acceleration_rms", "lat. acc. [m/s²]", "lateral_acceleration_rms", better=-1, digits=2),
    Metric("plan_ms", "plan [ms]", "plan_seconds", better=-1, scale=1000.0, digits=3),
    Metric("traffic_flow", "traffic flow [1/h]", "traffic_flow", better=1, by_file=True, traffic=True, digits=0),
    Metric("traffic_speed", "traffic speed [m/s]", "traffic_speed", better=1, by_file=True, traffic=True, digits=2),
    Metric("traffic_wait", "traffic waits [s]", "traffic_wait", better=-1, by_file=True, traffic=True),
    Metric("traffic_queue", "queue", "traffic_queue", better=-1, by_file=True, traffic=True),
)

#: Those that are stacked: every agent counts in exactly one of them.
SHARES = tuple(metric for metric in METRICS if metric.outcome and metric.off_lanelets_max == float("inf"))


def together(metric: Metric, values: Floats, files: Sequence[str]) -> float:
    """The metric of several agents, with the file of each; nan without any."""
    if metric.by_file:
        return mean_of_files(values, files)[0]
    known = values[~np.isnan(values)]
    if not len(known):
        return float("nan")
    if not metric.median:
        return float(np.mean(known))
    return float(weighted_medians(known, np.ones((1, len(known))))[0])


def weighted_medians(values: Floats, weights: Floats) -> Floats:
    """The lower median for every row of weights; works with infinite values.

    Args:
        values: Shape (n,).
        weights: Whole numbers of at least 0, shape (rows, n).

    Returns:
        Shape (rows,); nan where all weights are 0.
    """
    order = np.argsort(values, kind="stable")
    sums = np.cumsum(weights[:, order], axis=1)
    half = 0.5 * sums[:, -1:]
    place = (sums >= half).argmax(axis=1)
    found: Floats = np.where(half[:, 0] > 0, values[order][place], np.nan)
    return found
