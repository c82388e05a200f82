"""Driving styles: presets of the comfort of the planner `rollout`."""

from __future__ import annotations

import difflib
from types import MappingProxyType
from typing import TYPE_CHECKING

from interdrive.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping

_COMFORT = {
    # Below 1.5 m/s² along and across and 1 m/s³, as nine of ten people stay on recorded motorways (MONA).
    "calm": {
        "acceleration": 1.5,
        "deceleration": 1.5,
        "jerk": 1.0,
        "jerk_low": 2.5,
        "lateral_acceleration": 1.5,
        "time_gap": 1.2,
    },
    "normal": {},
    # As hard as vehicles of recordings that simulators made brake and turn.
    "brisk": {
        "acceleration": 4.0,
        "deceleration": 3.0,
        "jerk": 5.0,
        "jerk_low": 8.0,
        "lateral_acceleration": 3.5,
        "time_gap": 0.8,
    },
}

#: Driving styles by name, as settings of a run by dotted name; `normal` has none, it is the default.
STYLES: Mapping[str, Mapping[str, float]] = MappingProxyType(
    {
        style: MappingProxyType({f"planner.rollout.comfort.{name}": value for name, value in comfort.items()})
        for style, comfort in _COMFORT.items()
    }
)


def style_settings(style: str) -> Mapping[str, float]:
    """Settings of a style, by dotted name.

    Raises:
        InputError: There is no such style.
    """
    if style not in STYLES:
        near = difflib.get_close_matches(style, STYLES, n=1)
        hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(STYLES)}"
        raise InputError(f"style: there is no style {style!r}; {hint}")
    return STYLES[style]
