"""A town of 40 crossings and a thousand planning problems, for measuring how cost grows with the number of agents.

One-way streets of three lanes, 240 m apart, alternately in both directions. Platoons as on a green wave: those of the
rows are half a period ahead of those of the columns, so that no vehicle has to wait while all keep their speed; the
last vehicle of some lanes turns. Every cell, a crossing and half a block around it, has 25 vehicles. Their ids follow a
chain of rectangles of cells, each around the one before: the first 25, 100, 300 and 1000 ids live in 1, 4, 12 and 40
cells, so that any number of agents drives at the same density.
"""

from __future__ import annotations

import itertools

import numpy as np
from curves import Pose, connection, straight
from document import Goal, Made
from network import LANE_WIDTH, Incoming, Network
from traffic import Vehicle

#: Rows of crossings from south to north, columns from west to east.
ROWS, COLUMNS = 5, 8
#: Distance of crossings, and from the middle of a crossing to where its lanelets begin [m].
BLOCK, BOX = 240.0, 18.0
#: Streets go on for so long beyond the last crossing [m].
ARM = 560.0
LANES = 3
#: Speed of the green wave [m/s], and deviations from it at the start.
SPEED, SPEED_SPREAD = 12.0, 0.4
#: Vehicles that go straight on drive for this long [s].
DURATION = 30.0
#: Middle of the platoons of rows and columns, seen from their crossing [m].
PLATOON = (-0.25 * BLOCK, 0.25 * BLOCK)
#: Vehicles of a platoon in each lane from the right, and their distance [m]; rows have one more in the middle lane.
PER_LANE, SPACING, SPACING_OF_FIVE = 4, 22.0, 17.5
#: Random displacement along the lane [m].
DISPLACEMENT = 1.5
#: Chance of the last vehicle of a lane to turn, and where those that turned end beyond the crossing [m].
TURNS, TURNED = 0.5, 75.0
#: Goals are so long [m]; they open and close so many time steps before and after the due one.
GOAL_LENGTH, EARLY, LATE = 40.0, 10, 30
FIRST_LANELET_ID = 10_000

#: A street: ("row", number from the south) or ("column", number from the west).
Street = tuple[str, int]


def streets() -> list[Street]:
    """All streets, rows first."""
    return [("row", row) for row in range(ROWS)] + [("column", column) for column in range(COLUMNS)]


def beginning(street: Street) -> Pose:
    """Where the middle line of a street begins, half a block before its first crossing."""
    kind, number = street
    forwards = number % 2 == 0
    far = (COLUMNS if kind == "row" else ROWS) - 1
    along = -0.5 * BLOCK if forwards else (far + 0.5) * BLOCK
    if kind == "row":
        return Pose(along, number * BLOCK, 0.0 if forwards else np.pi)
    return Pose(number * BLOCK, along, 0.5 * np.pi if forwards else -0.5 * np.pi)


def crossed(street: Street) -> list[Street]:
    """The streets that a street crosses, in the order in which it meets them."""
    kind, number = street
    others = [("column", i) for i in range(COLUMNS)] if kind == "row" else [("row", i) for i in range(ROWS)]
    return others if number % 2 == 0 else others[::-1]


def position(street: Street, other: Street) -> int:
    """How many crossings lie before the crossing with another street."""
    return crossed(street).index(other)


def section(street: Street, index: int, lane: int) -> int:
    """Id of a lane (0 is the right one) between crossing `index - 1` and crossing `index`."""
    return FIRST_LANELET_ID + 200 * streets().index(street) + 20 * index + lane


def inside(street: Street, index: int, lane: int) -> int:
    """Id of a lane in crossing `index`; lane 3 is the one that turns into the other street."""
    return section(street, index, 10 + lane)


def offset(lane: int) -> float:
    """Distance of a lane's centre to the left of the street's [m]."""
    return (lane - 0.5 * (LANES - 1)) * LANE_WIDTH


def turning_lane(street: Street, other: Street) -> int:
    """The lane from and into which one turns: the right one if the other street leads to the right."""
    turn = np.sin(beginning(other).heading - beginning(street).heading)
    return LANES - 1 if turn > 0.0 else 0


def network() -> Network:
    """Thirteen streets."""
    roads = Network(speed_limit=50.0 / 3.6)
    for street in streets():
        _add_street(roads, street)
    for row, column in itertools.product(range(ROWS), range(COLUMNS)):
        pair: tuple[Street, Street] = (("row", row), ("column", column))
        roads.intersections.append([_connect(roads, *pair), _connect(roads, *pair[::-1])])
    return roads


