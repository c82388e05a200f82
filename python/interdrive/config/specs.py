"""Planners and predictors from what you write: a name, a record, an object, a class, with settings or without."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from interdrive.config.binding import bind, flatten
from interdrive.config.plugins import Choice, find, made, named_error, read_choice
from interdrive.errors import InputError
from interdrive.planners import NATIVE as PLANNERS
from interdrive.planners import Planner, native_record
from interdrive.planners import native_name as native_planner_name
from interdrive.predictors import NATIVE as PREDICTORS
from interdrive.predictors import RECORDS as PREDICTOR_RECORDS
from interdrive.predictors import Predictor
from interdrive.predictors import native as native_predictor
from interdrive.predictors import native_name as native_predictor_name
from interdrive.predictors.calls import BoundPredictor

if TYPE_CHECKING:
    from interdrive import _core
    from interdrive.planners import PlannerSettings
    from interdrive.predictors import PredictorSettings


def resolve_planner(planner: object, settings: PlannerSettings) -> object:
    """A native record or an object with `plan` from a choice.

    Args:
        planner: Name, `module:object`, record, object, class or factory; or one of these with settings, as
            `interdrive.config.plugins.read_choice` reads them.
        settings: What native planners have where the choice says nothing else.

    Raises:
        InputError: Unknown name or setting (with the nearest valid one), a value that does not fit, or something that
            is no planner.
    """
    choice = read_choice(planner, "planner")
    chosen: Any = choice.chosen
    own = {name: value for name, value in choice.settings.items() if not name.startswith("view.")}
    try:
        if isinstance(chosen, str) and chosen in PLANNERS:
            chosen = native_record(chosen, settings)
        if native_planner_name(chosen) is not None:
            return bind(chosen, own)
        found = find(chosen, tuple(PLANNERS), "planner") if isinstance(chosen, str) else chosen
        found = made(found, "plan", "planner", own)
    except InputError as error:
        raise named_error(error, f"planner {planner_name(choice)}") from error
    if native_planner_name(found) is not None or isinstance(found, Planner):
        return found
    raise InputError(f"{found!r} is no planner: it has no method plan(view, predictions)")


def planner_name(choice: object) -> str:
    """Name of a planner or predictor for tables and for repeating a run."""
    if isinstance(choice, Choice):
        return planner_name(choice.chosen)
    if isinstance(choice, str):
        return choice
    native = native_planner_name(choice)
    if native is not None:
        return native
    named: Any = choice if isinstance(choice, type) or hasattr(choice, "__qualname__") else type(choice)
    return f"{named.__module__}:{named.__qualname__}"


def resolve_predictor(predictor: object, settings: PredictorSettings) -> object:
    """A native record or an object with `predict` from a choice.

    Args:
        predictor: Name, `module:object`, record, object, class or factory; or one of these with settings, as
            `interdrive.config.plugins.read_choice` reads them.
        settings: What native predictors have where the choice says nothing else.

    Raises:
        InputError: Unknown name or setting (with the nearest valid one), a value that does not fit, or something that
            is no predictor.
    """
    choice = read_choice(predictor, "predictor")
    chosen: Any = choice.chosen
    try:
        if isinstance(chosen, str) and chosen in PREDICTORS:
            chosen = getattr(settings, chosen, None) or PREDICTOR_RECORDS[chosen]()
        if native_predictor_name(chosen) is not None:
            # Records made in Python are not checked for types by themselves.
            return bind(chosen, {**flatten(chosen), **choice.settings})
        found = find(chosen, tuple(PREDICTORS), "predictor") if isinstance(chosen, str) else chosen
        found = made(found, "predict", "predictor", choice.settings)
    except InputError as error:
        raise named_error(error, f"predictor {native_predictor_name(chosen) or choice.chosen}") from error
    if native_predictor_name(found) is not None or isinstance(found, Predictor):
        return found
    raise InputError(f"{found!r} is no predictor: it has no method predict(scene)")


def predictor_name(choice: object) -> str:
    """Name of a predictor for tables and messages, with the settings that it was chosen with."""
    choice = read_choice(choice, "predictor")
    settings = "".join(f",{name}={value}" for name, value in choice.settings.items())
    chosen: Any = choice.chosen
    if isinstance(chosen, str):
        return chosen + settings
    known = native_predictor_name(chosen)
    if known is not None:
        return known + settings
    named = chosen if isinstance(chosen, type) or hasattr(chosen, "__qualname__") else type(chosen)
    return f"{named.__module__}:{named.__qualname__}{settings}"


def bound_predictor(choice: Choice | object, settings: PredictorSettings, recorded: _core.Scenario) -> BoundPredictor:
    """A predictor of one's own for one world.

    Args:
        choice: As `resolve_predictor` takes it.
        settings: What native predictors have where the choice says nothing else.
        recorded: The world's scenario.

    Raises:
        InputError: Unknown name or setting, or something that is no predictor.
    """
    predictor = resolve_predictor(choice, settings)
    return BoundPredictor(predictor_name(choice), predictor, native_predictor(predictor, settings, recorded))
