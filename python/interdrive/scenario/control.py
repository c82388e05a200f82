"""Traffic lights, stop lines and lines between lanes of a file, and what a light shows when."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np

from interdrive import _core

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from interdrive.scenario.signs import Ranks

#: What a traffic light shows; red and yellow together count as red.
Signal: TypeAlias = Literal["dark", "green", "yellow", "red"]

#: How a lanelet leads across a junction.
Turn: TypeAlias = Literal["left", "straight", "right"]

#: All turns; the position is the code that crosses the boundary to the core.
TURNS: tuple[Turn, ...] = ("left", "straight", "right")

#: All signals; the position is the code that crosses the boundary to the core.
SIGNALS: tuple[Signal, ...] = ("dark", "green", "yellow", "red")

#: Codes of the signals that hold nobody; the others, yellow and red, hold who could still stop.
GOING_SIGNALS: tuple[int, ...] = tuple(_core.GOING_SIGNALS)

#: Markings that must not be crossed from either side. Of a double line the nearer one counts: its names go from left to
#: right, so on the left of a lane it is the second one.
_SOLID = frozenset(("solid", "broad_solid", "solid_solid", "curb"))
CLOSED = {"left": _SOLID | {"dashed_solid"}, "right": _SOLID | {"solid_dashed"}}


@dataclass(frozen=True)
class TrafficLight:
    """A traffic light with its cycle.

    Attributes:
        id: Its id.
        phases: Signal and length in time steps of each phase; empty if it is switched off.
        offset: Time step at which the cycle begins.
        directions: Turns for which it counts.
        position: Where it stands [m]; None if the file does not say.
    """

    id: int
    phases: tuple[tuple[Signal, int], ...]
    offset: int = 0
    directions: frozenset[str] = frozenset(TURNS)
    position: tuple[float, float] | None = None

    def signals(self, n_steps: int) -> NDArray[np.int64]:
        """Codes of what it shows at time steps 0 to `n_steps` - 1: positions in `SIGNALS`, shape (n_steps,)."""
        lengths = [length for _, length in self.phases]
        if not lengths:
            return np.zeros(n_steps, dtype=np.int64)
        codes = np.array([SIGNALS.index(signal) for signal, _ in self.phases], dtype=np.int64)
        place = np.mod(np.arange(n_steps) - self.offset, sum(lengths))
        shown: NDArray[np.int64] = codes[np.searchsorted(np.cumsum(lengths), place, side="right")]
        return shown


@dataclass(frozen=True)
class StopLine:
    """A line before which vehicles stop for a red light or a stop sign.

    Attributes:
        lanelet_id: The lanelet that it belongs to.
        ends: Its ends, left before right [m], shape (2, 2).
        light_ids: For each lanelet that follows, the ids of the traffic lights that count on the way there.
        has_stop_sign: Every vehicle stops here, whatever the lights show.
        is_stated: The file has the line; otherwise it was put at the end of the lanelet.
        turns_on_red: Lanelets that follow onto which drivers may turn right on red after stopping.
    """

    lanelet_id: int
    ends: NDArray[np.float64]
    light_ids: tuple[tuple[int, tuple[int, ...]], ...] = field(default=())
    has_stop_sign: bool = False
    is_stated: bool = True
    turns_on_red: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        """The array is read-only from here on."""
        self.ends.setflags(write=False)


@dataclass(frozen=True)
class Priorities:
    """What a file says about priority at junctions.

    Attributes:
        turns: Lanelets that lead across a junction, and their turn, where the file states it.
        ranks: Lanelets that lead to a junction and have a sign, and what it is worth for a turn to the left, straight
            on and to the right: 1 (stop), 2 (give way), 4 or 5 (priority); without a sign it would be 3. Signs and
            what each is worth are listed in `interdrive.scenario.signs`.
        minor: Lanelets from which others are entered with care: driveways, ramps, bus stops, shoulders.
        left_hand: Vehicles drive on the left.
        priority_side: Without any sign, vehicles from this side go first.
        derives_main_road: At a T without signs the road that goes on is the main road.
    """

    turns: tuple[tuple[int, Turn], ...] = ()
    ranks: tuple[tuple[int, Ranks], ...] = ()
    minor: tuple[int, ...] = ()
    left_hand: bool = False
    priority_side: Literal["right", "left", "none"] = "right"
    derives_main_road: bool = False


def shown_at_lines(
    lights: Sequence[TrafficLight], lines: Sequence[StopLine], first_time_step: int, n_steps: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Stop lines with what drivers see there; a line whose ways have different lights is divided among them.

    Returns:
        Ends of the pieces, left before right [m], shape (pieces, 2, 2), and positions in `SIGNALS`, shape (pieces,
        n_steps), from `first_time_step` on.
    """
    known = {light.id: light for light in lights}
    ends, shown = [np.empty((0, 2, 2))], [np.empty((0, n_steps), dtype=np.int64)]
    for line in lines:
        groups = list(dict.fromkeys(found for _, found in line.light_ids)) or [()]
        cuts = np.linspace(line.ends[0], line.ends[1], len(groups) + 1)
        for place, group in enumerate(groups):
            ends.append(cuts[None, place : place + 2])
            codes = shown_together([known[i] for i in group], first_time_step + n_steps)
            shown.append(codes[None, first_time_step:])
    return np.concatenate(ends), np.concatenate(shown)


def shown_together(lights: list[TrafficLight], n_steps: int) -> NDArray[np.int64]:
    """What lights of one way show together at time steps 0 to `n_steps` - 1, as positions in `SIGNALS`.

    One green is green, else one yellow is yellow, else red; dark if all are.
    """
    shown = np.zeros(n_steps, dtype=np.int64)
    for light in lights:
        codes = light.signals(n_steps)
        shown = np.where((shown == 0) | ((codes != 0) & (codes < shown)), codes, shown)
    return shown
