"""Messages of a run and what they were good for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.run.arrays import SERVICES, Agreements, Messages

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from interdrive import _core
    from interdrive.native_settings import V2xSettings
    from interdrive.run.arrays import Plans
    from interdrive.run.record import Json

#: Bit rate of the radio [bit/s]: ITS-G5 with its default modulation.
_BIT_RATE = 6e6
#: A plan that ends earlier is not used [s].
_SHORTEST_PLAN = 1.0


def messages_of(parts: Mapping[str, Any] | None) -> Messages:
    """The record of messages; without any if no agent has V2X."""
    return Messages.empty() if parts is None else Messages(**{name: parts[name] for name in Messages.stored})


def agreements_of(parts: Mapping[str, Any]) -> Agreements:
    """The record of agreements, sorted."""
    order = np.lexsort((parts["holding_id"], parts["first_time_step"]))
    return Agreements(**{name: parts[name][order] for name in Agreements.stored})


def cooperation_notes(settings: V2xSettings, equipped: Sequence[int], plans: Plans, dt: float) -> list[str]:
    """Why messages are of no use, one line each.

    Args:
        settings: Those of cooperation.
        equipped: Ids of the agents with V2X.
        plans: All plans.
        dt: Time between steps [s].
    """
    if not equipped:
        share = settings.penetration
        return [f"v2x.penetration: {share:g} of the agents rounds to none: no agent has V2X"] if share > 0 else []
    notes = []
    arrival = max(1, int(np.ceil(settings.delay / dt - 1e-9))) * dt
    if arrival > settings.age_max + 1e-9:
        notes.append(
            f"v2x.delay: messages arrive after {arrival:g} s and are discarded after {settings.age_max:g} s"
            " (v2x.age_max): no message can ever be used"
        )
    lengths = np.isfinite(plans.x).sum(axis=1) if plans.x.size else np.empty(0, dtype=np.int64)
    for agent in equipped if settings.mcm else ():
        longest = dt * (int(lengths[plans.agent_id == agent].max(initial=0)) - 1)
        told = int(longest / settings.plan_spacing + 1e-9) * settings.plan_spacing
        if longest >= 0.0 and told < _SHORTEST_PLAN - 1e-9:
            notes.append(f"agent {agent}: its plans are shorter than {_SHORTEST_PLAN:g} s, so others do not use them")
    return notes


class PlanAges:
    """Collects how old the received plans are with which agents plan."""

    def __init__(self) -> None:
        """Starts empty."""
        self._ages: list[NDArray[np.float64]] = []
        self._pairs = 0

    def add(self, ages: NDArray[np.float64], pairs: int) -> None:
        """Adds those of a time step, and the number of pairs of an agent with V2X and another that it knows of."""
        self._ages.append(ages)
        self._pairs += pairs

    def summary(self, world: _core.World, dt: float) -> dict[str, Json]:
        """Totals of a run: for run.json."""
        log = world.messages() or {}
        ages = np.concatenate([np.empty(0), *self._ages])
        near = log["total_in_range"]
        return {
            "equipped": world.equipped,
            "messages": dict(zip(SERVICES, log["messages"], strict=True)),
            "bytes": dict(zip(SERVICES, log["total_bytes"], strict=True)),
            "received_share": log["total_received"] / near if near else None,
            "plan_age_mean": float(np.round(ages.mean(), 9)) if len(ages) else None,
            "plan_age_95": float(np.round(np.quantile(ages, 0.95), 9)) if len(ages) else None,
            "planned_with_plan": len(ages) / self._pairs if self._pairs else None,
            "peak_load": log["peak_bytes"] * 8 / (_BIT_RATE * dt),
        }
