"""Passages of joined recordings as files, cut from windows that are found by content.

A passage is the time in which one vehicle is there, and some more for a driver that takes longer: that vehicle is under
test, the others enter and leave as recorded.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from interdrive import _core
from interdrive.benchmarks.sets import find_files
from interdrive.files import join, scenario_document
from interdrive.recordings import part_of
from interdrive.storage import replacing

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from interdrive.benchmarks.sets import BenchmarkSet, Recording, SetFile
    from interdrive.scenario import Scenario


#: Folder of passages, beside that of results: all commands that write beside it share them.
PASSAGES = "passages"


def located(
    chosen: BenchmarkSet,
    wanted: Sequence[SetFile],
    scenarios: str | Path | None,
    folder: str | Path,
    on_recording: Callable[[str], None] | None = None,
) -> tuple[list[SetFile], dict[str, Path], list[str]]:
    """Files of a set that are there, passages of joined recordings included.

    Args:
        chosen: The set.
        wanted: Of its files.
        scenarios: Where files and windows are looked for, as for `find_files`.
        folder: Where passages are written; what is there is not made again.
        on_recording: Called with the name of a recording before it is joined, which takes seconds.

    Returns:
        The files with the hash of their content, their paths by that, and what is missing and why, one line each.

    Raises:
        InputError: A folder does not exist.
        ResultsError: The passages cannot be written.
    """
    whole = [file for file in wanted if file.passage is None]
    found, missing = find_files(tuple(whole), scenarios)
    there = {file.name: file for file in whole if file.sha256 in found}
    for name, recording in chosen.recordings.items():
        parts = [file for file in wanted if file.passage is not None and file.passage.recording == name]
        if not parts:
            continue
        windows, lacking = find_files(recording.parts, scenarios)
        if lacking:
            some = f"{len(lacking)} of {len(recording.parts)} windows are missing: {lacking[0]}"
            missing.append(f"{name}, {len(parts)} passages: {some}")
            continue
        made = _passages(parts, recording, windows, Path(folder), on_recording)
        for file, path in made:
            sha256 = hashlib.sha256(path.read_bytes()).hexdigest()
            there[file.name] = replace(file, sha256=sha256)
            found[sha256] = path
    return [there[file.name] for file in wanted if file.name in there], found, missing


def _passages(
    wanted: Sequence[SetFile],
    recording: Recording,
    windows: Mapping[str, Path],
    folder: Path,
    on_recording: Callable[[str], None] | None,
) -> list[tuple[SetFile, Path]]:
    stated = "".join(part.sha256 for part in recording.parts) + _core.__version__
    inside = folder / f"{recording.name}-{hashlib.sha256(stated.encode()).hexdigest()[:12]}"
    paths = {file.name: inside / f"{file.name}.xml" for file in wanted}
    whole: Scenario | None = None
    for file in wanted:
        if paths[file.name].is_file():
            continue
        if whole is None:
            if on_recording is not None:
                on_recording(recording.name)
            whole = join([windows[part.sha256] for part in recording.parts])
        assert file.passage is not None
        part = part_of(whole, file.passage.first, min(file.passage.end, whole.obstacles.valid.shape[1]))
        document = scenario_document(part, windows[recording.parts[0].sha256])
        with replacing(paths[file.name]) as partial:
            partial.write_bytes(document)
    return [(file, paths[file.name]) for file in wanted]
