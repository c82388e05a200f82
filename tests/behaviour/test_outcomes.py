"""How agents end, each in a world made for it."""

from dataclasses import replace

import numpy as np
import pytest
from drivers import Straight, Turning

from interdrive import InputError, Simulation, SimulationSettings, Trajectory, simulate
from interdrive.testing import Car, crossing, problem, straight_road, world


def outcome_of(scenario, planner=Straight, **options):
    run = simulate(scenario, agents=[100], planner=planner, threads=1, **options)
    assert run.outcomes.agent_id.tolist() == [100]
    return run.outcomes.outcome[0], int(run.outcomes.time_step[0]), run


def test_an_agent_that_is_in_its_goal_within_the_time_reaches_it():
    scenario = world(straight_road(), problems=[problem(100, 20.0, goal=(60.0, 0.0), time_step=(0, 50))])
    # 35 m to the near edge of the 10 m long area at 10 m/s: 3.5 s.
    assert outcome_of(scenario)[:2] == ("goal_reached", 35)


def test_an_agent_that_is_in_its_goal_within_the_grace_period_reaches_it_late():
    scenario = world(straight_road(), problems=[problem(100, 20.0, goal=(60.0, 0.0), time_step=(0, 25))])
    assert outcome_of(scenario)[:2] == ("goal_reached_late", 35)


def test_an_agent_that_is_slower_than_the_grace_period_runs_out_of_time():
    scenario = world(straight_road(), problems=[problem(100, 20.0, goal=(60.0, 0.0), time_step=(0, 20))])
    assert outcome_of(scenario)[:2] == ("time_limit", 34)  # 1.7 * 20


def test_an_agent_that_passes_its_goal_too_early_misses_it():
    scenario = world(straight_road(), problems=[problem(100, 20.0, goal=(60.0, 0.0), time_step=(80, 90))])
    end, time_step, _ = outcome_of(scenario)
    assert end == "goal_missed"
    assert 45 < time_step < 55  # the far edge is 45 m away, at 10 m/s


@pytest.mark.parametrize(("share", "outcome", "lowest"), [(0.9, "goal_reached", 9.0), (np.inf, "goal_missed", 15.0)])
def test_a_recording_far_above_the_limit_makes_a_goal_that_a_lawful_agent_reaches(share, outcome, lowest):
    # It drives 80 m at 20 m/s, where 10 m/s are allowed; with 5 m/s of tolerance that demands 15 m/s.
    road = straight_road()
    road = replace(road, speed_limit=np.full(len(road.ids), 10.0))
    scenario = world(road, cars=[Car(7, 20.0, velocity=20.0, last=40)])
    run = simulate(scenario, agents=[7], settings={"goal.limit_share": share, "goal.time_late": 10.0}, threads=1)
    assert run.agents[0].goal[0].velocity == pytest.approx((lowest, 25.0)), "m/s"
    assert run.outcomes.outcome == (outcome,)


def test_an_agent_that_hits_a_standing_car_collides_with_it_at_its_own_speed():
    scenario = world(
        straight_road(), cars=[Car(7, 60.0)], problems=[problem(100, 20.0, goal=(90.0, 0.0), time_step=(0, 90))]
    )
    end, time_step, run = outcome_of(scenario)
    assert (end, run.outcomes.partner_id[0]) == ("collision", 7)
    assert run.outcomes.impact_speed[0] == pytest.approx(10.0)
    assert time_step == 36  # 40 m apart, footprints 4.508 m and 4.5 m long: contact after 3.55 s


def test_two_agents_that_collide_are_both_gone_from_the_next_step_on():
    problems = [
        problem(100, -40.0, goal=(50.0, 0.0), time_step=(0, 90)),
        problem(
            200, 0.0, -40.0, orientation=np.pi / 2, goal=(0.0, 50.0), goal_orientation=np.pi / 2, time_step=(0, 90)
        ),
    ]
    run = simulate(world(crossing(), problems=problems), planner=Straight, threads=1)
    assert run.outcomes.outcome == ("collision", "collision")
    assert run.outcomes.partner_id.tolist() == [200, 100]
    assert run.outcomes.impact_speed == pytest.approx([np.hypot(10, 10)] * 2)
    assert run.states.n_steps == run.outcomes.time_step[0] + 1


def test_cars_that_cross_between_two_steps_at_fifty_metres_per_second_do_not_tunnel():
    # Half a length and half a width make 3.06 m: car 100 is at the crossing from 0.909 to 1.031 s, car 200 from 0.849
    # to 0.971 s. So they touch for 0.06 s, and at 0.9 s and at 1.0 s they do not.
    problems = [
        problem(100, -48.5, velocity=50.0, goal=(90.0, 0.0), time_step=(0, 90)),
        problem(200, 0.0, -45.5, velocity=50.0, orientation=np.pi / 2, goal=(0.0, 90.0), time_step=(0, 90)),
    ]
    run = simulate(world(crossing(), problems=problems), planner=Straight, threads=1)
    assert run.outcomes.outcome == ("collision", "collision")
    assert run.outcomes.time_step.tolist() == [10, 10]


