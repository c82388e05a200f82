"""Versioned sets of scenarios: what they consist of, and their files, found by content."""

from __future__ import annotations

import hashlib
import tomllib
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from interdrive.errors import InputError
from interdrive.files import content_of_file, scenario_folders, shipped_scenario, shipped_scenarios

if TYPE_CHECKING:
    from collections.abc import Mapping

#: Traffic that replays its recording, and traffic that adjusts its speed.
NON_REACTIVE, REACTIVE = "recorded", "velocity_adjusting"

#: Splits: what claims are made on, what planners are tuned on, both.
SPLITS = ("test", "dev", "all")

_ENDINGS = (".xml", ".pb")


def traffic_name(kind: str) -> str:
    """How a kind of traffic is headed."""
    return "replay" if kind == NON_REACTIVE else kind


@dataclass(frozen=True)
class Passage:
    """The part of a joined recording in which a vehicle is under test.

    Attributes:
        recording: Name of the recording.
        first: Time step of the recording at which the vehicle enters; the run begins there.
        end: One more than the last time step.
    """

    recording: str
    first: int
    end: int


@dataclass(frozen=True)
class SetFile:
    """One scenario of a set.

    Attributes:
        name: Of the file, without ending.
        sha256: Of its content, by which it is found.
        source: Repository, path and commit from which it comes; empty for shipped scenarios.
        category: Of its roads. place: One stretch of road; places are drawn together in intervals.
        traffic: recorded, simulated or invented.
        split: "test" or "dev".
        agents: Ids; each is driven alone.
        road_class: What has a weight of its own in the number; "" in sets without weights.
        passage: Of a recording that is joined from windows; `sha256` is then known once it is cut. None: a file.
    """

    name: str
    sha256: str
    source: tuple[str, ...]
    category: str
    place: str
    traffic: str
    split: str
    agents: tuple[int, ...]
    road_class: str = ""
    passage: Passage | None = None


@dataclass(frozen=True)
class Recording:
    """A long recording, joined from windows that follow each other.

    Attributes:
        name: Its name.
        parts: The windows; each is found by its content.
    """

    name: str
    parts: tuple[SetFile, ...]


@dataclass(frozen=True)
class BenchmarkSet:
    """A set of scenarios; a released one never changes, corrections make a new version.

    Attributes:
        name: With its version, such as "public-1".
        text: What it is.
        files: Its scenarios.
        sha256: Of what it states.
        weights: Of each class of roads in the number; empty: all files count alike.
        traffic: Kinds of traffic among which planners are driven.
        counted: Those of them whose mean is the number.
        recordings: By name, of which files are passages.
    """

    name: str
    text: str
    files: tuple[SetFile, ...]
    sha256: str
    weights: Mapping[str, float] = field(default_factory=dict)
    traffic: tuple[str, ...] = (NON_REACTIVE, REACTIVE)
    counted: tuple[str, ...] = (REACTIVE,)
    recordings: Mapping[str, Recording] = field(default_factory=dict)

    def of_split(self, split: str) -> tuple[SetFile, ...]:
        """The scenarios of a split.

        Raises:
            InputError: There is no such split, or it is empty.
        """
        if split not in SPLITS:
            raise InputError(f"split {split!r}: expected one of {', '.join(SPLITS)}")
        found = tuple(file for file in self.files if split in ("all", file.split))
        if not found:
            raise InputError(f"split {split}: {self.name} has no scenarios; use all")
        return found


def set_names() -> tuple[str, ...]:
    """The sets that come with the package."""
    return tuple(sorted(path.stem for path in _folder().glob("*.toml")))


def read_set(name: str) -> BenchmarkSet:
    """A set by its name.

    Raises:
        InputError: There is none; the message lists the names.
    """
    if name not in set_names():
        raise InputError(f"set {name!r}: there is no such benchmark set; there are {', '.join(set_names())}")
    content = (_folder() / f"{name}.toml").read_bytes()
    table: dict[str, Any] = tomllib.loads(content.decode())
    entries = [
        SetFile(
            name=entry["name"],
            sha256=entry["sha256"],
            source=tuple(entry.get("source", ())),
            category=entry["category"],
            place=entry["place"],
            traffic=entry["traffic"],
            split=entry["split"],
            agents=tuple(entry["agents"]),
            road_class=entry.get("class", ""),
        )
        for entry in table["file"]
    ]
    recordings = {}
    for entry in table.get("recording", ()):
        about = {name: entry[name] for name in ("category", "place", "traffic", "split")}
        parts = tuple(SetFile(part[0], part[1], tuple(part[2:]), **about, agents=()) for part in entry["parts"])
        recordings[entry["name"]] = Recording(entry["name"], parts)
        entries += [
            SetFile(
                name=f"{entry['name']}_{agent}",
                sha256="",
                source=(),
                **about,
                agents=(agent,),
                road_class=entry["class"],
                passage=Passage(entry["name"], first, end),
            )
            for agent, first, end in entry["passages"]
        ]
    return BenchmarkSet(
        name,
        table["text"],
        tuple(entries),
        hashlib.sha256(content).hexdigest(),
        weights=table.get("weights", {}),
        traffic=tuple(table.get("traffic", (NON_REACTIVE, REACTIVE))),
        counted=tuple(table.get("counted", (REACTIVE,))),
        recordings=recordings,
    )


def find_files(wanted: tuple[SetFile, ...], folder: str | Path | None) -> tuple[dict[str, Path], list[str]]:
    """The files of a set by the hash of their content, and what is missing and why, one line each.

    Args:
        wanted: What is looked for.
        folder: Searched with all folders below, or several with the separator of PATH between them; by default those of
            the variable `INTERDRIVE_SCENARIOS`. Shipped scenarios are always found.

    Raises:
        InputError: A folder does not exist.
    """
    paths = [shipped_scenario(name) for name in shipped_scenarios()]
    for given in scenario_folders(folder):
        if not given.is_dir():
            raise InputError(f"{given}: no such folder; benchmark files are looked for below it")
        paths += sorted(path for path in given.rglob("*") if path.suffix in _ENDINGS)
    names = {file.name for file in wanted}
    found: dict[str, Path] = {}
    others: dict[str, Path] = {}
    hashes = {file.sha256 for file in wanted}
    for path in paths:
        if path.stem not in names or not path.is_file():
            continue
        sha256 = hashlib.sha256(content_of_file(path)).hexdigest()
        if sha256 in hashes:
            found.setdefault(sha256, path)
        else:
            others.setdefault(path.stem, path)
    missing = [
        f"{file.name}: {others[file.name]} has other contents"
        if file.name in others
        else f"{file.name}: not found ({' '.join(file.source) or 'shipped'})"
        for file in wanted
        if file.sha256 not in found
    ]
    return found, missing


def _folder() -> Path:
    return Path(str(files("interdrive"))) / "benchmarks" / "sets"
