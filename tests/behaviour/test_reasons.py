"""Why agents ended as they did, in words, each in a world made for it."""

import re
from dataclasses import replace

import numpy as np
import pytest
from drivers import Straight, Turning

from interdrive import Simulation, Trajectory, load, save, simulate
from interdrive.report.events import events_of
from interdrive.results.story import story
from interdrive.results.tables import plans_table
from interdrive.run import PLAN_STATUS
from interdrive.run.reasons import reasons
from interdrive.testing import Car, PlannerContractError, check_planner, crossing, problem, straight_road, world


class Stopping(Straight):
    """Stands from its first planned state on."""

    def plan(self, view, predictions):
        ego = view.ego
        x = np.full(31, ego.x)
        x[1:] += 0.5 * ego.velocity * view.dt
        velocity = np.zeros(31)
        velocity[0] = ego.velocity
        return Trajectory(x, np.full(31, ego.y), np.full(31, ego.orientation), velocity)


def with_goal(scenario, **conditions):
    """The world with other conditions in the goal of its only problem."""
    one = scenario.planning_problems[0]
    return replace(scenario, planning_problems=(replace(one, goal=(replace(one.goal[0], **conditions),)),))


def ended(scenario, planner=Straight):
    """Outcome and reason of agent 100 among recorded cars."""
    outcomes = simulate(scenario, agents=[100], planner=planner, threads=1).outcomes
    return outcomes.outcome[0], outcomes.reason[0]


def on_a_road(*cars, velocity=10.0, goal=60.0, time_step=(0, 90)):
    """An agent at x = 20 m that has to reach 10 m around `goal`."""
    agent = problem(100, 20.0, velocity=velocity, goal=(goal, 0.0), time_step=time_step)
    return world(straight_road(), cars=cars, problems=[agent])


def test_an_agent_that_reaches_its_goal_needs_no_reason():
    assert ended(on_a_road()) == ("goal_reached", "")


def test_a_heading_that_is_not_allowed_is_said_in_degrees():
    scenario = with_goal(on_a_road(), orientation=(np.radians(20.0), np.radians(80.0)))
    # The centre is between 55 and 65 m at 10 m/s, from a start at 20 m.
    assert ended(scenario) == ("goal_missed", "in the goal area from 3.5 to 4.5 s, heading 50° off (30° allowed)")


@pytest.mark.parametrize(
    ("allowed", "words"),
    [((3.0, 9.5), "at 10.0 m/s (at most 9.5 m/s)"), ((10.04, 15.0), "at 10.00 m/s (at least 10.04 m/s)")],
)
def test_a_speed_that_is_not_allowed_is_said_with_the_bound(allowed, words):
    scenario = with_goal(on_a_road(), velocity=allowed)
    assert ended(scenario) == ("goal_missed", f"in the goal area from 3.5 to 4.5 s, {words}")


def test_an_agent_that_comes_too_early_is_told_the_first_admissible_time():
    assert ended(on_a_road(time_step=(60, 90))) == (
        "goal_missed",
        "in the goal area from 3.5 to 4.5 s, before its first admissible time 6.0 s",
    )


def test_an_agent_that_passes_beside_its_goal_is_told_by_how_much():
    agent = problem(100, 20.0, goal=(60.0, 3.5), goal_size=(10.0, 2.5), time_step=(0, 90))
    scenario = world(straight_road(lanes=2), problems=[agent])
    # The area begins 2.25 m beside the centre of its lane.
    missed = "passed the goal area at a distance of 2.2 m at 3.5 s"
    assert ended(scenario) == ("goal_missed", f"{missed}; it did not get from lanelet 1 to lanelet 2 beside it")


def test_being_late_is_said_in_seconds():
    assert ended(on_a_road(time_step=(0, 30))) == (
        "goal_reached_late",
        "reached the goal area at 3.5 s, 0.5 s after its last admissible time 3.0 s",
    )


