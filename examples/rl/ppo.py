"""Trains a policy that all agents share, by proximal policy optimization, on the shipped scenarios.

    OPENBLAS_NUM_THREADS=1 python examples/rl/ppo.py --out out/ppo     # at most 10 minutes on two cores
    python examples/rl/ppo.py --scenarios out/varied  # and on what scenarios/varied.py has made
    python examples/rl/compare.py out/ppo/policy.safetensors

Writes the policy, which is a planner, and its curve. Needs `pip install "interdrive[rl]"`. Schulman et al.,
"Proximal policy optimization algorithms", 2017, arXiv 1707.06347; generalized advantages as in arXiv 1506.02438.
"""

from __future__ import annotations

import argparse
import json
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from policy import Adam, Policy

from interdrive import InputError, envs

STEPS, WORLDS, SLOTS = 32, 24, 31
EPOCHS, MINIBATCH = 4, 1024
#: Parts of a minibatch that threads share; the result does not depend on how many threads there are.
SHARES = 2
DISCOUNT, TRACE = 0.97, 0.9
CLIP, ENTROPY, VALUE = 0.2, 0.003, 0.5
LEARNING_RATE = 1e-3
#: Outcomes that are printed and drawn while it learns.
WATCHED = ("goal_reached", "goal_missed", "collision", "time_limit")
#: Arrays of the worlds.
ARRAYS = (
    "actions",
    "observations",
    "rewards",
    "terminals",
    "truncations",
    "masks",
    "final_observations",
)
#: What is trained on.
SCENARIOS = ["t_junction", "intersection", "lane_merge", "highway"]
#: A decision lasts half a second, so that its effects can be told from those of the next. At first leaving the road
#: costs little: while all drivers leave it sooner or later, a high price teaches them to stand still.
SETTINGS = {"decision_seconds": 0.5, "reward.off_road": -0.3}
#: From this share of the training on it costs as much as a collision.
GROWN = 0.5


