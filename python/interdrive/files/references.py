"""References of a map of commonroad-io to elements that do not exist. Those of a document are found by the core."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from interdrive.files.shapes import Foreign

#: This many of each kind are named.
_NAMED = 3


class _Reference(NamedTuple):
    """What refers to which element."""

    owner: str
    target: str
    id: int


#: Targets of the relations of a lanelet, by their names in commonroad-io.
_RELATIONS = (
    ("predecessor", "predecessor"),
    ("successor", "successor"),
    ("left neighbour", "adj_left"),
    ("right neighbour", "adj_right"),
    ("traffic light", "traffic_lights"),
    ("traffic sign", "traffic_signs"),
)
#: The same of an incoming element, whose parts have different names in commonroad-io 2024 and 2026.
_WAYS = (
    "incoming_lanelets",
    *(f"{group}_{way}" for group in ("outgoing", "successors") for way in ("right", "straight", "left")),
)


def dangling_in_network(network: Foreign) -> tuple[str, ...]:
    """One line per reference of a lanelet network of commonroad-io to what does not exist; see `_listed`."""
    known = {
        "lanelet": {int(lanelet.lanelet_id) for lanelet in network.lanelets},
        "light": {int(light.traffic_light_id) for light in network.traffic_lights},
        "sign": {int(sign.traffic_sign_id) for sign in network.traffic_signs},
    }

    def found() -> Iterator[_Reference]:
        for lanelet in sorted(network.lanelets, key=lambda one: int(one.lanelet_id)):
            name = f"lanelet {lanelet.lanelet_id}"
            for target, attribute in _RELATIONS:
                yield from (_Reference(name, target, number) for number in _ids(lanelet, attribute))
            line = f"the stop line of {name}"
            for target, attribute in (("traffic light", "traffic_light_ref"), ("traffic sign", "traffic_sign_ref")):
                yield from (_Reference(line, target, number) for number in _ids(lanelet.stop_line, attribute))
        for intersection in network.intersections:
            for incoming in intersection.incomings:
                name = f"incoming {incoming.incoming_id} of intersection {intersection.intersection_id}"
                for attribute in _WAYS:
                    yield from (_Reference(name, "lanelet", number) for number in _ids(incoming, attribute))

    return _listed(found(), known)


def _ids(owner: Foreign, attribute: str) -> list[int]:
    stated = getattr(owner, attribute, None)
    if stated is None:
        return []
    return sorted(int(number) for number in (stated if hasattr(stated, "__iter__") else (stated,)))


def _listed(found: Iterable[_Reference], known: dict[str, set[int]]) -> tuple[str, ...]:
    """A line for each of the first three dangling references to a kind of element, and a line that counts the rest."""
    by_target: dict[str, list[str]] = {}
    for owner, target, number in found:
        kind = {"traffic light": "light", "traffic sign": "sign", "incoming": "incoming"}.get(target, "lanelet")
        if number not in known.get(kind, ()):
            by_target.setdefault(target, []).append(f"{owner} refers to {target} {number}, which does not exist")
    lines = []
    for target, texts in by_target.items():
        lines += texts[:_NAMED]
        if len(texts) > _NAMED:
            lines.append(f"{len(texts) - _NAMED} more references to a {target} that does not exist")
    return tuple(lines)
