"""What the native predictors expect in small worlds."""

import numpy as np
import pytest

from interdrive import ConstantVelocity, InputError, LaneFollowing, Predictions, Simulation
from interdrive.testing import Car, problem, straight_road, world


def predict(predictor, cars, steps=100):
    scenario = world(
        straight_road(300.0), cars=cars, problems=[problem(100, 5.0, goal=(90.0, 0.0), time_step=(0, 90))], steps=steps
    )
    simulation = Simulation(scenario, agents=[100], predictor=predictor, threads=1)
    return simulation.progress.predict(simulation.world.scene())


def test_constant_velocity_goes_straight_on():
    found = predict("constant_velocity", [Car(7, 50.0, velocity=8.0)])
    row = found.ids.tolist().index(7)
    assert found.x[row, 0] == pytest.approx(50.0 + 0.8 * np.arange(1, 31))
    assert found.probability[row].tolist() == [1.0]


@pytest.mark.parametrize("predictor", ["constant_velocity", "lane_following"])
def test_a_standing_car_stays(predictor):
    found = predict(predictor, [Car(7, 50.0)])
    row = found.ids.tolist().index(7)
    assert (found.x[row, 0] == 50.0).all()
    assert (found.covariance[row, 0] == 0.02 * np.eye(2)).all()


def test_the_spread_grows_with_time_and_more_along_the_heading_than_across():
    found = predict("lane_following", [Car(7, 50.0, velocity=10.0)])
    covariance = found.covariance[found.ids.tolist().index(7), 0]
    along, across = covariance[:, 0, 0], covariance[:, 1, 1]
    assert (np.diff(along) > 0).all()
    assert (np.diff(across) > 0).all()
    # 0.15 m now, then half of 0.8 m/s² times 9 s².
    assert along[-1] == pytest.approx(0.15**2 + 3.6**2)
    assert along[-1] > 5 * across[-1]


def test_lane_following_returns_to_the_middle_of_the_lane():
    found = predict(LaneFollowing(return_time=2.0), [Car(7, 50.0, 0.8, velocity=10.0)])
    y = found.y[found.ids.tolist().index(7), 0]
    assert y[0] == pytest.approx(0.8, abs=0.05)
    assert y[-1] == pytest.approx(0.0, abs=0.01)


def test_ground_truth_knows_when_a_car_leaves():
    found = predict("ground_truth", [Car(7, 50.0, velocity=10.0, last=12)])
    row = found.ids.tolist().index(7)
    assert found.valid[row, 0].tolist() == [True] * 12 + [False] * 18


def test_mode_probabilities_add_up_to_one():
    found = predict("lane_following", [Car(7, 50.0, velocity=10.0), Car(8, 80.0)])
    assert found.probability.sum(axis=1) == pytest.approx(1.0)


@pytest.mark.parametrize("make", [lambda: ConstantVelocity(position_sigma=0.0), lambda: LaneFollowing(modes_max=9)])
def test_an_impossible_setting_is_refused_by_its_name(make):
    with pytest.raises(InputError, match=r"^\w+: must be"):
        make()


def test_a_record_with_a_value_of_another_type_is_refused():
    with pytest.raises(InputError, match=r"^modes_max: expected a whole number, not 2\.5$"):
        LaneFollowing(modes_max=2.5)


def tables(**changes):
    fields = {
        "time_step": 0,
        "ids": np.array([7]),
        "probability": np.ones((1, 1)),
        **{name: np.zeros((1, 1, 5)) for name in ("x", "y", "orientation", "velocity")},
        "covariance": np.tile(np.eye(2), (1, 1, 5, 1, 1)),
        "valid": np.ones((1, 1, 5), dtype=bool),
    }
    return fields | changes


def test_tables_of_the_right_shape_become_predictions():
    assert Predictions(**tables()).x.shape == (1, 1, 5)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"x": np.zeros((1, 5))}, r"\(participants, modes, steps\) expected"),
        ({"y": np.zeros((1, 1, 4))}, "y: shape"),
        ({"x": np.full((1, 1, 5), np.nan)}, "participant 7 has a valid step that is not a number"),
        ({"probability": np.full((1, 1), 0.5)}, "mode probabilities of participant 7"),
        ({"covariance": np.zeros((1, 1, 5, 2, 2))}, "not positive definite"),
        (
            {"covariance": np.tile([[1.0, 0.5], [0.0, 1.0]], (1, 1, 5, 1, 1))},
            "7 has a covariance that is not symmetric",
        ),
        ({"ids": np.array([7, 8])}, "for 2 ids"),
        ({"ids": np.broadcast_to(np.int64(1), (10**13,))}, "for 10000000000000 ids"),
    ],
)
def test_garbage_of_a_predictor_is_refused(change, words):
    with pytest.raises(InputError, match=words):
        Predictions(**tables(**change))


def two_modes(scene, first, second, variance=1.0):
    """Participant 7 drives on along y = 7 m (mode 0) or y = 0 m (mode 1), to the left or right of the agent's lane."""
    time = np.arange(1, 31) * scene.dt
    x = np.broadcast_to(scene.x[scene.ids == 7, -1] + 8.0 * time, (1, 2, 30))
    y = np.broadcast_to(np.array([7.0, 0.0])[None, :, None], (1, 2, 30))
    return Predictions(
        scene.time_step,
        np.array([7]),
        np.array([[first, second]]),
        x,
        y,
        np.zeros((1, 2, 30)),
        np.full((1, 2, 30), 8.0),
        np.broadcast_to(variance * np.eye(2), (1, 2, 30, 2, 2)),
        np.ones((1, 2, 30), dtype=bool),
    )


def test_frenet_adds_the_collision_probabilities_of_all_modes_by_their_probability():
    scenario = world(
        straight_road(300.0, lanes=3),
        cars=[Car(7, 15.0, 7.0, velocity=8.0)],
        problems=[problem(100, 10.0, 3.5, 8.0, goal=(150.0, 3.5), time_step=(0, 200))],
    )
    simulation = Simulation(scenario, agents=[100], planner="frenet", threads=1)

    def found(first, second):
        step = simulation.world.observe()
        simulation.world.plan(step, two_modes(step.scene, first, second))
        return simulation.world.candidates(100, step)

    def prediction_cost(first, second):
        costs = found(first, second)
        return costs["terms"][:, costs["term_names"].index("prediction")]

    left, right = prediction_cost(1.0, 0.0), prediction_cost(0.0, 1.0)
    known = np.isfinite(left + right)
    assert known.sum() > 100
    assert np.abs(left - right)[known].max() > 1.0, "it matters which of the modes happens"
    for share in (0.2, 0.5, 0.7):
        mixed = prediction_cost(share, 1.0 - share)
        assert mixed[known] == pytest.approx(share * left[known] + (1.0 - share) * right[known], abs=1e-6)
