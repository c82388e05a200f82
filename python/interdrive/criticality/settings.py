"""Parameters and switches of the measures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from interdrive.native_settings import MeasureSettings


@dataclass(frozen=True)
class CriticalitySettings(MeasureSettings):
    """What can be chosen; the defaults are those of docs/reference/criticality.md.

    Attributes:
        conflict_areas: Where vehicles cross: stated, between the connectors of the file's intersections, or crossing,
            between all lanelets that cross or join.
    """

    conflict_areas: Literal["stated", "crossing"] = "stated"
