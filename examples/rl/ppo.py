"""Trains a policy that all agents share, by proximal policy optimization, on the shipped scenarios.

    python examples/rl/ppo.py --out out/ppo       # at most 10 minutes on two cores
    python examples/rl/ppo.py --scenarios out/varied  # and on what scenarios/varied.py has made
    python examples/rl/compare.py out/ppo/policy.safetensors

Writes the policy, which is a planner, and its curve. Needs torch, and `pip install "interdrive[rl]"`. Schulman et al.,
"Proximal policy optimization algorithms", 2017, arXiv 1707.06347; generalized advantages as in arXiv 1506.02438.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import torch
from torch import nn

from interdrive import envs

STEPS, WORLDS, SLOTS = 32, 24, 31
EPOCHS, MINIBATCH = 4, 1024
DISCOUNT, TRACE = 0.97, 0.9
CLIP, ENTROPY, VALUE = 0.2, 0.003, 0.5
LEARNING_RATE = 1e-3
WIDTH, LOG_STD = 128, -1.6
#: Observations that hardly change are not blown up.
SPREAD_MIN = 0.05
#: Outcomes that are printed and drawn while it learns.
WATCHED = ("goal_reached", "goal_missed", "collision", "time_limit")
#: What is trained on.
SCENARIOS = ["t_junction", "intersection", "lane_merge", "highway"]
#: A decision lasts half a second, so that its effects can be told from those of the next. At first leaving the road
#: costs little: while all drivers leave it sooner or later, a high price teaches them to stand still.
SETTINGS = {"decision_seconds": 0.5, "reward.off_road": -0.3}
#: From this share of the training on it costs as much as a collision.
GROWN = 0.5


def network(inputs: int, outputs: int, gain: float) -> nn.Sequential:
    """Two hidden layers; the last layer begins near zero if the gain is small."""
    layers = [nn.Linear(inputs, WIDTH), nn.Tanh(), nn.Linear(WIDTH, WIDTH), nn.Tanh(), nn.Linear(WIDTH, outputs)]
    for layer, own in ((layers[0], 2**0.5), (layers[2], 2**0.5), (layers[4], gain)):
        nn.init.orthogonal_(layer.weight, own)
        nn.init.zeros_(layer.bias)
    return nn.Sequential(*layers)


class Policy(nn.Module):
    """A mean action with a free spread, and a value, each from a network of its own.

    Observations are divided by their spread, which is far below 1 for most of them: 80 m are 1 there, so what matters
    at a junction is a tenth.
    """

    def __init__(self, observations: int, actions: int) -> None:
        super().__init__()
        self.mean, self.value = network(observations, actions, 0.01), network(observations, 1, 1.0)
        self.log_std = nn.Parameter(torch.full((actions,), LOG_STD))
        self.register_buffer("center", torch.zeros(observations))
        self.register_buffer("spread", torch.ones(observations))
        self.register_buffer("seen", torch.zeros(()))

    def forward(self, observations: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Mean actions and values."""
        x = (observations - self.center) / self.spread.clamp(min=SPREAD_MIN)
        return self.mean(x), self.value(x).squeeze(-1)

    @torch.no_grad()
    def watch(self, observations: torch.Tensor) -> None:
        """Counts observations into their mean and spread."""
        n = len(observations)
        share = n / (float(self.seen) + n)
        center, spread = observations.mean(0), observations.std(0)
        off = center - self.center
        variance = (1 - share) * self.spread**2 + share * spread**2 + share * (1 - share) * off**2
        self.spread.copy_(variance.sqrt() if self.seen else spread)
        self.center.add_(share * off)
        self.seen.add_(n)

    def log_probability(self, mean: torch.Tensor, actions: torch.Tensor) -> torch.Tensor:
        """Of actions that were drawn around the means."""
        spread = ((actions - mean) / self.log_std.exp()) ** 2
        return (-0.5 * spread - self.log_std - 0.9189385332046727).sum(-1)