def test_an_agent_whose_time_is_over_is_told_what_was_left():
    reason = ended(on_a_road(velocity=2.0, time_step=(0, 50)))
    # 20 m, and 2 m/s for 8.5 s, 1.7 times 5 s; the area begins at 55 m.
    assert reason == ("time_limit", "18.0 m before the goal area when the time was over")


def test_a_vehicle_ahead_is_named_only_if_it_holds_the_agent_up():
    # Both drive at 2 m/s, 4.5 m apart; then one drives off at 6 m/s, 15.5 m ahead.
    for car, cause in (
        (Car(310, 29.0, velocity=2.0), "drove behind 310 for 8.5 s; "),
        (Car(310, 40.0, velocity=6.0), ""),
    ):
        reason = ended(on_a_road(car, velocity=2.0, time_step=(0, 50)))
        assert reason == ("time_limit", f"{cause}18.0 m before the goal area when the time was over")


def test_a_stop_behind_a_vehicle_names_it_and_the_seconds():
    scenario = on_a_road(Car(310, 28.0), velocity=0.0, time_step=(0, 40))
    reason = "stood behind 310 for 6.8 s; 35.0 m before the goal area when the time was over"
    assert ended(scenario, Stopping) == ("time_limit", reason)


def test_a_stop_without_a_vehicle_ahead_says_so():
    scenario = on_a_road(Car(310, 10.0), velocity=0.0, time_step=(0, 40))
    reason = "stood for 6.8 s without a vehicle ahead, as planned; 35.0 m before the goal area when the time was over"
    assert ended(scenario, Stopping) == ("time_limit", reason)


@pytest.mark.parametrize(
    ("share", "status", "words"),
    [
        (0.7, "planned", "as quicker plans were rejected: collision with 7"),
        (0.3, "planned", "as planned"),
        # For less than a second in a row, which is no stretch without a safer plan.
        (0.7, "emergency_braking", "as planned"),
    ],
)
def test_quicker_plans_have_to_be_rejected_at_most_of_the_steps_of_a_stop(share, status, words):
    run = simulate(on_a_road(Car(7, 10.0), velocity=0.0, time_step=(0, 40)), planner=Stopping, threads=1)
    is_rejected = np.arange(len(run.plans.status)) % 10 < 10 * share
    plans = replace(
        run.plans,
        status=np.where(is_rejected, PLAN_STATUS.index(status), PLAN_STATUS.index("planned")),
        rejection=tuple("collision with 7" if each else "" for each in is_rejected),
    )
    (reason,) = reasons(replace(run, plans=plans), None)
    assert f"stood for 6.8 s without a vehicle ahead, {words}; 35.0 m before" in reason


def test_times_without_an_admissible_sample_say_what_rejected_most_samples(tmp_path):
    # An oncoming car creeps up to the standing agent, whose front is at 22.3 m.
    scenario = on_a_road(Car(7, 31.0, velocity=0.5, orientation=np.pi), velocity=0.0, time_step=(0, 40))
    run = simulate(scenario, agents=[100], planner="frenet", predictor="constant_velocity", threads=1)
    lasted = r"no safer plan for \d\.\d s \(emergency braking at \d+ time steps\)"
    assert re.search(rf"{lasted}: collision with 7 at \(2\d\.\d, 0\.0\)", run.outcomes.reason[0])
    braking = run.plans.status == PLAN_STATUS.index("emergency_braking")
    assert {run.plans.rejection[row] for row in np.flatnonzero(braking)} == {"collision with 7"}
    assert {run.plans.rejection[row] for row in np.flatnonzero(~braking)} == {""}
    save(run, tmp_path / "run")
    again = load(tmp_path / "run").plans
    assert again.rejection == run.plans.rejection
    np.testing.assert_array_equal(again.rejection_x, run.plans.rejection_x)


