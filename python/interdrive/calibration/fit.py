"""The calibration: windows behind recorded leaders first, then drives in the world, then places that were held out."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from interdrive import _core
from interdrive.calibration.evolution import Evolution
from interdrive.calibration.following import Following, followers
from interdrive.calibration.log import Log
from interdrive.calibration.result import Calibration, drivers_file
from interdrive.calibration.variables import VARIABLES, population, ranges, values_at
from interdrive.calibration.verdicts import verdict
from interdrive.calibration.worlds import SHORT_WINDOWS, Worlds
from interdrive.config.drivers import WAVERING
from interdrive.config.plugins import Choice
from interdrive.errors import InputError
from interdrive.files import content_of_input
from interdrive.storage import replacing
from interdrive.traffic_realism import realism
from interdrive.traffic_realism.jobs import rollout_settings
from interdrive.traffic_realism.windows import read_recordings, windows_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from interdrive.array_types import Floats
    from interdrive.config.drivers import Drivers
    from interdrive.config.schema import SettingsSpec, SimulationSettings
    from interdrive.run import Json
    from interdrive.traffic_realism import Realism
    from interdrive.traffic_realism.windows import Recording, Window

#: Points of a generation, and the first steps of both stages in units of the variables.
_SIZE_A, _STEP_A, _SIZE_B, _STEP_B = 14, 0.7, 10, 0.35
#: The best populations of stage A begin stage B, with these spreads of the time gap, which stage A cannot tell apart.
_SPREADS = (0.15, 0.3, 0.45, 0.6, 0.2, 0.35, 0.5, 0.25)
#: Weight of the squared distance from the usual numbers.
_PRIOR_WEIGHT = 0.002
#: A place counts in stage A with at least so many vehicles.
_VEHICLES_MIN = 10
#: Short windows [s].
_HORIZON = 8.0
#: The population that a calibration writes.
_FILE = "drivers.toml"


@dataclass
class _Fit:
    """A calibration under way."""

    log: Log
    followings: Sequence[Following]
    on_step: Callable[[str, int, int], None] | None

    def short(self, evaluations: int, seed: int) -> tuple[list[Floats], list[float]]:
        """Stage A: points and their objectives, the usual population first."""
        n = len(VARIABLES)
        points, objectives = [np.zeros(n)], [self._short_objective(np.zeros(n))]
        search = Evolution(np.zeros(n), _STEP_A, _SIZE_A, seed)
        while len(points) < evaluations:
            asked = search.ask()
            own = []
            for z in asked:
                self._say("stage A: populations behind recorded leaders", len(points), evaluations)
                own.append(self._short_objective(z))
                points.append(z)
            search.tell(np.array(own))
            objectives += own
        return points, objectives

    def _short_objective(self, z: Floats) -> float:
        def parts() -> dict[str, float]:
            drivers = population("candidate", values_at(z))
            scores = [following.objective(drivers) for following in self.followings]
            return {"places": float(np.mean(scores)), "prior": _prior(z)}

        return self.log.objective("A", z, parts)

    @staticmethod
    def spread_out(best: Sequence[Floats]) -> list[Floats]:
        """Where stage B begins: the best points of stage A with different spreads of the time gap."""
        column = next(i for i, one in enumerate(VARIABLES) if one.name == "time_gap.sd")
        found = [z.copy() for z in best[: len(_SPREADS)]]
        for z, spread in zip(found, _SPREADS, strict=False):
            z[column] = VARIABLES[column].units(spread)
        return found

    def long(self, worlds: Worlds, begin: Sequence[Floats], drives: int, seed: int) -> tuple[list[Floats], list[float]]:
        """Stage B: points and their objectives; the usual population and the best ones of stage A first."""
        n = len(VARIABLES)
        points = [np.zeros(n), *begin][: max(drives, 2)]
        objectives = [self._long_objective(worlds, z, i, drives) for i, z in enumerate(points)]
        best = points[1 + int(np.argmin(objectives[1:]))]
        varied = np.array([one.in_worlds for one in VARIABLES])
        search = Evolution(best[varied], _STEP_B, _SIZE_B, seed)
        while len(points) < drives:
            own = []
            for given in search.ask():
                z = best.copy()
                z[varied] = given
                own.append(self._long_objective(worlds, z, len(points), drives))
                points.append(z)
            search.tell(np.array(own))
            objectives += own
        return points, objectives

    def _long_objective(self, worlds: Worlds, z: Floats, number: int, total: int) -> float:
        def parts() -> dict[str, float]:
            self._say("stage B: populations in the world", number, total)
            return {**worlds.parts(population("candidate", values_at(z))), "prior": _prior(z)}

        return self.log.objective("B", z, parts)

    def _say(self, what: str, done: int, total: int) -> None:
        if self.on_step is not None:
            self.on_step(what, min(done, total), total)


def calibrate(
    files: str | Path | Sequence[str | Path],
    planner: str = "idm",
    *,
    out: str | Path,
    hold_out: Sequence[str] = (),
    stage: Literal["A", "B"] = "B",
    evaluations: int = 600,
    drives: int = 60,
    long: float = 40.0,
    rollouts: int = 8,
    seed: int = 0,
    settings: SettingsSpec | None = None,
    raw: bool = False,
    any_traffic: bool = False,
    licence: str = "",
    workers: int = 1,
    on_step: Callable[[str, int, int], None] | None = None,
) -> Calibration:
    """Fits a population of drivers to recordings.

    Stage A lets vehicles follow the leaders that they have in the recording and tries many populations; stage B drives
    the best ones in the world, for seconds and for longer, so that safety and the spread of drivers count. Places that
    are held out take no part in this; the result is measured on them. Results depend on the arguments alone. An
    interrupted calibration goes on where it was when it is called with the same ones.

    Args:
        files: CommonRoad files with recorded traffic, and folders of them; windows of one recording are joined.
        planner: Whose drivers they are: idm or idm_mobil.
        out: Folder of the calibration, with drivers.toml at the end.
        hold_out: Names of places that only check the result, such as DEU_MONAMerge.
        stage: Last stage.
        evaluations: Populations of stage A.
        drives: Populations of stage B.
        long: Length of the long drives of stage B and of the check [s]; 0: none.
        rollouts: Rollouts of each start of the check.
        seed: Of all that is drawn.
        settings: Settings, or a mapping of dotted names, of the runs.
        raw: Read recordings without repairs.
        any_traffic: Take simulated and invented traffic, too.
        licence: Words about the terms of the recordings, for the file.
        workers: Processes that share the windows; results do not depend on it. With more than one, scripts need
            `if __name__ == "__main__":`.
        on_step: Called with the current activity, the amount done, and the total.

    Returns:
        The population with what there is to know about it.

    Raises:
        InputError: A file, place or number cannot be used, no vehicle is left to fit, or the folder holds something
            else.
        ResultsError: The folder is damaged or cannot be written.
    """
    _check(planner, stage, evaluations, drives, long, rollouts, workers)
    given = rollout_settings(settings, "turns")
    sources = [files] if isinstance(files, str | os.PathLike) else list(files)
    recordings, notes = read_recordings(sources, raw=raw, any_traffic=any_traffic)
    fitted, held = _split(recordings, hold_out)
    windows = windows_of(fitted, horizon=_HORIZON)
    followings = list(_followings(windows, given, seed))
    if not followings:
        raise InputError(f"calibrate: no place has {_VEHICLES_MIN} vehicles that are recorded for 3.2 s after a start")
    places = tuple(following.vehicles.place for following in followings)
    what = {
        "files": dict(_digests(recordings)),
        "planner": planner,
        "hold_out": sorted(hold_out),
        "stage": stage,
        "evaluations": evaluations,
        "drives": drives,
        "long": long,
        "seed": seed,
        "settings": repr(given),
        "raw": raw,
        "version": _core.__version__,
    }
    fit = _Fit(Log(out, what), followings, on_step)
    points, objectives = fit.short(evaluations, seed)
    tried, found_objectives = {"A": len(points)}, {"A": (objectives[0], min(objectives))}
    order = np.argsort(objectives, kind="stable")
    best, is_long = points[int(order[0])], False
    if stage == "B":
        worlds = Worlds(planner, *_chosen(fitted, windows, places, long), given, seed=seed, workers=workers)
        in_worlds, costs = fit.long(worlds, fit.spread_out([points[i] for i in order]), drives, seed)
        best, is_long = in_worlds[int(np.argmin(costs))], worlds.n_long > 0
        tried["B"], found_objectives["B"] = len(in_worlds), (costs[0], min(costs))
    row = min((row for row in fit.log.rows if row["stage"] == stage), key=lambda row: (row["objective"], row["index"]))
    spreads = ranges(np.array(points), np.array(objectives), is_long=is_long)
    values = values_at(best)
    drivers = population("calibrated", values)
    measured = _measured(held, planner, drivers, given, rollouts, long, seed, raw, any_traffic, workers, on_step)
    label = f"{planner},drivers={drivers.name}"
    verdicts = {
        place: verdict(place, measured, label, places)
        for place in dict.fromkeys([*places, *(one.place for one in held)])
    }
    provenance: dict[str, Json] = {
        "places": list(places),
        "held_out": sorted({one.place for one in held}),
        "recordings": _by_place(fitted),
        "licence": licence,
        "version": _core.__version__,
        "stage": stage,
        "seed": seed,
        "evaluations": tried,
        "objective": {name: [round(value, 4) for value in pair] for name, pair in found_objectives.items()},
        "identifiable": {name: one.is_identified for name, one in spreads.items()},
        "held_out_energy_5": _energies(measured, label),
        "verdicts": {place: str(one) for place, one in verdicts.items()},
    }
    file = Path(out) / _FILE
    with replacing(file) as part:
        part.write_text(drivers_file(drivers, planner, provenance), encoding="utf-8")
    return Calibration(
        values=values,
        ranges=spreads,
        planner=planner,
        places=places,
        objectives=found_objectives,
        parts=row["parts"],
        evaluations=tried,
        file=file,
        verdicts=verdicts,
        realism=measured,
        notes=tuple(dict.fromkeys(notes)),
        provenance=provenance,
    )


def _check(planner: str, stage: str, evaluations: int, drives: int, long: float, rollouts: int, workers: int) -> None:
    if planner not in WAVERING:
        raise InputError(f"planner {planner}", f"cannot be calibrated; {' and '.join(WAVERING)} can")
    if stage not in ("A", "B"):
        raise InputError(f"stage: expected A or B, not {stage!r}")
    for name, value, most in (("evaluations", evaluations, 100_000), ("drives", drives, 10_000)):
        if not 1 <= value <= most:
            raise InputError(f"{name}: expected at least 1 and at most {most}, not {value}")
    if not 1 <= rollouts <= 1000:
        raise InputError(f"rollouts: expected at least 1 and at most 1000, not {rollouts}")
    if long != 0.0 and not 10.0 <= long <= 600.0:
        raise InputError(f"long: expected 0, or at least 10 and at most 600 s, not {long}")
    if workers < 1:
        raise InputError(f"workers: expected at least 1, not {workers}")


def _split(recordings: Sequence[Recording], hold_out: Sequence[str]) -> tuple[list[Recording], list[Recording]]:
    """Recordings to fit, and those of places that are held out."""
    places = list(dict.fromkeys(one.place for one in recordings))
    for place in hold_out:
        if place not in places:
            raise InputError(f"hold_out: no recording of {place}; there are {', '.join(places)}")
    fitted = [one for one in recordings if one.place not in hold_out]
    if not fitted:
        raise InputError("hold_out: every place is held out, so none is left to fit")
    return fitted, [one for one in recordings if one.place in hold_out]


def _followings(windows: Sequence[Window], settings: SimulationSettings, seed: int) -> Sequence[Following]:
    """Of each place with enough vehicles."""
    found = []
    for place in dict.fromkeys(window.place for window in windows):
        own = [window for window in windows if window.place == place]
        if sum(len(window.judged) for window in own) >= _VEHICLES_MIN:
            found.append(Following(followers(place, own, [window.judged for window in own], settings), seed))
    return found


def _chosen(
    recordings: Sequence[Recording], windows: Sequence[Window], places: Sequence[str], long: float
) -> tuple[list[Window], list[Window]]:
    """Short windows of each place, spread over its recordings, and all long ones."""
    short = []
    for place in places:
        own = [window for window in windows if window.place == place]
        step = max(1.0, len(own) / SHORT_WINDOWS)
        short += [own[math.floor((i + 0.5) * step)] for i in range(min(SHORT_WINDOWS, len(own)))]
    far = windows_of(recordings, horizon=long, is_long=True) if long > 0.0 else []
    return short, [window for window in far if window.place in places]


def _prior(z: Floats) -> float:
    return _PRIOR_WEIGHT * float((z**2).sum())


def _digests(recordings: Sequence[Recording]) -> Sequence[tuple[str, str]]:
    return sorted((file.name, sha256(content_of_input(file)).hexdigest()) for one in recordings for file in one.files)


def _by_place(recordings: Sequence[Recording]) -> dict[str, str]:
    """Of each place the number of files and the hash of their hashes."""
    found = {}
    for place in dict.fromkeys(one.place for one in recordings):
        digests = [digest for _, digest in _digests([one for one in recordings if one.place == place])]
        found[place] = f"{len(digests)} files, sha256 {sha256(''.join(digests).encode()).hexdigest()}"
    return found


def _measured(
    held: Sequence[Recording],
    planner: str,
    drivers: Drivers,
    settings: SimulationSettings,
    rollouts: int,
    long: float,
    seed: int,
    raw: bool,
    any_traffic: bool,
    workers: int,
    on_step: Callable[[str, int, int], None] | None,
) -> Realism | None:
    """The population at the places that were held out; None without any."""
    if not held:
        return None
    choice = Choice(planner, {"drivers": drivers})
    return realism(
        [file for one in held for file in one.files],
        [choice],
        rollouts=rollouts,
        horizon=_HORIZON,
        long=long,
        seed=seed,
        settings=settings,
        raw=raw,
        any_traffic=any_traffic,
        workers=workers,
        on_step=on_step,
    )


def _energies(found: Realism | None, label: str) -> dict[str, float]:
    rows = [] if found is None else found.rows
    return {row.place: round(row.energy[5], 3) for row in rows if row.planner == label and math.isfinite(row.energy[5])}
