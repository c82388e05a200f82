"""Whether the other vehicles of failures drive as recorded ones do, by a classifier that tells both kinds apart.

The classifier is that of `interdrive realism`. It learns from the recordings, and from the same files driven by the
traffic of the search without any disturbance. Then it is asked about the other vehicles of failures, by trees that have
seen nothing of their files. A vehicle looks recorded if it is scored no higher than 99 of 100 recorded ones.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from interdrive.errors import InputError, ResultsError
from interdrive.failure_search.disturbances import erring_in
from interdrive.failure_search.evaluation import Drivers, drive_of
from interdrive.failure_search.failures import failures
from interdrive.failure_search.pairs import scenario_at
from interdrive.failure_search.search_folder import described
from interdrive.failure_search.spaces import RECORDED
from interdrive.native_settings import RoadSettings
from interdrive.runs import load
from interdrive.scenario.inspection import candidates
from interdrive.scenario.native import core_road, core_shape
from interdrive.storage import replacing
from interdrive.storage.reading import read_json
from interdrive.storage.writing import json_text
from interdrive.traffic_realism.estimators import auc
from interdrive.traffic_realism.measures import snippets_of
from interdrive.traffic_realism.tracks import GRID, Kinematics, Tracks, kinematics
from interdrive.traffic_realism.trees import unseen_scores

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from interdrive import _core
    from interdrive.array_types import Floats, Ints
    from interdrive.run import States
    from interdrive.scenario import Scenario

_FILE = "likeness.json"
#: Time between two starts of snippets [s].
_EVERY = 4.0
#: Vehicles look recorded up to this quantile of the scores of recorded ones.
_QUANTILE = 0.99
#: With fewer recorded snippets nothing is learnt.
_SNIPPETS_MIN = 100


@dataclass(frozen=True)
class Likeness:
    """How alike the other vehicles of failures and recorded ones are.

    Attributes:
        vehicles: Other vehicles of failures that were scored, without those that err.
        alike: Of these, those that look recorded.
        driven: Share of the vehicles that the traffic drives without any disturbance that look recorded.
        auc: Area under the curve of the classifier, recorded beside driven without disturbance: 0.5 it cannot tell.
        recorded: Recorded snippets.
        simulated: Snippets of the same files, driven by the traffic.
        files: Files that they are from.
    """

    vehicles: int
    alike: int
    driven: float
    auc: float
    recorded: int
    simulated: int
    files: int

    @property
    def share(self) -> float:
        """Share of the other vehicles that look recorded; nan without any."""
        return self.alike / self.vehicles if self.vehicles else math.nan


@dataclass(frozen=True)
class Sample:
    """Snippets of vehicles: features, shape (snippets, 18), and the vehicle of each."""

    features: Floats
    vehicle: Ints

    @classmethod
    def of(cls, tracks: Tracks, ids: Sequence[int], road: _core.RoadNetwork) -> Sample:
        """The snippets of some vehicles, from every 4 s on."""
        own = np.array(sorted(ids), dtype=np.int64)
        found = kinematics(tracks, own, road)
        features, vehicles = [np.empty((0, 18))], [own[:0]]
        for start in range(0, tracks.x.shape[1], round(_EVERY / GRID)):
            values, is_whole = snippets_of(_from(found, start))
            features.append(values[is_whole])
            vehicles.append(np.tile(own, len(values) // max(len(own), 1))[is_whole])
        return cls(np.concatenate(features), np.concatenate(vehicles))


def measure(folder: str | Path, paths: Sequence[str | Path]) -> Likeness:
    """Asks the classifier about the failures of a search, and writes the answer into its folder.

    Args:
        folder: Of the search.
        paths: The files that were searched.

    Raises:
        InputError: The traffic replays its recordings, or there are too few files or vehicles to learn from.
        ResultsError: The folder holds no search, or it is damaged.
    """
    about = described(folder)
    if about["traffic"] == RECORDED:
        raise InputError("the traffic of this search replays its recordings; there is nothing to tell apart")
    drivers = Drivers(about["traffic"], about["traffic"], about["predictor"], tuple(about["settings"].items()))
    recorded: list[Sample] = []
    driven: list[Sample] = []
    groups: dict[str, int] = {}
    for scenario in _read(paths):
        groups[scenario.name] = len(groups)
        for sample, one in zip((recorded, driven), _both(scenario, drivers), strict=True):
            sample.append(one)
    asked, asked_groups = [], []
    for failure in failures(folder):
        if failure.scenario not in groups:
            raise InputError(f"{failure.scenario}: name its file, too; failure {failure} is of it")
        run = load(failure.folder / "run")
        others = {*failure.drive.others} - {erring_in(failure.disturbance)}
        road = core_road(run.scenario, RoadSettings())
        asked.append(Sample.of(_tracks(run.states, run.scenario.dt), sorted(others), road))
        asked_groups.append(groups[failure.scenario])
    found = likeness_of(recorded, driven, asked, asked_groups)
    with replacing(Path(folder) / _FILE) as part:
        part.write_text(json_text(asdict(found), indent=2) + "\n", encoding="utf-8")
    return found


def likeness_in(folder: str | Path) -> Likeness | None:
    """What was written into the folder of a search; None: nothing was.

    Raises:
        ResultsError: It is damaged.
    """
    path = Path(folder) / _FILE
    try:
        return Likeness(**read_json(path)) if path.exists() else None
    except (OSError, ValueError, TypeError) as cause:
        raise ResultsError(f"{path}: damaged ({cause!r})") from None


def likeness_of(
    recorded: Sequence[Sample], driven: Sequence[Sample], asked: Sequence[Sample], asked_groups: Sequence[int]
) -> Likeness:
    """What the classifier says of samples; recorded and driven ones are given file by file."""
    samples = [*recorded, *driven]
    groups = np.repeat(np.tile(np.arange(len(recorded)), 2), [len(one.features) for one in samples])
    features = np.concatenate([np.empty((0, 18)), *(one.features for one in samples)])
    n_recorded = sum(len(one.features) for one in recorded)
    is_simulated = np.arange(len(features)) >= n_recorded
    if n_recorded < _SNIPPETS_MIN or len(np.unique(groups)) < 2:
        raise InputError(
            f"{n_recorded} recorded snippets of {len(np.unique(groups))} files are too few to learn from: "
            f"{_SNIPPETS_MIN} of two files are needed"
        )
    others = np.concatenate([np.empty((0, 18)), *(one.features for one in asked)])
    other_groups = np.repeat(np.array(asked_groups, dtype=np.int64), [len(one.features) for one in asked])
    scores, found, _ = unseen_scores(features, is_simulated, groups, others, other_groups)
    limit = float(np.quantile(scores[~is_simulated], _QUANTILE))
    means = [np.empty(0)]
    for one, own in zip(asked, np.split(found, np.cumsum([len(one.features) for one in asked])[:-1]), strict=True):
        _, place = np.unique(one.vehicle, return_inverse=True)
        means.append(np.bincount(place, own) / np.bincount(place))
    vehicles = np.concatenate(means)
    return Likeness(
        len(vehicles),
        int((vehicles <= limit).sum()),
        float((scores[is_simulated] <= limit).mean()) if is_simulated.any() else math.nan,
        float(auc(scores, is_simulated)),
        n_recorded,
        int(is_simulated.sum()),
        len(recorded),
    )


def _read(paths: Sequence[str | Path]) -> Iterator[Scenario]:
    """The scenarios of files whose time step divides that of the grid, each once."""
    seen = set()
    for path in paths:
        try:
            scenario = scenario_at(str(path))
        except InputError:
            continue
        stride = GRID / scenario.dt
        if scenario.sha256 not in seen and abs(stride - round(stride)) < 1e-6:
            seen.add(scenario.sha256)
            yield scenario


def _both(scenario: Scenario, drivers: Drivers) -> tuple[Sample, Sample]:
    """Snippets of a recording, and of the same vehicles driven by the traffic of a search."""
    obstacles, able = scenario.obstacles, candidates(scenario)
    ids = able.ids[able.accepted].tolist()
    road = core_road(scenario, RoadSettings())
    extent = np.array([core_shape(shape).extent for shape in obstacles.shapes]).reshape(-1, 2)
    tables = (obstacles.x, obstacles.y, obstacles.orientation, obstacles.velocity)
    stride = round(GRID / scenario.dt)
    as_recorded = Tracks(obstacles.ids, extent[:, 0], extent[:, 1], *(table[:, ::stride] for table in tables))
    recorded = Sample.of(as_recorded, ids, road)
    if not ids:
        return recorded, recorded
    try:
        run = drive_of(scenario, ids[0], drivers).run(scenario)
    except InputError:
        return recorded, Sample(recorded.features[:0], recorded.vehicle[:0])
    return recorded, Sample.of(_tracks(run.states, scenario.dt), ids, road)


def _tracks(states: States, dt: float) -> Tracks:
    """The participants of a run on the grid."""
    tables = (states.x, states.y, states.orientation, states.velocity)
    stride = round(GRID / dt)
    return Tracks(states.participant_id, states.length, states.width, *(table[:, ::stride] for table in tables))


def _from(found: Kinematics, start: int) -> Kinematics:
    """The same from a point on."""
    return Kinematics(**{name: getattr(found, name)[:, start:] for name in found.__dataclass_fields__})