def rejecting(rejection, message="no sample can be driven, and full braking leaves the road", overhang=np.nan):
    """A run that ended as infeasible at 3.5 s, after two emergency plans; samples were rejected at each."""
    run = simulate(on_a_road(), planner=Straight, threads=1)
    plans, ended = run.plans, run.outcomes
    status = plans.status.copy()
    status[-3:] = [PLAN_STATUS.index(name) for name in ("emergency_braking", "emergency_braking", "infeasible")]
    last = np.arange(len(status)) >= len(status) - 3
    plans = replace(
        plans,
        status=status,
        rejection=tuple(rejection if each else "" for each in last),
        rejection_x=np.where(last & np.isfinite(overhang), 43.7, np.nan),
        rejection_y=np.where(last & np.isfinite(overhang), 1.9, np.nan),
        rejection_overhang=np.where(last, overhang, np.nan),
    )
    ended = replace(ended, outcome=("infeasible",), message=(message,), time_step=plans.time_step[-1:])
    run = replace(run, plans=plans, outcomes=ended)
    (reason,) = reasons(run, None)
    return replace(run, outcomes=replace(ended, reason=(reason,)))


@pytest.mark.parametrize(
    ("rejection", "words"),
    [
        ("acceleration", "acceleration beyond the vehicle's limit"),
        ("curvature", "curvature beyond the vehicle's limit"),
        ("steering rate", "steering rate beyond the vehicle's limit"),
        ("yaw rate", "yaw rate beyond the vehicle's limit"),
        ("lateral acceleration", "lateral acceleration beyond the vehicle's limit"),
        ("negative speed", "driving backwards"),
        ("left the reference path", "leaving the reference path"),
        ("stop line", "passing a stop line"),
        ("collision with 7", "collision with 7"),
        ("off the road", "off the road"),
    ],
)
def test_what_rejected_samples_is_said_in_words_that_stand_alone(rejection, words):
    run = rejecting(rejection)
    (reason,) = run.outcomes.reason
    assert reason == (
        "no plan after emergency braking at 2 time steps: no sample can be driven, and full braking leaves the road; "
        f"most samples were rejected: {words}"
    )
    braking = [line for line in story(run, 100) if "emergency braking, from" in line]
    assert len(braking) == 1 and braking[0].endswith(f"m/s; most samples were rejected: {words}")
    events = [event.text for event in events_of(run, plans_table(run), None, 1)]
    assert f"100 falls back on an emergency plan; most samples were rejected: {words}" in events
    assert f"100 has no plan (infeasible); most samples were rejected: {words}" in events


def test_the_edge_of_the_road_is_said_with_the_overhang_and_its_place():
    (reason,) = rejecting("off the road", overhang=0.31).outcomes.reason
    assert reason.endswith("; most samples were rejected: off the road, the cheapest by 0.3 m at (43.7, 1.9)")


@pytest.mark.parametrize("message", ["", "  ", "\n"])
@pytest.mark.parametrize("rejection", ["", "curvature"])
def test_no_reason_ends_or_begins_with_a_separator(message, rejection):
    (reason,) = rejecting(rejection, message).outcomes.reason
    assert reason.startswith("no plan after emergency braking at 2 time steps: the planner gave no reason")
    assert reason == reason.strip(" ;:,") and "; ;" not in reason and ": ;" not in reason


def test_participants_that_cross_the_path_of_a_standing_agent_are_named():
    agent = problem(100, -10.0, velocity=0.0, goal=(50.0, 0.0), time_step=(0, 60))
    cars = [Car(7, 0.0, -20.0, 8.0, np.pi / 2), Car(8, 0.0, -40.0, 8.0, np.pi / 2)]
    scenario = world(crossing(), cars=cars, problems=[agent])
    reason = "stood for 10.2 s while 7 and 8 crossed its path; 55.0 m before the goal area when the time was over"
    assert ended(scenario, Stopping) == ("time_limit", reason)


def test_a_run_that_ends_by_its_length_says_so():
    run = simulate(on_a_road(), planner=Straight, settings={"step.max_steps": 20}, threads=1)
    assert run.outcomes.reason == ("15.0 m before the goal area when the run ended after 20 time steps",)


