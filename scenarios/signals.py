"""The large intersection with traffic lights: north and south have green first, then east and west; no left turns."""

from __future__ import annotations

import numpy as np
from curves import Floats
from document import Goal, Made
from intersection import ARM, entering, inside, network, source, target
from network import Light
from traffic import FINE, SIZES, Vehicle, drive, free

DURATION = 18.0
#: Green, yellow and red of each pair of arms, in time steps, and when the green begins.
CYCLE = (("green", 60), ("yellow", 30), ("red", 110))
OFFSETS = {0: 200, 2: 200, 1: 100, 3: 100}
#: Traffic: arm, movement, and how far from the stop line each vehicle starts [m] and how fast it is [m/s].
QUEUES = (
    (0, "straight 2", ((12.0, 9.0), (38.0, 10.0), (66.0, 11.0), (110.0, 12.0))),
    (0, "straight 1", ((25.0, 10.0), (58.0, 11.0), (92.0, 12.0))),
    (2, "straight 2", ((18.0, 9.0), (47.0, 10.0), (80.0, 11.0))),
    (2, "straight 1", ((8.0, 9.0), (31.0, 10.0), (70.0, 11.0), (105.0, 12.0))),
    (1, "straight 2", ((2.0, 0.0), (9.5, 0.0), (45.0, 9.0))),
    (1, "straight 1", ((2.0, 0.0), (10.0, 0.0), (60.0, 11.0), (95.0, 12.0))),
    (3, "straight 2", ((3.0, 0.0), (40.0, 10.0))),
    (3, "straight 1", ((2.0, 0.0), (9.0, 0.0), (75.0, 12.0))),
)
#: The planning problem: the third vehicle from the south on the outer lane, which the yellow light catches.
EGO = (0, "straight 2", 2)
#: Intelligent Driver Model: desired speed [m/s], acceleration, comfortable deceleration [m/s²], time gap [s], gap [m].
SPEED, ACCELERATION, DECELERATION, TIME_GAP, GAP = 13.0, 1.8, 2.0, 1.2, 2.0
#: Hardest braking [m/s²], and fastest change of an acceleration [m/s³].
BRAKING, JERK = 2.8, 3.0
#: A driver stops for yellow if that takes no more than this [m/s²], so far before the line [m].
YELLOW, STOP_GAP = 3.0, 1.0


def shown(arm: int, time: float) -> str:
    """What the lights of an arm show."""
    step = round(time / 0.1) - OFFSETS[arm]
    place = step % sum(length for _, length in CYCLE)
    for colour, length in CYCLE:
        place -= length
        if place < 0:
            return colour
    raise ValueError(time)


def queue(arm: int, starts: tuple[tuple[float, float], ...], lengths: list[float]) -> list[Floats]:
    """Arc length of the centre of each vehicle of a lane at every `FINE` [m]; the first one is nearest to the line."""
    n = round(DURATION / FINE) + 1
    s = np.zeros((len(starts), n))
    v = np.zeros((len(starts), n))
    a = np.zeros(len(starts))
    goes = [False] * len(starts)
    for k, (distance, speed) in enumerate(starts):
        s[k, 0], v[k, 0] = ARM - distance - 0.5 * lengths[k], speed
    for i in range(n - 1):
        colour = shown(arm, i * FINE)
        for k, length in enumerate(lengths):
            front = s[k, i] + 0.5 * length
            gaps = [(s[k - 1, i] - 0.5 * lengths[k - 1] - front, v[k - 1, i])] if k else []
            room = ARM - front
            if colour == "green":
                goes[k] = False
            elif room > 0.0 and not goes[k]:
                goes[k] = colour == "yellow" and v[k, i] ** 2 > 2.0 * YELLOW * room
                if not goes[k]:
                    gaps.append((room - STOP_GAP + GAP, 0.0))
            held = 0.0
            for gap, ahead in gaps:
                closing = v[k, i] * (v[k, i] - ahead) / (2.0 * np.sqrt(ACCELERATION * DECELERATION))
                wanted = GAP + max(0.0, v[k, i] * TIME_GAP + closing)
                held = max(held, (wanted / max(gap, 0.1)) ** 2)
            wish = max(ACCELERATION * (1.0 - (v[k, i] / SPEED) ** 4 - held), -BRAKING)
            a[k] += np.clip(wish - a[k], -JERK * FINE, JERK * FINE)
            if v[k, i] + a[k] * FINE < 0.0:
                a[k] = 0.0
            v[k, i + 1] = max(0.0, v[k, i] + a[k] * FINE)
            s[k, i + 1] = s[k, i] + 0.5 * (v[k, i] + v[k, i + 1]) * FINE
    return list(s)


def make() -> Made:
    """The scenario."""
    roads = network()
    for arm in range(4):
        lanes = tuple(entering(arm, lane) for lane in range(3))
        x, y = roads.lanelets[lanes[-1]].right[-1]
        roads.lights.append(Light(CYCLE, OFFSETS[arm], lanes, (float(x), float(y))))
    vehicles: list[Vehicle] = []
    ego: Vehicle | None = None
    chance = np.random.default_rng(7)
    for arm, turn, starts in QUEUES:
        sizes = [SIZES["car"][chance.integers(len(SIZES["car"]))] for _ in starts]
        path = roads.path([source(arm, turn), inside(arm, turn), target(arm, turn)])
        for index, s in enumerate(queue(arm, starts, [length for length, _ in sizes])):
            vehicle = drive(path, s, ("car", *sizes[index]))
            if not free(vehicle, vehicles, along=1.0, aside=0.2):
                raise ValueError(f"vehicle {index} of {arm}, {turn} is in the way of another one")
            if (arm, turn, index) == EGO:
                ego = vehicle
            else:
                vehicles.append(vehicle)
    assert ego is not None
    goal = Goal(time_step=(160, 320), lanelets=(target(*EGO[:2]),))
    tags = ("urban", "intersection", "multi_lane", "oncoming_traffic")
    return Made("ZAM_InterdriveSignals-1_1_T-1", tags, roads, vehicles, [(ego, goal)])
