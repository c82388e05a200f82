"""What agents should do and do not do yet: each test states the right value and says what is missing.

A test that is marked fails today for the reason in its mark. The mark is strict: the day the value is right, the test
asks to take the mark away. Tests without a mark are the same worlds where the value is right already.
"""

import math
from dataclasses import replace

import commonroad_documents as cr
import numpy as np
import pytest
from drivers import Straight
from junction_lanes import cross_with_turns
from rings import ring, trip

from interdrive import read_scenario, simulate
from interdrive.testing import Car, problem, straight_road, world

ASKEW = "frenet finds no sample that leads back to the path and stands until its time is up"


def missing(reason):
    return pytest.mark.xfail(strict=True, raises=AssertionError, reason=reason)


def lanes(number, x, *, lanes=2, before=0, after=0, control="", has_line=False):
    """Parallel lanelets from x to x, ids from `number` on, the rightmost first, with the control of all of them."""
    found = ""
    for k in range(lanes):
        low, high = 3.5 * k - 1.75, 3.5 * k + 1.75
        more = "".join(
            f'<{tag} ref="{ref + k}"/>' for tag, ref in (("predecessor", before), ("successor", after)) if ref
        )
        if k + 1 < lanes:
            more += f'<adjacentLeft ref="{number + k + 1}" drivingDir="same"/>'
        if k:
            more += f'<adjacentRight ref="{number + k - 1}" drivingDir="same"/>'
        line = f"<stopLine>{cr.point(x[1], high)}{cr.point(x[1], low)}<lineMarking>solid</lineMarking></stopLine>"
        more += (line if has_line else "") + "<laneletType>urban</laneletType><userOneWay>vehicle</userOneWay>"
        found += cr.lanelet(
            number + k, left=[(x[0], high), (x[1], high)], right=[(x[0], low), (x[1], low)], more=more + control
        )
    return found


def to(number, start, goal, *, heading=0.0, velocity=10.0, seconds=60):
    area = cr.rectangle_at(*goal, length=10.0, width=3.0, orientation=heading)
    first = cr.initial(*start, orientation=heading, velocity=velocity, yawRate=0.0, slipAngle=0.0)
    return cr.planning_problem(number, cr.goal(position=area, time=(0, 10 * seconds)), start=first)


def before_a_line(folder, control, definition, *, n=2, start=1, goal=0):
    """A road of `n` lanes with a stop line of each at 100 m; agent 1001 starts in one lane and has its goal in another.

    The route may change lanes on either side of the line.
    """
    road = lanes(1, (0, 100), lanes=n, after=11, control=control, has_line=True) + lanes(
        11, (100, 300), lanes=n, before=1
    )
    content = definition + to(1001, (20.0, 3.5 * start), (250.0, 3.5 * goal))
    return read_scenario(cr.saved(folder, cr.document(content, lanelets=road)))


def driven(run, number=1001):
    """Time [s], arc length of the front bumper along the road [m] and speed [m/s] of an agent while it is there."""
    row = run.states.participant_id.tolist().index(number)
    there = run.states.valid[row]
    front = run.states.x[row, there] + 0.5 * run.states.length[row]
    return 0.1 * np.flatnonzero(there), front, run.states.velocity[row, there]


# Two lanes before a line

STOP, RED = '<trafficSignRef ref="803"/>', '<trafficLightRef ref="901"/>'
SIGN = cr.sign(803, 206)
LIGHT = cr.traffic_light(901, ("red", 400), ("green", 300))


@pytest.mark.parametrize(
    ("planner", "start", "goal"),
    [
        ("frenet", 1, 1),
        ("rollout", 1, 1),
        ("idm", 0, 0),
        ("frenet", 1, 0),
        ("rollout", 1, 0),
        ("idm", 1, 0),
        ("idm_mobil", 1, 0),
        ("frenet", 0, 1),
        ("rollout", 0, 1),
        ("idm", 0, 1),
    ],
)
def test_an_agent_stands_at_the_stop_sign_of_every_lane_and_drives_on(tmp_path, planner, start, goal):
    run = simulate(before_a_line(tmp_path, STOP, SIGN, start=start, goal=goal), planner=planner, threads=1)
    _, front, velocity = driven(run)
    stood = (velocity < 0.1) & (front > 95.0) & (front < 100.0)
    assert 10 <= np.count_nonzero(stood) < 60, "one second, and no minutes"
    assert run.outcomes.outcome == ("goal_reached",)


