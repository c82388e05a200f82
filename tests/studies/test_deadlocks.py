"""Circles of agents that stand because of each other: bodies ahead, and agreements to hold."""

from types import SimpleNamespace

import numpy as np
import pytest

from interdrive.run import States
from interdrive.run.arrays import Agreements
from interdrive.studies.cooperation import deadlocks

N_STEPS = 150


def standing(places, held=(), moves=()):
    """15 s in which agents of 4 m by 2 m stand at (x, y, heading); `held` has (holding, going, first, last)."""
    shape = (len(places), N_STEPS)
    x, y, heading = (np.repeat([[place[i]] for place in places], N_STEPS, axis=1).astype(float) for i in range(3))
    ids = np.arange(1, len(places) + 1)
    states = States(
        participant_id=ids,
        kinds=("car",) * len(places),
        first_time_step=20,
        is_agent=np.ones(len(places), dtype=bool),
        is_static=np.zeros(len(places), dtype=bool),
        length=np.full(len(places), 4.0),
        width=np.full(len(places), 2.0),
        valid=np.ones(shape, dtype=bool),
        x=x,
        y=y,
        orientation=heading,
        velocity=np.where(np.isin(ids, moves)[:, None], 5.0, np.zeros(shape)),
        acceleration=np.zeros(shape),
        yaw_rate=np.zeros(shape),
    )
    columns = np.array(held, dtype=np.int64).reshape(-1, 4).T
    bars = {name: np.zeros(len(held)) for name in ("bar_x", "bar_y", "bar_heading")}
    agreements = Agreements(*columns, **bars)
    return SimpleNamespace(states=states, scenario=SimpleNamespace(dt=0.1), agreements=agreements if held else None)


#: Two that face each other 30 m apart.
APART = ((0.0, 0.0, 0.0), (30.0, 0.0, np.pi))
ALWAYS = (20, 169)


@pytest.mark.parametrize(
    ("held", "found"),
    [
        ((), ()),
        (((1, 2, *ALWAYS), (2, 1, *ALWAYS)), ((1, 2),)),
        (((1, 2, *ALWAYS), (2, -1, *ALWAYS)), ()),
        (((1, 2, *ALWAYS),), ()),
        (((1, 2, 20, 80), (2, 1, 81, 169)), ()),
    ],
)
def test_two_that_hold_for_each_other_at_the_same_time_are_a_deadlock_however_far_apart(held, found):
    assert deadlocks(standing(APART, held)) == found


def test_an_agent_that_still_moves_is_no_part_of_a_circle():
    assert deadlocks(standing(APART, ((1, 2, *ALWAYS), (2, 1, *ALWAYS)), moves=(2,))) == ()


def test_a_circle_may_consist_of_bodies_ahead_and_of_agreements():
    # 1 stands behind 2, which holds for 3, which holds for 1; 3 also holds for 4, which waits for no agent.
    places = ((0.0, 0.0, 0.0), (6.0, 0.0, 0.0), (40.0, 40.0, 0.0), (80.0, 0.0, 0.0))
    held = ((2, 3, *ALWAYS), (3, 4, *ALWAYS), (3, 1, *ALWAYS))
    assert deadlocks(standing(places, held)) == ((1, 2, 3),)
    assert deadlocks(standing(places, held[:2])) == ()
