"""Runs in which nothing moves any more, and runs in which something still can."""

import re
from dataclasses import replace

import numpy as np
import pytest
from drivers import Straight

import interdrive as idr
from interdrive import Simulation, Trajectory, load, save, simulate
from interdrive.report.events import events_of
from interdrive.results.story import story
from interdrive.results.tables import plans_table
from interdrive.scenario import StopLine, TrafficLight
from interdrive.testing import Car, crossing, problem, straight_road, world

#: Goals count until 326 s: 1.7 times 191.8 s.
LAST = 1918
LIMIT = 3260


def agent(number=100, x=20.0, velocity=10.0, goal=(150.0, 0.0), time_step=(0, LAST), **more):
    return problem(number, x, velocity=velocity, goal=goal, time_step=time_step, **more)


def road(*problems, cars=(), static=True, steps=100):
    """One lane along x with these agents, and cars that stand for ever or replay `steps` time steps of 0.1 s."""
    scenario = world(straight_road(), cars=cars, problems=problems or [agent()], steps=steps)
    standing = np.full(len(cars), static)
    return replace(scenario, obstacles=replace(scenario.obstacles, is_static=standing))


def walled(*problems):
    """The lane is closed at x = 60 m."""
    return road(*problems, cars=[Car(7, 60.0)])


def drive(scenario, planner="idm", **options):
    options = {"predictor": "constant_velocity", "threads": 1} | options
    return simulate(scenario, agents="problems", planner=planner, **options)


def ends(run):
    """Outcome and time [s] of each agent."""
    outcomes = run.outcomes
    return {
        number: (outcome, 0.1 * step)
        for number, outcome, step in zip(
            outcomes.agent_id.tolist(), outcomes.outcome, outcomes.time_step.tolist(), strict=True
        )
    }


class Polite:
    """Accelerates by 1 m/s² unless another vehicle is within 20 m."""

    def plan(self, view, predictions):
        ego, time = view.ego, np.arange(31) * view.dt
        near = np.hypot(view.x[:, -1] - ego.x, view.y[:, -1] - ego.y) < 20.0
        rate = 0.0 if near.any() else 1.0
        way = ego.velocity * time + 0.5 * rate * time**2
        return Trajectory(
            ego.x + way * np.cos(ego.orientation),
            ego.y + way * np.sin(ego.orientation),
            np.full_like(time, ego.orientation),
            ego.velocity + rate * time,
        )


@pytest.mark.parametrize("planner", ["idm", "rollout"])
def test_an_agent_that_stands_before_a_wall_for_a_minute_ends_the_run_with_a_reason(planner):
    run = drive(walled(), planner)
    outcome, time = ends(run)[100]
    still = np.flatnonzero(run.states.velocity[1] >= 0.05)[-1]
    assert outcome == "time_limit"
    assert time == pytest.approx(0.1 * still + 60.0, abs=5.0), "s"
    x = run.states.x[1, -1]
    said = rf"had stood at \({x:.1f}, 0\.0\) for 60\.0 s; its time would have been up at 326\.0 s"
    assert re.search(f"m before the goal area when nothing moved any more: it {said}", run.outcomes.reason[0])
    assert re.match(r"behind 7 for \d+\.\d s, standing for 6\d\.\d s; ", run.outcomes.reason[0])
    assert run.notes[0].startswith(f"the run ended at {time:.1f} s because nothing moved any more (step.standstill_s)")
    assert run.finished


def test_the_story_of_an_agent_says_that_nothing_moved_any_more():
    run = drive(walled())
    assert "nothing moved any more" in story(run, 100)[0]


def test_saved_runs_and_reports_say_it_too(tmp_path):
    run = drive(walled())
    save(run, tmp_path / "run")
    again = load(tmp_path / "run")
    assert again.outcomes.reason == run.outcomes.reason
    told = [event.text for event in events_of(again, plans_table(again), None, 1)]
    assert told[-1] == "100 ends, as nothing moves any more"


@pytest.mark.parametrize(("seconds", "expected"), [(10.0, 10.0), (100.0, 100.0)])
def test_the_time_is_a_setting(seconds, expected):
    run = drive(road(agent(velocity=0.0)), Straight, settings={"step.standstill_s": seconds})
    # Nothing is recorded; the first judged state is that of the first step.
    assert ends(run)[100] == ("time_limit", pytest.approx(expected, abs=0.11)), "s"


