"""A large intersection, four arms with three lanes in and two out: north and south cross first, then east and west."""

from __future__ import annotations

import numpy as np
from curves import Pose, connection, straight
from document import Goal, Made
from network import Incoming, Network
from traffic import SIZES, Vehicle, distance_through_zone, drive, free

ARM = 180.0
#: From the middle of the intersection to where the arms begin [m].
BOX = 22.0
DURATION = 12.0
#: Lanes in, from the left: one that turns left, one straight ahead, one straight ahead or right. Distance of their
#: centres from the middle of the road [m]; the outer two go on as lanes out, the inner one opens in the median.
OFFSETS = (1.75, 5.25, 8.75)
#: Headings of those that come from the south, east, north and west.
ARMS = (0.5 * np.pi, np.pi, -0.5 * np.pi, 0.0)
#: Traffic: arms, movement, number of vehicles on each arm, how far from the intersection they start [m], and their
#: speeds before, in and after it [m/s]. First vehicles from north and south turn left, then others go straight on,
#: at last east and west. Those with the least choice come first.
MOVEMENTS = (
    ((0, 2), "left", 1, (1.0, 10.0), (9.0, 6.8, 12.5)),
    ((1, 3), "right", 1, (2.0, 12.0), (8.0, 5.0, 13.0)),
    ((0, 2), "right", 1, (85.0, 115.0), (12.0, 5.0, 13.0)),
    ((0, 2), "straight 2", 2, (30.0, 80.0), (10.0, 12.0, 13.5)),
    ((0, 2), "straight 1", 2, (30.0, 80.0), (10.0, 12.0, 13.5)),
    ((1, 3), "straight 2", 2, (95.0, 172.0), (13.0, 11.0, 13.0)),
    ((1, 3), "straight 1", 3, (95.0, 172.0), (13.0, 11.0, 13.0)),
    ((1, 3), "left", 1, (90.0, 150.0), (12.5, 6.8, 12.5)),
)
#: The kind of the first vehicle of a movement, where it is no car.
KINDS = {(1, "straight 1"): "bus", (2, "straight 1"): "truck", (3, "right"): "motorcycle"}
#: The planning problem: the vehicle that comes from the south and turns left.
EGO = (0, "left")


def entering(arm: int, lane: int) -> int:
    """Id of a lanelet that leads in."""
    return 100 * (arm + 1) + lane + 1


def leaving(arm: int, lane: int) -> int:
    """Id of a lanelet that leads out of the arm; lane 1 is the inner, 2 the outer one."""
    return 100 * (arm + 1) + 10 + lane


def inside(arm: int, turn: str) -> int:
    """Id of a lanelet inside: "left", "straight 1", "straight 2" or "right"."""
    return 100 * (arm + 1) + 21 + ("left", "straight 1", "straight 2", "right").index(turn)


def target(arm: int, turn: str) -> int:
    """Id of the lanelet on which a movement leaves."""
    # Arms are numbered by where one comes from, against the clock from the south: the next one is to the right.
    beyond, lane = {"left": (3, 1), "straight 1": (2, 1), "straight 2": (2, 2), "right": (1, 2)}[turn]
    return leaving((arm + beyond) % 4, lane)


def source(arm: int, turn: str) -> int:
    """Id of the lanelet on which a movement comes."""
    return entering(arm, {"left": 0, "straight 1": 1, "straight 2": 2, "right": 2}[turn])


def network() -> Network:
    """Twelve lanelets in, eight out, sixteen inside."""
    roads = Network(speed_limit=50.0 / 3.6)
    middle = Pose(0.0, 0.0, 0.0)
    for arm, heading in enumerate(ARMS):
        inwards = Pose(middle.x, middle.y, heading)
        outwards = Pose(middle.x, middle.y, heading + np.pi)
        for lane, aside in enumerate(OFFSETS):
            roads.add(entering(arm, lane), straight(inwards.ahead(-BOX - ARM, -aside), ARM), spacing=10.0)
            if lane > 0:
                roads.add(leaving(arm, lane), straight(outwards.ahead(BOX, -aside), ARM), spacing=10.0)
        roads.neighbours(entering(arm, 0), entering(arm, 1))
        roads.neighbours(entering(arm, 1), entering(arm, 2))
        roads.neighbours(leaving(arm, 1), leaving(arm, 2))
    incomings = []
    for arm in range(4):
        for turn in ("left", "straight 1", "straight 2", "right"):
            _connect(roads, arm, turn)
        roads.neighbours(inside(arm, "straight 1"), inside(arm, "straight 2"), marking="no_marking")
        straights = [inside(arm, "straight 1"), inside(arm, "straight 2")]
        lanes = [entering(arm, lane) for lane in range(3)]
        incomings.append(Incoming(lanes, [inside(arm, "left")], straights, [inside(arm, "right")]))
    roads.intersections.append(incomings)
    return roads


def _connect(roads: Network, arm: int, turn: str) -> None:
    number, first, second = inside(arm, turn), source(arm, turn), target(arm, turn)
    out = roads.lanelets[second].center
    center = connection(roads.lanelets[first].center.end, Pose(*out.points[0], out.heading[0]))
    spacing = 4.0 if turn.startswith("straight") else 1.0
    roads.add(number, center, spacing, kinds=("urban", "intersection"), markings=("no_marking", "no_marking"))
    roads.follow(first, number)
    roads.follow(number, second)


def make() -> Made:
    """The scenario."""
    roads = network()
    chance = np.random.default_rng(5)
    vehicles: list[Vehicle] = []
    movements: list[tuple[int, str]] = []
    for arms, turn, count, window, speeds in MOVEMENTS:
        for arm in arms:
            for index in range(count):
                kind = KINDS.get((arm, turn), "car") if index == 0 else "car"
                size = (kind, *SIZES[kind][chance.integers(len(SIZES[kind]))])
                vehicles.append(_placed(roads, (arm, turn), size, (window, speeds), vehicles, chance))
                movements.append((arm, turn))
    ego = vehicles.pop(movements.index(EGO))
    goal = Goal(time_step=(70, 150), lanelets=(target(*EGO),))
    tags = ("urban", "intersection", "multi_lane", "oncoming_traffic", "turn_left")
    return Made("ZAM_InterdriveIntersection-1_1_T-1", tags, roads, vehicles, [(ego, goal)])


def _placed(
    roads: Network,
    movement: tuple[int, str],
    size: tuple[str, float, float],
    choice: tuple[tuple[float, float], tuple[float, float, float]],
    others: list[Vehicle],
    chance: np.random.Generator,
) -> Vehicle:
    """A vehicle that starts somewhere in its window and keeps its distance from all others."""
    path = roads.path([source(*movement), inside(*movement), target(*movement)])
    zone = (ARM, ARM + roads.lanelets[inside(*movement)].center.length)
    window, (before, within, after) = choice
    for _ in range(1000):
        ahead = chance.uniform(*window) + 0.5 * size[1]
        speeds = (before + chance.uniform(-0.8, 0.8), within, after + chance.uniform(-0.5, 0.5))
        vehicle = drive(path, distance_through_zone(ARM - ahead, speeds, zone, DURATION), size)
        if free(vehicle, others, along=7.0, aside=0.4):
            return vehicle
    raise ValueError(f"no room left for {movement}")
