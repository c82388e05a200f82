"""What can be observed besides the usual numbers: road edges, predictions, a picture from above."""

from dataclasses import replace

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from test_policies import PROBLEM, forward, layers

from interdrive import InputError, envs, simulate
from interdrive.testing import Car, problem, straight_road, world

ALL = {"observation.edges": 32, "observation.predictions": True, "observation.raster": True}


def on_a_road(cars, **settings):
    """A car at 10 m/s, 20 m after the begin of a straight road."""
    start = problem(1, 20.0, velocity=10.0, goal=(200.0, 0.0), time_step=(1, 300))
    return envs.DriveEnv(scenarios=world(straight_road(400.0), problems=[start], cars=cars), **settings)


def coasted(env, steps):
    seen = [env.reset(seed=0)[0]]
    return seen + [env.step(np.zeros(2, np.float32))[0] for _ in range(steps)]


def test_spaces_have_boxes_by_name_as_soon_as_there_is_a_picture():
    flat = envs.DriveEnv(scenarios="t_junction", **ALL).observation_space
    assert {name: (box.shape, box.dtype.name) for name, box in flat.items()} == {
        "raster": ((4, 96, 96), "uint8"),
        "vector": ((324 + 32 * 6 + 12 * 10,), "float32"),
    }
    blocks = envs.DriveEnv(scenarios="t_junction", **ALL, **{"observation.form": "dict"}).observation_space
    shapes = {name: box.shape for name, box in blocks.items()}
    assert shapes["edges"] == (32, 6)
    assert shapes["predictions"] == (12, 10)
    assert shapes["raster"] == (4, 96, 96)
    numbers = envs.DriveEnv(scenarios="t_junction", **{"observation.edges": 8}).observation_space
    assert numbers.shape == (324 + 48,)


def test_a_car_ahead_is_expected_and_drawn_where_it_drives():
    # 30 m ahead, at the same speed.
    seen = coasted(on_a_road([Car(7, 50.0, 0.0, 10.0)], **ALL, **{"observation.form": "dict"}), 10)[-1]
    expected = seen["predictions"][0]
    np.testing.assert_allclose(expected[[1, 4, 7]] * 80.0, [40.0, 50.0, 60.0], atol=0.5)
    np.testing.assert_allclose(expected[[2, 5, 8]], 0.0, atol=1e-3)
    # Rows of 0.75 m; the observer is in row 72, column 48.
    now, before = (np.argwhere(seen["raster"][layer]).mean(axis=0) for layer in (2, 3))
    np.testing.assert_allclose((72.0 - now[0]) * 0.75, 30.0, atol=0.4)
    np.testing.assert_allclose((72.0 - before[0]) * 0.75, 25.0, atol=0.4)
    np.testing.assert_allclose([now[1], before[1]], 48.0, atol=0.5)


def traffic_of_all_sorts():
    """Cars that enter, leave, stand and hardly move, and one whose speed is stated 5 m/s higher than it moves."""
    cars = [
        Car(7, 50.0, 0.0, 10.0),
        Car(8, 70.0, 3.5, 6.0, first=4, last=20),
        Car(9, 90.0, 3.5),
        Car(11, 30.0, 3.5, 12.0, last=15),
        Car(12, 22.0, 3.5, 0.5, first=9),
    ]
    start = problem(1, 20.0, velocity=10.0, goal=(200.0, 0.0), time_step=(1, 300))
    made = world(straight_road(400.0, lanes=2), problems=[start], cars=cars)
    stated = made.obstacles.velocity.copy()
    stated[0] += 5.0
    return replace(made, obstacles=replace(made.obstacles, velocity=stated))


def test_a_learner_does_not_observe_a_car_that_it_misses_and_is_not_late():
    ahead = [Car(7, 50.0, 0.0, 10.0)]
    missed, late = ({f"simulation.view.{name}": 1.0} for name in ("missed", "delay"))
    exact, nobody = (coasted(on_a_road(cars), 3) for cars in (ahead, []))
    never = coasted(on_a_road(ahead, **missed), 3)
    assert np.array_equal(never, nobody)
    assert not np.array_equal(exact, nobody)
    assert np.array_equal(coasted(on_a_road(ahead, **late), 3), exact)


def test_a_learner_cannot_be_later_than_the_past_that_is_kept():
    with pytest.raises(InputError, match=r"view\.delay of 4 s is longer than the past that is kept: 3 s"):
        on_a_road([], **{"simulation.view.delay": 4.0})


@pytest.mark.parametrize("scenario", [traffic_of_all_sorts(), "t_junction", "signals"])
@pytest.mark.parametrize("sensor_radius", [35.0, 80.0])
@pytest.mark.parametrize("scene", ["observation.raster", "observation.predictions"])
def test_others_are_seen_alike_whether_or_not_a_scene_is_made_for_pictures_and_predictions(
    scenario, sensor_radius, scene
):
    several = {} if isinstance(scenario, str) else {"learners": [1]}
    seen = {"simulation.view.sensor_radius": sensor_radius}
    without, with_scene = (
        envs.Rows(1, scenarios=scenario, slots=4, seed=1, **several, **seen, **more) for more in ({}, {scene: True})
    )
    # Predictions come last.
    n, rng = without.observations.shape[1], np.random.default_rng(0)
    assert (without.reset() == with_scene.reset()[:, :n]).all()
    for _ in range(30):
        actions = (rng.uniform(-1, 1, without.actions.shape) * (0.5, 0.05)).astype(np.float32)
        np.testing.assert_array_equal(without.step(actions), with_scene.step(actions)[:, :n])
        np.testing.assert_array_equal(without.rewards, with_scene.rewards)


