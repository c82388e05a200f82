"""The folder of a batch. Everything in it appears whole or not at all, and several batches may write to it at once.

    batch.json          what the folder is
    results.parquet     all runs that were merged
    runs/<key>.parquet  runs that are not merged yet
    recordings/<key>/   run folders that are kept
    panel/              drives of the panel against which agents are scored
    .locks              which runs are being done; nothing is stored in it
    .stored             a line per run that was stored, for batches that are at work at the same time

A run is claimed by locking the byte of `.locks` that its key says, see `interdrive.storage.locks`. The system gives the
lock back when the process ends, however it ends. Only a batch that has claimed a run stores it, or removes its file.
"""

from __future__ import annotations

import io
import os
import shutil
import tarfile
import time
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from interdrive import _core
from interdrive.batches.columns import NOT_ARRIVED
from interdrive.batches.dataset import check_key, in_order, in_portions, joined, merge, n_keys, read, read_run
from interdrive.batches.plan import FORMAT, FORMER
from interdrive.errors import ResultsError
from interdrive.storage import (
    FolderKind,
    check_folder,
    check_tables,
    not_a_link,
    one_line,
    read_json,
    replacing,
    resolved,
    write_json,
)
from interdrive.storage.locks import Locks

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from interdrive.batches.job import Finished
    from interdrive.storage import ArrowTable

_MARK, _RESULTS, _RUNS, _RECORDINGS = "batch.json", "results.parquet", "runs", "recordings"
_LOCKS, _STORED = ".locks", ".stored"

#: A folder with anything in it is no new batch.
_FOLDER = FolderKind("batch", _MARK, lambda _: False)

#: Files of single runs are merged when there are this many, and this share of what is merged already.
_MERGE_AT, _MERGE_SHARE = 64, 0.25

#: Age after which a half-written file will not be finished [s].
_LEFTOVER_AGE = 3600.0

#: Where in the lock file the byte for merging is; run keys have the bytes behind it.
_MERGE_BYTE = 0


@dataclass(frozen=True)
class Done:
    """What is known of a run that was done.

    Attributes:
        status: One of `interdrive.batches.columns.STATUS`.
        kept: Its run folder is there.
        arrived: All agents under test did.
    """

    status: str
    kept: bool
    arrived: bool


