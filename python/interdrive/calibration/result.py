"""What a calibration found, as a table and as a file of drivers."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from interdrive.calibration.variables import VARIABLES, population
from interdrive.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from interdrive.calibration.variables import Range
    from interdrive.calibration.verdicts import PlaceVerdict
    from interdrive.config.drivers import Drivers
    from interdrive.run import Json
    from interdrive.traffic_realism import Realism


@dataclass(frozen=True)
class Calibration:
    """A population that was fitted to recordings.

    Attributes:
        values: Fitted numbers by name, such as time_gap.median.
        ranges: What fits of nearly the same quality say of each.
        planner: Name of the planner.
        places: Places that it was fitted on.
        objectives: Of the usual and of the fitted population, by stage; less is better.
        parts: What the last objective consists of.
        evaluations: Populations that were tried, by stage.
        file: File of the drivers, for `drivers=FILE`.
        verdicts: By place, fitted ones included.
        realism: What was measured at the places that were held out; None: there are none.
        notes: What there is to know about the recordings.
        provenance: Where the numbers are from, as in the file.
        folds: By place that was left out, what was found on the others; empty without folds.
    """

    values: Mapping[str, float]
    ranges: Mapping[str, Range]
    planner: str
    places: tuple[str, ...]
    objectives: Mapping[str, tuple[float, float]]
    parts: Mapping[str, float]
    evaluations: Mapping[str, int]
    file: Path
    verdicts: Mapping[str, PlaceVerdict]
    realism: Realism | None = field(repr=False)
    notes: tuple[str, ...] = ()
    provenance: Mapping[str, Json] = field(default_factory=dict, repr=False)
    folds: Mapping[str, Calibration] = field(default_factory=dict, repr=False)

    def __repr__(self) -> str:
        return f"<Calibration of {self.planner} on {', '.join(self.places)}>"

    @property
    def drivers(self) -> Drivers:
        """The population."""
        return population(str(self.file), dict(self.values))

    def is_realistic(self, place: str) -> bool:
        """Whether the population may be called realistic at a place.

        Args:
            place: Its name.

        Raises:
            InputError: Nothing can be said: it was fitted there, or not measured, or on too little.
        """
        if place not in self.verdicts:
            raise InputError(f"place {place}: was not measured; there are {', '.join(self.verdicts)}")
        found = self.verdicts[place]
        if found.is_realistic is None:
            raise InputError(f"place {place}: {'; '.join(found.reasons)}, so it says nothing about realism")
        return found.is_realistic

    @property
    def rows(self) -> list[tuple[str, str, str, str, str]]:
        """Each number: its name, usual value, fitted value, range among fits of nearly the same quality, judgement."""
        return [
            (
                one.name,
                f"{one.prior:.4g}",
                f"{self.values[one.name]:.4g}",
                f"{self.ranges[one.name].low:.3g} to {self.ranges[one.name].high:.3g}",
                "yes" if self.ranges[one.name].is_identified else "no",
            )
            for one in VARIABLES
        ]


def drivers_file(drivers: Drivers, planner: str, provenance: Mapping[str, Json]) -> str:
    """A population as the text of its file.

    Args:
        drivers: The population.
        planner: Name of the planner that it was fitted for.
        provenance: Plain values: texts, numbers, truth values, lists, and mappings of them.
    """
    lines = ["format = 1", f"planner = {_plain(planner)}", ""]
    for name, one in drivers.parameters.items():
        lines += [
            f"[parameters.{name}]",
            f"transform = {_plain(one.transform)}",
            f"bounds = [{one.low!r}, {one.high!r}]",
            f"median = {one.median!r}",
            f"sd = {one.sd!r}",
            "",
        ]
    lines += ["[driver]", *(f"{name} = {value!r}" for name, value in drivers.constants.items()), ""]
    lines += ["[provenance]", *(f"{name} = {_plain(value)}" for name, value in provenance.items())]
    return "\n".join(lines) + "\n"


def _plain(value: object) -> str:
    """A value in TOML."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return '"' + "".join(c if c.isprintable() else f"\\u{ord(c):04x}" for c in escaped) + '"'
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_plain(str(name))} = {_plain(one)}" for name, one in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_plain, value)) + "]"
    return repr(value)
