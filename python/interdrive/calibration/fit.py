"""The calibration: windows behind recorded leaders first, then drives in the world, then places that were held out."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from interdrive import _core
from interdrive.calibration.following import Following, followers
from interdrive.calibration.log import Log
from interdrive.calibration.result import Calibration, drivers_file
from interdrive.calibration.split import Parts, read_parts
from interdrive.calibration.stages import Stages
from interdrive.calibration.variables import population, ranges, values_at
from interdrive.calibration.verdicts import verdict
from interdrive.calibration.worlds import SHORT_WINDOWS, Worlds
from interdrive.config.plugins import Choice
from interdrive.errors import InputError
from interdrive.files import content_of_input
from interdrive.storage import replacing
from interdrive.traffic_realism import realism
from interdrive.traffic_realism.jobs import rollout_settings
from interdrive.traffic_realism.windows import windows_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from interdrive.config.drivers import Drivers
    from interdrive.config.schema import SettingsSpec, SimulationSettings
    from interdrive.run import Json
    from interdrive.traffic_realism import Realism
    from interdrive.traffic_realism.windows import Recording, Window

#: A place counts in stage A with at least so many vehicles.
_VEHICLES_MIN = 10
#: Short windows [s].
_HORIZON = 8.0
#: The population that a calibration writes, and where those are that leave a place out.
_FILE, _FOLDS, _TOML = "drivers.toml", "folds", ".toml"
#: Planners whose drivers are fitted.
_FITTED = ("idm", "idm_mobil")


@dataclass(frozen=True)
class _Asked:
    """What a calibration was asked for, besides the recordings."""

    planner: str
    stage: str
    evaluations: int
    drives: int
    long: float
    rollouts: int
    seed: int
    settings: SimulationSettings
    raw: bool
    any_traffic: bool
    licence: str
    workers: int
    on_step: Callable[[str, int, int], None] | None


def calibrate(
    files: str | Path | Sequence[str | Path],
    planner: str = "idm",
    *,
    out: str | Path,
    hold_out: Sequence[str] = (),
    split: str | Path | None = None,
    folds: Literal["place"] | None = None,
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
        out: Folder of the calibration, with drivers.toml at the end; or a file FILE.toml for the drivers, with a folder
            FILE for the rest beside it.
        hold_out: Names of places that only check the result, such as DEU_MONAMerge.
        split: TOML file with lists `fit`, `choose` and `test` of places, windows of a place in the order of time
            (DEU_MONAEast:1-20), files and folders: those to fit, those that choose among the best populations, and
            those that only check the result.
        folds: With "place", each place is also left out in turn: a population that is fitted on the others is
            measured there.
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
    if folds not in (None, "place"):
        raise InputError(f"folds: expected place, not {folds!r}")
    if folds is not None and (hold_out or split is not None):
        raise InputError("folds: every place is left out in turn; give neither hold_out nor split")
    given = rollout_settings(settings, "turns")
    sources = [files] if isinstance(files, str | os.PathLike) else list(files)
    parts = read_parts(sources, hold_out, split, raw=raw, any_traffic=any_traffic)
    asked = _Asked(
        planner, stage, evaluations, drives, long, rollouts, seed, given, raw, any_traffic, licence, workers, on_step
    )
    folder, file = _folder_and_file(Path(out))
    if folds is None:
        return _calibrated(parts, asked, folder, file)
    return _in_folds(parts, asked, folder, file)


def _folder_and_file(out: Path) -> tuple[Path, Path]:
    """Where a calibration keeps what it has tried, and where it writes the drivers."""
    return (out.with_suffix(""), out) if out.suffix == _TOML else (out, out / _FILE)


def _in_folds(parts: Parts, asked: _Asked, out: Path, file: Path) -> Calibration:
    """The calibration on all places, and one without each of them."""
    places = list(dict.fromkeys(one.place for one in parts.fit))
    fitted = [place for place, _ in _with_enough(windows_of(parts.fit, horizon=_HORIZON))]
    if len(fitted) == 1:
        which = f"place with {_VEHICLES_MIN} vehicles" if len(places) > 1 else "place"
        raise InputError(f"folds: {fitted[0]} is the only {which}; leaving it out leaves none to fit")
    whole = _calibrated(parts, asked, out, file, is_folded=True)
    found = {
        place: _calibrated(parts.without(place), asked, *_folder_and_file(out / _FOLDS / place)) for place in places
    }
    held_out: dict[str, Json] = {
        "folds": {place: str(one.verdicts[place]) for place, one in found.items()},
        "folds_energy_5": {place: one.provenance["held_out_energy_5"] for place, one in found.items()},
    }
    provenance = {**whole.provenance, **held_out}
    _write(whole.file, whole.drivers, asked.planner, provenance)
    return replace(whole, folds=found, provenance=provenance)


def _calibrated(parts: Parts, asked: _Asked, out: Path, file: Path, *, is_folded: bool = False) -> Calibration:
    windows = windows_of(parts.fit, horizon=_HORIZON)
    followings = list(_followings(windows, asked))
    if not followings:
        raise InputError(f"calibrate: no place has {_VEHICLES_MIN} vehicles that are recorded for 3.2 s after a start")
    places = tuple(following.vehicles.place for following in followings)
    what = {
        "files": dict(_digests([*parts.fit, *parts.choose, *parts.test])),
        "planner": asked.planner,
        "hold_out": sorted({one.place for one in parts.test}),
        "choose": [name for name, _ in _digests(parts.choose)],
        "test": [name for name, _ in _digests(parts.test)],
        "folds": is_folded,
        "stage": asked.stage,
        "evaluations": asked.evaluations,
        "drives": asked.drives,
        "long": asked.long,
        "seed": asked.seed,
        "settings": repr(asked.settings),
        "raw": asked.raw,
        "version": _core.__version__,
    }
    fit = Stages(Log(out, what), followings, asked.on_step)
    points, objectives = fit.short(asked.evaluations, asked.seed)
    tried, found_objectives = {"A": len(points)}, {"A": (objectives[0], min(objectives))}
    tested, costs, is_long = points, objectives, False
    if asked.stage == "B":
        worlds = _worlds(parts.fit, windows, places, asked)
        begin = fit.spread_out([points[i] for i in np.argsort(objectives, kind="stable")])
        tested, costs = fit.long(worlds, begin, asked.drives, asked.seed)
        is_long = worlds.n_long > 0
        tried["B"], found_objectives["B"] = len(tested), (costs[0], min(costs))
    best, last = tested[int(np.argmin(costs))], asked.stage
    if parts.choose:
        best, found_objectives["choice"] = fit.chosen(tested, costs, _judges(parts.choose, asked))
        last, tried["choice"] = "choice", fit.n_choice
    row = next(row for row in fit.log.rows if (row["stage"], row["z"]) == (last, best.tolist()))
    spreads = ranges(np.array(points), np.array(objectives), is_long=is_long)
    values = values_at(best)
    drivers = population("calibrated", values)
    measured = _measured(parts.test, drivers, asked)
    label = f"{asked.planner},drivers={drivers.name}"
    # Whoever chooses among populations has seen them, too.
    seen = tuple(dict.fromkeys([*places, *(one.place for one in parts.choose)]))
    verdicts = {
        place: verdict(place, measured, label, seen)
        for place in dict.fromkeys([*seen, *(one.place for one in parts.test)])
    }
    provenance: dict[str, Json] = {
        "places": list(seen),
        "held_out": sorted({one.place for one in parts.test}),
        "recordings": _by_place(parts.fit),
        **({"chosen_on": _by_place(parts.choose)} if parts.choose else {}),
        "licence": asked.licence,
        "version": _core.__version__,
        "stage": asked.stage,
        "seed": asked.seed,
        "evaluations": tried,
        "objective": {name: [round(value, 4) for value in pair] for name, pair in found_objectives.items()},
        "identifiable": {name: one.is_identified for name, one in spreads.items()},
        "held_out_energy_5": _energies(measured, label),
        "verdicts": {place: str(one) for place, one in verdicts.items()},
    }
    fit.log.write_table()
    if not is_folded:  # with folds it is written when all are known
        _write(file, drivers, asked.planner, provenance)
    return Calibration(
        values=values,
        ranges=spreads,
        planner=asked.planner,
        places=seen,
        objectives=found_objectives,
        parts=row["parts"],
        evaluations=tried,
        file=file,
        verdicts=verdicts,
        realism=measured,
        notes=tuple(dict.fromkeys(parts.notes)),
        provenance=provenance,
    )


def _write(file: Path, drivers: Drivers, planner: str, provenance: Mapping[str, Json]) -> None:
    with replacing(file) as part:
        part.write_text(drivers_file(drivers, planner, provenance), encoding="utf-8")


def _check(planner: str, stage: str, evaluations: int, drives: int, long: float, rollouts: int, workers: int) -> None:
    if planner not in _FITTED:
        raise InputError(f"planner {planner}", f"cannot be calibrated; {' and '.join(_FITTED)} can")
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


def _judges(recordings: Sequence[Recording], asked: _Asked) -> list[Following] | Worlds:
    """By whom the best populations are compared: in the world, if the last stage was there."""
    windows = windows_of(recordings, horizon=_HORIZON)
    followings = _followings(windows, asked)
    if not followings:
        raise InputError(f"calibrate: no place that chooses has {_VEHICLES_MIN} vehicles")
    if asked.stage == "A":
        return followings
    return _worlds(recordings, windows, [one.vehicles.place for one in followings], asked)


def _worlds(recordings: Sequence[Recording], windows: Sequence[Window], places: Sequence[str], asked: _Asked) -> Worlds:
    short, long = _chosen(recordings, windows, places, asked.long)
    return Worlds(asked.planner, short, long, asked.settings, seed=asked.seed, workers=asked.workers)


def _followings(windows: Sequence[Window], asked: _Asked) -> list[Following]:
    """Of each place with enough vehicles."""
    return [
        Following(followers(place, own, [window.judged for window in own], asked.settings), asked.seed)
        for place, own in _with_enough(windows)
    ]


def _with_enough(windows: Sequence[Window]) -> Iterator[tuple[str, list[Window]]]:
    """Places with enough vehicles, and their windows."""
    for place in dict.fromkeys(window.place for window in windows):
        own = [window for window in windows if window.place == place]
        if sum(len(window.judged) for window in own) >= _VEHICLES_MIN:
            yield place, own


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


def _digests(recordings: Sequence[Recording]) -> Sequence[tuple[str, str]]:
    return sorted((file.name, sha256(content_of_input(file)).hexdigest()) for one in recordings for file in one.files)


def _by_place(recordings: Sequence[Recording]) -> dict[str, str]:
    """Of each place the number of files and the hash of their hashes."""
    found = {}
    for place in dict.fromkeys(one.place for one in recordings):
        digests = [digest for _, digest in _digests([one for one in recordings if one.place == place])]
        found[place] = f"{len(digests)} files, sha256 {sha256(''.join(digests).encode()).hexdigest()}"
    return found


def _measured(held: Sequence[Recording], drivers: Drivers, asked: _Asked) -> Realism | None:
    """The population at the places that were held out; None without any."""
    if not held:
        return None
    return realism(
        [file for one in held for file in one.files],
        [Choice(asked.planner, {"drivers": drivers})],
        rollouts=asked.rollouts,
        horizon=_HORIZON,
        long=asked.long,
        seed=asked.seed,
        settings=asked.settings,
        raw=asked.raw,
        any_traffic=asked.any_traffic,
        workers=asked.workers,
        on_step=asked.on_step,
    )


def _energies(found: Realism | None, label: str) -> dict[str, float]:
    rows = [] if found is None else found.rows
    return {row.place: round(row.energy[5], 3) for row in rows if row.planner == label and math.isfinite(row.energy[5])}
