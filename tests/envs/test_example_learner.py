"""The example of learning: gradients, a network whose file says what it said, and the same seed."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import load_file

from interdrive import simulate

EXAMPLES = Path(__file__).parents[2] / "examples/rl"


def loaded(name, monkeypatch):
    """A module of the example."""
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, name, module)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def policies(monkeypatch):
    return loaded("policy", monkeypatch)


@pytest.fixture
def ppo(policies, monkeypatch):
    module = loaded("ppo", monkeypatch)
    monkeypatch.setattr(module, "SCENARIOS", ["lane_merge"])
    monkeypatch.setattr(module, "WORLDS", 6)
    return module


def test_the_gradient_is_that_of_the_loss(ppo, policies):
    rng = np.random.default_rng(0)
    policy = policies.Policy(12, 2, rng)
    # In double precision differences are exact enough.
    policy.parameters = policy.parameters + 0.1 * rng.standard_normal(len(policy.parameters))
    x, actions = rng.standard_normal((50, 12)), 0.3 * rng.standard_normal((50, 2))
    gains, returns = rng.standard_normal((2, 50))

    def likelihood():
        off = (actions - policy.forward(x).mean) / np.exp(policy.parts(policy.parameters)["log_std"])
        return policy.log_probability(off)

    # Some have become so likely or unlikely that they count no longer.
    before = likelihood() + 0.3 * rng.standard_normal(50)

    def loss():
        ratio = np.exp(likelihood() - before)
        gained = np.minimum(ratio * gains, ratio.clip(1 - ppo.CLIP, 1 + ppo.CLIP) * gains).mean()
        error = np.mean((policy.forward(x).value - returns) ** 2)
        return ppo.VALUE * error - gained - ppo.ENTROPY * policy.parts(policy.parameters)["log_std"].sum()

    gradient = ppo.gradient_of_loss(policy, x, actions, before, gains, returns)
    start = policy.parameters
    for name, part in policy.parts(np.arange(len(start))).items():
        # Along some direction within each part of the parameters.
        direction = np.zeros(len(start))
        direction[part.ravel()] = rng.standard_normal(part.size)
        direction *= 1e-5 / np.linalg.norm(direction)
        sides = []
        for sign in (1, -1):
            policy.parameters = start + sign * direction
            sides.append(loss())
        assert (sides[0] - sides[1]) / 2 == pytest.approx(gradient @ direction, rel=1e-3, abs=1e-12), name


def test_observations_of_several_batches_have_the_mean_and_spread_of_all(policies):
    rng = np.random.default_rng(1)
    policy = policies.Policy(5, 2, rng)
    batches = [rng.normal(3.0, (0.5, 1, 2, 4, 8), (n, 5)).astype(np.float32) for n in (400, 100, 900)]
    for batch in batches:
        policy.watch(*policy.watched(policy.inputs(batch)))
    np.testing.assert_allclose(policy.center, np.concatenate(batches).mean(0), rtol=1e-4)
    np.testing.assert_allclose(policy.spread, np.concatenate(batches).std(0), rtol=1e-4)


@pytest.mark.long
def test_the_exported_policy_acts_as_the_trained_network_does(ppo, tmp_path):
    policy, curve = ppo.train(seconds=60.0, most_steps=1500, seed=0, threads=1)
    assert curve[-1]["steps"] >= 1500
    assert {"goal_reached", "collision", "return"} <= curve[-1].keys()
    file = tmp_path / "policy.safetensors"
    policy.export(file)
    weights = load_file(file)
    observations = np.random.default_rng(0).uniform(-1, 1, (100, 324)).astype(np.float32)
    x = observations
    for i in range(2):
        x = np.tanh(x @ weights[f"hidden.{i}.weight"].T + weights[f"hidden.{i}.bias"])
    expected = policy.forward(policy.inputs(observations)).mean
    np.testing.assert_allclose(x @ weights["action.weight"].T + weights["action.bias"], expected, atol=1e-5)
    run = simulate("lane_merge", agents="all", planner=f"policy,file={file}")
    assert "planner_error" not in run.outcomes.outcome


@pytest.mark.long
def test_training_with_the_same_seed_gives_the_same_policy_with_any_number_of_threads(ppo):
    trained = [ppo.train(seconds=60.0, most_steps=1500, seed=1, threads=threads) for threads in (1, 2)]
    assert all(len(curve) > 1 for _, curve in trained)  # so there was an update
    np.testing.assert_array_equal(*[policy.parameters for policy, _ in trained])
