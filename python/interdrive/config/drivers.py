"""Populations of drivers: distributions of settings from which each agent draws its own."""

from __future__ import annotations

import difflib
import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, get_args

import numpy as np

from interdrive.errors import InputError

if TYPE_CHECKING:
    from interdrive.array_types import Floats

#: How a value follows from a normal number: exp, the logistic function between the bounds, or not at all.
Transform: TypeAlias = Literal["log", "logit", "identity"]

#: What drivers may differ in, with the bounds of what is drawn.
PARAMETERS: Mapping[str, tuple[float, float]] = MappingProxyType(
    {
        "time_gap": (0.6, 3.0),
        "minimum_gap": (0.5, 6.0),
        "acceleration": (0.5, 3.0),
        "deceleration": (0.8, 4.0),
        "politeness": (0.0, 1.0),
        "changing_threshold": (0.0, 0.5),
        "desired_factor": (0.7, 1.4),
        "free_weight": (0.0, 1.0),
    }
)
#: Those of them that are no settings of a planner, but say how fast an agent wants to be whose goal has no time.
TEMPERAMENT = ("desired_factor", "free_weight")
_CAR_FOLLOWING = {name: name for name in ("time_gap", "minimum_gap", "acceleration", "deceleration")}
#: The settings of planners that these parameters are; other parameters mean nothing to them.
SETTINGS: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        "idm": _CAR_FOLLOWING,
        "idm_mobil": {**_CAR_FOLLOWING, "politeness": "politeness", "changing_threshold": "changing_threshold"},
        "velocity_adjusting": _CAR_FOLLOWING,
        "rollout": {
            "time_gap": "comfort.time_gap",
            "minimum_gap": "comfort.standstill_gap",
            "acceleration": "comfort.acceleration",
            "deceleration": "comfort.deceleration",
        },
        "frenet": {
            "time_gap": "comfort.time_gap",
            "minimum_gap": "comfort.standstill_gap",
            "deceleration": "comfort.deceleration",
        },
    }
)
#: A driver whose headway at the start is this long [s] keeps what it draws; shorter and longer ones count as these [s].
HEADWAY_USUAL, HEADWAYS_KEPT = 1.5, (0.3, 4.0)
_NOISE = ("noise", "noise_length")
_PLACE = ("lateral_offset", "lateral_kept", "lateral_noise", "lateral_length", "lateral_way")
#: What all drivers of a population have in common, as far as planners have a setting for it: how they waver, and where
#: they are in their lane.
IN_COMMON: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "idm": ("improved", *_NOISE, *_PLACE),
        "idm_mobil": ("improved", *_NOISE, *_PLACE, "looking_interval"),
        "frenet": (*_NOISE, *_PLACE),
        "velocity_adjusting": _NOISE,
        "rollout": (),
    }
)
#: There are so many ways to waver, drawn apart from the parameters.
_WAVES, _NOISE_DRAW = 2**32, 1
_SEED = "noise_seed"
#: What all have in common that is spent when agents draw.
_SPENT = "time_gap_kept"
#: Version of the files.
_FORMAT = 1
#: Seeds are whole numbers below this.
_SEEDS = 2**64
_SUFFIX = ".toml"
#: Keys of files; other tables are kinds of vehicles.
_KEYS = ("format", "planner", "parameters", "driver", "correlation", "provenance")


@dataclass(frozen=True)
class Distribution:
    """How a parameter varies among drivers.

    Attributes:
        median: Of its values.
        sd: Standard deviation of the transformed values.
        transform: log, logit or identity.
        low: Smallest value that is drawn.
        high: Largest value.
    """

    median: float
    sd: float
    transform: Transform
    low: float
    high: float

    def at(self, z: float) -> float:
        """The value for a standard normal number."""
        if self.transform == "log":
            value = self.median * math.exp(self.sd * z)
        elif self.transform == "logit":
            share = (self.median - self.low) / (self.high - self.low)
            logit = math.log(share / (1.0 - share)) + self.sd * z
            value = self.low + (self.high - self.low) / (1.0 + math.exp(-logit))
        else:
            value = self.median + self.sd * z
        return min(max(value, self.low), self.high)

    def many(self, z: Floats) -> Floats:
        """The values for standard normal numbers, as `at`."""
        if self.transform == "log":
            values = self.median * np.exp(self.sd * z)
        elif self.transform == "logit":
            share = (self.median - self.low) / (self.high - self.low)
            logits = math.log(share / (1.0 - share)) + self.sd * z
            values = self.low + (self.high - self.low) / (1.0 + np.exp(-logits))
        else:
            values = self.median + self.sd * z
        return np.clip(values, self.low, self.high)


