"""Junctions made by SUMO's netconvert: their lanes as a scenario, and which lane yields to which by SUMO's matrices.

Of every junction SUMO lists its connections, and for each the foes, whose ways it shares ground with, and those of them
that it responds to, that is, gives way to.
"""

from __future__ import annotations

import subprocess
import sys
import xml.etree.ElementTree as ET
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from interdrive.scenario import Lanelets
from interdrive.scenario.control import Priorities, StopLine, TrafficLight
from interdrive.testing import world

if TYPE_CHECKING:
    from collections.abc import Mapping

    from interdrive.scenario import Scenario

NETCONVERT = Path(sys.executable).with_name("netconvert")
#: Half the width of a lane [m].
HALF_WIDTH = 1.6
#: Where the arms of a junction lie.
PLACES = {"east": (100.0, 0.0), "north": (0.0, 100.0), "west": (-100.0, 0.0), "south": (0.0, -100.0)}
#: What a sign is worth for a turn to the left, straight on and to the right, by the kind of a minor arm.
YIELD, STOP, MAIN = (2, 2, 2), (1, 1, 1), (4, 5, 4)


@dataclass(frozen=True)
class Connection:
    """A way across the junction: from which arm, to which one, and its centre line [m]."""

    origin: str
    target: str
    turn: str
    points: np.ndarray

    @property
    def name(self) -> str:
        return f"{self.origin} to {self.target}"


@dataclass(frozen=True)
class Junction:
    """A junction as SUMO has it.

    Attributes:
        connections: In SUMO's order.
        foes: Which connections share ground, shape (connections, connections).
        yields: Row gives way to column, same shape.
        meet: Both may drive at once: always, but for those that lights keep apart; same shape.
        arms: Centre lines of the lanes that lead to it and away from it [m], by arms.
    """

    connections: tuple[Connection, ...]
    foes: np.ndarray
    yields: np.ndarray
    meet: np.ndarray
    arms: Mapping[str, tuple[np.ndarray, np.ndarray]]


def netconverted(folder: Path, arms: tuple[str, ...], kind: str, main: tuple[str, ...], left_hand: bool) -> Junction:
    """A junction of arms with one lane per direction; `kind` is SUMO's type, `main` the arms with priority."""
    nodes = "".join(f'<node id="{arm}" x="{PLACES[arm][0]}" y="{PLACES[arm][1]}"/>' for arm in arms)
    (folder / "net.nod.xml").write_text(f'<nodes><node id="middle" x="0" y="0" type="{kind}"/>{nodes}</nodes>')
    edges = "".join(
        f'<edge id="{arm}_{way}" from="{a}" to="{b}" numLanes="1" speed="13.89" priority="{2 if arm in main else 1}"/>'
        for arm in arms
        for way, a, b in (("in", arm, "middle"), ("out", "middle", arm))
    )
    (folder / "net.edg.xml").write_text(f"<edges>{edges}</edges>")
    command = [
        str(NETCONVERT), "--node-files", "net.nod.xml", "--edge-files", "net.edg.xml", "--output-file", "net.net.xml",
        "--no-turnarounds", "true", "--offset.disable-normalization", "true", "--lefthand", str(left_hand).lower(),
    ]  # fmt: skip
    subprocess.run(command, cwd=folder, check=True, capture_output=True, timeout=60)
    return _read(ET.parse(folder / "net.net.xml").getroot(), arms)


