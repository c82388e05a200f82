"""The predictor `neural` with small random weights: its file, its settings, its place in a simulation."""

import numpy as np
import pytest
from safetensors.numpy import save_file

from interdrive import InputError, Simulation, _core, simulate
from interdrive.predictors import Neural, native_predictor
from interdrive.storage.weights import digest
from interdrive.testing import Car, problem, straight_road, world

#: Of the features that this interdrive computes.
VERSION = str(_core.NEURAL["version"])


def weights(seed=0, **changes):
    """Tensors of a small network with two modes per path."""
    random = np.random.default_rng(seed)
    n_agent, n_neighbour, n_path = (len(_core.NEURAL[name]) for name in ("agent", "neighbours", "paths"))
    tensors = {"calibration.s": np.ones(6), "calibration.d": np.ones(6), "decode.dead_zone": np.array([0.2, 0.05])}
    for name, n_in, n_out in (
        ("agent.0", n_agent, 24),
        ("agent.1", 24, 16),
        ("neighbour.0", n_neighbour, 12),
        ("neighbour.1", 12, 8),
        ("path.0", n_path + 24, 20),
        ("path.1", 20, 16),
        ("head.0", 32, 20),
        ("head.1", 20, 50),
    ):
        tensors[f"{name}.weight"] = random.normal(0.0, 0.3 / np.sqrt(n_in), (n_out, n_in))
        tensors[f"{name}.bias"] = random.normal(0.0, 0.1, n_out)
    return {name: np.asarray(values, dtype=np.float32) for name, values in {**tensors, **changes}.items()}


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "small.safetensors"
    save_file(weights(), path, {"feature_version": VERSION})
    return path


CARS = (Car(7, 50.0, velocity=8.0), Car(8, 90.0))


def scenario(cars=CARS, dt=0.1):
    problems = [problem(100, 5.0, goal=(90.0, 0.0), time_step=(0, 90))]
    return world(straight_road(300.0, lanes=2), cars=cars, problems=problems, steps=100, dt=dt)


def by_hand(tensors, agent, neighbours, paths, valid):
    """The network as it is defined, in float64, for one vehicle."""

    def layer(name, x):
        return x @ tensors[f"{name}.weight"].astype(float).T + tensors[f"{name}.bias"]

    def two(name, x):
        return np.maximum(layer(f"{name}.1", np.maximum(layer(f"{name}.0", x), 0.0)), 0.0)

    present = neighbours[:, -1] > 0
    near = two("neighbour", neighbours[present]).max(axis=0) if present.any() else np.zeros(8)
    context = np.concatenate([two("agent", agent), near])
    seen = two("path", np.hstack([paths[valid], np.tile(context, (valid.sum(), 1))]))
    seen = np.hstack([seen, np.tile(seen.max(axis=0), (valid.sum(), 1))])
    out = np.zeros((len(paths), 2, 25))
    out[valid] = layer("head.1", np.maximum(layer("head.0", seen), 0.0)).reshape(-1, 2, 25)
    return out


def test_the_forward_pass_is_the_network_as_defined():
    simulation = Simulation(scenario(), agents=[100], threads=1)
    inputs = _core.NeuralInputs(simulation.world.scene())
    arrays = (inputs.agent, inputs.neighbours, inputs.paths, inputs.path_valid)
    found = _core.NeuralNetwork(weights()).forward(*arrays)
    assert found.shape == (3, len(_core.NEURAL["slots"]), 2, 25)
    for i in range(3):
        expected = by_hand(
            weights(), *(array[i].astype(float) if array.dtype != bool else array[i] for array in arrays)
        )
        assert found[i] == pytest.approx(expected, abs=1e-5)
    assert np.abs(found).max() > 0.1


def test_features_of_wrong_shapes_are_refused():
    with pytest.raises(InputError, match="paths: shape"):
        _core.NeuralNetwork(weights()).forward(
            np.zeros((1, len(_core.NEURAL["agent"])), np.float32),
            np.zeros((1, 8, 11), np.float32),
            np.zeros((1, 6, 42), np.float32),
            np.ones((1, 7), bool),
        )


@pytest.mark.parametrize("modes_max", [1, 3, 8])
def test_predictions_have_modes_that_add_up_to_one(file, modes_max):
    simulation = Simulation(scenario(), agents=[100], predictor=Neural(modes_max, str(file)), threads=1)
    found = simulation.progress.predict(simulation.world.scene())
    assert found.x.shape == (3, modes_max, 30)
    assert found.probability.sum(axis=1) == pytest.approx(1.0)
    assert (np.diff(found.probability, axis=1) <= 0).all()
    covariance = found.covariance[found.valid]
    assert (np.linalg.eigvalsh(covariance) > 0).all()


