"""Structure-aware mutation of CommonRoad XML: a change knows elements, ids and references, not only bytes."""

from __future__ import annotations

from copy import deepcopy
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element, fromstring, tostring

from tests.fuzz.numbers import REAL, text_of_number

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from random import Random

    Change = Callable[[Element, Random, Sequence[Element]], None]

#: Texts that are no numbers: words of the format, control characters, long and foreign ones.
_WORDS = (
    *("", " ", "unknown", "car", "pedestrian", "same", "opposite", "true", "TRUE", "active", "2018b", "2020a", "ZAM"),
    *("\u202e", "a" * 5000, "'; --", "<", "%s%s", "\t\n", "Ω≈ç√", "274", "urban", "../../x", "1 2 3"),
)


def mutated(data: bytes, random: Random, donors: Sequence[bytes]) -> bytes:
    """A document with one to five changes.

    Args:
        data: A well-formed document.
        random: Source of all choices.
        donors: Other well-formed documents, parts of which may be transplanted.

    Returns:
        The changed document; in one of twelve cases bytes are changed as well, so it need not be well-formed.
    """
    root = fromstring(data)
    others = [fromstring(random.choice(donors))] if donors else []
    for _ in range(random.choice((1, 1, 1, 2, 2, 3, 5))):
        random.choices(_CHANGES, weights=_WEIGHTS)[0](root, random, others)
    text = tostring(root, encoding="utf-8", xml_declaration=True)
    return _bytes_changed(text, random) if random.random() < 1 / 12 else text


def _pick(root: Element, random: Random) -> tuple[Element, Element] | None:
    """A parent and one of its children: first a kind of element, then one of that kind, so that rare kinds are hit."""
    pairs: dict[str, list[tuple[Element, Element]]] = {}
    for parent in root.iter():
        for child in parent:
            pairs.setdefault(f"{parent.tag}/{child.tag}", []).append((parent, child))
    return random.choice(pairs[random.choice(sorted(pairs))]) if pairs else None


def _number(root: Element, random: Random, _donors: Sequence[Element]) -> None:
    leaves: dict[str, list[Element]] = {}
    for element in root.iter():
        if len(element) == 0 and (element.text or "").strip():
            leaves.setdefault(element.tag, []).append(element)
    if leaves:
        chosen = random.choice(leaves[random.choice(sorted(leaves))])
        chosen.text = text_of_number(random, chosen.text or "0")


def _many_numbers(root: Element, random: Random, _donors: Sequence[Element]) -> None:
    """The same change to every number of one element: a map moved, stretched or flattened."""
    found = _pick(root, random)
    if found is None:
        return
    scope = root if random.random() < 0.3 else found[1]
    tag = random.choice(("x", "y", "time", "exact", "length", "velocity"))
    factor, shift = random.choice(
        ((1e3, 0.0), (1e6, 0.0), (1e-6, 0.0), (0.0, 0.0), (-1.0, 0.0), (1.0, 1e6), (1.0, 5e8), (1.0, -1e3), (10.0, 0.0))
    )
    for element in scope.iter(tag):
        for leaf in element.iter():
            try:
                leaf.text = repr(float(leaf.text or "") * factor + shift)
            except ValueError:
                continue


def _attribute(root: Element, random: Random, _donors: Sequence[Element]) -> None:
    owners = [element for element in root.iter() if element.attrib]
    element = random.choice(owners)
    name = random.choice(sorted(element.attrib))
    draw = random.random()
    if draw < 0.15:
        del element.attrib[name]
    elif draw < 0.3:
        element.set(name, random.choice(_WORDS))
    else:
        element.set(name, text_of_number(random, element.get(name, "")))


def _reference(root: Element, random: Random, _donors: Sequence[Element]) -> None:
    """Another target: itself, another element of the document, or none that exists."""
    owners = [(child, parent) for parent in root.iter() for child in parent if "ref" in child.attrib]
    ids = [element.get("id", "0") for element in root.iter() if "id" in element.attrib]
    if owners and ids:
        reference, parent = random.choice(owners)
        reference.set("ref", random.choice((parent.get("id") or "1", random.choice(ids), random.choice(ids), "987654")))


def _relation(root: Element, random: Random, _donors: Sequence[Element]) -> None:
    """A new relation between lanelets, so also cycles and neighbours of oneself."""
    lanelets = root.findall("lanelet")
    if not lanelets:
        return
    lanelet, other = random.choice(lanelets), random.choice(lanelets)
    tag = random.choice(("successor", "predecessor", "adjacentLeft", "adjacentRight", "trafficSignRef", "stopLine"))
    attributes = {"ref": other.get("id") or "1"}
    if tag.startswith("adjacent"):
        attributes["drivingDir"] = random.choice(("same", "opposite"))
    for one, to in ((lanelet, other), (other, lanelet)):
        one.append(Element(tag, {**attributes, "ref": to.get("id") or "1"}))
        if random.random() < 0.6:
            return


def _identity(root: Element, random: Random, _donors: Sequence[Element]) -> None:
    """The same id twice, in the same kind of element or in another."""
    owners = [element for element in root.iter() if "id" in element.attrib]
    if owners:
        random.choice(owners).set("id", random.choice(owners).get("id", "1"))


