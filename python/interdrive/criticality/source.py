"""What is evaluated: runs and recordings as arrays."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive import _core
from interdrive.errors import InputError
from interdrive.scenario import STATE_FIELDS, Scenario, Shape
from interdrive.scenario.native import core_shape

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.array_types import Bools, Floats, Ints
    from interdrive.run import RunRecord

_TABLES = STATE_FIELDS[:5]

#: Recorded participants of these kinds are judged only if they are asked for by id.
_NOT_DRIVING = ("pedestrian", "construction_zone", "structure")


@dataclass(frozen=True)
class Traffic:
    """Participants as arrays, and those evaluated by default.

    Attributes:
        ids: Shape (participants,).
        shapes: Footprints in the body frame.
        is_static: Shape (participants,).
        first_time_step: Time step of column 0.
        x: Shape (participants, time_steps) [m]. y: [m]. orientation: [rad]. velocity: [m/s]. acceleration: [m/s²].
        valid: Present.
        default_ids: Agents of a run, vehicles of a recording.
        contacts: Pairs that touched on the way to a time step, with that time step.
    """

    ids: Ints
    shapes: tuple[Shape, ...]
    is_static: Bools
    first_time_step: int
    x: Floats
    y: Floats
    orientation: Floats
    velocity: Floats
    acceleration: Floats
    valid: Bools
    default_ids: list[int]
    contacts: list[tuple[int, int, int]]

    @property
    def in_core(self) -> _core.Participants:
        """The participants as the core takes them."""
        shapes = [core_shape(shape) for shape in self.shapes]
        tables: dict[str, Any] = {name: getattr(self, name) for name in _TABLES}
        about = (self.ids.tolist(), shapes, self.is_static.tolist(), self.first_time_step)
        return _core.Participants(*about, valid=np.ascontiguousarray(self.valid), **tables)

    def only(self, ids: Sequence[int]) -> Traffic:
        """The same with these participants only.

        Raises:
            InputError: An id is not there.
        """
        strangers = [number for number in ids if number not in self.ids]
        if strangers:
            raise InputError(f"there is no participant with id {strangers[0]}")
        rows = np.flatnonzero(np.isin(self.ids, list(ids)))
        kept = set(self.ids[rows].tolist())
        tables: dict[str, Any] = {name: np.ascontiguousarray(getattr(self, name)[rows]) for name in (*_TABLES, "valid")}
        return replace(
            self,
            ids=self.ids[rows],
            shapes=tuple(self.shapes[row] for row in rows.tolist()),
            is_static=self.is_static[rows],
            default_ids=[number for number in self.default_ids if number in kept],
            contacts=[contact for contact in self.contacts if contact[0] in kept and contact[1] in kept],
            **tables,
        )


def traffic_of(source: Scenario | RunRecord) -> Traffic:
    """Participants of a run, or the recorded ones of a scenario."""
    if isinstance(source, Scenario):
        obstacles = source.obstacles
        driving = np.array([kind not in _NOT_DRIVING for kind in obstacles.kinds], dtype=np.bool_)
        return Traffic(
            ids=obstacles.ids,
            shapes=obstacles.shapes,
            is_static=obstacles.is_static,
            first_time_step=0,
            **{name: np.ascontiguousarray(getattr(obstacles, name), dtype=np.float64) for name in _TABLES},
            valid=obstacles.valid,
            default_ids=obstacles.ids[~obstacles.is_static & driving & obstacles.valid.any(axis=1)].tolist(),
            contacts=[],
        )
    states, ended = source.states, source.outcomes
    rows = zip(ended.agent_id.tolist(), ended.partner_id.tolist(), ended.time_step.tolist(), ended.outcome, strict=True)
    return Traffic(
        ids=states.participant_id,
        shapes=footprints(source),
        is_static=states.is_static,
        first_time_step=states.first_time_step,
        **{name: np.ascontiguousarray(getattr(states, name), dtype=np.float64) for name in _TABLES},
        valid=states.valid,
        default_ids=states.participant_id[states.is_agent & states.valid.any(axis=1)].tolist(),
        contacts=[(who, whom, when) for who, whom, when, how in rows if how == "collision" and whom >= 0],
    )


def footprints(run: RunRecord) -> tuple[Shape, ...]:
    """Footprints of all participants of a run; participants without a recording are rectangles.

    So are agents that drive another vehicle than the recorded one (`agents.vehicle_type`).
    """
    obstacles, states = run.scenario.obstacles, run.states
    recorded = dict(zip(obstacles.ids.tolist(), obstacles.shapes, strict=True))
    agents = set(run.outcomes.agent_id.tolist())
    found = []
    for number, *size in zip(
        states.participant_id.tolist(), states.length.tolist(), states.width.tolist(), strict=True
    ):
        shape = recorded.get(number)
        is_own = shape is not None and (number not in agents or list(core_shape(shape).extent) == size)
        found.append(shape if shape is not None and is_own else Shape("rectangle", length=size[0], width=size[1]))
    return tuple(found)


def connectors_of(scenario: Scenario) -> list[tuple[int, int]]:
    """Lanelets across intersections, each with the number of the incoming that leads to it."""
    known = set(scenario.lanelets.ids.tolist())
    return [
        (connector, number)
        for number, incoming in enumerate(scenario.incomings)
        for connector in incoming.connector_ids
        if connector in known
    ]
