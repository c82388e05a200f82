"""Vehicles that reverse: their speed is negative, and plans, predictions, judgements and stories go by that."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from interdrive import Trajectory, load, read_scenario, save, score, simulate, write_scenario
from interdrive.criticality import collisions, evaluate
from interdrive.results.story import story
from interdrive.scenario import Priorities, StopLine
from interdrive.testing import Car, check_planner, crossing, problem, straight_road, world

NATIVE = ("rollout", "frenet", "idm", "lawful", "idm_mobil")


class Reversing:
    """Brakes, reverses `seconds` at `speed`, and stands; with `curvature` of the rear axle's path [1/m]."""

    speed, seconds, curvature = 1.5, 4.0, 0.0
    rate = 2.0

    def plan(self, view, predictions):
        ego, dt = view.ego, view.dt
        back = view.time_step * dt < self.seconds
        wanted = -self.speed if back else 0.0
        way = np.sign(wanted - ego.velocity)
        velocity = ego.velocity + way * np.minimum(self.rate * dt * np.arange(31), abs(wanted - ego.velocity))
        driven = np.concatenate([[0.0], np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) * dt)])
        axle = ego.vehicle.rear_axle_to_center
        heading = ego.orientation + self.curvature * driven
        middle = heading[:-1] + 0.5 * np.diff(heading)
        x = np.concatenate([[0.0], np.cumsum(np.diff(driven) * np.cos(middle))])
        y = np.concatenate([[0.0], np.cumsum(np.diff(driven) * np.sin(middle))])
        x += ego.x + axle * (np.cos(heading) - math.cos(ego.orientation))
        y += ego.y + axle * (np.sin(heading) - math.sin(ego.orientation))
        return Trajectory(x, y, heading, velocity)


class Far(Reversing):
    """Reverses to the end."""

    seconds = 100.0


class Standing(Reversing):
    """Stands."""

    seconds = 0.0


class Keeping(Reversing):
    """Keeps its speed."""

    def plan(self, view, predictions):
        self.speed, self.seconds = -view.ego.velocity, 100.0
        return super().plan(view, predictions)


def reversing(scenario, planner=Reversing, **more):
    """A run in which agent 100 reverses."""
    return simulate(scenario, agents=[100], planner={100: planner}, threads=1, **more)


def on_a_road(*cars, x=60.0, velocity=0.0, goal=100.0, time_step=(0, 60), road=None):
    agent = problem(100, x, velocity=velocity, goal=(goal, 0.0), time_step=time_step)
    return world(road or straight_road(), cars=cars, problems=[agent], steps=60)


def states(run, number=100):
    """Its x [m] and speed [m/s] at all time steps."""
    row = int(np.searchsorted(run.states.participant_id, number))
    return run.states.x[row], run.states.velocity[row]


def recorded(number, x, *speeds, steps=100):
    """A recorded car with speeds [m/s] for so many time steps each; the last one lasts."""
    scenario = world(straight_road(), cars=[Car(number, x)], steps=steps)
    every = [speed for speed, n in speeds[:-1] for _ in range(n)]
    speed = np.array([*every, *[speeds[-1]] * (steps + 1 - len(every))])[None]
    place = x + np.concatenate([[0.0], np.cumsum(0.1 * speed[0, :-1])])[None]
    return replace(scenario.obstacles, x=place, velocity=speed)


# What is driven.


@pytest.mark.parametrize("curvature", [0.0, 0.15])
def test_a_plan_that_reverses_is_driven_and_the_agent_goes_back_along_its_path(curvature):
    class Steered(Reversing):
        pass

    Steered.curvature = curvature
    road = straight_road(lanes=3, lane_width=8.0)
    run = reversing(on_a_road(x=100.0, goal=180.0, road=road), Steered)
    x, velocity = states(run)
    assert run.outcomes.outcome[0] == "time_limit"
    assert velocity.min() == pytest.approx(-1.5)
    # 1.5² / 2 m to become as fast, the rest at 1.5 m/s, and as much to stop: 4 s of reversing.
    assert 4.8 < 100.0 - x[~np.isnan(x)][-1] < 6.3
    row = int(np.searchsorted(run.states.participant_id, 100))
    moved = np.diff(np.unwrap(run.states.orientation[row, :35]))
    assert moved == pytest.approx(0.1 * curvature * 0.5 * (velocity[1:35] + velocity[:34]), abs=1e-3)


