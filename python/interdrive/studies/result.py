"""One encounter in every degree of interaction, and its table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from interdrive.storage import Column, arrow_table
from interdrive.storage.html import html_table
from interdrive.studies.measures import MEASURES, collided

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from interdrive.runs import Run
    from interdrive.scenario import Scenario
    from interdrive.storage import ArrowTable

#: How much the other vehicle reacts: it replays its recording, it adjusts its speed on its recorded path, it plans as
#: the agent does.
DEGREES = ("deterministic", "semi_deterministic", "interactive")


@dataclass(frozen=True)
class CaseStudy:
    """One encounter in every degree of interaction.

    Attributes:
        scenario: What was simulated.
        agent: Id of the vehicle that always plans.
        other: Id of the vehicle whose behaviour is varied.
        planner: Name of the planner of the agent and, in the interactive degree, of the other vehicle.
        runs: One per degree, in the order of `DEGREES`. In the deterministic run the other vehicle is not an agent.
    """

    scenario: Scenario
    agent: int
    other: int
    planner: str
    runs: Mapping[str, Run]

    def __repr__(self) -> str:
        return f"<CaseStudy of {self.scenario.name}: agent {self.agent}, other {self.other}, planner {self.planner}>"

    def _repr_html_(self) -> str:
        """The table, for notebooks."""
        return html_table(self.table.column_names, self.table.to_pylist())

    @property
    def name(self) -> str:
        """Scenario and pair, as one word."""
        return f"{self.scenario.name}_{self.agent}_{self.other}"

    @property
    def table(self) -> ArrowTable:
        """One row per degree; the columns are those of `interdrive.studies.study_table`."""
        return study_table([self])


_COLUMNS = (
    Column("scenario", "label", "name of the scenario"),
    Column("agent_id", "integer", "the vehicle that always plans"),
    Column("other_id", "integer", "the vehicle whose behaviour is varied"),
    Column("degree", "label", "one of interdrive.studies.DEGREES"),
    Column("planner", "label", "planner of the agent"),
    Column("other_planner", "label", "planner of the other vehicle; recorded: it replays its recording"),
    *(measure.column for measure in MEASURES),
    Column("collided", "truth", "the two collided with each other"),
    Column("agent_outcome", "label", "one of interdrive.run.OUTCOMES"),
    Column(
        "other_outcome",
        "label",
        "one of interdrive.run.OUTCOMES; none for a recording",
        null="it replays its recording",
    ),
)


def study_table(studies: Sequence[CaseStudy]) -> ArrowTable:
    """One row per case of `studies` and degree, as an Arrow table (`to_pandas()`, `polars.from_arrow`).

    Columns: scenario, agent_id, other_id, degree, planner, other_planner, one per entry of `MEASURES`, collided,
    agent_outcome, other_outcome.
    """
    rows = [_row(study, degree, run) for study in studies for degree, run in study.runs.items()]
    return arrow_table(_COLUMNS, {column.name: [row[column.name] for row in rows] for column in _COLUMNS})


def _row(study: CaseStudy, degree: str, run: Run) -> dict[str, object]:
    ended = run.outcomes
    planners = dict(zip(ended.agent_id.tolist(), ended.planner, strict=True))
    outcomes = dict(zip(ended.agent_id.tolist(), ended.outcome, strict=True))
    return {
        "scenario": study.scenario.name,
        "agent_id": study.agent,
        "other_id": study.other,
        "degree": degree,
        "planner": planners[study.agent],
        "other_planner": planners.get(study.other, "recorded"),
        **{measure.column.name: measure.of(run, study.agent, study.other) for measure in MEASURES},
        "collided": collided(run, study.agent, study.other),
        "agent_outcome": outcomes[study.agent],
        "other_outcome": outcomes.get(study.other),
    }
