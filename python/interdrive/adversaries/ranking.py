"""Whether adversaries rank below honest drivers: trials on the files of a set, differences to bases, verdicts."""

from __future__ import annotations

import math
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from contextlib import nullcontext
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np

from interdrive.adversaries.drivers import ADVERSARIES, HONEST
from interdrive.adversaries.trial import PREDICTOR, TRAFFIC, Drive, Place, Trial, trial
from interdrive.benchmarks.passages import PASSAGES, located
from interdrive.benchmarks.sets import read_set
from interdrive.comparison.intervals import PLACES_MIN, mean_interval, mean_of_files
from interdrive.errors import InputError
from interdrive.panel import PANEL, PanelFolder
from interdrive.results import software
from interdrive.storage import replacing, write_json

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from interdrive.adversaries.drivers import Adversary
    from interdrive.array_types import Floats

#: Honest drivers, below which every adversary must be.
HONEST_DRIVERS = (*PANEL, HONEST)

#: The adversary that solves no task but a trivial one.
_STANDING = "Stand"

#: An interval must exclude 0 if the vice acts in so many drives, and there are enough places for an interval.
_DRIVES_MIN = 10

_MARK = "adversaries.json"


@dataclass(frozen=True)
class Verdict:
    """What an adversary gains or loses.

    Attributes:
        driver: Its name. base: The honest driver from which it differs.
        score: 100 times its mean score.
        difference: To its base [points], mean of files. low: Lower end of the interval over places. high: Upper end.
        n_vice: Drives in which its vice acts.
        loss_max: As an honest control it must not lose more points than this; inf: it is no control.
        on_vice: 100 times its mean score there. least_honest: The least of any honest driver there.
        holds: It ranks as it should; None if its vice never acts.
    """

    driver: str
    base: str
    score: float
    difference: float
    low: float
    high: float
    n_vice: int
    on_vice: float
    least_honest: float
    loss_max: float
    holds: bool | None


@dataclass(frozen=True)
class Ranking:
    """The result of trials.

    Attributes:
        honest: 100 times the mean scores of honest drivers, by name.
        verdicts: One per adversary.
        n_drives: Agents that were driven. n_files: Their files. n_places: Their stretches of road.
        n_trivial: Agents that are left out: one that stands reaches their goal in time, so they tell nothing apart.
        missing: Files that were not found, and agents that cannot be driven, one line each.
        rows: All drives.
        notes: One line per thing the user should know.
    """

    honest: Mapping[str, float]
    verdicts: tuple[Verdict, ...]
    n_drives: int
    n_files: int
    n_places: int
    n_trivial: int
    missing: tuple[str, ...]
    rows: tuple[Drive, ...]
    notes: tuple[str, ...] = ()

    @property
    def judged(self) -> tuple[Verdict, ...]:
        """Those whose vice acts somewhere."""
        return tuple(one for one in self.verdicts if one.holds is not None)

    @property
    def n_below(self) -> int:
        """How many of those rank as they should."""
        return sum(bool(one.holds) for one in self.judged)


def rank_adversaries(
    *,
    set: str = "shipped-2",  # noqa: A002 - the word for it
    split: str = "dev",
    scenarios: str | Path | None = None,
    files: int | None = None,
    agents: int = 2,
    workers: int | None = None,
    out: str | Path | None = None,
    panel: str | Path | None = None,
    on_place: Callable[[int, int], None] | None = None,
) -> Ranking:
    """Drives honest drivers and adversaries in the same places, and says whether the score ranks them as it should.

    Worker processes start new interpreters: a script that calls this needs `if __name__ == "__main__":`.

    Args:
        set: Name of a benchmark set.
        split: Part of it.
        scenarios: Folder that contains its files; None: `INTERDRIVE_SCENARIOS`.
        files: At most so many files, spread over the set; None: all.
        agents: At most so many agents per file, the first ones of the set.
        workers: Processes; all cores by default.
        out: Folder for adversaries.json; None: nothing is written.
        panel: Folder of a stored panel, which is not driven again; None: what is driven is stored in `out`.
        on_place: Called after every agent with how many are done, and how many there are.

    Raises:
        InputError: An unknown set or split, none of its files was found, or a number below 1.
        ResultsError: The file cannot be written.
    """
    for name, number in (("files", files), ("agents", agents), ("workers", workers)):
        if number is not None and number < 1:
            raise InputError(name, f"must be at least 1, is {number}")
    chosen = read_set(set)
    wanted = chosen.of_split(split)
    with TemporaryDirectory() if out is None else nullcontext(Path(out).parent) as folder:
        there, found, missing = located(chosen, wanted, scenarios, Path(folder) / PASSAGES)
        if not there:
            raise InputError(
                f"set {set}: none of its {len(wanted)} files was found; give their folder with --scenarios"
            )
        if files is not None and files < len(there):
            there = [there[k] for k in np.linspace(0, len(there) - 1, files).round().astype(int).tolist()]
        places = [
            Place(found[file.sha256], file.name, file.place, number)
            for file in there
            for number in file.agents[:agents]
        ]
        stored = PanelFolder.open(panel) if panel is not None else None
        if stored is None and out is not None:
            stored = PanelFolder.create(Path(out) / "panel", PANEL, f"{set}, split {split}, {TRAFFIC}, {PREDICTOR}")
        rows: list[Drive] = []
        problems = list(missing)
        anew: list[str] = []
        for done, answer in enumerate(_trials(places, workers, stored), start=1):
            if isinstance(answer, str):
                problems.append(answer)
            else:
                rows += answer.drives
                anew += [answer.driven_anew] if answer.driven_anew else []
            if on_place is not None:
                on_place(done, len(places))
        if not rows:
            raise InputError(f"set {set}: no agent of it can be driven; {problems[0]}")
        notes = () if stored is None else stored.said_lacking(anew, len(places), "agents")
        ranking = replace(ranked(rows, problems), notes=notes)
        if out is not None:
            _save(ranking, Path(out), f"{set}, split {split}")
        return ranking


