"""Names, units and directions of the criticality measures."""

from __future__ import annotations

import difflib
from dataclasses import dataclass

from interdrive.errors import InputError


@dataclass(frozen=True)
class Measure:
    """One measure.

    Attributes:
        name: In tables and arguments.
        title: For people.
        unit: "m", "s", ...; "" for a number without unit.
        grows: Larger values are more critical; otherwise smaller ones.
        none_is_zero: Without a conflict it is 0; otherwise inf.
    """

    name: str
    title: str
    unit: str
    grows: bool = False
    none_is_zero: bool = False

    @property
    def label(self) -> str:
        """Title with unit."""
        return f"{self.title} [{self.unit}]" if self.unit else self.title


#: All measures in the order of tables; docs/reference/criticality.md defines them.
MEASURES = (
    Measure("hw", "headway", "m"),
    Measure("thw", "time headway", "s"),
    Measure("ttc", "time to collision", "s"),
    Measure("tet", "time exposed TTC, share", "", grows=True, none_is_zero=True),
    Measure("tit", "time integrated TTC", "s²", grows=True, none_is_zero=True),
    Measure("dce", "distance of closest encounter", "m"),
    Measure("ttce", "time to closest encounter", "s"),
    Measure("et", "encroachment time", "s"),
    Measure("pet", "post-encroachment time", "s"),
    Measure("a_long_req", "required longitudinal acceleration", "m/s²", none_is_zero=True),
    Measure("btn", "brake threat number", "", grows=True, none_is_zero=True),
    Measure("a_lat_req", "required lateral acceleration", "m/s²", grows=True, none_is_zero=True),
    Measure("stn", "steer threat number", "", grows=True, none_is_zero=True),
    Measure("psd", "proportion of stopping distance", ""),
    Measure("msd", "minimal stopping distance", "m", grows=True),
)

_BY_NAME = {measure.name: measure for measure in MEASURES}


def measure_named(name: str) -> Measure:
    """The measure with a name.

    Raises:
        InputError: There is none; the text names the nearest one.
    """
    if name in _BY_NAME:
        return _BY_NAME[name]
    near = difflib.get_close_matches(name.lower(), _BY_NAME, n=1, cutoff=0.6)
    hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(_BY_NAME)}"
    raise InputError(f"there is no measure '{name}'; {hint}")
