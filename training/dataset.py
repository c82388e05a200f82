"""Recorded traffic as rows of features and true positions, cached per file.

A row is a vehicle at a time step. Features, path coordinates of the true positions and the shape of the paths come from
the core, from the same code that the predictor runs, and are local to the vehicle: turning or moving a scenario changes
none of them, so there is nothing to augment in that respect.
"""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive import _core
from interdrive.config.specs import read_predictor
from interdrive.files import read_scenario
from interdrive.native_settings import CoreStepSettings, RoadSettings
from interdrive.predictors import PredictorSettings, native_predictor
from interdrive.scenario.native import core_road, core_scenario
from training.driven import behaviour_of, driven_traffic, files_to_drive
from training.split import FOLDS, place_of
from training.steady import steady_traffic

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from interdrive.scenario import Obstacles, Scenario
    from training.split import Place

    Rows = dict[str, NDArray[Any]]

#: Increased when rows are made differently.
REVISION = 1
#: Every so many seconds a scene of a recording becomes rows.
INTERVAL = 0.2
#: The same for runs of our own simulation.
DRIVEN_INTERVAL = 0.4
#: Predictors whose answers are kept beside the truth, and the modes that each has at most.
RIVALS = {"constant_velocity": 1, "lane_following": 3}
#: Largest speed of invented steady traffic [m/s], by category of the place.
_STEADY_SPEED = {"highway": 38.0, "other": 38.0, "urban": 17.0, "intersection": 17.0}
#: Points of each path that are kept, evenly spread over what can be reached.
PATH_POINTS = 64
#: What rows are: of the file itself, of steady traffic on its map, of agents on its map that our own planners drive.
MADE = ("", "steady", "driven")
KNOTS = np.asarray(_core.NEURAL["knots"])


def future_of(obstacles: Obstacles, ids: NDArray[np.int64], time_step: int, dt: float) -> NDArray[np.float64]:
    """True positions at the knots, between time steps linearly.

    Args:
        obstacles: The recording.
        ids: Vehicles, shape (n,).
        time_step: Now.
        dt: Time between steps [s].

    Returns:
        World positions [m], shape (n, knots, 2); nan where the recording has ended.
    """
    row = np.searchsorted(obstacles.ids, ids)
    at = time_step + KNOTS / dt
    before = np.floor(at + 1e-9).astype(int)
    share = np.clip(at - before, 0.0, 1.0)
    share[share < 1e-6] = 0.0
    last = obstacles.n_steps - 1
    positions = np.stack([obstacles.x, obstacles.y], axis=-1)
    known = obstacles.valid
    low, high = np.minimum(before, last), np.minimum(before + (share > 0), last)
    exists = (before + (share > 0) <= last) & known[row][:, low] & known[row][:, high]
    future = positions[row][:, low] * (1 - share)[:, None] + positions[row][:, high] * share[:, None]
    return np.where(exists[..., None], future, np.nan)


def rows_of(scenario: Scenario, interval: float = INTERVAL, only: NDArray[np.int64] | None = None) -> Rows:
    """All rows of one scenario, with what other predictors say; empty where nothing moves.

    Args:
        scenario: The recording.
        interval: Time between scenes that become rows [s].
        only: Vehicles that become rows; all otherwise.
    """
    road_settings = RoadSettings()
    road = core_road(scenario, road_settings)
    core = core_scenario(scenario, road)
    world = _core.World(core, [], CoreStepSettings(), threads=1)
    settings = PredictorSettings()
    rivals = {name: native_predictor(read_predictor(name, settings).make(), settings, core) for name in RIVALS}
    stride = max(1, round(interval / scenario.dt))
    parts = []
    for time_step in range(0, scenario.obstacles.n_steps - 1, stride):
        scene = core.scene(time_step, max(1, round(2.5 / scenario.dt)))
        inputs = _core.NeuralInputs(scene)
        future = future_of(scenario.obstacles, inputs.ids, time_step, scenario.dt)
        rows = _rows_of_scene(scenario, time_step, inputs, future)
        n_steps = round(3.0 / scenario.dt)
        at_knots = np.rint(KNOTS / scenario.dt).astype(int) - 1
        for name, n_modes in RIVALS.items():
            said = world.predict(rivals[name], scene, n_steps).of(inputs.ids)
            modes = np.full((len(inputs.ids), n_modes, len(KNOTS), 2), np.nan, np.float32)
            share = np.zeros((len(inputs.ids), n_modes), np.float32)
            share[:, : said.probability.shape[1]] = said.probability
            points = np.stack([said.x, said.y], axis=-1)[:, :, at_knots] - rows["pose"][:, None, None, :2]
            modes[:, : points.shape[1]] = points
            rows[f"{name}_xy"], rows[f"{name}_probability"] = modes, share
        keep = np.isfinite(future[:, 0, 0]) & (np.isin(inputs.ids, only) if only is not None else True)
        parts.append({name: value[keep] for name, value in rows.items()})
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]} if parts else {}