class Batch:
    """What a policy did for some steps in all rows."""

    def __init__(self, rows: int, observations: int, actions: int) -> None:
        self.observations = np.zeros((STEPS, rows, observations), np.float32)
        self.actions = np.zeros((STEPS, rows, actions), np.float32)
        self.log_probabilities = np.zeros((STEPS, rows), np.float32)
        self.values = np.zeros((STEPS + 1, rows), np.float32)
        self.rewards = np.zeros((STEPS, rows), np.float32)
        self.ends = np.zeros((STEPS, rows), np.bool_)
        self.masks = np.zeros((STEPS, rows), np.bool_)
        self.bootstraps = np.zeros((STEPS, rows), np.float32)

    def advantages(self) -> np.ndarray:
        """Generalized advantages; beyond an end only what it was cut off from counts."""
        found = np.zeros_like(self.rewards)
        last = np.zeros(self.rewards.shape[1], np.float32)
        for t in reversed(range(STEPS)):
            after = np.where(self.ends[t], self.bootstraps[t], self.values[t + 1])
            surprise = self.rewards[t] + DISCOUNT * after - self.values[t]
            last = surprise + np.where(self.ends[t], 0.0, DISCOUNT * TRACE * last)
            found[t] = last
        return found


class Mixed(envs.Uniform):
    """Half of the episodes are of the shipped scenarios, however many others there are."""

    def draw(self, rng: np.random.Generator) -> int:
        """Position of the next scenario."""
        own, n = len(SCENARIOS), self._n
        if n == own or rng.random() < 0.5:
            return int(rng.integers(own))
        return own + int(rng.integers(n - own))


class Fleet:
    """Worlds in which half of the episodes begin where the scenarios do, and half anywhere in the recordings.

    From the start all vehicles learn, with the planning problems that are counted in the end; later starts show
    places and speeds that a policy would come to only once it drives well.
    """

    def __init__(self, seed: int, **settings: object) -> None:
        self.halves = [
            envs.Rows(
                WORLDS // 2, slots=SLOTS, seed=seed + i, keep_final=True, sampler=Mixed(), start=start, **settings
            )
            for i, start in ((0, "first"), (1000, "random"))
        ]
        for rows in self.halves:
            rows.reset()

    def all(self, name: str) -> np.ndarray:
        """An array of both halves."""
        return np.concatenate([getattr(rows, name) for rows in self.halves])

    def step(self, actions: np.ndarray) -> list[dict[str, object]]:
        """Drives; returns what is known about those that have ended."""
        ended: list[dict[str, object]] = []
        for rows, given in zip(self.halves, np.split(actions, 2), strict=True):
            rows.step(given)
            if rows.terminals.any() or rows.truncations.any():
                ended += rows.infos()
        return ended


@torch.no_grad()
def collect(fleet: Fleet, policy: Policy, batch: Batch, ended: list[dict[str, object]]) -> int:
    """Drives and writes the batch; returns the number of agent-steps."""
    for t in range(STEPS):
        batch.observations[t], batch.masks[t] = fleet.all("observations"), fleet.all("masks")
        driving = batch.masks[t]
        mean, value = policy(torch.from_numpy(batch.observations[t, driving]))
        actions = mean + policy.log_std.exp() * torch.randn_like(mean)
        batch.actions[t, driving], batch.values[t, driving] = actions.numpy(), value.numpy()
        batch.log_probabilities[t, driving] = policy.log_probability(mean, actions).numpy()
        ended += fleet.step(np.clip(batch.actions[t], -1, 1))
        cuts = fleet.all("truncations")
        batch.rewards[t], batch.ends[t] = fleet.all("rewards"), fleet.all("terminals") | cuts
        batch.bootstraps[t] = 0.0
        if cuts.any():
            last = torch.from_numpy(fleet.all("final_observations")[cuts])
            batch.bootstraps[t, cuts] = policy(last)[1].numpy()
    batch.values[STEPS] = policy(torch.from_numpy(fleet.all("observations")))[1].numpy()
    return int(batch.masks.sum())


def improve(policy: Policy, optimizer: torch.optim.Optimizer, batch: Batch) -> None:
    """Some epochs over what was driven."""
    advantages = batch.advantages()
    driven = batch.masks
    tensors = [
        torch.from_numpy(one[driven])
        for one in (batch.observations, batch.actions, batch.log_probabilities, advantages, batch.values[:-1])
    ]
    observations, actions, before, gains, values = tensors
    returns = gains + values
    gains = (gains - gains.mean()) / (gains.std() + 1e-8)
    for _ in range(EPOCHS):
        for part in torch.randperm(len(gains)).split(MINIBATCH):
            mean, value = policy(observations[part])
            ratio = (policy.log_probability(mean, actions[part]) - before[part]).exp()
            gain = gains[part]
            surrogate = torch.minimum(ratio * gain, ratio.clamp(1 - CLIP, 1 + CLIP) * gain).mean()
            error = (value - returns[part]).pow(2).mean()
            loss = -surrogate + VALUE * error - ENTROPY * policy.log_std.sum()
            optimizer.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(policy.parameters(), 0.5)
            optimizer.step()


