"""A learned policy is a file, and a planner like any other."""

import numpy as np
import pytest
from safetensors.numpy import load_file, save_file

from interdrive import InputError, envs, simulate

PROBLEM = 2001


def layers(seed=0, n_in=324, n_out=2, scale=1.0):
    rng = np.random.default_rng(seed)
    sizes = {"hidden.0": (32, n_in), "hidden.1": (16, 32), "action": (n_out, 16)}
    made = {}
    for name, (rows, columns) in sizes.items():
        made[f"{name}.weight"] = (scale * rng.standard_normal((rows, columns)) / columns**0.5).astype(np.float32)
        made[f"{name}.bias"] = (0.1 * rng.standard_normal(rows)).astype(np.float32)
    return made


def forward(weights, observation):
    x = observation
    for i in range(2):
        x = np.tanh(weights[f"hidden.{i}.weight"] @ x + weights[f"hidden.{i}.bias"])
    return np.clip(weights["action.weight"] @ x + weights["action.bias"], -1, 1)


def test_a_policy_drives_in_a_run_as_it_does_in_its_environment(tmp_path):
    weights, file = layers(), tmp_path / "policy.safetensors"
    envs.export_policy(file, weights)
    env = envs.DriveEnv(scenarios="t_junction", learners=[PROBLEM], traffic="idm", record=True)
    observation, _ = env.reset(seed=0)
    info = {}
    while not info:
        observation, *_, info = env.step(forward(weights, observation))
    run = simulate(
        "t_junction",
        planner={"default": "idm", PROBLEM: f"policy,file={file}"},
        predictor="lane_following",
        threads=2,
    )
    row = run.states.participant_id.tolist().index(PROBLEM)
    n = info["steps"] + 1
    learned = env.run().states
    for name, tolerance in (("x", 1e-3), ("y", 1e-3), ("velocity", 1e-4), ("orientation", 1e-4)):
        ours, theirs = getattr(run.states, name)[row, :n], getattr(learned, name)[row, :n]
        np.testing.assert_allclose(ours, theirs, atol=tolerance, err_msg=name)
    assert run.outcomes.outcome[run.outcomes.agent_id.tolist().index(PROBLEM)] == info["outcome"]


def test_all_agents_may_have_a_policy_and_threads_do_not_matter(tmp_path):
    file = tmp_path / "grid.safetensors"
    grid = envs.KinematicGrid(accelerations=3, steerings=5)
    envs.export_policy(file, layers(n_out=15), actions=grid, activation="relu")
    runs = [simulate("lane_merge", planner=f"policy,file={file}", threads=threads) for threads in (1, 2)]
    assert runs[0].digest == runs[1].digest
    assert "planner_error" not in runs[0].outcomes.outcome
    assert runs[0].plans.x.shape[0] > 0


def damaged(change):
    def make(path):
        envs.export_policy(path, layers())
        tensors = load_file(path)
        from safetensors import safe_open

        with safe_open(path, framework="np") as file:
            metadata = dict(file.metadata())
        change(tensors, metadata)
        save_file(tensors, path, metadata=metadata)

    return make


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (damaged(lambda _, told: told.update(format="2")), "format 2, this version reads 1"),
        (
            damaged(lambda _, told: told.update(layout="0")),
            "its observation differs from that of this version; train it again",
        ),
        (
            damaged(lambda tensors, _: tensors.update({"hidden.0.weight": np.zeros((32, 300), np.float32)})),
            "hidden.0.weight is (32, 300), the observation has 324 values",
        ),
        (lambda path: path.write_bytes(b"no"), "not a safetensors file"),
    ],
)
def test_a_file_that_cannot_be_driven_is_named_with_the_reason(tmp_path, make, text):
    file = tmp_path / "policy.safetensors"
    make(file)
    with pytest.raises(InputError) as refused:
        simulate("t_junction", planner=f"policy,file={file}")
    assert str(file) in str(refused.value)
    assert text in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_policy_needs_its_file():
    with pytest.raises(InputError, match="policy,file=FILE"):
        simulate("t_junction", planner="policy")
