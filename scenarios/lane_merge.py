"""Two lanes become one: the left lane ends, vehicles zip together; the planning problem comes on the lane that ends."""

from __future__ import annotations

import numpy as np
from curves import Floats, Path, Pose, shifted, straight
from document import Goal, Made
from network import LANE_WIDTH, Network
from traffic import FINE, Vehicle, drive, free

BEFORE, TAPER, AFTER = 200.0, 70.0, 180.0
DURATION = 15.0
SPEED = 13.0
#: Distance of one vehicle to the next where the lanes have become one [m].
HEADWAY = 21.0
#: The planning problem's place in the queue, counted from 0 at its front.
EGO_PLACE = 3
RIGHT, LEFT, RIGHT_TAPER, LEFT_TAPER, MERGED = 1, 2, 3, 4, 5


def network() -> Network:
    """Two lanes side by side, a taper in which the left one moves over the right one, one lane."""
    roads = Network(speed_limit=60.0 / 3.6)
    begin = Pose(-BEFORE - TAPER, 0.0, 0.0)
    right, left = straight(begin, BEFORE), straight(begin.ahead(0.0, LANE_WIDTH), BEFORE)
    roads.add(RIGHT, right, spacing=10.0)
    roads.add(LEFT, left, spacing=10.0)
    roads.add(RIGHT_TAPER, straight(right.end, TAPER), spacing=5.0)
    roads.add(LEFT_TAPER, shifted(left.end, TAPER, -LANE_WIDTH), spacing=2.0)
    roads.add(MERGED, straight(Pose(0.0, 0.0, 0.0), AFTER), spacing=10.0)
    roads.neighbours(LEFT, RIGHT)
    for first, second in ((RIGHT, RIGHT_TAPER), (LEFT, LEFT_TAPER), (RIGHT_TAPER, MERGED), (LEFT_TAPER, MERGED)):
        roads.follow(first, second)
    return roads


def make() -> Made:
    """The scenario."""
    roads = network()
    paths = {side: roads.path(route) for side, route in _routes().items()}
    chance = np.random.default_rng(7)
    sizes = (("car", 4.5, 1.82), ("car", 4.2, 1.78), ("truck", 9.2, 2.5), ("car", 4.7, 1.85))
    vehicles: list[Vehicle] = []
    # In the order in which they leave the taper, from the front; every other one comes on the lane that ends.
    for place in range(7):
        size = ("car", 4.6, 1.85) if place == EGO_PLACE else sizes[place % 4]
        path = paths["left" if place % 2 else "right"]
        vehicles.append(_zipping(path, place, size, vehicles, chance))
    ego = vehicles.pop(EGO_PLACE)
    goal = Goal(time_step=(120, 150), lanelets=(MERGED,))
    tags = ("urban", "merging_lanes", "multi_lane", "no_oncoming_traffic")
    return Made("ZAM_InterdriveMerge-1_1_T-1", tags, roads, vehicles, [(ego, goal)])


def _routes() -> dict[str, list[int]]:
    return {"right": [RIGHT, RIGHT_TAPER, MERGED], "left": [LEFT, LEFT_TAPER, MERGED]}


def _zipping(
    path: Path, place: int, size: tuple[str, float, float], others: list[Vehicle], chance: np.random.Generator
) -> Vehicle:
    """A vehicle that starts somewhere near its place with some speed and has found it before the taper."""
    front = BEFORE - 15.0
    for _ in range(200):
        # Where it would be had it driven at the common speed all the time, and where it is instead.
        start = front - place * HEADWAY + chance.uniform(-7.0, 7.0)
        speed = SPEED + chance.uniform(-1.8, 1.8)
        settled = max(3.5, 4.0 + 0.45 * place)
        s = _quintic(start, speed, front - place * HEADWAY + SPEED * settled, settled)
        vehicle = drive(path, s, size)
        if start > 5.0 and free(vehicle, others, along=9.0, aside=0.2):
            return vehicle
    raise ValueError(f"no start found for place {place}")


def _quintic(start: float, speed: float, target: float, settled: float) -> Floats:
    """Arc length at every `FINE`: from a start and speed to a target at the common speed, and on at that speed."""
    time = np.arange(0.0, DURATION + 0.5 * FINE, FINE)
    t = np.clip(time / settled, 0.0, 1.0)
    gap, gained = target - start - speed * settled, (SPEED - speed) * settled
    a3, a4, a5 = 10.0 * gap - 4.0 * gained, -15.0 * gap + 7.0 * gained, 6.0 * gap - 3.0 * gained
    moving = start + speed * settled * t + a3 * t**3 + a4 * t**4 + a5 * t**5
    return moving + SPEED * np.maximum(time - settled, 0.0)
