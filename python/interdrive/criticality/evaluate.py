"""All measures for recorded or simulated traffic, in one call of the core."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive import _core
from interdrive.criticality.measures import MEASURES, measure_named
from interdrive.criticality.settings import CriticalitySettings
from interdrive.criticality.source import RecordedRun, connectors_of, traffic_of
from interdrive.errors import InputError
from interdrive.native_settings import RoadSettings
from interdrive.scenario import Scenario
from interdrive.scenario.native import core_road, core_shape, thread_count

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from interdrive.criticality.source import Bools, Floats, Ints, Traffic
    from interdrive.files import ScenarioSpec

#: Gaps between lanelets do not matter to the measures; this is what a road must be built with.
_ROAD = RoadSettings(open_end_length=0.0)


@dataclass(frozen=True)
class Series:
    """One measure over time; arrays of shape (judged, time_steps).

    Attributes:
        value: In the unit of the measure. inf: no conflict. nan: absent, or cannot be computed.
        partner_id: Id of the decisive participant; -1 for none.
        path: Index into `Criticality.paths`; -1 for none.
    """

    value: Floats
    partner_id: Ints
    path: Ints


@dataclass(frozen=True)
class Extremes:
    """The most critical value of one measure per judged participant; arrays of shape (judged,).

    Attributes:
        value: nan if it could not be computed at any time step.
        time_step: When; of the distance of the closest encounter, the encounter itself.
        partner_id: Id of the decisive participant; -1 for none.
        path: Index into `Criticality.paths`; -1 for none.
    """

    value: Floats
    time_step: Ints
    partner_id: Ints
    path: Ints


@dataclass(frozen=True)
class CriticalMoment:
    """The most critical moment of a measure.

    Attributes:
        measure: Its name. value: In its unit.
        participant_id: Evaluated participant. partner_id: Decisive participant; -1 for none.
        time_step: Time step of the moment.
        path: Path or conflict area, as in `Criticality.paths`; "" for none.
    """

    measure: str
    value: float
    participant_id: int
    partner_id: int
    time_step: int
    path: str


@dataclass(frozen=True)
class Criticality:
    """All measures of some participants.

    Attributes:
        participant_id: Judged participants, ascending, shape (judged,).
        first_time_step: Time step of column 0.
        dt: Time between steps [s].
        present: Whether each was there, shape (judged, time_steps).
        series: By name of the measure (`MEASURES`).
        extremes: By name of the measure.
        tet_seconds: Time with a time to collision of at most the threshold [s], shape (judged,).
        tit_mean: Time integrated TTC per time of presence [s], shape (judged,).
        psd_below_one: Share of the time steps before a conflict area at which it could not have stopped before it; nan
            without any; shape (judged,).
        et_left_censored: The conflict area of the encroachment time was occupied from the first state on.
        pet_first: Id of the first participant in the conflict area of the post-encroachment time; -1 for none.
        paths: Paths ("12 > 15 > 18", lanelets in driving order) and conflict areas ("12 x 34": the own lanelet, the
            other one's) that values refer to.
        settings: As evaluated.
        notes: One line per thing the user should know.
    """

    participant_id: Ints
    first_time_step: int
    dt: float
    present: Bools
    series: Mapping[str, Series]
    extremes: Mapping[str, Extremes]
    tet_seconds: Floats
    tit_mean: Floats
    psd_below_one: Floats
    et_left_censored: Bools
    pet_first: Ints
    paths: tuple[str, ...]
    settings: CriticalitySettings
    notes: tuple[str, ...]

    def __repr__(self) -> str:
        judged, steps = self.present.shape
        return f"<Criticality of {judged} participants over {steps} time steps: {', '.join(self.series)}>"

    def __getitem__(self, name: str) -> Floats:
        """Values of a measure, shape (judged, time_steps).

        Raises:
            InputError: There is no such measure.
        """
        return self.series[measure_named(name).name].value

    def row(self, participant_id: int) -> int:
        """Row of the judged participant with id `participant_id`.

        Raises:
            InputError: It was not judged.
        """
        rows = np.flatnonzero(self.participant_id == participant_id)
        if not len(rows):
            raise InputError(f"participant {participant_id} was not judged")
        return int(rows[0])

    def most_critical(self, name: str) -> CriticalMoment | None:
        """The most critical moment of the measure `name` among all judged participants; the first of equal ones.

        Returns:
            None if there was no conflict: no finite value, or none above 0 for a measure that grows (none below 0 for
            the required longitudinal acceleration).

        Raises:
            InputError: There is no such measure.
        """
        measure = measure_named(name)
        extremes = self.extremes[measure.name]
        values = np.where(np.isfinite(extremes.value), extremes.value, np.nan)
        if measure.none_is_zero:
            values = np.where(values == 0.0, np.nan, values)
        if not np.isfinite(values).any():
            return None
        row = int(np.nanargmax(values) if measure.grows else np.nanargmin(values))
        numbers = (int(array[row]) for array in (extremes.partner_id, extremes.time_step, extremes.path))
        return self._moment(measure.name, float(values[row]), row, *numbers)

    def most_critical_pairs(self, name: str, n: int) -> tuple[CriticalMoment, ...]:
        """The most critical moments of different pairs of participants, the most critical one first.

        Args:
            name: The measure.
            n: At most so many.

        Raises:
            InputError: There is no such measure.
        """
        measure = measure_named(name)
        series = self.series[measure.name]
        is_conflict = np.isfinite(series.value) & (series.partner_id >= 0)
        if measure.none_is_zero:
            is_conflict &= series.value != 0.0
        row, column = np.nonzero(is_conflict)
        value, partner = series.value[row, column], series.partner_id[row, column]
        order = np.argsort(-value if measure.grows else value, kind="stable")
        both = np.sort(np.stack([self.participant_id[row], partner], axis=1), axis=1)[order]
        first = order[np.sort(np.unique(both, axis=0, return_index=True)[1])][:n]
        return tuple(
            self._moment(
                measure.name,
                float(value[i]),
                int(row[i]),
                int(partner[i]),
                int(column[i]) + self.first_time_step,
                int(series.path[row[i], column[i]]),
            )
            for i in first.tolist()
        )

    def _moment(
        self, measure: str, value: float, row: int, partner_id: int, time_step: int, path: int
    ) -> CriticalMoment:
        return CriticalMoment(
            measure=measure,
            value=value,
            participant_id=int(self.participant_id[row]),
            partner_id=partner_id,
            time_step=time_step,
            path="" if path < 0 else self.paths[path],
        )

    def most_critical_moment(self) -> CriticalMoment | None:
        """The moment to look at: the smallest time to collision; without any, the smallest distance of an encounter.

        Returns:
            None if no participants met.
        """
        for name in ("ttc", "dce"):
            moment = self.most_critical(name)
            if moment is not None:
                return moment
        return None


def evaluate(
    source: ScenarioSpec | RecordedRun,
    participant_ids: Sequence[int] | None = None,
    *,
    other_ids: Sequence[int] | None = None,
    settings: CriticalitySettings | None = None,
    deceleration: Mapping[int, float] | None = None,
    threads: int | None = None,
) -> Criticality:
    """All measures at every time step.

    Args:
        source: A run, or a scenario (see `interdrive.ScenarioSpec`) whose recorded traffic is evaluated.
        participant_ids: Participants to judge; by default all agents of a run, all recorded vehicles of a scenario.
        other_ids: If given, only these participants (and the judged ones among themselves) are looked at.
        settings: Parameters and switches; the defaults otherwise.
        deceleration: Available deceleration of single vehicles by id [m/s²].
        threads: The number of cores by default. Results do not depend on it.

    Returns:
        The measures, rows sorted by id.

    Raises:
        InputError: An id that is not there, is static or never present; impossible settings or states. One line.
    """
    n_threads = thread_count(threads)
    chosen = settings or CriticalitySettings()
    if not isinstance(source, Scenario | RecordedRun):
        from interdrive.files import open_scenario  # noqa: PLC0415 - commonroad-io takes a second to load

        source = open_scenario(source)
    scenario = source if isinstance(source, Scenario) else source.scenario
    traffic = traffic_of(source)
    judged = traffic.default_ids if participant_ids is None else list(participant_ids)
    if other_ids is not None:
        traffic = traffic.only([*judged, *other_ids])
    available = dict(deceleration or {})
    strangers = [number for number in available if number not in judged]
    if strangers:
        raise InputError(f"participant {strangers[0]}: a deceleration is given for it, but it is not judged")
    found = _core.evaluate_criticality(
        scenario.dt,
        core_road(scenario, _ROAD),
        traffic.ids.tolist(),
        [core_shape(shape) for shape in traffic.shapes],
        traffic.is_static.tolist(),
        traffic.first_time_step,
        traffic.x,
        traffic.y,
        traffic.orientation,
        traffic.velocity,
        traffic.acceleration,
        np.ascontiguousarray(traffic.valid),
        judged=judged,
        deceleration=[available.get(number, chosen.deceleration) for number in judged],
        connectors=connectors_of(scenario) if chosen.conflict_areas == "stated" else None,
        contacts=traffic.contacts,
        threads=n_threads,
        settings=chosen,
    )
    notes = []
    if not judged:
        notes.append("no vehicle is evaluated: there are no agents and no moving vehicles, or none are requested")
    if chosen.conflict_areas == "stated" and not scenario.incomings:
        notes.append(
            "the map states no intersection: no conflict areas for et, pet and psd; "
            "conflict_areas=crossing looks for crossing lanelets"
        )
    return _criticality(found, traffic, scenario.dt, chosen, tuple(notes))


def _criticality(
    found: dict[str, Any], traffic: Traffic, dt: float, settings: CriticalitySettings, notes: tuple[str, ...]
) -> Criticality:
    measures = found["measures"]
    rows = np.searchsorted(traffic.ids, found["ids"])
    present = traffic.valid[rows]
    present.setflags(write=False)
    return Criticality(
        participant_id=found["ids"],
        first_time_step=traffic.first_time_step,
        dt=dt,
        present=present,
        series={m.name: Series(*(measures[m.name][key] for key in ("value", "partner", "way"))) for m in MEASURES},
        extremes={
            m.name: Extremes(
                value=measures[m.name]["extreme"],
                time_step=measures[m.name]["extreme_time_step"],
                partner_id=measures[m.name]["extreme_partner"],
                path=measures[m.name]["extreme_way"],
            )
            for m in MEASURES
        },
        tet_seconds=found["tet_seconds"],
        tit_mean=found["tit_mean"],
        psd_below_one=found["psd_below_one"],
        et_left_censored=found["et_left_censored"],
        pet_first=found["pet_first"],
        paths=tuple((" x " if crosses else " > ").join(map(str, lanelets)) for crosses, lanelets in found["ways"]),
        settings=settings,
        notes=notes,
    )
