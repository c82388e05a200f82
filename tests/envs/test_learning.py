"""A learner learns: a linear policy follows a bend that doing nothing leaves.

The policy gradient is written in numpy here, so that this needs no library for learning.
"""

import numpy as np

from interdrive import envs
from interdrive.testing import bend, problem, world

WORLDS, STEPS, UPDATES, EPOCHS = 32, 64, 73, 10
DISCOUNT, TRACE, CLIP = 0.95, 0.9, 0.2
#: Longer decisions, so that their effects can be seen; leaving the road is cheap, so that standing does not pay.
SETTINGS = {"decision_seconds": 0.5, "reward.off_road": -0.2}


def starts(n, seed):
    """Bends of radius 30 m that a car comes to with another speed, offset and heading each time."""
    rng = np.random.default_rng(seed)
    found = []
    for i in range(n):
        x, y, turn, velocity = rng.uniform((-45, -0.4, -0.05, 5), (-15, 0.4, 0.05, 9))
        car = problem(
            1, x, y, velocity, turn, goal=(30.0, 60.0), goal_size=(20.0, 3.5), goal_orientation=np.pi / 2,
            time_step=(1, 300),
        )  # fmt: skip
        found.append(world(bend(), problems=[car], name=f"bend_{i}"))
    return found


class Learner:
    """Normal actions around a linear mean, and a linear value, of observations divided by their spread."""

    def __init__(self, rows, rng):
        self.rows, self.rng = rows, rng
        n = rows.observations.shape[1] + 1
        self.weights = {"mean": np.zeros((n, 2)), "log_std": np.full(2, -1.5), "value": np.zeros((n, 1))}
        self.moments = {name: (np.zeros_like(one), np.zeros_like(one)) for name, one in self.weights.items()}
        self.center, self.spread, self.updates = np.zeros(n - 1), np.ones(n - 1), 0

    def inputs(self, observations):
        return np.column_stack([(observations - self.center) / self.spread, np.ones(len(observations))])

    def log_probability(self, x, actions):
        off = (actions - x @ self.weights["mean"]) / np.exp(self.weights["log_std"])
        return -(0.5 * off**2 + self.weights["log_std"]).sum(1), off

    def collect(self):
        rows, kept = self.rows, {name: [] for name in ("x", "actions", "rewards", "values", "ends")}
        for _ in range(STEPS):
            x = self.inputs(rows.observations)
            actions = x @ self.weights["mean"] + np.exp(self.weights["log_std"]) * self.rng.standard_normal((len(x), 2))
            rows.step(np.clip(actions, -1, 1).astype(np.float32))
            ends = rows.terminals | rows.truncations
            values = (x @ self.weights["value"])[:, 0]
            for name, one in zip(kept, (x, actions, rows.rewards.copy(), values, ends), strict=True):
                kept[name].append(one)
        kept["values"].append((self.inputs(rows.observations) @ self.weights["value"])[:, 0])
        return {name: np.array(one) for name, one in kept.items()}

    def improve(self, kept, share):
        gains, last = np.zeros_like(kept["rewards"]), 0.0
        for t in reversed(range(STEPS)):
            goes_on = ~kept["ends"][t]
            surprise = kept["rewards"][t] + DISCOUNT * goes_on * kept["values"][t + 1] - kept["values"][t]
            last = surprise + DISCOUNT * TRACE * goes_on * last
            gains[t] = last
        x, actions = kept["x"].reshape(STEPS * WORLDS, -1), kept["actions"].reshape(-1, 2)
        returns = (gains + kept["values"][:-1]).reshape(-1, 1)
        gains = ((gains - gains.mean()) / gains.std()).reshape(-1)
        before = self.log_probability(x, actions)[0]
        for _ in range(EPOCHS):
            now, off = self.log_probability(x, actions)
            ratio = np.exp(now - before)
            # The gradient of the clipped surrogate: none where the ratio is already on the wanted side.
            weight = np.where((gains > 0) & (ratio > 1 + CLIP) | (gains < 0) & (ratio < 1 - CLIP), 0.0, ratio * gains)
            pull = weight[:, None] * off / len(x)
            self.move("mean", x.T @ (pull / np.exp(self.weights["log_std"])), 0.001 * share)
            self.move("log_std", (weight[:, None] * (off**2 - 1)).mean(0), 0.003 * share)
            self.move("value", x.T @ (returns - x @ self.weights["value"]) / len(x), 0.002 * share)

    def move(self, name, gradient, rate):
        first, second = self.moments[name]
        first += 0.1 * (gradient - first)
        second += 0.01 * (gradient**2 - second)
        self.updates += 1
        self.weights[name] += rate * first / (np.sqrt(second) + 1e-8)

    def learn(self):
        self.rows.reset()
        kept = self.collect()
        seen = kept["x"].reshape(STEPS * WORLDS, -1)[:, :-1]
        # What hardly changes is not blown up; nothing learned so far has to be forgotten.
        self.center, self.spread = seen.mean(0), np.maximum(seen.std(0), 0.05)
        for update in range(UPDATES):
            self.improve(self.collect(), 1 - update / UPDATES)


def successes(scenarios, act):
    """How many reach the goal of as many scenarios."""
    found = []
    for scenario in scenarios:
        env = envs.DriveEnv(scenarios=scenario, **SETTINGS)
        observation, info = *env.reset(seed=0)[:1], {}
        while not info:
            observation, *_, info = env.step(act(observation))
        found.append(info["is_success"])
    return sum(found)


def test_a_linear_policy_learns_to_follow_a_bend_that_it_has_not_started_in():
    unseen = starts(64, seed=1)
    assert successes(unseen, lambda _: np.zeros(2, np.float32)) == 0
    rows = envs.Rows(WORLDS, scenarios=starts(64, seed=0), max_seconds=25.0, seed=0, **SETTINGS)
    learner = Learner(rows, np.random.default_rng(0))
    learner.learn()

    def act(observation):
        return np.clip(learner.inputs(observation[None]) @ learner.weights["mean"], -1, 1)[0].astype(np.float32)

    assert successes(unseen, act) >= 58
