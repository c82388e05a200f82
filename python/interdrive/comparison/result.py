"""What a comparison says: its tables and their columns."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from interdrive.comparison.metrics import METRICS
from interdrive.storage import Column, Origin
from interdrive.storage.html import html_table

if TYPE_CHECKING:
    from interdrive.comparison.paper import PaperTable
    from interdrive.comparison.variants import ComparedSet
    from interdrive.storage import ArrowTable

_WHICH = (
    Column("traffic", "label", "what vehicles do that are not under test"),
    Column("agents", "label", "agents under test"),
    Column("category", "label", "folder of the scenarios, or all"),
)

#: One row per traffic, agents, category and variant.
TABLE_COLUMNS = (
    *_WHICH,
    Column("variant", "label", "planner, with predictor, settings and version if there are several"),
    Column("runs", "integer", "runs that finished"),
    Column("runs_lost", "integer", "runs that failed, crashed or were ended; refused ones are not among them"),
    Column("n_agents", "integer", "agents under test that all variants drove; all else is about them"),
    Column("n_left_out", "integer", "agents under test that this variant drove and another one did not"),
    *(Column(metric.name, "number", metric.title, metric.unit, null="no agent has a value") for metric in METRICS),
)

_TOO_FEW = "fewer than 5 places have a value"

#: One row per traffic, agents, category, pair of variants and metric.
DIFFERENCE_COLUMNS = (
    *_WHICH,
    Column("variant", "label", "the one"),
    Column("other", "label", "the other one"),
    Column("metric", "label", "one of interdrive.comparison.METRICS"),
    Column(
        "difference",
        "number",
        "of the one minus the other, over agents that all variants drove",
        "of the metric",
        null="no agent has a value",
    ),
    Column("low", "number", "lower end of the interval", "of the metric", null=_TOO_FEW),
    Column("high", "number", "upper end of the interval", "of the metric", null=_TOO_FEW),
    Column("p", "number", "two-sided, that it is zero, adjusted for all pairs after Holm", "1", null=_TOO_FEW),
    Column("n_agents", "integer", "agents with a value of both"),
    Column("n_scenarios", "integer", "scenarios of these agents"),
    Column("n_places", "integer", "what intervals draw: places, files or agents"),
)


@dataclass(frozen=True)
class Comparison:
    """Planners of a batch compared.

    Attributes:
        table: The columns are `TABLE_COLUMNS`.
        differences: The columns are `DIFFERENCE_COLUMNS`.
        sets: What is compared, and over which agents; rows of both tables belong to one by traffic and agents.
        samples: Bootstrap samples. level: Coverage of the intervals. seed: Of the samples.
        group: What is drawn together: place, file or agent.
        paper: A table for a paper of each set, in their order.
        caveats: What the numbers do not prove, one line each.
        own: As `table`, over all agents that each variant drove, in all categories together; none is left out.
        origin: How it came about.
    """

    table: ArrowTable
    differences: ArrowTable
    sets: tuple[ComparedSet, ...]
    samples: int
    level: float
    seed: int
    caveats: tuple[str, ...]
    own: ArrowTable
    group: str = "place"
    paper: tuple[PaperTable, ...] = ()
    origin: Origin = field(default_factory=Origin)

    def __repr__(self) -> str:
        variants = dict.fromkeys(self.table["variant"].to_pylist())
        return f"<Comparison of {', '.join(variants)}>"

    def _repr_html_(self) -> str:
        """The table, for notebooks."""
        return html_table(self.table.column_names, self.table.to_pylist())
