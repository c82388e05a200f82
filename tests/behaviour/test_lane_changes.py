"""Lane changes of the default planner on two lanes along x, 3.5 m wide.

The agent starts in lane 1 (y = 0) and has its goal in lane 2 (y = 3.5 m). Recorded cars keep their speed whatever the
agent does. All vehicles are 4.5 m long.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.support.junction_lanes import left_turn, network, straight

import interdrive as idr
from interdrive.results.story import story
from interdrive.run import PLAN_STATUS
from interdrive.scenario import Lanelets
from interdrive.simulation import Simulation
from interdrive.testing.worlds import Car, problem, straight_road, world

LENGTH = 4.5
SPEED = 15.0
#: A change is shown for so long before it begins [s].
SHOWN = 3.0
#: People take 1 to 13 s for a whole change of lanes (Toledo and Zohar 2007); half of it takes less than this [s].
HALF_OVER = 5.0


def two_lanes(cars=(), velocity=SPEED, goal=560.0, first_ends=None, steps=500, problems=()):
    """The agent at x = 50 m with a speed, the goal at an x in lane 2; lane 1 may end early; perhaps more agents."""
    lanelets = straight_road(600.0, lanes=2)
    if first_ends is not None:
        lanelets = two_pieces(lanelets, first_ends)
    agent = problem(1, 50.0, 0.0, velocity, goal=(goal, 3.5), goal_size=(40.0, 3.5), time_step=(0, steps))
    return world(lanelets, cars=list(cars), problems=[agent, *problems], steps=steps)


def two_pieces(lanelets, ends):
    """Lanelet 1 up to an x; lanelet 2 beside it and lanelet 3 behind that."""

    def cut(points, before):
        return points[points[:, 0] <= ends if before else points[:, 0] >= ends]

    return replace(
        lanelets,
        ids=np.array([1, 2, 3]),
        left=(cut(lanelets.left[0], True), cut(lanelets.left[1], True), cut(lanelets.left[1], False)),
        right=(cut(lanelets.right[0], True), cut(lanelets.right[1], True), cut(lanelets.right[1], False)),
        predecessors=((), (), (2,)),
        successors=((), (3,), ()),
        adjacent_left=np.array([2, -1, -1]),
        adjacent_left_same_direction=np.array([True, False, False]),
        adjacent_right=np.array([-1, 1, -1]),
        adjacent_right_same_direction=np.array([False, True, False]),
        speed_limit=np.full(3, np.nan),
        types=((),) * 3,
        left_marking=("dashed", "solid", "solid"),
        right_marking=("solid", "dashed", "solid"),
    )


def straight_road_in_pieces(n, length):
    """Two lanes as of `two_lanes`, in n lanelets each of a length: 1, 3, 5, ... and 2, 4, 6, ..."""
    x = [np.linspace(i * length, (i + 1) * length, 21) for i in range(n)]

    def bounds(y):
        return tuple(np.column_stack([part, np.full_like(part, side)]) for part in x for side in y)

    ids = np.arange(1, 2 * n + 1)
    is_first = ids % 2 == 1
    return Lanelets(
        ids=ids,
        left=bounds((1.75, 5.25)),
        right=bounds((-1.75, 1.75)),
        predecessors=tuple((int(i) - 2,) if i > 2 else () for i in ids),
        successors=tuple((int(i) + 2,) if i <= 2 * n - 2 else () for i in ids),
        adjacent_left=np.where(is_first, ids + 1, -1),
        adjacent_left_same_direction=is_first,
        adjacent_right=np.where(is_first, -1, ids - 1),
        adjacent_right_same_direction=~is_first,
        speed_limit=np.full(2 * n, np.nan),
        types=((),) * (2 * n),
    )


class Drive:
    """The agent's drive, and the cars around it when its middle crosses the line between the lanes."""

    def __init__(self, scenario):
        self.run = idr.simulate(scenario, agents=[1], threads=1)
        states = self.run.states
        row = list(states.participant_id).index(1)
        there = states.valid[row]
        self.x, self.y, self.velocity = states.x[row, there], states.y[row, there], states.velocity[row, there]
        self.outcome = self.run.outcomes.outcome[0]
        over = np.flatnonzero(self.y > 1.75)
        self.crossing = int(over[0]) if len(over) else None

    def gaps(self, cars):
        """Bumper to bumper at the crossing: to the nearest car ahead and behind in lane 2 [m], and its speed [m/s]."""
        at = self.crossing * self.run.scenario.dt
        offsets = [(car.x + car.velocity * at - self.x[self.crossing], car.velocity) for car in cars if car.y > 1.75]
        ahead = min((offset - LENGTH, v) for offset, v in [*offsets, (np.inf, 0.0)] if offset > 0)
        behind = min((-offset - LENGTH, v) for offset, v in [*offsets, (-np.inf, 0.0)] if offset <= 0)
        return ahead, behind


