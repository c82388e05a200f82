"""What a process does for a search: drives a world, or makes a failure small and writes its folder.

Folders travel as archives, so that the search that drives elsewhere, on other machines too, has them in its own.
"""

from __future__ import annotations

import io
import json
import tempfile
import time
import zipfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from interdrive import _core
from interdrive.errors import InterdriveError
from interdrive.failure_search.disturbed_worlds import disturbed
from interdrive.failure_search.evaluation import avoided_by, judged, witness
from interdrive.failure_search.failures import Failure, begin, finish
from interdrive.failure_search.pairs import scenario_at
from interdrive.failure_search.shrinking import shrunk
from interdrive.failure_search.spaces import CHOICES, undisturbed
from interdrive.failure_search.trials import Driven, change_at, drive_at, driven, judged_in, signature, world_at
from interdrive.storage import replacing

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interdrive.array_types import Floats
    from interdrive.failure_search.trials import Trial


@dataclass(frozen=True)
class Kept:
    """A failure as it is to be kept.

    Attributes:
        failure: The failure, in a folder that is gone.
        archive: That folder.
    """

    failure: Failure
    archive: bytes

    def unpack(self, folder: Path) -> None:
        """Writes the folder of the failure; it appears whole or not at all."""
        folder.parent.mkdir(parents=True, exist_ok=True)
        with replacing(folder) as part:
            with zipfile.ZipFile(io.BytesIO(self.archive)) as packed:
                packed.extractall(part)
            was, now = (json.dumps(str(path))[1:-1] for path in (self.failure.folder, folder.resolve()))
            for about in part.glob("*/run.json"):  # which names the file that was driven
                about.write_text(about.read_text(encoding="utf-8").replace(was, now), encoding="utf-8")


def work(numbered: tuple[int, Trial], _attempts: int) -> Driven | Kept | InterdriveError | None:
    """Does a trial: drives, or keeps a failure (None: the file of its world does not fail).

    Errors of the input are its result, since an exception would end the process.
    """
    _, trial = numbered
    try:
        return driven(trial) if trial.failing is None else _kept(trial)
    except InterdriveError as error:
        return error


def _kept(trial: Trial) -> Kept | None:
    setup, pair = trial.setup, trial.pair
    point, is_small = _smallest(trial)
    change = change_at(setup, pair, point)
    with tempfile.TemporaryDirectory(prefix="interdrive-failure-") as made:
        folder = Path(made).resolve() / "failure"
        scenario = begin(folder, disturbed(scenario_at(pair.path), change))
        way = drive_at(setup, pair, change, scenario)
        run = way.run(scenario)
        verdict = judged(run, pair.agent_id)
        if not verdict.failure:
            return None
        avoided_by, avoided = witness(scenario, way)
        words = verdict.words, change.words(), avoided_by, verdict.digest, trial.signature, _core.__version__
        failure = Failure(folder, way, verdict.failure, *words, pair.scenario, is_small)
        finish(failure, run, avoided)
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w") as archive:
            for path in sorted(folder.rglob("*")):
                archive.write(path, path.relative_to(folder))
    return Kept(failure, packed.getvalue())


class _TimeIsOverError(Exception):
    """No more time to make a failure small."""


def _smallest(trial: Trial) -> tuple[Floats, bool]:
    """The smallest disturbance under which the agent fails in the same way, avoided by whoever avoids the first one.

    Returns:
        The point, and whether there was the time to find it; otherwise it is the smallest one until then.
    """
    setup, pair = trial.setup, trial.pair
    first = np.array(trial.failing)
    if time.time() >= trial.until:
        return first, False
    world = world_at(setup, pair, first)
    avoiding = "" if world is None else avoided_by(*world)
    # Points that mean the same disturbance are driven once: without an error, for instance, its time means nothing.
    known = {repr(change_at(setup, pair, first)): True}
    smallest = first

    def still_fails(point: Floats) -> bool:
        nonlocal smallest
        meaning = repr(change_at(setup, pair, point))
        if meaning not in known:
            if time.time() >= trial.until:
                raise _TimeIsOverError
            known[meaning] = fails(point)
        if known[meaning]:
            smallest = point.copy()
        return known[meaning]

    def fails(point: Sequence[float] | Floats) -> bool:
        world = world_at(setup, pair, point)
        if world is None:
            return False
        found = judged_in(*world)
        if found is None or signature(pair, found) != trial.signature:
            return False
        return not avoiding or bool(avoided_by(*world, (avoiding,)))

    choices = [name in CHOICES for name in setup.space.coordinates]
    try:
        return shrunk(first, undisturbed(setup.space), still_fails, choices), True
    except _TimeIsOverError:
        return smallest, False


def unshrunk(trial: Trial) -> Trial:
    """The same failure, to be kept as it is."""
    return replace(trial, until=0.0)
