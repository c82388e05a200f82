"""Planners: where does an agent want to be over the next seconds?

A planner is anything with one method, `plan(view, predictions) -> Trajectory`. Native ones are plain records of
settings; all agents that use them are planned in one call of the core.
"""

from __future__ import annotations

from typing import Any

from interdrive.errors import InputError
from interdrive.planners.contract import Planner, Trajectory
from interdrive.planners.native import (
    NATIVE,
    RECORDS,
    Frenet,
    FrenetComfort,
    FrenetWeights,
    Idm,
    IdmMobil,
    PlannerSettings,
    Recorded,
    VelocityAdjusting,
    native_name,
    native_planner,
    native_record,
)
from interdrive.plugins import Choice, find, made, named_error, read_choice
from interdrive.settings import bind

__all__ = [
    "NATIVE",
    "RECORDS",
    "Frenet",
    "FrenetComfort",
    "FrenetWeights",
    "Idm",
    "IdmMobil",
    "Planner",
    "PlannerSettings",
    "Recorded",
    "Trajectory",
    "VelocityAdjusting",
    "name_of",
    "native_name",
    "native_planner",
    "native_record",
    "resolve",
]


def resolve(planner: object, settings: PlannerSettings) -> object:
    """A native record or an object with `plan` from a choice.

    Args:
        planner: Name, `module:object`, record, object, class or factory; or one of these with settings, as
            `interdrive.plugins.read_choice` reads them.
        settings: What native planners have where the choice says nothing else.

    Raises:
        InputError: Unknown name or setting (with the nearest valid one), a value that does not fit, or something that
            is no planner.
    """
    choice = read_choice(planner, "planner")
    chosen: Any = choice.chosen
    own = {name: value for name, value in choice.settings.items() if not name.startswith("view.")}
    try:
        if isinstance(chosen, str) and chosen in NATIVE:
            chosen = native_record(chosen, settings)
        if native_name(chosen) is not None:
            return bind(chosen, own)
        found = find(chosen, tuple(NATIVE), "planner") if isinstance(chosen, str) else chosen
        found = made(found, "plan", "planner", own)
    except InputError as error:
        raise named_error(error, f"planner {name_of(choice)}") from error
    if native_name(found) is not None or isinstance(found, Planner):
        return found
    raise InputError(f"{found!r} is no planner: it has no method plan(view, predictions)")


def name_of(choice: object) -> str:
    """Name of a planner or predictor for tables and for repeating a run."""
    if isinstance(choice, Choice):
        return name_of(choice.chosen)
    if isinstance(choice, str):
        return choice
    native = native_name(choice)
    if native is not None:
        return native
    named: Any = choice if isinstance(choice, type) or hasattr(choice, "__qualname__") else type(choice)
    return f"{named.__module__}:{named.__qualname__}"