class Onwards:
    """Changes to lane 2 in 4 s and keeps its speed."""

    def plan(self, view, predictions):
        ego, time = view.ego, view.dt * np.arange(31)
        y = np.minimum(ego.y + 3.5 / 4.0 * time, 3.5)
        return idr.Trajectory(ego.x + ego.velocity * time, y, np.zeros(31), np.full(31, ego.velocity))


def row(first, gap, n, velocity=SPEED, y=3.5):
    """Cars in lane 2 from an x on backwards, with gaps between bumpers [m]."""
    return [Car(100 + i, first - i * (LENGTH + gap), y, velocity) for i in range(n)]


def test_an_agent_alone_changes_gently_as_soon_as_it_has_shown_it():
    drive = Drive(two_lanes())
    dt = drive.run.scenario.dt
    assert drive.outcome == "goal_reached"
    assert drive.crossing * dt < SHOWN + HALF_OVER, "s until it is half over"
    assert np.abs(drive.y[: round(SHOWN / dt) + 1]).max() < 0.01, "m aside while it only shows it"
    lateral = np.abs(np.diff(drive.y, 2)) / dt**2
    assert lateral[2:].max() < 3.0, "m/s² across"
    assert abs(drive.y[-1] - 3.5) < 0.1, "m from the middle of lane 2"


def turns(run, agent=1):
    """What the agent shows at each step: 1 left, -1 right, nan nothing."""
    return run.plans.turn[run.plans.agent_id == agent]


def test_it_shows_the_change_from_3_s_before_until_it_is_in_the_new_lane():
    drive = Drive(two_lanes())
    shown = turns(drive.run) == 1.0
    last = int(np.flatnonzero(shown)[-1])
    assert shown[: last + 1].all(), "without a break"
    assert np.isnan(turns(drive.run)[last + 1 :]).all()
    assert drive.y[last + 1] == pytest.approx(3.5, abs=0.5), "m: in the middle of lane 2"
    assert f"  blinkers left from 0.0 to {0.1 * (last + 1):.1f} s" in story(drive.run, 1)


def test_a_change_to_the_right_is_shown_on_the_right():
    agent = problem(1, 50.0, 3.5, SPEED, goal=(560.0, 0.0), goal_size=(40.0, 3.5), time_step=(0, 500))
    run = idr.simulate(world(straight_road(600.0, lanes=2), problems=[agent], steps=500), agents=[1], threads=1)
    assert set(turns(run)[:40].tolist()) == {-1.0}


def test_where_its_lane_ends_soon_it_does_not_wait_to_have_shown_it():
    drive = Drive(two_lanes(first_ends=110.0))
    assert drive.outcome == "goal_reached"
    assert drive.crossing * drive.run.scenario.dt < 0.5 + HALF_OVER, "s until it is half over"
    assert turns(drive.run)[0] == 1.0


def test_it_shows_the_change_to_its_end_where_the_lane_that_it_leaves_ends_before():
    run = Drive(two_lanes(first_ends=85.0)).run
    x, y, shown = run.states.x[0], run.states.y[0], turns(run) == 1.0
    last = int(np.flatnonzero(shown)[-1])
    assert shown[: last + 1].all(), "without a break"
    assert abs(y[int(np.argmax(x > 85.0))] - 3.5) > 0.8, "m: the change is not over where lane 1 ends"
    assert y[last + 1] == pytest.approx(3.5, abs=0.5), "m: in the middle of lane 2"


