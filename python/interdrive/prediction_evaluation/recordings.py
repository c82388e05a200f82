"""Recordings replayed step by step without agents: scenes, the evaluated vehicles, and their recorded future."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from interdrive import _core
from interdrive.errors import InputError, InterdriveError
from interdrive.files import open_scenario, scenario_file
from interdrive.prediction_evaluation.measures import HORIZONS, step_of
from interdrive.scenario import KINDS, Scenario
from interdrive.scenario.native import core_road, core_scenario

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from interdrive.array_types import Bools, Floats, Ints
    from interdrive.config.schema import SimulationSettings

#: Kinds of participants that are judged, if they are not static.
JUDGED_KINDS = ("car", "truck", "bus", "motorcycle", "bicycle")
#: A vehicle stands if it is known for this time [s] and moved less than this in it [m].
STANDING_TIME, STANDING_WAY = 0.5, 0.1

#: Categories that the mean of categories is about.
CATEGORIES = ("highway", "intersection", "urban", "junction")
#: Further names that a folder may have, or a shipped scenario; everything else is "other".
_CATEGORY_OF = {name: name for name in (*CATEGORIES, "merge", "overtaking", "vulnerable")} | {
    "t_junction": "junction",
    "lane_merge": "merge",
    "signals": "intersection",
}


@dataclass(frozen=True)
class Moment:
    """A time step of a recording, and the vehicles that are judged at it.

    Attributes:
        scene: All present participants with their past.
        row: Places of the judged vehicles in `scene.ids`, shape (n,).
        known: For how long they have been recorded without a break [s].
        truth: Where they will be [m], shape (n, steps, 2) until 3 s; nan after the first gap.
        stands: Known for 0.5 s and moved less than 0.1 m in it.
        stays: The same, and moves less than 0.1 m in the 3 s to come.
    """

    scene: _core.Scene
    row: Ints
    known: Floats
    truth: Floats
    stands: Bools
    stays: Bools


class Recording:
    """A scenario whose recorded traffic is replayed without planning."""

    def __init__(self, scenario: Scenario, settings: SimulationSettings) -> None:
        """Stands at the first time step.

        Raises:
            InputError: The road cannot be used.
        """
        self.scenario, self._settings = scenario, settings
        self.road = core_road(scenario, settings.road)
        self.core_scenario = core_scenario(scenario, self.road)
        self.n_steps = step_of(HORIZONS[-1], scenario.dt) + 1
        self.restart()

    def restart(self) -> None:
        """Back to the first time step."""
        self.world = _core.World(self.core_scenario, [], replace(self._settings.step, max_steps=0), threads=1)

    def advance(self) -> None:
        """One time step."""
        self.world.advance(self.world.observe())

    def moments(self, every: int) -> Iterator[Moment]:
        """Moments at regular time steps, as long as a vehicle has a recorded future of a second."""
        obstacles = self.scenario.obstacles
        last = obstacles.n_steps - 1 - (step_of(HORIZONS[0], self.scenario.dt) + 1)
        while self.world.time_step <= last:
            if self.world.time_step % every == 0:
                moment = self._moment()
                if len(moment.row):
                    yield moment
            self.advance()

    def at(self, time_step: int) -> Moment:
        """The moment at a time step."""
        if self.world.time_step > time_step:
            self.restart()
        while self.world.time_step < time_step:
            self.advance()
        return self._moment()

    def _moment(self) -> Moment:
        scene, dt = self.world.scene(), self.scenario.dt
        obstacles = self.scenario.obstacles
        fits = np.isin(scene.kinds, [KINDS.index(kind) for kind in JUDGED_KINDS]) & ~scene.is_static
        recorded = np.searchsorted(obstacles.ids, scene.ids)
        columns = scene.time_step + 1 + np.arange(self.n_steps)
        inside = columns < obstacles.n_steps
        truth = np.full((len(recorded), self.n_steps, 2), np.nan)
        for axis, values in enumerate((obstacles.x, obstacles.y)):
            truth[:, inside, axis] = values[np.ix_(recorded, columns[inside])]
        there = np.isfinite(truth).all(axis=2)
        unbroken = np.logical_and.accumulate(there, axis=1)
        truth[~unbroken] = np.nan
        row = np.flatnonzero(fits & unbroken[:, step_of(HORIZONS[0], dt)])
        truth = truth[row]
        valid, x, y = scene.valid[row], scene.x[row], scene.y[row]
        unbroken_past = np.logical_and.accumulate(valid[:, ::-1], axis=1)
        known = (unbroken_past.sum(axis=1) - 1) * dt
        steps = int(np.ceil(STANDING_TIME / dt - 1e-9))
        recent = slice(max(0, x.shape[1] - 1 - steps), None)
        way = np.hypot(x[:, recent] - x[:, -1:], y[:, recent] - y[:, -1:])
        stands = (known > STANDING_TIME - 1e-9) & (way.max(axis=1, initial=0.0) < STANDING_WAY)
        ahead = np.hypot(truth[:, :, 0] - x[:, -1:], truth[:, :, 1] - y[:, -1:])
        stays = stands & np.isfinite(ahead).all(axis=1)
        stays[stays] = ahead[stays].max(axis=1, initial=0.0) < STANDING_WAY
        return Moment(scene, row, known, truth, stands, stays)


def category_of(path: Path) -> str:
    """Category of a file: the name of its nearest folder that is one (t_junction: junction), else "other"."""
    names = (path.stem, *(parent.name for parent in path.parents))
    return next((_CATEGORY_OF[name] for name in names if name in _CATEGORY_OF), "other")


def found_files(sources: Sequence[str | Path]) -> list[tuple[Path, bool]]:
    """Files, folders and names of shipped scenarios as files, each once, in the order given; those of a folder by name.

    Returns:
        Each file, and whether it was named itself (not found in a folder).

    Raises:
        InputError: Something is not there, or a folder has no CommonRoad file.
    """
    found: dict[Path, bool] = {}
    for source in sources:
        path = Path(source)
        if path.is_dir():
            inside = sorted(file for file in path.rglob("*") if file.suffix in (".xml", ".pb") and file.is_file())
            if not inside:
                raise InputError(f"{source}: this folder has no CommonRoad file (.xml, .pb)")
            for file in inside:
                found.setdefault(file, False)
        else:
            found[scenario_file(source)] = True
    return list(found.items())


def opened(path: Path, settings: SimulationSettings, *, is_needed: bool) -> Recording | str:
    """The recording of a file; or, unless it is needed, the line that says why it cannot be used.

    Raises:
        InputError: It is needed and cannot be used.
    """
    try:
        return Recording(open_scenario(path, raw=settings.recording.raw, start=settings.recording.start), settings)
    except InterdriveError as error:
        if is_needed:
            raise
        return str(error)
