"""Settings of environments."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias, get_args

from interdrive.config.binding import bind
from interdrive.config.schema import SimulationSettings, TrafficSpec
from interdrive.config.specs import PlannerSpec, PredictorSpec
from interdrive.envs.actions import Actions
from interdrive.errors import InputError
from interdrive.native_settings import Kinematic, ObservationSettings, RewardWeights
from interdrive.scenario import Scenario
from interdrive.scenario.native import thread_count

#: Scenario files, folders with some, names of shipped scenarios, or scenarios.
ScenariosSpec: TypeAlias = str | Path | Scenario | Sequence[str | Path | Scenario]

#: Which agents learn: a number, "all", or ids.
Learners: TypeAlias = int | Literal["all"] | Sequence[int]

#: What drives the others that could be agents: "recorded", a planner, or planners by id (others are recorded). With a
#: rate or a density: generated traffic in the place of recorded vehicles, or besides them ("recorded,rate=600").
Traffic: TypeAlias = PlannerSpec | Mapping[int, PlannerSpec] | TrafficSpec

#: An action lasts this long if nothing else is said [s], rounded to time steps.
DECISION_SECONDS = 0.1


@dataclass(frozen=True)
class EnvSettings:
    """Settings of an environment, besides scenarios, learners, traffic, predictor and actions.

    Attributes:
        split: File of places (see `interdrive predict-eval`), which are divided as a whole; none: by file names.
        part: Part of the scenarios that is used: "train", "test" or "all".
        test_share: Share of the places for tests without a file.
        start: "first": episodes begin at the first time step. "random": anywhere in the recording, with 3 s left.
        decision_seconds: An action lasts this long; a multiple of the scenario's time step. None: 0.1 s, or the
            multiple that is nearest to it, at least one time step.
        max_seconds: Episodes that last longer are cut.
        time_limit: What the end of the grace period is: "truncation" or "termination".
        reverse: Traffic with the planner `rollout` may back out where it stands wedged, if its own setting says so.
            Learners never reverse.
        threads: Threads over worlds. Results do not depend on it.
        record: Keep the recording of the episode, for `run()`.
        copy: Hand out copies of observations; otherwise the buffers, which the next step overwrites.
        observation: What learners observe.
        reward: Weights of the reward.
        simulation: Settings of the simulation, as for a run.
    """

    split: str | None = None
    part: Literal["train", "test", "all"] = "all"
    test_share: float = 0.2
    start: Literal["first", "random"] = "first"
    decision_seconds: Annotated[float | None, "s"] = None
    max_seconds: Annotated[float, "s"] = math.inf
    time_limit: Literal["truncation", "termination"] = "truncation"
    reverse: bool = False
    threads: int = 1
    record: bool = False
    copy: bool = True
    observation: ObservationSettings = field(default_factory=ObservationSettings)
    reward: RewardWeights = field(default_factory=RewardWeights)
    simulation: SimulationSettings = field(default_factory=SimulationSettings)

    def __post_init__(self) -> None:
        """Checks the ranges."""
        if not 0 <= self.test_share <= 1:
            raise InputError("test_share", f"must be at least 0 and at most 1, not {self.test_share}")
        for name in ("decision_seconds", "max_seconds"):
            value = getattr(self, name)
            if value is not None and not (value > 0 and (value < math.inf or name == "max_seconds")):
                raise InputError(name, f"must be positive, is {getattr(self, name)}")
        thread_count(self.threads)


@dataclass(frozen=True)
class Setup:
    """Everything an environment is made with.

    Attributes:
        scenarios: As given.
        learners: As given.
        traffic: As given.
        predictor: As given.
        actions: What actions mean.
        settings: The rest.
    """

    scenarios: ScenariosSpec
    learners: Learners
    traffic: Traffic = "recorded"
    predictor: PredictorSpec = "lane_following"
    actions: Actions = field(default_factory=Kinematic)
    settings: EnvSettings = field(default_factory=EnvSettings)

    def updated(self, changes: Mapping[str, Any]) -> Setup:
        """With other settings.

        Raises:
            InputError: A setting that does not exist, or a value that does not fit.
        """
        own = {name: changes[name] for name in _CHOICES if name in changes}
        whole: dict[str, Any] = {
            name: value for name, value in changes.items() if name in _GROUPS and isinstance(value, _GROUPS[name])
        }
        rest = {name: value for name, value in changes.items() if name not in own and name not in whole}
        settings = bind(replace(self.settings, **whole), rest, unknown="unknown")
        return replace(self, **own, settings=settings)


_CHOICES = ("scenarios", "learners", "traffic", "predictor", "actions")
_GROUPS: dict[str, type] = {
    "observation": ObservationSettings,
    "reward": RewardWeights,
    "simulation": SimulationSettings,
}


def _are_ids(wanted: Any) -> bool:  # noqa: ANN401 - whatever the user gives
    """Whether it is at least one id."""
    return isinstance(wanted, Sequence) and len(wanted) > 0 and all(isinstance(one, int) for one in wanted)


def setup_of(given: Mapping[str, Any], *, learners: Learners) -> Setup:
    """What an environment is made with, from its keywords; nested settings have dotted names ("reward.collision").

    Args:
        given: The keywords.
        learners: Which agents learn if that is not given.

    Raises:
        InputError: No scenarios are given, a setting does not exist, or a value does not fit.
    """
    if "scenarios" not in given:
        raise InputError("scenarios", "must be given: files, folders or names of shipped scenarios")
    for name in ("scenarios", "traffic", "predictor", "actions"):
        if name in given and given[name] is None:
            raise InputError(name, "is None; leave it out for the default, or give one")
    wanted = given.get("learners", learners)
    if isinstance(wanted, str) and wanted not in get_args(Literal["all"]):
        raise InputError("learners", f"a number, 'all' or ids expected, not {wanted!r}")
    if not isinstance(wanted, str | int) and not _are_ids(wanted):
        raise InputError("learners", f"a number, 'all' or ids expected, not {wanted!r}")
    if isinstance(wanted, bool) or (isinstance(wanted, int) and wanted < 1):
        raise InputError("learners", f"must be at least 1, not {wanted}")
    return Setup(given["scenarios"], wanted).updated(given)
