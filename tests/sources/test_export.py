"""Runs are written for other tools, and read back as they were."""

import re
import time
from dataclasses import replace
from xml.etree import ElementTree

import foreign_files as ff
import numpy as np
import pytest
from invented_run import invented_run

import interdrive as idr
from interdrive.cli import main
from interdrive.runs import recorded_run
from interdrive.testing import Car, straight_road, world


@pytest.fixture(scope="module")
def run():
    return invented_run()


@pytest.fixture(scope="module")
def roads(run, tmp_path_factory):
    """The roads of the invented run as a CommonRoad file."""
    path = tmp_path_factory.mktemp("roads") / "roads.xml"
    empty = idr.read_source(ff.neutral_map(path.parent)).obstacles
    idr.write_scenario(replace(run.scenario, obstacles=empty, planning_problems=()), path)
    return path


def rows(states, valid=None):
    """x, y, direction of the heading and speed by id and time step, of what is there."""
    heading = states.orientation
    table = np.stack([states.x, states.y, np.cos(heading), np.sin(heading), states.velocity])
    return np.where((states.valid if valid is None else valid)[None], table, np.nan)


def test_tracks_of_a_run_are_read_back_bit_for_bit(run, roads, tmp_path):
    path = run.export(tmp_path / "run.csv")
    assert path.read_text().splitlines()[0] == "track_id,time_s,x,y,heading,speed,length,width,kind"
    again = idr.read_source(path, map=roads, raw=True)
    kept = run.states.valid.sum(axis=1) > 1
    np.testing.assert_array_equal(again.obstacles.x, run.states.x[kept])
    np.testing.assert_array_equal(again.obstacles.y, run.states.y[kept])
    np.testing.assert_array_equal(again.obstacles.velocity, run.states.velocity[kept])


def test_a_recording_that_went_through_tracks_is_replayed_with_the_same_digest(tmp_path):
    scenario = idr.read_scenario(idr.shipped_scenario("t_junction"), raw=True)
    once = recorded_run(scenario)
    path = once.export(tmp_path / "t.csv")
    again = recorded_run(idr.read_source(path, map=scenario.path, raw=True))
    np.testing.assert_allclose(again.states.x, once.states.x, atol=1e-6)
    second = recorded_run(idr.read_source(again.export(tmp_path / "u.csv"), map=scenario.path, raw=True))
    assert second.digest == again.digest


@pytest.mark.parametrize("ending", ["mcap", "osi"])
def test_a_trace_of_a_run_is_read_back_exactly_and_equal_runs_give_equal_bytes(run, roads, tmp_path, ending):
    path = run.export(tmp_path / f"run.{ending}")
    again = idr.read_source(path, map=roads, raw=True)
    order = [run.states.participant_id.tolist().index(number) for number in again.obstacles.ids]
    ours, theirs = rows(run.states)[:, order], rows(again.obstacles)
    moving = ~again.obstacles.is_static
    np.testing.assert_allclose(theirs[:, moving], ours[:, moving], atol=1e-9)
    assert path.read_bytes() == run.export(tmp_path / f"other.{ending}").read_bytes()
    assert f"the host vehicle is {run.agents[0].id}" in again.notes


def test_objects_of_a_trace_have_types_and_sizes(run, tmp_path):
    import betterosi as osi

    truths = list(osi.read(str(run.export(tmp_path / "run.mcap")), return_ground_truth=True))
    assert len(truths) == run.states.n_steps
    assert (truths[0].version.version_major, truths[0].version.version_minor) == (3, 8)
    objects = {one.id.value: one for truth in truths for one in truth.moving_object}
    kinds = dict(zip(run.states.participant_id.tolist(), run.states.kinds, strict=True))
    assert {number: one.type.name for number, one in objects.items()} == {
        number: "PEDESTRIAN" if kinds[number] == "pedestrian" else "VEHICLE" for number in objects
    }
    one = objects[run.agents[0].id]
    assert one.vehicle_classification.type.name == "CAR"
    assert one.vehicle_classification.role.name == "CIVIL"
    assert one.base.dimension.height == 1.5
    assert (truths[-1].timestamp.seconds, truths[-1].timestamp.nanos) == divmod(round((len(truths) - 1) * 1e8), 10**9)