def test_without_the_setting_an_agent_stands_until_its_time_is_up():
    run = drive(walled(), settings={"step.standstill_s": np.inf})
    assert ends(run)[100] == ("time_limit", pytest.approx(0.1 * LIMIT))
    assert "nothing moved" not in run.outcomes.reason[0]


def test_a_time_of_nothing_is_refused():
    with pytest.raises(idr.InputError, match="standstill_s"):
        drive(walled(), settings={"step.standstill_s": 0.0})


def test_two_agents_that_let_each_other_go_first_end_together():
    eastward = problem(1, -10.0, velocity=0.0, goal=(50.0, 0.0), time_step=(0, LAST))
    northward = problem(2, 0.0, -10.0, 0.0, np.pi / 2, goal=(0.0, 50.0), goal_size=(3.5, 10.0), time_step=(0, LAST))
    alone, both = (drive(world(crossing(), problems=some), Polite) for some in ([eastward], [eastward, northward]))
    assert alone.outcomes.outcome == ("goal_reached",)
    assert ends(both) == {1: ("time_limit", pytest.approx(60.1)), 2: ("time_limit", pytest.approx(60.1))}, "s"


def test_an_agent_that_waits_90_s_at_a_red_light_goes_on_when_it_is_green():
    line = StopLine(1, np.array([[100.0, 1.75], [100.0, -1.75]]), ((1, (5,)),))
    light = TrafficLight(5, (("red", 1000), ("green", 300)))
    run = drive(replace(road(agent(x=70.0, velocity=5.0)), traffic_lights=(light,), stop_lines=(line,)), "rollout")
    stood = 0.1 * (np.abs(run.states.velocity[0]) < 0.05).sum()
    assert stood > 85.0, "s"
    assert run.outcomes.outcome == ("goal_reached",)


def test_a_light_that_is_red_for_ever_releases_nobody():
    line = StopLine(1, np.array([[100.0, 1.75], [100.0, -1.75]]), ((1, (5,)),))
    light = TrafficLight(5, (("red", 400), ("red", 600)))
    outcome, time = ends(
        drive(replace(road(agent(x=70.0, velocity=5.0)), traffic_lights=(light,), stop_lines=(line,)), "rollout")
    )[100]
    assert outcome == "time_limit"
    assert time < 80.0, "s"


def test_the_cycle_of_a_light_comes_on_top():
    light = TrafficLight(5, (("red", 300), ("green", 200)))
    scenario = replace(road(agent(velocity=0.0)), traffic_lights=(light,))
    assert ends(drive(scenario, Straight))[100] == ("time_limit", pytest.approx(110.0, abs=0.11)), "s"


def test_an_agent_behind_a_replayed_vehicle_that_leaves_after_100_s_goes_on():
    scenario = road(cars=[Car(7, 60.0)], static=False, steps=1000)
    run = drive(scenario)
    assert run.outcomes.outcome == ("goal_reached",)


def test_the_recording_of_another_vehicle_must_be_over():
    scenario = road(agent(velocity=0.0), cars=[Car(7, 100.0, last=300)], static=False, steps=900)
    # The car is there until 30 s.
    assert ends(drive(scenario, Straight))[100] == ("time_limit", pytest.approx(90.0, abs=0.31)), "s"


def test_a_replayed_vehicle_that_is_still_to_come_keeps_the_run_going():
    scenario = road(
        agent(velocity=0.0), cars=[Car(7, 100.0, velocity=5.0, first=900, last=950)], static=False, steps=950
    )
    assert ends(drive(scenario, Straight))[100] == ("time_limit", pytest.approx(155.0, abs=0.31)), "s"


def test_an_agent_that_is_still_to_enter_keeps_the_run_going():
    late = agent(2, 100.0, goal=(170.0, 0.0), time_step=(800, 1000), start=800)
    run = drive(road(agent(1, velocity=0.0), late), Straight)
    found = ends(run)
    assert found[2] == ("goal_reached", pytest.approx(86.5, abs=0.5))
    # A minute after the other one has ended.
    assert found[1] == ("time_limit", pytest.approx(found[2][1] + 60.0, abs=0.11))


def test_an_agent_in_its_goal_that_waits_for_its_time_reaches_it():
    early = agent(velocity=0.0, goal=(20.0, 0.0), time_step=(900, 950))
    assert ends(drive(road(early), Straight))[100] == ("goal_reached", pytest.approx(90.0))


