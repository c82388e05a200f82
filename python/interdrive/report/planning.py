"""Which plans of a run were made anew, and which are what was left of an earlier one."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from interdrive.array_types import Ints


def made_at(steps: Ints, lengths: Ints, replan_every: int) -> Ints:
    """When an agent made the plans that it followed: an earlier time step where it went on with what was left of one.

    Args:
        steps: Time steps of all its plans, ascending, shape (plans,).
        lengths: Their numbers of points, shape (plans,).
        replan_every: Number of time steps for which a plan is followed, if it is long enough.

    Returns:
        Time steps, shape (plans,).
    """
    made, last = steps.copy(), 0
    for at in range(1, len(steps)):
        age = steps[at] - steps[last]
        if age < replan_every and lengths[last] > age + 1:
            made[at] = steps[last]
        else:
            last = at
    return made
