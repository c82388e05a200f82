"""Valid documents to start from: small ones that hold every element of the format, and the shipped scenarios."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import commonroad_documents as cr

from interdrive.files import shipped_scenario

if TYPE_CHECKING:
    from pathlib import Path

#: Shipped scenarios that are small enough to be driven many times.
SHIPPED = ("t_junction", "lane_merge")

_LIGHT = (
    '<trafficLight id="900"><cycle><cycleElement><duration>50</duration><color>red</color></cycleElement>'
    "<cycleElement><duration>30</duration><color>green</color></cycleElement><timeOffset>7</timeOffset></cycle>"
    f"<position>{cr.point(50, 3)}</position><direction>all</direction><active>true</active></trafficLight>"
)
_SIGN = (
    '<trafficSign id="901"><trafficSignElement><trafficSignID>274</trafficSignID>'
    "<additionalValue>13.9</additionalValue></trafficSignElement>"
    f"<position>{cr.point(10, -3)}</position><virtual>false</virtual></trafficSign>"
)
_INTERSECTION = (
    '<intersection id="902"><incoming id="903"><incomingLanelet ref="1"/><successorsStraight ref="2"/></incoming>'
    "</intersection>"
)
_STOP_LINE = (
    f"<stopLine>{cr.point(48, 2)}{cr.point(48, -2)}<lineMarking>solid</lineMarking>"
    '<trafficLightRef ref="900"/></stopLine>'
)
_LOCATION = (
    "<location><geoNameId>1</geoNameId><gpsLatitude>48.1</gpsLatitude><gpsLongitude>11.5</gpsLongitude></location>"
)


def _bend(number: int, more: str) -> str:
    left, right = ((50, 2), (60, 3), (70, 6), (80, 11)), ((50, -2), (61, -1), (72, 2), (83, 8))
    return cr.lanelet(number, left=left, right=right, more=more)


def _lanelets() -> str:
    """A straight lanelet, a bend after it, a neighbour on either side, one of them oncoming."""
    types = "<laneletType>urban</laneletType><userOneWay>car</userOneWay>"
    marks = '<trafficSignRef ref="901"/><trafficLightRef ref="900"/>'
    relations = '<successor ref="2"/><adjacentLeft ref="3" drivingDir="opposite"/>'
    right = '<adjacentRight ref="4" drivingDir="same"/>'
    return "".join(
        (
            cr.lanelet(
                1,
                left=((0, 2), (25, 2), (50, 2)),
                right=((0, -2), (25, -2), (50, -2)),
                more=relations + right + _STOP_LINE + types + marks,
            ),
            _bend(2, '<predecessor ref="1"/><laneletType>urban</laneletType>'),
            cr.lanelet(
                3,
                left=((50, 2), (0, 2)),
                right=((50, 6), (0, 6)),
                more='<adjacentLeft ref="1" drivingDir="opposite"/><laneletType>urban</laneletType>',
            ),
            cr.lanelet(
                4,
                left=((0, -2), (50, -2)),
                right=((0, -6), (50, -6)),
                more='<adjacentLeft ref="1" drivingDir="same"/><laneletType>urban</laneletType>',
            ),
        )
    )


def _obstacles(*, with_sets: bool = True) -> str:
    drive = [cr.state(k, 5.0 + k, 0.0, orientation=0.0, velocity=10.0, acceleration=0.0) for k in range(1, 41)]
    oncoming = [cr.state(k, 48.0 - 0.8 * k, 4.0, orientation=3.14159, velocity=8.0) for k in range(1, 41)]
    walk = [cr.state(k, 40.0, -5.0 + 0.1 * k) for k in range(1, 30)]
    truck = "<rectangle><length>12</length><width>2.5</width><orientation>0.0</orientation>"
    circle = "<circle><radius>0.4</radius></circle>"
    triangle = f"<polygon>{cr.point(2, 0)}{cr.point(-2, 1)}{cr.point(-2, -1)}</polygon>"
    parked = f"<shape>{cr.RECTANGLE}</shape>{cr.initial(20.0, -4.0, velocity=None)}"
    box = "<occupancySet><occupancy><shape><circle><radius>1.0</radius></circle></shape>"
    occupied = f"{box}<time><exact>1</exact></time></occupancy></occupancySet>"
    uncertain = cr.state(1, 0, position=cr.rectangle_at(31, -4, length=1, width=1), velocity=(3.0, 5.0))
    by_set = cr.car(75, cr.initial(45.0, -4.0, velocity=0.0), prediction=occupied) if with_sets else ""
    return by_set + "".join(
        (
            f'<staticObstacle id="70"><type>parkedVehicle</type>{parked}</staticObstacle>',
            cr.car(71, cr.initial(5.0), drive),
            cr.car(
                72, cr.initial(48.0, 4.0, orientation=3.14159, velocity=8.0), oncoming, shape=f"{truck}</rectangle>"
            ),
            cr.car(73, cr.initial(40.0, -5.0, velocity=1.0, orientation=1.57), walk, shape=circle, kind="pedestrian"),
            cr.car(74, cr.initial(30.0, -4.0, velocity=4.0), (uncertain,), shape=triangle, kind="bicycle"),
        )
    )


def _problems() -> str:
    area = cr.rectangle_at(40.0, 0.0, length=10.0, width=4.0)
    return "".join(
        (
            cr.planning_problem(80, cr.goal(position=area, time=(20, 60), velocity=(0.0, 15.0))),
            cr.planning_problem(
                81,
                cr.goal(position='<lanelet ref="2"/>', time=(0, 90), orientation=(-0.5, 1.5)),
                start=cr.initial(2.0, -4.0, velocity=7.0, yawRate=0.0, slipAngle=0.0),
            ),
        )
    )


def _rich(obstacles: str) -> str:
    return cr.document(_SIGN + _LIGHT + _INTERSECTION + obstacles + _problems(), lanelets=_LOCATION + _lanelets())


@cache
def to_be_protobuf() -> tuple[bytes, ...]:
    """Documents that commonroad-io can write as protobuf, so without set-based predictions."""
    return (_rich(_obstacles(with_sets=False)).encode(), shipped_scenario("lane_merge").read_bytes())


@cache
def documents() -> tuple[bytes, ...]:
    """Well-formed documents in a fixed order, all of which are accepted."""
    rich = _rich(_obstacles())
    limit = cr.lanelet(1, more="<speedLimit>13.9</speedLimit>")
    drive = [cr.state(k, 5.0 + k, 0.0, orientation=0.0, velocity=10.0) for k in range(1, 30)]
    goal = cr.planning_problem(80, cr.goal(position='<lanelet ref="1"/>', velocity=(0.0, 20.0)))
    old = cr.document(cr.car(71, cr.initial(5.0), drive) + goal, version="2018b", lanelets=limit)
    plain = cr.document(cr.car(71, cr.initial(5.0), drive))
    shipped = [shipped_scenario(name).read_bytes() for name in SHIPPED]
    return (rich.encode(), rich.encode(), old.encode(), plain.encode(), *shipped)


def further(folder: Path) -> tuple[bytes, ...]:
    """Small well-formed XML files of a folder as further seeds, sorted by name."""
    from xml.etree.ElementTree import ParseError, fromstring

    found = []
    for path in sorted(folder.rglob("*.xml")):
        if path.stat().st_size > 200_000:
            continue
        data = path.read_bytes()
        try:
            fromstring(data)
        except (ParseError, ValueError, LookupError):
            continue
        found.append(data)
    return tuple(found)