def test_an_agent_that_enters_in_the_middle_of_a_change_goes_on_with_it():
    agent = problem(1, 50.0, 1.2, SPEED, 0.06, goal=(560.0, 3.5), goal_size=(40.0, 3.5), time_step=(0, 500))
    run = idr.simulate(world(straight_road(600.0, lanes=2), problems=[agent], steps=500), agents=[1], threads=1)
    y = run.states.y[0, run.states.valid[0]]
    assert (np.diff(y[:40]) > -0.01).all(), "m: it does not go back"
    assert int(np.argmax(y > 1.75)) * run.scenario.dt < 1.5, "s until it is half over"
    assert turns(run)[0] == 1.0


def test_without_blinkers_it_shows_nothing_and_waits_for_nothing():
    run = idr.simulate(two_lanes(), agents=[1], threads=1, settings={"rules.blinkers": False})
    assert int(np.argmax(run.states.y[0] > 1.75)) * run.scenario.dt < HALF_OVER, "s until it is half over"
    assert np.isnan(turns(run)).all()


def test_an_agent_in_the_middle_of_its_lane_shows_nothing():
    agent = problem(1, 50.0, 0.6, SPEED, goal=(560.0, 0.0), goal_size=(40.0, 3.5), time_step=(0, 500))
    run = idr.simulate(world(straight_road(600.0, lanes=2), problems=[agent], steps=500), agents=[1], threads=1)
    assert np.isnan(turns(run)).all()


def test_an_agent_along_a_path_shows_its_lane_change_as_before_a_fork():
    run = idr.simulate(two_lanes(), agents=[1], planner="idm", threads=1)
    over = int(np.argmax(run.states.y[0] > 1.75))
    shown = turns(run) == 1.0
    assert shown[over - 40 : over].all(), "4 s before it is half over"
    assert not shown[over + 20 :].any(), "2 s behind"


@pytest.mark.parametrize("planner", ["idm", "rollout"])
def test_an_agent_that_reverses_shows_no_lane_change(planner):
    def shown(velocity):
        drive = Simulation(two_lanes(velocity=velocity), agents=[1], planner=planner, threads=1)
        drive.step()
        return drive.world.scene().turn.tolist()

    assert shown(0.0) == [1.0]
    assert np.isnan(shown(-1.5)).all()


def test_an_agent_of_mobil_shows_a_change_while_it_makes_it():
    run = idr.simulate(two_lanes(), agents=[1], planner="idm_mobil", threads=1)
    shown, y = turns(run) == 1.0, run.states.y[0, : len(turns(run))]
    assert shown[(y > 0.5) & (y < 3.0)].all()
    assert not shown[y > 3.4].any()


def test_beside_a_car_of_the_same_speed_it_falls_back_or_goes_ahead_before_it_changes():
    cars = row(50.0, 0.0, 1)
    drive = Drive(two_lanes(cars))
    ahead, behind = drive.gaps(cars)
    assert drive.outcome == "goal_reached"
    assert min(ahead[0], behind[0]) > 1.0, "m when it is half over"


@pytest.mark.parametrize("velocity", [16.0, 20.0, 25.0])
@pytest.mark.parametrize("distance", [10.0, 20.0, 30.0, 45.0])
def test_half_over_4_meters_per_second_squared_suffice_for_another_agent_behind(velocity, distance):
    behind = problem(2, 50.0 - distance, 3.5, velocity, goal=(560.0, 3.5), goal_size=(40.0, 3.5), time_step=(0, 500))
    run = idr.simulate(two_lanes(problems=[behind]), agents=[1, 2], threads=1)
    states = run.states
    half_over = int(np.argmax(states.y[0] > 1.75))
    gap = states.x[0, half_over] - states.x[1, half_over] - LENGTH
    faster = max(0.0, states.velocity[1, half_over] - states.velocity[0, half_over])
    assert run.outcomes.outcome == ("goal_reached", "goal_reached")
    assert gap > 1.0 or gap < -2.0 * LENGTH - 1.0, "m: it is behind, or has passed"
    assert gap < 0.0 or 0.5 * faster**2 / (gap - 1.0) <= 4.0, "m/s²: what it has to brake with"


