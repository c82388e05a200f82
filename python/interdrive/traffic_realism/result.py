"""What an evaluation of realism found, as tables."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.run.reasons import said_count
from interdrive.storage import Column, arrow_table, labels
from interdrive.traffic_realism.measures import FEATURE_SETS, HORIZONS, QUANTITIES

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from interdrive.run import Json
    from interdrive.storage import ArrowTable
    from interdrive.traffic_realism.measures import WindowMeasures
    from interdrive.traffic_realism.summary import Floor, Row

_NO_ROLLOUT = "no rollout"
_NOT_DRIVEN = "the row is not simulated"


def _number(name: str, text: str, unit: str, null: str = "no vehicle") -> Column:
    return Column(name, "number", text, unit, null=null)


ROW_COLUMNS = (
    Column("planner", "label", "as it was given; or recorded, constant_velocity, analog"),
    Column("place", "label", "what the recordings show; or all"),
    Column("windows", "integer", "starts of rollouts"),
    Column("vehicles", "integer", "judged vehicles in all windows"),
    Column("is_claim", "truth", "there are at least 20 windows or 300 vehicles"),
    Column("is_fitted", "truth", "its drivers were fitted on this place, so it says nothing about realism"),
    *(
        column
        for h in HORIZONS
        for column in (
            _number(f"energy_{h}", f"energy score of positions after {h} s, mean", "m"),
            _number(f"energy_{h}_low", "lower end of its 95 % interval over windows", "m", "fewer than two windows"),
            _number(f"energy_{h}_high", "upper end of the same", "m", "fewer than two windows"),
            _number(f"distance_{h}", f"distance of the first rollout after {h} s, mean", "m"),
            _number(f"crps_{h}", f"continuous ranked probability score of speeds after {h} s, mean", "m/s"),
        )
    ),
    *(
        _number(f"auc_{name}", f"how well a classifier tells it from the recording: {text}", "1", "too few snippets")
        for name, text in zip(
            FEATURE_SETS, ("along the road and gaps", "speeds and gaps", "across the road", "all features"), strict=True
        )
    ),
    *(
        _number(f"w1_{name}", f"Wasserstein distance of the {name.replace('_', ' ')} from the recording's", unit)
        for name, unit in QUANTITIES.items()
    ),
    _number("lane_changes", "lane changes", "1/km"),
    _number("lag_gap", "median gap to whoever is behind in the new lane, at lane changes", "m", "nobody was behind"),
    Column("lag_gaps", "integer", "lane changes with a follower; below 100 they decide nothing"),
    _number("standing", "share of points at which a vehicle stands", "1"),
    _number("braked", "judged vehicles of 100 that brake harder than 4 m/s² in the first 3 s", "1", _NOT_DRIVEN),
    _number("collisions", "vehicles of 100 that hit another participant", "1", _NOT_DRIVEN),
    _number("departures", "vehicles of 100 that leave the road", "1", _NOT_DRIVEN),
    _number("not_admitted", "share of the vehicles that find no room to enter", "1", _NOT_DRIVEN),
    Column("long_vehicles", "integer", "vehicles of the long rollouts"),
    _number("long_collisions", "vehicles of 100 that hit another participant in long rollouts", "1", _NO_ROLLOUT),
    _number("long_departures", "vehicles of 100 that leave the road in long rollouts", "1", _NO_ROLLOUT),
    _number("spread", "standard deviation over vehicles of the logarithm of the time headway", "1", _NO_ROLLOUT),
    _number("persistence", "correlation of it between the first and the last third of a drive", "1", _NO_ROLLOUT),
    Column("persistence_vehicles", "integer", "vehicles of that correlation"),
)
SCORE_COLUMNS = (
    Column("planner", "label", "the row"),
    Column("place", "label", "what the recording shows"),
    Column("window", "integer", "number of the window"),
    _number("start", "of the rollouts, in the recording", "s"),
    Column("vehicle", "integer", "id of the judged vehicle"),
    Column("horizon", "integer", "after so many seconds"),
    _number("energy", "energy score of its position", "m"),
    _number("crps", "score of its speed", "m/s"),
)
DISTANCE_COLUMNS = (
    Column("planner", "label", "the row"),
    Column("place", "label", "what the recordings show; or all"),
    Column("quantity", "label", "what is compared"),
    _number("distance", "Wasserstein distance from the recording, in the unit of the quantity", "1"),
    _number("floor", "median distance between halves of the recording", "1", "fewer than two windows"),
    _number("floor_90", "90 % quantile of the same", "1", "fewer than two windows"),
)
CLASSIFIER_COLUMNS = (
    Column("planner", "label", "the row; floor: half of the recording against the other"),
    Column("place", "label", "what the recordings show; or all"),
    Column("features", "label", "lon_gap, coarse, lat or all"),
    _number("auc", "area under the curve of scores of snippets that the trees have not seen", "1", "too few snippets"),
)


@dataclass(frozen=True)
class Realism:
    """How far planners drive from recorded people.

    Attributes:
        rows: One per planner and place, with the rows beside them.
        floors: One per place.
        windows: Place, number and start [s] of each window.
        measures: By row what was measured in each window.
        files: The recordings.
        notes: What there is to know about them.
        settings: What was asked for.
    """

    rows: tuple[Row, ...]
    floors: tuple[Floor, ...]
    windows: tuple[tuple[str, int, float], ...]
    measures: Mapping[str, Sequence[WindowMeasures]] = field(repr=False)
    files: tuple[Path, ...]
    notes: tuple[str, ...]
    settings: Mapping[str, Json]

    def __repr__(self) -> str:
        planners = dict.fromkeys(row.planner for row in self.rows)
        return f"<Realism of {', '.join(planners)}: {len(self.windows)} windows>"

    @property
    def about(self) -> str:
        """What was measured, in a sentence."""
        goals, settings = str(self.settings["goals"]), self.settings
        starts, files = said_count(len(self.windows), "start"), said_count(len(self.files), "file")
        rollouts = said_count(int(str(settings["rollouts"])), "rollout")
        each = "" if len(self.windows) == 1 else " each"
        return f"{starts} in {files}, {rollouts}{each}; every planner {KNOWS[goals]} (goals: {goals})."

    @property
    def table(self) -> ArrowTable:
        """A row per planner and place."""
        return _arrow(ROW_COLUMNS, [_flat(row) for row in self.rows])

    @property
    def distances(self) -> ArrowTable:
        """Distances of distributions beside their floor."""
        floors = {floor.place: floor for floor in self.floors}
        nothing = (float("nan"), float("nan"))
        rows = []
        for row in self.rows:
            for name, distance in row.wasserstein.items():
                middle, high = floors[row.place].wasserstein.get(name, nothing)
                values = {"quantity": name, "distance": distance, "floor": middle, "floor_90": high}
                rows.append({"planner": row.planner, "place": row.place, **values})
        return _arrow(DISTANCE_COLUMNS, rows)

    @property
    def classifier(self) -> ArrowTable:
        """How well rows are told from the recording, and its halves from each other."""
        rows = [
            {"planner": name, "place": place, "features": features, "auc": value}
            for name, place, values in (
                *((row.planner, row.place, row.auc) for row in self.rows),
                *(("floor", floor.place, floor.auc) for floor in self.floors),
            )
            for features, value in values.items()
        ]
        return _arrow(CLASSIFIER_COLUMNS, rows)

    @property
    def scores(self) -> ArrowTable:
        """A row per planner, vehicle and horizon."""
        rows = [
            {
                "planner": name,
                "place": place,
                "window": index,
                "start": start,
                "vehicle": vehicle,
                "horizon": horizon,
                "energy": float(part.energy[i, k]),
                "crps": float(part.crps[i, k]),
            }
            for name, parts in self.measures.items()
            for (place, index, start), part in zip(self.windows, parts, strict=True)
            for k, vehicle in enumerate(part.judged.tolist())
            for i, horizon in enumerate(HORIZONS)
            if np.isfinite(part.energy[i, k])
        ]
        return _arrow(SCORE_COLUMNS, rows)

    def json(self) -> dict[str, Json]:
        """Rows, floors, notes and what was asked for as plain values; numbers that are not known are None."""
        return {
            **self.settings,
            "knows": KNOWS[str(self.settings["goals"])],
            "files": [str(path) for path in self.files],
            "windows": len(self.windows),
            "rows": [_plain(_nested(row)) for row in self.rows],
            "floors": [
                _plain({"place": floor.place, "wasserstein": dict(floor.wasserstein), "auc": dict(floor.auc)})
                for floor in self.floors
            ],
            "notes": list(self.notes),
        }


#: What planners know, in words, for every table about realism.
KNOWS = {
    "timed": "knows the recorded time",
    "place": "knows where the recording ends",
    "route": "knows the recorded lanelets",
    "turns": "knows the recorded turns",
}


def _flat(row: Row) -> dict[str, Any]:
    found: dict[str, Any] = {
        name: getattr(row, name)
        for name in (
            *("planner", "place", "windows", "vehicles", "is_claim", "is_fitted"),
            *("lane_changes", "lag_gap", "lag_gaps", "standing", "braked"),
            *("collisions", "departures", "not_admitted", "long_vehicles", "long_collisions", "long_departures"),
        )
    }
    for h in HORIZONS:
        found[f"energy_{h}"], (found[f"energy_{h}_low"], found[f"energy_{h}_high"]) = (
            row.energy[h],
            row.energy_interval[h],
        )
        found[f"distance_{h}"], found[f"crps_{h}"] = row.distance[h], row.crps[h]
    found |= {f"auc_{name}": value for name, value in row.auc.items()}
    found |= {f"w1_{name}": value for name, value in row.wasserstein.items()}
    found["spread"], found["persistence"] = row.persistence.spread, row.persistence.persistence
    found["persistence_vehicles"] = row.persistence.n_vehicles
    return found


def _nested(row: Row) -> dict[str, Any]:
    flat = _flat(row)
    by_horizon = {name: {str(h): flat.pop(f"{name}_{h}") for h in HORIZONS} for name in ("energy", "distance", "crps")}
    by_horizon["energy_interval"] = {
        str(h): [flat.pop(f"energy_{h}_low"), flat.pop(f"energy_{h}_high")] for h in HORIZONS
    }
    nested = {"auc": dict(row.auc), "wasserstein": dict(row.wasserstein)}
    kept = {name: value for name, value in flat.items() if not name.startswith(("auc_", "w1_"))}
    return {**kept, **by_horizon, **nested}


def _plain(value: Any) -> Any:  # noqa: ANN401 - nested values
    if isinstance(value, dict):
        return {str(key): _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value


def _arrow(columns: Sequence[Column], rows: Sequence[Mapping[str, Any]]) -> ArrowTable:
    values: dict[str, Any] = {}
    for column in columns:
        own = [row[column.name] for row in rows]
        if column.kind == "label":
            values[column.name] = labels(own)
        elif column.kind == "number":
            values[column.name] = np.array(own, dtype=np.float64)
        else:
            values[column.name] = own
    return arrow_table(columns, values)
