"""How criticality measures are drawn: up to where their values matter, and lines to compare them with."""

from __future__ import annotations

from interdrive.criticality import CriticalitySettings

#: Beyond these, values of a measure do not matter any more; further up they would only press the rest down.
CAPS = {
    "ttc": 10.0,
    "thw": 10.0,
    "psd": 10.0,
    "btn": 3.0,
    "stn": 3.0,
    "hw": 100.0,
    "dce": 50.0,
    "ttce": 20.0,
    "pet": 20.0,
    "et": 20.0,
}

#: The threshold of the default settings; 1 for numbers that compare what is needed with what is there.
LEVELS = {"ttc": CriticalitySettings().ttc_threshold, "btn": 1.0, "stn": 1.0, "psd": 1.0}


def levels_of(settings: CriticalitySettings) -> dict[str, float]:
    """The same with the threshold of these settings."""
    return LEVELS | {"ttc": settings.ttc_threshold}