def test_it_waits_for_a_fast_car_behind_and_not_for_a_slow_one():
    fast, slow = (Drive(two_lanes([Car(100, 20.0, 3.5, velocity)])) for velocity in (25.0, 12.0))
    assert fast.gaps([Car(100, 20.0, 3.5, 25.0)])[0][0] < np.inf, "the fast car is ahead"
    assert slow.gaps([Car(100, 20.0, 3.5, 12.0)])[1][0] < np.inf, "the slow car is behind"
    assert slow.crossing < fast.crossing


@pytest.mark.parametrize(("first", "place"), [(62.0, "behind"), (90.0, "ahead")])
def test_in_a_dense_row_it_drives_to_the_only_gap(first, place):
    # Cars 3 m apart but for one gap of 25 m, which begins 20 m behind or 5 m before the agent.
    front = row(first, 3.0, 4)
    back = row(front[-1].x - LENGTH - 25.0, 3.0, 8)
    cars = [*front, *(replace(car, id=car.id + 50) for car in back)]
    drive = Drive(two_lanes(cars))
    (gap_ahead, _), (gap_behind, _) = drive.gaps(cars)
    assert drive.outcome == "goal_reached", place
    assert gap_ahead + gap_behind + LENGTH == pytest.approx(25.0, abs=0.1), "m: that gap"
    assert min(gap_ahead, gap_behind) > 1.0, "m"


def test_without_a_gap_it_stops_before_its_lane_ends_and_goes_on_behind_the_row():
    cars = row(190.0, 2.0, 40, velocity=10.0)
    drive = Drive(two_lanes(cars, velocity=10.0, first_ends=200.0, steps=900))
    waiting = drive.velocity < 0.1
    assert waiting.any()
    assert 180.0 < drive.x[waiting].max() + 0.5 * LENGTH < 200.0, "m: its front, in lane 1"
    assert drive.outcome == "goal_reached"
    assert drive.gaps(cars)[1][0] == np.inf, "no car is left behind it"


def test_an_agent_whose_time_is_over_before_the_end_of_its_lane_says_so():
    cars = row(400.0, 3.0, 70, velocity=10.0)
    drive = Drive(two_lanes(cars, velocity=10.0, first_ends=200.0, steps=300))
    assert drive.outcome == "time_limit"
    assert "before the end of lanelet 1 without a gap in the lane beside" in drive.run.outcomes.reason[0]


def test_with_little_time_it_takes_smaller_gaps():
    # Beside the agent, from 4 m behind it to 24 m ahead, is a gap of its speed.
    cars = [Car(100, 50.0 - LENGTH - 4.0, 3.5, SPEED), Car(101, 50.0 + LENGTH + 24.0, 3.5, SPEED)]
    patient, hurried = Drive(two_lanes(cars)), Drive(two_lanes(cars, goal=170.0))
    assert hurried.outcome == "goal_reached"
    assert hurried.crossing < patient.crossing
    assert patient.gaps(cars)[1][0] > hurried.gaps(cars)[1][0] > 1.0, "m to the car behind"


@pytest.mark.parametrize(("velocity", "beside"), [(8.0, 0.0), (10.0, 0.0), (10.0, 1.5), (15.0, 0.0)])
def test_beside_the_first_car_of_a_row_it_falls_back_if_the_car_ahead_keeps_it_from_passing(velocity, beside):
    # The lane is free ahead of the row, whose gaps are 8 m; the car ahead drives as fast, 12 m ahead of the agent.
    ahead = Car(300, 50.0 + LENGTH + 12.0, 0.0, velocity)
    cars = row(50.0 + beside, 8.0, 12, velocity=velocity)
    drive = Drive(two_lanes([ahead, *cars], velocity=velocity, goal=50.0 + 12.0 * velocity))
    assert drive.outcome == "goal_reached"
    assert drive.gaps(cars)[0][0] < np.inf, "the first car of the row is ahead"
    assert drive.velocity.min() > 0.75 * velocity, "m/s"


def test_in_a_row_with_short_gaps_it_does_not_slow_down_in_front_of_the_car_behind():
    # In the end it has to change into a gap of 14 m, which leaves less than 5 m on each side.
    assert Drive(two_lanes(row(66.0, 14.0, 4))).outcome == "goal_reached"


