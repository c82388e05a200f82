"""Rules of the road where a route changes lanes before, at and behind a line: those of the lane of the path count."""

from __future__ import annotations

import math
from dataclasses import replace

import commonroad_documents as cr
import numpy as np
import pytest
from obeying import Obeys
from rings import ring

from interdrive import read_scenario, simulate
from interdrive.scenario import StopLine
from interdrive.testing import problem, world

PLANNERS = ("rollout", "frenet", "idm", "lawful", "idm_mobil", "cc", "obeys")
#: Where an agent starts [m] and how fast [m/s]; half of its lane change lies at 40, 91, 145, 105 m, the line at 100 m.
CHANGES = {"before": (20.0, 10.0), "at": (75.0, 8.0), "behind": (60.0, 10.0), "across": (90.0, 2.0)}
HALF = 2.25
STOP, RED, TURN = '<trafficSignRef ref="803"/>', '<trafficLightRef ref="901"/>', '<trafficSignRef ref="804"/>'


def planner_of(name):
    """A planner by its name; that of the example obeys the rules, too."""
    return Obeys() if name == "obeys" else name


def lanes(number, x, *, before=0, after=0, more="", has_line=False, beside=True):
    """Two lanelets from x to x [m], side by side, the right one first."""
    found = ""
    for k in range(2):
        low, high = 3.5 * k - 1.75, 3.5 * k + 1.75
        links = "".join(
            f'<{tag} ref="{ref + k}"/>' for tag, ref in (("predecessor", before), ("successor", after)) if ref
        )
        if beside:
            links += f'<adjacent{"Right" if k else "Left"} ref="{number + 1 - k}" drivingDir="same"/>'
        line = f"<stopLine>{cr.point(x[1], high)}{cr.point(x[1], low)}<lineMarking>solid</lineMarking></stopLine>"
        kind = "<laneletType>urban</laneletType><userOneWay>vehicle</userOneWay>"
        bounds = {"left": [(x[0], high), (x[1], high)], "right": [(x[0], low), (x[1], low)]}
        found += cr.lanelet(number + k, **bounds, more=links + (line if has_line else "") + kind + more)
    return found


def trip(number, start, goal, *, velocity, heading=0.0, goal_heading=None, seconds=60):
    along = heading if goal_heading is None else goal_heading
    area = cr.rectangle_at(*goal, length=10.0, width=3.0, orientation=along)
    first = cr.initial(*start, orientation=heading, velocity=velocity, yawRate=0.0, slipAngle=0.0)
    return cr.planning_problem(number, cr.goal(position=area, time=(0, 10 * seconds)), start=first)


def road(folder, change, to_left, *, control="", behind="", content=""):
    """Two lanes with a line of each at 100 m; agent 1 starts in one and has its goal in the other, at 260 m."""
    start, velocity = CHANGES[change]
    # The lanes are separate up to the line if the agent is to change behind it.
    found = lanes(1, (0, 100), after=11, more=control, has_line=True, beside=change != "behind")
    found += lanes(11, (100, 320), before=1, more=behind)
    y = (0.0, 3.5) if to_left else (3.5, 0.0)
    content += trip(1, (start, y[0]), (260.0, y[1]), velocity=velocity)
    return read_scenario(cr.saved(folder, cr.document(content, lanelets=found)))


def driven(run, number=1):
    """Time [s], arc length of the front along the road [m] and speed [m/s] of an agent while it is there."""
    row = run.states.participant_id.tolist().index(number)
    there = run.states.valid[row]
    front = run.states.x[row, there] + HALF
    return 0.1 * np.flatnonzero(there), front, run.states.velocity[row, there]


every_change = pytest.mark.parametrize("change", ["before", "at", "behind"])
every_place = pytest.mark.parametrize("change", CHANGES)
either_way = pytest.mark.parametrize("to_left", [False, True])
every_planner = pytest.mark.parametrize("name", PLANNERS)


@every_planner
@every_place
@either_way
def test_it_stands_at_the_stop_sign_of_its_lane(tmp_path, name, change, to_left):
    scenario = road(tmp_path, change, to_left, control=STOP, content=cr.sign(803, 206))
    run = simulate(scenario, planner=planner_of(name), threads=1)
    _, front, velocity = driven(run)
    stood = (velocity < 0.1) & (front > 97.0) & (front < 100.0)
    assert 10 <= np.count_nonzero(stood) < 40, "one second, and not for long"
    assert run.outcomes.outcome == ("goal_reached",)
    assert run.violations.rule.count("stop_sign") == 0


