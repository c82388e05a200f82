"""Conflict areas and what follows from them, as docs/reference/criticality.md defines them, without the core."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import shapely
from definitions import ALONG, OVERLAP_MIN, Definitions

if TYPE_CHECKING:
    from interdrive.scenario import Scenario

#: First step in an area, and first later one out of it; None if there is none.
Stay = tuple[int, int | None]


@dataclass(frozen=True)
class Encroachment:
    """Of one vehicle over all its areas; the remaining distance at every step [m], inf without an area ahead."""

    et: float
    pet: float
    remaining: np.ndarray


def stated_connectors(scenario: Scenario) -> dict[int, set[int]]:
    """Rows of lanelets that lead on from incoming lanelets, with the numbers of the incomings."""
    row = {number: i for i, number in enumerate(scenario.lanelets.ids.tolist())}
    found: dict[int, set[int]] = {}
    for number, incoming in enumerate(scenario.incomings):
        for connector in incoming.connector_ids:
            if connector in row:
                found.setdefault(row[connector], set()).add(number)
    return found


def crossing_connectors(definitions: Definitions) -> dict[int, set[int]]:
    """Rows of lanelets that overlap others which neither follow nor share a lanelet before; with those before them."""
    before, after, eroded = definitions.before, definitions.after, definitions.eroded
    found = {}
    for i, lanelet in enumerate(eroded):
        for j, other in enumerate(eroded):
            if i == j or j in before[i] | after[i] or before[i] & before[j] or not lanelet.intersects(other):
                continue
            if definitions.share(lanelet, other):
                found[i] = before[i] or {-1 - i}
                break
    return found


class Conflicts:
    """Which vehicle uses which connector, and when each is where two of them overlap."""

    def __init__(self, definitions: Definitions, connectors: dict[int, set[int]]) -> None:
        self.definitions, self.connectors = definitions, connectors
        self._stays: dict[tuple[int, int, int], Stay | None] = {}

    @cached_property
    def used(self) -> dict[int, list[int]]:
        """Connectors on the way of every row."""
        moving = np.flatnonzero(~self.definitions.obstacles.is_static).tolist()
        return {row: self._used(row) for row in moving}

    def _used(self, row: int) -> list[int]:
        definitions = self.definitions
        x, y = definitions.obstacles.x[row], definitions.obstacles.y[row]
        visits: dict[int, list[tuple[int, float]]] = {}
        for k in np.flatnonzero(definitions.obstacles.valid[row]).tolist():
            for i in definitions.here(row, k):
                if abs(definitions.place(i, row, k)[0]) <= ALONG:
                    aside = shapely.LineString(definitions.centers[i]).distance(shapely.Point(x[k], y[k]))
                    visits.setdefault(i, []).append((k, aside))
        ranked = []
        for i in self.connectors.keys() & visits.keys():
            first, last = visits[i][0][0], visits[i][-1][0]
            came = any(j in visits and visits[j][0][0] < first for j in definitions.before[i])
            went = any(j in visits and visits[j][-1][0] > last for j in definitions.after[i])
            if came or went:
                aside = float(np.mean([distance for _, distance in visits[i]]))
                ranked.append((not (came and went), -len(visits[i]), aside, i))
        used: list[int] = []
        for *_, i in sorted(ranked):
            before, after = definitions.before, definitions.after
            if not any(before[i] & before[j] or after[i] & after[j] for j in used):
                used.append(i)
        return used

    def stay(self, row: int, one: int, other: int) -> Stay | None:
        key = (row, min(one, other), max(one, other))
        if key not in self._stays:
            definitions = self.definitions
            area = definitions.outlines[key[1]].intersection(definitions.outlines[key[2]])
            steps = np.flatnonzero(definitions.obstacles.valid[row])
            poses = np.array([definitions.pose(row, k) for k in steps.tolist()])
            body = definitions.bodies[row]
            inside = shapely.distance(body.at(poses), area) <= body.radius
            enter = int(inside.argmax())
            out = np.flatnonzero(~inside[enter:])
            stay = (int(steps[enter]), int(steps[enter + out[0]]) if len(out) else None)
            self._stays[key] = stay if inside.any() else None
        return self._stays[key]

    def encroachment(self, row: int) -> Encroachment:
        definitions, o = self.definitions, self.definitions.obstacles
        steps = np.flatnonzero(o.valid[row])
        way = np.append(0.0, np.nancumsum(np.hypot(np.diff(o.x[row]), np.diff(o.y[row]))))
        et = pet = np.inf
        stays_inside, remaining = False, np.full(o.n_steps, np.inf)
        pairs = [(own, other, user) for own in self.used[row] for user, used in self.used.items() for other in used]
        for own, other, user in pairs:
            if user == row or own == other or self.connectors[own] & self.connectors[other]:
                continue
            if definitions.outlines[own].intersection(definitions.outlines[other]).area <= OVERLAP_MIN:
                continue
            mine, theirs = self.stay(row, own, other), self.stay(user, own, other)
            if mine is None:
                continue
            enter, out = mine
            stays_inside |= out is None
            et = min(et, np.inf if out is None else (out - enter) * definitions.dt)
            for k in range(int(steps[0]), int(steps[-1]) + 1 if out is None else out):
                remaining[k] = min(remaining[k], 0.0 if k >= enter else way[max(enter - 1, k)] - way[k])
            if theirs is not None:
                pet = min(pet, self._pet(row, mine, user, theirs))
        return Encroachment(np.nan if stays_inside and et == np.inf else et, pet, remaining)

    def _pet(self, row: int, mine: Stay, user: int, theirs: Stay) -> float:
        o = self.definitions.obstacles
        (first, who), (second, _) = sorted([(mine, row), (theirs, user)], key=lambda item: (item[0][0], item[1]))
        gone = int(np.flatnonzero(o.valid[who])[-1]) + 1
        out = first[1] if first[1] is not None else gone if gone < o.n_steps else None
        return 0.0 if out is None or second[0] < out else (second[0] - out) * self.definitions.dt
