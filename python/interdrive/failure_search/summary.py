"""What a search on disk found: its failures, its runs, and what these brought; several of them as rows of a table."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from interdrive.errors import ResultsError
from interdrive.failure_search.failures import Failure, failures
from interdrive.failure_search.likeness import likeness_in
from interdrive.failure_search.rates import Yield, is_lost, said_rate, said_ratio, yields
from interdrive.failure_search.search_folder import described, logged

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from interdrive.failure_search.likeness import Likeness

#: Headings of the rows of `compared`.
HEAD = (
    *("search", "planner", "runs", "lost", "uniform runs", "fail", "rate [%]", "95 %"),
    *("directed fail", "times uniform", "95 % of it", "different", "at equal runs"),
    *("failures", "avoidable", "agents", "others look recorded"),
)


@dataclass(frozen=True)
class Summary:
    """A search on disk.

    Attributes:
        folder: Where it is.
        planner: The planner under test.
        rows: Its runs, with the columns of the table.
        failures: Failures that are kept.
        yields: What its runs brought by where their points come from, the uniform ones first.
        undisturbed: Agents that fail without any disturbance.
        likeness: Whether the other vehicles of failures look recorded; None: not measured.
    """

    folder: Path
    planner: str
    rows: Sequence[Mapping[str, Any]]
    failures: tuple[Failure, ...]
    yields: tuple[Yield, ...]
    undisturbed: tuple[str, ...]
    likeness: Likeness | None

    @classmethod
    def of(cls, folder: str | Path) -> Summary:
        """Reads a search, which may still go on.

        Raises:
            ResultsError: The folder holds no search, or it is damaged.
        """
        about, rows = described(folder), logged(folder)
        try:
            failing = tuple(f"{name} {agent}" for name, agent, how in about["undisturbed"] if how and how[0] != "!")
            kept, alike = tuple(failures(folder)), likeness_in(folder)
            return cls(Path(folder), str(about["planner"]), rows, kept, yields(rows), failing, alike)
        except (KeyError, TypeError, ValueError) as error:
            raise ResultsError(f"{folder}: the search is damaged ({error!r}); search anew in another folder") from error

    @property
    def kinds(self) -> Counter[str]:
        """Failures that are kept, by kind."""
        return Counter(one.failure for one in self.failures)

    @property
    def agents(self) -> int:
        """Number of agents that fail in some run."""
        return len({(row["scenario"], row["agent_id"]) for row in self.rows if row["failure"]})

    def cells(self) -> tuple[str, ...]:
        """Its row of a table with the headings `HEAD`."""
        uniform, directed = self.yields[0], self.yields[-1]
        is_directed = directed.source == "directed"
        return (
            self.folder.name,
            self.planner,
            str(len(self.rows)),
            str(sum(is_lost(row) for row in self.rows)),
            str(uniform.runs),
            str(uniform.failures),
            *said_rate(uniform.rate),
            f"{directed.failures} of {directed.runs}" if is_directed else "",
            *(said_ratio(directed.ratio) if is_directed else ("", "")),
            str(len({row["signature"] for row in self.rows if row["failure"]})),
            f"{directed.alike[0]:.1f}, uniform {directed.alike[1]:.1f}" if is_directed else "",
            str(len(self.failures)),
            str(sum(bool(one.witness) for one in self.failures)),
            str(self.agents),
            "" if self.likeness is None else f"{self.likeness.alike} of {self.likeness.vehicles}",
        )


def compared(folders: Sequence[str | Path]) -> list[Summary]:
    """The searches in some folders, in this order.

    Raises:
        ResultsError: A folder holds no search, or it is damaged.
    """
    return [Summary.of(folder) for folder in folders]
