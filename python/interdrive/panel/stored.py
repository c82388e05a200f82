"""Drives of a panel on disk, so that they are driven once: a folder with one file per place.

    panel.json      what the folder is: version, drivers, and where they drove
    <key>.npz       all drives in the place of one agent, and the world without it

The key of a place is a hash of everything that decides about the drives. A world with code or files of the user is not
stored: nothing here would say that they have changed.
"""

from __future__ import annotations

import hashlib
import io
import json
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zipfile import BadZipFile

import numpy as np

from interdrive import _core
from interdrive.config.binding import flatten
from interdrive.errors import InputError, ResultsError
from interdrive.scoring.drive_facts import Drive
from interdrive.scoring.hindrance import Braking, Hindrance, Undisturbed
from interdrive.scoring.judgement import PanelDrives
from interdrive.scoring.terms import Term
from interdrive.storage import one_line, read_json, replacing, write_json

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from interdrive.panel.worlds import World
    from interdrive.scoring import ScoringSettings

#: Layout of the folder.
FORMAT = 2

_MARK = "panel.json"

#: Settings of scores that decide about no drive.
_OF_SCORES = ("weights.", "panel.", "progress_min")

_ARRAYS = ("time", "way", "velocity", "s", "x", "y", "free")
_WORLD = tuple(item.name for item in fields(Undisturbed) if item.name != "first_time_step")


def key_of(world: World, drivers: Sequence[str], settings: ScoringSettings, *, measures_hindrance: bool) -> str:
    """Hash of all that decides about the drives in the place of an agent; "" if that cannot be told."""
    if not world.is_closed:
        return ""
    content = {
        "format": FORMAT,
        "version": _core.__version__,
        "drivers": list(drivers),
        "hindrance": measures_hindrance,
        "bounds": {name: value for name, value in flatten(settings).items() if not name.startswith(_OF_SCORES)},
        **world.content(),
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True, default=str).encode()).hexdigest()[:32]


@dataclass(frozen=True)
class PanelFolder:
    """Stored drives of a panel.

    Attributes:
        path: The folder.
        drivers: Names of the drivers.
        about: Where they drove, in words.
        writes: What is not there yet is stored.
        is_complete: What is not there is an error instead of being driven.
    """

    path: Path
    drivers: tuple[str, ...]
    about: str = ""
    writes: bool = False
    is_complete: bool = False

    @classmethod
    def create(cls, path: str | Path, drivers: Sequence[str], about: str = "") -> PanelFolder:
        """A folder that grows; it may be there.

        Args:
            path: The folder.
            drivers: Names of the drivers.
            about: Where they drive, in words.

        Raises:
            ResultsError: Something else is there, or it cannot be written.
            InputError: It is of other drivers or of another version.
        """
        target = Path(path)
        if not (target / _MARK).exists():
            if target.exists() and (not target.is_dir() or any(target.iterdir())):
                raise ResultsError(f"{path}: there is something else already; a panel needs a new folder")
            with replacing(target / _MARK) as partial:
                write_json(
                    {"format": FORMAT, "interdrive": _core.__version__, "drivers": list(drivers), "about": about},
                    partial,
                )
        found = cls.open(target)
        if found.drivers != tuple(drivers):
            raise InputError(f"{path}: a panel of {', '.join(found.drivers)}, not of {', '.join(drivers)}")
        return cls(found.path, found.drivers, found.about, writes=True)

    @classmethod
    def open(cls, path: str | Path, *, is_complete: bool = False) -> PanelFolder:
        """A folder that is there.

        Args:
            path: The folder.
            is_complete: What is not there is an error.

        Raises:
            InputError: It is no panel, or one of another version.
            ResultsError: Its description is damaged.
        """
        try:
            info = read_json(Path(path) / _MARK)
        except (FileNotFoundError, NotADirectoryError):
            raise InputError(f"{path}: not a stored panel, there is no {_MARK}") from None
        except (OSError, ValueError) as cause:
            raise ResultsError(f"{path}/{_MARK}: cannot be read: {one_line(cause)}") from cause
        told = info if isinstance(info, dict) else {}
        own = (FORMAT, _core.__version__)
        found = (told.get("format"), told.get("interdrive"))
        if found != own:
            raise InputError(
                f"{path}: a panel of interdrive {found[1]}, format {found[0]}; this is {own[1]}, format {own[0]}: "
                "drive it again with interdrive panel"
            )
        names = told.get("drivers")
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            raise ResultsError(f"{path}/{_MARK}: its drivers are missing; the file is damaged")
        return cls(Path(path), tuple(names), str(told.get("about", "")), is_complete=is_complete)

    def find(self, key: str) -> PanelDrives | None:
        """The drives with a `key`; None if they are not there.

        Raises:
            ResultsError: The file is damaged.
        """
        path = self.path / f"{key}.npz"
        if not key or not path.exists():
            return None
        try:
            with np.load(path, allow_pickle=False) as arrays:
                return _decoded({name: arrays[name] for name in arrays.files})
        except (OSError, ValueError, KeyError, TypeError, BadZipFile) as cause:
            raise ResultsError(f"{path}: cannot be read: {one_line(cause)}; delete the file") from cause

    def said_lacking(self, anew: int, n: int, what: str) -> tuple[str, ...]:
        """A note if drivers of the panel drove for `anew` of `n` runs or places; `what` says which of the two."""
        if not anew:
            return ()
        has = f" (it has {self.about})" if self.about else ""
        return (f"{self.path} lacks what {anew} of {n} {what} need{has}; its drivers drove anew, which takes longer",)

    def keep(self, key: str, found: PanelDrives) -> None:
        """Stores the drives `found` under a `key`, unless the folder is only read.

        Raises:
            ResultsError: They cannot be written.
        """
        if not (key and self.writes):
            return
        content = io.BytesIO()
        np.savez_compressed(content, **_encoded(found))
        with replacing(self.path / f"{key}.npz") as partial:
            partial.write_bytes(content.getvalue())


