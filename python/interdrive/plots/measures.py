"""Lines to compare criticality measures with in figures."""

from __future__ import annotations

from interdrive.criticality import CriticalitySettings

#: The threshold of the default settings; 1 for numbers that compare what is needed with what is there.
LEVELS = {"ttc": CriticalitySettings().ttc_threshold, "btn": 1.0, "stn": 1.0, "psd": 1.0}


def levels_of(settings: CriticalitySettings) -> dict[str, float]:
    """The same with the threshold of these settings."""
    return LEVELS | {"ttc": settings.ttc_threshold}
