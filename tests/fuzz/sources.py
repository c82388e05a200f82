"""Mutants of maps and recordings of other tools: small ones made here, cut, shuffled, with other numbers and bytes."""

from __future__ import annotations

import gzip
import json
import re
import tempfile
from functools import cache
from pathlib import Path
from random import Random

import foreign_files as ff
import opendrive_documents as xodr
import sind_files
from tests.fuzz.mutants import Mutant
from tests.fuzz.numbers import text_of_number

#: A number in a text, as attributes, JSON and CSV hold it.
_NUMBER = re.compile(rb"(?<![\w.])-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\w.])")
#: An element without children, a row, or an object of JSON.
_PARTS = (re.compile(rb"<\w+[^<>]*/>"), re.compile(rb"(?<=\n)[^\n<]+\n"), re.compile(rb"\{[^{}]*\}"))
_ATTRIBUTE = re.compile(rb' \w+="[^"]*"|"\w+": ?')
_WORDS = (b"", b"nan", b"-", b"\xff", b"<", b'"', b",", b"\n", b"a" * 3000, b"{}", b"[]", b"null", b"true", b"0" * 400)


def _opendrive() -> bytes:
    widths = '<width sOffset="0" a="3" b="0" c="0.003" d="-0.0001"/><width sOffset="20" a="3.4" b="0" c="0" d="0"/>'
    marks = '<roadMark sOffset="0" type="broken solid" weight="bold"/><speed sOffset="0" max="50" unit="km/h"/>'
    lanes = (
        '<laneOffset s="0" a="0.5" b="0.01" c="0" d="0"/>'
        + xodr.section(xodr.lane(1, before=1), xodr.lane(0, more=marks), xodr.lane(-1, width=widths, after=-1))
        + xodr.section(
            xodr.lane(1, after=1, more=marks),
            xodr.lane(0),
            xodr.lane(-1, before=-1, width='<border sOffset="0" a="-3.4" b="0" c="0" d="0"/>'),
            xodr.lane(-2, kind="bus"),
            s=40.0,
        )
    )
    shapes = (
        xodr.geometry("<line/>", 20.0)
        + xodr.geometry('<spiral curvStart="0" curvEnd="0.02"/>', 20.0, s=20.0, x=20.0)
        + xodr.geometry('<arc curvature="0.02"/>', 20.0, s=40.0, x=39.9, y=1.3, heading=0.2)
        + xodr.geometry('<poly3 a="0" b="0" c="0.002" d="0"/>', 10.0, s=60.0, x=58.0, y=9.0, heading=0.6)
    )
    cubic = '<paramPoly3 pRange="normalized" aU="0" bU="30" cU="0" dU="0" aV="0" bV="0" cV="4" dV="-1"/>'
    banked = '<type s="0" type="town"><speed max="30" unit="mph"/></type><lateralProfile>'
    banked += '<superelevation s="0" a="0.05" b="0" c="0" d="0"/></lateralProfile>'
    junction = (
        '<junction id="9"><connection id="0" incomingRoad="1" connectingRoad="2" contactPoint="start">'
        '<laneLink from="-1" to="-1"/></connection></junction>'
    )
    return xodr.document(
        xodr.road(1, shapes, lanes, length=70.0, more=banked + _SIGNALS, after='elementType="junction" elementId="9"'),
        xodr.road(
            2, xodr.geometry(cubic, 30.6, x=66.0, y=15.0, heading=0.6), xodr.section(xodr.lane(0), xodr.lane(-1)),
            length=30.6, junction=9, rule="RHT",
        ),
        junction,
        header='<geoReference>+proj=utm +zone=32</geoReference><offset x="5" y="0"/>',
    ).encode()  # fmt: skip


