"""Specifications of planners and predictors, each read once into a record that is passed on."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, is_dataclass, replace
from typing import TYPE_CHECKING, Any, TypeAlias, TypeGuard, cast

from interdrive.config.binding import Setting, bind, flatten
from interdrive.config.drivers import SETTINGS, Drivers, check_planner, checked_driver, read_drivers
from interdrive.config.plugins import DEFAULT_PLANNER, Choice, find, made, read_choice
from interdrive.errors import InputError, InterdriveError
from interdrive.planners import NATIVE as PLANNERS
from interdrive.planners import RECORDS as PLANNER_RECORDS
from interdrive.planners import NativePlanner, Planner
from interdrive.predictors import NATIVE as PREDICTORS
from interdrive.predictors import RECORDS as PREDICTOR_RECORDS
from interdrive.predictors import NativePredictor, Predictor, native_predictor
from interdrive.predictors.calls import BoundPredictor

if TYPE_CHECKING:
    from interdrive import _core
    from interdrive.planners import PlannerSettings
    from interdrive.predictors import PredictorSettings


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

#: In choices by agent, the key of all others.
DEFAULT = "default"

#: What else an agent is told with its planner.
_BESIDES = ("view.", "rules.", "driver.")


@dataclass(frozen=True)
class Resolved:
    """A planner or predictor that was found, with valid settings; every agent and every run has its own object.

    Attributes:
        kind: Whether it is a planner or a predictor.
        source: The record of a native plug-in; otherwise a name, class, factory or object.
        settings: Settings of the source by dotted names, as values of its types; native records hold theirs.
        label: Name and settings as they were given, for tables.
    """

    kind: _Kind
    source: object
    settings: Mapping[str, Any] = field(default_factory=dict)
    label: str = field(default="", compare=False)

    @property
    def native(self) -> str | None:
        """The name of a native plug-in; None for others."""
        return self.kind.native_name(self.source)

    @property
    def values(self) -> Mapping[str, Any]:
        """All settings that it has, as plain values by dotted names."""
        return self.settings if self.native is None else flatten(cast("Any", self.source))

    @property
    def name(self) -> str:
        """The name for tables and messages, and for repeating a run."""
        return spec_name(self.source)

    def make(self) -> Any:  # noqa: ANN401 - a native record, or an object with the method of the contract
        """Returns the record of a native plug-in, or makes a separate object.

        Raises:
            InputError: The object cannot be made, or lacks the method.
        """
        if self.native is not None:
            return self.source
        kind, source = self.kind, self.source
        found = find(source, tuple(kind.natives), kind.what) if isinstance(source, str) else source
        found = made(found, kind.method.partition("(")[0], f"{kind.what} {self.name}", self.settings)
        if kind.native_name(found) is None and not isinstance(found, kind.contract):
            raise InputError(f"{found!r} is not a {kind.what}: it has no method {kind.method}")
        return found

    def plain(self, usual: PlannerSettings | PredictorSettings) -> tuple[Any, bool]:
        """A name or a table for run.json, and whether it reproduces the same object.

        Args:
            usual: Settings of native plug-ins that need not be stored.
        """
        source, values, known = self.source, dict(self.settings), True
        if self.native is not None:
            record = _usual(self.native, self.kind, usual)
            base = {} if source == record else flatten(record)
            values = {name: value for name, value in self.values.items() if value != base[name]} if base else {}
        elif not isinstance(source, str):
            owner = source if isinstance(source, type) or hasattr(source, "__qualname__") else type(source)
            known = self._is_found(owner)
            if owner is not source:
                known = known and is_dataclass(owner)
                values = {**(flatten(cast("Any", source)) if is_dataclass(owner) else {}), **values}
        try:
            json.dumps(values)
        except (TypeError, ValueError):
            values, known = {}, False
        return ({self.kind.what: self.name, **values} if values else self.name), known

    def check_found_elsewhere(self, usual: PlannerSettings | PredictorSettings) -> None:
        """Whether other processes can make an equal object from its name and settings.

        Args:
            usual: As for `plain`.

        Raises:
            InputError: They cannot; the text says why, and what to do.
        """
        if self.plain(usual)[1]:
            return
        module, _, name = self.name.partition(":")
        why = "other processes cannot make an equal object; give its class, or a dataclass with plain fields"
        if module == "__main__" or "<" in name:
            own = name.rpartition(".")[2] if "<lambda>" not in name else "CLASS"
            where = "it is defined in a " + ("notebook or script" if module == "__main__" else "function")
            what_to_do = f"save it in a file mine.py, write {self.kind.what} mine:{own}"
            why = f"{where}, where other processes do not find it; {what_to_do}"
        raise InputError(f"{self.kind.what} {self.name}", why)

    def _is_found(self, kind: object) -> bool:
        """Whether another process can find the object by its name."""
        if self.name.startswith("__main__:") or "<" in self.name:
            return False
        try:
            return find(self.name, (), self.kind.what) is kind
        except InterdriveError:
            return False


@dataclass(frozen=True)
class AgentChoice:
    """What is chosen for an agent together with its planner.

    Attributes:
        planner: The planner.
        view: Settings of its view that differ from those of the run, by name.
        rules: Settings of the rules of the road that it obeys, likewise.
        v2x: Whether it has V2X, as given; None: as others have.
        drivers: The population from which each agent draws settings of its planner; None: all agents have the same.
        driver: How fast it wants to be where its goal has no time, by `desired_factor` and `free_weight`; for a planner
            in Python all that its driver has, see `view.ego.driver`.
    """

    planner: Resolved
    view: Mapping[str, object] = field(default_factory=dict)
    rules: Mapping[str, object] = field(default_factory=dict)
    v2x: object = None
    drivers: Drivers | None = None
    driver: Mapping[str, float] = field(default_factory=dict)


#: A planner: a name listed by `interdrive planners` or `module:object`, with or without settings ("frenet,level=1"); a
#: table `{"planner": "frenet", "level": 1}`; a record such as `Frenet(level=1)`; an object with `plan`, of which each
#: agent gets a copy; a class or a function without arguments that makes one; or any of them as it was read.
PlannerSpec: TypeAlias = (
    str | Mapping[str, Setting] | NativePlanner | Planner | Callable[[], Planner] | Choice | AgentChoice
)

#: A predictor, written like a planner: `interdrive predictors` lists the names, and objects have `predict`.
PredictorSpec: TypeAlias = (
    str | Mapping[str, Setting] | NativePredictor | Predictor | Callable[[], Predictor] | Choice | Resolved
)

#: Planners or predictors of a batch: one text may name several, separated by commas; a mapping gives them labels.
PlannerSpecs: TypeAlias = PlannerSpec | Sequence[PlannerSpec] | Mapping[str, PlannerSpec]
PredictorSpecs: TypeAlias = PredictorSpec | Sequence[PredictorSpec] | Mapping[str, PredictorSpec]


def is_per_agent(planner: object) -> TypeGuard[Mapping[Any, PlannerSpec]]:
    """Whether this is a mapping from agents to choices, rather than a choice, which may be a mapping."""
    return isinstance(planner, Mapping) and all(
        not isinstance(key, str) or key == DEFAULT or key.lstrip("-").isdigit() for key in planner
    )


def read_planner(spec: PlannerSpec, usual: PlannerSettings, default: AgentChoice | None = None) -> AgentChoice:
    """Reads the choice of a planner and of what an agent has besides (`view.*`, `rules.*`, `driver.*`, `v2x`).

    Args:
        spec: The specification.
        usual: Settings of native planners where the specification states none.
        default: To which a choice that names no planner adds its settings; None: the default planner.

    Raises:
        InputError: The name or setting is unknown (the message names the nearest valid one), a value does not fit, or
            the choice is not a planner.
    """
    if isinstance(spec, AgentChoice):
        return spec
    if is_per_agent(spec):
        raise InputError(f"planner {spec!r}", "one planner is wanted here, not one per agent")
    choice = read_choice(spec, "planner")
    given, v2x = choice.settings, choice.settings.get("v2x")
    view, rules, driver = (
        {name.removeprefix(group): value for name, value in given.items() if name.startswith(group)}
        for group in _BESIDES
    )
    beside = ("v2x", "drivers")
    own = {name: value for name, value in given.items() if not name.startswith(_BESIDES) and name not in beside}
    if choice.chosen is not None:
        planner = _resolved(Choice(choice.chosen, own), usual, _PLANNER)
        temper = checked_driver(driver, is_native=planner.native is not None)
        return AgentChoice(*_with_drivers(planner, given, view, rules, v2x, None), temper)
    base = default or AgentChoice(_resolved(DEFAULT_PLANNER, usual, _PLANNER))
    planner = _resolved(Choice(base.planner, own), usual, _PLANNER)
    temper = checked_driver(driver, is_native=planner.native is not None)
    view, rules = {**base.view, **view}, {**base.rules, **rules}
    return AgentChoice(
        *_with_drivers(planner, given, view, rules, base.v2x if v2x is None else v2x, base.drivers),
        {**base.driver, **temper},
    )


def _with_drivers(
    planner: Resolved,
    given: Mapping[str, object],
    view: Mapping[str, object],
    rules: Mapping[str, object],
    v2x: object,
    usual: Drivers | None,
) -> tuple[Resolved, Mapping[str, object], Mapping[str, object], object, Drivers | None]:
    """The parts of a choice, whose label names its drivers."""
    named = given.get("drivers")
    if named is None:
        return planner, view, rules, v2x, usual
    drivers = named if isinstance(named, Drivers) else read_drivers(str(named))
    if planner.native is not None:
        if planner.native not in SETTINGS:
            have = f"{', '.join(SETTINGS)} and planners in Python have"
            raise InputError(f"planner {planner.name}", f"drivers={drivers.name}: it has none; {have}")
        check_planner(drivers, planner.native)
    return replace(planner, label=f"{planner.label},drivers={drivers.name}"), view, rules, v2x, drivers


def read_predictor(spec: PredictorSpec, usual: PredictorSettings) -> Resolved:
    """Reads the choice of a predictor, as `read_planner` does."""
    return _resolved(spec, usual, _PREDICTOR)


def _usual(name: str, kind: _Kind, usual: PlannerSettings | PredictorSettings) -> Any:  # noqa: ANN401 - a native record
    """The record of a native plug-in from the settings; a new one if it has no settings."""
    return getattr(usual, name, None) or kind.records[name]()


def _resolved(spec: object, usual: PlannerSettings | PredictorSettings, kind: _Kind) -> Resolved:
    if isinstance(spec, Resolved):
        return spec
    choice = read_choice(spec, kind.what)
    source: Any = choice.chosen
    settings = choice.settings
    if isinstance(source, Resolved):
        source, settings = source.source, {**source.settings, **settings}
    if isinstance(source, str) and source in kind.natives:
        source = _usual(source, kind, usual)
    name = kind.native_name(source)
    if name is not None:
        try:
            # Records made in Python do not check types themselves.
            return Resolved(kind, bind(source, {**flatten(source), **settings}), {}, spec_label(choice))
        except InputError as error:
            raise error.within(f"{kind.what} {name}") from None
    found = Resolved(kind, source, settings, spec_label(choice))
    one: Any = found.make()
    values = flatten(one) if settings else {}
    return replace(found, settings={name: values[name] for name in settings})


def spec_name(spec: object) -> str:
    """Name of a planner or predictor without its settings."""
    if isinstance(spec, Resolved):
        return spec.name
    if isinstance(spec, str):
        return spec
    native = _PLANNER.native_name(spec) or _PREDICTOR.native_name(spec)
    if native is not None:
        return native
    named: Any = spec if isinstance(spec, type) or hasattr(spec, "__qualname__") else type(spec)
    return f"{named.__module__}:{named.__qualname__}"


def spec_label(choice: Choice) -> str:
    """Name of a planner or predictor with its chosen settings, for tables."""
    return ",".join([spec_name(choice.chosen), *(f"{name}={value}" for name, value in choice.settings.items())])


def bound_predictor(spec: PredictorSpec, usual: PredictorSettings, recorded: _core.Scenario) -> BoundPredictor:
    """Makes a separate predictor for one world.

    Args:
        spec: The specification.
        usual: Settings of native predictors where the specification states none.
        recorded: The world's scenario.

    Raises:
        InputError: The name or setting is unknown, or the choice is not a predictor.
    """
    found = read_predictor(spec, usual)
    predictor = found.make()
    return BoundPredictor(found.label, predictor, native_predictor(predictor, usual, recorded))
