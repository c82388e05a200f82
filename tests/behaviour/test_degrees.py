"""The degrees of interaction: what `recorded`, `velocity_adjusting`, `idm` and `idm_mobil` do in small worlds."""

from dataclasses import replace

import numpy as np
import pytest

from interdrive import (
    AgentSettings,
    Idm,
    IdmMobil,
    InputError,
    Simulation,
    SimulationSettings,
    VelocityAdjusting,
    read_scenario,
    simulate,
)
from interdrive.config.plugins import DEFAULT_PLANNER
from interdrive.planners import NATIVE
from interdrive.testing import CAR, Car, crossing, problem, straight_road, world
from recordings import along_x, braking, only, with_recordings

LENGTH = CAR.length
ANY_VEHICLE = SimulationSettings(agents=AgentSettings(min_displacement=0.0))
REPLAYING = ("recorded", "velocity_adjusting")


def track(run, agent_id, field="x"):
    """A field of a participant's states while it is there."""
    row = int(np.searchsorted(run.states.participant_id, agent_id))
    return getattr(run.states, field)[row, run.states.valid[row]]


def gaps(run, leader, follower):
    """Bumper to bumper along x, while both are there."""
    rows = [int(np.searchsorted(run.states.participant_id, i)) for i in (leader, follower)]
    both = run.states.valid[rows].all(axis=0)
    ahead, behind = run.states.x[rows[0], both], run.states.x[rows[1], both]
    return ahead - behind - LENGTH


