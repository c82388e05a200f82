"""Planners and predictors as you may write them, each resolved once into one typed value."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, is_dataclass, replace
from typing import TYPE_CHECKING, Any, TypeAlias, cast

from interdrive.config.binding import Setting, bind, flatten
from interdrive.config.plugins import Choice, find, made, read_choice
from interdrive.errors import InputError, InterdriveError
from interdrive.planners import NATIVE as PLANNERS
from interdrive.planners import RECORDS as PLANNER_RECORDS
from interdrive.planners import Frenet, Idm, IdmMobil, Planner, Recorded, VelocityAdjusting
from interdrive.predictors import NATIVE as PREDICTORS
from interdrive.predictors import RECORDS as PREDICTOR_RECORDS
from interdrive.predictors import ConstantVelocity, GroundTruth, LaneFollowing, Neural, Predictor, Walenet
from interdrive.predictors import native as native_predictor
from interdrive.predictors.calls import BoundPredictor

if TYPE_CHECKING:
    from interdrive import _core
    from interdrive.planners import PlannerSettings
    from interdrive.predictors import PredictorSettings

NativePlanner: TypeAlias = Frenet | Recorded | VelocityAdjusting | Idm | IdmMobil
NativePredictor: TypeAlias = ConstantVelocity | LaneFollowing | GroundTruth | Neural | Walenet

#: A planner: a name that `interdrive planners` lists or `module:object`, with settings or without ("frenet,level=1");
#: a table `{"planner": "frenet", "level": 1}`; a record such as `Frenet(level=1)`; an object with `plan`, of which each
#: agent gets a copy; a class or a function without arguments that makes one.
PlannerSpec: TypeAlias = str | Mapping[str, Setting] | NativePlanner | Planner | Callable[[], Planner] | Choice

#: Planners or predictors of a batch: one text may name several, separated by commas; a mapping gives them labels.
PlannerSpecs: TypeAlias = "PlannerSpec | Sequence[PlannerSpec] | Mapping[str, PlannerSpec]"
PredictorSpecs: TypeAlias = "PredictorSpec | Sequence[PredictorSpec] | Mapping[str, PredictorSpec]"

#: A predictor, written like a planner: `interdrive predictors` lists the names, and objects have `predict`.
PredictorSpec: TypeAlias = str | Mapping[str, Setting] | NativePredictor | Predictor | Callable[[], Predictor] | Choice


@dataclass(frozen=True)
class _Kind:
    """What planners and predictors differ in."""

    what: str
    method: str
    contract: type
    natives: Mapping[str, str]
    records: Mapping[str, type]

    def native_name(self, thing: object) -> str | None:
        """The name of a native record; None for anything else."""
        return next((name for name, kind in self.records.items() if type(thing) is kind), None)


_PLANNER = _Kind("planner", "plan(view, predictions)", Planner, PLANNERS, PLANNER_RECORDS)
_PREDICTOR = _Kind("predictor", "predict(scene)", Predictor, PREDICTORS, PREDICTOR_RECORDS)
_KINDS = {kind.what: kind for kind in (_PLANNER, _PREDICTOR)}


@dataclass(frozen=True)
class Resolved:
    """A planner or predictor that exists and takes its settings; every agent and every run has its own object.

    Attributes:
        source: The record of a native one; otherwise a name, class, factory or object.
        settings: Of the source, by dotted names, as values of its types; a native record has its own.
        what: "planner" or "predictor".
    """

    source: object
    settings: Mapping[str, Any] = field(default_factory=dict)
    what: str = "planner"

    @property
    def kind(self) -> _Kind:
        """What planners and predictors differ in."""
        return _KINDS[self.what]

    @property
    def native(self) -> str | None:
        """The name of a native one."""
        return self.kind.native_name(self.source)

    @property
    def name(self) -> str:
        """For tables and messages, and for repeating a run."""
        return spec_name(self.source)

    def make(self) -> Any:  # noqa: ANN401 - a native record, or an object with the method of the contract
        """The record of a native one, or an object of its own.

        Raises:
            InputError: It cannot be made, or is something else.
        """
        if self.native is not None:
            return self.source
        kind, source = self.kind, self.source
        found = find(source, tuple(kind.natives), self.what) if isinstance(source, str) else source
        found = made(found, kind.method.partition("(")[0], f"{self.what} {self.name}", self.settings)
        if kind.native_name(found) is None and not isinstance(found, kind.contract):
            raise InputError(f"{found!r} is no {self.what}: it has no method {kind.method}")
        return found

    def plain(self, usual: PlannerSettings | PredictorSettings) -> tuple[Any, bool]:
        """A name or a table as run.json has it, and whether it makes the same again.

        Args:
            usual: Settings of native ones that need not be told.
        """
        source, values, known = self.source, dict(self.settings), True
        if self.native is not None:
            base = flatten(_usual(self.native, self.kind, usual))
            values = {name: value for name, value in flatten(cast("Any", source)).items() if value != base[name]}
        elif not isinstance(source, str):
            kind = source if isinstance(source, type) or hasattr(source, "__qualname__") else type(source)
            known = self._is_found(kind)
            if kind is not source:
                known = known and is_dataclass(kind)
                values = {**(flatten(cast("Any", source)) if is_dataclass(kind) else {}), **values}
        try:
            json.dumps(values)
        except (TypeError, ValueError):
            values, known = {}, False
        return ({self.what: self.name, **values} if values else self.name), known

    def _is_found(self, kind: object) -> bool:
        """Whether another process would find it by its name."""
        if self.name.startswith("__main__:") or "<" in self.name:
            return False
        try:
            return find(self.name, (), self.what) is kind
        except InterdriveError:
            return False


def resolved_planner(spec: PlannerSpec | Resolved, usual: PlannerSettings) -> Resolved:
    """The planner that a specification means.

    Args:
        spec: What you wrote.
        usual: Settings of native planners where the specification says nothing else.

    Raises:
        InputError: Unknown name or setting (with the nearest valid one), a value that does not fit, or something that
            is no planner.
    """
    return _resolved(spec, usual, _PLANNER)


def resolved_predictor(spec: PredictorSpec | Resolved, usual: PredictorSettings) -> Resolved:
    """The predictor that a specification means; as `resolved_planner`."""
    return _resolved(spec, usual, _PREDICTOR)


def _usual(name: str, kind: _Kind, usual: PlannerSettings | PredictorSettings) -> Any:  # noqa: ANN401 - a native record
    """The record of a native one as the settings have it; one without settings is made."""
    return getattr(usual, name, None) or kind.records[name]()


def _resolved(spec: object, usual: PlannerSettings | PredictorSettings, kind: _Kind) -> Resolved:
    if isinstance(spec, Resolved):
        return spec
    choice = read_choice(spec, kind.what)
    source: Any = choice.chosen
    if isinstance(source, str) and source in kind.natives:
        source = _usual(source, kind, usual)
    name = kind.native_name(source)
    if name is not None:
        try:
            # Records made in Python are not checked for types by themselves.
            return Resolved(bind(source, {**flatten(source), **choice.settings}), what=kind.what)
        except InputError as error:
            raise error.within(f"{kind.what} {name}") from None
    found = Resolved(source, choice.settings, kind.what)
    one: Any = found.make()
    values = flatten(one) if choice.settings else {}
    return replace(found, settings={name: values[name] for name in choice.settings})


def spec_name(spec: object) -> str:
    """Name of a planner or predictor without its settings."""
    if isinstance(spec, Choice | Resolved):
        return spec_name(spec.chosen if isinstance(spec, Choice) else spec.source)
    if isinstance(spec, str):
        return spec
    native = _PLANNER.native_name(spec) or _PREDICTOR.native_name(spec)
    if native is not None:
        return native
    named: Any = spec if isinstance(spec, type) or hasattr(spec, "__qualname__") else type(spec)
    return f"{named.__module__}:{named.__qualname__}"


def spec_label(choice: Choice) -> str:
    """Name of a planner or predictor with the settings that it was chosen with, for tables."""
    return ",".join([spec_name(choice), *(f"{name}={value}" for name, value in choice.settings.items())])


def bound_predictor(
    spec: PredictorSpec | Resolved, usual: PredictorSettings, recorded: _core.Scenario
) -> BoundPredictor:
    """A predictor of its own for one world.

    Args:
        spec: What you wrote.
        usual: Settings of native predictors where the specification says nothing else.
        recorded: The world's scenario.

    Raises:
        InputError: Unknown name or setting, or something that is no predictor.
    """
    label = spec.name if isinstance(spec, Resolved) else spec_label(read_choice(spec, "predictor"))
    predictor = _resolved(spec, usual, _PREDICTOR).make()
    return BoundPredictor(label, predictor, native_predictor(predictor, usual, recorded))
