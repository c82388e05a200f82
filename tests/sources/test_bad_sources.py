"""What cannot be read is refused in one line: file first, what to do last; nothing is written."""

import gzip
import math

import foreign_files as ff
import opendrive_documents as xodr
import pytest
from click.testing import CliRunner

from interdrive.cli import main

BOTH = xodr.section(xodr.lane(1), xodr.lane(0), xodr.lane(-1))


def road(number=1, geometry=None, length=20.0):
    line = xodr.geometry("<line/>", 20.0) if geometry is None else geometry
    return xodr.road(number, line, BOTH, length=length)


GOOD = xodr.document(road())
WITHOUT_ROADS = "has no lane that vehicles may drive (types: no lanes at all; roads left out, {}: 1); --keep adds types"
XML = {
    "broken.xodr": (GOOD[:200], "line 1, column 198: unclosed token; give a whole file"),
    "empty.xodr": ("", "the file is empty; give a CommonRoad file"),
    "text.xodr": ("hello", "not an XML file; give a CommonRoad .xml or .pb file"),
    "type.xodr": (
        GOOD.replace("<OpenDRIVE>", "<!DOCTYPE a><OpenDRIVE>"),
        "has a document type, which may expand without end; remove it",
    ),
    "other.xml": (
        "<foo/>",
        "<foo> is no map or scenario that is read here; give a CommonRoad, OpenDRIVE, Lanelet2 or SUMO net file",
    ),
    "none.xodr": (
        GOOD.replace("driving", "none"),
        "has no lane that vehicles may drive (types: none 2); --keep adds types",
    ),
    "without.xodr": (xodr.document(road(geometry="")), WITHOUT_ROADS.format("without geometry")),
    "nan.xodr": (
        xodr.document(road(geometry=xodr.geometry("<line/>", 20.0, x=math.nan))),
        WITHOUT_ROADS.format("x of <geometry> is no possible number"),
    ),
    "long.xodr": (xodr.document(road(length=1e9)), WITHOUT_ROADS.format("longer than 100 km")),
    "twice.xodr": (xodr.document(road(), road()), "two roads have the id 1; give each its own"),
    "deep.xodr": (
        xodr.document("<a>" * 300 + "</a>" * 300),
        "is nested more than 256 elements deep; is the file damaged?",
    ),
    "plain.osm": (
        '<osm version="0.6"><node id="1" lat="1" lon="2"/></osm>',
        "is an OpenStreetMap file without lanelets; only Lanelet2 maps are read",
    ),
    "net.net.xml": ("<net/>", "has no lane that vehicles may drive (lanes: none); --keep adds types"),
}
OTHERS = {
    "cut.xodr.gz": (gzip.compress(GOOD.encode())[:-12], "compressed data end early; fetch the file again"),
    "no.xodr.gz": (b"\x1f\x8bgarbage", "compressed data are damaged; fetch the file again"),
    "lfs.csv": (
        b"version https://git-lfs.github.com/spec/v1\n",
        "is a Git LFS pointer, not the data; run git lfs pull",
    ),
    "columns.csv": (b"frame,id,x\n1,2,3\n", "has no column track_id (found: frame, id, x)"),
    "mapless.csv": (
        ff.tracks(ff.car()).encode(),
        "tracks need --map (a CommonRoad, OpenDRIVE, Lanelet2 or SUMO map, or lanes.parquet)",
    ),
    "a.pkl": (b"\x80\x04}.", "pickle is not read; docs/how_to/inputs says how to get JSON or tracks.parquet"),
    "a.tfrecord-00000-of-00001": (
        b"\0\1",
        "TFRecord is not read; docs/how_to/inputs says how to get JSON or tracks.parquet",
    ),
}


def refused(*arguments):
    done = CliRunner().invoke(main, [*map(str, arguments), "--out", "new.xml"])
    assert done.exit_code == 2, done.output
    return done.output


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", [*XML, *OTHERS])
def test_a_file_that_cannot_be_read_is_refused_in_one_line(here, name):
    content, message = (XML | OTHERS)[name]
    (here / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    assert refused("convert", name) == f"error: {name}: {message}\n"
    assert [path.name for path in here.iterdir()] == [name]


@pytest.mark.long
def test_what_unpacks_to_very_much_is_refused(here):
    (here / "bomb.xodr.gz").write_bytes(gzip.compress(bytes(513 * 2**20), 1))
    assert refused("convert", "bomb.xodr.gz") == "error: bomb.xodr.gz: unpacks to more than 512 MB; cut it\n"


def test_a_folder_without_a_scenario_is_refused(here):
    (here / "empty").mkdir()
    said = refused("convert", "empty")
    assert said.startswith("error: empty: is a folder; it holds no Argoverse 2 scenario")
    assert said.count("\n") == 1


@pytest.mark.parametrize("missing", ["00_tracksMeta.csv", "00_recordingMeta.csv"])
def test_tables_that_belong_together_must_be_together(here, missing):
    ff.neutral_map(here)
    ff.saved(here / "ind", {name: text for name, text in ff.IND.items() if name != missing})
    said = refused("convert", "ind", "--map", "lanes.csv")
    assert missing in said
    assert said.count("\n") == 1


def test_a_track_that_is_at_two_places_at_a_time_is_refused(here):
    ff.neutral_map(here)
    (here / "twice.csv").write_text(ff.tracks(ff.car() + ff.car()[:1]))
    assert refused("convert", "twice.csv", "--map", "lanes.csv") == "error: twice.csv: track 7 has time 0 twice\n"


def test_tracks_that_say_nothing_are_refused(here):
    ff.neutral_map(here)
    (here / "empty.csv").write_text(ff.tracks([]))
    assert refused("convert", "empty.csv", "--map", "lanes.csv") == "error: empty.csv: has no rows\n"
    nowhere = [(name, time, math.nan, *rest) for name, time, _, *rest in ff.car()]
    (here / "nowhere.csv").write_text(ff.tracks(nowhere))
    said = refused("convert", "nowhere.csv", "--map", "lanes.csv")
    assert said == "error: nowhere.csv: no row has a time, x and y that are finite numbers\n"
    (here / "partly.csv").write_text(ff.tracks(nowhere[:3] + ff.car()[3:]))
    done = CliRunner().invoke(main, ["convert", "partly.csv", "--map", "lanes.csv", "--out", "partly.xml"])
    assert done.exit_code == 0, done.output


def test_tracks_far_from_their_map_are_refused_with_what_to_check(here):
    ff.neutral_map(here)
    rows = [(name, time, x + 5e6, *rest) for name, time, x, *rest in ff.car()]
    (here / "far.csv").write_text(ff.tracks(rows))
    assert refused("convert", "far.csv", "--map", "lanes.csv") == (
        "error: far.csv: 1 of 1 tracks are more than 100 m from lanes.csv (nearest 5,000 km): "
        "check --projection, --origin, --shift\n"
    )
