"""Actions: what they mean, and their spaces."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import gymnasium
import numpy as np

from interdrive.errors import InputError
from interdrive.native_settings import Frenet, FrenetTarget, Kinematic
from interdrive.native_settings import FrenetWeights as CostWeights

if TYPE_CHECKING:
    from numpy.typing import NDArray


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


@dataclass(frozen=True)
class FrenetWeights:
    """The sampling planner drives; numbers from -1 to 1, one per term, change weights of its cost.

    Attributes:
        terms: Terms of the cost whose weights are changed. That of `velocity_offset` is fixed, because only the ratios
            of weights matter.
        change: "absolute": the first weight times ten to the power of the number. "additive": the present weight plus a
            tenth of the first weight times the number, from a thousandth to twice the first weight.
        planner: The planner with its first weights.
    """

    terms: tuple[str, ...] = ("prediction", "distance_to_reference", "lateral_jerk", "longitudinal_jerk")
    change: Literal["absolute", "additive"] = "absolute"
    planner: Frenet = field(default_factory=Frenet)

    def __post_init__(self) -> None:
        """Checks names.

        Raises:
            InputError: A term or change that there is not.
        """
        names = [one.name for one in fields(CostWeights) if one.name != "velocity_offset"]
        for term in self.terms:
            if term not in names:
                raise InputError("actions", f"there is no weight {term}; choose from {', '.join(names)}")
        if self.change not in ("absolute", "additive"):
            raise InputError("actions", f'change must be "absolute" or "additive", not {self.change!r}')


#: What actions mean.
Actions: TypeAlias = Kinematic | KinematicGrid | FrenetTarget | FrenetWeights


@dataclass(frozen=True)
class ActionKind:
    """Actions as the core and gymnasium take them.

    Attributes:
        name: For the core.
        record: Its settings.
        numbers: Numbers of choices, or positions of weights.
        space: Of one action.
    """

    name: str
    record: Kinematic | FrenetTarget | Frenet
    numbers: tuple[int, ...]
    space: gymnasium.Space[np.ndarray] | gymnasium.spaces.Discrete

    def array(self, rows: int) -> np.ndarray:
        """An array for the actions of `n` rows."""
        if isinstance(self.space, gymnasium.spaces.Discrete):
            return np.zeros(rows, dtype=np.int32)
        return np.zeros((rows, *self.shape), dtype=np.float32)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of one action."""
        return self.space.shape or ()


_MOST = int(np.iinfo(np.int32).max)


def put(actions: NDArray[Any], given: Any) -> None:  # noqa: ANN401 - whatever the user gives
    """Writes what was given into an array of actions; what was given stays as it is.

    Raises:
        InputError: It has another shape, or is no numbers, or for choices no whole numbers.
    """
    try:
        shape = np.shape(given)
    except ValueError:
        raise InputError("actions", f"rows of different lengths given, shape {actions.shape} expected") from None
    if shape != actions.shape:
        raise InputError("actions", f"shape {shape} given, {actions.shape} expected")
    kind = np.asarray(given).dtype.kind
    if isinstance(given, np.ma.MaskedArray) or kind not in "iuf":
        raise InputError("actions", "numbers expected")
    if actions.dtype == np.int32:
        choices = np.asarray(given)
        if choices.dtype.kind not in "iu":
            raise InputError("actions", f"whole numbers expected, not {choices.dtype}")
        # What does not fit is still not among the choices.
        given = np.clip(choices, -1 - _MOST, _MOST)
    try:
        actions[...] = given
    except (TypeError, ValueError):
        raise InputError("actions", "numbers expected") from None


def action_kind(actions: Actions) -> ActionKind:
    """The actions as the core and gymnasium take them.

    Raises:
        InputError: These are no actions.
    """
    if isinstance(actions, Kinematic):
        return ActionKind("kinematic", actions, (1, 1), gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32))
    if isinstance(actions, FrenetWeights):
        names = [one.name for one in fields(CostWeights)]
        terms = tuple(names.index(term) for term in actions.terms)
        space = gymnasium.spaces.Box(-1.0, 1.0, (len(terms),), np.float32)
        return ActionKind(f"frenet_weights_{actions.change}", actions.planner, terms, space)
    if isinstance(actions, FrenetTarget):
        return ActionKind("frenet_target", actions, (1, 1), gymnasium.spaces.Box(-1.0, 1.0, (3,), np.float32))
    if isinstance(actions, KinematicGrid):
        grid = (actions.accelerations, actions.steerings)
        return ActionKind("kinematic_grid", actions.model, grid, gymnasium.spaces.Discrete(grid[0] * grid[1]))
    raise InputError("actions", f"Kinematic, KinematicGrid, FrenetTarget or FrenetWeights expected, not {actions!r}")
