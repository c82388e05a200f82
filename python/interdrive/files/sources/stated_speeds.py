"""Speeds that a source states and that no vehicle can change to, such as the first ones of a track, put right."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from interdrive.array_types import Floats

#: What no vehicle reaches, neither braking nor driving off [m/s²].
IMPOSSIBLE_ACCELERATION = 12.0
#: Speeds this long before and after one are compared with it [s].
AROUND = 0.5


def put_right(speed: Floats, dt: float) -> int:
    """Replaces speeds by the median of those around if no vehicle changes its speed from that one to them in time.

    Trackers state the first speeds of what they begin to see before they know it. A real change, such as a crash, stays
    as it is: half of the speeds around are then like those before it, half like those after it.

    Args:
        speed: Speeds of one participant at consecutive time steps [m/s], nan where none is stated; changed in place.
        dt: Time between two of them [s].

    Returns:
        How many were replaced.
    """
    reach = round(AROUND / dt)
    stated = np.flatnonzero(np.isfinite(speed))
    if reach < 1 or not (np.abs(np.diff(speed[stated])) > IMPOSSIBLE_ACCELERATION * dt).any():
        return 0
    padding = np.full(reach, np.nan)
    around = np.lib.stride_tricks.sliding_window_view(np.concatenate((padding, speed, padding)), 2 * reach + 1)
    usual = np.nanmedian(around[stated], axis=1)
    wrong = np.abs(speed[stated] - usual) > IMPOSSIBLE_ACCELERATION * AROUND
    speed[stated[wrong]] = usual[wrong]
    return int(wrong.sum())
