"""The predictor `walenet` in small worlds, most with random weights: what it is told, what is made of its answers."""

from __future__ import annotations

import os
import sys
from dataclasses import replace

import numpy as np
import published_network as plain
import pytest
from click.testing import CliRunner

from interdrive import InputError, InterdriveError, Simulation, Walenet, _core
from interdrive.cli import main
from interdrive.native_settings import CoreStepSettings, RoadSettings
from interdrive.predictors import walenet
from interdrive.scenario.native import core_road, core_scenario
from interdrive.testing import Car, straight_road, world

pytestmark = pytest.mark.long

NUMBERS = plain.invented()
ROAD = straight_road(400.0, lanes=3)


@pytest.fixture(autouse=True)
def invented(monkeypatch, request):
    """Predictors have random weights, unless a test asks for the published ones or for none."""
    if not {"published_walenet", "empty_cache"} & set(request.fixturenames):
        session = walenet.network(NUMBERS)
        monkeypatch.setattr(walenet, "network", lambda: session)


class Traffic:
    """Recorded traffic alone, and what the predictor expects of it."""

    def __init__(self, scenario, **settings):
        road = core_road(scenario, RoadSettings())
        self.settings = settings
        self.world = _core.World(core_scenario(scenario, road), [], CoreStepSettings(), threads=1)

    def after(self, steps):
        for _ in range(steps):
            self.world.advance(self.world.observe())
        return self

    def predict(self, n_steps=30):
        self.scene = self.world.scene()
        return Walenet(**self.settings, horizon=n_steps * self.scene.dt).predict(self.scene)


def lane(number, **more):
    return {"y": 3.5 * number, **more}


CARS = [
    Car(1, 120.0, **lane(0), velocity=9.0),
    Car(2, 138.0, **lane(0), velocity=7.0, first=12),
    Car(3, 130.0, **lane(1, orientation=0.02), velocity=12.0),
    Car(4, 131.0, **lane(1), velocity=11.0, first=25),
    Car(5, 160.0, **lane(2), velocity=3.0),
]


def crooked(lanelets):
    """The road, bent by a sine."""

    def bent(bounds):
        return tuple(np.column_stack([b[:, 0], b[:, 1] + 9 * np.sin(b[:, 0] / 40)]) for b in bounds)

    return replace(lanelets, left=bent(lanelets.left), right=bent(lanelets.right))


def drawn(lanelets, x, y, orientation):
    edges = lanelets.adjacent_left < 0, lanelets.adjacent_right < 0
    return plain.picture(lanelets.left, lanelets.right, *edges, x, y, orientation)


@pytest.mark.parametrize("orientation", [0.0, 0.3, -1.2, 2.9])
@pytest.mark.parametrize("x", [-30.0, 10.0, 200.0, 500.0])
def test_the_picture_shows_the_borders_as_described(x, orientation):
    lanelets = crooked(ROAD)
    road = core_road(world(lanelets), RoadSettings())
    y = 9 * np.sin(x / 40) + 1.3
    found, expected = walenet.Borders(road).picture(x, y, orientation), drawn(lanelets, x, y, orientation)
    # A point on the edge of a pixel may fall to either side.
    assert (found != expected).sum() <= 2
    assert (found > 0).any() == (x < 500.0), "the last one is too far away"


def told(scene, row, own):
    """History of a row in the frame of another, filled in backwards at the speed first seen."""
    known = np.flatnonzero(scene.valid[row])[-30:]
    x, y = scene.x[row, known], scene.y[row, known]
    missing = 30 - len(known)
    back = -0.1 * np.arange(missing, 0, -1)
    first, speed = scene.orientation[row, known[0]], scene.velocity[row, known[0]]
    x = np.concatenate([x[0] + back * speed * np.cos(first), x])
    y = np.concatenate([y[0] + back * speed * np.sin(first), y])
    dx, dy, psi = x - scene.x[own, -1], y - scene.y[own, -1], scene.orientation[own, -1]
    return np.column_stack([dx * np.sin(psi) - dy * np.cos(psi), dx * np.cos(psi) + dy * np.sin(psi)])


