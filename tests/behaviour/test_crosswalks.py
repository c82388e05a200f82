"""People on a crosswalk: a road of 3.5 m along x, a crosswalk of 4 m across it at x = 100 m; steps of 0.1 s.

The crosswalk reaches from x = 98 to 102 m and from y = -4 to 4 m; the lane from y = -1.75 to 1.75 m.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import interdrive as idr
from interdrive.scenario import Lanelets, Shape
from interdrive.simulation import Simulation
from interdrive.testing.worlds import Car, crossing, problem, straight_road, world

HALF = 2.25
EDGE = 98.0
PLANNERS = ["rollout", "frenet", "idm", "idm_mobil"]


def crosswalk_road():
    road, y = straight_road(), np.array([-4.0, 4.0])
    both = {
        "ids": np.array([1, 2]),
        "left": (*road.left, np.column_stack([np.full(2, EDGE), y])),
        "right": (*road.right, np.column_stack([np.full(2, EDGE + 4.0), y])),
        "predecessors": ((), ()),
        "successors": ((), ()),
        "adjacent_left": np.array([-1, -1]),
        "adjacent_left_same_direction": np.array([False, False]),
        "adjacent_right": np.array([-1, -1]),
        "adjacent_right_same_direction": np.array([False, False]),
        "speed_limit": np.array([10.0, np.nan]),
        "types": (("urban",), ("crosswalk",)),
    }
    return Lanelets(**both)


def meeting(
    y, speed, *, x=60.0, velocity=10.0, first=0, kind="pedestrian", person_x=100.0, heading=np.pi / 2, goal=200
):
    """An agent at `x` and a person at `y` who walks with a speed to the left [m, m/s]; the goal is at x = 150 m."""
    person = Car(9, person_x, y, speed, heading, first=first)
    agent = problem(1, x, 0.0, velocity, goal=(150.0, 0.0), goal_size=(20.0, 3.5), time_step=(0, goal))
    made = world(crosswalk_road(), cars=[person], problems=[agent], steps=300)
    obstacles = replace(made.obstacles, kinds=(kind,), shapes=(Shape("rectangle", length=0.6, width=0.6),))
    return replace(made, obstacles=obstacles, crosswalks=(2,))


def driven(scenario, planner="rollout", **settings):
    """x of the front of the agent [m] and its speed [m/s], and the run."""
    run = idr.simulate(scenario, agents=[1], planner=planner, settings=settings, threads=1)
    row = run.states.participant_id.tolist().index(1)
    valid = run.states.valid[row]
    return run.states.x[row, valid] + HALF, run.states.velocity[row, valid], run


def told(scenario, **settings):
    """Distance from the front to where it has to stop now [m], and for which person."""
    simulation = Simulation(scenario, agents=[1], settings=settings, threads=1)
    ego = simulation.world.view(simulation.world.scene(), 1).ego
    front = float(ego.route.project(np.array([ego.x]), np.array([ego.y]))[0][0]) + HALF
    return ego.stop_s - front, ego.stop_by


@pytest.mark.parametrize("planner", PLANNERS)
def test_an_agent_waits_for_a_person_who_walks_onto_the_crosswalk_and_goes_on_when_they_have_left(planner):
    x, speed, run = driven(meeting(-5.0, 0.8, goal=300), planner)
    # The person has left the lane by 2 m at y = 3.75 m.
    leaves = int(np.ceil((5.0 + 3.75) / 0.8 / 0.1))
    assert EDGE - 1.0 < x[leaves] < EDGE - 0.1, "it stands before the edge, or still comes nearer"
    assert speed[leaves + 30] > 1.0, "3 s later it drives"
    assert run.outcomes.outcome == ("goal_reached",)


def test_the_wait_is_recorded_and_told_as_the_reason():
    run = driven(meeting(-4.0, 0.5, goal=100))[2]
    orders = run.orders
    assert set(zip(orders.kind, orders.by_id.tolist(), strict=True)) == {("crosswalk", 9)}
    assert np.allclose(orders.stop_s, orders.stop_s[0]) and orders.first_time_step[0] < 30
    path = run.agents[0].reference_path
    before = np.hypot(*np.diff(path, axis=0).T).cumsum().searchsorted(orders.stop_s[0])
    assert EDGE - 1.0 < path[before, 0] < EDGE + 1.0, "it was to stop before the edge"
    assert "before a crosswalk: it gave way to pedestrian 9" in run.outcomes.reason[0]


def violations(scenario, rule="crosswalk"):
    run = idr.simulate(scenario, agents=[1], threads=1)
    found = run.violations
    rows = [i for i, name in enumerate(found.rule) if name == rule]
    return [(found.source[i], int(found.participant_id[i]), int(found.partner_id[i]), found.value[i]) for i in rows]


@pytest.mark.parametrize(
    ("y", "speed", "passed_at"),
    [
        # Its front reaches the edge after 3.6 s, with the person 1.4 m beside its line, and its rear leaves the person
        # after 4.2 s, then 1.1 m beside.
        (-3.2, 0.5, 0.2),
        (-3.0, 0.0, None),  # The person stands beside the lane.
        (2.2, 0.5, None),  # The person walks away.
        (-10.0, 1.3, None),  # The person has not come near.
        (-7.0, 1.5, None),  # The person comes within 3.75 m after 2.2 s, when stopping takes more than 3 m/s².
    ],
)
def test_a_recorded_vehicle_that_does_not_give_way_on_a_crosswalk_breaks_a_rule(y, speed, passed_at):
    scenario = meeting(y, speed, x=20.0, velocity=2.0)
    cars = [Car(8, 60.0, 0.0, 10.0), Car(9, 100.0, y, speed, np.pi / 2)]
    both = world(crosswalk_road(), cars=cars, problems=scenario.planning_problems, steps=300).obstacles
    person = Shape("rectangle", length=0.6, width=0.6)
    both = replace(both, kinds=("car", "pedestrian"), shapes=(both.shapes[0], person))
    found = violations(replace(scenario, obstacles=both))
    if passed_at is None:
        assert found == []
    else:
        assert found == [("replayed", 8, 9, pytest.approx(passed_at, abs=0.1))]


def test_one_that_gives_way_breaks_no_rule():
    assert violations(meeting(-3.2, 0.5)) == []


@pytest.mark.parametrize("planner", PLANNERS)
@pytest.mark.parametrize(("y", "speed"), [(3.9, 1.3), (-3.0, 0.0), (-12.0, 0.0)])
def test_a_person_who_walks_away_or_stands_beside_the_road_changes_nothing(planner, y, speed):
    scenario = meeting(y, speed)
    run, free = driven(scenario, planner)[2], driven(replace(scenario, crosswalks=()), planner)[2]
    assert run.outcomes.outcome == ("goal_reached",)
    assert run.digest == free.digest


def test_a_person_beside_the_crosswalk_holds_nobody():
    assert told(meeting(-3.0, 1.3)) == (pytest.approx(EDGE - 60.0 - HALF, abs=0.15), 9)
    assert told(meeting(-3.0, 1.3, person_x=95.0)) == (np.inf, None)
    assert told(meeting(-3.0, 1.3, heading=0.0)) == (np.inf, None), "along the road"


def test_an_agent_that_is_too_near_does_not_stop_for_the_rule():
    # 10 m/s: 16.7 m are needed for 3 m/s².
    assert told(meeting(-3.5, 1.0, x=EDGE - HALF - 16.0)) == (np.inf, None)
    assert told(meeting(-3.5, 1.0, x=EDGE - HALF - 17.5))[1] == 9


@pytest.mark.parametrize("planner", PLANNERS)
@pytest.mark.parametrize(("distance", "stops"), [(16.0, False), (17.5, True)])
def test_the_rule_takes_no_harder_braking_than_a_light(planner, distance, stops):
    # The person appears when the agent is there, and is still 3.25 m beside the lane.
    x, speed, _ = driven(meeting(-5.0, 1.2, x=EDGE - HALF - distance), planner)
    assert (x[30] < EDGE) == stops, "after 3 s"
    assert stops or np.diff(speed).min() / 0.1 > -3.0, "m/s²"


def test_a_bicycle_counts_where_it_rides_across():
    assert told(meeting(-8.0, 3.0, kind="bicycle"))[1] == 9
    assert told(meeting(0.0, 3.0, kind="bicycle", heading=0.0)) == (np.inf, None), "it rides along the lane"


def test_a_person_out_of_sight_changes_nothing():
    assert told(meeting(-3.0, 1.3), **{"view.sensor_radius": 30.0}) == (np.inf, None)


def test_without_the_rule_an_agent_drives_as_if_there_were_no_crosswalk():
    scenario = meeting(-5.0, 0.8)
    digests = [
        driven(replace(scenario, crosswalks=crosswalks), **{"rules.crossings": rule})[2].digest
        for crosswalks, rule in [((2,), False), ((), False), ((), True), ((2,), True)]
    ]
    assert len(set(digests[:3])) == 1
    assert digests[3] != digests[0]


def junction(edge, *, person_y=-3.0, person_speed=0.0, velocity=8.0, x=-30.0):
    """Two lanes that cross at the origin, and a crosswalk of 3 m behind it whose edge is at x = `edge`; agent 1 drives
    along x, a person walks across.
    """
    lanes, y = crossing(), np.array([-4.0, 4.0])
    none, no = np.full(3, -1), np.zeros(3, dtype=bool)
    road = replace(
        lanes,
        ids=np.array([1, 2, 3]),
        left=(*lanes.left, np.column_stack([np.full(2, edge), y])),
        right=(*lanes.right, np.column_stack([np.full(2, edge + 3.0), y])),
        predecessors=((), (), ()), successors=((), (), ()),
        adjacent_left=none, adjacent_left_same_direction=no, adjacent_right=none, adjacent_right_same_direction=no,
        speed_limit=np.full(3, 10.0), types=((), (), ("crosswalk",)),
    )  # fmt: skip
    person = Car(9, edge + 1.5, person_y, person_speed, np.pi / 2)
    agent = problem(1, x, 0.0, velocity, goal=(60.0, 0.0), goal_size=(20.0, 3.5), time_step=(0, 400))
    made = world(road, cars=[person], problems=[agent], steps=400)
    obstacles = replace(made.obstacles, kinds=("pedestrian",), shapes=(Shape("rectangle", length=0.6, width=0.6),))
    return replace(made, obstacles=obstacles, crosswalks=(3,))


@pytest.mark.parametrize("planner", PLANNERS)
@pytest.mark.parametrize("edge", [1.2, 3.0, 5.5])
def test_an_agent_waits_before_a_junction_as_long_as_a_person_uses_the_crosswalk_behind_it(edge, planner):
    scenario = junction(edge, person_y=-3.9, person_speed=0.5)
    x, speed, run = driven(scenario, planner, **{"rules.precedence": True})
    # The other lane, with what vehicles need beside it, reaches from x = -1.1 to 1.1 m.
    is_inside = (x > -1.0) & (x - 2.0 * HALF < 1.0)
    assert speed[is_inside].min() > 0.5, "m/s"
    waits = (speed < 0.1) & (x < -1.0)
    assert 0.1 * waits.sum() > 1.0, "s before the junction"
    assert run.outcomes.outcome[0].startswith("goal_reached")
    assert "exit" in run.orders.kind
    assert "keep_clear" not in run.violations.rule


def test_room_for_the_vehicle_before_the_crosswalk_is_enough_to_enter_a_junction():
    # The vehicle has left the junction with its front at 1.4 + 4.5 m, and keeps 1 m.
    front, mouth = -30.0 + HALF, -1.4
    for edge, stop, by in [(6.7, mouth, None), (7.2, 7.2, 9)]:
        found = told(junction(edge, person_speed=1.3), **{"rules.precedence": True})
        assert found == (pytest.approx(stop - front, abs=0.15), by), f"crosswalk at {edge} m"


def test_a_crosswalk_before_the_junction_holds_an_agent_there():
    found = told(junction(-8.0, person_speed=1.3), **{"rules.precedence": True})
    assert found == (pytest.approx(-8.0 + 30.0 - HALF, abs=0.15), 9)