def _trials(places: Sequence[Place], workers: int | None, stored: PanelFolder | None) -> Iterable[Trial | str]:
    """Answers in the order of the places, however many processes work."""
    tried = partial(trial, stored=stored)
    if workers == 1 or len(places) == 1:
        yield from map(tried, places)
        return
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        yield from pool.map(tried, places)


def ranked(rows: Sequence[Drive], missing: Sequence[str]) -> Ranking:
    """Verdicts from all drives."""
    by_driver: dict[str, dict[tuple[str, int], Drive]] = {}
    for row in rows:
        by_driver.setdefault(row.driver, {})[row.file, row.agent_id] = row
    every = sorted(by_driver[HONEST])
    keys = [key for key in every if not by_driver[_STANDING][key].in_time]
    if not keys:
        raise InputError(
            "adversaries", f"one that stands solves all {len(every)} tasks in time: there is nothing to tell apart"
        )
    roads = {file: by_driver[HONEST][file, number].road for file, number in keys}
    scores = {name: np.array([found[key].score for key in keys]) for name, found in by_driver.items()}
    files = [file for file, _ in keys]
    honest = {name: 100.0 * mean_of_files(scores[name], files)[0] for name in HONEST_DRIVERS}
    verdicts = []
    for adversary in ADVERSARIES:
        acts = np.array([by_driver[adversary.name][key].acts for key in keys])
        verdicts.append(_verdict(adversary, keys, scores, acts, honest, roads))
    return Ranking(
        honest=honest,
        verdicts=tuple(verdicts),
        n_drives=len(keys),
        n_files=len(roads),
        n_places=len({*roads.values()}),
        n_trivial=len(every) - len(keys),
        missing=tuple(missing),
        rows=tuple(rows),
    )


def _verdict(
    adversary: Adversary,
    keys: Sequence[tuple[str, int]],
    scores: Mapping[str, Floats],
    acts: np.ndarray[tuple[int], np.dtype[np.bool_]],
    honest: Mapping[str, float],
    roads: Mapping[str, str],
) -> Verdict:
    own = scores[adversary.name]
    driven = [file for file, _ in keys]
    score = 100.0 * mean_of_files(own, driven)[0]
    difference, means, files = mean_of_files(own - scores[adversary.base], driven)
    places = [roads[file] for file in files]
    low, high = mean_interval(100.0 * means, places)
    n_vice = int(acts.sum())
    on_vice = 100.0 * float(own[acts].mean()) if n_vice else math.nan
    least = min(100.0 * float(scores[name][acts].mean()) for name in honest) if n_vice else math.nan
    holds: bool | None
    if adversary.is_control:
        holds = -100.0 * difference <= adversary.loss_max
    elif not n_vice:
        holds = None
    else:
        is_clear = high < 0.0 or n_vice < _DRIVES_MIN or len({*places}) < PLACES_MIN
        holds = difference < 0.0 and is_clear and on_vice < least
        holds = holds and (not adversary.is_crude or score < min(honest.values()))
    return Verdict(
        driver=adversary.name,
        base=adversary.base,
        score=score,
        difference=100.0 * difference,
        low=low,
        high=high,
        n_vice=n_vice,
        on_vice=on_vice,
        least_honest=least,
        loss_max=adversary.loss_max,
        holds=holds,
    )


def _save(found: Ranking, folder: Path, what: str) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    content = {
        "set": what,
        "n_drives": found.n_drives,
        "n_files": found.n_files,
        "n_places": found.n_places,
        "n_trivial": found.n_trivial,
        "missing": list(found.missing),
        "notes": list(found.notes),
        "honest": dict(found.honest),
        "adversaries": [_plain(asdict(one)) for one in found.verdicts],
        "drives": [asdict(row) for row in found.rows],
        **software(),
    }
    with replacing(folder / _MARK) as partial:
        write_json(content, partial)


def _plain(values: dict[str, object]) -> dict[str, object]:
    """Values as JSON has them: what is no finite number is null."""
    return {
        key: None if isinstance(value, float) and not math.isfinite(value) else value for key, value in values.items()
    }
