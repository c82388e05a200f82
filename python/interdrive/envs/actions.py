"""Actions: what they mean, and their spaces."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeAlias

import gymnasium
import numpy as np

from interdrive.errors import InputError
from interdrive.native_settings import FrenetTarget, Kinematic


@dataclass(frozen=True)
class KinematicGrid:
    """One choice from a grid over the two numbers of `Kinematic`: index = pedal number * steerings + steering number.

    Attributes:
        model: The single-track model.
        accelerations: Number of pedal positions from -1 to 1, odd, so that coasting is one.
        steerings: Number of steering positions from -1 to 1, odd, so that straight on is one.
    """

    model: Kinematic = field(default_factory=Kinematic)
    accelerations: int = 7
    steerings: int = 13


#: What actions mean.
Actions: TypeAlias = Kinematic | KinematicGrid | FrenetTarget


@dataclass(frozen=True)
class ActionKind:
    """Actions as the core and gymnasium take them.

    Attributes:
        name: For the core.
        record: Its settings.
        grid: Numbers of choices.
        space: Of one action.
    """

    name: str
    record: Kinematic | FrenetTarget
    grid: tuple[int, int]
    space: gymnasium.Space[np.ndarray] | gymnasium.spaces.Discrete

    def array(self, rows: int) -> np.ndarray:
        """An array for the actions of so many rows."""
        if isinstance(self.space, gymnasium.spaces.Discrete):
            return np.zeros(rows, dtype=np.int32)
        return np.zeros((rows, *self.shape), dtype=np.float32)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of one action."""
        return self.space.shape or ()


def action_kind(actions: Actions) -> ActionKind:
    """The actions as the core and gymnasium take them.

    Raises:
        InputError: These are no actions.
    """
    if isinstance(actions, Kinematic):
        return ActionKind("kinematic", actions, (1, 1), gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32))
    if isinstance(actions, FrenetTarget):
        return ActionKind("frenet_target", actions, (1, 1), gymnasium.spaces.Box(-1.0, 1.0, (3,), np.float32))
    if isinstance(actions, KinematicGrid):
        grid = (actions.accelerations, actions.steerings)
        return ActionKind("kinematic_grid", actions.model, grid, gymnasium.spaces.Discrete(grid[0] * grid[1]))
    raise InputError("actions", f"Kinematic, KinematicGrid or FrenetTarget expected, not {actions!r}")