@dataclass(frozen=True)
class Drivers:
    """A population of drivers.

    Attributes:
        name: As it was given.
        parameters: Distributions by parameter, in the order of `PARAMETERS`.
        correlation: Correlations of the normal numbers behind two parameters.
        kinds: Distributions that differ for a kind of vehicle, such as "truck".
        improved: Share of the improved model, in which who follows keeps its time gap at any speed.
        noise: Standard deviation of a random part of the acceleration [m/s²], which differs from agent to agent.
        noise_length: Time over which that part changes [s].
        lateral_offset: Where in their lanes they drive, to the left of the middle [m].
        lateral_kept: Share of the offset at the start that each keeps besides.
        lateral_noise: Standard deviation of a random part of that place [m].
        lateral_length: Time over which that part changes [s].
        lateral_way: Way on which that part changes instead [m]; 0: it changes with time.
        time_gap_kept: How much of its headway at the start each keeps: its time gap is the drawn one times the headway
            over 1.5 s, to this power.
        looking_interval: How often they look for a better lane, `idm_mobil` alone [s]; 0: at every step.
        planner: Whose drivers they are, where they were fitted; empty: any planner's.
        provenance: Where the numbers are from; `places` names the places that they were fitted on.
    """

    name: str
    parameters: Mapping[str, Distribution]
    correlation: tuple[tuple[str, str, float], ...] = ()
    kinds: Mapping[str, Mapping[str, Distribution]] = field(default_factory=dict)
    improved: float = 0.0
    noise: float = 0.0
    noise_length: float = 1.5
    lateral_offset: float = 0.0
    lateral_kept: float = 0.0
    lateral_noise: float = 0.0
    lateral_length: float = 2.0
    lateral_way: float = 0.0
    time_gap_kept: float = 0.0
    looking_interval: float = 0.0
    planner: str = ""
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def fitted_on(self) -> tuple[str, ...]:
        """Names of the places that it was fitted on: there it says nothing about realism."""
        return tuple(map(str, self.provenance.get("places", ())))

    @property
    def constants(self) -> Mapping[str, float]:
        """What all of its drivers have in common, by name."""
        values = {name: float(getattr(self, name)) for name in _CONSTANTS}
        unused = {length for length, noise in _LENGTHS.items() if values[noise] <= 0.0}
        return {name: value for name, value in values.items() if name not in unused and value != 0.0}

    def drawn(self, seed: int, agent: int, kind: str = "car") -> dict[str, float]:
        """The parameters of an agent; they depend on nothing but these arguments.

        Args:
            seed: Of the run.
            agent: Its id.
            kind: Of its vehicle.
        """
        random = np.random.default_rng(np.random.SeedSequence([seed % _SEEDS, agent % _SEEDS]))
        # One number per possible parameter, so that a population with fewer of them draws the same.
        z = self._cholesky() @ random.standard_normal(len(PARAMETERS))
        own = {**self.parameters, **self.kinds.get(kind, {})}
        return {name: own[name].at(float(z[i])) for i, name in enumerate(PARAMETERS) if name in own}

    def time_gap(self, drawn: float, headway: float) -> float:
        """The time gap of a driver that has drawn one and starts with a headway; both in s, nan: nobody is ahead."""
        one = self.parameters["time_gap"]
        if not (self.time_gap_kept > 0.0 and math.isfinite(headway)):
            return drawn
        share = min(max(headway, HEADWAYS_KEPT[0]), HEADWAYS_KEPT[1]) / HEADWAY_USUAL
        return float(min(max(drawn * share**self.time_gap_kept, one.low), one.high))

    def settings(
        self, planner: str, seed: int, agent: int, kind: str = "car", headway: float = math.nan
    ) -> dict[str, float]:
        """The same as settings of a planner, by dotted name.

        Args:
            planner: Its name.
            seed: Of the run.
            agent: Its id.
            kind: Of its vehicle.
            headway: With which it starts [s]; nan: nobody is ahead.

        Raises:
            InputError: The planner has no drivers.
        """
        names = SETTINGS.get(planner)
        if names is None:
            raise InputError("drivers", f"planner {planner} has none; {', '.join(SETTINGS)} have")
        known = self.values(seed, agent, kind, headway)
        found = {names[name]: value for name, value in known.items() if name in names}
        common = {name: value for name, value in known.items() if name in IN_COMMON[planner]}
        if not common.keys().isdisjoint(_LENGTHS.values()):
            common[_SEED] = known[_SEED]
        return {**found, **common}

    def noise_seed(self, seed: int, agent: int) -> int:
        """In which way an agent wavers.

        Args:
            seed: Of the run.
            agent: Its id.
        """
        random = np.random.default_rng(np.random.SeedSequence([seed % _SEEDS, agent % _SEEDS, _NOISE_DRAW]))
        return int(random.integers(_WAVES))

    def values(self, seed: int, agent: int, kind: str = "car", headway: float = math.nan) -> dict[str, float]:
        """All that the driver of an agent has, by name: what it draws, and what all have in common.

        Args:
            seed: Of the run.
            agent: Its id.
            kind: Of its vehicle.
            headway: With which it starts [s]; nan: nobody is ahead.
        """
        drawn = self.drawn(seed, agent, kind)
        if "time_gap" in drawn:
            drawn["time_gap"] = self.time_gap(drawn["time_gap"], headway)
        common = {name: value for name, value in self.constants.items() if name != _SPENT}
        if not common.keys().isdisjoint(_LENGTHS.values()):
            common[_SEED] = self.noise_seed(seed, agent)
        return {**drawn, **common}

    def temperament(self, seed: int, agent: int, kind: str = "car") -> dict[str, float]:
        """What an agent draws of `TEMPERAMENT`."""
        return {name: value for name, value in self.drawn(seed, agent, kind).items() if name in TEMPERAMENT}

    def plain(self) -> dict[str, Any]:
        """All that decides what is drawn, as plain values."""
        return {
            "parameters": {name: vars(one) for name, one in self.parameters.items()},
            "correlation": [list(one) for one in self.correlation],
            "kinds": {kind: {name: vars(one) for name, one in own.items()} for kind, own in self.kinds.items()},
            **self.constants,
        }

    def _cholesky(self) -> Floats:
        names = list(PARAMETERS)
        matrix = np.eye(len(names))
        for one, other, value in self.correlation:
            i, j = names.index(one), names.index(other)
            matrix[i, j] = matrix[j, i] = value
        try:
            return np.asarray(np.linalg.cholesky(matrix))
        except np.linalg.LinAlgError:
            raise InputError("correlation", "the matrix is not positive definite") from None


