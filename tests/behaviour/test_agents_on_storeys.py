"""Agents on storeys of their own drive as if they were alone; vehicles that come down to their storey count there."""

from dataclasses import replace

import numpy as np
import pytest
from recorded_drives import recorded
from storeys import EAST, NORTH, drive, line, ramp, road

import interdrive as idr
from interdrive import envs
from interdrive.testing import problem, world

GROUND = problem(9, -60.0, velocity=10.0, goal=(80.0, 0.0), time_step=(0, 400))
ABOVE = problem(11, 0.0, -60.0, 10.0, np.pi / 2, goal=(0.0, 80.0), goal_orientation=np.pi / 2, time_step=(0, 400))


def speeds(run, number=9):
    row = run.states.participant_id.tolist().index(number)
    return run.states.velocity[row][run.states.valid[row]]


def crossing_roads(height, *problems):
    return world(road((line(EAST), 0.0), (line(NORTH), height)), problems=problems)


@pytest.mark.parametrize("planner", ["rollout", "frenet", "idm", "idm_mobil"])
@pytest.mark.parametrize("settings", [{}, {"v2x.penetration": 1.0, "v2x.negotiate": True}], ids=["sensors", "v2x"])
def test_agents_one_above_the_other_drive_as_if_alone(planner, settings):
    def run(height, *problems):
        scenario = crossing_roads(height, *problems)
        return idr.simulate(scenario, planner=planner, settings=settings, threads=1)

    both, alone = run(7.0, GROUND, ABOVE), run(7.0, GROUND)
    assert set(both.outcomes.outcome) == {"goal_reached"}
    assert speeds(both).tolist() == speeds(alone).tolist()
    assert speeds(both, 11).tolist() == speeds(run(7.0, ABOVE), 11).tolist()
    assert min(speeds(run(0.0, GROUND, ABOVE)).min(), speeds(run(0.0, GROUND, ABOVE), 11).min()) < 9.0


def climbing():
    """A road on the ground, and one that leaves beside it and crosses it at a height of 8 m."""
    ground = line(EAST, -150.0, 150.0)
    angle = np.linspace(0.0, np.pi, 60)
    bend = np.column_stack([-20.0 + 40.0 * np.sin(angle), 0.0 + 40.0 * np.cos(angle)])
    up = np.vstack([np.linspace([-150.0, 40.0], [-20.0, 40.0], 60)[:-1], bend])
    across = np.linspace(up[-1], up[-1] + [-100.0, 0.0], 30)[1:]
    way = np.vstack([up, across])
    height = np.interp(np.arange(len(way)), [0, 72, 88, len(way) - 1], [0.0, 0.0, 8.0, 8.0])
    return ground, way, height


@pytest.mark.parametrize("planner", ["rollout", "idm"])
def test_who_is_seen_on_the_ground_and_expected_on_the_bridge_is_not_in_the_way(planner):
    ground, way, height = climbing()
    lanes = road((ground, 0.0), (way, height))
    agent = problem(9, -60.0, velocity=10.0, goal=(130.0, 0.0), time_step=(0, 400))
    climber = recorded(lanes, {7: drive(way, 111.0, 10.0, 150)})
    with_it = idr.simulate(
        replace(climber, planning_problems=(agent,)), agents=[9], planner=planner, threads=1,
        predictor="ground_truth",
    )  # fmt: skip
    alone = idr.simulate(world(lanes, problems=[agent]), agents=[9], planner=planner, threads=1)
    assert with_it.outcomes.outcome == alone.outcomes.outcome == ("goal_reached",)
    assert speeds(with_it)[:60].tolist() == speeds(alone)[:60].tolist()


def test_who_comes_down_a_ramp_is_met_on_the_ground():
    lanes, _, down = ramp()
    length = np.hypot(*np.diff(down, axis=0).T).sum() - 160.0
    agent = problem(9, 90.0, velocity=10.0, goal=(260.0, 0.0), time_step=(0, 600))
    comer = recorded(lanes, {7: drive(down, length - 45.0, 8.0, 250)})
    scenario = replace(comer, planning_problems=(agent,))
    run = idr.simulate(scenario, agents=[9], planner="idm", threads=1)
    assert run.outcomes.outcome == ("goal_reached",)
    assert speeds(run).min() < 9.0  # it follows the car that has come down
    assert np.nanmin(run.criticality()["dce"]) > 0.5


def test_learners_neither_observe_nor_are_rewarded_for_what_is_above_them():
    def episode(height, *cars):
        lanes = road((line(EAST), 0.0), (line(-EAST), height))
        scenario = recorded(lanes, {7: drive(line(-EAST), 60.0, steps=60)}) if cars else world(lanes, steps=60)
        scenario = replace(scenario, planning_problems=(GROUND,))
        settings = {"reward.headway": -1.0, "observation.predictions": True}
        env = envs.DriveEnv(scenarios=scenario, learners=[9], **settings)
        seen, rewards = [env.reset(seed=0)[0]], []
        for _ in range(30):
            observation, reward, *_ = env.step(np.zeros(2, np.float32))
            seen.append(observation)
            rewards.append(reward)
        return np.array(seen), rewards

    (seen, rewards), (alone, rewards_alone) = episode(7.0, 7), episode(7.0)
    assert np.array_equal(seen, alone)
    assert rewards == rewards_alone
    assert not np.array_equal(episode(2.0, 7)[0], alone)


def test_who_is_further_up_the_own_slope_is_seen():
    way = line(EAST, 0.0, 300.0)
    agent = problem(9, 20.0, velocity=10.0, goal=(250.0, 0.0), time_step=(0, 400))
    scenario = replace(
        recorded(road((way, 0.1 * way[:, 0])), {7: drive(way, 70.0, 3.0, 300)}), planning_problems=(agent,)
    )
    run = idr.simulate(scenario, agents=[9], planner="idm", threads=1)
    assert run.criticality()["hw"][0, 0] == pytest.approx(50.0 - 4.5, abs=0.1)
    assert np.nanmin(run.criticality()["hw"]) > 1.0
