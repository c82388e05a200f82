"""Two lanes that become one: the second comes down to the first along x from y = 6 m, over 100 m.

A recorded car in the second lane keeps its speed and its way whatever the agent in the first lane does; both are 4.5 m
long. Nobody has to give way by the rules, so the agent has to make room of its own.
"""

import numpy as np
import pytest

import interdrive as idr
from interdrive.scenario import Lanelets
from interdrive.testing import Car, problem, world

ASIDE, OVER, LENGTH = 6.0, 100.0, 300.0
SLOPE = np.arctan2(ASIDE, OVER)


def _joining(speed, ahead):
    """The agent at x = 20 m with 14 m/s; the other car so fast and so far ahead of it."""
    x = np.linspace(0.0, LENGTH, 61)

    def bound(aside):
        return np.column_stack([x, aside])

    down = np.clip(ASIDE * (1.0 - x / OVER), 0.0, None)
    none = np.zeros(2, dtype=np.bool_)
    lanes = Lanelets(
        ids=np.array([1, 2]), left=(bound(0.0 * x + 1.75), bound(down + 1.75)),
        right=(bound(0.0 * x - 1.75), bound(down - 1.75)), predecessors=((), ()), successors=((), ()),
        adjacent_left=np.array([-1, -1]), adjacent_left_same_direction=none,
        adjacent_right=np.array([-1, -1]), adjacent_right_same_direction=none,
        speed_limit=np.full(2, np.nan), types=((), ()),
    )  # fmt: skip
    start = 20.0 + ahead
    other = Car(11, start, ASIDE * (1.0 - start / OVER), speed, orientation=-SLOPE, last=60)
    agent = problem(1, 20.0, 0.0, 14.0, goal=(280.0, 0.0), time_step=(0, 300))
    return world(lanes, cars=[other], problems=[agent], steps=300)


@pytest.mark.parametrize("planner", ["idm", "idm_mobil", "lawful", "rollout", "velocity_adjusting"])
@pytest.mark.parametrize(("speed", "ahead"), [(15.0, 0.0), (15.5, -1.5), (14.5, 0.5)])
def test_beside_a_faster_car_that_joins_an_agent_falls_behind_it(planner, speed, ahead):
    run = idr.simulate(_joining(speed, ahead), planner=planner, settings={"rules.enabled": False}, threads=1)
    assert run.outcomes.outcome[0] != "collision"
    if planner != "lawful":  # which first speeds up to the other's speed
        row = run.states.participant_id.tolist().index(1)
        assert np.nanmin(run.states.acceleration[row]) > -4.0
