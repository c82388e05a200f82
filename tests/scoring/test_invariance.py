"""Scores do not depend on where the world lies, which way it is turned, on sides, the clock, or the order of ids.

Every vehicle replays its recording, so that only the score can differ.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import interdrive as idr
from interdrive.testing.worlds import Car, crossing, straight_road, world

AGENT, OTHER = 4, 6
STEPS = 60


def recorded(scenario, number, **tables):
    """The scenario with other states of one car."""
    obstacles = scenario.obstacles
    row = int(np.searchsorted(obstacles.ids, number))
    changed = {}
    for name, values in tables.items():
        changed[name] = getattr(obstacles, name).copy()
        changed[name][row] = values
    return replace(scenario, obstacles=replace(obstacles, **changed))


def cutting_in():
    """The agent changes to the right lane, in front of a faster one, too fast for the limit and the comfort."""
    lanes = replace(straight_road(300.0, lanes=2), speed_limit=np.array([11.0, 11.0]))
    cars = [Car(AGENT, x=50.0, y=3.5, velocity=12.0), Car(OTHER, x=26.0, velocity=19.0)]
    time = 0.1 * np.arange(STEPS + 1)
    share = np.clip((time - 1.5) / 1.5, 0.0, 1.0)
    heading = np.where((share > 0.0) & (share < 1.0), -math.atan2(3.5 / 1.5, 12.0), 0.0)
    hard = np.where(time < 1.0, 3.0, 0.0)
    changed = {"y": 3.5 - 3.5 * share, "orientation": heading, "acceleration": hard}
    return recorded(world(lanes, cars=cars, steps=STEPS), AGENT, **changed)


def crossing_ways():
    """The agent enters the way of another one, and comes too late to leave it."""
    cars = [
        Car(AGENT, x=0.0, y=-14.0, velocity=3.0, orientation=math.pi / 2),
        Car(OTHER, x=-50.0, velocity=12.0),
    ]
    return world(crossing(), cars=cars, steps=STEPS)


def oncoming():
    """The agent overtakes nothing, on the left of two lanes, against the other one."""
    lanes = straight_road(300.0, lanes=2)
    left, right = list(lanes.left), list(lanes.right)
    left[1], right[1] = lanes.right[1][::-1].copy(), lanes.left[1][::-1].copy()
    none = np.array([-1, -1])
    lanes = replace(lanes, left=tuple(left), right=tuple(right), adjacent_left=none, adjacent_right=none)
    cars = [Car(AGENT, x=30.0, velocity=12.0), Car(OTHER, x=130.0, y=3.5, velocity=12.0, orientation=math.pi)]
    time = 0.1 * np.arange(STEPS + 1)
    y = 3.5 * (np.clip((time - 1.0) / 1.5, 0.0, 1.0) - np.clip(time - 4.5, 0.0, 1.0))
    return recorded(world(lanes, cars=cars, steps=STEPS), AGENT, y=y)


def placed(scenario, angle, x, y):
    """Turned around the origin, then shifted."""
    turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])

    def moved(points):
        return points @ turn + np.array([x, y])

    lanes, cars = scenario.lanelets, scenario.obstacles
    centers = moved(np.stack([cars.x, cars.y], axis=-1))
    return replace(
        scenario,
        lanelets=replace(lanes, left=tuple(map(moved, lanes.left)), right=tuple(map(moved, lanes.right))),
        obstacles=replace(
            cars,
            x=np.ascontiguousarray(centers[..., 0]),
            y=np.ascontiguousarray(centers[..., 1]),
            orientation=cars.orientation + angle,
        ),
    )


def mirrored(scenario):
    """Left is right, and vehicles drive on the other side of the road."""
    lanes, cars, priorities = scenario.lanelets, scenario.obstacles, scenario.priorities

    def across(points):
        return points * np.array([1.0, -1.0])

    return replace(
        scenario,
        lanelets=replace(
            lanes,
            left=tuple(map(across, lanes.right)),
            right=tuple(map(across, lanes.left)),
            adjacent_left=lanes.adjacent_right,
            adjacent_right=lanes.adjacent_left,
            adjacent_left_same_direction=lanes.adjacent_right_same_direction,
            adjacent_right_same_direction=lanes.adjacent_left_same_direction,
        ),
        obstacles=replace(cars, y=-cars.y, orientation=-cars.orientation, yaw_rate=-cars.yaw_rate),
        priorities=replace(priorities, left_hand=not priorities.left_hand, priority_side="left"),
    )


def later(scenario, steps):
    """Everything so many time steps later."""
    cars = scenario.obstacles
    tables = {}
    for name in ("x", "y", "orientation", "velocity", "acceleration", "yaw_rate", "valid"):
        table = getattr(cars, name)
        before = np.full((len(table), steps), False if name == "valid" else np.nan, dtype=table.dtype)
        tables[name] = np.concatenate([before, table], axis=1)
    return replace(scenario, obstacles=replace(cars, **tables))


def renamed(scenario):
    """The agent has the larger id, so that rows change places."""
    cars = scenario.obstacles
    tables = {
        name: getattr(cars, name)[::-1].copy()
        for name in ("x", "y", "orientation", "velocity", "acceleration", "yaw_rate", "valid")
    }
    return replace(scenario, obstacles=replace(cars, ids=np.array([OTHER - 1, OTHER + 1]), **tables))


def scored(scenario, number=AGENT):
    found = idr.score(idr.simulate(scenario, agents=[number], planner="recorded"), panel="none")
    numbers = {name: float(values[0]) for name, values in found.terms.items()}
    numbers |= {"score": float(found.score[0]), "score_1": float(found.score_1[0])}
    return numbers, (found.fault_kind[0], bool(found.fault_nuplan[0]), found.collision_type[0], found.excused[0])


WORLDS = {
    cutting_in: ("cut_off", False, "rear"),
    crossing_ways: ("cut_off", True, "front"),
    oncoming: ("wrong_side", True, "front"),
}


@pytest.fixture(scope="module", params=WORLDS, ids=lambda make: make.__name__)
def case(request):
    scenario = request.param()
    return scenario, scored(scenario), request.param


def test_the_worlds_hold_what_they_are_made_for(case):
    _, (numbers, verdict), make = case
    assert verdict[:3] == WORLDS[make]
    assert numbers["score"] == 0.0
    assert numbers["gate_fault"] == 0.0
    if make is cutting_in:
        assert 0.0 < numbers["gate_speed"] < 1.0
        assert numbers["comfort_term"] == 0.0


@pytest.mark.parametrize(
    "change",
    [
        lambda scenario: placed(scenario, 0.7, 0.0, 0.0),
        lambda scenario: placed(scenario, math.pi, 0.0, 0.0),
        lambda scenario: placed(scenario, -2.9, 5000.0, -70000.0),
        mirrored,
        lambda scenario: later(scenario, 7),
    ],
    ids=["turned", "the other way", "far away", "mirrored", "later"],
)
def test_scores_do_not_depend_on_place_direction_side_and_time(case, change):
    scenario, (numbers, verdict), _ = case
    found, other_verdict = scored(change(scenario))
    assert other_verdict == verdict
    assert found == pytest.approx(numbers, abs=1e-5, nan_ok=True)


def test_scores_do_not_depend_on_the_order_of_ids(case):
    scenario, (numbers, verdict), _ = case
    found, other_verdict = scored(renamed(scenario), OTHER + 1)
    assert (found, other_verdict[:3]) == (pytest.approx(numbers, nan_ok=True), verdict[:3])