class Batch:
    """What a policy did for some steps in all rows.

    Inputs of its networks and actions are of the rows that drove, one step after the other; all else is (STEPS, rows).
    """

    def __init__(self, rows: int, observations: int, actions: int) -> None:
        self.inputs = np.zeros((STEPS * rows, observations), np.float32)
        self.actions = np.zeros((STEPS * rows, actions), np.float32)
        self.log_probabilities = np.zeros(STEPS * rows, np.float32)
        self.n = 0
        #: Number, mean and spread of the observations.
        self.watched: tuple[int, np.ndarray, np.ndarray] | None = None
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
        # Both halves of the worlds write halves of the same arrays, of shapes that a single world tells.
        one = envs.Rows(1, slots=1, keep_final=True, **{**settings, "scenarios": SCENARIOS[0]})
        shapes = {name: getattr(one, name) for name in ARRAYS}
        self.arrays = {
            name: np.zeros((WORLDS * SLOTS, *array.shape[1:]), array.dtype) for name, array in shapes.items()
        }
        parts = [{name: np.split(array, 2)[i] for name, array in self.arrays.items()} for i in range(2)]
        of = {"num_worlds": WORLDS // 2, "slots": SLOTS, "keep_final": True, **settings}
        self.halves = [
            envs.Rows(seed=seed + i, sampler=Mixed(), start=start, buf=part, **of)
            for (i, start), part in zip(((0, "first"), (1000, "random")), parts, strict=True)
        ]
        for rows in self.halves:
            rows.reset()

    def step(self) -> list[dict[str, object]]:
        """Drives as `actions` says; returns what is known about those that have ended."""
        ended: list[dict[str, object]] = []
        for rows in self.halves:
            rows.step()
            if rows.terminals.any() or rows.truncations.any():
                ended += rows.infos()
        return ended


def collect(fleet: Fleet, policy: Policy, batch: Batch, rng: np.random.Generator) -> list[dict[str, object]]:
    """Drives and writes the batch; returns what is known about those that have ended."""
    arrays, ended, n = fleet.arrays, [], 0
    std = np.exp(policy.parts(policy.parameters)["log_std"])
    for t in range(STEPS):
        driving = batch.masks[t]
        driving[:] = arrays["masks"]
        x = policy.inputs(arrays["observations"][driving])
        done = policy.forward(x)
        off = rng.standard_normal(done.mean.shape, np.float32)
        actions = done.mean + std * off
        own = slice(n, n + len(x))
        batch.inputs[own], batch.actions[own], batch.log_probabilities[own] = x, actions, policy.log_probability(off)
        batch.values[t] = 0.0
        batch.values[t, driving] = done.value
        arrays["actions"][driving] = np.clip(actions, -1, 1)
        n += len(x)
        ended += fleet.step()
        cuts = arrays["truncations"]
        batch.rewards[t], batch.ends[t] = arrays["rewards"], arrays["terminals"] | cuts
        batch.bootstraps[t] = 0.0
        if cuts.any():
            batch.bootstraps[t, cuts] = policy.forward(policy.inputs(arrays["final_observations"][cuts])).value
    batch.n, batch.watched = n, policy.watched(batch.inputs[:n])
    driving = arrays["masks"]
    batch.values[STEPS] = 0.0
    batch.values[STEPS, driving] = policy.forward(policy.inputs(arrays["observations"][driving])).value
    return ended


def gradient_of_loss(
    policy: Policy, x: np.ndarray, actions: np.ndarray, before: np.ndarray, gains: np.ndarray, returns: np.ndarray
) -> np.ndarray:
    """That of all parameters: actions that led to more than expected become likelier, values better, spreads wider."""
    n, gradient = len(x), np.empty_like(policy.parameters)
    std = np.exp(policy.parts(policy.parameters)["log_std"])
    done = policy.forward(x)
    off = (actions - done.mean) / std
    ratio = np.exp(policy.log_probability(off) - before)
    # What has become likely enough, or unlikely enough, no longer counts.
    counts = np.where(gains > 0, ratio <= 1 + CLIP, ratio >= 1 - CLIP)
    pull = (counts * ratio * gains / n)[:, None]
    policy.backward(done, -pull * off / std, (2 * VALUE / n) * (done.value - returns), gradient)
    policy.parts(gradient)["log_std"][:] = (-pull * (off**2 - 1)).sum(0) - ENTROPY
    return gradient


def improve(
    policy: Policy, optimizer: Adam, rate: float, batch: Batch, rng: np.random.Generator, pool: ThreadPoolExecutor
) -> None:
    """Some epochs over what was driven; the gradient of a part is the mean of those of its shares, one per thread."""
    gains = batch.advantages()[batch.masks]
    returns = gains + batch.values[:-1][batch.masks]
    gains = (gains - gains.mean()) / (gains.std() + 1e-8)

    def gradient(part: np.ndarray) -> np.ndarray:
        driven = batch.inputs[part], batch.actions[part], batch.log_probabilities[part]
        return gradient_of_loss(policy, *driven, gains[part], returns[part])

    for _ in range(EPOCHS):
        order = rng.permutation(batch.n)
        for begin in range(0, batch.n, MINIBATCH):
            part = order[begin : begin + MINIBATCH]
            shares = [share for share in np.array_split(part, SHARES) if len(share)]
            weights = [np.float32(len(share) / len(part)) for share in shares]
            found = [weight * one for weight, one in zip(weights, pool.map(gradient, shares), strict=True)]
            optimizer.move(policy.parameters, np.sum(found, axis=0), rate, 0.5)


def train(
    seconds: float, most_steps: int, seed: int, threads: int, more: list[Path] | None = None
) -> tuple[Policy, list[dict[str, float]]]:
    """A policy, trained on the shipped scenarios and more, and how it came about: one entry per update."""
    rng = np.random.default_rng(seed)
    fleet = Fleet(seed, scenarios=[*SCENARIOS, *(more or [])], threads=threads, **SETTINGS)
    n, n_actions = fleet.arrays["observations"].shape[1], fleet.arrays["actions"].shape[1]
    policy, batch = Policy(n, n_actions, rng), Batch(WORLDS * SLOTS, n, n_actions)
    optimizer = Adam(len(policy.parameters))
    begin, steps, curve, is_grown = time.perf_counter(), 0, [], False
    with ThreadPoolExecutor(threads) as pool:
        while time.perf_counter() - begin < seconds and steps < most_steps:
            if steps >= GROWN * most_steps and not is_grown:
                is_grown = True
                for rows in fleet.halves:
                    rows.update(**{"reward.off_road": -1.0})
            ended = collect(fleet, policy, batch, rng)
            # The first batch only shows what observations are like.
            if steps:
                improve(policy, optimizer, LEARNING_RATE * max(0.02, 1 - steps / most_steps), batch, rng, pool)
            policy.watch(*batch.watched)
            steps += batch.n
            curve.append(told(time.perf_counter() - begin, steps, ended))
            if len(curve) % 10 == 1:
                print(", ".join(f"{name} {value:.2f}" for name, value in curve[-1].items()), flush=True)
    return policy, curve


def told(seconds: float, steps: int, ended: list[dict[str, object]]) -> dict[str, float]:
    """An entry of the curve."""
    shares = {name: float(np.mean([info["outcome"] == name for info in ended])) for name in WATCHED} if ended else {}
    total = float(np.mean([info["return"] for info in ended])) if ended else 0.0
    return {"seconds": seconds, "steps": steps, "return": total, **shares}


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
    if given.steps < 1 or given.threads < 1:
        arguments.error("--steps and --threads must be at least 1")
    given.out.mkdir(parents=True, exist_ok=True)
    try:
        policy, curve = train(given.seconds, given.steps, given.seed, given.threads, given.scenarios)
    except InputError as error:
        arguments.error(str(error))
    (given.out / "curve.json").write_text(json.dumps(curve))
    picture(curve, given.out / "curve.png")
    policy.export(given.out / "policy.safetensors")


if __name__ == "__main__":
    main()
