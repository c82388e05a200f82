"""The folder of a calibration: what was asked for, a line per evaluated population, from which it goes on, a table."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.calibration.variables import VARIABLES, values_at
from interdrive.errors import InputError, ResultsError
from interdrive.storage import Column, Origin, arrow_table, labels, replacing, write_table
from interdrive.storage.reading import read_json
from interdrive.storage.writing import json_text

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from interdrive.array_types import Floats

_FILE, _LOG, _TABLE = "calibration.json", "evaluations.jsonl", "evaluations.parquet"

#: What an objective consists of.
PARTS = {
    "places": "behind recorded leaders: all that stage A counts",
    "scores": "errors of positions and speeds over those of constant velocity",
    "acceleration": "distance of the distribution of accelerations over the recorded spread",
    "headway": "the same of headways",
    "jerk": "the same of jerks",
    "collisions": "vehicles that collide in long drives",
    "persistence": "difference from the recorded persistence of headways",
    "spread": "difference from the recorded spread of headways",
    "prior": "distance from the usual numbers",
}
#: Columns of evaluations.parquet.
EVALUATION_COLUMNS = (
    Column("index", "integer", "number of the evaluation"),
    Column("stage", "label", "A, B, or choice: of the best populations on other recordings"),
    Column("objective", "number", "sum of what it consists of; less is better", "1"),
    *(Column(f"part_{name}", "number", text, "1", null="does not count there") for name, text in PARTS.items()),
    *(Column(one.name, "number", "number of the population", one.unit) for one in VARIABLES),
)


class Log:
    """Evaluations in their order; those that are there already are not done again."""

    def __init__(self, folder: str | Path, what: Mapping[str, Any]) -> None:
        """Opens a new folder, or one with the same calibration.

        Args:
            folder: New, empty, or with an interrupted calibration.
            what: All that decides what is found.

        Raises:
            InputError: It holds something else.
            ResultsError: It is damaged or cannot be written.
        """
        self.folder, self._path, self._next = Path(folder), Path(folder) / _LOG, 0
        self._what = plain = json.loads(json_text(dict(what)))
        try:
            self._open(plain)
        except OSError as cause:
            raise ResultsError(f"{folder}: cannot be written ({cause.strerror or cause})") from None
        self.rows = self._read()

    def _open(self, what: dict[str, Any]) -> None:
        path = self.folder / _FILE
        if path.exists():
            try:
                stored = read_json(path)
                other = [name for name in what if stored.get(name) != what[name]]
            except (OSError, ValueError, AttributeError) as cause:
                raise ResultsError(f"{path}: damaged ({cause!r})") from None
            if other:
                raise InputError(
                    f"{self.folder}: holds another calibration ({', '.join(other)} differ); choose another folder"
                )
            return
        if self.folder.exists() and (not self.folder.is_dir() or any(self.folder.iterdir())):
            raise InputError(f"{self.folder}: is no calibration, and not empty")
        self.folder.mkdir(parents=True, exist_ok=True)
        with replacing(path) as part:
            part.write_text(json_text(what, indent=2) + "\n", encoding="utf-8")

    def _read(self) -> list[dict[str, Any]]:
        """Evaluations, without what a killed process left of a line."""
        if not self._path.exists():
            return []
        lines = self._path.read_text(encoding="utf-8", errors="replace").splitlines(keepends=True)
        whole = [line for line in lines if line.endswith("\n")]
        try:
            rows: list[dict[str, Any]] = [json.loads(line) for line in whole]
            in_order = [row["index"] for row in rows] == list(range(len(rows)))
        except (ValueError, KeyError, TypeError) as cause:
            raise ResultsError(f"{self._path}: damaged ({cause!r})") from None
        if not in_order:
            raise ResultsError(f"{self._path}: damaged (evaluations are missing)")
        if len(whole) < len(lines):
            with replacing(self._path) as part:
                part.write_text("".join(whole), encoding="utf-8")
        return rows

    def write_table(self) -> None:
        """Writes evaluations.parquet: what the log has, with the numbers of each population."""
        values = [values_at(np.array(row["z"])) for row in self.rows]
        columns: dict[str, Any] = {
            "index": [row["index"] for row in self.rows],
            "stage": labels([row["stage"] for row in self.rows]),
            "objective": np.array([row["objective"] for row in self.rows]),
            **{f"part_{name}": np.array([row["parts"].get(name, math.nan) for row in self.rows]) for name in PARTS},
            **{one.name: np.array([own[one.name] for own in values]) for one in VARIABLES},
        }
        origin = Origin({"calibration": self._what}, {})
        with replacing(self.folder / _TABLE) as part:
            write_table(arrow_table(EVALUATION_COLUMNS, columns), part, origin)

    def objective(self, stage: str, z: Floats, parts: Callable[[], Mapping[str, float]]) -> float:
        """The sum of what a point costs, from the log if it is the next one there.

        Raises:
            ResultsError: The log has another point there: it is of another machine or version.
        """
        index, point = self._next, z.tolist()
        self._next += 1
        if index < len(self.rows):
            row = self.rows[index]
            if (row.get("stage"), row.get("z")) != (stage, point):
                raise ResultsError(f"{self._path}: evaluation {index} is another one; choose another folder")
            return float(row["objective"])
        found = dict(parts())
        row = {"index": index, "stage": stage, "z": point, "parts": found, "objective": sum(found.values())}
        with self._path.open("a", encoding="utf-8") as log:
            log.write(json_text(row) + "\n")
        self.rows.append(row)
        return float(row["objective"])