def checked_driver(given: Mapping[str, object], *, is_native: bool) -> dict[str, float]:
    """What a choice says of a driver, as numbers.

    Args:
        given: By name.
        is_native: The planner has settings for all but `TEMPERAMENT`; others are told of them in `view.ego.driver`.

    Raises:
        InputError: Another name, no number, or a value beyond its bounds.
    """
    bounds = {**PARAMETERS, **{name: ends for name, ends in _CONSTANTS.items() if name != _SPENT}}
    bounds[_SEED] = (0.0, _WAVES - 1.0)
    known = TEMPERAMENT if is_native else tuple(bounds)
    found = {}
    for name, value in given.items():
        if name not in known:
            raise InputError(f"driver.{name}", f"is not known; there are {', '.join(known)}")
        low, high = bounds[name]
        try:
            number = math.nan if isinstance(value, bool) else float(value)  # type: ignore[arg-type]
        except (TypeError, ValueError):
            number = math.nan
        if not low <= number <= high:
            raise InputError(f"driver.{name}", f"must be a number from {low:g} to {high:g}, is {value}")
        found[name] = number
    return found


def check_planner(drivers: Drivers, planner: str) -> None:
    """Refuses files of drivers that were fitted for a planner whose settings mean something else.

    Raises:
        InputError: They were.
    """
    if (
        drivers.planner
        and drivers.name not in POPULATIONS
        and SETTINGS[planner].get("time_gap") != SETTINGS[drivers.planner].get("time_gap")
    ):
        alike = [name for name, own in SETTINGS.items() if own["time_gap"] == SETTINGS[drivers.planner]["time_gap"]]
        raise InputError(
            f"planner {planner}",
            f"drivers={drivers.name}: they were fitted for {drivers.planner}; {', '.join(alike)} can have them",
        )