def test_a_stated_speed_that_contradicts_the_motion_is_not_observed():
    env = envs.DriveEnv(scenarios=traffic_of_all_sorts(), learners=[1], **{"observation.form": "dict"})
    seen = [one["partners"] for one in coasted(env, 4)]
    # In its own lane; from the first state alone nobody can tell.
    speeds = [40.0 * partners[np.abs(partners[:, 1] - 30.0 / 80.0) < 1e-3, 5] for partners in seen]
    np.testing.assert_allclose(np.ravel(speeds), [15.0, 10.0, 10.0, 10.0, 10.0], atol=1e-3)


def test_what_is_written_into_a_row_of_nobody_is_gone_after_the_next_reset_at_the_latest():
    rows = envs.Rows(1, slots=3, scenarios="t_junction", learners=1)
    rows.reset()
    # Looked at in every step are only the numbers about the observer, with which every observation begins.
    rows.observations[1:, 15] = 7.0
    assert not rows.step()[1:].any()
    rows.observations[1:, 16:] = 7.0
    rows.step()
    assert not rows.reset()[1:].any()


def test_nothing_is_drawn_half_a_second_ago_before_there_was_one():
    seen = coasted(on_a_road([Car(7, 50.0, 0.0, 10.0)], **{"observation.raster": True}), 5)
    drawn = [bool(one["raster"][3].any()) for one in seen]
    assert drawn == [False] * 5 + [True]


def test_edges_predictions_and_pictures_do_not_show_what_others_will_do():
    drives = [coasted(on_a_road([Car(7, 60.0, 0.0, 8.0, last=last)], **ALL), 20) for last in (100, 20)]
    for one, other in zip(*drives, strict=True):
        np.testing.assert_array_equal(one["vector"], other["vector"])
        np.testing.assert_array_equal(one["raster"], other["raster"])


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_many_worlds_draw_what_single_environments_draw(mode):
    n, settings = 2, {"scenarios": ["t_junction", "lane_merge"], "start": "random", **ALL}
    native = envs.DriveVectorEnv(num_envs=n, autoreset_mode=mode, threads=2, **settings)
    several = SyncVectorEnv([lambda: envs.DriveEnv(**settings)] * n, autoreset_mode=mode)
    rng = np.random.default_rng(0)
    native.reset(seed=5), several.reset(seed=5)
    ends = 0
    for _ in range(150):
        given = rng.uniform(-1, 1, (n, 2)).astype(np.float32)
        a, b = native.step(given), several.step(given)
        for name in ("vector", "raster"):
            np.testing.assert_array_equal(a[0][name], b[0][name])
        for i in np.flatnonzero(a[4].get("_final_obs", [])):
            np.testing.assert_array_equal(a[4]["final_obs"][i]["raster"], b[4]["final_obs"][i]["raster"])
        ends += (a[2] | a[3]).sum()
    assert ends > 0


def test_pictures_are_written_into_an_array_of_the_caller_and_are_black_in_rows_that_have_ended():
    mine = np.full((8, 4, 96, 96), 7, np.uint8)
    raster = {"observation.raster": True}
    rows = envs.Rows(2, slots=4, scenarios="t_junction", buf={"raster": mine}, keep_final=True, **raster)
    rows.reset(seed=0)
    assert rows.raster is mine
    assert set(np.unique(mine)) == {0, 255}
    rng = np.random.default_rng(0)
    ended = 0
    while ended < 10:
        rows.step(rng.uniform(-1, 1, (8, 2)).astype(np.float32))
        over = rows.terminals | rows.truncations
        ended += over.sum()
        assert not mine[~rows.masks & ~over].any()
        assert rows.final_raster[over].any(axis=(1, 2, 3)).all()


def test_a_policy_may_observe_edges_and_predictions_and_drives_as_in_its_environment(tmp_path):
    observation = envs.ObservationSettings(edges=16, predictions=True)
    file, weights = tmp_path / "policy.safetensors", layers(n_in=324 + 16 * 6 + 12 * 10)
    envs.export_policy(file, weights, observation=observation)
    env = envs.DriveEnv(scenarios="t_junction", learners=[PROBLEM], traffic="idm", record=True, observation=observation)
    seen, _ = env.reset(seed=0)
    info = {}
    while not info:
        seen, *_, info = env.step(forward(weights, seen))
    planners = {"default": "idm", PROBLEM: f"policy,file={file}"}
    run = simulate("t_junction", planner=planners, predictor="lane_following")
    row, n = run.states.participant_id.tolist().index(PROBLEM), info["steps"] + 1
    for name in ("x", "y"):
        ours, theirs = getattr(run.states, name)[row, :n], getattr(env.run().states, name)[row, :n]
        np.testing.assert_allclose(ours, theirs, atol=1e-3, err_msg=name)


def test_a_policy_that_needs_pictures_cannot_be_a_planner(tmp_path):
    with pytest.raises(InputError, match=r"observation\.raster: a policy used as a planner observes numbers only"):
        envs.export_policy(tmp_path / "p", layers(), observation=envs.ObservationSettings(raster=True))


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"observation.edges": 257}, "observation.edges: must be 0 to 256, not 257"),
        ({"observation.predictions": 2}, "observation.predictions"),
        ({"buf": {"raster": np.zeros((8, 4, 96, 96), np.uint8)}}, "buf.raster: there is no such array"),
        (
            {"observation.raster": True, "buf": {"raster": np.zeros((8, 96, 96, 4), np.uint8)}},
            "buf.raster: shape [8, 96, 96, 4] given, [8, 4, 96, 96] expected",
        ),
    ],
)
def test_what_cannot_be_observed_is_refused_in_one_line(given, text):
    with pytest.raises(InputError) as refused:
        envs.Rows(1, scenarios="t_junction", **given)
    assert text in str(refused.value)
    assert "\n" not in str(refused.value)
