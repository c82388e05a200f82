"""A T-junction of a main road and a side road, where the planning problem gives way and turns left."""

from __future__ import annotations

import numpy as np
from curves import Pose, connection, straight
from document import Goal, Made
from network import Incoming, Network, Sign
from traffic import Vehicle, distance_over_time, distance_through_zone, drive, first_free

ARM = 150.0
#: From the middle of the junction to where the arms begin [m].
BOX = 14.0
DURATION = 13.0
HALF_LANE = 1.75
#: Traffic signs: this road goes first, this one gives way.
PRIORITY, YIELD = "306", "205"

EAST, NORTH, WEST, SOUTH = 0.0, 0.5 * np.pi, np.pi, -0.5 * np.pi
FROM_WEST, TO_WEST, FROM_EAST, TO_EAST, FROM_SOUTH, TO_SOUTH = 1, 2, 3, 4, 5, 6
WEST_EAST, WEST_SOUTH, EAST_WEST, EAST_SOUTH, SOUTH_EAST, SOUTH_WEST = 7, 8, 9, 10, 11, 12
INSIDE = {
    WEST_EAST: (FROM_WEST, TO_EAST),
    WEST_SOUTH: (FROM_WEST, TO_SOUTH),
    EAST_WEST: (FROM_EAST, TO_WEST),
    EAST_SOUTH: (FROM_EAST, TO_SOUTH),
    SOUTH_EAST: (FROM_SOUTH, TO_EAST),
    SOUTH_WEST: (FROM_SOUTH, TO_WEST),
}


def network() -> Network:
    """Three arms with a lane each way, six lanelets inside."""
    roads = Network(speed_limit=50.0 / 3.6)
    for number, start in {
        FROM_WEST: Pose(-BOX - ARM, -HALF_LANE, EAST),
        TO_WEST: Pose(-BOX, HALF_LANE, WEST),
        FROM_EAST: Pose(BOX + ARM, HALF_LANE, WEST),
        TO_EAST: Pose(BOX, -HALF_LANE, EAST),
        FROM_SOUTH: Pose(HALF_LANE, -BOX - ARM, NORTH),
        TO_SOUTH: Pose(-HALF_LANE, -BOX, SOUTH),
    }.items():
        roads.add(number, straight(start, ARM), spacing=10.0)
    for number, (first, second) in INSIDE.items():
        center = connection(roads.lanelets[first].center.end, _start(roads, second))
        roads.add(number, center, spacing=1.0, kinds=("urban", "intersection"), markings=("no_marking", "no_marking"))
        roads.follow(first, number)
        roads.follow(number, second)
    for left, right in ((TO_WEST, FROM_WEST), (TO_EAST, FROM_EAST), (TO_SOUTH, FROM_SOUTH)):
        roads.neighbours(left, right, same_direction=False)
    roads.neighbours(EAST_WEST, WEST_EAST, same_direction=False, marking="no_marking")
    incomings = [
        Incoming([FROM_WEST], straight=[WEST_EAST], right=[WEST_SOUTH]),
        Incoming([FROM_EAST], left=[EAST_SOUTH], straight=[EAST_WEST]),
        Incoming([FROM_SOUTH], left=[SOUTH_WEST], right=[SOUTH_EAST]),
    ]
    roads.intersections.append(incomings)
    for code, number in ((PRIORITY, FROM_WEST), (PRIORITY, FROM_EAST), (YIELD, FROM_SOUTH)):
        x, y = roads.lanelets[number].right[-1]
        roads.signs.append(Sign(code, (number,), (float(x), float(y))))
    return roads


def _start(roads: Network, number: int) -> Pose:
    center = roads.lanelets[number].center
    return Pose(*center.points[0], center.heading[0])


def make() -> Made:
    """The scenario."""
    roads = network()
    vehicles: list[Vehicle] = []

    def add(
        inside: int, aheads: list[float], speeds: tuple[float, float, float], size: tuple[str, float, float]
    ) -> None:
        """Adds a vehicle that starts ahead of the junction [m], at the first distance without contact.

        It has one speed before, one in and one behind the junction [m/s].
        """
        path = roads.path([INSIDE[inside][0], inside, INSIDE[inside][1]])
        zone = (ARM, ARM + roads.lanelets[inside].center.length)
        choice = [drive(path, distance_through_zone(ARM - ahead, speeds, zone, DURATION), size) for ahead in aheads]
        vehicles.append(first_free(choice, vehicles, along=4.0))

    # All of them respect the right of way: the left turn comes behind the bus, the car from the south between it and
    # the next one.
    add(WEST_EAST, [104.0], (13.0, 13.0, 13.0), ("car", 4.6, 1.85))
    add(WEST_EAST, [9.0], (11.0, 11.0, 11.0), ("bus", 12.0, 2.55))
    add(EAST_WEST, [66.0], (12.8, 12.8, 12.8), ("car", 4.4, 1.8))
    add(EAST_WEST, [94.0], (11.0, 11.0, 11.0), ("truck", 9.2, 2.5))
    add(EAST_SOUTH, [20.0], (8.5, 5.6, 12.0), ("car", 4.3, 1.78))
    add(SOUTH_EAST, [*np.arange(6.0, 14.0, 1.0)], (6.5, 4.8, 13.0), ("car", 4.5, 1.82))
    add(WEST_SOUTH, [*np.arange(-6.0, -12.0, -1.0)], (6.0, 5.2, 12.0), ("motorcycle", 2.2, 0.85))
    ego = first_free([_ego(roads, go) for go in np.arange(5.5, 9.0, 0.25)], vehicles, along=5.0)
    goal = Goal(time_step=(90, 160), lanelets=(TO_WEST,))
    tags = ("urban", "intersection", "two_lane", "turn_left", "oncoming_traffic")
    return Made("ZAM_InterdriveTJunction-2_1_T-1", tags, roads, vehicles, [(ego, goal)])


def _ego(roads: Network, go: float) -> Vehicle:
    """Comes from the south, stops at the junction after 5 s, goes at `go` [s] and turns left."""
    path = roads.path([FROM_SOUTH, SOUTH_WEST, TO_WEST])
    s = distance_over_time(
        [(0.0, 9.0), (5.0, 0.0), (go, 0.0), (go + 3.0, 4.8), (go + 4.5, 5.2), (go + 8.0, 10.0)], DURATION
    )
    stop = ARM - 3.0
    return drive(path, s + stop - s[round(5.0 / 0.005)], ("car", 4.5, 1.8))