@pytest.mark.parametrize(
    ("car", "words"),
    [
        (Car(37, 40.0, velocity=4.0), "ran into 37 from behind at 6.0 m/s, which replays its recording"),
        (Car(37, 40.0), "ran into 37 from behind at 10.0 m/s, which replays its recording and stood"),
        (Car(83, 0.0, velocity=16.0), "hit from behind by 83 at 6.0 m/s, which replays its recording"),
        (
            Car(12, 60.0, velocity=5.0, orientation=np.pi),
            "frontal collision with 12 at 15.0 m/s, which replays its recording",
        ),
        (
            Car(12, 45.0, -22.0, 10.0, np.pi / 2),
            "ran into the left side of 12 at 14.1 m/s, which replays its recording",
        ),
    ],
)
def test_a_collision_names_the_parts_that_touched(car, words):
    outcome, reason = ended(on_a_road(car, goal=150.0))
    assert (outcome, reason) == ("collision", words)


@pytest.mark.parametrize(
    ("car", "words"),
    [
        (Car(7, 40.0, velocity=-4.0), "hit at its front by reversing 7 at 4.0 m/s, which replays its recording"),
        (Car(7, 0.0, velocity=4.0), "hit from behind by 7 at 4.0 m/s, which replays its recording"),
        (
            Car(7, 20.0, 20.0, -4.0, np.pi / 2),
            "hit on its left side by reversing 7 at 4.0 m/s, which replays its recording",
        ),
        (
            Car(7, 23.0, 20.0, 4.0, -np.pi / 2),
            "hit on its left side by 7 at 4.0 m/s, which replays its recording",
        ),
    ],
    ids=["backward in front", "from behind", "backward at its side", "at its side"],
)
def test_a_standing_agent_is_hit_and_does_not_run_into_anything(car, words):
    assert ended(on_a_road(car, velocity=0.0, goal=150.0)) == ("collision", words)


@pytest.mark.parametrize("dt", [0.1, 0.5, 0.8, 1.0])
def test_a_frontal_collision_is_one_at_every_step_size(dt):
    agent = problem(100, 20.0, velocity=20.0, goal=(190.0, 0.0), time_step=(0, 30))
    oncoming = Car(12, 101.0, velocity=20.0, orientation=np.pi)
    run = simulate(
        world(straight_road(), cars=[oncoming], problems=[agent], steps=30, dt=dt),
        agents=[100],
        planner=Straight,
        threads=1,
    )
    assert run.outcomes.reason[0].startswith("frontal collision with 12 at 40.0 m/s")


@pytest.mark.parametrize("dt", [0.1, 0.5, 1.0])
def test_a_crossing_in_one_long_step_hits_the_side_that_comes_first(dt):
    agent = problem(100, -40.0, velocity=20.0, goal=(90.0, 0.0), time_step=(0, 30))
    crossing_car = Car(12, 0.0, -36.8, 20.0, np.pi / 2)
    run = simulate(
        world(crossing(), cars=[crossing_car], problems=[agent], steps=30, dt=dt),
        agents=[100],
        planner=Straight,
        threads=1,
    )
    assert run.outcomes.reason[0].startswith("ran into the left side of 12")


def test_both_agents_of_a_collision_are_told_their_part():
    problems = [
        problem(100, -40.0, goal=(50.0, 0.0), time_step=(0, 90)),
        problem(200, 0.0, -36.8, orientation=np.pi / 2, goal=(0.0, 50.0), time_step=(0, 90)),
    ]
    run = simulate(world(crossing(), problems=problems), planner=Straight, threads=1)
    # 200 is 3.2 m ahead of 100 on its way to the point where their paths cross: 100 hits its side.
    assert run.outcomes.reason == (
        "ran into the left side of 200 at 14.1 m/s",
        "hit on its left side by 100 at 14.1 m/s",
    )


def test_vehicles_that_meet_side_by_side_have_side_contact():
    car = Car(12, 20.0, 4.0, velocity=np.hypot(10.0, 1.0), orientation=-np.arctan2(1.0, 10.0))
    scenario = world(
        straight_road(lanes=2), cars=[car], problems=[problem(100, 20.0, goal=(150.0, 0.0), time_step=(0, 200))]
    )
    assert ended(scenario) == ("collision", "side contact with 12 at 1.0 m/s, which replays its recording")


