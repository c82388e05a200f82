"""Stored steps: faster worlds observe, reward and end what slower ones did.

`python tests/envs/test_stored_steps.py` stores them anew, if what learners are told is meant to change.
"""

from pathlib import Path

import numpy as np
import pytest

from interdrive import envs

STORED = Path(__file__).with_name("stored_steps.npz")
SCENARIOS = ("t_junction", "intersection", "lane_merge", "highway", "signals")
#: Where the blocks of an observation begin: ego, goal, route, partners.
BLOCKS = (0, 16, 28, 156)
#: Every so many steps whole observations are stored, too.
WHOLE_EVERY = 40


def told(scenario, steps=80):
    """What learners are told: a weighted sum of each block, in some steps all of it; whose row, rewards, outcomes."""
    rows = envs.Rows(2, slots=6, scenarios=scenario, start="random")
    rows.reset(5)
    rng = np.random.default_rng(1)
    weights = rng.uniform(0.5, 1.5, rows.observations.shape[1])
    found = {name: [] for name in ("blocks", "whole", "agent_ids", "rewards", "outcomes")}
    for step in range(steps):
        # Half of the pedal and a twentieth of the wheel, so that some episodes last.
        rows.step((rng.uniform(-1, 1, rows.actions.shape) * (0.5, 0.05)).astype(np.float32))
        found["blocks"].append(np.add.reduceat(rows.observations * weights, BLOCKS, axis=1))
        found["agent_ids"].append(np.where(rows.masks, rows.agent_ids, -1))
        found["rewards"].append(rows.rewards.copy())
        found["outcomes"].append(rows.outcomes.copy())
        if step % WHOLE_EVERY == 0:
            found["whole"].append(rows.observations.copy())
    return {name: np.array(one) for name, one in found.items()}


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_learners_are_told_what_they_were_told_when_the_steps_were_stored(scenario):
    with np.load(STORED) as stored:
        then = {name: stored[f"{scenario}.{name}"] for name in ("blocks", "whole", "agent_ids", "rewards", "outcomes")}
    now = told(scenario)
    for name in ("agent_ids", "outcomes"):
        np.testing.assert_array_equal(now[name], then[name])
    for name in ("rewards", "blocks", "whole"):
        np.testing.assert_allclose(now[name], then[name], rtol=0, atol=1e-6)


if __name__ == "__main__":
    arrays = {f"{scenario}.{name}": one for scenario in SCENARIOS for name, one in told(scenario).items()}
    np.savez_compressed(STORED, **arrays)
