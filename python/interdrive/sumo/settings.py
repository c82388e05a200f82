"""Settings of traffic by SUMO."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from interdrive.errors import InputError


@dataclass(frozen=True)
class SumoSettings:
    """Traffic by SUMO.

    Attributes:
        radius: Participants of SUMO that are farther from every agent are left out of the run until they come nearer;
            inf: none is.
    """

    radius: Annotated[float, "m"] = 300.0

    def __post_init__(self) -> None:
        """Checks the range."""
        if not self.radius > 0.0:
            raise InputError("radius", f"must be positive, not {self.radius}")