def train(
    seconds: float, most_steps: int, seed: int, threads: int, more: list[Path] | None = None
) -> tuple[Policy, list[dict[str, float]]]:
    """A policy, trained on the shipped scenarios and more, and how it came about: one entry per update."""
    torch.manual_seed(seed)
    fleet = Fleet(seed, scenarios=[*SCENARIOS, *(more or [])], threads=threads, **SETTINGS)
    n, n_actions = fleet.all("observations").shape[1], fleet.all("actions").shape[1]
    policy, batch = Policy(n, n_actions), Batch(WORLDS * SLOTS, n, n_actions)
    optimizer = torch.optim.Adam(policy.parameters(), lr=LEARNING_RATE, eps=1e-5)
    begin, steps, curve, is_grown = time.perf_counter(), 0, [], False
    while time.perf_counter() - begin < seconds and steps < most_steps:
        for group in optimizer.param_groups:
            group["lr"] = LEARNING_RATE * max(0.02, 1 - steps / most_steps)
        if steps >= GROWN * most_steps and not is_grown:
            is_grown = True
            for rows in fleet.halves:
                rows.update(**{"reward.off_road": -1.0})
        ended: list[dict[str, object]] = []
        driven = collect(fleet, policy, batch, ended)
        if steps:
            improve(policy, optimizer, batch)
        policy.watch(torch.from_numpy(batch.observations[batch.masks]))
        steps += driven
        shares = [float(np.mean([info["outcome"] == name for info in ended])) for name in WATCHED] if ended else []
        total = float(np.mean([info["return"] for info in ended])) if ended else 0.0
        entry = {"seconds": time.perf_counter() - begin, "steps": steps, "return": total}
        curve.append(entry | dict(zip(WATCHED, shares, strict=True)))
        if len(curve) % 10 == 1:
            told = ", ".join(f"{name} {share:.0%}" for name, share in zip(WATCHED, shares, strict=True))
            print(f"{entry['seconds']:5.0f} s, {steps:8d} steps: return {total:5.2f}, {told}", flush=True)
    return policy, curve


def export(policy: Policy, path: Path) -> None:
    """The policy as a file for `--planner policy,file=FILE`, which needs neither the value nor what was watched."""
    layers = [layer for layer in policy.mean if isinstance(layer, nn.Linear)]
    kept = {}
    for name, layer in zip(("hidden.0", "hidden.1", "action"), layers, strict=True):
        weight, bias = layer.weight.detach().numpy(), layer.bias.detach().numpy()
        if name == "hidden.0":
            weight = weight / policy.spread.clamp(min=SPREAD_MIN).numpy()
            bias = bias - weight @ policy.center.numpy()
        kept |= {f"{name}.weight": weight, f"{name}.bias": bias}
    envs.export_policy(path, kept)


def picture(curve: list[dict[str, float]], path: Path) -> None:
    """Goals reached over decisions."""
    steps = np.array([entry["steps"] for entry in curve]) / 1e6
    success = 100 * np.array([entry.get("goal_reached", 0.0) for entry in curve])
    figure, axes = plt.subplots(figsize=(6, 3.2), layout="constrained")
    axes.plot(steps, success, color="#9bb7d4", linewidth=0.8)
    width = max(1, len(curve) // 25)
    smooth = np.convolve(success, np.ones(width) / width, mode="valid")
    axes.plot(steps[width - 1 :], smooth, color="#1f4e79", linewidth=1.6)
    axes.set(xlabel="decisions of agents [million]", ylabel="goals reached [%]", ylim=(0, 100), xlim=(0, None))
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=160)
    plt.close(figure)


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--out", type=Path, default=Path("out/ppo"))
    arguments.add_argument("--seconds", type=float, default=600.0, help="stops then")
    arguments.add_argument("--steps", type=int, default=3_000_000, help="decisions of agents")
    arguments.add_argument("--seed", type=int, default=0)
    arguments.add_argument("--threads", type=int, default=2)
    arguments.add_argument("--scenarios", type=Path, nargs="*", help="files or folders besides the shipped scenarios")
    given = arguments.parse_args()
    torch.set_num_threads(given.threads)
    given.out.mkdir(parents=True, exist_ok=True)
    policy, curve = train(given.seconds, given.steps, given.seed, given.threads, given.scenarios)
    (given.out / "curve.json").write_text(json.dumps(curve))
    picture(curve, given.out / "curve.png")
    export(policy, given.out / "policy.safetensors")


if __name__ == "__main__":
    main()
