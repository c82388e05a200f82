"""Whatever is missing, empty or wrong in a document: the message names file and element in the words of the format."""

from __future__ import annotations

import copy
import re
from xml.etree.ElementTree import fromstring, tostring

import pytest

from interdrive.errors import InputError
from interdrive.files.read import read_document

#: Words that only a programmer knows.
INTERNAL = re.compile(
    r"NoneType|None|object has no|(list|tuple) index|[A-Z]\w+Error|Exception|invalid literal|could not convert"
    r"|<class|<enum|argument must|\w\(\)|not subscriptable"
)


def exact(tag, value):
    return f"<{tag}><exact>{value}</exact></{tag}>"


def interval(tag, first, last):
    return f"<{tag}><intervalStart>{first}</intervalStart><intervalEnd>{last}</intervalEnd></{tag}>"


def point(x, y):
    return f"<point><x>{x}</x><y>{y}</y></point>"


def state(tag, step, x, more=""):
    place = f"<position>{point(x, 0)}</position>"
    return f"<{tag}>{place}{exact('orientation', 0)}{exact('time', step)}{exact('velocity', 5)}{more}</{tag}>"


def lanelet(number, first, last, more):
    bounds = [
        f"<{side}>{point(first, y)}{point(last, y)}<lineMarking>solid</lineMarking></{side}>"
        for side, y in (("leftBound", 2), ("rightBound", -2))
    ]
    return f'<lanelet id="{number}">{"".join(bounds)}{more}</lanelet>'


def document(version, body):
    about = 'author="a" affiliation="b" source="c" tags="urban" benchmarkID="DEU_Test-1_1_T-1" date="2020-01-01"'
    return f'<commonRoad timeStepSize="0.1" commonRoadVersion="{version}" {about}>{body}</commonRoad>'


RECTANGLE = "<rectangle><length>4</length><width>2</width></rectangle>"
CORNERS = f"<polygon>{point(10, 20)}{point(20, 20)}{point(20, 30)}</polygon>"
LINE = f"""<stopLine>{point(98, 2)}{point(98, -2)}<lineMarking>solid</lineMarking><trafficSignRef ref="20"/>
<trafficLightRef ref="21"/></stopLine>"""
OCCUPIED = f"<occupancySet><occupancy><shape>{RECTANGLE}</shape>{exact('time', 1)}</occupancy></occupancySet>"
START = state("initialState", 0, 3, exact("yawRate", 0) + exact("slipAngle", 0))
GOAL = f"""<goalState><position><lanelet ref="2"/></position>{interval("orientation", -1, 1)}{interval("time", 1, 90)}
{interval("velocity", 0, 20)}</goalState>"""
UNCERTAIN = f"<state><position>{RECTANGLE}</position>{interval('orientation', 0, 0.1)}{exact('time', 1)}</state>"

URBAN = "<laneletType>urban</laneletType>"

DOCUMENT_2020A = document(
    "2020a",
    f"""
{
        lanelet(
            1,
            0,
            100,
            f'<successor ref="2"/>{LINE}{URBAN}<userOneWay>car</userOneWay>'
            '<trafficSignRef ref="20"/><trafficLightRef ref="21"/>',
        )
    }
{
        lanelet(
            2,
            100,
            200,
            f'<predecessor ref="1"/>{URBAN}<userBidirectional>bus</userBidirectional>',
        )
    }
<trafficSign id="20"><trafficSignElement><trafficSignID>274</trafficSignID><additionalValue>13.9</additionalValue>
</trafficSignElement><position>{point(1, 1)}</position></trafficSign>
<trafficLight id="21"><cycle><cycleElement><duration>10</duration><color>red</color></cycleElement>
<timeOffset>3</timeOffset></cycle><position>{
        point(1, 1)
    }</position><direction>all</direction><active>true</active></trafficLight>
<intersection id="30"><incoming id="31"><incomingLanelet ref="1"/><successorsStraight ref="2"/></incoming>
<crossing><crossingLanelet ref="2"/></crossing></intersection>
<staticObstacle id="40"><type>parkedVehicle</type><shape><circle><radius>1</radius></circle></shape>
{state("initialState", 0, 60)}</staticObstacle>
<dynamicObstacle id="41"><type>car</type><shape>{RECTANGLE}</shape>{state("initialState", 0, 1)}
<trajectory>{state("state", 1, 1.5)}</trajectory></dynamicObstacle>
<dynamicObstacle id="42"><type>car</type><shape>{RECTANGLE}</shape>{state("initialState", 0, 30)}
<trajectory>{UNCERTAIN}</trajectory></dynamicObstacle>
<dynamicObstacle id="43"><type>car</type><shape>{RECTANGLE}</shape>{state("initialState", 0, 80)}{
        OCCUPIED
    }</dynamicObstacle>
<environmentObstacle id="44"><type>building</type><shape>{CORNERS}</shape></environmentObstacle>
<planningProblem id="50">{START}{GOAL}</planningProblem>""",
)
DOCUMENT_2018B = document(
    "2018b",
    f"""
{lanelet(1, 0, 100, '<successor ref="2"/><speedLimit>13.9</speedLimit>')}
{lanelet(2, 100, 200, '<predecessor ref="1"/>')}
<obstacle id="41"><role>dynamic</role><type>car</type><shape>{RECTANGLE}</shape>{state("initialState", 0, 1)}
<trajectory>{state("state", 1, 1.5)}</trajectory></obstacle>
<planningProblem id="50">{START}{GOAL}</planningProblem>""",
)  # fmt: skip


