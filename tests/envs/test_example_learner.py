"""The example trains a network whose file says what the network said."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.numpy import load_file

from interdrive import simulate

ROOT = Path(__file__).parents[2]


@pytest.fixture
def ppo(monkeypatch):
    spec = importlib.util.spec_from_file_location("ppo", ROOT / "examples/rl/ppo.py")
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "ppo", module)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module, "SCENARIOS", ["lane_merge"])
    return module


def test_the_exported_policy_acts_as_the_trained_network_does(ppo, tmp_path):
    policy, curve = ppo.train(seconds=60.0, most_steps=6000, seed=0, threads=1)
    assert curve[-1]["steps"] >= 6000
    assert {"goal_reached", "collision", "return"} <= curve[-1].keys()
    file = tmp_path / "policy.safetensors"
    ppo.export(policy, file)
    weights = load_file(file)
    observations = np.random.default_rng(0).uniform(-1, 1, (100, 324)).astype(np.float32)
    x = observations
    for i in range(2):
        x = np.tanh(x @ weights[f"hidden.{i}.weight"].T + weights[f"hidden.{i}.bias"])
    with torch.no_grad():
        expected = policy(torch.from_numpy(observations))[0].numpy()
    np.testing.assert_allclose(x @ weights["action.weight"].T + weights["action.bias"], expected, atol=1e-5)
    run = simulate("lane_merge", agents="all", planner=f"policy,file={file}")
    assert "planner_error" not in run.outcomes.outcome


def test_training_with_the_same_seed_gives_the_same_curve(ppo):
    curves = [ppo.train(seconds=60.0, most_steps=4000, seed=1, threads=1)[1] for _ in range(2)]
    assert [entry["return"] for entry in curves[0]] == [entry["return"] for entry in curves[1]]