_SIGNALS = """<objects><object id="7" type="crosswalk" s="30" t="0" hdg="1.57"><outline><cornerLocal u="4" v="1"/>
<cornerLocal u="4" v="-1"/><cornerLocal u="-4" v="-1"/><cornerLocal u="-4" v="1"/></outline></object>
<object id="8" type="crosswalk" s="50" t="0" length="3" width="8"/></objects>
<signals><signal id="1" s="60" t="-4" orientation="+" type="206" dynamic="no"/>
<signal id="2" s="58" t="-2" orientation="+" type="294" dynamic="no"/>
<signal id="3" s="5" t="3" orientation="-" type="205" country="DE"><validity fromLane="1" toLane="1"/></signal>
<signal id="4" s="0" t="-4" orientation="+" type="274" value="50" unit="km/h"/>
<signalReference id="3" s="3" t="0" orientation="+"/></signals>"""
_NET = """<net version="1.20"><location netOffset="10.00,0.00"/>
<edge id=":b_0" function="internal"><lane id=":b_0_0" index="0" speed="8.0" shape="100.00,-1.60 106.00,-1.60"/></edge>
<edge id=":b_c0" function="crossing"><lane id=":b_c0_0" index="0" speed="1" width="4" shape="96,2 96,-4"/></edge>
<edge id="in" from="a" to="b">
<lane id="in_0" index="0" speed="13.9" width="2.0" allow="bicycle" shape="0.00,-7.40 100.00,-7.40"/>
<lane id="in_1" index="1" speed="13.9" shape="0.00,-4.80 50.00,-4.90 100.00,-4.80"/>
<lane id="in_2" index="2" speed="13.9" shape="0.00,-1.60 100.00,-1.60"/></edge>
<edge id="back" from="b" to="a"><lane id="back_0" index="0" speed="13.9" shape="100.00,1.60 0.00,1.60"/></edge>
<edge id="out" from="b" to="c"><lane id="out_0" index="0" speed="16.7" shape="106.00,-1.60 200.00,-1.60"/></edge>
<tlLogic id="b" type="static" programID="0" offset="5"><phase duration="30" state="Gr"/><phase duration="3" state="yr"/>
<phase duration="27" state="rs"/></tlLogic><junction id="b" type="priority"/>
<connection from="in" to="out" fromLane="2" toLane="0" via=":b_0_0" tl="b" linkIndex="0" dir="s" state="o"/>
<connection from="in" to="out" fromLane="1" toLane="0" dir="r" state="m"/>
<connection from=":b_0" to="out" fromLane="0" toLane="0"/></net>
"""


_RULES = """<way id="900"><nd ref="1"/><nd ref="2"/><tag k="type" v="stop_line"/></way>
<relation id="901"><member type="way" role="ref_line" ref="900"/><tag k="type" v="regulatory_element"/>
<tag k="subtype" v="traffic_light"/></relation>
<relation id="902"><member type="relation" role="yield" ref="201"/><member type="way" role="ref_line" ref="900"/>
<tag k="type" v="regulatory_element"/><tag k="subtype" v="right_of_way"/></relation>
<relation id="903"><member type="relation" role="yield" ref="204"/><tag k="type" v="regulatory_element"/>
<tag k="subtype" v="all_way_stop"/></relation></osm>"""


def _lanelet2() -> bytes:
    text: str = ff.lanelet2(local=False)
    return text.replace("</osm>", _RULES).encode()


def _scene() -> dict[str, object]:
    """A scene with a light, a stop sign at a lane's end, and a crosswalk."""
    scene = ff.womd()
    words = ["unknown", "arrow_stop", "arrow_stop", "go", "caution"]
    scene["tl_states"] = {"3": {"state": words, "time_index": [0, 1, 2, 3, 4], "x": [60.0], "y": [1.75]}}
    for kind, points in (("stop_sign", [(59, -1)]), ("crosswalk", [(40, -1), (43, -1), (43, 8), (40, 8)])):
        geometry = [{"x": float(x), "y": float(y), "z": 0.0} for x, y in points]
        scene["roads"].append({"type": kind, "geometry": geometry, "map_element_id": 18, "id": 50})
    return scene


