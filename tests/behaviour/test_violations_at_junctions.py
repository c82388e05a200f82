"""What the monitor calls a violation where two ways meet, and what it does not: straight lanes through the origin.

Cars are 4.5 m long and 1.8 m wide. The area of the lanes reaches from -1.1 to 1.1 m: a front reaches it when the centre
is at -3.35 m, a rear has left it when the centre is at 3.35 m. At 10 m/s this takes 0.67 s.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.behaviour.test_right_of_way import HALF, NORTH
from tests.support.drivers import Straight
from tests.support.junction_lanes import left_turn, network, straight

import interdrive as idr
from interdrive.native_settings import RoadSettings
from interdrive.report.contents import run_contents
from interdrive.run.violations.drives import Drives
from interdrive.run.violations.junction_rules import needed_deceleration
from interdrive.run.violations.ways import Ways
from interdrive.scenario.control import Priorities, StopLine, TrafficLight
from interdrive.scenario.native import core_road
from interdrive.testing.worlds import Car, crossing, problem, world

#: The centre of a car whose front is at the area, and of one whose rear has left it [m].
AT, BEHIND = -1.1 - HALF, 1.1 + HALF


def judged(cars, lanelets=None, **more):
    """Violations of replayed cars; an agent far away drives along."""
    far = problem(99, 60.0, -200.0, 5.0, goal=(90.0, -200.0), time_step=(0, 100))
    lanelets = crossing() if lanelets is None else lanelets
    scenario = replace(world(with_field(lanelets), cars=cars, problems=[far]), **more)
    found = idr.simulate(scenario, planner=Straight, agents=[99], threads=1).violations
    names = ("rule", "participant_id", "partner_id", "first_time_step", "last_time_step", "value")
    rows = zip(*(list(getattr(found, name)) for name in names), strict=True)
    return [row for row, source in zip(rows, found.source, strict=True) if source == "replayed"]


def with_field(lanelets):
    """The same lanelets and a lonely one for the agent that every run needs."""
    x = np.linspace(50.0, 100.0, 11)
    left, right = (np.column_stack([x, np.full_like(x, y)]) for y in (-198.0, -202.0))
    grown = {
        "ids": np.append(lanelets.ids, 90),
        "left": (*lanelets.left, left),
        "right": (*lanelets.right, right),
        "predecessors": (*lanelets.predecessors, ()),
        "successors": (*lanelets.successors, ()),
        "types": (*lanelets.types, ()),
        "speed_limit": np.append(lanelets.speed_limit, np.nan),
    }
    for side in ("left", "right"):
        grown[f"adjacent_{side}"] = np.append(getattr(lanelets, f"adjacent_{side}"), -1)
        grown[f"adjacent_{side}_same_direction"] = np.append(
            getattr(lanelets, f"adjacent_{side}_same_direction"), False
        )
        if getattr(lanelets, f"{side}_marking"):
            grown[f"{side}_marking"] = (*getattr(lanelets, f"{side}_marking"), "no_marking")
    return replace(lanelets, **grown)


def from_west(time, velocity=10.0, number=1):
    """A car towards +x whose front reaches the area after so many seconds; it comes from the left of the other one."""
    return Car(number, AT - velocity * time, 0.0, velocity)


def from_south(time, velocity=10.0, number=2):
    """A car towards +y, the one that goes first, whose front reaches the area after so many seconds."""
    return Car(number, 0.0, AT - velocity * time, velocity, NORTH)


# The one from the west is in the area from 2 s to 2.67 s.
@pytest.mark.parametrize(
    ("reaches", "rows"),
    [
        (3.65, [("right_of_way", 1, 2, 20, 27, pytest.approx(0.98, abs=0.01))]),
        (3.70, []),
        (2.60, [("right_of_way", 1, 2, 20, 27, 0.0)]),
        (1.90, []),  # It is there first.
    ],
)
def test_who_has_to_wait_leaves_a_second_to_the_one_that_goes_first(reaches, rows):
    assert judged([from_west(2.0), from_south(reaches)]) == rows


def test_the_one_that_goes_first_may_leave_no_gap():
    assert judged([from_west(3.0), from_south(2.0)]) == []


def test_where_no_rule_decides_nobody_takes_the_right_of_way():
    none = Priorities(priority_side="none")
    assert judged([from_west(2.0), from_south(3.0)], priorities=none) == []


def test_signs_tell_who_goes_first():
    signs = Priorities(ranks=((1, (4, 5, 4)),))
    rows = judged([from_west(3.0), from_south(2.0)], priorities=signs)
    assert [row[:3] for row in rows] == [("right_of_way", 2, 1)]


def test_a_slow_car_that_makes_another_brake_hard_takes_its_right_of_way():
    # At 2 m/s it needs 3.35 s for the area; the other one, 25 m before it at 15 m/s, would have to brake with 4.4 m/s².
    slow = from_west(2.0, 2.0)
    assert needed_deceleration(15.0, 25.0, 3.35) == pytest.approx(15.0**2 / 50.0, rel=0.02)
    gone = Car(2, 0.0, AT - 55.0, 15.0, NORTH, last=25)  # It leaves the road before it gets there.
    assert [row[:3] for row in judged([slow, gone])] == [("right_of_way", 1, 2)]
    assert judged([from_west(2.0, 9.0), gone]) == []


@pytest.mark.parametrize(
    ("speed", "distance", "time", "needed"),
    [
        (10.0, 30.0, 3.0, 0.0),
        (10.0, 30.0, 4.0, 1.25),  # 10 · 4 - 1.25 · 16 / 2 = 30
        (10.0, 20.0, 5.0, 2.5),  # It stops after 4 s.
        (10.0, 25.0, np.inf, 2.0),
        (10.0, 0.0, 1.0, np.inf),
    ],
)
def test_the_deceleration_that_keeps_a_car_out_for_a_time(speed, distance, time, needed):
    assert needed_deceleration(speed, distance, time) == pytest.approx(needed)


@pytest.mark.parametrize(("metres", "rows"), [(17.0, 1), (16.0, 0)])
def test_who_enters_the_scene_too_near_to_stop_takes_no_right_of_way(metres, rows):
    # From 10 m/s a stop takes 16.7 m at 3 m/s².
    near = Car(1, AT - metres, 0.0, 10.0)
    assert len(judged([near, from_south(0.1 * metres + 0.7)])) == rows


def two_lanes_turn_left_into_a_road():
    """Northwards at x = 0 lanelets 1, 2, 3; 5 at x = 3.5 beside 3. Two lanes turn left, 12 into 3 and 14 into 5."""
    centers = {
        1: straight((0.0, -60.0), (0.0, -10.0)),
        2: straight((0.0, -10.0), (0.0, 10.0)),
        3: straight((0.0, 10.0), (0.0, 60.0)),
        5: straight((3.5, 10.0), (3.5, 60.0)),
        11: straight((-60.0, 0.0), (-10.0, 0.0)),
        12: left_turn(10.0, (-10.0, 0.0)),
        13: straight((-60.0, -3.5), (-10.0, -3.5)),
        14: left_turn(13.5, (-10.0, -3.5)),
    }
    after = {1: (2,), 2: (3,), 11: (12,), 12: (3,), 13: (14,), 14: (5,)}
    return network(centers, after, {5: 3, 13: 11, 14: 12})


def test_a_car_that_goes_straight_on_is_not_on_the_lanes_that_cross_its_own():
    scenario = world(two_lanes_turn_left_into_a_road(), cars=[Car(1, 0.0, -40.0, 10.0, NORTH)])
    road = core_road(scenario, RoadSettings())
    shown = Drives(
        ("replayed",), np.array([1]), ("car",), 0, scenario.dt, np.array([4.5]), np.array([1.8]),
        *(getattr(scenario.obstacles, name) for name in ("valid", "x", "y", "orientation", "velocity", "acceleration")),
    )  # fmt: skip
    ways = Ways(shown, scenario.lanelets, road, {}, set())
    assert [way.lanelet for way in ways.taken[0]] == [1, 2, 3]


@pytest.mark.parametrize("chosen", [2, 12])
def test_an_agent_that_ends_where_lanes_part_would_have_kept_to_its_route(chosen):
    # Lanelet 2 leads straight on from x = 0, 12 turns left; its centre ends 1 m behind the fork.
    centers = {
        1: straight((-60.0, 0.0), (0.0, 0.0)),
        2: straight((0.0, 0.0), (60.0, 0.0)),
        12: left_turn(10.0, (0.0, 0.0)),
    }
    scenario = world(network(centers, {1: (2, 12)}), cars=[Car(1, -29.0, 0.0, 10.0, last=30)])
    names = ("valid", "x", "y", "orientation", "velocity", "acceleration")
    columns = (getattr(scenario.obstacles, name) for name in names)
    shown = Drives(("agent",), np.array([1]), ("car",), 0, scenario.dt, np.array([4.5]), np.array([1.8]), *columns)
    ways = Ways(shown, scenario.lanelets, core_road(scenario, RoadSettings()), {1: (1, chosen)}, set())
    assert [way.lanelet for way in ways.taken[0]] == [1, chosen]


def test_of_those_that_go_first_the_nearest_one_counts():
    cars = [from_west(2.0), from_south(3.0), from_south(4.0, number=3)]
    assert [row[:3] for row in judged(cars)] == [("right_of_way", 1, 2)]


def test_one_that_stands_lets_others_go():
    standing = Car(2, 0.0, AT - 0.5, 0.0, NORTH)
    assert judged([from_west(2.0), standing]) == []


@pytest.mark.parametrize(("signal", "rows"), [("red", 0), ("green", 1)])
def test_one_that_a_light_holds_does_not_go_first(signal, rows):
    # It runs the light, which is its own violation.
    light = TrafficLight(7, ((signal, 5000),))
    line = StopLine(2, np.array([[-1.75, -5.0], [1.75, -5.0]]), ((2, (7,)),))
    found = judged([from_west(2.0), from_south(3.0)], traffic_lights=(light,), stop_lines=(line,))
    assert sum(row[0] == "right_of_way" for row in found) == rows
    assert sum(row[0] == "red_light" for row in found) == 1 - rows


class Stops:
    """Drives to a place of the lane along x, stands there for five seconds, and goes on."""

    place, obeys_rules, standing = 0.0, False, 0

    def plan(self, view, predictions):
        ego, dt = view.ego, view.dt
        room = self.place - ego.x if self.standing < 50 else np.inf
        self.standing += abs(ego.velocity) < 0.1 and room < 0.5
        x, speed = [ego.x], [ego.velocity]
        for _ in range(30):
            largest = np.sqrt(5.0 * max(room - (x[-1] - ego.x), 0.0))
            speed.append(min(5.0, speed[-1] + 2.0 * dt, largest))
            x.append(x[-1] + 0.5 * (speed[-1] + speed[-2]) * dt)
        return idr.Trajectory(np.array(x), np.full(31, ego.y), np.zeros(31), np.array(speed))


def stands_at(place, cars=(), **settings):
    """Rules that an agent breaks which stands at a place, and the values."""
    agent = problem(1, -20.0, 0.0, 5.0, goal=(30.0, 0.0), goal_size=(10.0, 3.5), time_step=(0, 200))
    planner = type("StopsThere", (Stops,), {"place": place, **settings})
    scenario = world(crossing(), cars=cars, problems=[agent])
    run = idr.simulate(scenario, planner=planner, settings={"rules.precedence": True}, threads=1)
    assert run.outcomes.outcome == ("goal_reached",)
    return dict(zip(run.violations.rule, run.violations.value.tolist(), strict=True))


@pytest.mark.parametrize(("place", "blocks"), [(-3.5, False), (-3.0, True), (0.0, True), (3.0, True), (3.5, False)])
def test_standing_in_an_area_for_three_seconds_blocks_it(place, blocks):
    # The front reaches the area with the centre at -3.35 m, the rear leaves it at 3.35 m.
    assert stands_at(place) == ({"keep_clear": pytest.approx(5.0, abs=0.4)} if blocks else {})


def test_an_agent_that_was_told_to_go_does_not_block():
    assert stands_at(0.0, obeys_rules=True) == {}


def test_an_agent_that_was_told_to_wait_and_goes_blocks():
    # Behind the junction another car leaves no room: the order is to wait, the planner does not look at it.
    ahead = Car(2, 9.0, 0.0, 0.0, last=60)
    assert "keep_clear" in stands_at(0.0, cars=[ahead], obeys_rules=True)


def test_violations_at_junctions_are_stored_counted_and_told(tmp_path):
    problems = [problem(1, AT - 20.0, 0.0, goal=(30.0, 0.0), goal_size=(10.0, 3.5), time_step=(0, 90))]
    scenario = world(crossing(), cars=[from_south(3.0)], problems=problems)
    run = idr.simulate(scenario, planner=Straight, threads=1)
    assert (run.violations.rule, run.violations.partner_id.tolist()) == (("right_of_way",), [2])
    folder = run.save(tmp_path / "run")
    assert idr.Run.load(folder).violations.to_arrow().equals(run.violations.to_arrow())
    events = [event["text"] for event in run_contents(folder).header["events"] if event["kind"] == "violation"]
    assert events == ["1 takes the right of way of 2, 0.3\N{NO-BREAK SPACE}s ahead of it"]


def test_lanelets_that_the_file_names_but_does_not_have_lead_nowhere():
    lanelets = crossing()
    ghost = tuple((*some, 99) for some in lanelets.successors)
    rows = judged([from_west(0.0)], replace(lanelets, successors=ghost))
    assert rows == []
