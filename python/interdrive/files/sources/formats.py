"""The formats that are known, and how each is recognised by its content."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

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


# A reader is imported when it is needed: most runs need none.


def _opendrive(file: SourceFile, options: SourceOptions) -> Source:
    from interdrive.files.sources.opendrive.reader import read  # noqa: PLC0415

    return read(file, options)


def _sumo(file: SourceFile, options: SourceOptions) -> Source:
    from interdrive.files.sources.sumo_net import read  # noqa: PLC0415

    return read(file, options)


#: In the order in which they are tried.
FORMATS = (
    Format("OpenDRIVE", _root("OpenDRIVE"), _opendrive),
    Format("SUMO net", _root("net"), _sumo),
)