def forking(cars, start=50.0, velocity=SPEED, problems=(), steps=900):
    """Lanes 1 and 2 (left) run beside each other for 200 m; 1 leads straight on to 3, 2 to the goal in 4, a bend."""
    centers = {
        1: straight((0.0, 0.0), (200.0, 0.0)),
        2: straight((0.0, 3.5), (200.0, 3.5)),
        3: straight((200.0, 0.0), (600.0, 0.0)),
        4: left_turn(200.0, (200.0, 3.5)),
    }
    agent = problem(1, start, 0.0, velocity, goal=(300.0, 30.4), goal_size=(40.0, 20.0), time_step=(0, steps))
    lanelets = network(centers, {1: (3,), 2: (4,)}, {1: 2})
    return world(lanelets, cars=cars, problems=[agent, *problems], steps=steps)


def test_it_waits_for_a_gap_where_its_lane_leads_elsewhere():
    drive = Drive(forking(row(200.0, 2.0, 40, velocity=6.0)))
    assert drive.velocity.min() < 1.0, "m/s"
    assert drive.outcome == "goal_reached"


def test_it_gives_up_its_goal_rather_than_stop_in_front_of_the_traffic_behind():
    behind = [Car(200 + k, 10.0 - 30.0 * k, 0.0, SPEED) for k in range(4)]
    drive = Drive(forking([*row(200.0, 2.0, 40, velocity=6.0), *behind]))
    assert drive.velocity.min() > 0.85 * SPEED - 0.1, "m/s: the flow behind it"
    assert drive.outcome == "goal_missed"
    assert drive.run.outcomes.reason == (
        "passed the goal area at a distance of 20.4 m at 15.4 s; it did not get from lanelet 1 to lanelet 2 beside it",
    )
    assert abs(drive.y[-1]) < 0.5, "m from the middle of lane 3"


def test_it_gives_up_its_goal_too_where_both_lanes_end_with_the_map():
    agent = problem(1, 50.0, 0.0, SPEED, goal=(275.0, 3.5), goal_size=(40.0, 3.5), time_step=(0, 300))
    cars = [*row(200.0, 2.0, 40, velocity=6.0), *(Car(200 + k, 10.0 - 30.0 * k, 0.0, SPEED) for k in range(4))]
    drive = Drive(world(straight_road(300.0, lanes=2), cars=cars, problems=[agent], steps=300))
    assert drive.velocity.min() > 0.85 * SPEED - 0.1, "m/s: the flow behind it"
    assert drive.outcome == "goal_missed"


@pytest.mark.parametrize(("velocity", "x"), [(13.2, -2.0), (13.2, 6.0), (13.6, 2.0)])
def test_it_does_not_brake_again_when_the_vehicle_behind_falls_back(velocity, x):
    drive = Drive(forking([*row(260.0, 2.0, 40, velocity=6.0), Car(300, x, 0.0, velocity)]))
    braking = -np.diff(drive.velocity).min() / drive.run.scenario.dt
    assert drive.outcome == "goal_missed"
    assert braking < 3.0, "m/s²"


def test_it_does_not_keep_a_vehicle_standing_behind_it():
    behind = problem(2, 180.0, 0.0, 0.0, goal=(300.0, 0.0), goal_size=(40.0, 3.5), time_step=(0, 300))
    scenario = forking(row(400.0, 2.0, 80, velocity=6.0), start=187.0, velocity=0.0, problems=[behind])
    run = idr.simulate(scenario, agents=[1, 2], threads=1)
    assert run.outcomes.outcome == ("goal_missed", "goal_reached")


def test_the_reason_names_no_change_that_was_made():
    # The agent passes the goal in lane 2 before its first admissible time.
    agent = problem(1, 50.0, 0.0, SPEED, goal=(200.0, 3.5), goal_size=(10.0, 3.5), time_step=(400, 500))
    world_of_it = world(straight_road(600.0, lanes=2), problems=[agent], steps=500)
    run = idr.simulate(world_of_it, agents=[1], planner=Onwards, threads=1)
    assert run.outcomes.outcome == ("goal_missed",)
    assert "lanelet" not in run.outcomes.reason[0]