def read_drivers(spec: str | Drivers) -> Drivers:
    """A population by its name, or from a file that ends in .toml.

    Raises:
        InputError: There is no such population or file, or the file cannot be used; one line says why.
    """
    if isinstance(spec, Drivers):
        return spec
    if spec in POPULATIONS:
        return POPULATIONS[spec]
    if not spec.endswith(_SUFFIX):
        near = difflib.get_close_matches(spec, POPULATIONS, n=1)
        hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(POPULATIONS)}, or a file FILE.toml"
        raise InputError("drivers", f"there is no population {spec!r}; {hint}")
    try:
        table = tomllib.loads(Path(spec).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"drivers {spec}", f"cannot be read: {error}") from None
    try:
        return _from_table(spec, table)
    except InputError as error:
        raise error.within(f"drivers {spec}") from None


def _from_table(name: str, table: Mapping[str, Any]) -> Drivers:
    if table.get("format") != _FORMAT:
        raise InputError("format", f"must be {_FORMAT}, is {table.get('format')!r}")
    kinds = {
        key: _distributions(value) for key, value in table.items() if isinstance(value, Mapping) and key not in _KEYS
    }
    unknown = [key for key in table if key not in _KEYS and key not in kinds]
    if unknown:
        raise InputError(unknown[0], f"is not known here; there are {', '.join(_KEYS)}")
    planner = table.get("planner", "")
    if planner and planner not in SETTINGS:
        raise InputError("planner", f"must be one of {', '.join(SETTINGS)}, not {planner!r}")
    given = _distributions(table.get("parameters", {}))
    correlation = tuple(_correlated(one) for one in table.get("correlation", ()))
    found = Drivers(
        name,
        given,
        correlation,
        kinds,
        **_constants(table.get("driver", {})),
        planner=planner,
        provenance=_provenance(table.get("provenance", {})),
    )
    found.drawn(0, 0)
    return found


def _provenance(given: object) -> Mapping[str, Any]:
    if not isinstance(given, Mapping):
        raise InputError("provenance", "must be a table")
    places = given.get("places", [])
    if not isinstance(places, list) or not all(isinstance(place, str) for place in places):
        raise InputError("provenance.places", f"must be a list of names of places, is {places!r}")
    return dict(given)  # batches send it to other processes


#: Bounds of `[driver]`, as those of the settings of `idm`.
_CONSTANTS = {
    "improved": (0.0, 1.0),
    "noise": (0.0, 5.0),
    "noise_length": (0.01, 60.0),
    "lateral_offset": (-2.0, 2.0),
    "lateral_kept": (0.0, 1.0),
    "lateral_noise": (0.0, 1.0),
    "lateral_length": (0.01, 60.0),
    "lateral_way": (0.0, 1000.0),
    "time_gap_kept": (0.0, 1.0),
    "looking_interval": (0.0, 60.0),
}
#: A `lateral_offset` that each driver has at its start: all of it is kept.
_AT_START = "start"
#: Lengths that mean nothing without the noise that they belong to.
_LENGTHS = {"noise_length": "noise", "lateral_length": "lateral_noise", "lateral_way": "lateral_noise"}


