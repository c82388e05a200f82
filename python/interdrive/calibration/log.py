"""The folder of a calibration: what was asked for, and a line per evaluated population, so that it can go on."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from interdrive.errors import InputError, ResultsError
from interdrive.storage import replacing
from interdrive.storage.reading import read_json
from interdrive.storage.writing import json_text

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from interdrive.array_types import Floats

_FILE, _LOG = "calibration.json", "evaluations.jsonl"


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
        plain = json.loads(json_text(dict(what)))
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