def test_a_prediction_is_what_a_plain_network_makes_of_the_scene():
    lanelets = crooked(ROAD)
    traffic = Traffic(world(lanelets, cars=CARS, steps=60)).after(34)
    found = traffic.predict()
    scene = traffic.scene
    assert found.probability.tolist() == [[1.0]] * len(CARS)
    for own in range(len(CARS)):
        neighbours = np.zeros((39, 30, 2))
        nearest = np.full(39, np.inf)
        for row in range(len(CARS)):
            x, y = told(scene, row, own)[-1]
            cell = 13 * int((x + 9) // 6) + int((39 - y) // 6)
            if abs(x) < 9 and abs(y) < 39 and np.hypot(x, y) < nearest[cell]:
                neighbours[cell], nearest[cell] = told(scene, row, own), np.hypot(x, y)
        x, y, psi = scene.x[own, -1], scene.y[own, -1], scene.orientation[own, -1]
        answer = plain.answer(NUMBERS, told(scene, own, own), neighbours, drawn(lanelets, x, y, psi))[:30]
        right, forward = np.array([np.sin(psi), -np.cos(psi)]), np.array([np.cos(psi), np.sin(psi)])
        means = np.array([x, y]) + np.outer(answer[:, 0], right) + np.outer(answer[:, 1], forward)
        assert found.x[own, 0] == pytest.approx(means[:, 0], abs=2e-3)
        assert found.y[own, 0] == pytest.approx(means[:, 1], abs=2e-3)
        sx, sy, rho = 1 / answer[0, 2], 1 / answer[0, 3], answer[0, 4]
        turn = np.column_stack([right, forward])
        covariance = turn @ np.array([[sx**2, rho * sx * sy], [rho * sx * sy, sy**2]]) @ turn.T
        assert found.covariance[own, 0, 0] == pytest.approx(covariance, rel=1e-3)
    velocity = np.gradient(np.stack([found.x[:, 0], found.y[:, 0]]), 0.1, axis=2)
    assert found.velocity[:, 0] == pytest.approx(np.hypot(*velocity))
    turned = np.arctan2(velocity[1], velocity[0]) - found.orientation[:, 0]
    moving = found.velocity[:, 0] > 0.3
    assert moving.any()
    assert np.cos(turned[moving]) == pytest.approx(1.0)


def relative(traffic, n_steps=30):
    found = traffic.predict(n_steps)
    return np.stack([found.x[0, 0] - traffic.scene.x[0, -1], found.y[0, 0] - traffic.scene.y[0, -1]])


def alone(**settings):
    return Traffic(world(ROAD, cars=[Car(1, 150.0, velocity=10.0)], steps=60), **settings)


def test_a_past_that_is_not_known_is_filled_in_at_the_speed_first_seen():
    """At constant speed a car that has just appeared is expected to do what it does when its past is known."""
    assert relative(alone()) == pytest.approx(relative(alone().after(30)), abs=1e-3)
    zeros = relative(alone(backfill=False))
    assert np.abs(zeros - relative(alone())).max() > 0.05
    assert relative(alone(backfill=False).after(30)) == pytest.approx(relative(alone().after(30)), abs=1e-3)


def test_the_published_anchor_is_a_step_ahead():
    """Constant speed fulfils the prediction, so "next" now is "now" at the next step, read early."""
    following, early = alone().after(31), alone(anchor="next").after(30)
    assert early.predict().x == pytest.approx(following.predict().x, abs=1e-4)
    assert early.predict().y == pytest.approx(following.predict().y, abs=1e-4)


def test_who_stands_stays_unless_the_guard_is_off():
    standing = world(ROAD, cars=[Car(1, 150.0), Car(2, 200.0, velocity=8.0)], steps=60)
    found = Traffic(standing).after(10).predict()
    assert (found.x[0], found.y[0]) == (pytest.approx(150.0, abs=0), pytest.approx(0.0, abs=0))
    assert (found.covariance[0, 0] == 0.02 * np.eye(2)).all()
    unguarded = Traffic(standing, standing_guard=False).after(10).predict()
    assert np.abs(unguarded.x[0] - 150.0).max() > 0.05
    assert (unguarded.x[1] == found.x[1]).all(), "the other one is not concerned"


def test_a_standing_vehicle_counts_as_such_in_its_first_step():
    found = Traffic(world(ROAD, cars=[Car(1, 150.0)], steps=60)).predict()
    assert (found.x[0] == 150.0).all()


def test_a_vehicle_that_is_asked_about_again_without_moving_gets_the_same_answer():
    traffic = Traffic(world(ROAD, cars=[Car(1, 150.0), Car(2, 180.0)], steps=60), standing_guard=False).after(5)
    first, again = traffic.predict(), traffic.predict()
    fresh = Traffic(world(ROAD, cars=[Car(1, 150.0), Car(2, 180.0)], steps=60), standing_guard=False).after(5).predict()
    assert (first.x == again.x).all()
    assert (first.x == fresh.x).all()


def test_other_time_steps_expect_the_same():
    def after_three_seconds(dt):
        scenario = world(ROAD, cars=CARS[:1], steps=round(4.0 / dt), dt=dt)
        return Traffic(scenario).after(round(3.0 / dt)).predict(round(3.0 / dt))

    usual, fine, coarse = (after_three_seconds(dt) for dt in (0.1, 0.04, 0.2))
    # 0.2, 1.0 and 3.0 s from now.
    for seconds in (0.2, 1.0, 3.0):
        expected = usual.x[0, 0, round(seconds / 0.1) - 1]
        assert fine.x[0, 0, round(seconds / 0.04) - 1] == pytest.approx(expected, abs=1e-3)
        assert coarse.x[0, 0, round(seconds / 0.2) - 1] == pytest.approx(expected, abs=1e-3)


def test_beyond_four_seconds_the_speed_is_kept_and_the_spread_grows():
    found = alone().after(30).predict(80)
    assert found.valid.all()
    assert np.ptp(np.diff(found.x[0, 0, 40:])) < 1e-9
    spread = np.linalg.det(found.covariance[0, 0, 39:])
    assert (np.diff(spread) > 0).all()


def test_pedestrians_go_straight_on_and_obstacles_stay():
    scenario = world(ROAD, cars=[Car(1, 150.0, velocity=1.0), Car(2, 200.0, velocity=9.0)], steps=60)
    obstacles = scenario.obstacles
    kinds = ("pedestrian", obstacles.kinds[1])
    found = Traffic(replace(scenario, obstacles=replace(obstacles, kinds=kinds))).predict()
    assert found.x[0, 0] == pytest.approx(150.0 + 0.1 * np.arange(1, 31))
    fixed = replace(obstacles, is_static=np.array([False, True]))
    found = Traffic(replace(scenario, obstacles=fixed)).predict()
    assert (found.x[1] == 200.0).all()


def test_far_from_any_road_there_is_an_answer():
    found = Traffic(world(ROAD, cars=[Car(1, 5000.0, 800.0, velocity=9.0)], steps=60)).after(3).predict()
    assert found.valid.all()


def test_the_bits_do_not_depend_on_the_number_of_threads(monkeypatch):
    crowd = [Car(i, 20.0 + 9.0 * i, 3.5 * (i % 3), velocity=5.0 + i % 4) for i in range(1, 30)]
    traffic = Traffic(world(crooked(ROAD), cars=crowd, steps=60)).after(8)
    one, four = (with_cores(monkeypatch, n, traffic) for n in (1, 4))
    for name in ("x", "y", "orientation", "velocity", "covariance"):
        assert (getattr(one, name) == getattr(four, name)).all(), name


def with_cores(monkeypatch, n, traffic):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _process: set(range(n)))
    return traffic.predict()