def test_an_agent_whose_goal_counts_only_later_may_wait_for_it():
    early = agent(velocity=0.0, time_step=(900, LAST))
    assert ends(drive(road(early), Straight))[100] == ("time_limit", pytest.approx(150.0, abs=0.11)), "s"


@pytest.mark.parametrize("velocity", [0.02, 0.2])
def test_an_agent_that_creeps_does_not_stand(velocity):
    run = drive(road(agent(velocity=velocity)), Straight)
    assert ends(run)[100] == ("time_limit", pytest.approx(0.1 * LIMIT))


def test_an_agent_that_still_drives_keeps_the_others():
    run = drive(road(agent(1, velocity=0.0), agent(2, 60.0, velocity=0.5, goal=(170.0, 0.0))), Straight)
    found = ends(run)
    assert found[2] == ("goal_reached_late", pytest.approx(210.0, abs=0.2))
    assert found[1] == ("time_limit", pytest.approx(found[2][1] + 60.0, abs=0.11))


def test_who_only_replays_its_own_recording_may_go_on_in_it():
    # Stands for 80 s, then drives.
    scenario = road(cars=[Car(7, 20.0)], static=False, steps=1000)
    x = scenario.obstacles.x.copy()
    x[0, 800:] += 0.5 * np.arange(201)
    velocity = np.where(np.arange(1001) < 800, 0.0, 5.0)[None]
    scenario = replace(scenario, obstacles=replace(scenario.obstacles, x=x, velocity=velocity), planning_problems=())
    run = simulate(scenario, agents=[7], planner="recorded", predictor="constant_velocity", threads=1)
    assert run.outcomes.outcome == ("goal_reached",)


def test_a_run_without_a_standstill_has_the_bits_that_it_has_without_the_setting():
    with_it, without = (
        simulate("t_junction", planner="idm", settings={"step.standstill_s": seconds}, threads=1)
        for seconds in (60.0, np.inf)
    )
    assert with_it.digest == without.digest
    assert with_it.outcomes.reason == without.outcomes.reason


def test_the_states_until_the_end_are_those_of_the_longer_run():
    short, whole = (drive(walled(), settings={"step.standstill_s": seconds}) for seconds in (60.0, np.inf))
    np.testing.assert_array_equal(short.states.x, whole.states.x[:, : short.states.n_steps])


@pytest.mark.parametrize("threads", [2, 8])
def test_the_end_depends_neither_on_threads_nor_on_the_order_of_agents(threads):
    def stands(*numbers, threads):
        problems = [agent(number, 20.0 + 10.0 * place, velocity=0.0) for place, number in enumerate(numbers)]
        return drive(road(*problems, cars=[Car(9, 60.0)]), threads=threads)

    one, other = stands(1, 2, 3, threads=1), stands(1, 2, 3, threads=threads)
    assert one.digest == other.digest
    assert one.outcomes.reason == other.outcomes.reason
    assert {end for end, _ in ends(stands(3, 2, 1, threads=1)).values()} == {"time_limit"}


def test_stepping_by_hand_ends_where_a_run_does():
    simulation = Simulation(walled(), agents="problems", planner="idm", predictor="constant_velocity", threads=1)
    while not simulation.is_done:
        simulation.step()
    ended = simulation.time_step
    simulation.step()
    assert simulation.time_step == ended
    assert simulation.record().digest == drive(walled()).digest


@pytest.mark.parametrize(("end", "limit"), [(4000, 6800), (10_000, 17_000), (2**31 - 1, 20_000)])
def test_the_time_of_a_goal_minutes_beyond_the_recording_is_that_of_the_file(end, limit):
    scenario = road(agent(velocity=0.0, time_step=(0, end)), steps=10)
    simulation = Simulation(scenario, agents="problems", planner=Straight, threads=1)
    assert simulation.world.last_time_step == limit


def test_an_agent_is_not_late_within_the_time_of_its_file_however_long_that_is():
    # 125 m at 0.2 m/s, 6250 time steps.
    slow = agent(velocity=0.2, time_step=(0, 6500))
    assert ends(drive(road(slow, steps=10), Straight, settings={"record.violations": False}))[100] == (
        "goal_reached",
        pytest.approx(625.0, abs=1.0),
    )
