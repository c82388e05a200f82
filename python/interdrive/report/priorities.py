"""Priority at junctions on the page of a run: signs, and ways that wait for others, as packed arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from interdrive.native_settings import RoadSettings
from interdrive.scenario.inspection import PRECEDENCE
from interdrive.scenario.native import core_road, core_scenario
from interdrive.scenario.signs import SIGN_KINDS, sign_with

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from interdrive.array_types import Floats
    from interdrive.report.packing import Packer
    from interdrive.scenario import Scenario

_ONCOMING = PRECEDENCE.index("left turns wait")

#: Distance of signs beside the lane [m].
_ASIDE = 1.2

#: Resolutions: positions [m], headings [rad].
_METRE, _RADIAN = 0.01, 0.001


def pack_priorities(packer: Packer, scenario: Scenario, origin: Floats) -> None:
    """Signs and their codes, shape (signs, 2) and (signs,); where ways wait: x, y, shape (ways, 2), and heading."""
    places, codes = signs(scenario)
    if len(codes):
        packer.add("sign_xy", places - origin, unit=_METRE)
        packer.add("sign_kind", codes)
    waits = waiting_ways(scenario)
    if len(waits):
        packer.add("wait_xy", waits[:, :2] - origin, unit=_METRE)
        packer.add("wait_heading", waits[:, 2], unit=_RADIAN)


def signs(scenario: Scenario) -> tuple[Floats, NDArray[np.int64]]:
    """Signs of priority beside the ends of their lanelets. Ranks that no sign has have none.

    Returns:
        Positions in the world's frame [m], shape (signs, 2), and positions of their kinds in `SIGN_KINDS`.
    """
    lanelets, priorities = scenario.lanelets, scenario.priorities
    row = {number: place for place, number in enumerate(lanelets.ids.tolist())}
    places, codes = [np.empty((0, 2))], []
    for number, ranks in priorities.ranks:
        sign = sign_with(ranks)
        if sign is not None:
            near, far = lanelets.right[row[number]][-1], lanelets.left[row[number]][-1]
            if priorities.left_hand:
                near, far = far, near
            across = near - far
            places.append((near + _ASIDE * across / max(float(np.hypot(*across)), 1e-9))[None])
            codes.append(SIGN_KINDS.index(sign.kind))
    return np.concatenate(places), np.array(codes, dtype=np.int64)


def waiting_ways(scenario: Scenario) -> Floats:
    """Where lanelets reach the first area in which another way goes first.

    Left out are lanes that run side by side and merge, where no vehicle is held, and two ways that have lights, unless
    they run against each other: those are not green together.

    Returns:
        x, y [m] and heading [rad] in the world's frame, shape (lanelets, 3), sorted by id.
    """
    areas = core_scenario(scenario, core_road(scenario, RoadSettings())).junctions()
    entries: dict[int, float] = {}
    lit = {way for line in scenario.stop_lines for way, lights in line.light_ids if lights}
    columns = ("first", "lanelet", "entry", "reason", "side_by_side")
    for first, ids, entry, reason, beside in zip(*(areas[name].tolist() for name in columns), strict=True):
        if first >= 0 and not beside and (reason == _ONCOMING or not lit.issuperset(ids)):
            waits = 1 - first
            entries[ids[waits]] = min(entry[waits], entries.get(ids[waits], np.inf))
    row = {number: place for place, number in enumerate(scenario.lanelets.ids.tolist())}
    found = [_pose(scenario, row[number], s) for number, s in sorted(entries.items())]
    return np.array(found).reshape(-1, 3)


def _pose(scenario: Scenario, row: int, s: float) -> tuple[float, float, float]:
    """Point and heading of a lanelet's centre line at an arc length."""
    line = 0.5 * (scenario.lanelets.left[row] + scenario.lanelets.right[row])
    steps = np.diff(line, axis=0)
    lengths = np.hypot(*steps.T)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    piece = min(max(int(np.searchsorted(along, s, side="right")) - 1, 0), len(steps) - 1)
    part = (s - along[piece]) / max(float(lengths[piece]), 1e-9)
    x, y = line[piece] + min(max(part, 0.0), 1.0) * steps[piece]
    return float(x), float(y), float(np.arctan2(steps[piece, 1], steps[piece, 0]))