def test_a_plan_that_moves_forwards_but_states_a_negative_speed_is_refused():
    class Contradicting(Reversing):
        def plan(self, view, predictions):
            found = super().plan(view, predictions)
            return Trajectory(2.0 * view.ego.x - found.x, found.y, found.orientation, found.velocity)

    run = reversing(on_a_road(), Contradicting)
    assert run.outcomes.outcome[0] == "planner_error"
    assert "but states -" in run.outcomes.message[0]


def test_the_contract_of_planners_admits_one_that_reverses():
    assert "an empty road" in check_planner(Far)


@pytest.mark.parametrize("planner", [*NATIVE, "pdm", "velocity_adjusting"])
def test_an_agent_that_rolls_backwards_at_first_brakes_and_then_drives_to_its_goal(planner):
    scenario = on_a_road(velocity=-3.0, time_step=(0, 300))
    if planner == "velocity_adjusting":
        scenario = replace(scenario, planning_problems=(), obstacles=recorded(100, 60.0, (-3.0, 10), 6.0))
    run = simulate(scenario, agents=[100], planner=planner, threads=1)
    x, velocity = states(run)
    assert velocity[0] == -3.0
    # Braking takes no more than a second, and no agent reverses by itself.
    assert velocity[10:][~np.isnan(velocity[10:])].min() > -0.1
    # At comfortable 3 m/s² that takes 1.5 m.
    assert 58.4 < np.nanmin(x) < 60.0
    assert run.outcomes.outcome[0] == "goal_reached"


# What others see.


@pytest.mark.parametrize("planner", NATIVE)
@pytest.mark.parametrize("distance", [25.0, 40.0])
def test_an_agent_stops_before_a_car_that_reverses_towards_it(planner, distance):
    obstacles = recorded(2, 60.0 + distance, (-2.0, 50), 0.0)
    scenario = replace(on_a_road(velocity=8.0, goal=180.0, time_step=(0, 100)), obstacles=obstacles)
    run = simulate(scenario, agents=[100], planner=planner, threads=1)
    x, velocity = states(run)
    assert run.outcomes.outcome[0] != "collision"
    # When the car has come 10 m nearer and stands, from bumper to bumper.
    assert abs(velocity[50]) < 0.3
    assert 0.5 < 60.0 + distance - 10.0 - 4.5 - x[50] < 7.0


@pytest.mark.parametrize("predictor", ["constant_velocity", "lane_following", "neural"])
def test_what_reverses_is_predicted_to_go_on_backwards(predictor):
    scenario = on_a_road(Car(2, 90.0, velocity=-2.0))
    seen = []

    class Seeing(Reversing):
        def plan(self, view, predictions):
            seen.append((view.velocity[0, -1], predictions.of(view.ids)))
            return super().plan(view, predictions)

    reversing(scenario, Seeing, predictor=predictor)
    velocity, found = seen[5]
    assert velocity == found.velocity[0, 0, 0] == pytest.approx(-2.0)
    assert found.probability[0].max() == pytest.approx(1.0)
    assert found.x[0, 0, 29] == pytest.approx(89.0 - 6.0, abs=0.1)
    assert found.orientation[0, 0, 29] == pytest.approx(0.0)


@pytest.mark.parametrize("service", ["cam", "mcm", "cpm"])
def test_messages_of_an_agent_that_reverses_out_of_sight_tell_its_sign_and_that_it_goes_on_backwards(service):
    seen = []

    class Hearing(Standing):
        def plan(self, view, predictions):
            if 100 in view.ids:
                row = view.ids.tolist().index(100)
                seen.append((view.time_step, view.x[row, -1], view.velocity[row, -1], predictions.of(np.array([100]))))
            return super().plan(view, predictions)

    # Agent 1 sees 30 m far; only agent 2, between both, sees agent 100.
    others = [
        problem(number, x, velocity=0.0, goal=(190.0, 0.0), time_step=(0, 60)) for number, x in ((1, 130.0), (2, 100.0))
    ]
    scenario = on_a_road(x=85.0)
    scenario = replace(scenario, planning_problems=(*scenario.planning_problems, *others))
    settings = {f"v2x.{name}": name == service for name in ("cam", "mcm", "cpm")} | {"view.sensor_radius": 30.0}
    speakers = {1: True, 2: service == "cpm", 100: service != "cpm"}
    planner = {1: Hearing, 2: Standing, 100: Far}
    run = simulate(scenario, agents=[1, 2, 100], planner=planner, settings=settings, v2x=speakers, threads=1)
    x, velocity = states(run)
    time_step, told_x, told_velocity, found = next(one for one in seen if one[0] >= 30)
    assert velocity[time_step] == told_velocity == pytest.approx(-1.5)
    assert told_x == pytest.approx(x[time_step], abs=0.2)
    assert found.velocity[0, 0, 29] == pytest.approx(-1.5)
    assert found.x[0, 0, 29] == pytest.approx(x[time_step] - 4.5, abs=0.2)


