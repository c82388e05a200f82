"""Names, units and directions of the criticality measures."""

from __future__ import annotations

import difflib
import math
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
        horizon: In texts, sizes beyond this say only that they are beyond it.
        drawn_to: In figures, values beyond this do not matter any more; they would only press the rest down.
    """

    name: str
    title: str
    unit: str
    grows: bool = False
    none_is_zero: bool = False
    horizon: float = math.inf
    drawn_to: float = math.inf

    @property
    def label(self) -> str:
        """Title with unit."""
        return f"{self.title} [{self.unit}]" if self.unit else self.title

    def text(self, value: float | None, digits: int = 2, *, with_unit: bool = True) -> str:
        """A value for people, such as "1.52 s", "> 60 s" beyond the horizon, or "-" without a conflict.

        Args:
            value: In the unit of the measure; None, nan and infinite ones are "-".
            digits: Behind the point.
            with_unit: Whether the unit follows; it need not where the heading of a column has it.
        """
        if value is None or not math.isfinite(value):
            return "-"
        if abs(value) > self.horizon:
            number = f"> {self.horizon:g}" if value > 0.0 else f"< -{self.horizon:g}"
        else:
            number = f"{value:.{digits}f}"
            number = number if float(number) else number.removeprefix("-")
        return f"{number} {self.unit}" if with_unit and self.unit else number


#: All measures in the order of tables; docs/reference/criticality.md defines them, with their horizons.
MEASURES = (
    Measure("hw", "headway", "m", horizon=1000.0, drawn_to=100.0),
    Measure("thw", "time headway", "s", horizon=60.0, drawn_to=10.0),
    Measure("ttc", "time to collision along lanes", "s", horizon=60.0, drawn_to=10.0),
    Measure("tet", "time exposed TTC, share", "", grows=True, none_is_zero=True),
    Measure("tit", "time integrated TTC", "s²", grows=True, none_is_zero=True, horizon=1000.0),
    Measure("dce", "distance of closest encounter", "m", horizon=1000.0, drawn_to=50.0),
    Measure("ttce", "time to closest encounter", "s", horizon=60.0, drawn_to=20.0),
    Measure("et", "encroachment time", "s", horizon=60.0, drawn_to=20.0),
    Measure("pet", "post-encroachment time", "s", horizon=60.0, drawn_to=20.0),
    Measure("a_long_req", "required longitudinal acceleration", "m/s²", none_is_zero=True, horizon=100.0),
    Measure("btn", "brake threat number", "", grows=True, none_is_zero=True, horizon=100.0, drawn_to=3.0),
    Measure("a_lat_req", "required lateral acceleration", "m/s²", grows=True, none_is_zero=True, horizon=100.0),
    Measure("stn", "steer threat number", "", grows=True, none_is_zero=True, horizon=100.0, drawn_to=3.0),
    Measure("psd", "proportion of stopping distance", "", horizon=100.0, drawn_to=10.0),
    Measure("msd", "minimal stopping distance", "m", grows=True, horizon=1000.0),
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
