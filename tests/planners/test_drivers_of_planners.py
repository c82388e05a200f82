"""What drivers are to planners: `view.ego.driver` in Python, noise and the place in the lane of native ones."""

import json
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
import pytest

import interdrive as idr
from interdrive import InputError, Trajectory
from interdrive.config.drivers import read_drivers
from interdrive.testing import Car, check_planner, straight_road, world
from interdrive.testing.planner_contract import PlannerContractError

FILE = """
format = 1
[parameters.time_gap]
median = 1.4
sd = 0.2
[driver]
noise = 0.3
noise_length = 2.0
time_gap_kept = 0.5
"""


def cruise(view, speed):
    """Straight on at a speed, within reach of the present one [m/s]."""
    ego, t = view.ego, view.dt * np.arange(31)
    v = ego.velocity + np.clip(speed - ego.velocity, -2.0 * t, 2.0 * t)
    way = np.concatenate(([0.0], np.cumsum(0.5 * view.dt * (v[1:] + v[:-1]))))
    heading = np.full(31, ego.orientation)
    return Trajectory(ego.x + way * np.cos(heading), ego.y + way * np.sin(heading), heading, v)


@dataclass
class Hurried:
    """The shorter its time gap, the faster."""

    parallel = False

    def plan(self, view, predictions):
        return cruise(view, 12.0 / view.ego.driver.get("time_gap", 1.0))


class Parallel(Hurried):
    parallel = True


class Careless:
    def plan(self, view, predictions):
        return cruise(view, 12.0 / view.ego.driver["time_gap"])


class Meddling:
    def plan(self, view, predictions):
        if view.ego.driver:
            view.ego.driver["time_gap"] = 0.1
        return cruise(view, 10.0)


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(FILE)
    return str(path)


@pytest.fixture(scope="module")
def road():
    return world(straight_road(400.0, lanes=3), cars=[Car(11 + i, 30.0, 3.5 * i, 10.0) for i in range(3)])


def test_a_planner_in_python_sees_what_its_driver_has_drawn(road, file):
    seen = {}

    class Looking:
        def plan(self, view, predictions):
            seen[view.ego.id] = view.ego.driver
            return cruise(view, 10.0)

    idr.simulate(road, planner={"planner": Looking, "drivers": file}, seed=3, settings={"step.max_steps": 2})
    assert {i: dict(driver) for i, driver in seen.items()} == {i: read_drivers(file).values(3, i) for i in seen}
    assert {driver["noise"] for driver in seen.values()} == {0.3}
    assert len({driver["noise_seed"] for driver in seen.values()}) == 3
    assert "time_gap_kept" not in seen[11], "it is spent when the time gap is drawn"
    assert all(isinstance(driver, MappingProxyType) for driver in seen.values())
    idr.simulate(road, planner=Looking, settings={"step.max_steps": 2})
    assert dict(seen[11]) == {}


def test_the_run_stores_its_drivers_plain_and_can_be_repeated_without_their_file(road, file, tmp_path):
    name = f"{__name__}:Hurried"
    run = idr.simulate(road, planner=f"{name},drivers={file}", seed=3)
    own = run.settings["planner"]
    assert own["12"]["driver.time_gap"] == read_drivers(file).values(3, 12)["time_gap"]
    run.save(tmp_path / "run")
    assert "mine.toml" not in json.dumps(json.loads((tmp_path / "run" / "run.json").read_text())["settings"])
    assert idr.simulate(road, planner=own).digest == run.digest
    assert idr.simulate(road, planner=name).digest != run.digest


@pytest.mark.long
def test_planners_in_processes_of_their_own_see_the_same(road, file):
    digests = {idr.simulate(road, planner={"planner": kind, "drivers": file}).digest for kind in (Hurried, Parallel)}
    assert len(digests) == 1


