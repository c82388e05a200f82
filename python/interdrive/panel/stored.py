"""Drives of a panel on disk, so that they are driven once: a folder with one file per place.

    panel.json      what the folder is: version, drivers, and where they drove
    <key>.npz       all drives in the place of one agent, and the world without it

The key of a place is a hash of the agent and its file, followed by one of everything else that decides about the
drives. The file holds the settings, too, to tell what differs where a place is there with others. A world with code or
files of the user is not stored: nothing here would say that they have changed.
"""

from __future__ import annotations

import hashlib
import io
import json
from collections import Counter
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
FORMAT = 3

_MARK = "panel.json"

#: Settings of scores that decide about no drive.
_OF_SCORES = ("weights.", "panel.", "progress_min")

_ARRAYS = ("time", "way", "velocity", "s", "x", "y", "free")
_WORLD = tuple(item.name for item in fields(Undisturbed) if item.name != "first_time_step")


#: Letters of a key: those of the agent and its file, and all.
_OF_PLACE, _KEY = 12, 32

#: What a note says of values that are too long for it.
_OTHER = {
    "scenario": "the recording is read otherwise",
    "present": "other participants",
    "others": "other agents",
}

#: Settings that a note names, and letters of a value in it.
_NAMED, _LONGEST = 3, 40


@dataclass(frozen=True)
class Asked:
    """The drives in the place of an agent that a score needs.

    Attributes:
        key: Hash of all that decides about them; "" if that cannot be told.
        content: All that decides, in plain values.
    """

    key: str
    content: Mapping[str, Any]

    @classmethod
    def of(cls, world: World, drivers: Sequence[str], settings: ScoringSettings, *, measures_hindrance: bool) -> Asked:
        """What a score with these drivers and bounds needs in the place of the agent of a world."""
        if not world.is_closed:
            return cls("", {})
        bounds = {
            f"scoring.{name}": value for name, value in flatten(settings).items() if not name.startswith(_OF_SCORES)
        }
        given = world.content()
        of_run = given.pop("settings")
        given |= {"drivers": list(drivers), "hindrance": measures_hindrance, **bounds, **of_run}
        content = json.loads(_text(given))
        place = _hash(_text([world.scenario.sha256, world.agent_id]))[:_OF_PLACE]
        return cls((place + _hash(_text([FORMAT, _core.__version__, content])))[:_KEY], content)

    def differences(self, content: Mapping[str, Any]) -> list[str]:
        """What is other than in a stored `content`, such as "predictor neural, here lane_following"."""
        names = [name for name in {**content, **self.content} if content.get(name) != self.content.get(name)]
        return [_difference(name, content.get(name), self.content.get(name)) for name in names]


def _text(content: object) -> str:
    return json.dumps(content, sort_keys=True, default=str)


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _difference(name: str, there: Any, here: Any) -> str:  # noqa: ANN401 - any JSON value
    if name == "others" and there and here:
        kinds = [" and ".join(sorted({str(choice) for choice in one.values()})) for one in (there, here)]
        if kinds[0] != kinds[1]:
            return f"traffic {kinds[0]}, here {kinds[1]}"
    if name in _OTHER:
        return _OTHER[name]
    said = [one if isinstance(one, str) else json.dumps(one) for one in (there, here)]
    return f"{name} {said[0]}, here {said[1]}" if max(map(len, said)) <= _LONGEST else f"other {name}"


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

    def why_not(self, asked: Asked) -> str:
        """Why the drives that are asked for are not there, in words.

        Raises:
            ResultsError: A file is damaged.
        """
        if not asked.key:
            return "it depends on code or files of yours"
        found = []
        for path in sorted(self.path.glob(f"{asked.key[:_OF_PLACE]}*.npz")):
            try:
                with np.load(path, allow_pickle=False) as arrays:
                    found.append(asked.differences(json.loads(arrays["told"].tobytes().decode())["asked"]))
            except (OSError, ValueError, KeyError, TypeError, AttributeError, BadZipFile) as cause:
                raise ResultsError(f"{path}: cannot be read: {one_line(cause)}; delete the file") from cause
        if not found:
            return "no such place"
        nearest = min(found, key=len)
        more = f" and {len(nearest) - _NAMED} more" if len(nearest) > _NAMED else ""
        return f"{'; '.join(nearest[:_NAMED])}{more}"

    def said_lacking(self, reasons: Sequence[str], n: int, what: str) -> tuple[str, ...]:
        """A note if drivers of the panel drove anew in runs or places.

        Args:
            reasons: Why, for each of them, in the words of `why_not`.
            n: How many runs or places there are.
            what: Which of the two they are.
        """
        if not reasons:
            return ()
        (why, times), *_ = Counter(reasons).most_common(1)
        often = "" if times == len(reasons) else f"{times} times "
        has = f", it has {self.about}" if self.about else ""
        lacks = f"{self.path} lacks what {len(reasons)} of {n} {what} need ({often}{why}{has})"
        return (f"{lacks}; its drivers drove anew, which takes longer",)

    def keep(self, asked: Asked, found: PanelDrives) -> None:
        """Stores the drives that were `asked` for and `found`, unless the folder is only read.

        Raises:
            ResultsError: They cannot be written.
        """
        if not (asked.key and self.writes):
            return
        content = io.BytesIO()
        np.savez_compressed(content, **_encoded(found, asked))
        with replacing(self.path / f"{asked.key}.npz") as partial:
            partial.write_bytes(content.getvalue())


def _encoded(found: PanelDrives, asked: Asked) -> dict[str, Any]:
    arrays: dict[str, Any] = {}
    told: dict[str, Any] = {"asked": asked.content, "notes": found.notes, "drives": {}, "hindrances": {}}
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
