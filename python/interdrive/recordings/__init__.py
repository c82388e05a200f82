"""What is wrong in recordings: headings that are off, vehicles that overlap; and windows that follow each other."""

from interdrive.recordings.headings import HeadingOffset, heading_offset, turned
from interdrive.recordings.overlaps import overlapping, overlapping_at_first
from interdrive.recordings.repair import repaired, with_overlaps
from interdrive.recordings.windows import joined, part_of

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
]
