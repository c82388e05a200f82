"""What training computes in Python beside the core: merging, the wide mode, how even a past was. No torch is needed."""

from types import SimpleNamespace

import numpy as np
import pytest

from interdrive import _core
from interdrive.files import read_scenario, shipped_scenario
from interdrive.native_settings import CoreStepSettings, RoadSettings
from interdrive.predictors import Neural, PredictorSettings, native_predictor
from interdrive.predictors.neural import SHIPPED
from interdrive.scenario.native import core_road, core_scenario
from interdrive.storage.weights import read_weights

evaluate = pytest.importorskip("training.evaluate", reason="training/ is part of the repository, not of the package")
dataset = pytest.importorskip("training.dataset")
driven = pytest.importorskip("training.driven")
evenness = pytest.importorskip("training.evenness")
networks = pytest.importorskip("training.networks")
tail = pytest.importorskip("training.tail")

KNOTS = np.asarray(_core.NEURAL["knots"])
#: Bounds of the logarithm of the growth of a standard deviation [log m/s], and its value now [m].
LOG_RATE, SIGMA_NOW = (-5.0, 2.0), 0.05
N_EVENNESS = 8


@pytest.fixture(scope="module", params=["t_junction", "highway"])
def rows(request):
    """Rows of a shipped scenario as training has them, and what the core predicts for them."""
    scenario = read_scenario(shipped_scenario(request.param))
    road = core_road(scenario, RoadSettings(gap_tolerance=0.5, open_end_length=100.0))
    core = core_scenario(scenario, road)
    core_world = _core.World(core, [], CoreStepSettings(), threads=1)
    found = dataset.rows_of(scenario, interval=1.0)
    predictor = native_predictor(Neural(modes_max=8), PredictorSettings(), core)
    n_steps = round(3.0 / scenario.dt)
    at = np.rint(KNOTS / scenario.dt).astype(int) - 1
    said = {name: [] for name in ("probability", "xy", "covariance")}
    for step in np.unique(found["time_step"]):
        here = found["time_step"] == step
        answer = core_world.predict(predictor, core.scene(int(step), round(2.5 / scenario.dt)), n_steps)
        of = answer.of(found["id"][here])
        said["probability"].append(of.probability)
        points = np.stack([of.x, of.y], axis=-1)[:, :, at] - found["pose"][here][:, None, None, :2]
        said["xy"].append(points)
        said["covariance"].append(of.covariance[:, :, at])
    return found, {name: np.concatenate(parts) for name, parts in said.items()}


def decoded(found, weights):
    """Modes in path coordinates from the network's raw outputs, spreads calibrated."""
    network = _core.NeuralNetwork(weights)
    raw = np.asarray(network.forward(*(found[name] for name in ("agent", "neighbours", "paths", "path_valid"))), float)
    logit = np.where(found["path_valid"][..., None], raw[..., 0], -np.inf)
    logit -= logit.max(axis=(1, 2), keepdims=True)
    log_p = logit - np.log(np.exp(logit).sum(axis=(1, 2), keepdims=True))
    numbers = raw[..., 1:].reshape(*raw.shape[:3], len(KNOTS), 4)
    speed, lateral = (
        np.sign(numbers[..., i]) * np.maximum(np.abs(numbers[..., i]) - weights["decode.dead_zone"][i], 0.0)
        for i in (0, 1)
    )
    s = np.maximum.accumulate(np.maximum(KNOTS * (found["velocity"][:, None, None, None] + speed), 0.0), axis=-1)
    offset, slope, length = (
        np.nan_to_num(found[name], nan=1.0)[:, :, None, None] for name in ("offset", "slope", "settling")
    )
    u = np.clip(s / length, 0.0, 1.0)
    d = (1 + 2 * u) * (1 - u) ** 2 * offset + length * u * (1 - u) ** 2 * slope + KNOTS * lateral
    sigma = SIGMA_NOW + KNOTS[:, None] * np.exp(np.clip(numbers[..., 2:], *LOG_RATE))
    even = found["agent"][:, -N_EVENNESS:].astype(float)
    for i, axis in enumerate("sd"):
        parts = weights[f"calibration.evenness_{axis}"].astype(float)
        of_vehicle = np.exp(np.clip(parts[0] + even @ parts[1:], -1.5, 1.5))
        sigma[..., i] *= weights[f"calibration.{axis}"] * of_vehicle[:, None, None, None]
    return SimpleNamespace(log_probability=log_p, s=s, d=d, sigma_s=sigma[..., 0], sigma_d=sigma[..., 1])