@pytest.mark.parametrize("planner", [Reversing, Standing])
def test_an_agent_that_reverses_before_a_junction_is_given_no_order_and_does_not_hold_up_others(planner):
    class Obeying(planner):
        obeys_rules = True

    there = problem(1, 0.0, -45.0, 8.0, 0.5 * np.pi, goal=(0.0, 60.0), goal_size=(3.5, 10.0), time_step=(0, 200))
    here = problem(100, -7.0, velocity=0.0, goal=(60.0, 0.0), time_step=(0, 60))
    signs = Priorities(ranks=((1, (2, 2, 2)),))
    scenario = replace(world(crossing(), problems=[there, here], steps=60), priorities=signs)
    run = simulate(scenario, agents=[1, 100], planner={1: "rollout", 100: Obeying}, threads=1)
    orders = run.orders
    # It reverses from the second time step on, for 4 s.
    told = (orders.agent_id == 100) & (orders.first_time_step <= 10) & (orders.last_time_step >= 10)
    assert told.any() == (planner is Standing)
    assert run.outcomes.outcome[0] == "goal_reached"
    assert states(run, 1)[1][:30].min() > 7.0


# How it is judged.


def test_an_agent_that_reverses_into_a_standing_car_is_told_so_and_at_fault_and_one_that_stands_is_not():
    run = reversing(on_a_road(Car(2, 52.0)), Far)
    assert run.outcomes.reason[0] == "reversed into 2 at 1.5 m/s, which replays its recording and stood"
    found = score(run)
    assert (found.fault[0], found.fault_kind[0]) == (True, "reversed")
    assert found.why(100).startswith("at fault: reversed into 2")
    hit = simulate(on_a_road(Car(2, 68.0, velocity=-2.0)), agents=[100], planner=Standing, threads=1)
    assert hit.outcomes.reason[0] == "hit at its front by reversing 2 at 2.0 m/s, which replays its recording"
    assert not score(hit).fault[0]


def test_two_that_close_in_have_the_relative_speed_of_both_in_impact_and_harm():
    run = reversing(on_a_road(Car(2, 40.0, velocity=3.0)), Far)
    assert run.outcomes.impact_speed[0] == pytest.approx(4.5, abs=0.01)
    assert collisions(run).relative_speed[0] == pytest.approx(4.5, abs=0.01)
    assert run.outcomes.reason[0].startswith("hit from behind by 2 while reversing")


def test_the_time_to_collision_with_a_leader_that_reverses_counts_both_speeds_and_its_own_is_infinite():
    run = reversing(on_a_road(Car(2, 100.0, velocity=-2.0), Car(3, 30.0), velocity=4.0), Keeping)
    found = evaluate(run)
    # 35.5 m between the bumpers.
    assert found.series["ttc"].value[0, 0] == pytest.approx(35.5 / 6.0, abs=1e-3)
    assert found.series["thw"].value[0, 0] == pytest.approx(35.5 / 4.0, abs=1e-3)
    back = evaluate(reversing(on_a_road(Car(2, 80.0), Car(3, 30.0), velocity=-1.0), Far))
    assert np.isinf(back.series["ttc"].value[0, :5]).all()
    assert np.isinf(back.series["thw"].value[0, :5]).all()
    assert (back.series["btn"].value[0, :5] == 0.0).all()
    assert back.series["msd"].value[0, 0] == pytest.approx(1.0 / 23.0)


def test_reversing_in_the_own_lane_is_no_driving_on_the_wrong_side_but_may_be_too_fast():
    class Fast(Far):
        speed, rate = 6.0, 4.0

    road = replace(straight_road(), speed_limit=np.array([3.0]))
    run = reversing(on_a_road(x=100.0, goal=150.0, road=road), Fast)
    assert set(run.violations.rule) == {"speeding"}
    assert run.violations.value[0] == pytest.approx(3.0, abs=0.01)
    found = score(run, panel="none")
    assert found.terms["gate_direction"][0] == 1.0
    assert found.terms["gate_speed"][0] < 0.5