@every_planner
@every_place
@either_way
def test_it_stands_at_the_red_light_of_its_lane(tmp_path, name, change, to_left):
    light = cr.traffic_light(901, ("red", 250), ("green", 600))
    run = simulate(road(tmp_path, change, to_left, control=RED, content=light), planner=planner_of(name), threads=1)
    time, front, _ = driven(run)
    assert 97.0 < front[time <= 25.0].max() < 100.0, "red for 25 s"
    assert run.outcomes.outcome == ("goal_reached",)


@every_planner
@every_change
@either_way
def test_it_keeps_to_the_limit_behind_the_line(tmp_path, name, change, to_left):
    limit = '<trafficSignRef ref="805"/>'
    scenario = road(tmp_path, change, to_left, behind=limit, content=cr.speed_sign(805, 5.0))
    run = simulate(scenario, planner=planner_of(name), threads=1)
    _, front, velocity = driven(run)
    # The planner of the example looks at the limit where its front is, and brakes from there on.
    beyond = 140.0 if name == "obeys" else 112.0
    assert velocity[front > beyond].max() < 5.1, "5 m/s from 100 m on"
    assert run.outcomes.outcome == ("goal_reached",)


@every_change
@either_way
def test_the_monitor_sees_who_passes_the_red_light_of_its_lane(tmp_path, change, to_left):
    light = cr.traffic_light(901, ("red", 250), ("green", 600))
    run = simulate(
        road(tmp_path, change, to_left, control=RED, content=light), planner="rollout", threads=1,
        settings={"rules.enabled": False},
    )  # fmt: skip
    assert run.violations.rule.count("red_light") == 1


@pytest.mark.parametrize("name", ["rollout", "idm", "obeys"])
@every_change
@either_way
def test_it_waits_for_a_person_on_the_crosswalk_behind_the_line(tmp_path, name, change, to_left):
    walk = cr.lanelet(
        51, left=[(108, -6), (108, 9)], right=[(112, -6), (112, 9)],
        more="<laneletType>crosswalk</laneletType><userBidirectional>pedestrian</userBidirectional>",
    )  # fmt: skip
    start, velocity = CHANGES[change]
    found = lanes(1, (0, 100), after=11, has_line=True, beside=change != "behind") + lanes(11, (100, 320), before=1)
    walk_on = [cr.state(k, 110.0, -4.0 + 0.1 * k, orientation=np.pi / 2, velocity=1.0) for k in range(1, 150)]
    person = cr.car(
        30, cr.initial(110.0, -4.0, orientation=np.pi / 2, velocity=1.0), walk_on, kind="pedestrian",
        shape="<circle><radius>0.3</radius></circle>",
    )  # fmt: skip
    y = (0.0, 3.5) if to_left else (3.5, 0.0)
    content = person + trip(1, (start, y[0]), (260.0, y[1]), velocity=velocity)
    run = simulate(
        read_scenario(cr.saved(tmp_path, cr.document(content, lanelets=found + walk))),
        planner=planner_of(name),
        agents=[1],
        threads=1,
    )
    assert "crosswalk" in run.orders.kind
    time, front, _ = driven(run)
    until = 0.1 * run.orders.last_time_step[run.orders.kind.index("crosswalk")]
    assert front[time <= until].max() < 108.0, "as long as it is told to wait"
    assert run.violations.rule.count("crosswalk") == 0
    assert run.outcomes.outcome == ("goal_reached",)


