"""The folder of a search: what is searched, the log from which it goes on, and the table of its runs."""

from __future__ import annotations

import json
import shutil
from contextlib import suppress
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from interdrive.errors import InputError, ResultsError
from interdrive.failure_search.allocation import SOURCES
from interdrive.run import OUTCOMES
from interdrive.storage import Column, Origin, arrow_table, replacing, write_table
from interdrive.storage.interrupts import uninterrupted
from interdrive.storage.locks import Locks
from interdrive.storage.reading import read_json
from interdrive.storage.writing import json_text

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

_FILE, _LOG, _TABLE = "search.json", "evaluations.jsonl", "evaluations.parquet"
#: File whose lock says that a process is searching.
_CLAIM = ".claim"
#: What was found before, while it is driven again.
_BEFORE = ".before"

#: Whether a failure that is kept was made small.
SHRUNK = ("", "yes", "ended", "lost")

#: Columns of evaluations.parquet.
EVALUATION_COLUMNS = (
    Column("index", "integer", "number of the run"),
    Column("scenario", "label", "name of the scenario file"),
    Column("agent_id", "integer", "the agent under test"),
    Column("source", "label", "where its point comes from (interdrive.failure_search.SOURCES)", labels=SOURCES),
    Column("uniform", "truth", "drawn uniformly over all pairs and points, so it counts for the rate"),
    Column("draws", "integer", "points that were drawn until one was plausible; 0: the run was lost"),
    Column("point", "text", "coordinates from 0 to 1, as JSON, in the order of `coordinates` in search.json"),
    Column("disturbance", "text", "the same in words, or why the run was lost"),
    Column(
        "outcome",
        "label",
        "one of interdrive.run.OUTCOMES",
        labels=OUTCOMES,
        null="no draw was plausible, or the run was lost",
    ),
    Column("failure", "label", "kind of the failure; empty: none"),
    Column("partner_id", "integer", "with whom it collided", null="no collision with a participant"),
    Column(
        "criticality", "number", "below 0: a failure; 0 (near) or more otherwise", "1", null="no draw was plausible"
    ),
    Column("signature", "label", "scenario, agent, kind, partner and lanelets of both at a failure; empty: none"),
    Column("folder", "label", "folder of the failure; empty: none"),
    Column(
        "shrunk",
        "label",
        "whether the failure that is kept was made small: yes; ended (the search ended before, and does it when it "
        "goes on); lost (the process that did it); empty: none is kept",
        labels=SHRUNK,
    ),
    Column("witness", "label", "a driver that avoids the failure in this folder; empty: none"),
    Column("digest", "text", "SHA-256 of all states until the agent had its outcome"),
)


