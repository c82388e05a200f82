"""The formats that are known, and how each is recognised by its content."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from interdrive.errors import InputError
from interdrive.storage.foreign_tables import PARQUET_MARK, header_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from interdrive.files.sources.model import Source
    from interdrive.files.sources.opening import SourceFile
    from interdrive.scenario import SourceOptions


@dataclass(frozen=True)
class Format:
    """A format of maps or recordings.

    Attributes:
        name: For messages and run.json.
        fits: Whether a file or folder is of this format, by its content; it is not broken for certain.
        read: Reads it.
    """

    name: str
    fits: Callable[[SourceFile], bool]
    read: Callable[[SourceFile, SourceOptions], Source]


def recognised(file: SourceFile) -> Format | None:
    """The format of a file or folder; None: it is none of these, such as a CommonRoad file."""
    return next((one for one in FORMATS if one.fits(file)), None)


def _root(name: str) -> Callable[[SourceFile], bool]:
    return lambda file: file.root == name


def _is_json(file: SourceFile, *names: bytes) -> bool:
    """Whether it is a JSON object with these names in it."""
    is_object = file.data[:4096].removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"{")
    return is_object and all(b'"%s"' % name in file.data for name in names)


#: Endings of tables, which have no mark if they are CSV.
_TABLES = (".csv", ".parquet")
_PICKLE, _TFRECORD = re.compile(rb"\x80[\x02-\x05]"), re.compile(r"\.tfrecord([.-].*)?", re.IGNORECASE)

# A reader is imported when it is needed: most runs need none.


def _opendrive(file: SourceFile, options: SourceOptions) -> Source:
    from interdrive.files.sources.opendrive.reader import read  # noqa: PLC0415

    return read(file, options)


def _sumo(file: SourceFile, options: SourceOptions) -> Source:
    from interdrive.files.sources.sumo_net import read  # noqa: PLC0415

    return read(file, options)


def _lanelet2(file: SourceFile, options: SourceOptions) -> Source:
    from interdrive.files.sources.lanelet2 import read  # noqa: PLC0415

    return read(file, options)


def _is_argoverse2(file: SourceFile) -> bool:
    if file.is_folder:
        return bool(file.names("scenario_*.parquet") and file.names("log_map_archive_*.json"))
    return _is_json(file, b"lane_segments")


def _argoverse2(file: SourceFile, options: SourceOptions) -> Source:
    from interdrive.files.sources.argoverse2 import read  # noqa: PLC0415

    return read(file, options)


def _is_womd(file: SourceFile) -> bool:
    return _is_json(file, b"objects", b"roads")


def _womd(file: SourceFile, options: SourceOptions) -> Source:
    from interdrive.files.sources.womd import read  # noqa: PLC0415

    return read(file, options)


def _is_osi(file: SourceFile) -> bool:
    """Whether it is MCAP, or has the ending .osi: these files have no mark."""
    return file.data.startswith(b"\x89MCAP") or (not file.is_folder and file.path.suffix.lower() == ".osi")


def _osi(file: SourceFile, options: SourceOptions) -> Source:
    from interdrive.files.sources.osi import read  # noqa: PLC0415

    return read(file, options)


def _is_interaction(file: SourceFile) -> bool:
    from interdrive.files.sources.interaction import fits  # noqa: PLC0415

    return fits(file)


def _interaction(file: SourceFile, options: SourceOptions) -> Source:
    from interdrive.files.sources.interaction import read  # noqa: PLC0415

    return read(file, options)


def _is_levelx(file: SourceFile) -> bool:
    from interdrive.files.sources.levelx import fits  # noqa: PLC0415

    return fits(file)


def _levelx(file: SourceFile, options: SourceOptions) -> Source:
    from interdrive.files.sources.levelx import read  # noqa: PLC0415

    return read(file, options)


def _is_table(file: SourceFile) -> bool:
    """Whether it is Parquet, or CSV with neutral tracks or lanes; or a table that lacks columns, by its ending."""
    named = not file.is_folder and file.path.suffix.lower() in _TABLES
    return named or file.data.startswith(PARQUET_MARK) or bool({"time_s", "lane_id"} & set(header_of(file.data)))


def _table(file: SourceFile, options: SourceOptions) -> Source:
    from interdrive.files.sources.neutral import read  # noqa: PLC0415

    return read(file, options)


def _is_never_read(file: SourceFile) -> bool:
    return bool(_PICKLE.match(file.data) or _TFRECORD.search(file.path.name)) and not file.is_folder


def _refused(file: SourceFile, _: SourceOptions) -> Source:
    kind = "pickle" if _PICKLE.match(file.data) else "TFRecord"
    raise InputError(f"{file.path}: {kind} is not read; docs/how_to/inputs says how to get JSON or tracks.parquet")


#: In the order in which they are tried.
FORMATS = (
    Format("OpenDRIVE", _root("OpenDRIVE"), _opendrive),
    Format("SUMO net", _root("net"), _sumo),
    Format("Lanelet2", _root("osm"), _lanelet2),
    Format("Argoverse 2", _is_argoverse2, _argoverse2),
    Format("Waymo Open Motion Dataset", _is_womd, _womd),
    Format("OSI", _is_osi, _osi),
    Format("INTERACTION or SinD", _is_interaction, _interaction),
    Format("highD, inD, rounD, exiD or uniD", _is_levelx, _levelx),
    Format("tables", _is_table, _table),
    Format("unread", _is_never_read, _refused),
)
