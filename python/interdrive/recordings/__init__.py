"""What is wrong in recordings, windows that follow each other, and parts of what is long."""

from interdrive.recordings.headings import HeadingOffset, heading_offset, turned
from interdrive.recordings.overlaps import overlapping, overlapping_at_first
from interdrive.recordings.parts import part_of, with_own_overlaps
from interdrive.recordings.repair import repaired, with_overlaps
from interdrive.recordings.windows import joined

__all__ = [
    "HeadingOffset",
    "heading_offset",
    "joined",
    "overlapping",
    "overlapping_at_first",
    "part_of",
    "repaired",
    "turned",
    "with_overlaps",
    "with_own_overlaps",
]