def _removal(root: Element, random: Random, _donors: Sequence[Element]) -> None:
    found = _pick(root, random)
    if found is not None:
        found[0].remove(found[1])


def _repetition(root: Element, random: Random, _donors: Sequence[Element]) -> None:
    found = _pick(root, random)
    if found is not None:
        parent, child = found
        for _ in range(random.choice((1, 1, 1, 2, 30))):
            parent.insert(random.randint(0, len(parent)), deepcopy(child))


def _order(root: Element, random: Random, _donors: Sequence[Element]) -> None:
    found = _pick(root, random)
    if found is not None:
        children = list(found[0])
        random.shuffle(children)
        found[0][:] = children


def _transplant(root: Element, random: Random, donors: Sequence[Element]) -> None:
    """A part of this or another document in a place of the same parent's kind, or anywhere."""
    source = _pick(random.choice((root, *donors)), random)
    if source is None:
        return
    parents = [element for element in root.iter() if element.tag == source[0].tag]
    if not parents or random.random() < 0.1:
        parents = list(root.iter())
    parent = random.choice(parents)
    parent.insert(random.randint(0, len(parent)), deepcopy(source[1]))


def _name(root: Element, random: Random, _donors: Sequence[Element]) -> None:
    found = _pick(root, random)
    if found is not None:
        found[1].tag = random.choice(sorted({element.tag for element in root.iter()}))


def _text(root: Element, random: Random, _donors: Sequence[Element]) -> None:
    found = _pick(root, random)
    if found is not None:
        found[1].text = random.choice(_WORDS + REAL)


def _exact_or_interval(root: Element, random: Random, _donors: Sequence[Element]) -> None:
    """A value becomes an interval, also a reversed one; an interval becomes a value."""
    owners = [e for e in root.iter() if e.find("exact") is not None or e.find("intervalStart") is not None]
    if not owners:
        return
    owner = random.choice(owners)
    old = owner.findtext("exact") or owner.findtext("intervalStart") or "0"
    tags = ("intervalStart", "intervalEnd") if owner.find("exact") is not None else ("exact",)
    for child in list(owner):
        owner.remove(child)
    for tag in tags:
        child = Element(tag)
        child.text = text_of_number(random, old) if random.random() < 0.7 else old
        owner.append(child)


def _shape(root: Element, random: Random, _donors: Sequence[Element]) -> None:
    """Another footprint or area: flat, crossing itself, huge, of several parts."""
    owners = [element for element in root.iter() if element.tag in ("shape", "position") and len(element)]
    if not owners:
        return
    owner = random.choice(owners)
    for child in list(owner):
        owner.remove(child)
    size = random.choice(("1e-12", "1e-5", "0.5", "2", "50", "1e4", "1e8"))
    other = random.choice(("1e-9", "0.5", "2", size))
    corners = random.choice(
        (
            ((0, 0), (1, 1), (2, 2)),
            ((0, 0), (4, 0), (0, 4), (4, 4)),
            ((0, 0), (4, 0), (4, 0), (4, 4)),
            ((0, 0), (1e-7, 0), (0, 1e-7)),
            ((0, 0), (4, 0), (4, 4), (2, 1), (0, 4)),
            ((0, 0), (0, 0), (0, 0)),
        )
    )
    polygon = "".join(f"<point><x>{x}</x><y>{y}</y></point>" for x, y in corners)
    turn, center = (
        f"<orientation>{random.uniform(-9, 9)}</orientation>",
        f"<center><x>{other}</x><y>{size}</y></center>",
    )
    kinds = (
        f"<rectangle><length>{size}</length><width>{other}</width></rectangle>",
        f"<rectangle><length>{size}</length><width>{other}</width>{turn}{center}</rectangle>",
        f"<circle><radius>{size}</radius></circle>",
        f"<polygon>{polygon}</polygon>",
    )
    for _ in range(random.choice((1, 1, 1, 2, 3))):
        owner.append(fromstring(random.choice(kinds)))


def _bytes_changed(data: bytes, random: Random) -> bytes:
    """Broken off, cut, repeated, or with other bytes in it."""
    first, last = sorted(random.randrange(len(data) + 1) for _ in range(2))
    last = min(last, first + random.choice((1, 10, 1000)))
    return random.choice(
        (
            data[:first],
            data[:first] + data[last:],
            data[:last] + data[first:],
            data[:first] + bytes(random.randrange(256) for _ in range(last - first)) + data[last:],
            data.decode().encode("utf-16"),
            b"\xef\xbb\xbf" + data,
            data.replace(b"utf-8", random.choice((b"latin-1", b"utf-7", b"nonsense", b"utf-16")), 1),
        )
    )


_WEIGHTED: tuple[tuple[Change, int], ...] = (
    (_number, 8),
    (_many_numbers, 3),
    (_attribute, 4),
    (_reference, 2),
    (_relation, 2),
    (_identity, 1),
    (_removal, 3),
    (_repetition, 3),
    (_order, 1),
    (_transplant, 3),
    (_name, 1),
    (_text, 1),
    (_exact_or_interval, 2),
    (_shape, 2),
)
_CHANGES, _WEIGHTS = [change for change, _ in _WEIGHTED], [weight for _, weight in _WEIGHTED]