def test_a_number_of_the_driver_may_be_given_for_one_agent(road):
    run = idr.simulate(road, planner={12: f"{__name__}:Hurried,driver.time_gap=2", "default": f"{__name__}:Hurried"})
    assert run.states.velocity[:, 60] == pytest.approx([12.0, 6.0, 12.0], abs=0.2), "m/s"
    with pytest.raises(InputError, match=r"driver.mood: is not known; there are time_gap, minimum_gap"):
        idr.simulate(road, planner=f"{__name__}:Hurried,driver.mood=1")
    with pytest.raises(InputError, match=r"driver.time_gap: must be a number from 0.6 to 3, is 9"):
        idr.simulate(road, planner=f"{__name__}:Hurried,driver.time_gap=9")


def test_check_planner_finds_who_relies_on_a_driver_or_changes_it():
    assert check_planner(Hurried)["a driver of its own"]
    with pytest.raises(PlannerContractError, match=r"an empty road.*KeyError"):
        check_planner(Careless)
    with pytest.raises(PlannerContractError, match=r"a driver of its own.*TypeError"):
        check_planner(Meddling)


@pytest.mark.parametrize("planner", ["frenet", "velocity_adjusting"])
def test_drivers_waver_each_in_its_own_way(road, planner, file):
    run = idr.simulate(road, planner=f"{planner},drivers={file}", seed=4)
    own = run.settings["planner"]
    assert {one["noise"] for one in own.values()} == {0.3}
    assert len({one["noise_seed"] for one in own.values()}) == 3
    speed = run.states.velocity[:, 20:60]
    assert 0.05 < np.nanstd(speed - np.nanmean(speed)) < 1.5, "m/s"
    assert idr.simulate(road, planner=own, threads=2).digest == run.digest
    still = idr.simulate(road, planner=f"{planner},noise_seed=7,noise_length=3")
    assert still.digest == idr.simulate(road, planner=planner).digest, "without noise nobody wavers"


@pytest.mark.parametrize("planner", ["frenet", "velocity_adjusting"])
def test_drivers_who_waver_do_not_hit_a_leader_that_brakes_hard(planner):
    # The leader brakes from 20 m/s at 6 m/s² after 2 s; 1.2 s lie between the cars.
    speed = np.maximum(20.0 - 6.0 * np.clip(0.1 * np.arange(121) - 2.0, 0.0, None), 0.0)
    ahead = 100.0 + np.concatenate(([0.0], np.cumsum(0.05 * (speed[1:] + speed[:-1]))))
    leader = Car(1, 100.0, 0.0, 20.0)
    road = world(straight_road(500.0), cars=[leader, Car(2, 70.0, 0.0, 20.0), Car(3, 40.0, 0.0, 20.0)], steps=120)
    x, velocity = road.obstacles.x.copy(), road.obstacles.velocity.copy()
    x[0], velocity[0] = ahead[: x.shape[1]], speed[: x.shape[1]]
    braking = replace(road, obstacles=replace(road.obstacles, x=x, velocity=velocity))
    for seed in range(5):
        own = f"{planner},noise=0.5,noise_length=2,noise_seed={seed}"
        run = idr.simulate(braking, agents=[2, 3], planner=own)
        assert "collision" not in run.outcomes.outcome, seed


def test_drivers_of_frenet_keep_their_side_of_the_lane():
    cars = [Car(11 + i, 40.0 * i, offset, 10.0) for i, offset in enumerate((0.5, -0.4, 0.0))]
    road = world(straight_road(400.0), cars=cars)

    def sides(words):
        run = idr.simulate(road, planner=f"frenet,{words}", settings={"goal.information": "turns"})
        assert run.outcomes.outcome.count("collision") == 0
        return run.states.y[:, 45:55], run.states.width[0]

    assert sides("lateral_kept=1")[0] == pytest.approx(np.array([[0.5], [-0.4], [0.0]]) * np.ones(10), abs=0.05), "m"
    y, width = sides("lateral_offset=2")
    assert y == pytest.approx(0.5 * (3.5 - width) - 0.2, abs=0.05), "it stays in its lane"
    y, _ = sides("lateral_noise=0.3,noise_seed=5")
    assert 0.02 < np.std(y) < 0.4, "m"
