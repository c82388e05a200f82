"""Harm of collisions: the probability of severe injuries in every vehicle involved."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive import _core
from interdrive.scenario import KINDS
from interdrive.storage import Record, label, number

if TYPE_CHECKING:
    from collections.abc import Mapping

    from interdrive.array_types import Floats, Ints
    from interdrive.run import RunRecord

#: Mass [kg] of CommonRoad's vehicle type 2 (BMW 320i), and its size [m], by which agents of this type are known.
BMW_320I_MASS, _BMW_320I_LENGTH, _BMW_320I_WIDTH = 1093.3, 4.508, 1.610

#: Where a vehicle can be hit.
IMPACT_AREAS = ("front", "left", "right", "rear")


@dataclass(frozen=True)
class Collisions:
    """Every pair that collided in a run, and every vehicle that hit the edge of the road; one row each.

    Attributes:
        agent_id: One of the pair, shape (collisions,).
        partner_id: The other one; -1 for the edge of the road.
        time_step: Of the first recorded state after the contact.
        relative_speed: Size of the relative velocity at that state [m/s]; at the edge of the road the speed.
        mass: Of the agent [kg]. partner_mass: Of the other one; inf for things that do not give way.
        harm: Probability of MAIS 3+ (severe injuries) in the agent. partner_harm: In the other one; nan for things.
        speed_change: Of the agent [m/s]. partner_speed_change: Of the other one.
        impact_angle: Direction to the other one, seen from the agent, at the last state before the contact [rad]; nan
            for the edge of the road. partner_impact_angle: The same for the other one.
        impact_area: "front", "left", "right" or "rear" of the agent; "" for the edge of the road.
        partner_impact_area: The same for the other one.
    """

    agent_id: Ints
    partner_id: Ints
    time_step: Ints
    relative_speed: Floats
    mass: Floats
    partner_mass: Floats
    harm: Floats
    partner_harm: Floats
    speed_change: Floats
    partner_speed_change: Floats
    impact_angle: Floats
    partner_impact_angle: Floats
    impact_area: tuple[str, ...]
    partner_impact_area: tuple[str, ...]


_NO_COLLISION, _NOT_HURT = "no collision", "no collision with a participant that can be hurt"


@dataclass(frozen=True)
class AgentHarm(Record):
    """What collisions did to the agents of a run, the one with the largest harm; rows as in its outcomes."""

    harm: Floats = field(
        metadata=number(
            "probability of severe injuries (MAIS 3+) in the agent after a collision", "1", null=_NO_COLLISION
        )
    )
    partner_harm: Floats = field(metadata=number("the same in the other participant", "1", null=_NOT_HURT))
    impact_angle: Floats = field(
        metadata=number(
            "direction to the other participant, seen from the agent", "rad", null="no collision with a participant"
        )
    )
    impact_area: tuple[str, ...] = field(
        metadata=label("front, left, right or rear of the agent", IMPACT_AREAS, null="no collision with a participant")
    )


def participant_masses(run: RunRecord, masses: Mapping[int, float] | None = None) -> Floats:
    """Mass of every participant of a run [kg], shape (participants,), by kind and footprint.

    Args:
        run: The run.
        masses: Known masses by id; they replace those of the model.
    """
    states = run.states
    found = np.array(
        _core.participant_mass(
            [KINDS.index(kind) for kind in states.kinds],
            np.ascontiguousarray(states.length, dtype=np.float64),
            np.ascontiguousarray(states.width, dtype=np.float64),
        )
    )
    is_car = np.array([kind == "car" for kind in states.kinds], dtype=np.bool_)
    type_2 = states.is_agent & is_car
    type_2 &= np.isclose(states.length, _BMW_320I_LENGTH) & np.isclose(states.width, _BMW_320I_WIDTH)
    found[type_2] = BMW_320I_MASS
    for participant, mass in (masses or {}).items():
        found[states.participant_id == participant] = mass
    return found


def collisions(run: RunRecord, *, masses: Mapping[int, float] | None = None, asymmetric: bool = False) -> Collisions:
    """Harm of every collision of a run.

    Impact perfectly plastic; logistic regression over speed change and impact area with the coefficients of the
    published risk assessment (docs/reference/criticality.md).

    Args:
        run: The run, finished or not.
        masses: Known masses by id [kg]; by default from kind and footprint.
        asymmetric: A side impact on the driver's (left) side differs from one on the right.
    """
    states, ended = run.states, run.outcomes
    all_masses = participant_masses(run, masses)
    pairs: dict[tuple[int, int], int] = {}
    alone = []
    for i, how in enumerate(ended.outcome):
        who, whom = int(ended.agent_id[i]), int(ended.partner_id[i])
        if how != "collision":
            continue
        if whom < 0:
            alone.append((who, int(ended.time_step[i]), float(ended.impact_speed[i])))
        else:
            pairs.setdefault((min(who, whom), max(who, whom)), int(ended.time_step[i]))
    row_of = {number: row for row, number in enumerate(states.participant_id.tolist())}
    rows: list[tuple[object, ...]] = []
    for (first, second), time_step in sorted(pairs.items(), key=lambda item: (item[1], item[0])):
        two = (row_of[first], row_of[second])
        speed, one, other = _pair(run, two, time_step, all_masses, asymmetric=asymmetric)
        together = [value for both in zip(one, other, strict=True) for value in both]
        rows.append((first, second, time_step, speed, *(float(all_masses[row]) for row in two), *together))
    for who, time_step, speed in sorted(alone, key=lambda item: (item[1], item[0])):
        row = row_of[who]
        harm = _core.boundary_harm(KINDS.index(states.kinds[row]), speed)
        nan = float("nan")
        rows.append(
            (who, -1, time_step, speed, float(all_masses[row]), np.inf, harm, nan, speed, 0.0, nan, nan, "", "")
        )
    names = [item.name for item in fields(Collisions)]
    table: dict[str, Any] = dict(zip(names, zip(*rows, strict=True), strict=True)) if rows else dict.fromkeys(names, ())
    for name in names[:12]:
        table[name] = np.array(table[name], dtype=np.int64 if name in names[:3] else np.float64)
    return Collisions(**table)


def _pair(
    run: RunRecord, rows: tuple[int, int], time_step: int, masses: Floats, *, asymmetric: bool
) -> tuple[float, tuple[float, float, float, str], tuple[float, float, float, str]]:
    states = run.states
    at = time_step - states.first_time_step
    before = at - 1 if at > 0 and all(states.valid[row, at - 1] for row in rows) else at
    first, second = rows

    def both(values: Floats, column: int) -> tuple[float, float]:
        return float(values[first, column]), float(values[second, column])

    x, y = both(states.x, before), both(states.y, before)
    return _core.collision_harm(
        (KINDS.index(states.kinds[first]), KINDS.index(states.kinds[second])),
        (float(masses[first]), float(masses[second])),
        both(states.velocity, at),
        both(states.orientation, at),
        ((x[0], y[0]), (x[1], y[1])),
        asymmetric,
    )


def agent_harm(run: RunRecord, *, masses: Mapping[int, float] | None = None, asymmetric: bool = False) -> AgentHarm:
    """Harm per agent, for the table of outcomes.

    Args:
        run: A run with outcomes.
        masses: Masses of single participants by id [kg].
        asymmetric: Tell left from right sides, as `collisions` does.
    """
    found = collisions(run, masses=masses, asymmetric=asymmetric)
    ended = run.outcomes
    n = len(ended.agent_id)
    place = {number: i for i, number in enumerate(ended.agent_id.tolist())}
    harm, partner_harm, angle = np.full(n, np.nan), np.full(n, np.nan), np.full(n, np.nan)
    area = [""] * n
    for k, (first, second) in enumerate(zip(found.agent_id.tolist(), found.partner_id.tolist(), strict=True)):
        sides = (
            (first, second, found.harm[k], found.partner_harm[k], found.impact_angle[k], found.impact_area[k]),
            (
                second,
                first,
                found.partner_harm[k],
                found.harm[k],
                found.partner_impact_angle[k],
                found.partner_impact_area[k],
            ),
        )
        for who, whom, own, others, own_angle, own_area in sides:
            i = place.get(who)
            if i is None:
                continue
            if not harm[i] >= own:
                harm[i], angle[i], area[i] = own, own_angle, own_area
            if int(ended.partner_id[i]) == whom:
                partner_harm[i] = others
    return AgentHarm(harm, partner_harm, angle, tuple(area))