@pytest.mark.parametrize(
    ("planner", "n", "start", "goal"),
    [
        ("idm", 2, 0, 0),
        ("frenet", 2, 1, 1),
        ("rollout", 2, 1, 1),
        ("idm", 2, 1, 0),
        ("frenet", 2, 1, 0),
        ("rollout", 2, 1, 0),
        ("frenet", 2, 0, 1),
        ("rollout", 2, 0, 1),
        ("idm_mobil", 2, 1, 0),
        ("idm", 2, 0, 1),
        ("idm", 3, 2, 0),
    ],
)
def test_an_agent_stands_at_the_red_light_of_every_lane_until_it_is_green(tmp_path, planner, n, start, goal):
    scenario = before_a_line(tmp_path, RED, LIGHT, n=n, start=start, goal=goal)
    run = simulate(scenario, planner=planner, threads=1)
    time, front, _ = driven(run)
    assert front[time <= 40.0].max() < 100.0, "red until 40 s"
    assert run.outcomes.outcome == ("goal_reached",)


class Reading(Straight):
    """Obeys the rules of the road, and keeps what its view says about the next line [m]."""

    obeys_rules = True
    stops: tuple[float, ...] = ()

    def plan(self, view, predictions):
        type(self).stops += (view.ego.stop_s,)
        return super().plan(view, predictions)


@pytest.mark.parametrize(
    ("n", "start", "goal"),
    [
        (2, 0, 0),
        (2, 1, 1),
        (2, 1, 0),
        (2, 0, 1),
        (3, 2, 0),
    ],
)
def test_a_view_tells_where_the_line_of_a_red_light_is(tmp_path, n, start, goal):
    class Reader(Reading):
        pass

    simulate(before_a_line(tmp_path, RED, LIGHT, n=n, start=start, goal=goal), planner=Reader(), threads=1)
    # The path begins 15 m before the road's first lanelet; a lane change makes it longer by 10/7 · 3.5² / (2 · 40) m.
    longer = 0.219 * abs(start - goal)
    assert Reader.stops[0] == pytest.approx(115.0 + longer, abs=0.02)


def crossing_of_two_lanes(folder, start):
    """Two lanes that give way (sign 205) to a road from the right (306); agent 1001's goal is in the left lane."""
    give_way, priority = '<trafficSignRef ref="801"/>', '<trafficSignRef ref="802"/>'
    road = lanes(1, (0, 90), after=11, control=give_way) + lanes(11, (90, 110), before=1, after=21)
    road += lanes(21, (110, 300), before=11)
    across = ((7, -150, -8, "", 8), (8, -8, 12, 7, 9), (9, 12, 150, 8, ""))
    for number, low, high, before, after in across:
        more = "".join(f'<{tag} ref="{ref}"/>' for tag, ref in (("predecessor", before), ("successor", after)) if ref)
        more += "<laneletType>urban</laneletType><userOneWay>vehicle</userOneWay>"
        more += priority if number == 7 else ""
        bounds = {"left": [(98.25, low), (98.25, high)], "right": [(101.75, low), (101.75, high)]}
        road += cr.lanelet(number, **bounds, more=more)
    content = cr.sign(801, 205) + cr.sign(802, 306) + to(1001, (20.0, 3.5 * start), (250.0, 3.5))
    for number, y in ((2001, -60.0), (2002, -72.0)):
        content += to(number, (100.0, y), (100.0, 100.0), heading=math.pi / 2)
    return read_scenario(cr.saved(folder, cr.document(content, lanelets=road)))


@pytest.mark.parametrize("start", [1, 0])
def test_an_agent_gives_way_from_every_lane(tmp_path, start):
    run = simulate(crossing_of_two_lanes(tmp_path, start), planner="frenet", threads=1)
    orders = zip(run.orders.agent_id.tolist(), run.orders.kind, strict=True)
    assert (1001, "yield") in set(orders)
    assert run.outcomes.outcome == ("goal_reached",) * 3


@pytest.mark.parametrize("planner", ["idm", "idm_mobil"])
@pytest.mark.parametrize("start", [0, 1])
def test_nobody_touches_who_has_priority_from_any_lane(tmp_path, planner, start):
    run = simulate(crossing_of_two_lanes(tmp_path, start), planner=planner, threads=1)
    assert run.outcomes.outcome == ("goal_reached",) * 3


# Rings


