"""Models of Stable-Baselines3 become planners; here the library is replaced by what a model of it offers."""

from types import SimpleNamespace

import numpy as np
import pytest
from safetensors import safe_open
from safetensors.numpy import load_file

from interdrive import InputError, envs, simulate

N_OBSERVED = 324


class Tanh: ...


class ReLU: ...


class GELU: ...


def layer(rows, columns, seed):
    rng = np.random.default_rng(seed)
    return {"weight": rng.standard_normal((rows, columns)) / columns**0.5, "bias": 0.1 * rng.standard_normal(rows)}


def named(prefix, part):
    return {f"{prefix}.{name}": values.astype(np.float32) for name, values in part.items()}


def model(tensors, activation=Tanh, normalised=None):
    policy = SimpleNamespace(state_dict=lambda: tensors, activation_fn=activation)
    return SimpleNamespace(policy=policy, get_vec_normalize_env=lambda: normalised)


def ppo(n_out=2):
    """With the value network, which does not drive."""
    return {
        "log_std": np.zeros(n_out, np.float32),
        **named("mlp_extractor.policy_net.0", layer(16, N_OBSERVED, 0)),
        **named("mlp_extractor.policy_net.2", layer(8, 16, 1)),
        **named("mlp_extractor.value_net.0", layer(16, N_OBSERVED, 2)),
        **named("action_net", layer(n_out, 8, 3)),
        **named("value_net", layer(1, 16, 4)),
    }


def test_the_layers_that_drive_are_written_in_their_order(tmp_path):
    tensors, file = ppo(), tmp_path / "ppo.safetensors"
    envs.export_stable_baselines(model(tensors), file)
    written = load_file(file)
    assert sorted(written) == sorted(
        f"{name}.{kind}" for name in ("hidden.0", "hidden.1", "action") for kind in ("weight", "bias")
    )
    np.testing.assert_array_equal(written["hidden.1.weight"], tensors["mlp_extractor.policy_net.2.weight"])
    np.testing.assert_array_equal(written["action.bias"], tensors["action_net.bias"])
    run = simulate("t_junction", agents=[2001], planner=f"policy,file={file}", threads=1)
    assert "planner_error" not in run.outcomes.outcome


def test_a_model_equals_its_own_layers_given_by_hand(tmp_path):
    tensors = ppo()
    one, other = tmp_path / "one.safetensors", tmp_path / "other.safetensors"
    envs.export_stable_baselines(model(tensors, ReLU), one)
    by_hand = {
        **named("hidden.0", {k: tensors[f"mlp_extractor.policy_net.0.{k}"] for k in ("weight", "bias")}),
        **named("hidden.1", {k: tensors[f"mlp_extractor.policy_net.2.{k}"] for k in ("weight", "bias")}),
        **named("action", {k: tensors[f"action_net.{k}"] for k in ("weight", "bias")}),
    }
    envs.export_policy(other, by_hand, activation="relu")
    written, expected = load_file(one), load_file(other)
    assert sorted(written) == sorted(expected)
    for name, values in expected.items():
        np.testing.assert_array_equal(written[name], values, err_msg=name)
    with safe_open(one, framework="np") as first, safe_open(other, framework="np") as second:
        assert first.metadata() == second.metadata()
        assert first.metadata()["activation"] == "relu"


def test_of_dqn_the_last_layer_of_the_sequence_is_the_action(tmp_path):
    tensors = {
        **named("q_net.q_net.0", layer(16, N_OBSERVED, 0)),
        **named("q_net.q_net.2", layer(15, 16, 1)),
        **named("q_net_target.q_net.0", layer(16, N_OBSERVED, 2)),
    }
    file = tmp_path / "dqn.safetensors"
    grid = envs.KinematicGrid(accelerations=3, steerings=5)
    envs.export_stable_baselines(model(tensors, ReLU), file, actions=grid)
    np.testing.assert_array_equal(load_file(file)["action.weight"], tensors["q_net.q_net.2.weight"])


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (model(named("actor.mu", layer(2, 8, 0))), "its layers are actor.mu.weight, actor.mu.bias; an export needs"),
        (model({}), "its layers are none"),
        (model({name: one for name, one in ppo().items() if "policy_net" not in name}), "log_std, mlp_extractor.value"),
        (model(ppo(), GELU), "its activation is GELU"),
        (model(ppo(), normalised=object()), "VecNormalize"),
        (model(ppo(n_out=5)), "action"),
        (object(), "object is no model of Stable-Baselines3"),
    ],
)
def test_what_cannot_be_exported_is_one_line_that_names_what_was_found(tmp_path, made, words):
    with pytest.raises(InputError) as caught:
        envs.export_stable_baselines(made, tmp_path / "policy.safetensors")
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_layer_that_would_be_lost_is_named(tmp_path):
    tensors = ppo() | named("features_extractor.linear.0", layer(N_OBSERVED, N_OBSERVED, 5))
    with pytest.raises(InputError, match=r"features_extractor\.linear\.0\.weight"):
        envs.export_stable_baselines(model(tensors), tmp_path / "policy.safetensors")
    assert not list(tmp_path.iterdir())
