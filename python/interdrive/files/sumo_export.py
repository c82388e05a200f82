"""Runs for SUMO: floating car data, and the agents as vehicles of SUMO on the edges that they drove."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from interdrive.files.sources.opening import SourceFile

if TYPE_CHECKING:
    from collections.abc import Iterator

    from interdrive.array_types import Floats
    from interdrive.run import RunRecord
    from interdrive.scenario import SumoTraffic

#: A vehicle is on a lane whose middle is this near [m], if it heads along it within this angle [rad].
_ON_LANE, _ALONG = 2.5, 1.0
#: SUMO's classes by kinds.
_CLASSES = {
    "car": "passenger", "truck": "truck", "bus": "bus", "motorcycle": "motorcycle", "bicycle": "bicycle",
    "taxi": "taxi", "priority_vehicle": "emergency", "train": "tram", "pedestrian": "pedestrian",
}  # fmt: skip


def sumo_files(run: RunRecord) -> dict[str, bytes]:
    """Files for SUMO by name.

    `fcd.xml` is SUMO's format of floating car data: front, angle and speed of all participants at every time. If SUMO
    drove traffic in the run, `agents.rou.xml` holds the agents as its own vehicles, where and when they began.
    """
    made = {"fcd.xml": _written(_car_data(run))}
    if run.scenario.sumo is not None:
        made["agents.rou.xml"] = _written(_routes(run, run.scenario.sumo))
    return made


def _written(root: Element) -> bytes:
    indent(root)
    text: bytes = tostring(root, encoding="utf-8", xml_declaration=True)
    return text + b"\n"


def _car_data(run: RunRecord) -> Element:
    states, dt = run.states, run.scenario.dt
    dx, dy = (0.0, 0.0) if run.scenario.sumo is None else run.scenario.sumo.offset
    root = Element("fcd-export")
    for step in range(states.n_steps):
        at = SubElement(root, "timestep", time=f"{(step + states.first_time_step) * dt:.2f}")
        for row in np.flatnonzero(states.valid[:, step] & ~states.is_static).tolist():
            x, y = _front(run, row, step)
            name = "person" if states.kinds[row] == "pedestrian" else "vehicle"
            SubElement(
                at,
                name,
                id=str(states.participant_id[row]),
                x=f"{x + dx:.3f}",
                y=f"{y + dy:.3f}",
                angle=f"{math.degrees(0.5 * math.pi - states.orientation[row, step]) % 360.0:.3f}",
                type=_CLASSES.get(states.kinds[row], "custom1"),
                speed=f"{states.velocity[row, step]:.3f}",
            )
    return root


def _front(run: RunRecord, row: int, step: int) -> tuple[float, float]:
    states = run.states
    half, heading = 0.5 * float(states.length[row]), float(states.orientation[row, step])
    return float(states.x[row, step]) + half * math.cos(heading), float(states.y[row, step]) + half * math.sin(heading)


@dataclass(frozen=True)
class _Lane:
    edge: str
    index: int
    shape: Floats


def _routes(run: RunRecord, sumo: SumoTraffic) -> Element:
    """Agents in the order in which they begin, as SUMO wants them."""
    lanes = list(_lanes(sumo))
    root, vehicles = Element("routes"), []
    for agent in run.agents:
        row = int(np.searchsorted(run.states.participant_id, agent.id))
        steps = np.flatnonzero(run.states.valid[row]).tolist()
        places = [_place(run, sumo, lanes, row, step) for step in steps]
        known = [place for place in places if place is not None]
        if not known:
            continue
        edges: list[str] = []
        for lane, _ in known:
            if not edges or edges[-1] != lane.edge:
                edges.append(lane.edge)
        begin = next(step for step, place in zip(steps, places, strict=True) if place is not None)
        vehicles.append((begin, row, known[0], edges))
    for begin, row, (lane, along), edges in sorted(vehicles, key=lambda one: one[:2]):
        name = str(run.states.participant_id[row])
        SubElement(
            root,
            "vType",
            id=f"agent_{name}",
            vClass=_CLASSES.get(run.states.kinds[row], "passenger"),
            length=f"{run.states.length[row]:.3f}",
            width=f"{run.states.width[row]:.3f}",
        )
        vehicle = SubElement(
            root,
            "vehicle",
            id=f"agent_{name}",
            type=f"agent_{name}",
            depart=f"{begin * run.scenario.dt:.2f}",
            departLane=str(lane.index),
            departPos=f"{along:.2f}",
            departSpeed=f"{max(0.0, run.states.velocity[row, begin]):.2f}",
        )
        SubElement(vehicle, "route", edges=" ".join(edges))
    return root


def _lanes(sumo: SumoTraffic) -> Iterator[_Lane]:
    """Lanes of edges, but none inside junctions."""
    for name, content in sumo.files:
        document = SourceFile.within(Path(name), content).document()
        if document.tag != "net":
            continue
        for edge in document.iterfind("edge"):
            if edge.get("function"):
                continue
            for lane in edge.iterfind("lane"):
                points = [[float(part) for part in point.split(",")[:2]] for point in lane.get("shape", "").split()]
                yield _Lane(edge.get("id", ""), int(lane.get("index", "0")), np.array(points))


def _place(run: RunRecord, sumo: SumoTraffic, lanes: list[_Lane], row: int, step: int) -> tuple[_Lane, float] | None:
    """The lane that a vehicle is on, and how far its front is along it [m]."""
    x, y = _front(run, row, step)
    front = np.array([x + sumo.offset[0], y + sumo.offset[1]])
    heading = float(run.states.orientation[row, step])
    best, least = None, _ON_LANE
    for lane in lanes:
        sides = np.diff(lane.shape, axis=0)
        lengths = np.hypot(*sides.T)
        offsets = front - lane.shape[:-1]
        share = np.clip((offsets * sides).sum(axis=1) / np.maximum(lengths, 1e-9) ** 2, 0.0, 1.0)
        apart = np.hypot(*(offsets - share[:, None] * sides).T)
        near = int(apart.argmin())
        turned = math.remainder(heading - math.atan2(sides[near, 1], sides[near, 0]), math.tau)
        if apart[near] < least and abs(turned) < _ALONG:
            best, least = (lane, float(lengths[:near].sum() + share[near] * lengths[near])), float(apart[near])
    return best