def _rows_of_scene(scenario: Scenario, time_step: int, inputs: _core.NeuralInputs, future: NDArray[np.float64]) -> Rows:
    row = np.searchsorted(scenario.obstacles.ids, inputs.ids)
    pose = np.stack(
        [getattr(scenario.obstacles, name)[row, time_step] for name in ("x", "y", "orientation")], axis=-1
    ).reshape(-1, 3)
    n, n_paths = inputs.path_valid.shape
    reach = 15.0 + 3.0 * 1.4 * np.maximum(np.asarray(inputs.velocity, np.float64), 5.0)
    s = np.linspace(0.0, 1.0, PATH_POINTS) * reach[:, None]
    s = np.ascontiguousarray(np.broadcast_to(s[:, None], (n, n_paths, PATH_POINTS)))
    shape = inputs.to_world(s, np.zeros_like(s)).copy()
    shape[..., :2] -= pose[:, None, None, :2]
    return {
        "agent": inputs.agent,
        "neighbours": inputs.neighbours,
        "paths": inputs.paths,
        "path_valid": inputs.path_valid,
        "standing": inputs.standing,
        "velocity": inputs.velocity,
        "offset": inputs.offset,
        "slope": inputs.slope,
        "settling": inputs.settling,
        "target": inputs.targets(np.ascontiguousarray(future)),
        "future": (future - pose[:, None, :2]).astype(np.float32),
        "path_shape": shape.astype(np.float32),
        "reach": reach.astype(np.float32),
        "pose": pose,
        "id": inputs.ids,
        "time_step": np.full(n, time_step),
        "dt": np.full(n, scenario.dt),
    }


def scenario_files(folders: Sequence[Path]) -> list[Path]:
    """All scenario files below the folders, sorted by name; of files with one name the first."""
    found: dict[str, Path] = {}
    for folder in folders:
        for path in sorted(folder.rglob("*.xml")):
            found.setdefault(path.stem, path)
    return [found[name] for name in sorted(found)]


def cached_rows(path: Path, cache: Path, steady_speed: float | None = None, planner: str | None = None) -> Rows:
    """Rows of a file, made once and kept in the cache; those that a planner drove, once for what it does now.

    Args:
        path: The file.
        cache: Where rows are kept.
        steady_speed: If given, of steady traffic on the file's map, at most this fast [m/s], instead of its recording.
        planner: If given, of agents that this planner drives instead.
    """
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    kind = "" if steady_speed is None else f"-steady{steady_speed:g}"
    kind += "" if planner is None else f"-{planner}-{behaviour_of(planner)}"
    kept = cache / f"{path.stem}-{digest[:12]}{kind}-{_core.NEURAL['version']}.{REVISION}.npz"
    if not kept.exists():
        scenario = read_scenario(path)
        if steady_speed is not None:
            rows = rows_of(steady_traffic(scenario, steady_speed, int(digest[:8], 16)))
        elif planner is not None:
            driven = driven_traffic(scenario, planner)
            rows = rows_of(driven[0], DRIVEN_INTERVAL, driven[1]) if driven else {}
        else:
            rows = rows_of(scenario)
        unfinished = kept.with_suffix(".part.npz")
        np.savez(unfinished, **rows)
        unfinished.rename(kept)
    with np.load(kept) as stored:
        return {name: stored[name] for name in stored.files}


def load(files: Sequence[Path], places: tuple[Place, ...], cache: Path) -> Iterator[tuple[str, Place, str, Rows]]:
    """Rows of every file that has traffic to learn from, in order of the names.

    Yields:
        Name, place, what the rows are (one of `MADE`; steady and driven traffic is made at places for training only,
        steady once per map), rows.
    """
    cache.mkdir(parents=True, exist_ok=True)
    planners = files_to_drive(files, places)
    drawn: set[str] = set()
    for path in files:
        place = place_of(path.stem, places)
        if place.part == "none":
            continue
        ways = {"": cached_rows(path, cache)}
        map_name = path.stem.split("_T-")[0].rpartition("_")[0]
        if place.part in FOLDS and map_name not in drawn:
            drawn.add(map_name)
            ways["steady"] = cached_rows(path, cache, _STEADY_SPEED.get(place.category, _STEADY_SPEED["other"]))
        if path.stem in planners:
            ways["driven"] = cached_rows(path, cache, planner=planners[path.stem])
        for made, rows in ways.items():
            if rows and len(rows["id"]):
                yield path.stem, place, made, rows


def keys_of(rows: Rows, place: str) -> list[bytes]:
    """What tells rows apart: place, pose, speed, future and (up to half a second) the known past.

    Many files show the same recording, some of them at shifted times.
    """
    known = rows["agent"][:, [i for i, entry in enumerate(_core.NEURAL["agent"]) if entry[0] == "seconds_known"]]
    parts = [rows["pose"], rows["velocity"][:, None], rows["future"].reshape(len(rows["id"]), -1), np.rint(2 * known)]
    key = np.nan_to_num(np.rint(np.concatenate(parts, axis=1) * 5), nan=-999).astype(np.int64)
    return [place.encode() + line.tobytes() for line in key]


def gather(files: Sequence[Path], places: tuple[Place, ...], cache: Path) -> Rows:
    """All rows of all files, each once, with their file and place.

    Returns:
        The arrays of `rows_of`, `file` and `place`: their names, and `made`: one of `MADE`, shape (rows,).
    """
    seen: set[bytes] = set()
    parts: list[Rows] = []
    # The fullest recording first: of two rows that agree, the one with more traffic around it is kept.
    loaded = sorted(load(files, places, cache), key=lambda entry: (-len(entry[3]["id"]), entry[0], entry[2]))
    for name, place, made, rows in loaded:
        keys = keys_of(rows, place.name)
        # A waiting vehicle has the same row again and again; only what earlier files have shown is left out.
        keep = np.array([key not in seen for key in keys], dtype=bool)
        seen.update(keys)
        part = {field: values[keep] for field, values in rows.items()}
        part["file"] = np.full(int(keep.sum()), name)
        part["place"] = np.full(int(keep.sum()), place.name)
        part["made"] = np.full(int(keep.sum()), made, dtype="U6")
        parts.append(part)
    return {field: np.concatenate([part[field] for part in parts]) for field in parts[0]}
