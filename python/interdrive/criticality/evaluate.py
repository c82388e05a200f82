"""All measures for recorded or simulated traffic, in one call of the core."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive import _core
from interdrive.criticality.measures import MEASURES, measure_named
from interdrive.criticality.settings import CriticalitySettings
from interdrive.criticality.source import connectors_of, traffic_of
from interdrive.criticality.tables import criticality_table
from interdrive.errors import InputError
from interdrive.native_settings import RoadSettings
from interdrive.recordings import overlapping_at_first
from interdrive.run import RunRecord
from interdrive.scenario import Scenario
from interdrive.scenario.native import core_road, storeys, thread_count
from interdrive.storage import Origin, Tabled, changed_settings
from interdrive.storage.html import html_head

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from interdrive.array_types import Bools, Floats, Ints
    from interdrive.criticality.source import Traffic
    from interdrive.files import ScenarioSpec
    from interdrive.storage import ArrowTable

#: Pairs that a note names.
_NAMED = 3

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
class Criticality(Tabled):
    """All measures of some participants.

    Attributes:
        participant_id: Judged participants, ascending, shape (judged,).
        first_time_step: Time step of column 0.
        dt: Time between steps [s].
        present: Whether each was there, shape (judged, time_steps).
        series: By name of the measure (`MEASURES`).
        in_the_way: By name of the measure, what pairs are ranked by: as `series`, but for headway, time headway, time
            to collision along lanes, and the accelerations and threat numbers that follow from them, only participants
            in the way of the judged one count: they stand on the path that it then drives, or drive along
            it, and the bodies would meet. Recorded footprints that overlap by less than 0.3 m are no contact there.
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
        overlapping: Pairs of ids that overlap at their first common time step, unless they collide later in a run;
            they are in the tables, but not among the most critical moments: no run drove them together.
        notes: One line per thing the user should know.
        origin: How the values came about.
    """

    participant_id: Ints
    first_time_step: int
    dt: float
    present: Bools
    series: Mapping[str, Series]
    in_the_way: Mapping[str, Series]
    extremes: Mapping[str, Extremes]
    tet_seconds: Floats
    tit_mean: Floats
    psd_below_one: Floats
    et_left_censored: Bools
    pet_first: Ints
    paths: tuple[str, ...]
    settings: CriticalitySettings
    notes: tuple[str, ...]
    overlapping: tuple[tuple[int, int], ...] = ()
    origin: Origin = field(default_factory=Origin)

    def __repr__(self) -> str:
        judged, steps = self.present.shape
        return f"<Criticality of {judged} participants over {steps} time steps: {', '.join(self.series)}>"

    def _repr_html_(self) -> str:
        """The most critical value of each measure, one row per participant, for notebooks."""
        units = {name: measure_named(name).unit for name in self.extremes}
        heads = {name: f"{name} [{unit}]" if unit else name for name, unit in units.items()}
        rows: list[dict[str, float | str | None]] = [
            {
                "participant_id": participant,
                **{
                    heads[name]: float(value) if np.isfinite(value := found.value[row]) else None
                    for name, found in self.extremes.items()
                },
            }
            for row, participant in enumerate(self.participant_id.tolist())
        ]
        names = ("participant_id", *heads.values())
        from html import escape  # noqa: PLC0415 - a long table of entities

        return f"<p>{escape(repr(self))}</p>{html_head(names, rows, len(rows))}"

    def to_arrow(self) -> ArrowTable:
        """All measures in long form, as criticality.parquet: one row per participant, time step and measure."""
        return self.origin.marked(criticality_table(self))

    def __getitem__(self, name: str) -> Floats:
        """Values of a measure, shape (judged, time_steps).

        Raises:
            InputError: There is no such measure.
        """
        return self.series[measure_named(name).name].value

    def row(self, participant_id: int) -> int:
        """Row of the judged participant with id `participant_id`.

        Raises:
            InputError: It was not evaluated.
        """
        rows = np.flatnonzero(self.participant_id == participant_id)
        if not len(rows):
            raise InputError(f"participant {participant_id} was not evaluated")
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
        if self.in_the_way[measure.name] is not self.series[measure.name]:
            return next(iter(self.most_critical_pairs(name, 1)), None)
        extremes = self.extremes[measure.name]
        is_artefact = self._is_overlapping(self.participant_id, extremes.partner_id)
        values = np.where(np.isfinite(extremes.value) & ~is_artefact, extremes.value, np.nan)
        if measure.none_is_zero:
            values = np.where(values == 0.0, np.nan, values)
        # A vehicle that is most critical against what it overlaps may have met others, too.
        others = self.most_critical_pairs(name, 1, rows=is_artefact) if is_artefact.any() else ()
        if not np.isfinite(values).any():
            return others[0] if others else None
        row = int(np.nanargmax(values) if measure.grows else np.nanargmin(values))
        numbers = (int(array[row]) for array in (extremes.partner_id, extremes.time_step, extremes.path))
        found = self._moment(measure.name, float(values[row]), row, *numbers)
        return min((found, *others), key=lambda one: -one.value if measure.grows else one.value)

    def most_critical_pairs(self, name: str, n: int, *, rows: Bools | None = None) -> tuple[CriticalMoment, ...]:
        """The most critical moments of different pairs of participants, the most critical one first.

        Ranked by `in_the_way`. Pairs of `overlapping` are left out. The moment of an encounter that was known long
        before (`dce`, `et`, `pet`) is the encounter itself.

        Args:
            name: The measure.
            n: Largest number of pairs.
            rows: If given, only moments of these judged participants, shape (judged,).

        Raises:
            InputError: There is no such measure.
        """
        measure = measure_named(name)
        series = self.in_the_way[measure.name]
        is_conflict = np.isfinite(series.value) & (series.partner_id >= 0)
        if measure.none_is_zero:
            is_conflict &= series.value != 0.0
        if measure.name == "dce":  # Said from long before: the moment is that of the encounter.
            is_conflict &= self.series["ttce"].value == 0.0
        elif measure.name == "et":  # The series counts down: only the whole time is that of the vehicle.
            extremes = self.extremes["et"]
            is_conflict &= series.value == extremes.value[:, None]
        is_conflict &= ~self._is_overlapping(self.participant_id[:, None], series.partner_id)
        if rows is not None:
            is_conflict &= rows[:, None]
        row, column = np.nonzero(is_conflict)
        value, partner = series.value[row, column], series.partner_id[row, column]
        # Encroachment is said from the first state on: the moment is the last one at which it is.
        in_time = -column if measure.name in ("et", "pet") else column
        order = np.lexsort((in_time, row, -value if measure.grows else value))
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

    def _is_overlapping(self, one: Ints, other: Ints) -> Bools:
        """Whether pairs of ids are in `overlapping`; shapes are broadcast."""
        one, other = np.broadcast_arrays(one, other)
        found = np.zeros(one.shape, dtype=np.bool_)
        for low, high in self.overlapping:
            found |= ((one == low) & (other == high)) | ((one == high) & (other == low))
        return found

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
    source: ScenarioSpec | RunRecord,
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
    if not isinstance(source, Scenario | RunRecord):
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
        raise InputError(f"participant {strangers[0]}: a deceleration is given for it, but it is not evaluated")
    found = _core.evaluate_criticality(
        scenario.dt,
        core_road(scenario, _ROAD),
        traffic.in_core,
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
            "the map has no intersection: no conflict areas for et, pet and psd; "
            "conflict_areas=crossing looks for crossing lanelets"
        )
    collided = {(min(a, b), max(a, b)) for a, b, _ in traffic.contacts}
    pairs = tuple(
        pair
        for pair in overlapping_at_first(traffic, storeys(scenario))
        if not set(judged).isdisjoint(pair) and pair not in collided
    )
    if pairs:
        one = len(pairs) == 1
        notes.append(
            f"{len(pairs)} {'pair' if one else 'pairs'} of vehicles overlap{'s' * one} from the start and "
            f"{'is' if one else 'are'} not among the most critical ones: "
            + ", ".join(f"{low} and {high}" for low, high in pairs[:_NAMED])
            + (f" and {len(pairs) - _NAMED} more" if len(pairs) > _NAMED else "")
        )
    asked = {"participant_ids": participant_ids, "other_ids": other_ids, "deceleration of participants": deceleration}
    inputs = {"scenario": scenario.sha256}
    if not isinstance(source, Scenario):
        inputs["run"] = source.digest
    origin = Origin(
        changed_settings(chosen) | {name: value for name, value in asked.items() if value is not None}, inputs
    )
    return replace(_criticality(found, traffic, scenario.dt, chosen, tuple(notes)), overlapping=pairs, origin=origin)


def _criticality(
    found: dict[str, Any], traffic: Traffic, dt: float, settings: CriticalitySettings, notes: tuple[str, ...]
) -> Criticality:
    measures, ahead = found["measures"], found["in_the_way"]
    keys = ("value", "partner", "way")
    series = {m.name: Series(*(measures[m.name][key] for key in keys)) for m in MEASURES}
    rows = np.searchsorted(traffic.ids, found["ids"])
    present = traffic.valid[rows]
    present.setflags(write=False)
    return Criticality(
        participant_id=found["ids"],
        first_time_step=traffic.first_time_step,
        dt=dt,
        present=present,
        series=series,
        in_the_way=series | {name: Series(*(one[key] for key in keys)) for name, one in ahead.items()},
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