def crossing(folder, change, to_left, shift):
    """Two lanes that give way (205) to a road from the right (306) whose car is `shift` seconds late."""
    give_way, priority = '<trafficSignRef ref="801"/>', '<trafficSignRef ref="802"/>'
    found = lanes(1, (0, 90), after=11, more=give_way, beside=change != "behind")
    found += lanes(11, (90, 110), before=1, after=21, beside=change != "behind") + lanes(21, (110, 320), before=11)
    for number, low, high, before, after in ((7, -150, -8, "", 8), (8, -8, 12, 7, 9), (9, 12, 150, 8, "")):
        more = "".join(f'<{tag} ref="{ref}"/>' for tag, ref in (("predecessor", before), ("successor", after)) if ref)
        more += "<laneletType>urban</laneletType><userOneWay>vehicle</userOneWay>" + (priority if number == 7 else "")
        bounds = {"left": [(98.25, low), (98.25, high)], "right": [(101.75, low), (101.75, high)]}
        found += cr.lanelet(number, **bounds, more=more)
    start, velocity = CHANGES[change] if change else (20.0, 10.0)
    y = {None: (3.5, 3.5)}.get(change, (0.0, 3.5) if to_left else (3.5, 0.0))
    content = cr.sign(801, 205) + cr.sign(802, 306) + trip(1, (start, y[0]), (260.0, y[1]), velocity=velocity)
    # It would be at the crossing when agent 1 is, and then earlier or later.
    before = 10.0 * ((97.0 - start) / velocity + shift)
    content += trip(2, (100.0, -before), (100.0, 100.0), velocity=10.0, heading=np.pi / 2)
    return read_scenario(cr.saved(folder, cr.document(content, lanelets=found)))


@pytest.mark.parametrize("name", ["rollout", "idm"])
@pytest.mark.parametrize("change", [None, "before"])
@pytest.mark.parametrize("shift", [0.5 * k for k in range(-5, 6)])
def test_nobody_touches_and_the_car_with_the_sign_waits(tmp_path, name, change, shift):
    run = simulate(crossing(tmp_path, change, to_left=True, shift=shift), planner=planner_of(name), threads=1)
    assert run.outcomes.outcome == ("goal_reached",) * 2
    assert 2 not in run.orders.agent_id, "it is not told to wait"
    assert run.violations.rule.count("right_of_way") == 0


@every_planner
@pytest.mark.parametrize("change", ["at", "behind"])
@either_way
def test_it_gives_way_from_the_lane_of_its_path(tmp_path, name, change, to_left):
    run = simulate(crossing(tmp_path, change, to_left=to_left, shift=0.0), planner=planner_of(name), threads=1)
    assert run.outcomes.outcome == ("goal_reached",) * 2
    assert 1 in run.orders.agent_id, "it is told to wait"
    assert run.violations.rule.count("right_of_way") == 0


@pytest.mark.parametrize("ends", [(60.0, 60.0), (60.5, 59.5), (63.0, 57.0), (57.0, 63.0)])
def test_it_gives_way_behind_lanelets_that_do_not_end_beside_each_other(tmp_path, ends):
    """Half of the lane change lies at 60 m, so between the ends of the right and the left lanelet."""
    found = ""
    for k, end in enumerate(ends):
        low, high = 3.5 * k - 1.75, 3.5 * k + 1.75
        for number, x, link in ((1 + k, (0, end), f'<successor ref="{11 + k}"/>'), (11 + k, (end, 320), "")):
            beside = f'<adjacent{"Right" if k else "Left"} ref="{number + 1 - 2 * k}" drivingDir="same"/>'
            kind = "<laneletType>urban</laneletType><userOneWay>vehicle</userOneWay>"
            before = f'<predecessor ref="{1 + k}"/>' if number > 10 else ""
            bounds = {"left": [(x[0], high), (x[1], high)], "right": [(x[0], low), (x[1], low)]}
            found += cr.lanelet(number, **bounds, more=before + link + beside + kind)
    for number, low, high, before, after in ((7, -150, -8, "", 8), (8, -8, 12, 7, 9), (9, 12, 150, 8, "")):
        more = "".join(f'<{tag} ref="{ref}"/>' for tag, ref in (("predecessor", before), ("successor", after)) if ref)
        more += "<laneletType>urban</laneletType><userOneWay>vehicle</userOneWay>"
        more += '<trafficSignRef ref="802"/>' if number == 7 else ""
        bounds = {"left": [(198.25, low), (198.25, high)], "right": [(201.75, low), (201.75, high)]}
        found += cr.lanelet(number, **bounds, more=more)
    content = cr.sign(802, 306) + trip(1, (40.0, 0.0), (280.0, 3.5), velocity=10.0)
    content += trip(2, (200.0, -145.0), (200.0, 100.0), velocity=10.0, heading=np.pi / 2)
    scenario = read_scenario(cr.saved(tmp_path, cr.document(content, lanelets=found)))
    run = simulate(scenario, planner="idm", threads=1)
    assert 1 in run.orders.agent_id, "it is told to wait"
    assert run.outcomes.outcome == ("goal_reached",) * 2