def broken(text):
    """Each element dropped, emptied, renamed, or with wrong contents; each attribute dropped or wrong."""
    whole = fromstring(text)
    for index, original in enumerate(whole.iter()):

        def copied(index=index):
            root = copy.deepcopy(whole)
            element = list(root.iter())[index]
            owner = next((one for one in root.iter() if element in list(one)), None)
            return root, element, owner

        root, element, owner = copied()
        if owner is not None:
            owner.remove(element)
            yield f"without {owner.tag}/{element.tag}", root
        root, element, _ = copied()
        if len(element):
            for child in list(element):
                element.remove(child)
            yield f"{element.tag} without children", root
        elif (original.text or "").strip():
            for wrong in ("", "abc", "1.5"):
                root, element, _ = copied()
                element.text = wrong
                yield f"{element.tag} with {wrong!r}", root
        for name in original.attrib:
            for wrong in (None, "abc"):
                root, element, _ = copied()
                element.attrib.pop(name) if wrong is None else element.set(name, wrong)
                yield f"{element.tag} with {name} {wrong!r}", root


@pytest.mark.parametrize("text", [DOCUMENT_2020A, DOCUMENT_2018B], ids=["2020a", "2018b"])
def test_messages_name_file_and_element_and_nothing_of_python(text):
    assert len(read_document(text.encode(), "map.xml").lanelets.ids) == 2
    refused = 0
    for what, root in broken(text):
        try:
            read_document(tostring(root), "map.xml")
        except InputError as error:
            message = str(error)
            refused += 1
            assert message.startswith("map.xml: "), what
            assert not INTERNAL.search(message), f"{what}: {message}"
            assert re.search(r"\d|<\w+>|commonRoad|dt|lanelets|CommonRoad", message), f"{what}: {message}"
            assert "\n" not in message
    assert refused > 50


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (point(98, -2) + "<lineM", "<lineM", "the stop line of lanelet 1 has 1 point; give it both ends, or none"),
        (point(98, -2) + "<lineM", point(98, -2) * 2 + "<lineM", "the stop line of lanelet 1 has 3 points"),
        ("<role>dynamic</role>", "", "obstacle 41 has no role static or dynamic; add it"),
        ("<duration>10</duration>", "<duration>ten</duration>", "'ten' is not a whole number"),
        ("<color>red</color>", "<color>blue</color>", "'blue' is no traffic light state"),
        ("<type>building</type>", "<type>castle</type>", "environmentObstacle 44 ('castle' is no obstacle type)"),
        ("<length>4</length>", "<length>4 m</length>", "the shape of obstacle 41 cannot be read"),
    ],
)
def test_a_mistake_is_said_in_the_words_of_the_format(old, new, message):
    text = next(one for one in (DOCUMENT_2020A, DOCUMENT_2018B) if old in one)
    with pytest.raises(InputError, match=re.escape(message)):
        read_document(text.replace(old, new, 1).encode(), "map.xml")


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("<lineMarking>solid</lineMarking><trafficSignRef", "<trafficSignRef"),
        (point(98, 2) + point(98, -2), ""),
        ("<additionalValue>13.9</additionalValue>", "<additionalValue/>"),
        ("<lanelet id", "<location><geoNameId>here</geoNameId></location><lanelet id"),
    ],
    ids=["stop line without marking", "stop line without points", "limit without value", "unknown place"],
)
def test_what_is_not_needed_may_be_missing(old, new):
    found = read_document(DOCUMENT_2020A.replace(old, new, 1).encode(), "map.xml")
    assert [line.lanelet_id for line in found.stop_lines] == [1]