def test_a_tail_is_one_more_mode(file):
    save_file(weights(**{"decode.tail": np.array([0.1, 5.0, 0.02, 8.0])}), file, {"feature_version": VERSION})
    simulation = Simulation(scenario(), agents=[100], predictor=Neural(2, str(file)), threads=1)
    found = simulation.progress.predict(simulation.world.scene())
    assert found.x.shape == (3, 3, 30)
    assert found.probability.sum(axis=1) == pytest.approx(1.0)
    last = (found.probability > 0).sum(axis=1) - 1
    rows = np.arange(3)
    assert set(np.round(found.probability[rows, last], 6)) <= {0.1, 0.02}
    assert (found.x[rows, last] == found.x[:, 0]).all()
    assert (np.linalg.det(found.covariance[rows, last]) > np.linalg.det(found.covariance[:, 0])).all()


@pytest.mark.parametrize("dt", [0.1, 0.2])
def test_a_run_with_it_is_the_same_on_any_number_of_threads(file, dt):
    cars = [Car(i, 20.0 + 12.0 * i, 3.5 * (i % 2), velocity=6.0 + i % 3) for i in range(1, 8)]
    digests = {
        simulate(scenario(cars, dt), agents=[100, 1, 2], predictor=f"neural,weights={file}", threads=threads).digest
        for threads in (1, 3)
    }
    assert len(digests) == 1


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"weights .*none.safetensors: no such file"):
        Simulation(scenario(), predictor=Neural(weights=str(tmp_path / "none.safetensors")))


def test_a_truncated_file_is_named(file):
    file.write_bytes(file.read_bytes()[:-100])
    with pytest.raises(InputError, match=r"weights .*small.safetensors: damaged or not a safetensors file"):
        Simulation(scenario(), predictor=Neural(weights=str(file)))


@pytest.mark.parametrize(
    ("changes", "version", "words"),
    [
        ({}, "0", r"made for features of version 0, this interdrive computes version \d+; use weights"),
        ({}, None, r"made for features of version none"),
        ({"agent.0.bias": np.zeros(25)}, VERSION, r"small.safetensors: tensor agent.0.bias has shape \[25\], \(24\)"),
        ({"more": np.zeros(1)}, VERSION, "unknown tensor more"),
        (
            {"decode.tail": np.array([0.1, 0.5, 0.0, 1.0])},
            VERSION,
            "tensor decode.tail must have probabilities below 0.5",
        ),
        ({"calibration.s": np.zeros(6)}, VERSION, "tensor calibration.s has values that are not positive"),
        ({"agent.0.bias": np.full(24, np.nan)}, VERSION, "tensor agent.0.bias has values that are not finite numbers"),
    ],
)
def test_weights_that_do_not_fit_are_refused_in_one_line(file, changes, version, words):
    save_file(weights(**changes), file, {} if version is None else {"feature_version": version})
    with pytest.raises(InputError, match=words) as refusal:
        Simulation(scenario(), predictor=Neural(weights=str(file)))
    assert "\n" not in str(refusal.value)


def test_a_file_that_changes_is_read_again(file):
    def ends():
        simulation = Simulation(scenario(), agents=[100], predictor=Neural(1, str(file)), threads=1)
        return simulation.progress.predict(simulation.world.scene()).x[:, 0, -1].copy()

    first = ends()
    changed = weights(seed=1, **{"decode.dead_zone": np.zeros(2)})
    save_file(changed, file, {"feature_version": VERSION, "more": "text"})
    assert (ends() != first).any()


def test_values_that_were_changed_after_training_are_refused(file):
    metadata = {"feature_version": VERSION, "sha256": digest(weights())}
    save_file(weights(), file, metadata)
    Simulation(scenario(), predictor=Neural(weights=str(file)))
    save_file(weights(seed=1), file, metadata)
    with pytest.raises(InputError, match=r"small.safetensors: the values differ from the trained ones"):
        Simulation(scenario(), predictor=Neural(weights=str(file)))


@pytest.mark.parametrize("modes_max", [0, 9])
def test_an_impossible_number_of_modes_is_refused_by_its_name(modes_max):
    with pytest.raises(InputError, match=r"modes_max: must be 1 to 8"):
        Neural(modes_max)


def test_the_shipped_weights_keep_a_steady_car_going_and_a_standing_one_where_it_is():
    simulation = Simulation(scenario((Car(7, 60.0, 0.2, velocity=12.0), Car(8, 150.0, 3.5))), agents=[100], threads=1)
    scene = simulation.preparation.core_scenario.scene(30)
    found = simulation.world.predict(native_predictor(Neural(), simulation.settings.predictor, None), scene, 30)
    moving, standing = (found.ids.tolist().index(i) for i in (7, 8))
    assert found.x[moving, 0, -1] == pytest.approx(60.0 + 12.0 * 6.0, abs=3.0)
    assert abs(found.y[moving, 0, -1]) < 1.0
    assert (found.x[standing, 0] == 150.0).all()
    assert (found.y[standing, 0] == 3.5).all()