@pytest.mark.parametrize(
    ("planner", "lanes", "radius"),
    [
        ("frenet", 1, 40.0),
        ("rollout", 1, 40.0),
        ("idm", 1, 40.0),
        ("idm_mobil", 1, 40.0),
        ("idm_mobil", 1, 25.0),
        ("idm_mobil", 1, 80.0),
        ("idm_mobil", 2, 40.0),
    ],
)
def test_an_agent_drives_an_empty_ring_to_its_end(planner, lanes, radius):
    around = 2.0 * math.pi * radius
    scenario = world(
        ring(2, radius, lanes), problems=[trip(100, radius, 7.0, around - 7.0, velocity=8.0, steps=900)], steps=0
    )
    run = simulate(scenario, agents=[100], planner=planner, threads=1)
    assert run.outcomes.outcome == ("goal_reached",)


@pytest.mark.parametrize(
    ("planner", "radius"),
    [
        ("idm", 18.5),
        ("frenet", 25.0),
        ("rollout", 25.0),
        ("idm_mobil", 40.0),
        ("frenet", 18.5),
        ("rollout", 18.5),
        ("idm_mobil", 18.5),
        ("idm_mobil", 25.0),
    ],
)
def test_an_agent_leaves_the_inner_lane_of_an_empty_ring(planner, radius):
    lanelets = ring(8, radius, 2)
    inner = radius - 3.5
    at, there = 0.0873, 3.4907
    goal = (radius * math.cos(there), radius * math.sin(there))
    problems = [
        problem(
            100, inner * math.cos(at), inner * math.sin(at), 7.0, at + math.pi / 2, goal=goal, goal_size=(6.0, 3.0),
            goal_orientation=math.remainder(there + math.pi / 2, 2 * math.pi), time_step=(0, 700),
        )
    ]  # fmt: skip
    run = simulate(world(lanelets, problems=problems, steps=0), agents=[100], planner=planner, threads=1)
    assert run.outcomes.outcome == ("goal_reached",)


@pytest.mark.parametrize(("radius", "velocity"), [(40.0, 8.0), (60.0, 14.0)])
@pytest.mark.parametrize("into", [0.0, 0.7, 2.0])
def test_an_agent_enters_a_ring_at_the_beginning_of_a_lanelet(into, radius, velocity):
    trips = [trip(100, radius, into, 1.5 * math.pi * radius, velocity=velocity, steps=900)]
    run = simulate(world(ring(8, radius, 1), problems=trips, steps=0), agents=[100], planner="idm_mobil", threads=1)
    assert run.outcomes.outcome == ("goal_reached",)


# Starts beside or across the path


@pytest.mark.parametrize(
    ("planner", "y", "heading"),
    [
        ("frenet", 1.0, 0.2),
        ("rollout", 1.0, 0.2),
        ("idm", 1.0, math.pi / 4),
        pytest.param("frenet", 1.0, math.pi / 4, marks=missing(ASKEW)),
        ("rollout", 1.0, math.pi / 4),
        pytest.param("frenet", -1.0, -math.pi / 4, marks=missing(ASKEW)),
        ("rollout", -1.0, -math.pi / 4),
        pytest.param("frenet", 1.0, 1.0, marks=missing(ASKEW)),
        ("rollout", 1.0, 1.0),
    ],
)
def test_an_agent_that_stands_askew_in_a_wide_lane_drives_off(planner, y, heading):
    road = straight_road(300.0, lane_width=8.0)
    problems = [
        problem(1001, 50.0, y, 0.0, heading, goal=(150.0, 0.0), goal_size=(10.0, 8.0), time_step=(0, 400)),
    ]
    run = simulate(world(road, problems=problems, steps=0), agents=[1001], planner=planner, threads=1)
    assert run.outcomes.outcome == ("goal_reached",)


@pytest.mark.parametrize(
    ("planner", "beside", "heading"),
    [
        ("idm", 1.2, -0.4),
        ("frenet", 1.2, 0.4),
        ("rollout", 1.2, 0.4),
        ("frenet", -1.2, -0.4),
        ("rollout", -1.2, -0.4),
        ("frenet", 1.2, -0.4),
        ("rollout", 1.2, -0.4),
    ],
)
def test_an_agent_that_stands_askew_inside_a_junction_drives_off(planner, beside, heading):
    """It stands 1.2 m beside its way straight on, 23 degrees off."""
    problems = [
        problem(1001, 2.0, -1.75 + beside, 0.0, heading, goal=(60.0, -1.75), goal_size=(10.0, 3.5), time_step=(0, 400))
    ]
    scenario = world(cross_with_turns(), problems=problems, steps=0)
    run = simulate(scenario, agents=[1001], planner=planner, threads=1)
    assert run.outcomes.outcome == ("goal_reached",)


# A gap in a flow