def follow(kind, velocity, gap, leader_velocities, **options):
    """A run in which agent 2 follows recorded car 1 on a long road, both at `velocity` at first."""
    road, steps = straight_road(2000.0), len(leader_velocities) - 1
    tracks = {1: along_x(20.0 + gap + LENGTH, leader_velocities)}
    if kind in REPLAYING:
        tracks[2] = along_x(20.0, np.full(steps + 1, velocity))
        scenario = with_recordings(road, tracks)
    else:
        goal = problem(2, 20.0, velocity=velocity, goal=(1900.0, 0.0), time_step=(0, steps // 2))
        scenario = with_recordings(road, tracks, (goal,))
    return simulate(scenario, agents=[2], planner=kind, settings=ANY_VEHICLE, threads=1, **options)


# --- braking in time ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["idm", "idm_mobil", "velocity_adjusting", "rollout"])
def test_a_car_keeps_a_safe_gap_at_any_speed_when_its_leader_brakes_at_8_metres_per_second_squared(kind):
    for velocity in range(41):
        run = follow(kind, float(velocity), 2.0 + velocity, braking(velocity, 8.0, 20, 200))
        assert run.outcomes.outcome[0] != "collision", velocity
        assert gaps(run, 1, 2).min() > 0.2, velocity
        assert track(run, 2, "velocity")[len(track(run, 1)) - 1] < 0.3, velocity


def test_idm_stops_one_minimum_gap_behind_a_standing_car():
    scenario = world(
        straight_road(400.0),
        cars=[Car(1, 150.0)],
        problems=[problem(2, 20.0, velocity=15.0, goal=(300.0, 0.0), time_step=(0, 200))],
        steps=350,
    )
    run = simulate(scenario, agents=[2], planner=Idm(minimum_gap=3.0), threads=1)
    # A driver of the model closes the last part of the gap ever more slowly, or stops a little too near.
    assert 2.5 < gaps(run, 1, 2)[-1] < 3.7
    assert track(run, 2, "velocity")[-1] < 0.1
    assert track(run, 2, "acceleration").min() > -4.0


def test_idm_follows_at_its_time_gap():
    run = follow(Idm(time_gap=1.8), 12.0, 40.0, np.full(401, 8.0))
    # Equilibrium of the model far below the desired speed: s0 + v T, a little more because the desired speed is finite.
    assert gaps(run, 1, 2)[-1] == pytest.approx(2.0 + 8.0 * 1.8, abs=1.0)
    assert track(run, 2, "velocity")[-1] == pytest.approx(8.0, abs=0.1)


def test_idm_arrives_in_time_in_the_middle_of_its_lane():
    scenario = world(straight_road(), problems=[problem(2, 20.0, 0.6, goal=(110.0, 0.0), time_step=(80, 110))])
    run = simulate(scenario, agents=[2], planner="idm", threads=1)
    assert run.outcomes.outcome == ("goal_reached",)
    assert abs(track(run, 2, "y")[-1]) < 0.1
    assert np.abs(np.diff(track(run, 2, "velocity"))).max() / 0.1 < 2.0


def test_idm_keeps_the_speed_limit():
    road = straight_road(400.0)
    road = replace(road, speed_limit=np.full(len(road.ids), 8.0))
    scenario = world(road, problems=[problem(2, 20.0, velocity=12.0, goal=(380.0, 0.0), time_step=(0, 150))])
    velocity = track(simulate(scenario, planner="idm", threads=1), 2, "velocity")
    assert velocity[80:].max() < 8.4
    assert velocity[-1] > 7.0


# --- recorded -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["highway/USA_US101-23_1_T-1", "merge/ZAM_Zip-1_56_T-1", "urban/DEU_Muc-12_1_T-1"])
def test_recorded_replays_the_recording_to_the_bit(scenarios_folder, name):
    scenario = read_scenario(scenarios_folder / f"{name}.xml")
    run = simulate(scenario, agents=_recorded_agents(scenario), planner="recorded", threads=1)
    for agent in run.outcomes.agent_id:
        row, recorded = (
            int(np.searchsorted(run.states.participant_id, agent)),
            int(np.searchsorted(scenario.obstacles.ids, agent)),
        )
        n = min(run.states.n_steps, scenario.obstacles.n_steps)
        both = run.states.valid[row, :n] & scenario.obstacles.valid[recorded, :n]
        assert both.sum() > 1
        for field in ("x", "y", "orientation", "velocity"):
            ours, theirs = getattr(run.states, field)[row, :n], getattr(scenario.obstacles, field)[recorded, :n]
            assert np.array_equal(ours[both], theirs[both]), (agent, field)


def _recorded_agents(scenario):
    all_ids = [agent.id for agent in Simulation(scenario, threads=1).agents]
    return [i for i in all_ids if i in scenario.obstacles.ids][:25]


def test_beyond_its_end_a_recording_goes_on_along_the_lane_with_its_last_speed():
    # The recording ends after 3 s with 12 m/s, 0.8 m beside the middle of the lane.
    tracks = {2: along_x(20.0, np.linspace(9.0, 12.0, 31), y=0.8)}
    for kind in REPLAYING:
        goal = problem(9, 20.0, 0.8, velocity=9.0, goal=(120.0, 0.0), time_step=(0, 150))
        scenario = with_recordings(straight_road(300.0), tracks, (goal,))
        run = simulate(scenario, agents=[2], planner=kind, threads=1)
        x, y, velocity = (track(run, 2, field) for field in ("x", "y", "velocity"))
        assert len(x) > 45, kind
        assert velocity[31:] == pytest.approx(12.0, abs=0.1), kind
        assert np.abs(np.diff(x[30:]) - 1.2).max() < 0.02, kind
        assert abs(y[-1]) < 0.3, kind


@pytest.mark.parametrize("kind", REPLAYING)
def test_an_agent_without_recording_is_left_to_the_default_and_refused_if_it_was_named(kind):
    agent = problem(60000, 20.0, goal=(110.0, 0.0), time_step=(0, 110))
    scenario = world(straight_road(300.0), cars=[Car(7, 150.0, velocity=10.0)], problems=[agent])
    run = simulate(scenario, agents=[7, 60000], planner=kind, threads=1)
    assert run.outcomes.planner == (kind, DEFAULT_PLANNER)
    assert f"agent 60000 has no recording for planner {kind}: {DEFAULT_PLANNER} drives it" in run.notes
    assert run.settings["planner"] == {"7": kind, "60000": DEFAULT_PLANNER}
    with pytest.raises(InputError, match=f"agent 60000 has no recording, which planner {kind} needs"):
        simulate(scenario, planner={60000: kind}, threads=1)


# --- velocity_adjusting ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name",
    [
        "highway/USA_US101-23_1_T-1",
        "t_junction/ZAM_Tjunction-1_42_T-1",
        "urban/DEU_Muc-12_1_T-1",
        "merge/ZAM_Zip-1_56_T-1",
    ],
)
def test_alone_on_the_road_a_velocity_adjusting_car_drives_its_recording(scenarios_folder, name):
    scenario = read_scenario(scenarios_folder / f"{name}.xml")
    for agent in _recorded_agents(scenario)[:12]:
        alone = only(scenario, agent)
        run = simulate(alone, agents=[agent], planner="velocity_adjusting", threads=1)
        n = min(run.states.n_steps, alone.obstacles.n_steps)
        both = run.states.valid[0, :n] & alone.obstacles.valid[0, :n]
        offset = np.hypot(
            run.states.x[0, :n] - alone.obstacles.x[0, :n], run.states.y[0, :n] - alone.obstacles.y[0, :n]
        )
        assert offset[both].max() < 0.5, agent


def test_a_velocity_adjusting_car_brakes_for_an_agent_that_crosses_its_path_and_resumes_its_speed():
    # Both would be at the crossing after 5 s; the agent from the south keeps its speed whatever happens.
    n = 140
    across = along_x(0.0, np.full(n + 1, 10.0))
    across = across | {"x": 0.0 * across["x"], "y": across["x"] - 50.0, "orientation": across["x"] * 0.0 + np.pi / 2}
    tracks = {5: along_x(-50.0, np.full(n + 1, 10.0)), 7: across}
    scenario = with_recordings(crossing(150.0), tracks)
    run = simulate(scenario, agents=[5, 7], planner={5: VelocityAdjusting(), 7: "recorded"}, threads=1)
    assert "collision" not in run.outcomes.outcome
    velocity, x = track(run, 5, "velocity"), track(run, 5)
    assert velocity.min() < 9.0
    passed = int(np.argmax(x > 5.0))
    assert passed > 55  # 5.5 s would be undisturbed
    assert np.diff(velocity[passed:]).min() > -0.05
    assert velocity[-1] > 9.5
    assert track(run, 5, "y") == pytest.approx(0.0, abs=0.05)


def test_a_velocity_adjusting_car_ignores_traffic_that_crosses_long_before_or_after_it():
    n = 100
    for start in (-95.0, -5.0):
        across = along_x(0.0, np.full(n + 1, 10.0))
        across = across | {
            "x": 0.0 * across["x"],
            "y": across["x"] + start,
            "orientation": across["x"] * 0.0 + np.pi / 2,
        }
        scenario = with_recordings(crossing(150.0), {5: along_x(-50.0, np.full(n + 1, 10.0)), 7: across})
        run = simulate(scenario, agents=[5], planner="velocity_adjusting", threads=1)
        assert track(run, 5, "velocity") == pytest.approx(10.0, abs=0.3), start


def _with_a_stop():
    """10 m/s, a stop of 4 s from 5 s on, 10 m/s again."""
    stop = np.concatenate([np.full(31, 10.0), np.linspace(10.0, 0.0, 21)[1:], np.zeros(40), np.linspace(0.0, 10.0, 41)])
    return np.concatenate([stop, np.full(60, 10.0)])


def test_a_velocity_adjusting_car_waits_where_it_stood_until_it_left():
    velocity = _with_a_stop()
    recorded = along_x(20.0, velocity)
    run = simulate(
        with_recordings(straight_road(500.0), {2: recorded}), agents=[2], planner="velocity_adjusting", threads=1
    )
    x = track(run, 2)
    n = min(len(x), len(recorded["x"]))
    assert x[:n] == pytest.approx(recorded["x"][:n], abs=0.3)


def test_a_velocity_adjusting_car_that_is_late_does_not_wait_longer_and_does_not_catch_up():
    # A recorded car stands in its way 20 m after the start for 12 s: longer than the recorded stop would have lasted.
    velocity = _with_a_stop()
    tracks = {
        1: {name: values[:121] for name, values in along_x(45.0, np.zeros(200)).items()},
        2: along_x(20.0, velocity),
    }
    run = simulate(with_recordings(straight_road(500.0), tracks), agents=[2], planner="velocity_adjusting", threads=1)
    x, speed = track(run, 2), track(run, 2, "velocity")
    assert speed[100] < 0.1
    assert x[100] < 45.0 - LENGTH
    stop = tracks[2]["x"][70]
    # It passes the place of the recorded stop without waiting there, and is never faster than recorded.
    near = np.abs(x - stop) < 1.0
    assert 0 < near.sum() < 30
    assert speed.max() < 10.2
    assert x[150] < tracks[2]["x"][150] - 20.0


# --- idm_mobil ------------------------------------------------------------------------------------------------------


def overtaking(planner, cars, *, lanes=2, goal_y=0.0, goal_x=900.0, steps=400, velocity=20.0, y=0.0):
    """A run of agent 100 on a road of parallel lanes among recorded cars."""
    scenario = world(
        straight_road(1200.0, lanes=lanes),
        cars=cars,
        problems=[problem(100, 50.0, y, velocity=velocity, goal=(goal_x, goal_y), time_step=(0, steps))],
        steps=steps,
    )
    return simulate(scenario, agents=[100], planner=planner, threads=1)


def test_idm_mobil_overtakes_a_slow_leader_when_the_left_lane_is_free_and_comes_back():
    run = overtaking("idm_mobil", [Car(1, 110.0, velocity=8.0)])
    x, y = track(run, 100), track(run, 100, "y")
    assert run.outcomes.outcome == ("goal_reached",)
    assert y.max() > 3.2
    assert y[-1] == pytest.approx(0.0, abs=0.3)
    assert x[-1] > track(run, 1)[len(x) - 1] + 50.0
    # One way out, one way back.
    lane = np.round(y / 3.5)
    assert np.count_nonzero(np.diff(lane)) == 2


def test_idm_follows_the_slow_leader_that_idm_mobil_overtakes():
    run = overtaking("idm", [Car(1, 110.0, velocity=8.0)])
    assert np.abs(track(run, 100, "y")).max() < 0.05
    assert gaps(run, 1, 100).min() > 2.0


def test_idm_mobil_stays_while_a_faster_car_approaches_from_behind_in_the_left_lane():
    run = overtaking("idm_mobil", [Car(1, 80.0, velocity=12.0), Car(2, 15.0, 3.5, velocity=32.0)], velocity=14.0)
    y = track(run, 100, "y")
    left = int(np.argmax(y > 1.0))
    # It leaves its lane only after the fast car has passed.
    assert left > 0
    assert track(run, 2)[left] > track(run, 100)[left] + LENGTH
    assert "collision" not in run.outcomes.outcome


def test_idm_mobil_is_polite_if_asked():
    # A change that would make the car behind in the left lane brake a little is worth it for an egoist only.
    cars = [Car(1, 95.0, velocity=13.0), Car(2, 10.0, 3.5, velocity=17.0)]

    def change_time(planner):
        y = track(overtaking(planner, cars, velocity=15.0), 100, "y")
        return int(np.argmax(y > 1.75)) if y.max() > 1.75 else len(y)

    assert change_time(IdmMobil(politeness=0.0)) < change_time(IdmMobil(politeness=1.0))


@pytest.mark.parametrize("lanes_away", [1, 2])
def test_idm_mobil_reaches_the_lane_of_its_goal_in_traffic(lanes_away):
    # A platoon in every lane; the goal lies in a lane to the left.
    cars = [Car(10 * lane + i, 20.0 + 40.0 * i, 3.5 * lane, velocity=12.0) for lane in (1, 2) for i in range(6)]
    run = overtaking(
        "idm_mobil", cars, lanes=3, goal_x=400.0, goal_y=3.5 * lanes_away, velocity=12.0, steps=500
    )  # fmt: skip
    assert run.outcomes.outcome[0] in ("goal_reached", "goal_reached_late"), run.outcomes
    assert track(run, 100, "y")[-1] == pytest.approx(3.5 * lanes_away, abs=1.0)


def test_a_lane_change_is_smooth_and_takes_its_duration():
    run = overtaking(IdmMobil(lane_change_duration=5.0), [Car(1, 110.0, velocity=8.0)])
    y, yaw_rate, velocity = (track(run, 100, field) for field in ("y", "yaw_rate", "velocity"))
    start, end = int(np.argmax(y > 0.02)), int(np.argmax(y > 3.48))
    assert 35 <= end - start <= 55
    lateral_acceleration = np.abs(yaw_rate * velocity)
    # 5.77 * 3.5 m / (5 s)² = 0.81 m/s² for the quintic
    assert lateral_acceleration[start:end].max() < 1.2
    assert np.abs(np.diff(yaw_rate)).max() / 0.1 < 0.15


# --- all of them ----------------------------------------------------------------------------------------------------

#: A policy needs a file.
KINDS = tuple(kind for kind in NATIVE if kind != "policy")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["highway/USA_US101-23_1_T-1", "intersection/USA_Lanker-2_8_T-1"])
def test_reactive_vehicles_start_exactly_at_their_recorded_initial_state(scenarios_folder, kind, name):
    scenario = read_scenario(scenarios_folder / f"{name}.xml")
    agents = _recorded_agents(scenario)[:8]
    simulation = Simulation(scenario, agents=agents, planner=kind, threads=1)
    simulation.step()
    simulation.step()
    run = simulation.record()
    row_of = {agent: int(np.searchsorted(scenario.obstacles.ids, agent)) for agent in agents}
    from_the_start = [agent for agent, row in row_of.items() if scenario.obstacles.valid[row, 0]]
    assert from_the_start
    for agent in from_the_start:
        row, recorded = int(np.searchsorted(run.states.participant_id, agent)), row_of[agent]
        for field in ("x", "y", "orientation", "velocity"):
            assert getattr(run.states, field)[row, 0] == getattr(scenario.obstacles, field)[recorded, 0], (agent, field)
        # No jump afterwards: the first two steps are as long as the speeds say.
        moved = np.hypot(np.diff(run.states.x[row, :3]), np.diff(run.states.y[row, :3]))
        speeds = 0.5 * (run.states.velocity[row, :2] + run.states.velocity[row, 1:3])
        if kind != "recorded":
            assert moved == pytest.approx(speeds * scenario.dt, abs=0.05), agent


