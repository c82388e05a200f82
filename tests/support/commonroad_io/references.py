"""References of a map to elements that do not exist."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from xml.etree.ElementTree import Element


#: This many of each kind are named.
_NAMED = 3


class _Reference(NamedTuple):
    """What refers to which element."""

    owner: str
    target: str
    id: int


#: Targets of the relations of a lanelet, by their names in the format and in commonroad-io.
_RELATIONS = (
    ("predecessor", "predecessor", "predecessor"),
    ("successor", "successor", "successor"),
    ("left neighbour", "adjacentLeft", "adj_left"),
    ("right neighbour", "adjacentRight", "adj_right"),
    ("traffic light", "trafficLightRef", "traffic_lights"),
    ("traffic sign", "trafficSignRef", "traffic_signs"),
)
#: The same of an incoming element, whose parts have different names in commonroad-io 2024 and 2026.
_WAYS = ("incomingLanelet", "successorsRight", "successorsStraight", "successorsLeft")


def dangling_in_file(root: Element) -> tuple[str, ...]:
    """One line per reference of a document to a lanelet, light, sign or incoming that does not exist; see `_listed`."""

    def ids(tag: str) -> set[int]:
        return {number for element in root.iterfind(tag) if (number := _number(element.get("id"))) is not None}

    known = {"lanelet": ids("lanelet"), "light": ids("trafficLight"), "sign": ids("trafficSign")}
    known["incoming"] = ids("intersection/incoming")

    def found() -> Iterator[_Reference]:
        for lanelet in root.iterfind("lanelet"):
            name = f"lanelet {lanelet.get('id')}"
            for target, tag, _ in _RELATIONS:
                yield from _references(name, target, lanelet.iterfind(tag))
                if tag.startswith("traffic"):
                    yield from _references(f"the stop line of {name}", target, lanelet.iterfind(f"stopLine/{tag}"))
        for intersection in root.iterfind("intersection"):
            place = f"of intersection {intersection.get('id')}"
            for incoming in intersection.iterfind("incoming"):
                name = f"incoming {incoming.get('id')} {place}"
                for tag in _WAYS:
                    yield from _references(name, "lanelet", incoming.iterfind(tag))
                yield from _references(name, "incoming", incoming.iterfind("isLeftOf"))
            yield from _references(f"a crossing {place}", "lanelet", intersection.iterfind("crossing/crossingLanelet"))

    return _listed(found(), known)


def _number(text: str | None) -> int | None:
    try:
        return int(text or "")
    except ValueError:
        return None


def _references(owner: str, target: str, elements: Iterable[Element]) -> Iterator[_Reference]:
    for element in elements:
        number = _number(element.get("ref"))
        if number is not None:
            yield _Reference(owner, target, number)


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
