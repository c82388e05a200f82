"""`interdrive convert` and the same sources for other commands."""

import csv
import gzip
import json
import math
from dataclasses import replace

import opendrive_documents as xodr
import pytest
from click.testing import CliRunner

import interdrive as idr
from interdrive.cli import main
from interdrive.files import scenario_document
from interdrive.files.scenario_file import losses

STRAIGHT = xodr.document(
    xodr.road(
        7,
        xodr.geometry("<line/>", 200.0),
        xodr.section(
            xodr.lane(1), xodr.lane(0), xodr.lane(-1), xodr.lane(-2, kind="bus"), xodr.lane(-3, kind="sidewalk")
        ),
        length=200.0,
    ),
    header="<geoReference>+proj=tmerc</geoReference>",
)


@pytest.fixture
def straight(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "straight.xodr"
    path.write_text(STRAIGHT)
    return path


def call(*arguments):
    done = CliRunner().invoke(main, [str(one) for one in arguments])
    return done.exit_code, done.output


def test_the_last_line_says_what_was_written_and_what_was_left_out(straight):
    code, said = call("convert", straight, "--out", "new.xml")
    assert code == 0
    assert said == "new.xml: 2 lanelets, 0.4 km, 0 links; left out: 1 bus, 1 sidewalk lanes\n"
    read = idr.read_scenario("new.xml")
    assert read.benchmark_id == "ZAM_straight-1_1_T-1"
    assert read.notes == ()
    text = (straight.parent / "new.xml").read_text()
    assert "<geoReference>+proj=tmerc</geoReference>" in text
    assert 'source="OpenDRIVE straight.xodr"' in text


def test_a_converted_file_is_read_as_the_scenario_that_the_source_is_read_as(straight):
    scenario = idr.read_scenario(straight)
    assert losses(scenario, scenario_document(scenario)) == ()
    assert call("convert", straight, "--out", "new.xml", "--quiet") == (0, "")
    assert (straight.parent / "new.xml").read_bytes() == scenario_document(scenario)


def test_equal_input_gives_equal_bytes_also_if_it_is_packed(straight):
    packed = straight.parent / "packed" / "straight.xodr"
    packed.parent.mkdir()
    packed.write_bytes(gzip.compress(straight.read_bytes()))
    for source, target in ((straight, "a.xml"), (straight, "b.xml"), (packed, "c.xml")):
        assert call("convert", source, "--out", target)[0] == 0
    one, *others = ((straight.parent / name).read_bytes() for name in ("a.xml", "b.xml", "c.xml"))
    assert others == [one, one]


def test_names_of_lanelets_in_the_source_are_a_table(straight):
    assert call("convert", straight, "--out", "new.xml", "--names", "names.csv", "--keep", "bus")[0] == 0
    with (straight.parent / "names.csv").open() as table:
        assert list(csv.reader(table)) == [["lanelet_id", "key"], ["1", "7/0/1"], ["2", "7/0/-1"], ["3", "7/0/-2"]]


def test_files_are_replaced_only_if_that_is_wanted_and_never_the_source(straight):
    assert call("convert", straight, "--out", "new.xml")[0] == 0
    code, said = call("convert", straight, "--out", "new.xml")
    assert (code, said) == (2, "error: --out new.xml: exists already; name another file, or add --overwrite\n")
    assert call("convert", straight, "--out", "new.xml", "--overwrite")[0] == 0
    source = straight.rename(straight.with_suffix(".xml"))
    code, said = call("convert", source, "--out", source, "--overwrite")
    assert code == 2 and "straight.xml" in said
    assert source.read_text() == STRAIGHT


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--keep", "tram"), "error: keep: expected bike or bus or parking or shoulder, not tram"),
        (("--dt", "0"), "error: dt: must be between 0.001 and 10 s, is 0"),
        (("--origin", "100,0"), "error: origin: must be latitude,longitude in degrees"),
        (("--shift", "a,b"), "error: shift: expected a number, not a"),
        (("--country", "Spain"), "error: country: must be a code of three letters such as DEU, is Spain"),
        (("--offset", "half"), "error: offset: expected none or add or subtract, not half"),
    ],
)
def test_options_that_mean_nothing_are_refused_in_one_line(straight, options, words):
    code, said = call("convert", straight, "--out", "new.xml", *options)
    assert code == 2
    assert said.startswith(words)
    assert said.count("\n") == 1
    assert not (straight.parent / "new.xml").exists()


def test_check_reads_sources_with_their_options(straight):
    code, said = call("check", straight, "--source", "keep=bus")
    assert code == 0
    assert "3 lanelets" in said
    assert "note: left out: 1 sidewalk lanes" in said
    code, said = call("check", straight, "--source", "keep=tram")
    assert (code, said.count("\n")) == (2, 1)
    assert said.startswith("error: source.keep: expected")


def test_a_map_alone_is_not_run(straight):
    code, said = call("run", straight)
    assert code == 2
    assert said.splitlines()[-1] == (
        "error: straight: has no traffic; a map can be run once it has vehicles or planning problems"
    )


def test_run_folders_say_from_which_source_and_with_which_options_they_came(straight):
    scenario = idr.read_source(straight, keep="bus")
    start = idr.scenario.InitialState(0, 10.0, -1.75, 0.0, 8.0)
    goal = idr.scenario.GoalState((idr.scenario.Shape("rectangle", 20.0, 3.0, center=(80.0, -1.75)),), (), (0, 200))
    problem = idr.scenario.PlanningProblem(900, start, (goal,))
    run = idr.simulate(replace(scenario, planning_problems=(problem,)), predictor="lane_following")
    assert run.outcomes.outcome == ("goal_reached",)
    folder = straight.parent / "run"
    run.save(folder)
    stored = json.loads((folder / "run.json").read_text())
    assert stored["source"]["format"] == "OpenDRIVE"
    assert stored["source"]["options"] == {"keep": "bus"}
    assert [file["name"] for file in stored["source"]["files"]] == ["straight.xodr"]
    assert stored["settings"]["settings"]["source.keep"] == ["bus"]
    again = idr.load(folder)
    assert len(again.scenario.lanelets.ids) == 3
    assert math.isclose(again.scenario.lanelets.left[0][0, 0], 200.0)
    straight.write_text(STRAIGHT.replace('length="200.0"', 'length="190.0"'))
    assert idr.load(folder).scenario.path == folder / "scenario.xml", "the source has changed, the folder has a copy"
    code, said = call("verify", folder)
    assert code == 2 and "has changed since the run" in said