def _read(net: ET.Element, arms: tuple[str, ...]) -> Junction:
    shapes = {lane.attrib["id"]: _points(lane.attrib["shape"]) for lane in net.iter("lane")}
    after = {f"{one.attrib['from']}_0": one.attrib.get("via") for one in net.iter("connection")}
    junction = next(one for one in net.iter("junction") if one.attrib["id"] == "middle")
    by_first_lane = {one.attrib.get("via"): one for one in net.iter("connection") if one.attrib["from"][0] != ":"}
    found, links = [], []
    for lane in junction.attrib["intLanes"].split():
        # A left turn that waits within the junction has two internal lanes; the junction lists the last one.
        first = next(name for name in by_first_lane if lane in (name, after.get(name)))
        chain = [first, lane] if first != lane else [lane]
        connection = by_first_lane[first].attrib
        links.append(int(connection.get("linkIndex", -1)))
        origin, target = connection["from"].split("_")[0], connection["to"].split("_")[0]
        points = np.vstack([shapes[name] for name in chain])
        found.append(Connection(origin, target, connection["dir"], _resampled(points)))
    n = len(found)
    rows = {int(row.attrib["index"]): row.attrib for row in junction.iter("request")}
    # The strings are bit masks: their last character is the first connection.
    matrix = {
        name: np.array([[bit == "1" for bit in reversed(rows[i][name])] for i in range(n)])
        for name in ("foes", "response")
    }
    meet = np.ones((n, n), dtype=bool)
    for logic in net.iter("tlLogic"):
        green = np.array([[phase.attrib["state"][link] in "gG" for link in links] for phase in logic.iter("phase")])
        meet = (green[:, :, None] & green[:, None, :]).any(axis=0)
    lanes = {arm: (_resampled(shapes[f"{arm}_in_0"]), _resampled(shapes[f"{arm}_out_0"])) for arm in arms}
    return Junction(tuple(found), matrix["foes"], matrix["response"], meet, lanes)


def _points(shape: str) -> np.ndarray:
    return np.array([[float(value) for value in point.split(",")[:2]] for point in shape.split()])


def _resampled(points: np.ndarray) -> np.ndarray:
    """A line with a point every half metre; points that SUMO has twice are left out."""
    kept = np.append(True, np.hypot(*np.diff(points, axis=0).T) > 1e-6)
    points = points[kept]
    s = np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))
    at = np.linspace(0.0, s[-1], max(3, int(2.0 * s[-1])))
    return np.column_stack([np.interp(at, s, axis) for axis in points.T])


def as_scenario(
    junction: Junction, ranks: Mapping[str, tuple[int, int, int]], *, lights: bool, left_hand: bool
) -> Scenario:
    """The lanes as lanelets: connection i has id i + 1, the arms follow. Signs by arms; lights at all of them."""
    names = list(junction.arms)
    n = len(junction.connections)
    way_in = {arm: n + 1 + k for k, arm in enumerate(names)}
    way_out = {arm: n + 1 + len(names) + k for k, arm in enumerate(names)}
    centers = [one.points for one in junction.connections]
    centers += [junction.arms[arm][0] for arm in names] + [junction.arms[arm][1] for arm in names]
    inside = range(n)
    predecessors = [(way_in[one.origin],) for one in junction.connections] + [()] * len(names)
    predecessors += [tuple(i + 1 for i in inside if junction.connections[i].target == arm) for arm in names]
    successors = [(way_out[one.target],) for one in junction.connections]
    successors += [tuple(i + 1 for i in inside if junction.connections[i].origin == arm) for arm in names]
    successors += [()] * len(names)
    bounds = [_bounds(center) for center in centers]
    size = len(centers)
    none, no = np.full(size, -1), np.zeros(size, dtype=bool)
    lanelets = Lanelets(
        np.arange(1, size + 1), tuple(left for left, _ in bounds), tuple(right for _, right in bounds),
        tuple(predecessors), tuple(successors), none, no, none, no, np.full(size, 13.89), ((),) * size,
    )  # fmt: skip
    scenario = replace(
        world(lanelets),
        priorities=Priorities(
            ranks=tuple((way_in[arm], rank) for arm, rank in ranks.items()),
            left_hand=left_hand,
            priority_side="left" if left_hand else "right",
        ),
    )
    if not lights:
        return scenario
    lines = tuple(
        StopLine(
            way_in[arm],
            np.array([bound[-1] for bound in bounds[way_in[arm] - 1]]),
            tuple((following, (900,)) for following in successors[way_in[arm] - 1]),
        )
        for arm in names
    )
    return replace(scenario, stop_lines=lines, traffic_lights=(TrafficLight(900, (("green", 10),)),))


def _bounds(center: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    along = np.gradient(center, axis=0)
    aside = HALF_WIDTH * np.column_stack([-along[:, 1], along[:, 0]]) / np.hypot(*along.T)[:, None]
    return center + aside, center - aside
