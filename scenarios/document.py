"""A made scenario as a CommonRoad 2020a document, one line per state."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from network import Incoming, Lanelet, Light, Network, Sign, rounded
from traffic import DT, Vehicle

#: Ids: lanelets from 1 (or beyond all others), then the speed sign, intersections, signs, lights; then vehicles, and
#: planning problems.
SPEED_SIGN_ID = 900
INTERSECTION_ID = 901
FIRST_SIGN_ID = 931
FIRST_LIGHT_ID = 951
FIRST_VEHICLE_ID = 1001
PLANNING_PROBLEM_ID = 2001


@dataclass(frozen=True)
class Goal:
    """Where a planning problem ends: lanelets, or a rectangle (x, y, heading, length, width); steps; speeds [m/s]."""

    time_step: tuple[int, int]
    lanelets: tuple[int, ...] = ()
    rectangle: tuple[float, float, float, float, float] | None = None
    velocity: tuple[float, float] | None = None


@dataclass(frozen=True)
class Made:
    """Everything that goes into a file; the vehicle of a planning problem gives it its start and is not recorded."""

    benchmark_id: str
    tags: tuple[str, ...]
    network: Network
    vehicles: list[Vehicle]
    problems: list[tuple[Vehicle, Goal]]


def document(made: Made) -> str:
    """The document."""
    network = made.network
    lines = [
        "<?xml version='1.0' encoding='UTF-8'?>",
        (
            f'<commonRoad timeStepSize="{DT}" commonRoadVersion="2020a" author="interdrive" affiliation="interdrive" '
            f'source="made by scenarios/make.py" benchmarkID="{made.benchmark_id}" date="2026-01-01">'
        ),
        "<location><geoNameId>-999</geoNameId><gpsLatitude>999</gpsLatitude><gpsLongitude>999</gpsLongitude></location>",
        f"<scenarioTags>{''.join(f'<{tag}/>' for tag in made.tags)}</scenarioTags>",
    ]
    light_of = {number: FIRST_LIGHT_ID + i for i, light in enumerate(network.lights) for number in light.lanelets}
    sign_of = {number: FIRST_SIGN_ID + i for i, sign in enumerate(network.signs) for number in sign.lanelets}
    for number, lanelet in sorted(network.lanelets.items()):
        lines.append(_lanelet(lanelet, light_of.get(number), sign_of.get(number)))
    lines.append(_speed_sign(network))
    lines += [_sign(FIRST_SIGN_ID + i, sign) for i, sign in enumerate(network.signs)]
    lines += [_light(FIRST_LIGHT_ID + i, light) for i, light in enumerate(network.lights)]
    number = INTERSECTION_ID
    for incomings in network.intersections:
        lines.append(_intersection(number, incomings))
        number += 1 + len(incomings)
    lines += [_vehicle(FIRST_VEHICLE_ID + index, vehicle) for index, vehicle in enumerate(made.vehicles)]
    lines += [_planning_problem(PLANNING_PROBLEM_ID + index, *one) for index, one in enumerate(made.problems)]
    lines += ["</commonRoad>", ""]
    return "\n".join(lines)


def _number(value: float) -> str:
    return f"{float(rounded(np.array(value))):.4f}".rstrip("0").rstrip(".")


def _exact(tag: str, value: float) -> str:
    return f"<{tag}><exact>{_number(value)}</exact></{tag}>"


def _point(x: float, y: float, tag: str = "point") -> str:
    return f"<{tag}><x>{_number(x)}</x><y>{_number(y)}</y></{tag}>"


def _lanelet(lanelet: Lanelet, light: int | None, sign: int | None) -> str:
    parts = [f'<lanelet id="{lanelet.id}">']
    for tag, bound, marking in zip(
        ("leftBound", "rightBound"), (lanelet.left, lanelet.right), lanelet.markings, strict=True
    ):
        points = "".join(_point(x, y) for x, y in bound.tolist())
        parts.append(f"<{tag}>{points}<lineMarking>{marking}</lineMarking></{tag}>")
    parts += [f'<predecessor ref="{number}"/>' for number in lanelet.predecessors]
    parts += [f'<successor ref="{number}"/>' for number in lanelet.successors]
    for tag, adjacent in (("adjacentLeft", lanelet.adjacent_left), ("adjacentRight", lanelet.adjacent_right)):
        if adjacent is not None:
            parts.append(f'<{tag} ref="{adjacent[0]}" drivingDir="{"same" if adjacent[1] else "opposite"}"/>')
    ref = "" if light is None else f'<trafficLightRef ref="{light}"/>'
    if ref:
        parts.append(f"<stopLine><lineMarking>solid</lineMarking>{ref}</stopLine>")
    parts += [f"<laneletType>{kind}</laneletType>" for kind in lanelet.kinds]
    own = "" if sign is None else f'<trafficSignRef ref="{sign}"/>'
    parts += [f'<trafficSignRef ref="{SPEED_SIGN_ID}"/>{own}{ref}', "</lanelet>"]
    return "\n".join(parts)


def _speed_sign(network: Network) -> str:
    x, y = network.lanelets[min(network.lanelets)].right[0]
    element = f"<trafficSignID>274</trafficSignID><additionalValue>{network.speed_limit:.4f}</additionalValue>"
    return (
        f'<trafficSign id="{SPEED_SIGN_ID}"><trafficSignElement>{element}</trafficSignElement>'
        f"<position>{_point(x, y)}</position><virtual>true</virtual></trafficSign>"
    )


def _sign(number: int, sign: Sign) -> str:
    element = f"<trafficSignElement><trafficSignID>{sign.code}</trafficSignID></trafficSignElement>"
    position = f"<position>{_point(*sign.position)}</position>"
    return f'<trafficSign id="{number}">{element}{position}<virtual>false</virtual></trafficSign>'


def _light(number: int, light: Light) -> str:
    phases = "".join(
        f"<cycleElement><duration>{length}</duration><color>{colour}</color></cycleElement>"
        for colour, length in light.phases
    )
    return (
        f'<trafficLight id="{number}"><cycle>{phases}<timeOffset>{light.offset}</timeOffset></cycle>'
        f"<position>{_point(*light.position)}</position><direction>all</direction><active>true</active></trafficLight>"
    )


def _intersection(number: int, incomings: list[Incoming]) -> str:
    parts = [f'<intersection id="{number}">']
    for index, incoming in enumerate(incomings, start=1):
        parts.append(f'<incoming id="{number + index}">')
        for tag, numbers in (
            ("incomingLanelet", incoming.lanelets),
            ("successorsRight", incoming.right),
            ("successorsStraight", incoming.straight),
            ("successorsLeft", incoming.left),
        ):
            parts += [f'<{tag} ref="{lanelet}"/>' for lanelet in numbers]
        parts.append("</incoming>")
    return "\n".join([*parts, "</intersection>"])


def _vehicle(number: int, vehicle: Vehicle) -> str:
    size = f"<length>{_number(vehicle.length)}</length><width>{_number(vehicle.width)}</width>"
    states = [_state(vehicle, step) for step in range(len(vehicle.x))]
    return "\n".join(
        [
            f'<dynamicObstacle id="{number}"><type>{vehicle.kind}</type><shape><rectangle>{size}</rectangle></shape>',
            f"<initialState>{states[0]}</initialState>",
            "<trajectory>",
            *(f"<state>{state}</state>" for state in states[1:]),
            "</trajectory></dynamicObstacle>",
        ]
    )


def _state(vehicle: Vehicle, step: int) -> str:
    heading = np.arctan2(np.sin(vehicle.heading[step]), np.cos(vehicle.heading[step]))
    return (
        f"<position>{_point(vehicle.x[step], vehicle.y[step])}</position>{_exact('orientation', heading)}"
        f"<time><exact>{step}</exact></time>{_exact('velocity', vehicle.speed[step])}"
    )


def _planning_problem(number: int, ego: Vehicle, goal: Goal) -> str:
    if goal.rectangle is None:
        area = "".join(f'<lanelet ref="{lanelet}"/>' for lanelet in goal.lanelets)
    else:
        x, y, heading, length, width = goal.rectangle
        area = (
            f"<rectangle><length>{_number(length)}</length><width>{_number(width)}</width>"
            f"<orientation>{_number(heading)}</orientation>{_point(x, y, 'center')}</rectangle>"
        )
    first, last = goal.time_step
    time = f"<time><intervalStart>{first}</intervalStart><intervalEnd>{last}</intervalEnd></time>"
    velocity = ""
    if goal.velocity is not None:
        slow, fast = (_number(value) for value in goal.velocity)
        velocity = f"<velocity><intervalStart>{slow}</intervalStart><intervalEnd>{fast}</intervalEnd></velocity>"
    return (
        f'<planningProblem id="{number}"><initialState>{_state(ego, 0)}'
        f"{_exact('yawRate', 0.0)}{_exact('slipAngle', 0.0)}</initialState>\n"
        f"<goalState><position>{area}</position>{time}{velocity}</goalState></planningProblem>"
    )
