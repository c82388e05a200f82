"""Policies trained with Stable-Baselines3 as files that drive; needs nothing of its own from that library."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.envs.policies import export_policy
from interdrive.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from interdrive.envs.actions import Actions
    from interdrive.native_settings import ObservationSettings

#: Hidden layers and the layer of the action, as `MlpPolicy` names them: of PPO and A2C, and of DQN, whose last layer is
#: one of a sequence.
_FORMS = (
    (re.compile(r"mlp_extractor\.policy_net\.(\d+)\.(weight|bias)"), re.compile(r"action_net\.(weight|bias)")),
    (re.compile(r"q_net\.q_net\.(\d+)\.(weight|bias)"), None),
)
#: What a policy has beside the layers that drive: values, spreads and copies for training.
_UNUSED = re.compile(r"log_std|(mlp_extractor\.)?value_net\..*|q_net_target\..*")
#: So many names of layers are listed in an error.
_LISTED = 12


def export_stable_baselines(
    model: Any,  # noqa: ANN401 - an algorithm of Stable-Baselines3
    path: str | Path,
    *,
    actions: Actions | None = None,
    observation: ObservationSettings | None = None,
) -> None:
    """Writes the policy of a model of Stable-Baselines3 as a file for `--planner policy,file=FILE`.

    `MlpPolicy` of PPO and A2C (continuous actions or a grid) and of DQN (a grid), with tanh or ReLU between the layers.

    Args:
        model: A trained algorithm such as `PPO`, or its policy.
        path: The file.
        actions: What it was trained with; None: the defaults.
        observation: What it was trained with; None: the defaults.

    Raises:
        InputError: Its layers are others (the line names those that were found), its observations were normalised, or
            the layers do not fit what is observed.
    """
    policy = getattr(model, "policy", model)
    if not callable(getattr(policy, "state_dict", None)):
        raise InputError("model", f"{type(model).__name__} is no model of Stable-Baselines3: it has no policy")
    normalised = getattr(model, "get_vec_normalize_env", None)
    if callable(normalised) and normalised() is not None:
        raise InputError("model", "it was trained with VecNormalize, which a policy file cannot hold; train without it")
    tensors = {name: _array(tensor) for name, tensor in policy.state_dict().items()}
    layers = _layers(tensors)
    export_policy(path, layers, actions=actions, observation=observation, activation=_activation(policy))


def _layers(tensors: Mapping[str, NDArray[np.float32]]) -> dict[str, NDArray[np.float32]]:
    """The layers by the names of `export_policy`."""
    for hidden, last in _FORMS:
        numbered: dict[int, dict[str, NDArray[np.float32]]] = {}
        action: dict[str, NDArray[np.float32]] = {}
        for name, tensor in tensors.items():
            if found := hidden.fullmatch(name):
                numbered.setdefault(int(found[1]), {})[found[2]] = tensor
            elif last is not None and (found := last.fullmatch(name)):
                action[found[1]] = tensor
        if len(action) + sum(map(len, numbered.values())) < sum(not _UNUSED.fullmatch(name) for name in tensors):
            continue  # others drive, too: a features extractor, for instance
        stack = [numbered[number] for number in sorted(numbered)]
        if last is None and stack:
            action = stack.pop()
        if stack and all({*layer} == {"weight", "bias"} for layer in (*stack, action)):
            made = {f"hidden.{i}.{kind}": tensor for i, layer in enumerate(stack) for kind, tensor in layer.items()}
            return made | {f"action.{kind}": tensor for kind, tensor in action.items()}
    names = ", ".join(list(tensors)[:_LISTED]) + (", ..." if len(tensors) > _LISTED else "")
    raise InputError(
        "model",
        f"its layers are {names or 'none'}; an export needs mlp_extractor.policy_net.* and action_net (PPO, A2C) or "
        "q_net.q_net.* (DQN), with hidden layers, as MlpPolicy has them, and no others that drive",
    )


def _activation(policy: Any) -> str:  # noqa: ANN401 - a policy of Stable-Baselines3
    """The name of the function between the layers."""
    kind = getattr(policy, "activation_fn", None)
    name = getattr(kind, "__name__", "") or type(kind).__name__
    known = {"Tanh": "tanh", "ReLU": "relu"}
    if name not in known:
        raise InputError("model", f"its activation is {name}, a policy file can have Tanh or ReLU")
    return known[name]


def _array(tensor: Any) -> NDArray[np.float32]:  # noqa: ANN401 - a tensor of torch, or an array
    if callable(getattr(tensor, "detach", None)):
        tensor = tensor.detach().cpu().numpy()
    return np.asarray(tensor, dtype=np.float32)