@pytest.mark.parametrize("kind", ["velocity_adjusting", "idm", "idm_mobil"])
def test_the_number_of_threads_changes_nothing(scenarios_folder, kind):
    scenario = read_scenario(scenarios_folder / "t_junction/ZAM_Tjunction-1_42_T-1.xml")
    agents = _recorded_agents(scenario)
    digests = {simulate(scenario, agents=agents, planner=kind, threads=threads).digest for threads in (1, 2, 8)}
    assert len(digests) == 1


@pytest.mark.parametrize("kind", ["rollout", "frenet", "idm", "idm_mobil"])
def test_agents_that_do_not_replay_a_recording_do_not_know_it(kind):
    """The recorded future of the agent itself and of others is changed: until then nothing is different."""

    def states(brakes, drives_on):
        tracks = {
            1: along_x(60.0, braking(10.0, 4.0, 40, 150) if brakes else np.full(151, 10.0)),
            2: along_x(20.0, np.full(151, 12.0)),
        }
        # The same goal, whatever the own recording says after 4 s.
        tracks[2] = tracks[2] if drives_on else tracks[2] | {"y": np.where(np.arange(151) < 40, 0.0, 1.0)}
        goal = (problem(2, 20.0, velocity=12.0, goal=(170.0, 0.0), time_step=(0, 150)),)
        scenario = with_recordings(straight_road(400.0, lanes=2), tracks, goal)
        run = simulate(scenario, agents=[2], planner=kind, threads=1)
        row = int(np.searchsorted(run.states.participant_id, 2))
        return np.stack([getattr(run.states, field)[row, :41] for field in ("x", "y", "velocity")])

    reference = states(False, True)
    assert np.array_equal(reference, states(True, True))
    assert np.array_equal(reference, states(False, False))