def turning(folder, change, to_left):
    """From either lane the road behind the line turns right, where drivers may turn on red (sign 720)."""
    found = lanes(1, (0, 100), after=11, more=RED + TURN, has_line=True, beside=change != "behind")
    angles = np.linspace(0.0, np.pi / 2, 12)
    for k in range(2):
        inner, outer = 20.0 + 3.5 * k - 1.75, 20.0 + 3.5 * k + 1.75
        arc = lambda radius: [(100.0 + radius * np.sin(a), -20.0 + radius * np.cos(a)) for a in angles]  # noqa: E731
        links = f'<predecessor ref="{1 + k}"/><successor ref="{21 + k}"/>'
        links += f'<adjacent{"Right" if k else "Left"} ref="{12 - k}" drivingDir="same"/>'
        kind = "<laneletType>urban</laneletType><userOneWay>vehicle</userOneWay>"
        found += cr.lanelet(11 + k, left=arc(outer), right=arc(inner), more=links + kind)
        low, high = 120.0 + 3.5 * k - 1.75, 120.0 + 3.5 * k + 1.75
        links = f'<predecessor ref="{11 + k}"/><adjacent{"Right" if k else "Left"} ref="{22 - k}" drivingDir="same"/>'
        found += cr.lanelet(
            21 + k, left=[(high, -20.0), (high, -250.0)], right=[(low, -20.0), (low, -250.0)], more=links + kind
        )
    start, velocity = CHANGES[change]
    y, x = ((0.0, 3.5), 123.5) if to_left else ((3.5, 0.0), 120.0)
    light = cr.traffic_light(901, ("red", 5000), ("green", 10))
    content = (
        light + cr.sign(804, 720) + trip(1, (start, y[0]), (x, -120.0), velocity=velocity, goal_heading=-np.pi / 2)
    )
    return read_scenario(cr.saved(folder, cr.document(content, lanelets=found)))


@every_planner
@every_change
@either_way
def test_it_turns_right_on_red_from_its_lane_after_standing(tmp_path, name, change, to_left):
    run = simulate(turning(tmp_path, change, to_left), planner=planner_of(name), threads=1)
    _, front, velocity = driven(run)
    assert np.count_nonzero((velocity < 0.1) & (front > 97.0) & (front < 100.0)) >= 10, "it stands before the line"
    assert run.outcomes.outcome == ("goal_reached",)
    assert run.violations.rule.count("red_light") == 0


def in_a_ring(start, outward):
    """Two lanes around the origin, of 40 and 36.5 m, a stop line across both at 90 degrees; agent 1 changes lanes."""
    from_radius, to_radius = (36.5, 40.0) if outward else (40.0, 36.5)
    goal = (to_radius * math.cos(3.5), to_radius * math.sin(3.5))
    agent = problem(
        1, from_radius * math.cos(start), from_radius * math.sin(start), 7.0, start + math.pi / 2, goal=goal,
        goal_size=(6.0, 3.0), goal_orientation=math.remainder(3.5 + math.pi / 2, 2 * math.pi), time_step=(0, 700),
    )  # fmt: skip
    lines = tuple(
        StopLine(number, np.array([[0.0, radius - 1.75], [0.0, radius + 1.75]]), (), has_stop_sign=True)
        for number, radius in ((2, 40.0), (10, 36.5))
    )
    return replace(world(ring(8, 40.0, 2), problems=[agent], steps=0), stop_lines=lines)


@pytest.mark.parametrize("name", ["idm", "obeys"])
@pytest.mark.parametrize("start", [0.05, 0.7, 1.2])
@either_way
def test_it_stands_at_the_stop_sign_in_a_ring_and_drives_on(name, start, to_left):
    run = simulate(in_a_ring(start, outward=not to_left), agents=[1], planner=planner_of(name), threads=1)
    row = run.states.participant_id.tolist().index(1)
    there = run.states.valid[row]
    angle = np.arctan2(run.states.y[row, there], run.states.x[row, there])
    to_line = 38.0 * (math.pi / 2 - angle) - HALF
    stood = (run.states.velocity[row, there] < 0.1) & (to_line > -0.5) & (to_line < 3.0)
    assert np.count_nonzero(stood) >= 10, "one second"
    assert run.outcomes.outcome == ("goal_reached",)
    assert run.violations.rule.count("stop_sign") == 0
