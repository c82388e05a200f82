"""OSI traces, in files of messages and in MCAP, are read with their objects, their map and their clock."""

import builtins
import json
import re
import sys

import foreign_files as ff
import numpy as np
import pytest

import interdrive as idr
from interdrive.files.sources.opening import SourceFile
from interdrive.files.sources.osi import read
from interdrive.scenario import SourceOptions


@pytest.fixture
def trace(tmp_path):
    path = tmp_path / "drive.osi"
    path.write_bytes(ff.osi_trace(ff.osi_messages()))
    return path


def mcap(path, messages, opendrive="", topic="ground_truth"):
    """Writes messages as MCAP."""
    import betterosi as osi

    with osi.Writer(path, topic=topic, metadata={"creation_time": "1970-01-01T00:00:00Z"}) as writer:
        if opendrive:
            writer.add(osi.MapAsamOpenDrive(open_drive_xml_content=opendrive), topic="ground_truth_map", log_time=0)
        for message in messages:
            writer.add(message)
    return path


def test_objects_of_a_trace_are_vehicles_pedestrians_and_posts(trace):
    scenario = idr.read_source(trace)
    obstacles = scenario.obstacles
    assert obstacles.kinds == ("bus", "pedestrian", "structure")
    assert obstacles.is_static.tolist() == [False, False, True]
    np.testing.assert_allclose(obstacles.x[0], 5.0 + np.arange(31), atol=1e-9)
    np.testing.assert_allclose(obstacles.velocity[:2, 3], [10.0, 1.4], atol=1e-5)
    assert obstacles.shapes[1].radius == pytest.approx(0.3), "half of the longer side"
    assert scenario.dt == 0.1
    assert scenario.notes[0] == "the host vehicle is 1"


def test_the_lanes_of_a_trace_are_its_map_unless_another_one_is_chosen(trace, tmp_path):
    lanelets = idr.read_source(trace).lanelets
    np.testing.assert_allclose(lanelets.left[0], [[0, 3.5], [50, 3.5], [100, 3.5]])
    assert lanelets.left_marking == ("solid",)
    assert len(idr.read_source(trace, map=ff.neutral_map(tmp_path)).lanelets.ids) == 3
    trace.write_bytes(ff.osi_trace(ff.osi_messages(with_lanes=False)))
    with pytest.raises(idr.InputError, match="tracks need --map"):
        idr.read_source(trace)


def test_mcap_is_recognised_by_its_content_and_read_alike(trace, tmp_path):
    path = mcap(tmp_path / "drive.mcap", ff.osi_messages())
    path = path.rename(tmp_path / "drive.dat")
    one, other = idr.read_source(trace), idr.read_source(path)
    np.testing.assert_array_equal(one.obstacles.x, other.obstacles.x)
    assert other.source.format == "OSI"


def test_views_of_sensors_hold_ground_truth_too(tmp_path):
    import betterosi as osi

    views = [osi.SensorView(timestamp=one.timestamp, global_ground_truth=one) for one in ff.osi_messages()]
    path = tmp_path / "views.osi"
    path.write_bytes(ff.osi_trace(views))
    assert idr.read_source(path).obstacles.kinds == ("bus", "pedestrian", "structure")


@pytest.mark.parametrize(("dt", "expected"), [(0.033, 0.033), (0.0999, 0.1), (0.0004, 0.1)])
def test_time_steps_are_those_of_the_trace_in_milliseconds(tmp_path, dt, expected):
    path = tmp_path / "drive.osi"
    path.write_bytes(ff.osi_trace(ff.osi_messages(n=301, dt=dt)))
    scenario = idr.read_source(path)
    assert scenario.dt == expected
    if dt != 0.0004:
        assert scenario.obstacles.n_steps == 301, "the clock of a trace that is nearly even is even"


@pytest.mark.parametrize("cut", [2, 100, -3])
def test_a_trace_that_ends_early_is_refused_in_one_line(trace, cut):
    trace.write_bytes(trace.read_bytes()[:cut])
    with pytest.raises(idr.InputError, match=r"ends within a message, at byte \d+; give a whole file"):
        idr.read_source(trace)


def test_other_bytes_are_no_trace(trace, tmp_path):
    trace.write_bytes(b"\x05\x00\x00\x00\xff\xff\xff\xff\x01")
    with pytest.raises(idr.InputError, match="a message cannot be read"):
        idr.read_source(trace)
    trace.write_bytes(b"")
    with pytest.raises(idr.InputError, match=re.escape("has no osi3.GroundTruth; give a trace with ground truth")):
        idr.read_source(trace)
    whole = mcap(tmp_path / "drive.mcap", ff.osi_messages())
    whole.write_bytes(whole.read_bytes()[:3000])
    with pytest.raises(idr.InputError, match=re.escape(str(whole))):
        idr.read_source(whole)


def test_mcap_without_ground_truth_lists_its_topics(tmp_path):
    path = mcap(tmp_path / "drive.mcap", [], opendrive="<OpenDRIVE/>")
    with pytest.raises(idr.InputError, match=r"has no osi3.GroundTruth \(topics: ground_truth_map\)"):
        idr.read_source(path)


def test_without_the_extra_one_line_says_what_to_install(trace, monkeypatch):
    whole = builtins.__import__

    def without(name, *more, **named):
        if name == "betterosi":
            raise ImportError(name)
        return whole(name, *more, **named)

    monkeypatch.delitem(sys.modules, "betterosi", raising=False)
    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(idr.InputError, match=re.escape("OSI files need the extra: pip install 'interdrive[osi]'")):
        idr.read_source(trace)


@pytest.mark.long
def test_real_traces_have_their_objects_and_frames(inputs_folder):
    expected = json.loads((inputs_folder / "expected_misc.json").read_text())["osi"]
    for name, values in expected.items():
        if name == "oracle":
            continue
        scenario = idr.read_source(inputs_folder / "osi" / name)
        obstacles = scenario.obstacles
        # Lanelets have the same numbers, so objects are numbered anew in the order in which they are seen.
        names = read(SourceFile(inputs_folder / "osi" / name), SourceOptions()).tracks.names
        assert (len(obstacles.ids), obstacles.n_steps) == (values["objects"], values["frames"]), name
        for number, one in values["ids"].items():
            row = names.index(number)
            steps = np.flatnonzero(obstacles.valid[row])
            assert len(steps) == one.get("n", values["frames"])
            for step, key in ((steps[0], "first"), (steps[-1], "last")):
                found = [table[row, step] for table in (obstacles.x, obstacles.y, obstacles.orientation)]
                np.testing.assert_allclose(found[: len(one.get(key, found))], one.get(key, found), atol=1e-5)
            assert obstacles.kinds[row] == one.get("kind", "car")
        assert ("the host vehicle is 225" in scenario.notes) == ("host" in values)