def test_an_agent_that_leaves_the_road_is_told_where_and_how_far():
    outcome, reason = ended(on_a_road(goal=150.0), Turning)
    assert outcome == "collision"
    run = simulate(on_a_road(goal=150.0), planner=Turning, threads=1)
    row, column = 0, run.outcomes.time_step[0]
    states = run.states
    angle = states.orientation[row, column]
    # Its front left corner is the furthest outside; the edge is at y = 1.75 m.
    x = states.x[row, column] + 2.254 * np.cos(angle) - 0.805 * np.sin(angle)
    y = states.y[row, column] + 2.254 * np.sin(angle) + 0.805 * np.cos(angle)
    assert reason == f"left the road at ({x:.1f}, {y:.1f}), {y - 1.75:.1f} m beyond its edge"


def test_a_planner_error_is_its_message():
    class Raising(Straight):
        def plan(self, view, predictions):
            raise ValueError("no idea")

    run = simulate(on_a_road(), planner=Raising, threads=1)
    assert run.outcomes.reason == run.outcomes.message
    assert "ValueError: no idea" in run.outcomes.reason[0]


def test_the_whole_traceback_of_a_planner_is_kept_with_its_causes(tmp_path):
    class Raising(Straight):
        def plan(self, view, predictions):
            try:
                return self.chosen([], view)
            except IndexError as error:
                raise ValueError("no idea") from error

        def chosen(self, candidates, view):
            return candidates[0]

    run = simulate(on_a_road(), planner=Raising, threads=1)
    save(run, tmp_path / "run")
    (trace,) = load(tmp_path / "run").outcomes.traceback
    assert trace == run.outcomes.traceback[0]
    places = [
        "in plan",
        "in chosen",
        "return candidates[0]",
        "IndexError",
        "and then",
        "in plan",
        "ValueError: no idea",
    ]
    at = -1
    for place in places:
        at = trace.index(place, at + 1)
    assert story(run, 100)[-1].strip() == "ValueError: no idea"
    with pytest.raises(PlannerContractError, match="ValueError: no idea") as found:
        check_planner(Raising)
    assert isinstance(found.value.__cause__, ValueError)


def test_a_run_that_was_stopped_says_when():
    simulation = Simulation(on_a_road(), planner=Straight, threads=1)
    for _ in range(12):
        simulation.step()
    assert simulation.record().outcomes.reason == ("still driving when the run was stopped at 1.2 s",)


def test_every_outcome_of_a_shipped_scenario_but_goal_reached_has_a_reason():
    outcomes = simulate("t_junction", planner=Straight, threads=1).outcomes
    assert [bool(reason) for reason in outcomes.reason] == [name != "goal_reached" for name in outcomes.outcome]


def test_a_loaded_run_has_the_same_reasons_and_whole_goals(tmp_path):
    conditions = {"orientation": (0.4, 1.2), "velocity": (3.0, 12.5), "time_step": (3, 80)}
    run = simulate(with_goal(on_a_road(), **conditions), planner=Straight, threads=1)
    save(run, tmp_path / "run")
    again = load(tmp_path / "run")
    assert again.outcomes.reason == run.outcomes.reason != ("",)
    stored = again.agents[0].goal[0]
    assert {name: getattr(stored, name) for name in conditions} == conditions
    assert (stored.areas[0].kind, stored.areas[0].center) == ("rectangle", (60.0, 0.0))


def test_bounds_of_a_goal_without_a_limit_are_stored(tmp_path):
    run = simulate(on_a_road(Car(7, 0.0, velocity=10.0)), agents=[7], settings={"goal.velocity_tolerance": np.inf})
    save(run, tmp_path / "run")
    assert [agent.goal[0].velocity for agent in load(tmp_path / "run").agents] == [(0.0, np.inf)]
