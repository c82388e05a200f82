"""Trains a shared policy by proximal policy optimization on the shipped scenarios, and counts how its agents end.

    python examples/rl/ppo.py --out out/ppo                    # trains, at most 10 minutes
    python examples/rl/ppo.py --out out/ppo --evaluate FOLDER  # counts only; FOLDER holds scenarios it never saw

Needs torch, and `pip install "interdrive[rl]"`. Schulman et al., "Proximal policy optimization algorithms", 2017,
arXiv 1707.06347; generalized advantages as in arXiv 1506.02438.
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

STEPS, WORLDS, SLOTS = 128, 16, 31
EPOCHS, MINIBATCH = 4, 4096
DISCOUNT, TRACE = 0.99, 0.95
CLIP, ENTROPY, VALUE = 0.2, 0.003, 0.5
LEARNING_RATE = 3e-4
WIDTH = 128
#: Scenarios of the table: those without and with the highway.
A = ["t_junction", "intersection", "lane_merge"]
B = [*A, "highway"]


class Policy(nn.Module):
    """Two hidden layers, a mean action with a free spread, and a value."""

    def __init__(self, observations: int, actions: int) -> None:
        super().__init__()
        self.hidden = nn.ModuleList([nn.Linear(observations, WIDTH), nn.Linear(WIDTH, WIDTH)])
        self.action, self.value = nn.Linear(WIDTH, actions), nn.Linear(WIDTH, 1)
        self.log_std = nn.Parameter(torch.full((actions,), -1.0))
        for layer, gain in ((self.hidden[0], 2**0.5), (self.hidden[1], 2**0.5), (self.action, 0.01), (self.value, 1.0)):
            nn.init.orthogonal_(layer.weight, gain)
            nn.init.zeros_(layer.bias)

    def forward(self, observations: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Mean actions and values."""
        x = observations
        for layer in self.hidden:
            x = torch.tanh(layer(x))
        return self.action(x), self.value(x).squeeze(-1)

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


@torch.no_grad()
def collect(rows: envs.Rows, policy: Policy, batch: Batch, ended: list[dict[str, object]]) -> int:
    """Drives and writes the batch; returns the number of agent-steps."""
    for t in range(STEPS):
        observations = torch.from_numpy(rows.observations)
        mean, value = policy(observations)
        actions = mean + policy.log_std.exp() * torch.randn_like(mean)
        batch.observations[t], batch.masks[t] = rows.observations, rows.masks
        batch.actions[t], batch.values[t] = actions.numpy(), value.numpy()
        batch.log_probabilities[t] = policy.log_probability(mean, actions).numpy()
        rows.step(np.clip(batch.actions[t], -1, 1))
        batch.rewards[t], batch.ends[t] = rows.rewards, rows.terminals | rows.truncations
        batch.bootstraps[t] = 0.0
        if batch.ends[t].any():
            ended += rows.infos()
            cut = np.flatnonzero(rows.truncations)
            if len(cut):
                batch.bootstraps[t, cut] = policy(torch.from_numpy(rows.final_observations[cut]))[1].numpy()
    batch.values[STEPS] = policy(torch.from_numpy(rows.observations))[1].numpy()
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
    scenarios: object, seconds: float, most_steps: int, seed: int, **settings: object
) -> tuple[Policy, list[dict[str, float]]]:
    """A policy, and how it came about: one entry per update."""
    torch.manual_seed(seed)
    rows = envs.Rows(WORLDS, slots=SLOTS, seed=seed, keep_final=True, scenarios=scenarios, start="random", **settings)
    rows.reset()
    policy = Policy(rows.observations.shape[1], rows.actions.shape[1])
    optimizer = torch.optim.Adam(policy.parameters(), lr=LEARNING_RATE, eps=1e-5)
    batch = Batch(rows.num_agents, rows.observations.shape[1], rows.actions.shape[1])
    begin, steps, curve = time.perf_counter(), 0, []
    while (passed := time.perf_counter() - begin) < seconds and steps < most_steps:
        for group in optimizer.param_groups:
            group["lr"] = LEARNING_RATE * max(0.02, 1 - max(passed / seconds, steps / most_steps))
        ended: list[dict[str, object]] = []
        steps += collect(rows, policy, batch, ended)
        improve(policy, optimizer, batch)
        success = float(np.mean([info["is_success"] for info in ended])) if ended else 0.0
        total = float(np.mean([info["return"] for info in ended])) if ended else 0.0
        curve.append({"seconds": time.perf_counter() - begin, "steps": steps, "success": success, "return": total})
        if len(curve) % 10 == 1:
            print(f"{curve[-1]['seconds']:5.0f} s, {steps:8d} steps: goals reached {success:.0%}, return {total:.2f}")
    return policy, curve


