"""The evaluation: recordings and planners in, rows and floors out."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, cast, get_args

import numpy as np

from interdrive.batches.plan import labels_of
from interdrive.config.binding import flatten
from interdrive.config.schema import SimulationSettings
from interdrive.config.specs import read_planner
from interdrive.errors import InputError, InterdriveError
from interdrive.scenario.known_goals import Information
from interdrive.scenario.native import core_road
from interdrive.traffic_realism import rollouts
from interdrive.traffic_realism.analog import Situations, analog, situations
from interdrive.traffic_realism.jobs import done, planning_from, rollout_settings
from interdrive.traffic_realism.measures import measured
from interdrive.traffic_realism.persistence import thirds
from interdrive.traffic_realism.result import Realism
from interdrive.traffic_realism.summary import LongMeasures, floor_of, row_of
from interdrive.traffic_realism.windows import read_recordings, windows_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from interdrive.config.schema import SettingsSpec
    from interdrive.config.specs import PlannerSpec
    from interdrive.traffic_realism.measures import WindowMeasures
    from interdrive.traffic_realism.summary import Row
    from interdrive.traffic_realism.windows import Recording, Window

#: Rows that are always beside those of planners.
RECORDED, CONSTANT_VELOCITY, ANALOG = "recorded", "constant_velocity", "analog"
#: All places together.
ALL = "all"


@dataclass(frozen=True)
class _Job:
    """A window, and who drives in it."""

    window: Window
    settings: SimulationSettings
    planners: tuple[tuple[str, PlannerSpec], ...]
    seeds: tuple[int, ...]
    agents: tuple[int, ...] = ()
    known: Situations | None = None
    first: int = 0  # of its vehicles among the situations
    is_long: bool = False

    @property
    def judged(self) -> np.ndarray:
        """Ids of the judged vehicles that plan."""
        return np.intersect1d(self.window.judged, np.array(self.agents, dtype=np.int64))


def realism(
    files: str | Path | Sequence[str | Path],
    planners: PlannerSpec | Sequence[PlannerSpec] = "rollout",
    *,
    goals: Information = "turns",
    rollouts: int = 8,
    horizon: float = 8.0,
    long: float = 40.0,
    starts: Sequence[float] = (),
    seed: int = 0,
    settings: SettingsSpec | None = None,
    raw: bool = False,
    any_traffic: bool = False,
    workers: int = 1,
    on_step: Callable[[str, int, int], None] | None = None,
) -> Realism:
    """Measures how far planners drive from recorded people.

    All cars, trucks, buses and motorcycles of a recording replay until a start, then plan; bicycles and people go on
    replaying. Beside the planners stand the recording itself (`recorded`), `constant_velocity`, `analog` (what recorded
    vehicles in a like situation did) and the floor (one half of the recording against the other).

    Args:
        files: CommonRoad files with recorded traffic, and folders of them; windows of one recording are joined.
        planners: A choice as in `simulate`, or a list of them.
        goals: What agents know of their recording, see `interdrive.GoalSettings`; `timed` knows the recorded time.
        rollouts: Rollouts of each start. Planners that draw nothing have one, as all would be equal.
        horizon: Length of rollouts [s]; scores are at 1, 3, 5 and 8 s.
        long: Length of the rollouts for safety and persistence [s]; 0: none.
        starts: Times in each recording at which vehicles begin to plan [s]; empty: every 8 s, or 16 s on busy roads.
        seed: Of drawings, bootstrap and classifier.
        settings: Settings, or a mapping of dotted names, of the runs.
        raw: Read recordings without repairs.
        any_traffic: Take simulated and invented traffic, too.
        workers: Processes that share the windows; results do not depend on it. With more than one, scripts need
            `if __name__ == "__main__":`.
        on_step: Called with the current activity, the amount done, and the total.

    Returns:
        All rows, with tables.

    Raises:
        InputError: A file or planner cannot be used, or no vehicle can be judged.
        InterdriveError: A process was lost twice.
    """
    _check(goals, rollouts, horizon, long, workers, starts)
    given = rollout_settings(settings, goals)
    choices = _choices(planners, given)
    sources = [files] if isinstance(files, str | os.PathLike) else list(files)
    recordings, notes = read_recordings(sources, raw=raw, any_traffic=any_traffic)
    windows = windows_of(recordings, horizon=horizon, starts=starts)
    if not windows:
        raise InputError("realism: no vehicle can be judged: none is recorded for 3.2 s after a start")
    long_windows = windows_of(recordings, horizon=long, is_long=True) if long > 0.0 else []
    draws = any(_draws(planner, given) for _, planner in choices)
    short_seeds = tuple(seed + i for i in range(rollouts if draws else 1))
    every = [_Job(one, planning_from(given, one), choices, short_seeds) for one in windows]
    every += [_Job(one, planning_from(given, one), choices, (seed,), is_long=True) for one in long_windows]
    agents = list(done(_planning, every, workers, on_step, "routes"))
    every = [replace(job, agents=tuple(own)) for job, own in zip(every, agents, strict=True)]
    jobs = [job for job in every if not job.is_long and len(job.judged)]
    long_jobs = [job for job in every if job.is_long and job.agents]
    if not jobs:
        raise InputError("realism: no vehicle can be judged: none has a route")
    windows = [job.window for job in jobs]
    known = situations(windows, [job.judged for job in jobs])
    firsts = np.cumsum([0, *(len(job.judged) for job in jobs)]).tolist()
    jobs = [replace(job, known=known, first=first) for job, first in zip(jobs, firsts, strict=False)]
    found = list(done(_measured, jobs, workers, on_step, "rollouts"))
    found_long = list(done(_measured_long, long_jobs, workers, on_step, "long rollouts"))
    if any(ANALOG not in one for one in found):
        notes.append(f"{ANALOG} is left out: fewer than 24 recorded vehicles are far enough from those of a window")
    names = [RECORDED, CONSTANT_VELOCITY, *([ANALOG] if all(ANALOG in one for one in found) else [])]
    everybody = [*(label for label, _ in choices), *names]
    rows: list[Row] = []
    floors = []
    places = list(dict.fromkeys(window.place for window in windows))
    fitted = {label: _fitted_on(planner, given) for label, planner in choices}
    notes += [
        f"{label} was fitted on {', '.join(sorted(own.intersection(places)))}: there it says nothing about realism"
        for label, own in fitted.items()
        if own.intersection(places)
    ]
    for place in [*([ALL] if len(places) > 1 else []), *places]:
        own = [one for one, job in zip(found, jobs, strict=True) if place in (ALL, job.window.place)]
        own_long = [one for one, job in zip(found_long, long_jobs, strict=True) if place in (ALL, job.window.place)]
        recorded = [one[RECORDED] for one in own]
        floors.append(floor_of(place, recorded, seed=seed))
        for name in everybody:
            parts, parts_long = [one[name] for one in own], [one[name] for one in own_long if name in one]
            known_places = places if place == ALL else [place]
            is_fitted = bool(fitted.get(name, set()).intersection(known_places))
            rows.append(row_of(name, place, parts, recorded, parts_long, seed=seed, is_fitted=is_fitted))
            if on_step is not None:
                on_step(f"{name}, {place}", len(rows), (len(places) + (len(places) > 1)) * len(everybody))
    usual = flatten(SimulationSettings())
    return Realism(
        rows=tuple(rows),
        floors=tuple(floors),
        windows=tuple((job.window.place, job.window.index, job.window.time) for job in jobs),
        measures={name: tuple(one[name] for one in found) for name in everybody},
        files=tuple(dict.fromkeys(path for one in recordings for path in one.files)),
        notes=tuple(dict.fromkeys([*notes, *_notes(recordings)])),
        settings={
            "planners": [label for label, _ in choices],
            "goals": goals,
            "rollouts": len(short_seeds),
            "horizon": horizon,
            "long": long,
            "starts": list(starts),
            "seed": seed,
            "raw": raw,
            "settings": {name: value for name, value in flatten(given).items() if value != usual[name]},
        },
    )


def _notes(recordings: Sequence[Recording]) -> Iterator[str]:
    """What was found on reading joined recordings; of single windows there are too many."""
    for one in recordings:
        if len(one.files) > 1:
            yield from (f"{one.place}: {note}" for note in one.scenario.notes)


def _check(goals: str, rollouts: int, horizon: float, long: float, workers: int, starts: Sequence[float]) -> None:
    if goals not in get_args(Information):
        raise InputError(f"goals: expected {', '.join(get_args(Information))}, not {goals!r}")
    if not 1 <= rollouts <= 1000:
        raise InputError(f"rollouts: expected at least 1 and at most 1000, not {rollouts}")
    if not 3.2 <= horizon <= 60.0:
        raise InputError(f"horizon: expected at least 3.2 and at most 60 s, not {horizon}")
    if long != 0.0 and not 10.0 <= long <= 600.0:
        raise InputError(f"long: expected 0, or at least 10 and at most 600 s, not {long}")
    if workers < 1:
        raise InputError(f"workers: expected at least 1, not {workers}")
    if any(not 0.0 <= start <= 1e5 for start in starts):
        raise InputError(f"starts: expected times of at least 0 s, not {list(starts)}")


def _choices(planners: object, settings: SimulationSettings) -> tuple[tuple[str, PlannerSpec], ...]:
    found: list[tuple[str, PlannerSpec]] = []
    for one in planners if isinstance(planners, list | tuple) else [planners]:
        spec = cast("PlannerSpec", one)
        named = labels_of([spec], "planner") if isinstance(spec, str) else []
        found += [(label, label) for label in named] or [(read_planner(spec, settings.planner).planner.label, spec)]
    labels = [label for label, _ in found]
    for label, spec in found:
        read_planner(spec, settings.planner)
        if labels.count(label) > 1:
            raise InputError(f"planner {label} is given twice")
        if label in (RECORDED, CONSTANT_VELOCITY, ANALOG):
            raise InputError(f"planner {label}", "stands beside the others anyway")
    if not found:
        raise InputError("realism: no planner to measure")
    return tuple(found)


def _fitted_on(planner: PlannerSpec, settings: SimulationSettings) -> set[str]:
    """Places that its drivers were fitted on."""
    drivers = read_planner(planner, settings.planner).drivers
    return set() if drivers is None else set(drivers.fitted_on)


def _draws(planner: PlannerSpec, settings: SimulationSettings) -> bool:
    """Whether its rollouts differ by their seed."""
    return read_planner(planner, settings.planner).drivers is not None


def _planning(job: _Job, _attempt: int) -> list[int] | InterdriveError:
    """Exceptions are answers: raised in a process they would end it."""
    try:
        return rollouts.planning(job.window, job.settings)
    except InterdriveError as error:
        return error


def _measured(job: _Job, _attempt: int) -> dict[str, WindowMeasures] | InterdriveError:
    try:
        window, judged = job.window, job.judged
        road = core_road(window.scenario, job.settings.road)
        truth = rollouts.replayed(window, job.settings, job.agents)
        rows = {
            RECORDED: truth,
            CONSTANT_VELOCITY: rollouts.constant_velocity(window, judged),
        }
        if job.known is not None and len(judged):
            own = np.zeros(len(job.known.known), dtype=np.bool_)
            own[job.first : job.first + len(judged)] = True
            found = analog(window, judged, own, job.known)
            if found is not None:
                rows[ANALOG] = found
        for label, planner in job.planners:
            seeds = job.seeds if _draws(planner, job.settings) else job.seeds[:1]
            rows[label] = rollouts.simulated(window, planner, job.settings, seeds, job.agents)
        return {name: measured(window, truth, row, road) for name, row in rows.items()}
    except InterdriveError as error:
        return error


def _measured_long(job: _Job, _attempt: int) -> dict[str, LongMeasures] | InterdriveError:
    try:
        window, agents = job.window, np.array(job.agents, dtype=np.int64)
        truth = rollouts.replayed(window, job.settings, job.agents)
        measured_of = thirds(truth.tracks, agents, window.start_point)
        found = {RECORDED: LongMeasures(measured_of, truth.n_agents, truth.collisions, truth.departures)}
        for label, planner in job.planners:
            row = rollouts.simulated(window, planner, job.settings, job.seeds, job.agents)
            found[label] = LongMeasures(
                thirds(row.tracks, agents, window.start_point),
                row.n_agents,
                row.collisions,
                row.departures,
                row.not_admitted,
            )
    except InterdriveError as error:
        return error
    return found