def _add_street(roads: Network, street: Street) -> None:
    begin, n = beginning(street), len(crossed(street))
    for lane in range(LANES):
        for index in range(n + 1):
            start = 0.0 if index == 0 else (index - 0.5) * BLOCK + BOX
            end = (index + 0.5) * BLOCK - BOX if index < n else (n - 0.5) * BLOCK + ARM
            roads.add(section(street, index, lane), straight(begin.ahead(start, offset(lane)), end - start), 60.0)
            if index < n:
                through = straight(begin.ahead(end, offset(lane)), 2.0 * BOX)
                kinds, no = ("urban", "intersection"), "no_marking"
                roads.add(inside(street, index, lane), through, 12.0, kinds=kinds, markings=(no, no))
        for index in range(n):
            roads.follow(section(street, index, lane), inside(street, index, lane))
            roads.follow(inside(street, index, lane), section(street, index + 1, lane))
    for lane, index in itertools.product(range(LANES - 1), range(n + 1)):
        roads.neighbours(section(street, index, lane + 1), section(street, index, lane))
        if index < n:
            roads.neighbours(inside(street, index, lane + 1), inside(street, index, lane), marking="no_marking")


def _connect(roads: Network, street: Street, other: Street) -> Incoming:
    """Adds the lane that turns from a street into another, with its turn in the intersection."""
    index, lane = position(street, other), turning_lane(street, other)
    here, number = section(street, index, lane), inside(street, index, 3)
    there = section(other, position(other, street) + 1, lane)
    out = roads.lanelets[there].center
    center = connection(roads.lanelets[here].center.end, Pose(*out.points[0], out.heading[0]))
    no = "no_marking"
    roads.add(number, center, 1.5, kinds=("urban", "intersection"), markings=(no, no))
    roads.follow(here, number)
    roads.follow(number, there)
    incoming = Incoming([section(street, index, lane) for lane in range(LANES)])
    incoming.straight = [inside(street, index, lane) for lane in range(LANES)]
    (incoming.right if lane == 0 else incoming.left).append(number)
    return incoming


def cells() -> list[tuple[int, int]]:
    """All crossings as (row, column), in the order of their vehicles' ids."""
    sizes = [(1, 1), (2, 2), (3, 4), (ROWS, COLUMNS)]
    everywhere = itertools.product(range(ROWS), range(COLUMNS))
    rank = {cell: next(i for i, (r, c) in enumerate(sizes) if cell[0] < r and cell[1] < c) for cell in everywhere}
    return sorted(rank, key=lambda cell: (rank[cell], cell))


def make() -> Made:
    """The scenario."""
    roads = network()
    chance = np.random.default_rng(17)
    problems: list[tuple[Vehicle, Goal]] = []
    for row, column in cells():
        pair: tuple[Street, Street] = (("row", row), ("column", column))
        problems += _platoon(roads, *pair, chance) + _platoon(roads, *pair[::-1], chance)
    tags = ("urban", "intersection", "multi_lane", "no_oncoming_traffic")
    return Made("ZAM_InterdriveTown-1_1_T-1", tags, roads, [], problems)


def _platoon(roads: Network, street: Street, other: Street, chance: np.random.Generator) -> list[tuple[Vehicle, Goal]]:
    """The vehicles of a street in the cell of its crossing with another one, from the front to the back."""
    is_row, index = street[0] == "row", position(street, other)
    turning = turning_lane(street, other)
    problems = []
    for lane in range(LANES):
        count, spacing = (PER_LANE + 1, SPACING_OF_FIVE) if is_row and lane == 1 else (PER_LANE, SPACING)
        turns = is_row and lane == turning and chance.random() < TURNS
        for place in range(count):
            ahead = PLATOON[0 if is_row else 1] + (0.5 * (count - 1) - place) * spacing
            ahead += chance.uniform(-DISPLACEMENT, DISPLACEMENT)
            start = beginning(street).ahead((index + 0.5) * BLOCK + ahead, offset(lane))
            speed = SPEED + chance.uniform(-SPEED_SPREAD, SPEED_SPREAD)
            if turns and place == count - 1:
                to_turn = -BOX - ahead
                turn = roads.lanelets[inside(street, index, 3)].center
                end = turn.end.ahead(TURNED)
                # Turns are driven at about half the speed, and it takes some seconds to get there and back.
                due = (to_turn + 2.0 * turn.length + TURNED) / SPEED + 3.0
            else:
                end, due = start.ahead(SPEED * (DURATION + 1.0)), DURATION
            problems.append((_standing_in(start, speed), _goal(end, due)))
    return problems


def _standing_in(start: Pose, speed: float) -> Vehicle:
    one = [np.array([value]) for value in (start.x, start.y, start.heading, speed)]
    return Vehicle("car", 4.508, 1.61, *one)


def _goal(end: Pose, due: float) -> Goal:
    step = round(due / 0.1)
    return Goal((step - EARLY, step + LATE), rectangle=(end.x, end.y, end.heading, GOAL_LENGTH, LANE_WIDTH))