class BatchFolder:
    """Results of a batch on disk."""

    def __init__(self, path: Path) -> None:
        """Use `BatchFolder.create` or `BatchFolder.open`."""
        self.path = path
        self._locks: Locks | None = None
        #: Runs that are merged, and that are not, roughly; None: not counted yet.
        self._merged: int | None = None
        self._unmerged: int | None = None
        #: What was stored since it was asked what is done; how far the list of it was read [bytes].
        self._stored_since: dict[str, Done] = {}
        self._looked_at = 0

    @classmethod
    def create(cls, path: str | Path) -> BatchFolder:
        """The folder, made if it is new.

        Raises:
            ResultsError: Something else is there, a symbolic link among it, or it cannot be written.
        """
        target = not_a_link(path)
        check_tables()
        # Another batch may be making the same folder at this moment, also while it is looked at.
        for is_last in (False, True):
            inside = {entry.name for entry in target.iterdir()} if target.is_dir() else set()
            if _MARK in inside:
                return cls.open(path, writes=True)
            if target.is_dir() and all(name.startswith(f".{_MARK}.") for name in inside):
                break
            try:
                check_folder(path, _FOLDER)
                break
            except ResultsError:
                if is_last:
                    raise
        with replacing(target / _MARK) as partial:
            write_json({"format": FORMAT, "interdrive": _core.__version__}, partial)
        return cls(target)

    @classmethod
    def open(cls, path: str | Path, *, writes: bool = False) -> BatchFolder:
        """A folder that is there; one of the format before only if nothing is written to it.

        Raises:
            ResultsError: It is no batch, or one of another version of the schema.
        """
        target = resolved(path)
        try:
            info = read_json(target / _MARK)
        except (FileNotFoundError, NotADirectoryError):
            raise ResultsError(f"{path}: this is not a batch folder, it has no {_MARK}") from None
        except (OSError, ValueError) as cause:
            raise ResultsError(f"{target / _MARK}: cannot be read: {one_line(cause)}") from cause
        # Nothing is ever written through a link to somewhere else.
        for entry in _entries(target):
            if entry.is_symlink():
                raise ResultsError(f"{entry.path}: this is a symbolic link; put what it links to into the batch folder")
        found = info.get("format") if isinstance(info, dict) else None
        if type(found) is not int or found not in ((FORMAT,) if writes else (FORMAT, FORMER)):
            shown = found if isinstance(found, int) else "unknown"
            raise ResultsError(
                f"{path}: a batch of format {shown}, this version of interdrive writes format {FORMAT} and reads "
                f"{FORMER}; choose a new folder"
            )
        return cls(target)

    @property
    def results(self) -> Path:
        """The data set; runs that are not merged yet lie beside it."""
        return self.path / _RESULTS

    def recording(self, key: str) -> Path:
        """Where the run folder of a run is, if it is kept."""
        return self.path / _RECORDINGS / key

    def unmerged(self) -> list[Path]:
        """Files of single runs that are not merged yet."""
        found = sorted((self.path / _RUNS).glob("[!.]*.parquet"))
        for part in found:
            check_key(part.stem, part)
        return found

    def table(self, columns: Sequence[str] | None = None, keys: set[str] | None = None) -> ArrowTable:
        """All rows, or some columns of them, or those of some runs; sorted by scenario, run and agent.

        Raises:
            ResultsError: A file that is damaged or has other columns.
        """
        order = ("scenario", "planner", "predictor", "traffic", "agents", "seed", "key", "agent_id")
        found = in_order(self._rows(None if columns is None else list(dict.fromkeys([*columns, *order])), keys), order)
        return found if columns is None else found.select(list(columns))

    def fresh(self, columns: Sequence[str] | None = None, keys: set[str] | None = None) -> tuple[ArrowTable, set[str]]:
        """Rows (or some columns of them, or those of some runs) that were not merged a moment ago, and whose they are.

        If you read what is merged after that, you miss nothing, and have to leave out these keys.
        """
        while True:
            parts = self.unmerged()
            wanted = parts if keys is None else [part for part in parts if part.stem in keys]
            try:
                return joined([read_run(part, columns) for part in wanted], columns), {part.stem for part in parts}
            except FileNotFoundError:
                continue  # another process has just merged them

    def _rows(self, columns: Sequence[str] | None, keys: set[str] | None = None) -> ArrowTable:
        fresh, others = self.fresh(columns, keys)
        merged = [read(self.results, columns, keys, but=others)] if self.results.exists() else []
        return joined([*merged, fresh], columns)

    def done(self) -> dict[str, Done]:
        """What was done already, by key."""
        self._stored_since.clear()
        with suppress(FileNotFoundError):
            self._looked_at = (self.path / _STORED).stat().st_size
        found: dict[str, Done] = {}
        for portion in in_portions(self._rows(["key", "status", "kept", "outcome", "under_test"])):
            for row in zip(*(portion[name].to_pylist() for name in portion.column_names), strict=True):
                key, status, kept, outcome, under_test = row
                arrived = not (under_test and outcome in NOT_ARRIVED) and (key not in found or found[key].arrived)
                found[key] = Done(status, kept and self.recording(key).is_dir(), arrived)
        return found

    def stored_since(self, key: str) -> Done | None:
        """The state of a run that another batch has stored since `done` was called."""
        with suppress(FileNotFoundError), (self.path / _STORED).open("rb") as file:
            file.seek(self._looked_at)
            for line in file:
                if not line.endswith(b"\n"):
                    break  # it is being written
                self._looked_at += len(line)
                fields = line.decode(errors="replace").split()
                if len(fields) == 4:  # else it was written on a full disk
                    about, status, kept, arrived = fields
                    self._stored_since[about] = Done(status, kept == "kept", arrived == "arrived")
        found = self._stored_since.get(key)
        return None if found is None or found.status == "-" else found

    def store(self, key: str, finished: Finished) -> None:
        """Writes a run; its rows last, so that what they promise is there.

        Raises:
            ResultsError: It cannot be written.
        """
        if finished.recording:
            with replacing(self.recording(key)) as partial, tarfile.open(fileobj=io.BytesIO(finished.recording)) as tar:
                partial.mkdir()
                for member in tar:
                    content = tar.extractfile(member)
                    if content is not None:
                        (partial / Path(member.name).name).write_bytes(content.read())
        with replacing(self.path / _RUNS / f"{key}.parquet") as partial:
            partial.write_bytes(finished.rows)
        arrived = not any(outcome in NOT_ARRIVED for outcome in finished.outcomes)
        line = (key, finished.status or "-", "kept" if finished.recording else "-", "arrived" if arrived else "-")
        self._note(f"{' '.join(line)}\n".encode())
        if self._unmerged is not None:
            self._unmerged += 1

    def _note(self, line: bytes) -> None:
        try:
            with io.FileIO(self.path / _STORED, "a") as file:
                written = file.write(line)  # at once, so that lines of several batches do not mix
        except OSError as cause:
            raise ResultsError(f"{self.path / _STORED}: cannot be written: {one_line(cause)}") from cause
        if written != len(line):
            raise ResultsError(f"{self.path / _STORED}: cannot be written: the disk is full")

    def tidy(self, *, now: bool = False) -> None:
        """Merges files of single runs if there are many, or `now`. They are listed only when there may be many."""
        if now:
            self._remove_leftovers()
        elif self._unmerged is not None and self._unmerged < self._many():
            return
        self._unmerged = len(self.unmerged())
        if not self._unmerged or not (now or self._unmerged >= self._many()):
            return
        with self._alone():
            parts = {part: _version(part) for part in self.unmerged()}
            if not parts:
                return
            merge(self.results, list(parts))
            self._merged = self._count() + len(parts) if self._merged is not None else None
            for part, version in parts.items():
                self._remove_merged(part, version)
            self._unmerged = 0

    def _remove_merged(self, part: Path, version: tuple[int, ...]) -> None:
        """Removes the file of a run, unless the run is being done again, or was while its rows were merged."""
        if self.claim(part.stem):
            try:
                if _version(part) == version:
                    part.unlink()
            finally:
                self.release(part.stem)

    def _remove_leftovers(self) -> None:
        """What processes left behind that were killed while they wrote."""
        for place in (self.path, self.path / _RUNS, self.path / _RECORDINGS):
            for entry in (*place.glob(".*.partial*"), *place.glob(".*.old")):
                with suppress(FileNotFoundError):
                    # A folder that gives way to another one has a new name, which changes no more than its ctime.
                    found = entry.stat()
                    since = found.st_ctime if entry.suffix == ".old" else found.st_mtime
                    if time.time() - since > _LEFTOVER_AGE:
                        shutil.rmtree(entry) if entry.is_dir() else entry.unlink()

    def _count(self) -> int:
        """Number of runs that are merged, roughly."""
        if self._merged is None:
            self._merged = n_keys(self.results) if self.results.exists() else 0
        return self._merged

    def _many(self) -> float:
        """So many files of single runs are merged."""
        return max(_MERGE_AT, _MERGE_SHARE * self._count())

    @contextmanager
    def _alone(self) -> Iterator[None]:
        self._held().take(_MERGE_BYTE, wait=True)
        try:
            yield
        finally:
            self._held().give(_MERGE_BYTE)

    def claim(self, key: str) -> bool:
        """Claims a run for this batch; False if another one has claimed it."""
        return self._held().take(1 + int(key[:12], 16), wait=False)

    def release(self, key: str) -> None:
        """The run is done, or given up."""
        self._held().give(1 + int(key[:12], 16))

    def _held(self) -> Locks:
        if self._locks is None:
            self._locks = Locks(self.path / _LOCKS)
        return self._locks

    def close(self) -> None:
        """Gives all claims back."""
        if self._locks is not None:
            self._locks.close()
            self._locks = None


