"""Goals without the recorded time, agents that begin to plan in the middle of a recording, or wait to enter."""

import json
from dataclasses import replace

import numpy as np
import pytest

import interdrive as idr
from interdrive import InputError
from interdrive.scenario import Lanelets
from interdrive.scenario.known_goals import Temperament, desired_speed
from interdrive.testing import Car, straight_road, world


def _changing(lanes=2, steps=100):
    """A car that changes from the right lane to the left one after 3 s, and two others ahead of it."""
    scenario = world(
        straight_road(600.0, lanes),
        cars=[Car(11, 20.0, 0.0, 15.0), Car(12, 80.0, 0.0, 18.0), Car(13, 60.0, 3.5, 22.0)],
        steps=steps,
    )
    y = scenario.obstacles.y.copy()
    y[0] = np.clip((np.arange(steps + 1) - 30) / 20.0, 0.0, 1.0) * 3.5
    return replace(scenario, obstacles=replace(scenario.obstacles, y=y))


def _simulation(scenario, **settings):
    named = {name.replace("__", "."): value for name, value in settings.items()}
    return idr.Simulation(scenario, agents=[11], planner="idm", settings=named, threads=1)


def test_what_an_agent_knows_decides_about_its_lane_and_its_time():
    lanes = {}
    for information in ("timed", "place", "route", "turns"):
        agent = _simulation(_changing(), goal__information=information).agents[0]
        lanes[information] = agent.route.lane_changes
        knows_time = agent.goal[0].velocity != (0.0, 40.0)
        assert knows_time == (information == "timed"), information
    assert lanes == {"timed": 1, "place": 1, "route": 1, "turns": 0}


def test_a_run_without_the_time_ends_with_the_recording_and_can_be_repeated(tmp_path):
    path = tmp_path / "road.xml"
    idr.write_scenario(_changing(), path)
    run = idr.simulate(path, agents=[11], planner="idm", settings={"goal.information": "turns"})
    assert run.outcomes.outcome[0] == "goal_reached"
    assert run.outcomes.time_step[0] == 100
    run.save(tmp_path / "run")
    stored = json.loads((tmp_path / "run" / "run.json").read_text())
    assert stored["settings"]["settings"]["goal.information"] == "turns"


def test_an_agent_that_drives_on_is_done_where_the_map_ends():
    scenario = world(straight_road(200.0), cars=[Car(11, 20.0, 0.0, 15.0)], steps=300, name="short")
    valid = scenario.obstacles.valid.copy()
    valid[:, 60:] = False
    tables = {
        name: np.where(valid, getattr(scenario.obstacles, name), np.nan)
        for name in ("x", "y", "orientation", "velocity", "acceleration", "yaw_rate")
    }
    scenario = replace(scenario, obstacles=replace(scenario.obstacles, valid=valid, **tables))
    run = _simulation(scenario, goal__information="turns").run()
    assert run.outcomes.outcome[0] == "goal_reached"
    assert 100 <= run.outcomes.time_step[0] <= 140


def _forking():
    """Lanes 1 and 2, side by side, part at x = 100 m: 1 goes on straight as 3, 2 bends away to the left as 4."""
    x, y = np.linspace(0.0, 100.0, 21), np.linspace(100.0, 200.0, 21)

    def bound(along, aside):
        return np.column_stack([along, aside + 0.0 * along])

    away = 3.5 + 40.0 * ((y - 100.0) / 100.0) ** 2
    return Lanelets(
        ids=np.array([1, 2, 3, 4]),
        left=(bound(x, 1.75), bound(x, 5.25), bound(y, 1.75), bound(y, away + 1.75)),
        right=(bound(x, -1.75), bound(x, 1.75), bound(y, -1.75), bound(y, away - 1.75)),
        predecessors=((), (), (1,), (2,)), successors=((3,), (4,), (), ()),
        adjacent_left=np.array([2, -1, -1, -1]), adjacent_left_same_direction=np.array([True, False, False, False]),
        adjacent_right=np.array([-1, 1, -1, -1]), adjacent_right_same_direction=np.array([False, True, False, False]),
        speed_limit=np.full(4, np.nan), types=((),) * 4,
    )  # fmt: skip


def test_an_agent_that_leaves_the_map_on_another_way_than_its_own_is_done_there():
    scenario = world(_forking(), cars=[Car(11, 20.0, 0.0, 15.0, last=60), Car(12, 60.0, 0.0, 1.0)], steps=300)
    planner = "idm_mobil,safe_deceleration=0.5,changing_threshold=0"
    run = idr.simulate(scenario, agents=[11], planner=planner, settings={"goal.information": "turns"}, threads=1)
    row = run.states.participant_id.tolist().index(11)
    assert np.nanmax(run.states.y[row]) > 30.0
    assert np.nanmax(run.states.x[row]) < 200.0
    assert run.outcomes.time_step[0] < 250


def test_the_desired_speed_is_that_of_the_traffic_around_or_the_own_one():
    scenario = _changing()
    assert desired_speed(scenario, 0, 0, np.inf, Temperament()) == 20.0
    assert desired_speed(scenario, 0, 0, np.inf, Temperament(free_weight=0.5, desired_factor=1.1)) == pytest.approx(
        1.1 * 17.5
    )
    assert desired_speed(scenario, 2, 0, np.inf, Temperament()) == 22.0
    assert desired_speed(scenario, 2, 0, 13.9, Temperament()) == 13.9
    standing = world(straight_road(200.0), cars=[Car(11, 20.0)])
    assert desired_speed(standing, 0, 0, np.inf, Temperament()) == 5.0


