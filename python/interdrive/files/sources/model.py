"""What the reader of a format returns: roads as lanes, traffic as columns; the same for every format."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from interdrive.files.sources.notes import Notes

if TYPE_CHECKING:
    from interdrive.array_types import Floats, Ints
    from interdrive.scenario.control import Signal, Turn
    from interdrive.scenario.signs import SignKind


#: Begins the note on lights without a cycle; their number follows.
DARK = "the cycles of traffic lights are unknown, so that they are dark"


@dataclass
class Lane:
    """A piece of a lane that becomes a lanelet.

    Attributes:
        key: Its name in the source, such as `road/section/lane` or the id of a relation.
        left: Left border in driving direction [m], shape (points, 2).
        right: Right border [m], as many points as the left one.
        speed_limit: [m/s]; nan: the source states none.
        left_line: CommonRoad's name of the line on the left border ("solid", "broad_dashed"); "unknown".
        right_line: The same on the right border.
        kind: CommonRoad's type of lanelet.
        left_neighbour: Position of the left neighbour in `Roads.lanes`, and whether it runs in the same direction.
        right_neighbour: The same for the right one.
        road: Name of the road of which it is a piece; very short pieces are joined to the next of the same road.
    """

    key: str
    left: Floats
    right: Floats
    speed_limit: float = math.nan
    left_line: str = "unknown"
    right_line: str = "unknown"
    kind: str = "urban"
    left_neighbour: tuple[int, bool] | None = None
    right_neighbour: tuple[int, bool] | None = None
    road: str = ""


@dataclass
class Sign:
    """A sign of priority at the end of a lane.

    Attributes:
        lane: Position of the lane in `Roads.lanes`.
        kind: What it says.
        line: Ends of the line before which vehicles stop [m], shape (2, 2); None: the end of the lane.
    """

    lane: int
    kind: SignKind
    line: Floats | None = None


@dataclass
class Light:
    """Traffic lights that show the same at the end of a lane.

    Attributes:
        name: Of the lights in the source; those with one name and the same cycle become one light.
        lane: Position of the lane in `Roads.lanes`.
        ways: Positions of the lanes that follow for which it counts; empty: all.
        phases: Signals and how long they last [s]; empty: the source does not say.
        begin: When the first phase begins [s], in the times of the source's tracks.
        repeats: The phases repeat; otherwise the last one lasts.
        line: Ends of the line before which vehicles stop [m], shape (2, 2); None: the end of the lane.
        turns_on_red: Drivers may turn right on red after stopping.
        turns: Turns for which it counts; empty: all.
        label: What tables of states call it; empty: the source does not say.
    """

    name: str
    lane: int
    ways: tuple[int, ...] = ()
    phases: tuple[tuple[Signal, float], ...] = ()
    begin: float = 0.0
    repeats: bool = True
    line: Floats | None = None
    turns_on_red: bool = False
    turns: frozenset[Turn] = frozenset()
    label: str = ""


@dataclass
class Roads:
    """The roads of a source. Lanelets get their ids in the order of the lanes.

    Attributes:
        lanes: All pieces of lanes that vehicles may drive, and crosswalks, whose type of lanelet is "crosswalk".
        links: Pairs of positions in `lanes`: the second begins where the first ends.
        signs: Signs of priority.
        lights: Traffic lights.
        left_hand: Whether vehicles drive on the left, as far as the source says; None: it does not.
        location: Where on earth it is, as the source says it, such as a PROJ string; empty: it does not.
    """

    lanes: list[Lane]
    links: list[tuple[int, int]] = field(default_factory=list)
    signs: list[Sign] = field(default_factory=list)
    lights: list[Light] = field(default_factory=list)
    left_hand: bool | None = None
    location: str = ""


@dataclass
class Tracks:
    """A recording, one row per track and time in any order; positions are the centres of footprints.

    Attributes:
        names: Name of each track in the source.
        kinds: One of `interdrive.scenario.KINDS` for each track.
        length: Of each track [m]; nan: the source states none, and the kind's default counts.
        width: The same across [m].
        is_round: Whether its footprint is a circle with the diameter `length`, for each track.
        is_static: Whether it stands for ever, for each track.
        track: Position of the row's track in `names`, shape (rows,).
        time: [s], with any origin, shape (rows,).
        x: Centre of the footprint [m]. y: The same [m].
        heading: [rad]; nan: not stated.
        speed: Along the heading [m/s]; nan: not stated.
        dt: Time between steps of the source, from which the scenario takes its own unless the user chooses one [s].
    """

    names: tuple[str, ...]
    kinds: tuple[str, ...]
    length: Floats
    width: Floats
    is_round: tuple[bool, ...]
    is_static: tuple[bool, ...]
    track: Ints
    time: Floats
    x: Floats
    y: Floats
    heading: Floats
    speed: Floats
    dt: float = 0.1


@dataclass(frozen=True)
class LightStates:
    """What a traffic light shows over time.

    Attributes:
        begin: When the first phase begins [s], in the times of the source's tracks.
        phases: Signals and how long they last [s]; the last one lasts.
        turns_on_red: Drivers may turn right on red after stopping.
    """

    begin: float
    phases: tuple[tuple[Signal, float], ...]
    turns_on_red: bool = False


@dataclass
class Source:
    """What a reader returns.

    Attributes:
        roads: None: the map is another file.
        tracks: None: there is no recording.
        notes: Remarks on both.
        map_options: Options with which that other file is read, unless the user chose them.
        light_states: What lights of that other file show, by their labels there.
    """

    roads: Roads | None
    tracks: Tracks | None = None
    notes: Notes = field(default_factory=Notes)
    map_options: dict[str, Any] = field(default_factory=dict)
    light_states: dict[str, LightStates] = field(default_factory=dict)