@cache
def formats() -> dict[str, tuple[dict[str, bytes], str, dict[str, str]]]:
    """Files, name of the one that is opened ("": the folder), and options, for each format."""
    with tempfile.TemporaryDirectory() as folder:
        argoverse = {path.name: path.read_bytes() for path in sorted(ff.argoverse2(Path(folder)).iterdir())}
    with tempfile.TemporaryDirectory() as folder:
        recording = sind_files.written(Path(folder))
        sind = {path.name: path.read_bytes() for path in sorted(recording.parent.iterdir())}
    lanes = {"lanes.csv": ff.LANES.encode(), "links.csv": ff.LINKS.encode()}
    on_lanes = {"map": "lanes.csv"}
    return {
        "opendrive": ({"map.xodr": _opendrive()}, "map.xodr", {"keep": "bus"}),
        "sumo": ({"map.net.xml": _NET.encode()}, "map.net.xml", {"keep": "bike"}),
        "lanelet2": ({"map.osm": _lanelet2()}, "map.osm", {"keep": "bus"}),
        "argoverse2": (argoverse, "", {"keep": "bike"}),
        "womd": ({"scene.json": json.dumps(_scene()).encode()}, "scene.json", {}),
        "neutral": ({"tracks.csv": ff.tracks(ff.car()).encode(), **lanes}, "tracks.csv", on_lanes),
        "interaction": (
            {
                "vehicle_tracks_000.csv": ff.INTERACTION.encode(),
                "pedestrian_tracks_000.csv": ff.INTERACTION_PEDESTRIANS.encode(),
                **lanes,
            },
            "vehicle_tracks_000.csv",
            on_lanes,
        ),
        "sind": (sind, recording.name, {"map": "map.osm"}),
        "highd": ({name: text.encode() for name, text in ff.HIGHD.items()}, "01_tracks.csv", {}),
        "ind": ({**{name: text.encode() for name, text in ff.IND.items()}, **lanes}, "00_tracks.csv", {
            **on_lanes, "shift": "-40,32",
        }),
        "osi": ({"trace.osi": ff.osi_trace(ff.osi_control(ff.osi_messages()))}, "trace.osi", {}),
        "mcap": ({"trace.mcap": ff.osi_mcap(ff.osi_control(ff.osi_messages(11)))}, "trace.mcap", {}),
    }  # fmt: skip


def source_mutant(seed: int, index: int, names: tuple[str, ...]) -> Mutant:
    """Mutant number `index` of these formats, in turn; the first of each is not changed."""
    name = names[index % len(names)]
    files, main, options = formats()[name]
    random = Random(f"{seed}:{name}:{index // len(names)}")
    changed = dict(files)
    if index >= len(names):
        for chosen in {random.choice(sorted(files)) for _ in range(random.choice((1, 1, 2)))}:
            changed[chosen] = mutated(changed[chosen], random)
        if random.random() < 1 / 30 and len(changed) > 1:
            del changed[random.choice(sorted(changed))]
    if main and random.random() < 1 / 20 and main in changed:
        packed = gzip.compress(changed[main], 1)
        changed[main] = packed[: random.randrange(len(packed))] if random.random() < 0.5 else packed
    return Mutant(f"source {name}", main, changed, random, options)


def mutated(data: bytes, random: Random) -> bytes:
    """Content with one to five changes: numbers, parts (gone, twice, elsewhere), attributes, bytes, the end."""
    for _ in range(random.choice((1, 1, 1, 2, 2, 3, 5))):
        data = random.choices((_number, _part, _attribute, _bytes, _cut), weights=(6, 4, 2, 1, 1))[0](data, random)
    return data


def _spot(pattern: re.Pattern[bytes], data: bytes, random: Random) -> re.Match[bytes] | None:
    found = list(pattern.finditer(data))
    return random.choice(found) if found else None


def _number(data: bytes, random: Random) -> bytes:
    spot = _spot(_NUMBER, data, random)
    if spot is None:
        return _bytes(data, random)
    return data[: spot.start()] + text_of_number(random, spot[0].decode()).encode() + data[spot.end() :]


def _part(data: bytes, random: Random) -> bytes:
    spot = _spot(random.choice(_PARTS), data, random)
    if spot is None:
        return _number(data, random)
    rest = data[: spot.start()] + data[spot.end() :]
    draw = random.random()
    if draw < 0.4:
        return rest
    other = _spot(random.choice(_PARTS), rest, random)
    at = spot.start() if draw < 0.7 or other is None else other.start()
    return rest[:at] + spot[0] * (2 if draw < 0.7 else 1) + rest[at:]


def _attribute(data: bytes, random: Random) -> bytes:
    spot = _spot(_ATTRIBUTE, data, random)
    if spot is None:
        return _bytes(data, random)
    return data[: spot.start()] + random.choice((b"", *_WORDS)) + data[spot.end() :]


def _bytes(data: bytes, random: Random) -> bytes:
    at = random.randrange(len(data) + 1)
    return data[:at] + random.choice((*_WORDS, random.randbytes(3))) + data[at + random.choice((0, 1, 4)) :]


def _cut(data: bytes, random: Random) -> bytes:
    return data[: random.randrange(len(data) + 1)]