def test_a_hundred_vehicles_in_a_crowd_are_expected_somewhere():
    crowd = [Car(i, 1.5 * i, 3.5 * (i % 3), velocity=5.0 + i % 4) for i in range(1, 101)]
    found = Traffic(world(ROAD, cars=crowd, steps=3)).after(2).predict()
    assert found.valid.all()
    assert np.isfinite(found.covariance).all()


MISSING = "predictor walenet: the weights of walenet are not on this machine: run 'interdrive models install walenet'"


@pytest.fixture
def empty_cache(monkeypatch, tmp_path):
    monkeypatch.setenv("INTERDRIVE_CACHE", str(tmp_path))


def refused(tmp_path):
    """What a run with the predictor says in the command line, and what the exception says."""
    with pytest.raises(InterdriveError) as caught:
        Simulation("t_junction", agents=1, predictor="walenet")
    result = CliRunner().invoke(main, ["run", "t_junction", "--predictor", "walenet", "--out", str(tmp_path / "run")])
    assert (result.exit_code, result.stderr) == (2, f"error: {caught.value}\n")
    return str(caught.value)


def test_without_weights_one_line_says_what_to_do(empty_cache, tmp_path):
    assert refused(tmp_path) == MISSING


def test_without_onnxruntime_one_line_says_what_to_install(empty_cache, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    assert refused(tmp_path) == "predictor walenet needs the extra: pip install interdrive[walenet]"


@pytest.mark.parametrize("changes", [{"anchor": "later"}, {"horizon": 0.0}])
def test_an_impossible_setting_is_refused_by_its_name(changes):
    with pytest.raises(InputError, match=f"{next(iter(changes))}: "):
        Walenet(**changes)


def test_the_published_weights_move_a_standing_car_by_many_metres_without_the_guard(published_walenet):
    standing = world(ROAD, cars=[Car(1, 150.0)], steps=60)
    found = Traffic(standing, standing_guard=False).after(10).predict()
    assert 5.0 < found.x[0, 0, -1] - 150.0 < 45.0


def test_the_published_weights_drive_on_along_a_straight_road(published_walenet):
    found = relative(alone().after(30))
    assert found[0, -1] == pytest.approx(30.0, abs=6.0)
    assert abs(found[1, -1]) < 1.5


def test_a_run_with_the_published_weights_can_be_repeated(published_walenet, tmp_path):
    arguments = ["run", "t_junction", "--agents", "all", "--predictor", "walenet,standing_guard=false", "--quiet"]
    result = CliRunner().invoke(main, [*arguments, "--out", str(tmp_path / "run")])
    assert result.exit_code == 0, result.stderr
    assert CliRunner().invoke(main, ["verify", str(tmp_path / "run")]).exit_code == 0
