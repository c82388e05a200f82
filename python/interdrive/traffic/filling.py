"""Vehicles that are on the map from the beginning: in lanes that overlap no other one, as fast as their gaps allow."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from interdrive.errors import InputError
from interdrive.traffic import draws
from interdrive.traffic.arrivals import Wish, vehicles

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.array_types import Floats
    from interdrive.traffic.lanes import Chain, LaneGraph
    from interdrive.traffic.settings import TrafficSettings

#: Spacings differ by at most this share.
_SPREAD = 0.2
#: Least gap between two vehicles [m]: that of the IDM to who stands.
_GAP = 2.0
#: Time gap of drivers that keep that of their planner [s], for their first speed.
_TIME_GAP = 1.2
#: On a ring a way begins with the lanelet behind for vehicles so near to the start of theirs [m]: their rear is there.
_SEAM = 6.0
#: Nobody begins so near to the end of the map [m], ...
_END = 20.0
#: ... or to a vehicle that is there already [m].
_APART = 30.0
#: Braking that nobody has to exceed [m/s²], after a second; before junctions less is enough.
_FIRM, _GENTLE = 4.0, 2.0


def filled(
    graph: LaneGraph, settings: TrafficSettings, seed: int, density: float, occupied: Sequence[tuple[float, float]]
) -> list[Wish]:
    """Vehicles for all lanes that can be filled.

    Args:
        graph: The lanes.
        settings: Of the traffic.
        seed: Of the run.
        density: Vehicles per km and lane.
        occupied: Where others are [m].

    Raises:
        InputError: So many vehicles do not fit into a ring.
    """
    found: list[Wish] = []
    for chain in graph.chains():
        found += _chain(graph, chain, settings, seed, density, np.array(occupied).reshape(-1, 2))
    return found


def _chain(
    graph: LaneGraph, chain: Chain, settings: TrafficSettings, seed: int, density: float, occupied: Floats
) -> list[Wish]:
    head = chain.lanelet_ids[0]
    spacing = 1000.0 / density
    most = round(chain.length / spacing) if chain.is_ring else math.ceil(chain.length / ((1.0 - _SPREAD) * spacing))
    if not most:
        return []
    numbers = np.arange(most)
    drawn = 2.0 * draws.uniform(seed, draws.PLACE, head, numbers) - 1.0
    own = vehicles(settings, seed, -head - 1, numbers)
    if chain.is_ring:
        step = chain.length / most
        places = (numbers + 0.5 + 0.5 * _SPREAD * drawn) * step
        if own.length.sum() + _GAP * most > chain.length:
            raise InputError("traffic.density", f"{most} vehicles do not fit into a ring of {chain.length:.0f} m")
        places = _pushed(places, own.length, chain.length)
        places = places - max(
            0.0, places[-1] - places[0] + 0.5 * (own.length[0] + own.length[-1]) + _GAP - chain.length
        )
    else:
        places = np.cumsum(spacing * (1.0 + _SPREAD * drawn)) - 0.5 * spacing
        places = _pushed(places, own.length, math.inf)
    is_exit = chain.lanelet_ids[-1] in graph.exits
    last = chain.length if chain.is_ring else chain.length - (_END if is_exit else 0.5 * spacing)
    kept = [i for i in range(most) if 0.5 * own.length[i] + 0.5 <= places[i] < last or chain.is_ring]
    speeds = _speeds(
        graph, chain, places, own.length, [one.time_gap or _TIME_GAP for one in own.drivers], kept, is_exit=is_exit
    )
    starts = np.concatenate([[0.0], np.cumsum([graph.length[lane] for lane in chain.lanelet_ids])])
    found: list[Wish] = []
    for i in kept:
        s = float(places[i]) % chain.length
        at = min(int(np.searchsorted(starts, s, side="right")) - 1, len(chain.lanelet_ids) - 1)
        lane, s = chain.lanelet_ids[at], s - float(starts[at])
        if chain.is_ring and s < _SEAM:
            lane = chain.lanelet_ids[at - 1]
            s += graph.length[lane]
        x, y, _ = graph.place(lane, s)
        if len(occupied) and np.hypot(*(occupied - (x, y)).T).min() < _APART:
            continue
        size = float(own.length[i]), float(own.width[i])
        factor = own.drivers[i].speed_factor
        speed = min(speeds[i], factor * graph.limit(lane))
        found.append(Wish(lane, i, 0.0, own.kinds[i], *size, own.drivers[i], s, speed))
    return found


def _pushed(places: Floats, lengths: Floats, most: float) -> Floats:
    """Places that leave the least gap to those behind, up to a length [m]."""
    found = places.copy()
    for i in range(1, len(found)):
        found[i] = max(found[i], found[i - 1] + 0.5 * (lengths[i - 1] + lengths[i]) + _GAP)
    for i in range(len(found) - 1, 0, -1):
        if found[i] > most:
            found[i] = min(found[i], most)
            most = found[i] - 0.5 * (lengths[i - 1] + lengths[i]) - _GAP
    return found


def _speeds(
    graph: LaneGraph,
    chain: Chain,
    places: Floats,
    lengths: Floats,
    gaps: Sequence[float],
    kept: Sequence[int],
    *,
    is_exit: bool,
) -> dict[int, float]:
    """Speeds in equilibrium with the gaps, from the front to the back [m/s]."""
    found: dict[int, float] = {}
    limit = max(graph.limit(lane) for lane in chain.lanelet_ids)
    for place, i in reversed(list(enumerate(kept))):
        ahead = kept[place + 1] if place + 1 < len(kept) else kept[0] if chain.is_ring else -1
        free = chain.length - places[i] - 0.5 * lengths[i]
        most = math.inf if is_exit or chain.is_ring else math.sqrt(2.0 * _GENTLE * max(0.0, free))
        if ahead < 0 or len(kept) == 1:
            found[i] = limit if math.isinf(most) else most
            continue
        distance = (places[ahead] - places[i]) % chain.length if chain.is_ring else places[ahead] - places[i]
        gap = float(distance - 0.5 * (lengths[i] + lengths[ahead]))
        own = equilibrium_speed(gap, limit, gaps[i])
        if ahead in found:
            lead = found[ahead]
            firm = math.sqrt(_FIRM * _FIRM + lead * lead + 2.0 * _FIRM * max(0.0, gap - _GAP)) - _FIRM
            own = min(own, max(0.0, firm))
        found[i] = min(own, most)
    return found


def equilibrium_speed(gap: float, desired: float, time_gap: float) -> float:
    """Speed at which the Intelligent Driver Model keeps its gap to a vehicle of the same speed [m/s].

    Treiber, Kesting, "Traffic Flow Dynamics", 2013, eq. 11.19, solved for the speed.

    Args:
        gap: To the vehicle ahead [m].
        desired: Speed on a free road [m/s].
        time_gap: Of the driver [s].
    """
    low, high = 0.0, desired
    for _ in range(50):
        middle = 0.5 * (low + high)
        wanted = _GAP + middle * time_gap
        if wanted > gap * math.sqrt(max(0.0, 1.0 - (middle / desired) ** 4)):
            high = middle
        else:
            low = middle
    return low
