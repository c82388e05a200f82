"""Which recordings are fitted, which choose among populations, and which only check the result."""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from interdrive.errors import InputError
from interdrive.traffic_realism.windows import files_of, place_of, read_recordings

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from interdrive.traffic_realism.windows import Recording

#: Parts of a split.
_PARTS = ("fit", "choose", "test")


@dataclass(frozen=True)
class Parts:
    """Recordings by what they are for.

    Attributes:
        fit: Populations are fitted to them.
        choose: The best populations are compared on them, if there are any.
        test: They only check the result.
        notes: What there is to know about the files.
    """

    fit: Sequence[Recording]
    choose: Sequence[Recording] = ()
    test: Sequence[Recording] = ()
    notes: tuple[str, ...] = ()

    def without(self, place: str) -> Parts:
        """A fold: the same, in which a place only checks the result."""
        return Parts(
            [one for one in self.fit if one.place != place], test=[one for one in self.fit if one.place == place]
        )


def read_parts(
    sources: Sequence[str | Path],
    hold_out: Sequence[str],
    split: str | Path | None,
    *,
    raw: bool,
    any_traffic: bool,
) -> Parts:
    """Reads recordings, divided.

    Args:
        sources: Files and folders.
        hold_out: Places that only check the result.
        split: File that says which part each file belongs to; None: all but the places that are held out are fitted.
        raw: Read them without repairs.
        any_traffic: Take simulated and invented traffic, too.

    Raises:
        InputError: A file or a split cannot be used, or nothing is left to fit.
    """
    if split is None:
        recordings, notes = read_recordings(sources, raw=raw, any_traffic=any_traffic)
        return _held_out(recordings, hold_out, notes)
    if hold_out:
        raise InputError("hold_out: the split says what is held out; give one of both")
    path = Path(split)
    files = [file for file, _ in files_of(sources)]
    try:
        chosen = _divided(path, files)
    except InputError as error:
        raise error.within(f"split {path}") from None
    read = {}
    notes = []
    for part, own in chosen.items():
        read[part], found = read_recordings(sources, raw=raw, any_traffic=any_traffic, only=own) if own else ([], [])
        notes += found
    left = len(set(files)) - sum(len(own) for own in chosen.values())
    if left:
        notes.append(f"{left} of {len(set(files))} files are in no part of the split")
    return Parts(read["fit"], read["choose"], read["test"], tuple(notes))


def _held_out(recordings: Sequence[Recording], hold_out: Sequence[str], notes: Sequence[str]) -> Parts:
    places = list(dict.fromkeys(one.place for one in recordings))
    for place in hold_out:
        if place not in places:
            raise InputError(f"hold_out: no recording of {place!r}; there are {', '.join(places)}")
    fitted = [one for one in recordings if one.place not in hold_out]
    if not fitted:
        raise InputError("hold_out: every place is held out, so none is left to fit")
    return Parts(fitted, test=[one for one in recordings if one.place in hold_out], notes=tuple(notes))


def _divided(path: Path, files: Sequence[Path]) -> dict[str, set[Path]]:
    """Files of each part."""
    found: dict[str, set[Path]] = {part: set() for part in _PARTS}
    for part, entries in _entries(path).items():
        for entry in entries:
            try:
                own = _files_of_entry(entry, path.parent, files)
            except InputError as error:
                raise error.within(part) from None
            for other, theirs in found.items():
                twice = sorted(own & theirs)
                if twice:
                    raise InputError(part, f"{entry!r}: {twice[0].name} is in {other}, too")
            found[part] |= own
    if not found["fit"]:
        raise InputError("fit", "names nothing, so none is left to fit")
    return found


def _entries(path: Path) -> Mapping[str, Sequence[str]]:
    try:
        table: dict[str, Any] = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"cannot be read: {error}") from None
    for name, entries in table.items():
        if name not in _PARTS:
            raise InputError(name, f"is not known; there are {', '.join(_PARTS)}")
        if not isinstance(entries, list) or not all(isinstance(entry, str) and entry.strip() for entry in entries):
            raise InputError(name, f"must be a list of places, windows PLACE:1-20, files and folders, is {entries!r}")
    return table


def _files_of_entry(entry: str, folder: Path, files: Sequence[Path]) -> set[Path]:
    """Those of a place, of some of its windows, or below a path, which is relative to the folder of the split."""
    place, colon, windows = entry.partition(":")
    own = sorted((file for file in files if place_of(file.stem) == place), key=_place_in_time)
    if colon and own:
        found = re.fullmatch(r"(\d+)-(\d+)", windows)
        first, last = (int(found[1]), int(found[2])) if found else (0, 0)
        if not 1 <= first <= last <= len(own):
            raise InputError(f"{entry!r}: write windows as {place}:1-{len(own)}; there are {len(own)}")
        return set(own[first - 1 : last])
    path = (folder / entry).resolve()
    own = own or [file for file in files if file.resolve() == path or path in file.resolve().parents]
    if not own:
        places = ", ".join(dict.fromkeys(place_of(file.stem) for file in files))
        raise InputError(f"{entry!r}: no file is of this place or below this path; there are {places}")
    return set(own)


def _place_in_time(file: Path) -> tuple[int, int, str]:
    """Windows state in their names which recording of the place they are from, and at which time step they begin."""
    found = re.search(r"-(\d+)_(\d+)_T-\d+$", file.stem)
    return (*((int(found[1]), int(found[2])) if found else (0, 0)), file.name)