def recordings_in(path: str | Path) -> Path:
    """Where the kept run folders of a batch are."""
    return Path(path) / _RECORDINGS


def _entries(folder: Path) -> Iterator[os.DirEntry[str]]:
    """Everything that a batch writes to: the parts of its folder, and what lies in those of single runs.

    Raises:
        ResultsError: A folder cannot be listed.
    """
    for place in (folder, folder / _RUNS, folder / _RECORDINGS):
        try:
            with os.scandir(place) as entries:
                yield from entries
        except (FileNotFoundError, NotADirectoryError):
            continue  # there are none yet, or other checks say what is wrong
        except OSError as cause:
            raise ResultsError(f"{place}: cannot be listed: {one_line(cause)}") from cause


def _version(path: Path) -> tuple[int, ...]:
    """Distinguishes a file from a later one of the same name."""
    found = path.stat()
    return found.st_ino, found.st_mtime_ns, found.st_size


def read_batch(path: str | Path, columns: Sequence[str] | None = None) -> ArrowTable:
    """The data set of a batch folder as an Arrow table, one row per run and agent.

    Args:
        path: The folder.
        columns: Names of `interdrive.batches.COLUMNS`; all by default.

    Raises:
        ResultsError: The folder is not a batch, of another version, or damaged.
    """
    return BatchFolder.open(path).table(columns)