def test_an_agent_replays_until_it_plans():
    scenario = _changing()
    simulation = _simulation(scenario, agents__plan_from=2.0, goal__information="turns")
    assert simulation.agents[0].initial_state.time_step == 20
    run = simulation.run()
    row = run.states.participant_id.tolist().index(11)
    assert run.states.x[row, :21].tolist() == scenario.obstacles.x[0, :21].tolist()
    assert run.plans.time_step.min() == 20
    assert not np.allclose(run.states.x[row, 40:60], scenario.obstacles.x[0, 40:60], atol=1e-3)


def test_a_run_in_which_agents_replay_first_is_loaded_as_it_was_saved(tmp_path):
    path = tmp_path / "road.xml"
    idr.write_scenario(_changing(), path)
    settings = {"agents.plan_from": 2.0, "goal.information": "turns"}
    run = idr.simulate(path, agents=[11], planner="idm", settings=settings)
    run.save(tmp_path / "run")
    loaded = idr.load(tmp_path / "run")
    assert loaded.digest == run.digest
    assert [agent.start_time_step for agent in loaded.agents] == [20]


def test_a_vehicle_that_has_left_by_then_cannot_be_an_agent():
    scenario = world(straight_road(300.0), cars=[Car(11, 20.0, 0.0, 15.0, last=30), Car(12, 60.0, 0.0, 15.0)])
    simulation = idr.Simulation(scenario, planner="idm", settings={"agents.plan_from": 5.0})
    assert [agent.id for agent in simulation.agents] == [12]
    with pytest.raises(InputError, match=r"agent 11: has left by agents.plan_from \(5 s\)"):
        idr.Simulation(scenario, agents=[11], planner="idm", settings={"agents.plan_from": 5.0})


def test_the_first_acceleration_is_that_of_the_past_whatever_the_recording_states():
    scenario = _changing()
    obstacles = scenario.obstacles
    acceleration, velocity = obstacles.acceleration.copy(), obstacles.velocity.copy()
    acceleration[:], velocity[0] = -2.5, 15.0 + 0.1 * np.arange(101)
    scenario = replace(scenario, obstacles=replace(obstacles, acceleration=acceleration, velocity=velocity))
    known = _simulation(scenario, agents__plan_from=2.0).agents[0]
    assert known.initial_state.acceleration == pytest.approx(1.0)
    assert _simulation(scenario, goal__information="turns").agents[0].initial_state.acceleration == 0.0
    assert _simulation(scenario).agents[0].initial_state.acceleration == -2.5


def test_an_agent_that_finds_no_room_does_not_enter_and_says_so():
    cars = [Car(11, 20.0, 0.0, 15.0, first=10), Car(12, 26.0, 0.0, 0.0)]
    scenario = world(straight_road(300.0), cars=cars)
    run = _simulation(scenario, step__entry_wait=2.0).run()
    assert run.outcomes.outcome[0] == "time_limit"
    assert run.outcomes.reason[0] == "found no room to enter within 2 s"
    assert not any("the run ended" in note for note in run.notes)
    assert not run.states.valid[run.states.participant_id.tolist().index(11)].any()


@pytest.mark.parametrize(("x", "y", "orientation"), [(14.9, 0.0, 0.0), (20.0, 2.0, 0.0), (20.0, 3.4, -0.15)])
def test_an_agent_enters_neither_at_the_bumper_of_another_vehicle_nor_beside_one_that_comes_over(x, y, orientation):
    # One metre behind the agent's place, 20 cm beside it, or on its way from the next lane: at step 10 it is there.
    there = Car(12, x - 15.0 * np.cos(orientation), y - 15.0 * np.sin(orientation), 15.0, orientation)
    scenario = world(straight_road(300.0, 2), cars=[Car(11, 20.0, 0.0, 15.0, first=10), there])
    run = _simulation(scenario, step__entry_wait=4.0).run()
    assert run.outcomes.outcome[0] != "collision"
    present = run.states.valid[run.states.participant_id.tolist().index(11)]
    assert 10 < np.flatnonzero(present)[0] < 50


def test_the_time_of_a_goal_begins_when_an_agent_that_waited_has_entered():
    # The place is taken until step 30.
    cars = [Car(11, 20.0, 0.0, 15.0, first=10), Car(12, 22.0, 0.0, 0.0, last=29)]
    scenario = world(straight_road(300.0), cars=cars)
    soon, late = (_simulation(scenario, step__entry_wait=wait).agents[0] for wait in (0.0, 4.0))
    assert soon.goal[0].time_step == late.goal[0].time_step
    run = _simulation(scenario, step__entry_wait=4.0).run()
    (agent,) = run.agents
    assert agent.start_time_step == 30
    assert agent.goal[0].time_step[1] == late.goal[0].time_step[1] + 20
    assert run.outcomes.outcome == ("goal_reached",)


def test_impossible_settings_are_refused():
    for settings, words in (
        ({"goal.information": "all"}, "goal.information"),
        ({"agents.plan_from": -1.0}, "agents.plan_from: must be at least 0"),
        ({"step.entry_wait": -1.0}, "entry_wait"),
    ):
        with pytest.raises(InputError, match=words):
            idr.simulate(_changing(), agents=[11], planner="idm", settings=settings)