def _constants(given: object) -> dict[str, float]:
    if not isinstance(given, Mapping):
        raise InputError("driver", "must be a table")
    if given.get("lateral_offset") == _AT_START:
        if "lateral_kept" in given:
            raise InputError("driver.lateral_offset", f"is {_AT_START}, which lateral_kept says, too")
        given = {**given, "lateral_offset": 0.0, "lateral_kept": 1.0}
    for name, value in given.items():
        if name not in _CONSTANTS:
            raise InputError(f"driver.{name}", f"is not known; there are {', '.join(_CONSTANTS)}")
        low, high = _CONSTANTS[name]
        if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
            raise InputError(f"driver.{name}", f"must be a number from {low:g} to {high:g}, is {value!r}")
    return {name: float(value) for name, value in given.items()}


def _distributions(given: object) -> dict[str, Distribution]:
    if not isinstance(given, Mapping):
        raise InputError("parameters", "must be a table of parameters")
    for key in given:
        _check_known(key)
    return {key: _distribution(key, given[key]) for key in PARAMETERS if key in given}


def _check_known(name: str) -> None:
    if name not in PARAMETERS:
        near = difflib.get_close_matches(name, PARAMETERS, n=1)
        hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(PARAMETERS)}"
        raise InputError(name, f"is no parameter of drivers; {hint}")


def _distribution(name: str, given: object) -> Distribution:
    if not isinstance(given, Mapping) or "median" not in given:
        raise InputError(name, "must be a table with at least a median")
    transform, bounds = given.get("transform", "log"), given.get("bounds", PARAMETERS[name])
    values = [given["median"], given.get("sd", 0.0), *(bounds if isinstance(bounds, list | tuple) else [bounds])]
    if transform not in get_args(Transform):
        raise InputError(name, f"transform must be {', '.join(get_args(Transform))}, not {transform!r}")
    if len(values) != 4 or any(isinstance(v, bool) or not isinstance(v, int | float) for v in values):
        raise InputError(name, "median, sd and both bounds must be numbers")
    median, sd, low, high = (float(value) for value in values)
    least, most = PARAMETERS[name]
    if not least <= low < high <= most:
        raise InputError(name, f"bounds must ascend within {least:g} and {most:g}, are {low:g} and {high:g}")
    if not low <= median <= high or (transform == "logit" and not low < median < high):
        raise InputError(name, f"the median {median:g} must be between the bounds {low:g} and {high:g}")
    if not 0.0 <= sd <= 10.0:
        raise InputError(name, f"sd must be at least 0 and at most 10, is {sd:g}")
    return Distribution(median, sd, transform, low, high)


def _correlated(given: object) -> tuple[str, str, float]:
    if not isinstance(given, list) or len(given) != 3 or not isinstance(given[2], int | float):
        raise InputError("correlation", f"write it as [parameter, parameter, number], not {given!r}")
    one, other, value = str(given[0]), str(given[1]), float(given[2])
    _check_known(one)
    _check_known(other)
    if one == other or not -1.0 < value < 1.0:
        raise InputError("correlation", f"two parameters and a number between -1 and 1 are needed, not {given!r}")
    return one, other, value


def _shipped(name: str) -> Drivers:
    """A population that was fitted and is part of the package."""
    file = Path(__file__).parent / "populations" / f"{name}.toml"
    return _from_table(name, tomllib.loads(file.read_text(encoding="utf-8")))


#: Populations by name. `house`: around the defaults of `idm`, by hand; `calibrated`: fitted to recordings, see its
#: provenance; `calm`, `brisk`: its drivers with more room and softer, or with less room and harder.
POPULATIONS: Mapping[str, Drivers] = MappingProxyType(
    {name: _shipped(name) for name in ("house", "calm", "brisk", "calibrated")}
)
