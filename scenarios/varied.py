"""Makes many different junctions in which vehicles have to yield, to learn from and to be judged by.

    python scenarios/varied.py out/varied --number 40 --seed 0

Every seed is another scenario: three or four arms at any angles, straight or curved, lanes of any usual width, traffic
that crosses; every other one is small, with slow traffic. Some vehicles stop and let others pass; at their first speed
they would hit one of them.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from curves import Floats, Pose, of_curvature, samples
from curves import Path as Curve
from document import Goal, Made, document
from network import Incoming, Network
from traffic import DT, FINE, SIZES, Vehicle, distance_over_time, distance_through_zone, drive, free

ARM, VERTICES = 120.0, 60
#: Least angle between two arms [rad].
ANGLE_MIN = np.deg2rad(60.0)
#: Vehicles that wait stop so far before the junction [m].
STOP = 3.0
#: Vehicles with priority, and those that yield: at most so many of each.
PASSING, YIELDING = 5, 3


@dataclass(frozen=True)
class Kind:
    """What a junction is like.

    Attributes:
        box: From its middle to where the arms begin, at least and at most [m].
        curvature_max: The tightest curve of a way through it [1/m].
        pace: Speeds, as a share of those in a usual town.
        duration: Of the scenario [s].
    """

    box: tuple[float, float] = (14.0, 20.0)
    curvature_max: float = 0.17
    pace: float = 1.0
    duration: float = 14.0


def kind(seed: int, chance: np.random.Generator) -> Kind:
    """Every other seed is a small junction with slow traffic."""
    if seed % 2 == 0:
        return Kind()
    return Kind(box=(9.0, 14.0), curvature_max=0.3, pace=float(chance.uniform(0.3, 0.6)), duration=22.0)


def entering(arm: int) -> int:
    """Id of the lanelet that leads in."""
    return 10 * (arm + 1)


def leaving(arm: int) -> int:
    """Id of the lanelet that leads out."""
    return 10 * (arm + 1) + 1


def inside(arm: int, beyond: int) -> int:
    """Id of the lanelet from one arm to another."""
    return 10 * (arm + 1) + 2 + beyond


def network(like: Kind, chance: np.random.Generator) -> tuple[Network, int]:
    """Roads and the number of arms."""
    while True:
        n = int(chance.integers(3, 5))
        directions = np.sort(chance.uniform(0.0, 2.0 * np.pi, n))
        apart = np.diff(np.append(directions, directions[0] + 2.0 * np.pi))
        if apart.min() < ANGLE_MIN:
            continue
        roads = _roads(directions, like, chance)
        if roads is not None:
            return roads, n


def _roads(directions: Floats, like: Kind, chance: np.random.Generator) -> Network | None:
    """A junction with arms in these directions; None if a way through it is too tight."""
    roads = Network(speed_limit=50.0 / 3.6)
    width, box = chance.uniform(3.0, 4.0), chance.uniform(*like.box)
    for arm, direction in enumerate(directions):
        out = _arm(Pose(0.0, 0.0, float(direction)).ahead(box), chance)
        # Lanelets side by side have the same number of vertices, also in a bend.
        for number, center in (
            (leaving(arm), _beside(out, -0.5 * width)),
            (entering(arm), _backwards(_beside(out, 0.5 * width))),
        ):
            roads.add(number, center, spacing=center.length / VERTICES, width=width)
        roads.neighbours(leaving(arm), entering(arm), same_direction=False)
    incomings = []
    for arm in range(len(directions)):
        others = [(arm + i) % len(directions) for i in range(1, len(directions))]
        for beyond in others:
            first, second = roads.lanelets[entering(arm)].center, roads.lanelets[leaving(beyond)].center
            way = _joining(first.end, Pose(*second.points[0], second.heading[0]))
            if np.abs(np.diff(way.heading) / np.diff(way.s)).max() > like.curvature_max:
                return None
            roads.add(
                inside(arm, beyond), way, spacing=1.0, width=width, kinds=("urban", "intersection"),
                markings=("no_marking", "no_marking"),
            )  # fmt: skip
            roads.follow(entering(arm), inside(arm, beyond))
            roads.follow(inside(arm, beyond), leaving(beyond))
        # Arms are sorted against the clock, so the next one is to the right of the vehicles that come in.
        right, *between, left = [inside(arm, beyond) for beyond in others]
        incomings.append(Incoming([entering(arm)], left=[left], straight=between, right=[right]))
    roads.intersections.append(incomings)
    return roads


def _arm(start: Pose, chance: np.random.Generator) -> Curve:
    """The middle of a road: straight at first, then a bend to either side, or two."""
    share = np.linspace(0.0, 1.0, samples(ARM))
    bend = chance.uniform(-0.025, 0.025) * np.sin(
        np.pi * np.clip((share - 0.1) / 0.9, 0.0, 1.0) * chance.integers(1, 3)
    )
    return of_curvature(start, bend, ARM)


def _beside(path: Curve, left: float) -> Curve:
    points, heading = path.at(path.s, left)
    return Curve(points, heading, np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T)))))


def _backwards(path: Curve) -> Curve:
    return Curve(path.points[::-1], path.heading[::-1] + np.pi, path.s[-1] - path.s[::-1])


def _joining(start: Pose, end: Pose) -> Curve:
    """From one pose to another as quintics of one parameter, without curvature at both ends."""
    t = np.linspace(0.0, 1.0, 2001)[:, None]
    first, last = np.array([start.x, start.y]), np.array([end.x, end.y])
    reach = 1.1 * float(np.hypot(*(last - first)))
    ahead = reach * np.array([np.cos(start.heading), np.sin(start.heading)])
    on = reach * np.array([np.cos(end.heading), np.sin(end.heading)])
    gap = last - first - ahead
    a3, a4, a5 = 10.0 * gap - 4.0 * (on - ahead), -15.0 * gap + 7.0 * (on - ahead), 6.0 * gap - 3.0 * (on - ahead)
    points = first + ahead * t + a3 * t**3 + a4 * t**4 + a5 * t**5
    moves = ahead + 3.0 * a3 * t**2 + 4.0 * a4 * t**3 + 5.0 * a5 * t**4
    s = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))))
    return Curve(points, np.unwrap(np.arctan2(moves[:, 1], moves[:, 0])), s)


def make(seed: int) -> Made:
    """The scenario of a seed; the last one that yields is its planning problem."""
    chance = np.random.default_rng(seed)
    like = kind(seed, chance)
    while True:
        roads, arms = network(like, chance)
        ways = list(itertools.permutations(range(arms), 2))
        vehicles = _passing(roads, ways, like, chance)
        yielding = _yielding(roads, ways, vehicles, like, chance)
        if yielding:
            break
    (ego, way), *others = reversed(yielding)
    goal = Goal(time_step=(60, round(like.duration / DT)), lanelets=(leaving(way[1]),))
    vehicles += [vehicle for vehicle, _ in others]
    tags = ("urban", "intersection", "two_lane", "oncoming_traffic")
    return Made(f"ZAM_InterdriveVaried-{seed + 1}_1_T-1", tags, roads, vehicles, [(ego, goal)])


def _path(roads: Network, way: tuple[int, int]) -> Curve:
    return roads.path([entering(way[0]), inside(*way), leaving(way[1])])


def _passing(roads: Network, ways: list[tuple[int, int]], like: Kind, chance: np.random.Generator) -> list[Vehicle]:
    """Vehicles that keep clear of each other without waiting."""
    found: list[Vehicle] = []
    for _ in range(12 * PASSING):
        if len(found) == PASSING:
            break
        way = ways[chance.integers(len(ways))]
        bent = roads.lanelets[inside(*way)].center
        sharp = float(np.abs(np.diff(bent.heading) / np.diff(bent.s)).max())
        before = like.pace * chance.uniform(8.0, 13.0)
        within = min(before, float(np.sqrt(2.5 / max(sharp, 1e-3))))
        speeds = (before, within, like.pace * chance.uniform(9.0, 13.0))
        start = ARM - like.pace * chance.uniform(25.0, 95.0)
        s = distance_through_zone(start, speeds, (ARM, ARM + bent.length), like.duration)
        vehicle = drive(_path(roads, way), s, ("car", *SIZES["car"][chance.integers(4)]))
        if free(vehicle, found, along=6.0):
            found.append(vehicle)
    return found


def _yielding(
    roads: Network, ways: list[tuple[int, int]], passing: list[Vehicle], like: Kind, chance: np.random.Generator
) -> list[tuple[Vehicle, tuple[int, int]]]:
    """Vehicles that would hit one with priority if they kept their speed, and wait until they hit none."""
    found: list[tuple[Vehicle, tuple[int, int]]] = []
    for _ in range(20 * YIELDING):
        if len(found) == YIELDING:
            break
        way = ways[chance.integers(len(ways))]
        path, size = _path(roads, way), ("car", *SIZES["car"][chance.integers(4)])
        speed, standing = like.pace * chance.uniform(6.0, 10.0), chance.uniform(3.0, 5.0)
        start = ARM - STOP - 0.5 * size[1] - 0.5 * speed * standing
        held = start + speed * np.arange(0.0, like.duration + 0.5 * FINE, FINE)
        if start < 5.0 or free(drive(path, held, size), passing, along=0.0, aside=0.0):
            continue
        others = passing + [vehicle for vehicle, _ in found]
        # All that follow are the same until it stands.
        arriving = start + distance_over_time([(0.0, speed), (standing, 0.0)], standing)
        if not free(drive(path, arriving, size), others, along=5.0):
            continue
        for go in np.arange(standing + 0.5, like.duration - 5.5, 0.5 / like.pace):
            later = [(3.0, 4.8), (4.5, 5.2), (8.0, 10.0)]
            knots = [(0.0, speed), (standing, 0.0), (go, 0.0), *((go + t, like.pace * v) for t, v in later)]
            vehicle = drive(path, start + distance_over_time(knots, like.duration), size)
            if free(vehicle, others, along=5.0):
                found.append((vehicle, way))
                break
    return found


def main(arguments: list[str] | None = None) -> int:
    """Writes the files."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--number", type=int, default=40, help="of scenarios")
    parser.add_argument("--seed", type=int, default=0, help="of the first one; the next one has the next seed")
    options = parser.parse_args(arguments)
    if options.number < 1 or options.seed < 0:
        parser.error("--number must be at least 1, --seed must not be negative")
    options.folder.mkdir(parents=True, exist_ok=True)
    for seed in range(options.seed, options.seed + options.number):
        made = make(seed)
        (options.folder / f"{made.benchmark_id}.xml").write_text(document(made), encoding="utf-8")
    sys.stdout.write(f"{options.number} scenarios in {options.folder}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
