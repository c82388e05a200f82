"""What a search records: a row for every run, and the failures that are new."""

from __future__ import annotations

import shutil
from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from interdrive.errors import InterdriveError
from interdrive.failure_search.failures import failures
from interdrive.failure_search.trials import Driven, signature

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from interdrive.failure_search.allocation import Proposal
    from interdrive.failure_search.disturbances import Pair
    from interdrive.failure_search.keeping import Kept
    from interdrive.failure_search.search_folder import SearchFolder
    from interdrive.failure_search.trials import Setup


@dataclass
class Record:
    """The record of a search.

    Attributes:
        folder: Where it is written.
        setup: Of the search.
        pairs: Its agents.
        keep: So many failures of one signature are kept.
    """

    folder: SearchFolder
    setup: Setup
    pairs: Sequence[Pair]
    keep: int
    _attempts: Counter[str] = field(default_factory=Counter)
    _digests: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        """Counts what the folder has."""
        for row in self.folder.rows:
            self.is_to_be_kept(row)

    def row(self, proposal: Proposal, driven: Driven | InterdriveError) -> dict[str, Any]:
        """The row of a run, not yet kept; of a run that is lost with the reason."""
        pair = self.pairs[proposal.pair]
        if isinstance(driven, InterdriveError):
            driven = Driven((), 0, None, str(driven))
        found = driven.judged
        row: dict[str, Any] = {
            "index": proposal.index,
            "pair": proposal.pair,
            "scenario": pair.scenario,
            "agent_id": pair.agent_id,
            "source": proposal.source,
            "uniform": proposal.source == "uniform",
            "draws": driven.draws,
            "point": list(driven.point),
            "disturbance": driven.disturbance,
            **dict.fromkeys(("outcome", "criticality")),
            **dict.fromkeys(("failure", "signature", "folder", "shrunk", "witness", "digest"), ""),
            "partner_id": -1,
        }
        if found is None:
            return row
        return row | {
            "outcome": found.outcome,
            "criticality": found.criticality,
            "failure": found.failure,
            "partner_id": found.partner_id,
            "digest": found.digest,
            "signature": signature(pair, found),
        }

    def is_to_be_kept(self, row: Mapping[str, Any]) -> bool:
        """Whether a failure is new: few of its signature came before it, and none that is equal. Rows come in order."""
        name = row["signature"]
        if not name or self._attempts[name] >= self.keep or row["digest"] in self._digests:
            return False
        self._attempts[name] += 1
        self._digests.add(row["digest"])
        return True

    def kept(self, row: dict[str, Any], kept: Kept | None, how: str) -> dict[str, Any]:
        """Stores a failure, of which `how` says whether it was made small (`search_folder.SHRUNK`).

        The row stays as it is if there is nothing to keep, or if the same run is kept already.
        """
        if kept is None:
            return row
        named = {one["folder"] for one in self.folder.rows if one["folder"]}
        known = {one.digest for one in failures(self.folder.path) if one.folder.name in named}
        if kept.failure.digest in known:
            return row
        name = f"{1 + len(named):03d}"
        # Ctrl-C may have come between the folder of this failure and its row.
        shutil.rmtree(self.folder.path / "failures" / name, ignore_errors=True)
        kept.unpack(self.folder.path / "failures" / name)
        return row | {"folder": name, "witness": kept.failure.witness, "shrunk": how}