@torch.no_grad()
def outcomes(policy: Policy, scenarios: object, **settings: object) -> dict[str, float]:
    """Shares of outcomes if all agents of scenarios drive by the mean action, from the first time step on."""
    found: list[str] = []
    for scenario in scenarios:
        env = envs.parallel_env(scenarios=scenario, **settings)
        observations, _ = env.reset(seed=0)
        while env.agents:
            names = env.agents
            mean, _ = policy(torch.from_numpy(np.stack([observations[name] for name in names])))
            observations, _, _, _, infos = env.step(dict(zip(names, mean.clamp(-1, 1).numpy(), strict=True)))
            for info in infos.values():
                if info:
                    found.append("off_road" if info["off_road"] else str(info["outcome"]))
    return {name: found.count(name) / len(found) for name in sorted(set(found))} | {"agents": len(found)}


def export(policy: Policy, path: Path) -> None:
    """The policy as a file for `--planner policy,file=FILE`; the value is not needed to drive."""
    weights = {name: one.detach().numpy() for name, one in policy.state_dict().items()}
    kept = {name: one for name, one in weights.items() if name.startswith(("hidden.", "action."))}
    envs.export_policy(path, kept)


def picture(curve: list[dict[str, float]], path: Path) -> None:
    """Goals reached over agent-steps."""
    steps = np.array([entry["steps"] for entry in curve]) / 1e6
    success = 100 * np.array([entry["success"] for entry in curve])
    figure, axes = plt.subplots(figsize=(6, 3.2), layout="constrained")
    axes.plot(steps, success, color="#9bb7d4", linewidth=0.8)
    width = max(1, len(curve) // 25)
    smooth = np.convolve(success, np.ones(width) / width, mode="valid")
    axes.plot(steps[width - 1 :], smooth, color="#1f4e79", linewidth=1.6)
    axes.set(xlabel="agent-steps [million]", ylabel="goals reached [%]", ylim=(0, 100), xlim=(0, None))
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=160)
    plt.close(figure)


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--out", type=Path, default=Path("out/ppo"))
    arguments.add_argument("--seconds", type=float, default=600.0)
    arguments.add_argument("--steps", type=int, default=5_000_000)
    arguments.add_argument("--seed", type=int, default=0)
    arguments.add_argument("--threads", type=int, default=2)
    arguments.add_argument("--evaluate", type=Path, help="count the outcomes of a policy trained before")
    arguments.add_argument("--unseen", type=Path, help="folder with scenarios that are never trained on")
    given = arguments.parse_args()
    torch.set_num_threads(given.threads)
    given.out.mkdir(parents=True, exist_ok=True)
    if given.evaluate is None:
        policy, curve = train(B, given.seconds, given.steps, given.seed, threads=given.threads)
        torch.save(policy.state_dict(), given.out / "policy.pt")
        (given.out / "curve.json").write_text(json.dumps(curve))
        picture(curve, given.out / "curve.png")
        export(policy, given.out / "policy.safetensors")
    else:
        policy = Policy(324, 2)
        policy.load_state_dict(torch.load(given.evaluate, weights_only=True))
    sets = {"A": A, "B": B}
    if given.unseen is not None:
        sets["C"] = sorted(given.unseen.glob("ZAM_Tjunction-*.xml"))
    table = {name: outcomes(policy, scenarios) for name, scenarios in sets.items()}
    (given.out / "outcomes.json").write_text(json.dumps(table, indent=2))
    for name, shares in table.items():
        print(
            name,
            ", ".join(f"{what} {share:.0%}" for what, share in shares.items() if what != "agents"),
            int(shares["agents"]),
        )


if __name__ == "__main__":
    main()
