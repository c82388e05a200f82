"""Stored steps: faster worlds observe, reward and end what slower ones did.

`python tests/envs/test_stored_steps.py` stores them anew, if what learners are told is meant to change.
"""

from pathlib import Path

import numpy as np
import pytest

from interdrive import envs

STORED = Path(__file__).with_name("stored_steps.npz")
SCENARIOS = ("t_junction", "intersection", "lane_merge", "highway", "signals")


def told(scenario, steps=80):
    """What learners are told in some steps: a weighted sum of every observation, rewards, outcomes."""
    rows = envs.Rows(2, slots=6, scenarios=scenario, start="random")
    rows.reset(5)
    rng = np.random.default_rng(1)
    weights = rng.uniform(0.5, 1.5, rows.observations.shape[1])
    found = []
    for _ in range(steps):
        # Half of the pedal and a twentieth of the wheel, so that some episodes last.
        rows.step((rng.uniform(-1, 1, rows.actions.shape) * (0.5, 0.05)).astype(np.float32))
        found.append((rows.observations @ weights, rows.rewards.astype(float), rows.outcomes.astype(float)))
    return np.array(found)


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_learners_are_told_what_they_were_told_when_the_steps_were_stored(scenario):
    with np.load(STORED) as stored:
        observed, rewards, outcomes = stored[scenario].swapaxes(0, 1)
    now_observed, now_rewards, now_outcomes = told(scenario).swapaxes(0, 1)
    np.testing.assert_array_equal(now_outcomes, outcomes)
    np.testing.assert_allclose(now_rewards, rewards, rtol=0, atol=1e-6)
    np.testing.assert_allclose(now_observed, observed, rtol=0, atol=1e-6)


if __name__ == "__main__":
    np.savez_compressed(STORED, **{scenario: told(scenario) for scenario in SCENARIOS})