def _encoded(found: PanelDrives) -> dict[str, Any]:
    arrays: dict[str, Any] = {}
    told: dict[str, Any] = {"notes": found.notes, "drives": {}, "hindrances": {}}
    for number, (name, drive) in enumerate(found.drives.items()):
        arrays |= {f"{number}_{item}": getattr(drive, item) for item in _ARRAYS}
        told["drives"][name] = {
            item.name: _plain(getattr(drive, item.name)) for item in fields(Drive) if item.name not in _ARRAYS
        }
    for name, one in found.hindrances.items():
        told["hindrances"][name] = {
            "lost": one.lost,
            "losers": list(one.losers.items()),
            "forced": [asdict(braking) for braking in one.forced.values()],
        }
    if found.without is not None:
        arrays |= {f"world_{name}": getattr(found.without, name) for name in _WORLD}
        told["first_time_step"] = found.without.first_time_step
    arrays["told"] = np.frombuffer(json.dumps(told).encode(), dtype=np.uint8)
    return arrays


def _plain(value: object) -> object:
    if isinstance(value, Term):
        return asdict(value)
    return sorted(value) if isinstance(value, frozenset) else value


def _decoded(arrays: Mapping[str, Any]) -> PanelDrives:
    told = json.loads(arrays["told"].tobytes().decode())
    drives = {}
    for number, (name, values) in enumerate(told["drives"].items()):
        terms = {key: Term(**values[key]) for key in ("ttc", "comfort")}
        hits = tuple(map(str, values["hits"]))
        cut_off = frozenset(values["cut_off_from"])
        own = {item: arrays[f"{number}_{item}"] for item in _ARRAYS}
        drives[name] = Drive(**{**values, **terms, **own, "hits": hits, "cut_off_from": cut_off})
    hindrances = {
        name: Hindrance(
            one["lost"],
            {int(number): time for number, time in one["losers"]},
            {int(braking["participant_id"]): Braking(**braking) for braking in one["forced"]},
        )
        for name, one in told["hindrances"].items()
    }
    without = None
    if "first_time_step" in told:
        world = {name: arrays[f"world_{name}"] for name in _WORLD}
        without = Undisturbed(first_time_step=told["first_time_step"], **world)
    return PanelDrives(drives, hindrances, without, tuple(told["notes"]))
