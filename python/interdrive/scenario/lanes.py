"""What a map says about lanes: for which kinds a lanelet is one, and on which side of the road vehicles drive."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from interdrive.scenario.model import KINDS

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from numpy.typing import NDArray

    from interdrive.scenario.model import Lanelets

_EVERYBODY = frozenset(KINDS)
_NO_USERS: frozenset[str] = frozenset()

#: Kinds for which a lanelet of a type is a lane; a lanelet of any other type, or of none, is one for all.
USERS_BY_TYPE = {
    **dict.fromkeys(("sidewalk", "border", "crosswalk", "parking", "shoulder"), _NO_USERS),
    **dict.fromkeys(("restricted", "restricted_area"), frozenset(("priority_vehicle",))),
    "bicycleLane": frozenset(("bicycle",)),
    "busLane": frozenset(("bus", "taxi", "priority_vehicle")),
    "busStop": frozenset(("bus",)),
}
#: Types of lanelets at the edge of the road, on the side on which vehicles drive.
_OUTER = frozenset(("shoulder", "busLane", "busStop", "bicycleLane", "parking", "sidewalk", "accessRamp", "exitRamp"))
#: The same for lanelets whose stated users are all named here; any other user opens a lanelet for all.
USERS_BY_USER = {
    **dict.fromkeys(("pedestrian", "train"), _NO_USERS),
    "bicycle": frozenset(("bicycle",)),
    "bus": frozenset(("bus",)),
    "taxi": frozenset(("taxi",)),
    "priorityVehicle": frozenset(("priority_vehicle",)),
}

Side = Literal["left", "right"]


def lane_users(lanelets: Lanelets) -> list[frozenset[str]]:
    """Kinds of participants (`KINDS`) for which each lanelet is a lane.

    A lanelet of several types is a lane for the kinds that all of them admit. A crosswalk between two lanes is a piece
    of road that people cross, and for all. Where no lanelet of a map is a lane for a kind, types and users do not
    count for it.
    """
    users = lanelets.users or ((),) * len(lanelets.ids)
    stated = [_admitted(kinds, USERS_BY_TYPE) & _stated(who) for kinds, who in zip(lanelets.types, users, strict=True)]
    rows = {number: row for row, number in enumerate(lanelets.ids.tolist())}

    def leads_on(row: int, related: Iterable[int]) -> bool:
        return any(
            rows[other] != row and "crosswalk" not in lanelets.types[rows[other]] and stated[rows[other]]
            for other in related
            if other in rows
        )

    after: dict[int, set[int]] = {number: set(ids) for number, ids in zip(rows, lanelets.successors, strict=True)}
    before: dict[int, set[int]] = {number: set(ids) for number, ids in zip(rows, lanelets.predecessors, strict=True)}
    for number in rows:
        for other in lanelets.successors[rows[number]]:
            before.setdefault(other, set()).add(number)
        for other in lanelets.predecessors[rows[number]]:
            after.setdefault(other, set()).add(number)
    found = []
    for number, row in rows.items():
        kinds = set(lanelets.types[row])
        is_crossed = "crosswalk" in kinds and leads_on(row, before[number]) and leads_on(row, after[number])
        found.append(
            _admitted(kinds - {"crosswalk"}, USERS_BY_TYPE) & _stated(users[row]) if is_crossed else stated[row]
        )
    unserved = _EVERYBODY.difference(*found)
    return [kinds | unserved for kinds in found]


def _admitted(names: Iterable[str], table: dict[str, frozenset[str]]) -> frozenset[str]:
    return _EVERYBODY.intersection(*(table[name] for name in names if name in table))


def _stated(users: tuple[str, ...]) -> frozenset[str]:
    if not users or any(name not in USERS_BY_USER for name in users):
        return _EVERYBODY
    return _NO_USERS.union(*(USERS_BY_USER[name] for name in users))


def driving_side(lanelets: Lanelets) -> Side | None:
    """The side of the road on which vehicles drive, as far as the map tells.

    The first of these that speaks for one side more often than for the other decides: neighbours of the opposite
    direction, stated or with a common bound; shoulders, bus and bicycle lanes, sidewalks, parking and ramps beside
    other lanelets; the slower of two lanes of one direction.
    """
    rows = {number: row for row, number in enumerate(lanelets.ids.tolist())}
    sides: tuple[tuple[Side, NDArray[np.int64], NDArray[np.bool_]], ...] = (
        ("left", lanelets.adjacent_left, lanelets.adjacent_left_same_direction),
        ("right", lanelets.adjacent_right, lanelets.adjacent_right_same_direction),
    )
    beside = [
        (row, side, rows[other], same)
        for side, neighbours, directions in sides
        for row, (other, same) in enumerate(zip(neighbours.tolist(), directions.tolist(), strict=True))
        if other in rows
    ]

    def opposite() -> Iterator[Side]:
        yield from (_other(side) for _, side, _, same in beside if not same)

    def touching() -> Iterator[Side]:
        for side, bounds in (("left", lanelets.left), ("right", lanelets.right)):
            ends = {(*_rounded(bound[0]), *_rounded(bound[-1])) for bound in bounds}
            yield from (_other(side) for x, y, far_x, far_y in ends if (far_x, far_y, x, y) in ends)  # type: ignore[arg-type]

    def outer() -> Iterator[Side]:
        is_outer = [not _OUTER.isdisjoint(kinds) for kinds in lanelets.types]
        yield from (side for row, side, other, same in beside if same and is_outer[other] and not is_outer[row])

    def slower() -> Iterator[Side]:
        limits = lanelets.speed_limit
        for row, side, other, same in beside:
            if same and limits[other] != limits[row] and np.isfinite(limits[other]) and np.isfinite(limits[row]):
                yield side if limits[other] < limits[row] else _other(side)

    for evidence in (opposite, touching, outer, slower):
        found = list(evidence())
        left, right = found.count("left"), found.count("right")
        if left != right:
            return "left" if left > right else "right"
    return None


def _other(side: Side) -> Side:
    return "right" if side == "left" else "left"


def _rounded(point: NDArray[np.float64]) -> tuple[float, float]:
    """A point of a bound to 0.1 m."""
    x, y = np.round(point, 1).tolist()
    return x, y