@pytest.mark.parametrize("kind", ["idm", "idm_mobil"])
def test_two_that_meet_at_a_crossing_both_arrive(kind):
    for head_start in (-4.0, -1.0, 0.0, 0.5, 3.0):
        problems = [
            problem(100, -50.0 + head_start, goal=(60.0, 0.0), time_step=(0, 200)),
            problem(
                200, 0.0, -50.0, orientation=np.pi / 2, goal=(0.0, 60.0), goal_orientation=np.pi / 2, time_step=(0, 200)
            ),
        ]
        run = simulate(world(crossing(), problems=problems), planner=kind, threads=1)
        assert run.outcomes.outcome == ("goal_reached", "goal_reached"), head_start


@pytest.mark.parametrize("kind", ["idm", "idm_mobil"])
def test_an_agent_that_stands_at_the_very_edge_of_its_lane_starts_at_once(kind):
    scenario = world(
        straight_road(200.0, lanes=2),
        problems=[problem(2, 20.0, -1.75, velocity=0.0, goal=(80.0, 0.0), time_step=(0, 200))],
    )
    run = simulate(scenario, planner=kind, threads=1)
    assert track(run, 2)[10] > 20.3
    assert run.outcomes.outcome[0] in ("goal_reached", "goal_reached_late")
    assert abs(track(run, 2, "y")[-1]) < 0.2


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Idm(time_gap=0.0), r"time_gap: must be positive"),
        (lambda: Idm(desired_velocity_max=-1.0), "desired_velocity_max: must be positive"),
        (lambda: VelocityAdjusting(minimum_gap=-1.0), "minimum_gap: must be between"),
        (lambda: IdmMobil(politeness=float("nan")), "politeness: must be between"),
        (lambda: IdmMobil(lane_change_duration=0.1), "lane_change_duration: must be between"),
    ],
)
def test_an_impossible_parameter_is_refused_by_its_name(make, words):
    with pytest.raises(InputError, match=words):
        make()