def test_an_agent_that_leaves_the_lanes_collides_with_the_edge_of_the_road():
    scenario = world(straight_road(), problems=[problem(100, 20.0, goal=(150.0, 0.0), time_step=(0, 90))])
    end, _, run = outcome_of(scenario, Turning)
    assert end == "collision"
    assert run.outcomes.off_road[0]
    assert run.outcomes.partner_id[0] == -1


def test_an_agent_between_two_lanes_with_a_hairline_gap_is_on_the_road():
    road = straight_road(lanes=2)
    moved = (road.left[0] - np.array([0.0, 0.04]), road.left[1])
    road = type(road)(**{**road.__dict__, "left": moved})
    start = problem(100, 20.0, 1.75, goal=(60.0, 1.75), time_step=(0, 50))
    assert outcome_of(world(road, problems=[start]))[0] == "goal_reached"


def test_where_the_map_ends_the_road_goes_on():
    scenario = world(straight_road(100.0), problems=[problem(100, 60.0, goal=(97.0, 0.0), time_step=(34, 36))])
    # At step 35 the centre is at 95 m, the front at 97.3 m; at 99 m it would stick out of the map.
    late = world(straight_road(100.0), problems=[problem(100, 60.0, goal=(99.0, 0.0), time_step=(39, 41))])
    assert outcome_of(scenario)[0] == "goal_reached"
    assert outcome_of(late)[0] == "goal_reached"


def test_an_agent_enters_when_its_planning_problem_starts():
    scenario = world(straight_road(), problems=[problem(100, 20.0, goal=(60.0, 0.0), time_step=(0, 90), start=12)])
    _, time_step, run = outcome_of(scenario)
    assert run.states.valid[0].tolist() == [False] * 12 + [True] * 36
    assert time_step == 47


def test_recorded_cars_in_contact_with_an_agent_at_its_start_count_once_they_have_separated():
    touching = [Car(7, 23.0)]
    scenario = world(
        straight_road(), cars=touching, problems=[problem(100, 20.0, velocity=0.0, goal=(60.0, 0.0), time_step=(0, 20))]
    )
    end, _, run = outcome_of(scenario)
    assert end == "time_limit"
    assert any("overlap when they enter" in note for note in run.notes)


class Raising(Straight):
    def plan(self, view, predictions):
        if view.time_step == 5:
            raise ValueError("no idea")
        return super().plan(view, predictions)


class NotNumbers(Straight):
    def plan(self, view, predictions):
        plan = super().plan(view, predictions)
        plan.x[3] = np.nan
        return plan


class OneShort(Straight):
    def plan(self, view, predictions):
        plan = super().plan(view, predictions)
        return Trajectory(plan.x, plan.y[:-1], plan.orientation, plan.velocity)


class Elsewhere(Straight):
    def plan(self, view, predictions):
        plan = super().plan(view, predictions)
        return Trajectory(plan.x + 3.0, plan.y, plan.orientation, plan.velocity)


@pytest.mark.parametrize(
    ("planner", "time_step", "words"),
    [
        (Raising, 5, "ValueError: no idea"),
        (NotNumbers, 0, "x is not a number at point 3"),
        (OneShort, 0, "y has 30 values, x has 31"),
        (Elsewhere, 0, "starts 3.00 m away"),
        (type("Silent", (), {"plan": lambda *_: None}), 0, "it returned a NoneType"),
    ],
)
def test_a_planner_that_fails_costs_its_own_agent_only(planner, time_step, words):
    problems = [
        problem(100, 20.0, goal=(60.0, 0.0), time_step=(0, 50)),
        problem(200, 20.0, 3.5, goal=(60.0, 3.5), time_step=(0, 50)),
    ]
    scenario = world(straight_road(lanes=2), problems=problems)
    run = simulate(scenario, planner={100: planner, "default": Straight}, threads=1)
    assert run.outcomes.outcome == ("planner_error", "goal_reached")
    assert run.outcomes.time_step[0] == time_step
    assert words in run.outcomes.message[0]
    assert run.outcomes.message[0].startswith("agent 100, planner test_outcomes:")


def test_a_predictor_that_raises_ends_the_run_naming_the_step():
    class Broken:
        def predict(self, scene):
            raise RuntimeError("no weights")

    scenario = world(straight_road(), problems=[problem(100, 20.0, goal=(60.0, 0.0), time_step=(0, 50))])
    with pytest.raises(Exception, match=r"time step 0: test_outcomes\.py:\d+ in predict: RuntimeError: no weights"):
        simulate(scenario, predictor=Broken(), threads=1)


def test_the_world_refuses_plans_of_another_time_step():
    scenario = world(straight_road(), problems=[problem(100, 20.0, goal=(60.0, 0.0), time_step=(0, 50))])
    simulation = Simulation(scenario, threads=1)
    step = simulation.progress.begin_step()
    simulation.step()
    with pytest.raises(Exception, match="plans belong to time step 0, the world is at time step 1"):
        simulation.world.advance(step)


def test_an_impossible_grace_factor_is_refused():
    with pytest.raises(InputError, match="grace_factor: must be between 1 and 1000, not"):
        SimulationSettings(step=type(SimulationSettings().step)(grace_factor=0.5))