def test_modes_are_merged_and_widened_as_in_the_core(rows):
    found, said = rows
    weights = read_weights(SHIPPED).tensors
    modes = evaluate.modes_of(decoded(found, weights), found, 8)
    pairs = weights["decode.tail"].astype(float).reshape(2, 2)
    modes = tail.with_tail(modes, found["standing"], tail.Tail(tuple(pairs[:, 0]), tuple(pairs[:, 1])))
    n_core, n_python = ((p > 0).sum(axis=1) for p in (said["probability"], modes.probability))
    assert len(n_core) > 50
    assert ((n_core - 1) < 2 * found["path_valid"].sum(axis=1)).mean() > 0.5, "modes were merged"
    assert (n_core == n_python).all(), "the same modes are one"
    rows_of, last = np.arange(len(n_core)), n_core - 1
    for in_core, in_python in ((np.zeros_like(last), 0), (last, -1)):
        p, q = said["probability"][rows_of, in_core], modes.probability[:, in_python]
        assert p == pytest.approx(q, abs=1e-4)
        # Training keeps paths at 64 points.
        assert np.abs(said["xy"][rows_of, in_core] - modes.xy[:, in_python]).max() < 0.05
        # The least standard deviation, 2 cm, is applied before modes are merged or after.
        factor = np.where(found["standing"], pairs[1, 1], pairs[0, 1]) if in_python else np.ones(len(last))
        slack = 1e-3 * factor[:, None, None, None] ** 2
        a, b = said["covariance"][rows_of, in_core], modes.covariance[:, in_python]
        largest = np.trace(b, axis1=-2, axis2=-1)[..., None, None]
        assert (np.abs(a - b) < slack + 0.02 * largest).all()


def test_how_even_a_past_was_is_computed_as_in_the_core(rows):
    agent = rows[0]["agent"]
    anew = evenness.with_evenness(agent)
    assert (agent[:, -N_EVENNESS:] != 0.0).mean() > 0.5
    assert anew == pytest.approx(agent, abs=2e-3)


def test_driven_rows_of_another_planner_or_version_are_other_rows(monkeypatch):
    digits = {planner: driven.behaviour_of(planner) for planner in ("idm", "idm_mobil")}
    assert len(set(digits.values())) == 2
    driven.behaviour_of.cache_clear()
    assert driven.behaviour_of("idm") == digits["idm"]
    monkeypatch.setattr(driven, "__version__", "0.0.0")
    driven.behaviour_of.cache_clear()
    assert driven.behaviour_of("idm") != digits["idm"]
    driven.behaviour_of.cache_clear()


def test_true_positions_that_are_not_known_are_not_outside_a_region():
    assert evaluate.share_inside(np.array([0.1, np.nan, 0.9]), 0.5) == 0.5
    assert np.isnan(evaluate.share_inside(np.array([np.nan]), 0.5))


def test_a_kept_network_is_the_one_that_was_trained_and_is_only_used_for_the_same_course(tmp_path):
    made, lines = {"data": "digest", "course": {"epochs": 20}}, [{"epoch": 1, "loss": 0.5}]
    tensors = {"head.1.weight": np.linspace(-1.0, 1.0, 6, dtype=np.float32).reshape(2, 3)}
    path = tmp_path / "kept" / "shipped.safetensors"
    networks.save(path, networks.TrainedNetwork(tensors, {"head": 32, "dropout": 0.1}, lines), made)
    found = networks.load(path, made)
    assert found.lines == lines
    assert found.sizes == {"head": 32, "dropout": 0.1}
    assert np.array_equal(found.tensors["head.1.weight"], tensors["head.1.weight"])
    with pytest.raises(ValueError, match="trained on other files or in another way"):
        networks.load(path, {**made, "course": {"epochs": 12}})