@pytest.mark.parametrize(
    ("planner", "gap", "ahead"),
    [
        ("frenet", 26.0, 0.0),
        ("rollout", 26.0, 0.0),
        pytest.param("idm_mobil", 26.0, 0.0, marks=missing("idm_mobil falls so far back that it is 1.7 s late")),
        ("frenet", 26.0, 13.0),
        ("rollout", 26.0, 13.0),
        ("frenet", 60.0, 30.0),
        ("rollout", 60.0, 30.0),
    ],
)
def test_an_agent_changes_into_a_gap_at_the_speed_of_the_flow(planner, gap, ahead):
    """Cars in the lane beside it drive as fast as it does; its goal is 123 m ahead, in their lane, for 11 s."""
    cars = [Car(10 + k, 72.0 + ahead + gap * (k - 2), 0.0, 16.0) for k in range(7)]
    cars += [Car(30 + k, 20.0 + 26.0 * k, 7.0, 17.0) for k in range(5)]
    goal = {"goal": (195.0, 0.0), "goal_size": (10.0, 3.5)}
    problems = [problem(62, 72.0, 3.5, 16.0, **goal, time_step=(0, 110))]
    scenario = world(straight_road(600.0, lanes=3), cars=cars, problems=problems, steps=150)
    run = simulate(scenario, agents=[62], planner=planner, threads=1)
    assert run.outcomes.outcome == ("goal_reached",)


def in_a_flow(gap, ahead):
    """A row at 16 m/s in the lane that the agent must reach within 330 m, and a car 35.5 m behind it in its own."""
    row = [Car(10 + k, 72.0 + ahead + gap * (k - 4), 0.0, 16.0) for k in range(10)]
    goal = {"goal": (400.0, 0.0), "goal_size": (10.0, 3.5), "time_step": (0, 400)}
    agent = problem(62, 72.0, 3.5, 16.0, **goal)
    scenario = world(straight_road(900.0, lanes=2), cars=[*row, Car(50, 32.0, 3.5, 16.0)], problems=[agent], steps=400)
    return simulate(scenario, agents=[62], threads=1)


@pytest.mark.parametrize("beside", [True, False])
@pytest.mark.parametrize("gap", [18.0, 21.0, 26.0])
def test_in_a_row_that_does_not_react_it_opens_the_gap_ahead_only_as_far_as_the_gap_behind_allows(gap, beside):
    # Gaps of 13.5, 16.5 and 21.5 m, for a car of 4.5 m.
    run = in_a_flow(gap, 0.0 if beside else 0.5 * gap)
    assert run.outcomes.outcome == ("goal_reached",)
    row = np.searchsorted(run.states.participant_id, 62)
    assert np.nanmin(run.states.velocity[row]) > 0.93 * 16.0, "m/s"


@pytest.mark.parametrize("beside", [True, False])
def test_it_does_not_force_its_way_into_a_row_without_gaps_nor_is_hit_in_its_own_lane(beside):
    run = in_a_flow(9.0, 0.0 if beside else 4.5)
    assert run.outcomes.outcome == ("goal_missed",)
    row = np.searchsorted(run.states.participant_id, 62)
    velocity = run.states.velocity[row, run.states.valid[row]]
    assert velocity.min() > 0.84 * 16.0, "of the flow"
    assert velocity[-1] > 0.97 * 16.0, "while the car behind is near"


def test_a_dense_row_of_agents_stops_as_gently_as_an_agent_alone():
    # Six agents 3 m apart at 5 m/s, behind a car that brakes from 3 s on with 2 m/s2.
    agents = [problem(1 + k, 100.0 - 7.5 * k, 0.0, 5.0, goal=(900.0, 0.0), time_step=(0, 150)) for k in range(6)]
    scenario = world(straight_road(1000.0), cars=[Car(50, 107.5, 0.0, 5.0)], problems=agents, steps=150)
    obstacles = scenario.obstacles
    velocity, x = obstacles.velocity.copy(), obstacles.x.copy()
    velocity[0] = np.clip(5.0 - 2.0 * (0.1 * np.arange(velocity.shape[1]) - 3.0), 0.0, 5.0)
    x[0] = 107.5 + np.concatenate([[0.0], np.cumsum(0.05 * (velocity[0, 1:] + velocity[0, :-1]))])
    scenario = replace(scenario, obstacles=replace(obstacles, velocity=velocity, x=x))
    run = simulate(scenario, agents=list(range(1, 7)), threads=1)
    rows = np.searchsorted(run.states.participant_id, np.arange(1, 7))
    slowing = -np.diff(run.states.velocity[rows], axis=1) / 0.1
    assert np.nanmax(slowing) < 3.5, "m/s2"
    assert np.nanmin(-np.diff(run.states.x[rows], axis=0)) > 4.5 + 1.5, "m between middles"