def test_reversing_is_comfortable_by_the_same_bounds_and_what_speeds_up_backwards_does_not_brake():
    class Hard(Far):
        speed, rate = 4.0, 3.5

    started = score(reversing(on_a_road(x=100.0, goal=180.0), Hard), panel="none")
    assert started.terms["comfort_term"][0] == 0.0
    assert "comfort 0: acceleration 3." in started.why(100), "2.4 m/s² are allowed, but 4.05 for braking"
    assert score(reversing(on_a_road(x=100.0, goal=180.0), Far), panel="none").terms["comfort_term"][0] == 1.0


def test_a_stop_line_that_is_crossed_backwards_is_no_violation_and_holds_again_afterwards():
    line = StopLine(1, np.array([[61.0, 1.75], [61.0, -1.75]]), (), has_stop_sign=True)
    run = reversing(replace(on_a_road(), stop_lines=(line,)))
    assert len(run.violations.rule) == 0

    class Again(Reversing):
        speed, seconds = 1.5, 3.0

        def plan(self, view, predictions):
            if view.time_step >= 45:
                self.seconds, self.speed = 100.0, -6.0
            return super().plan(view, predictions)

    run = reversing(replace(on_a_road(), stop_lines=(line,)), Again)
    assert states(run)[1].max() > 2.0
    assert list(run.violations.rule) == ["stop_sign"]


# What is read of recordings.


@pytest.mark.parametrize(("velocity", "tolerance"), [(-6.0, 5.0), (-1.0, 5.0), (-0.1, 5.0), (0.0, 5.0), (-0.15, 0.1)])
def test_the_goal_of_a_recorded_car_has_the_speed_with_which_it_ends(velocity, tolerance):
    scenario = replace(world(straight_road()), obstacles=recorded(7, 160.0, (5.0, 50), (-6.0, 50), velocity))
    run = simulate(scenario, agents=[7], planner="recorded", settings={"goal.velocity_tolerance": tolerance}, threads=1)
    least, most = run.agents[0].goal[0].velocity
    assert least <= most
    if velocity < -0.2:
        assert (least, most) == pytest.approx((velocity - tolerance, velocity + tolerance))
    else:
        assert least == 0.0


def test_no_agent_of_the_t_junction_backs_out_behind_a_car_that_gives_way_with_its_wheels_turned():
    # 2001 stands for 5 s behind 1006, which has begun to turn: there would be room beside it after a way back.
    run = simulate("t_junction", predictor="lane_following")
    assert np.nanmin(run.states.velocity) > -0.1  # m/s


def test_a_recorded_car_that_reverses_in_between_is_replayed_to_its_goal():
    scenario = replace(world(straight_road()), obstacles=recorded(7, 60.0, (6.0, 40), (-6.0, 10), 6.0))
    run = simulate(scenario, agents=[7], planner="recorded", threads=1)
    assert run.outcomes.outcome[0] == "goal_reached"
    assert states(run, 7)[1].min() == -6.0


def test_a_heading_that_a_file_leaves_out_is_against_the_motion_where_the_speed_is_negative(tmp_path):
    write_scenario(world(straight_road(), cars=[Car(2, 90.0, velocity=-2.0)], steps=20), tmp_path / "scenario.xml")
    text = re.sub(
        r"(<state>.*?)<orientation>.*?</orientation>", r"\1", (tmp_path / "scenario.xml").read_text(), flags=re.DOTALL
    )
    (tmp_path / "scenario.xml").write_text(text)
    assert np.abs(read_scenario(tmp_path / "scenario.xml").obstacles.orientation[0]).max() < 1e-6


# How it is told.


def test_a_story_says_that_an_agent_reversed_and_its_figure_shows_it(tmp_path):
    run = reversing(on_a_road())
    told = story(run, 100)
    assert "    0.0 to   4.7 s  reversing, from 0.0 to 0.1 m/s, at most 1.5 m/s" in told
    figure = run.plot("velocity")
    assert figure.axes[0].get_ylim()[0] < -1.5


def test_a_run_that_reverses_is_stored_and_repeated_with_its_signs(tmp_path):
    run = reversing(on_a_road(Car(2, 90.0, velocity=-2.0)))
    save(run, tmp_path / "run")
    again = load(tmp_path / "run")
    assert np.array_equal(states(again)[1], states(run)[1], equal_nan=True)
    assert states(again)[1].min() == pytest.approx(-1.5)
    write_scenario(run.scenario, tmp_path / "scenario.xml")
    stored = read_scenario(tmp_path / "scenario.xml")
    assert stored.obstacles.velocity[0, 3] == -2.0
    assert stored.obstacles.orientation[0, 3] == 0.0