def test_changes_to_the_right_are_those_to_the_left_mirrored():
    cars = row(66.0, 20.0, 4)
    left = Drive(two_lanes(cars))
    agent = problem(1, 50.0, 3.5, SPEED, goal=(560.0, 0.0), goal_size=(40.0, 3.5), time_step=(0, 500))
    mirrored = [replace(car, y=0.0) for car in cars]
    right = idr.simulate(
        world(straight_road(600.0, lanes=2), cars=mirrored, problems=[agent], steps=500), agents=[1], threads=1
    )
    states = right.states
    x, y = states.x[0, states.valid[0]], states.y[0, states.valid[0]]
    over = int(np.argmax(y < 1.75))
    assert right.outcomes.outcome == ("goal_reached",)
    assert x[over] == pytest.approx(left.x[left.crossing], abs=3.0), "m"


def test_where_lanelets_follow_each_other_it_changes_as_early_as_on_long_ones():
    pieces = straight_road_in_pieces(6, 100.0)
    agent = problem(1, 50.0, 0.0, SPEED, goal=(560.0, 3.5), goal_size=(40.0, 3.5), time_step=(0, 500))
    run = idr.simulate(world(pieces, problems=[agent], steps=500), agents=[1], threads=1)
    over = int(np.argmax(run.states.y[0] > 1.75))
    assert run.outcomes.outcome == ("goal_reached",)
    assert over * run.scenario.dt < SHOWN + HALF_OVER, "s until it is half over"


def test_two_changes_follow_each_other():
    agent = problem(1, 50.0, 0.0, SPEED, goal=(560.0, 7.0), goal_size=(40.0, 3.5), time_step=(0, 500))
    run = idr.simulate(world(straight_road(600.0, lanes=3), problems=[agent], steps=500), agents=[1], threads=1)
    y = run.states.y[0, run.states.valid[0]]
    assert run.outcomes.outcome == ("goal_reached",)
    first, second = (run.scenario.dt * np.argmax(y > line) for line in (1.75, 5.25))
    assert first < second < 3.0 * HALF_OVER, "s: one whole change, then the other one to its half"


@pytest.mark.parametrize("planner", ["rollout", "idm_mobil"])
@pytest.mark.parametrize("velocity", [5.0, SPEED])
def test_two_agents_beside_each_other_that_want_each_others_lanes_swap_them(planner, velocity):
    agents = [
        problem(1, 50.0, 0.0, velocity, goal=(560.0, 3.5), goal_size=(40.0, 3.5), time_step=(0, 1500)),
        problem(2, 50.0, 3.5, velocity, goal=(560.0, 0.0), goal_size=(40.0, 3.5), time_step=(0, 1500)),
    ]
    scenario = world(straight_road(600.0, lanes=2), problems=agents, steps=1500)
    run = idr.simulate(scenario, agents=[1, 2], planner=planner, threads=1)
    assert run.outcomes.outcome == ("goal_reached", "goal_reached")


def test_the_drive_does_not_depend_on_threads_or_on_what_is_recorded():
    agents = [
        problem(
            i,
            90.0 - 20.0 * i,
            3.5 * (i % 2),
            SPEED + i,
            goal=(560.0, 3.5 - 3.5 * (i % 2)),
            goal_size=(40.0, 3.5),
            time_step=(0, 500),
        )
        for i in range(1, 5)
    ]
    scenario = world(straight_road(600.0, lanes=2), problems=agents, steps=500)
    observed = {"record.candidates": 10, "record.predictions": True}
    runs = [idr.simulate(scenario, agents="all", threads=threads) for threads in (1, 2)]
    runs.append(idr.simulate(scenario, agents="all", threads=2, settings=observed))
    assert len({run.digest for run in runs}) == 1