def test_every_time_step_of_a_trace_has_its_own_states_and_what_is_unknown_there_is_left_out(tmp_path):
    import betterosi as osi

    scenario = world(straight_road(300.0), cars=[Car(1, x=5.0, velocity=4.0), Car(2, x=90.0, velocity=8.0)], steps=9)
    run = recorded_run(scenario)
    acceleration, yaw_rate = run.states.acceleration.copy(), run.states.yaw_rate.copy()
    acceleration[0, [2, 5]], acceleration[0, 3], yaw_rate[1, 4] = np.nan, 1.25, np.nan
    run = replace(run, states=replace(run.states, acceleration=acceleration, yaw_rate=yaw_rate))
    truths = list(osi.read(str(run.export(tmp_path / "run.mcap")), return_ground_truth=True))
    bases = [[one.base for one in truth.moving_object] for truth in truths]
    np.testing.assert_allclose([[base.position.x for base in row] for row in bases], run.states.x.T)
    np.testing.assert_allclose([[base.velocity.x for base in row] for row in bases], run.states.velocity.T)
    assert [step for step, row in enumerate(bases) if row[0].acceleration is None] == [2, 5]
    assert bases[3][0].acceleration.x == 1.25
    assert [step for step, row in enumerate(bases) if row[1].orientation_rate is None] == [4]


def test_a_minute_of_two_hundred_vehicles_is_a_trace_within_seconds(tmp_path):
    cars = [Car(number, x=5.0 + 25.0 * number, velocity=4.0) for number in range(1, 201)]
    run = recorded_run(world(straight_road(6000.0), cars=cars, steps=600))
    begun = time.process_time()
    run.export(tmp_path / "run.mcap")
    run.export(tmp_path / "run.csv")
    assert time.process_time() - begun < 2.5  # with a new object for every state it took 4 s


ROAD = """<OpenDRIVE><header revMajor="1" revMinor="4"/><road id="1" length="100" junction="-1">
  <planView><geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry></planView>
  <lanes><laneSection s="0"><center><lane id="0" type="none"/></center><right><lane id="-1" type="driving">
  <width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></right></laneSection></lanes></road></OpenDRIVE>
"""


def test_the_map_of_an_opendrive_run_travels_in_its_trace(tmp_path):
    path = tmp_path / "road.xodr"
    path.write_text(ROAD)
    tracks = tmp_path / "tracks.csv"
    tracks.write_text(
        ff.tracks(
            ff.car("7", y=-1.75, n=31),
        )
    )
    on_map = idr.read_source(path)
    obstacles = idr.read_source(tracks, map=path).obstacles
    run = recorded_run(replace(on_map, obstacles=obstacles))
    again = idr.read_source(run.export(tmp_path / "run.mcap"))
    np.testing.assert_array_equal(again.lanelets.left[0], on_map.lanelets.left[0])
    assert len(again.obstacles.ids) == 1
    path.write_text(ROAD.replace("100", "90"))
    with pytest.raises(idr.InputError, match="tracks need --map"):
        idr.read_source(run.export(tmp_path / "other.mcap"))


def test_the_command_writes_what_is_asked_for_and_replaces_nothing(run, tmp_path, capsys):
    folder = run.save(tmp_path / "run")
    table, trace = tmp_path / "a.csv", tmp_path / "b.mcap"

    def called(*arguments):
        with pytest.raises(SystemExit) as ended:
            main(["export", str(folder), *map(str, arguments)])
        return ended.value.code, capsys.readouterr()

    code, said = called("--csv", table, "--osi", trace)
    assert code == 0
    n = len(run.states.participant_id)
    assert re.fullmatch(rf"({n} participants over {run.states.n_steps} time steps in \S+\n){{2}}", said.out)
    before = table.read_bytes()
    code, said = called("--csv", table)
    assert code == 2
    assert said.err == f"error: --csv {table}: exists already; name another file, or add --overwrite\n"
    assert called("--csv", table, "--overwrite")[0] == 0
    assert table.read_bytes() == before
    assert called()[1].err == "error: nothing to write: add --osi FILE.mcap, --csv FILE.csv or --sumo DIR\n"
    assert called("--sumo", tmp_path / "for_sumo")[0] == 0
    steps = list(ElementTree.parse(tmp_path / "for_sumo" / "fcd.xml").getroot())
    assert [len(steps), len(steps[0])] == [
        run.states.n_steps,
        np.count_nonzero(run.states.valid[:, 0] & ~run.states.is_static),
    ]
    assert called("--sumo", tmp_path / "for_sumo")[1].err.endswith("name another folder, or add --overwrite\n")
    assert called("--osi", tmp_path / "a.txt")[1].err.endswith("name a file that ends in .mcap or .osi\n")


def test_a_run_is_exported_by_the_ending_of_the_file(run, tmp_path):
    with pytest.raises(idr.InputError, match=r"name a file that ends in \.csv, \.mcap or \.osi"):
        run.export(tmp_path / "run.txt")
    run.export(tmp_path / "run.csv")
    with pytest.raises(idr.InputError, match="exists; choose another name or overwrite=True"):
        run.export(tmp_path / "run.csv")