class SearchFolder:
    """The folder of one search, new or begun."""

    def __init__(self, path: Path, what: Mapping[str, Any], *, goes_back: bool = True) -> None:
        """Opens it.

        Args:
            path: The folder.
            what: All that decides what is found.
            goes_back: Runs are driven again from the first failure on that is still to be made small.

        Raises:
            InputError: It holds something else.
            ResultsError: It is damaged, or another process is searching there.
        """
        self.path, self._what = path, dict(what)
        self._locks: Locks | None = None
        self._log: IO[str] | None = None
        self.undisturbed: list[tuple[str, int, str]] | None = self._opened()
        self._claim()
        self.rows: list[dict[str, Any]] = []
        self._settle()
        if (path / _LOG).exists():
            self.rows = logged(path)
            self._go_back(to_unshrunk=goes_back)
            with replacing(path / _LOG) as part:  # without what a killed process left of a line
                part.write_text("".join(json_text(row) + "\n" for row in self.rows), encoding="utf-8")

    def _go_back(self, *, to_unshrunk: bool) -> None:
        """Forgets folders without a row, and the runs from the first failure on that is still to be made small.

        They are driven again, so that a search that goes on ends with the same failures, under the same numbers, as one
        that was not interrupted. Until it has come as far again, they are kept aside.
        """
        unshrunk = (place for place, row in enumerate(self.rows) if to_unshrunk and row.get("shrunk") == "ended")
        first = next(unshrunk, len(self.rows))
        if first < len(self.rows):
            with replacing(self.path / _BEFORE) as part:
                part.mkdir(exist_ok=True)
                shutil.copy2(self.path / _LOG, part / _LOG)
                shutil.copytree(self.path / "failures", part / "failures")
        del self.rows[first:]
        kept = {row["folder"] for row in self.rows}
        for folder in (self.path / "failures").glob("*"):
            if folder.is_dir() and folder.name not in kept:
                shutil.rmtree(folder)

    def _settle(self) -> bool:
        """Puts back what was found before, if the search did not come as far again; says whether it did so."""
        before = self.path / _BEFORE
        if not before.is_dir():
            return False
        is_shorter = len(logged(self.path)) < len(logged(before))
        if is_shorter:
            shutil.rmtree(self.path / "failures", ignore_errors=True)
            shutil.copytree(before / "failures", self.path / "failures")
            with replacing(self.path / _LOG) as part:
                shutil.copy2(before / _LOG, part)
        shutil.rmtree(before)
        return is_shorter

    def _opened(self) -> list[tuple[str, int, str]] | None:
        """How pairs ended undisturbed, if the folder holds the same search; None if it holds none yet."""
        path = self.path / _FILE
        if not path.exists():
            if self.path.exists() and any(one.name != _CLAIM for one in self.path.iterdir()):
                raise InputError(f"{self.path}: is no search, and not empty")
            self.path.mkdir(parents=True, exist_ok=True)
            return None
        stored = described(self.path)
        other = [name for name in self._what if stored.get(name) != self._what[name]]
        if other:
            raise InputError(f"{self.path}: holds another search ({', '.join(other)} differ); choose another --out")
        return [(str(scenario), int(agent), str(how)) for scenario, agent, how in stored["undisturbed"]]

    def _claim(self) -> None:
        try:
            self._locks = Locks(self.path / _CLAIM)
            is_free = self._locks.take(0, wait=False)
        except OSError:  # a file system without locks
            return
        if not is_free:
            raise ResultsError(f"{self.path}: another process is searching there; wait for it, or choose another --out")

    def close(self) -> None:
        """Lets other processes go on with it; a folder in which nothing was searched is removed."""
        if self._log is not None:
            self._log.close()
        if self._settle():
            self.rows = logged(self.path)
            self.write_table()
        if self._locks is not None:
            (self.path / _CLAIM).unlink(missing_ok=True)
            self._locks.close()
        if self.undisturbed is None:
            with suppress(OSError):
                self.path.rmdir()

    def describe(self, undisturbed: Sequence[tuple[str, int, str]]) -> None:
        """Writes what is searched, and how pairs (scenario, agent) ended undisturbed."""
        self.undisturbed = list(undisturbed)
        with replacing(self.path / _FILE) as part:
            part.write_text(
                json_text({**self._what, "undisturbed": self.undisturbed}, indent=2) + "\n", encoding="utf-8"
            )

    def add(self, row: dict[str, Any]) -> None:
        """Adds a run, to the log first: Ctrl-C finds it in both or in neither."""
        with uninterrupted():
            if self._log is None:
                self._log = (self.path / _LOG).open("a", encoding="utf-8")
            self._log.write(json_text(row) + "\n")
            self._log.flush()
            self.rows.append(row)

    def write_table(self) -> None:
        """Writes the runs of the log as a table."""
        values: dict[str, list[Any]] = {
            column.name: [row[column.name] for row in self.rows] for column in EVALUATION_COLUMNS
        }
        values["point"] = [json.dumps(point) for point in values["point"]]
        values["partner_id"] = [None if number < 0 else number for number in values["partner_id"]]
        with replacing(self.path / _TABLE) as part:
            write_table(arrow_table(EVALUATION_COLUMNS, values), part, Origin({"planner": self._what["planner"]}))


def is_search(folder: str | Path) -> bool:
    """The folder is one of a search."""
    return (Path(folder) / _FILE).is_file()


def described(folder: str | Path) -> dict[str, Any]:
    """What was searched, and how pairs ended undisturbed.

    Raises:
        ResultsError: The folder holds no search, or it is damaged.
    """
    path = Path(folder) / _FILE
    try:
        stored: dict[str, Any] = read_json(path)
        iter(stored["undisturbed"])
    except FileNotFoundError:
        raise ResultsError(f"{folder}: is no search: there is no {_FILE}") from None
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as cause:
        raise ResultsError(f"{path}: damaged ({cause!r})") from None
    return stored


def logged(folder: str | Path) -> list[dict[str, Any]]:
    """The runs of a search, in order, without what a killed process left of a line.

    Raises:
        ResultsError: The log is damaged.
    """
    log = Path(folder) / _LOG
    try:
        lines = log.read_text(encoding="utf-8").splitlines(keepends=True) if log.exists() else []
        rows: list[dict[str, Any]] = [json.loads(line) for line in lines if line.endswith("\n")]
        in_order = [row["index"] for row in rows] == list(range(len(rows)))
    except (OSError, ValueError, KeyError, TypeError) as cause:
        raise ResultsError(f"{log}: damaged ({cause!r})") from None
    if not in_order:
        raise ResultsError(f"{log}: damaged (runs are missing)")
    return rows