def test_an_agent_turns_into_a_road_whose_far_lane_it_has_to_reach():
    """It stands before a right turn of 4 m radius into the right lane, y = 0, and heads across the far one, y = 3 m.

    With 3 m/s² across it turns at 3.5 m/s, so that 41 m take a good 6 s.
    """
    radius = 4.0
    turned = np.linspace(0.0, 0.5 * np.pi, 13)
    centers = {
        5: straight((-radius, -40.0), (-radius, -radius)),
        6: radius * np.column_stack([-np.cos(turned), np.sin(turned) - 1.0]),
        10: straight((-60.0, 0.0), (0.0, 0.0)),
        11: straight((0.0, 0.0), (120.0, 0.0)),
        20: straight((-60.0, 3.0), (0.0, 3.0)),
        21: straight((0.0, 3.0), (120.0, 3.0)),
    }
    after = {5: (6,), 6: (11,), 10: (11,), 20: (21,)}
    lanelets = network(centers, after, {10: 20, 11: 21}, width=3.0, speed_limit=10.0)
    goal = {"goal": (30.0, 3.0), "goal_size": (10.0, 3.0), "time_step": (0, 80)}
    agent = problem(1, -radius, -radius - 1.0, 0.0, 0.5 * np.pi, **goal)
    run = idr.simulate(world(lanelets, problems=[agent], steps=80), settings={"rules.precedence": False}, threads=1)
    assert run.outcomes.outcome == ("goal_reached",)
    # It cannot plan along a lane across which it heads.
    assert not (run.plans.status == PLAN_STATUS.index("emergency_braking")).any()


def _in_waves(seconds):
    """Two lanes with a leader each, faster in turns: now the one is ahead, now the other."""
    time = 0.1 * np.arange(10 * seconds + 1)
    scenario = world(
        straight_road(20.0 * seconds + 300.0, lanes=2),
        cars=[Car(1, 60.0, 0.0, 15.0), Car(2, 60.0, 3.5, 15.0), Car(3, 20.0, 0.0, 15.0)],
        steps=10 * seconds,
    )
    x, velocity = scenario.obstacles.x.copy(), scenario.obstacles.velocity.copy()
    period, swing = 12.0, 20.0
    for row, sign in ((0, 1.0), (1, -1.0)):
        phase = 2.0 * np.pi * time / period
        x[row] = 60.0 + 15.0 * time + sign * swing * (1.0 - np.cos(phase)) / 2.0
        velocity[row] = 15.0 + sign * swing * np.pi / period * np.sin(phase)
    return replace(scenario, obstacles=replace(scenario.obstacles, x=x, velocity=velocity))


def _changes(scenario, words, **settings):
    """When agent 3 passes the line between the lanes [s]."""
    settings = {"goal.information": "turns"} | {name.replace("__", "."): value for name, value in settings.items()}
    run = idr.simulate(scenario, agents=[3], planner=f"idm_mobil,driver.desired_factor=1.2{words}", settings=settings)
    y = run.states.y[list(run.states.participant_id).index(3)]
    return 0.1 * np.flatnonzero(np.diff(y[np.isfinite(y)] > 1.75))


def test_who_looks_for_a_better_lane_now_and_then_does_not_go_back_at_once():
    scenario = _in_waves(90)
    always, sometimes = _changes(scenario, ""), _changes(scenario, ",looking_interval=20")
    assert len(always) > 6
    assert np.diff(always).min() < 10.0, "s: back at once"
    assert 1 <= len(sometimes) < len(always) / 2
    # One look is 20 s after the other, and a change takes as long as the one before.
    assert np.diff(sometimes).min(initial=20.0) > 19.0, "s"


@pytest.mark.parametrize("shift", [0.0, 1.0, 2.0])
def test_a_look_that_is_due_between_two_plans_is_made_with_the_next_one(shift):
    scenario = _in_waves(90)
    x = scenario.obstacles.x.copy()
    # Where it enters decides when it looks.
    x[2] += shift
    scenario = replace(scenario, obstacles=replace(scenario.obstacles, x=x))
    assert len(_changes(scenario, ",looking_interval=10", step__replan_every=5)) >= 1


@pytest.mark.parametrize("start", [30.0, 33.0, 36.0, 39.0])
def test_who_has_to_change_soon_does_not_wait_until_it_looks_again(start):
    goal = problem(1, start, 0.0, 10.0, goal=(380.0, 3.5), goal_size=(20.0, 3.5), time_step=(0, 900))
    scenario = world(straight_road(400.0, lanes=2), problems=[goal], steps=900)
    run = idr.simulate(scenario, agents=[1], planner="idm_mobil,looking_interval=60", threads=1)
    assert run.outcomes.outcome == ("goal_reached",)
