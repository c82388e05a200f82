"""A six-lane highway, one way, slightly bent: thirty vehicles, some of which change lane, trucks on the right."""

from __future__ import annotations

import itertools

import numpy as np
from curves import Path, Pose, of_curvature, samples
from document import Goal, Made
from network import Network
from traffic import DT, FINE, SIZES, Vehicle, drive, free, smooth

LANES = 6
LANE_WIDTH = 3.75
#: Length of the road and radius of its bend to the left [m].
LENGTH, RADIUS = 760.0, 2000.0
#: Lanelets follow each other at these arc lengths [m].
JOINTS = (0.0, 380.0, LENGTH)
DURATION = 10.0
#: Speed of each lane from the right [m/s].
SPEEDS = (22.5, 24.0, 26.0, 27.5, 29.5, 31.0)
N_VEHICLES = 30
#: Lane changes: from lane to lane, counted from the right. The last one is the planning problem's.
CHANGES = ((1, 2), (3, 2), (2, 3), (4, 3), (4, 5), (2, 1))


def axis() -> Path:
    """Centre line of the whole road."""
    return of_curvature(Pose(0.0, 0.0, 0.0), np.full(samples(LENGTH), 1.0 / RADIUS), LENGTH)


def network() -> Network:
    """Six lanes side by side, each of two lanelets: 1 to 6 from the right, then 11 to 16."""
    roads = Network(speed_limit=120.0 / 3.6)
    middle = axis()
    for part, (begin, end) in enumerate(itertools.pairwise(JOINTS)):
        for lane in range(LANES):
            grid = np.linspace(begin, end, samples(end - begin))
            points, heading = middle.at(grid, offset(lane))
            step = np.hypot(*np.diff(points, axis=0).T)
            center = Path(points, heading, np.concatenate(([0.0], np.cumsum(step))))
            roads.add(10 * part + lane + 1, center, spacing=10.0, width=LANE_WIDTH, kinds=("highway",))
        for lane in range(LANES - 1):
            roads.neighbours(10 * part + lane + 2, 10 * part + lane + 1)
    for lane in range(LANES):
        roads.follow(lane + 1, lane + 11)
    return roads


def offset(lane: int) -> float:
    """Distance of a lane's centre to the left of the road's [m]."""
    return (lane - 0.5 * (LANES - 1)) * LANE_WIDTH


def make() -> Made:
    """The scenario."""
    chance = np.random.default_rng(11)
    middle = axis()
    vehicles: list[Vehicle] = []
    # Those that change lane first, since they need room in two lanes.
    for first, second in CHANGES:
        vehicles.append(_placed(middle, first, second, ("car", *SIZES["car"][len(vehicles) % 4]), vehicles, chance))
    lane = 0
    while len(vehicles) < N_VEHICLES + 1:
        truck = lane < 2 and chance.random() < 0.4
        kind = "truck" if truck else "car"
        size = (kind, *SIZES[kind][chance.integers(len(SIZES[kind]))])
        vehicles.append(_placed(middle, lane, lane, size, vehicles, chance))
        lane = (lane + 1) % LANES
    ego = vehicles.pop(len(CHANGES) - 1)
    end = (float(ego.x[-1]), float(ego.y[-1]), float(ego.heading[-1]))
    goal = Goal(
        time_step=(round(DURATION / DT) - 10, round(DURATION / DT)),
        rectangle=(*end, 50.0, LANE_WIDTH),
        velocity=(float(ego.speed[-1]) - 3.0, float(ego.speed[-1]) + 3.0),
    )
    tags = ("highway", "multi_lane", "parallel_lanes", "no_oncoming_traffic", "lane_change")
    return Made("ZAM_InterdriveHighway-1_1_T-1", tags, network(), vehicles, [(ego, goal)])


def _placed(
    middle: Path,
    first: int,
    second: int,
    size: tuple[str, float, float],
    others: list[Vehicle],
    chance: np.random.Generator,
) -> Vehicle:
    """A vehicle of a lane at a random place where it keeps its distance from all others."""
    for _ in range(2000):
        start = chance.uniform(10.0, 380.0)
        speed = SPEEDS[first] + chance.uniform(-0.7, 0.7) - (1.5 if size[0] == "truck" else 0.0)
        later = speed + 0.6 * (SPEEDS[second] - SPEEDS[first]) + chance.uniform(-0.5, 0.5)
        begin, taken = chance.uniform(1.0, 3.5), chance.uniform(4.0, 5.0)
        time = np.arange(0.0, DURATION + 0.5 * FINE, FINE)
        velocity = speed + (later - speed) * smooth((time - 1.0) / 7.0)
        s = start + np.concatenate(([0.0], np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) * FINE)))
        share = np.clip((time - begin) / taken, 0.0, 1.0)
        crossing = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        vehicle = drive(middle, s, size, offset(first) + (offset(second) - offset(first)) * crossing)
        if free(vehicle, others, along=18.0, aside=0.2):
            return vehicle
    raise ValueError(f"no room left in lane {first}")
