"""What scores of a run look at: its traffic, times to contact straight on, and verdicts on collisions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from interdrive.scoring.drives import rear_axle_to_center, site_of, traffic
from interdrive.scoring.faults import verdicts

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from interdrive import _core
    from interdrive.array_types import Floats, Ints
    from interdrive.run import RunRecord
    from interdrive.scoring.drives import Site
    from interdrive.scoring.faults import Verdict
    from interdrive.scoring.settings import ScoringSettings


@dataclass(frozen=True)
class Seen:
    """What is looked up once for all scores of some agents.

    Attributes:
        ids: The agents, ascending.
        site: Road and recording.
        traffic: As simulated.
        times: Times to contact straight on and the other one's id, at all columns, by agent.
        verdicts: On their collisions with other participants, by agent.
    """

    ids: tuple[int, ...]
    site: Site
    traffic: _core.Traffic
    times: Mapping[int, tuple[Floats, Ints]]
    verdicts: Mapping[int, Verdict]

    @classmethod
    def of(cls, run: RunRecord, ids: Sequence[int], settings: ScoringSettings) -> Seen:
        """All that is seen of some agents of a run."""
        wanted = sorted(ids)
        site = site_of(run, run.settings.get("settings") or {})
        simulated = traffic(site, run)
        lengths = dict(zip(run.states.participant_id.tolist(), run.states.length.tolist(), strict=True))
        axles = [rear_axle_to_center(lengths[number]) for number in wanted]
        times, partners = simulated.straight_times(wanted, axles, settings.ttc_horizon, 1)
        found = dict(zip(wanted, zip(times, partners, strict=True), strict=True))
        return cls(tuple(wanted), site, simulated, found, verdicts(run, simulated, wanted, settings))
