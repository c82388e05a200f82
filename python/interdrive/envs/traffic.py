"""What `traffic` of an environment says: who drives the vehicles of the file, and which vehicles are generated."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from interdrive.config.agent_config import run_config
from interdrive.config.schema import with_traffic
from interdrive.errors import InputError
from interdrive.traffic import TrafficSettings

if TYPE_CHECKING:
    from interdrive.config.agent_config import RunConfig
    from interdrive.config.schema import SimulationSettings
    from interdrive.envs.settings import Traffic

#: What asks for generated traffic; other settings of it have names that planners have, too.
_ASKING = frozenset({"rate", "rates", "density"})
#: Keeps recorded vehicles besides generated ones.
_RECORDED = "recorded"


class TrafficChoice(NamedTuple):
    """Who drives besides learners.

    Attributes:
        config: Planners of vehicles of the file and of generated ones, with the settings of these.
        is_alone: Recorded vehicles are left out.
    """

    config: RunConfig
    is_alone: bool


def read_traffic(given: Traffic, simulation: SimulationSettings) -> TrafficChoice:
    """Reads who drives besides learners.

    Args:
        given: As for an environment.
        simulation: Settings, which may have generated traffic of their own.

    Raises:
        InputError: A name or a planner that does not exist, or a value that does not fit.
    """
    planners: Any = given
    is_alone = _asks(given)
    if is_alone:
        spec: Any = given
        planners = _RECORDED
        if isinstance(given, str) and given.partition(",")[0].strip() == _RECORDED:
            is_alone, spec = False, given.partition(",")[2]
        simulation = with_traffic(simulation, spec)
        if not simulation.traffic.is_on:
            raise InputError("traffic", "there is none: give a rate or a density, such as rate=600")
    elif isinstance(planners, Mapping) and "planner" not in planners:
        planners = {"default": _RECORDED, **planners}
    try:
        return TrafficChoice(run_config(simulation, planners), is_alone)
    except InputError as error:
        raise (error if str(error.location).startswith("traffic") else error.within("traffic")) from None


def _asks(given: Any) -> bool:  # noqa: ANN401 - whatever the user gives
    """Whether it asks for generated traffic, rather than naming planners of the vehicles of the file."""
    if isinstance(given, TrafficSettings):
        return True
    if isinstance(given, Mapping):
        return not _ASKING.isdisjoint(given)
    if not isinstance(given, str):
        return False
    return not _ASKING.isdisjoint(part.partition("=")[0].strip() for part in given.split(",") if "=" in part)
