"""Measures of the table of a case study. To add one, add a line to `MEASURES`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from interdrive.criticality import CriticalitySettings, measure_named
from interdrive.scenario import Shape
from interdrive.scenario.native import core_shape
from interdrive.storage import Column

if TYPE_CHECKING:
    from collections.abc import Callable

    from interdrive import _core
    from interdrive.array_types import Floats
    from interdrive.runs import Run


@dataclass(frozen=True)
class Measure:
    """A number about the encounter of two vehicles in a run; nan where it is not defined.

    Attributes:
        column: Name, type and meaning in the table.
        heading: The same for people, with unit.
        name: The criticality measure that it is of two vehicles.
        digits: Decimals to print.
        of: The number, from a run and the ids of the agent and of the other vehicle.
    """

    column: Column
    heading: str
    name: str
    digits: int
    of: Callable[[Run, int, int], float]

    def text(self, value: float | None) -> str:
        """A value for people, without unit; see `interdrive.criticality.Measure.text`."""
        return measure_named(self.name).text(value, self.digits, with_unit=False)


def footprint_distances(run: Run, first: int, second: int) -> Floats:
    """Distance between the footprints of the participants `first` and `second` of a `run` [m], shape (time_steps,).

    0 where they share a point; nan while one of them is absent, and everywhere if one of them never takes part.
    """
    states = run.states
    distances = np.full(states.n_steps, np.nan)
    rows = [int(row) for number in (first, second) for row in np.flatnonzero(states.participant_id == number)]
    if len(rows) < 2:
        return distances
    (i, a), (j, b) = ((row, _footprint(run, row)) for row in rows)
    x, y, orientation = states.x, states.y, states.orientation
    for k in np.flatnonzero(states.valid[i] & states.valid[j]):
        distances[k] = a.distance((x[i, k], y[i, k], orientation[i, k]), b, (x[j, k], y[j, k], orientation[j, k]))
    return distances


def _footprint(run: Run, row: int) -> _core.Shape:
    obstacles, states = run.scenario.obstacles, run.states
    recorded = np.flatnonzero(obstacles.ids == states.participant_id[row])
    if len(recorded):
        return core_shape(obstacles.shapes[int(recorded[0])])
    return core_shape(Shape("rectangle", length=float(states.length[row]), width=float(states.width[row])))


def collided(run: Run, first: int, second: int) -> bool:
    """Whether two participants collided with each other."""
    ended = run.outcomes
    pairs = zip(ended.outcome, ended.agent_id.tolist(), ended.partner_id.tolist(), strict=True)
    return any(how == "collision" and {who, whom} == {first, second} for how, who, whom in pairs)


def distance_of_closest_encounter(run: Run, first: int, second: int) -> float:
    """Smallest distance between the footprints while both are there, DCE [m]; 0 if they collide, nan if never both."""
    if run.states.is_static[run.states.participant_id == first].any():
        first, second = second, first
    # No limit except the size of maps; oncoming vehicles count, too.
    settings = CriticalitySettings(radius=_EVERYWHERE, oncoming_filter=False)
    value = _extreme("dce", settings)(run, first, second)
    return float("nan") if value == float("inf") else value


def _extreme(name: str, settings: CriticalitySettings | None = None) -> Callable[[Run, int, int], float]:
    """The most critical value of a measure for the first participant, with the second one as the only other one."""

    def of(run: Run, first: int, second: int) -> float:
        there = set(run.states.participant_id[run.states.valid.any(axis=1)].tolist())
        if not {first, second} <= there:
            return float("nan")
        areas: Literal["stated", "crossing"] = "stated" if run.scenario.incomings else "crossing"
        chosen = settings or CriticalitySettings(conflict_areas=areas)
        return float(run.criticality([first], other_ids=[second], settings=chosen).extremes[name].value[0])

    return of


#: Wider than any map of a scenario [m].
_EVERYWHERE = 2000.0

_ABSENT = "one of the two was not there"


def _number(name: str, text: str, unit: str, null: str = _ABSENT) -> Column:
    return Column(name, "number", text, unit, null=null)


_DCE = _number("min_dce", "smallest distance between the footprints of the two", "m")
_TTC = _number("min_ttc", "smallest time to collision along lanes with the other", "s")
_BTN = _number("max_btn", "largest brake threat number of the agent behind the other", "1")
_ET = _number("et", "encroachment time of the agent", "s", f"it entered and never left, or {_ABSENT}")
_PET = _number("pet", "post-encroachment time of the two", "s")

#: The numbers of the table, in its order. docs/reference/criticality.md defines them; where the map states no
#: intersection, the vehicles encroach where lanelets cross or join.
MEASURES = (
    Measure(_DCE, "min. DCE [m]", "dce", 2, distance_of_closest_encounter),
    Measure(_TTC, "min. TTC [s]", "ttc", 2, _extreme("ttc")),
    Measure(_BTN, "max. BTN", "btn", 2, _extreme("btn")),
    Measure(_ET, "ET [s]", "et", 1, _extreme("et")),
    Measure(_PET, "PET [s]", "pet", 1, _extreme("pet")),
)
