"""`interdrive problem` puts vehicles on maps, and `interdrive check --png` draws lanes to choose from."""

import numpy as np
import pytest
from click.testing import CliRunner
from opendrive_documents import document, geometry, lane, road, section

from interdrive import read_scenario, read_source, simulate, write_scenario
from interdrive.cli import main
from interdrive.files import scenario_file
from interdrive.plots.map import draw_map
from interdrive.scenario.problems import lanelet_named
from interdrive.testing import straight_road, world


def call(*arguments):
    return CliRunner().invoke(main, list(map(str, arguments)))


@pytest.fixture
def bare(tmp_path):
    """Two lanes of one direction, lanelets 1 and 2, without any traffic."""
    path = tmp_path / "map.xml"
    write_scenario(world(straight_road(lanes=2)), path)
    return path


def texts(figure):
    return {text.get_text() for axes in figure.axes for text in axes.texts}


def test_a_map_becomes_a_scenario_that_runs(bare, tmp_path):
    target = tmp_path / "made.xml"
    ids = read_scenario(bare).lanelets.ids.tolist()
    done = call("problem", bare, "--from", f"{ids[0]},30", "--to", ids[0], "--velocity", "8", "--out", target)
    assert done.exit_code == 0, done.output
    made = read_scenario(target)
    (problem,) = made.planning_problems
    assert problem.initial_state.velocity == 8.0
    row = 0
    middle = 0.5 * (made.lanelets.left[row] + made.lanelets.right[row])
    begin = middle[0] + 30.0 * (middle[-1] - middle[0]) / np.hypot(*(middle[-1] - middle[0]))
    assert np.allclose((problem.initial_state.x, problem.initial_state.y), begin)
    assert problem.goal[0].lanelet_ids == (ids[0],)
    run = simulate(target, agents="problems", threads=1)
    assert len(run.agents) == 1
    assert run.outcomes.outcome == ("goal_reached",)


def test_every_from_has_its_to_and_ids_are_new(bare, tmp_path):
    first, second = tmp_path / "first.xml", tmp_path / "second.xml"
    one, two = read_scenario(bare).lanelets.ids.tolist()
    call("problem", bare, "--from", one, "--to", one, "--out", first)
    done = call("problem", first, "--from", two, "--to", two, "--from", f"{one},60", "--to", one, "--out", second)
    assert done.exit_code == 0, done.output
    problems = read_scenario(second).planning_problems
    assert len({problem.id for problem in problems} | {one, two}) == 5
    assert [problem.goal[0].lanelet_ids for problem in problems] == [(one,), (two,), (one,)]


def test_lanes_have_the_names_of_their_source(tmp_path):
    source = tmp_path / "town.xodr"
    line = geometry("<line/>", 100.0)
    source.write_text(document(road(7, line, section(lane(0), lane(-1)), length=100.0)), encoding="utf-8")
    (key,) = read_source(source).source.keys
    target = tmp_path / "made.xml"
    done = call("problem", source, "--from", f"{key},10", "--to", f"name={key}", "--out", target)
    assert done.exit_code == 0, done.output
    assert len(read_scenario(target).planning_problems) == 1
    assert lanelet_named(read_source(source), key) == read_source(source).lanelets.ids[0]


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--from", "77", "--to", "ID"], "77: no lane has that id or name"),
        (["--from", "ID,900", "--to", "ID"], "900 m is not on the lane"),
        (["--from", "ID,x", "--to", "ID"], "write a number from 0 to"),
        (["--from", "ID", "--from", "ID", "--to", "ID"], "2 --from and 1 --to"),
        (["--from", "ID", "--to", "ID", "--velocity", "-1"], "--velocity -1: write a number from 0 to 100"),
        (["--from", "ID", "--to", "ID", "--velocity", "fast"], "--velocity fast"),
        (["--from", "ID", "--to", "ID", "--velocity", "1e9"], "--velocity 1e9: write a number from 0 to 100"),
        (["--from", "ID", "--to", "ID", "--time", "inf"], "--time inf"),
        (["--from", "ID", "--to", "ID", "--out", "made.txt"], "name a file that ends in .xml"),
        (["--from", "ID", "--to", "ID", "--out", "MAP"], "exists already"),
    ],
)
def test_what_cannot_be_is_one_line_and_nothing_is_written(bare, tmp_path, more, words):
    number = str(read_scenario(bare).lanelets.ids[0])
    given = [word.replace("ID", number).replace("MAP", str(bare)) for word in more]
    target = tmp_path / "made.xml"
    done = call("problem", bare, "--out", target, *given)
    assert done.exit_code == 2, done.output
    assert done.stderr.startswith("error: ")
    assert done.stderr.count("\n") == 1
    assert words in done.stderr
    assert not target.exists()


def test_a_map_without_a_way_is_refused(tmp_path):
    done = call("problem", "t_junction", "--from", "1", "--to", "2", "--out", tmp_path / "made.xml")
    assert done.exit_code == 2
    assert "from 1 to 2: no way leads" in done.stderr


def test_a_picture_of_the_map_has_the_ids_of_its_lanelets(bare, tmp_path):
    figure, too_short = draw_map(read_scenario(bare))
    assert too_short == 0
    assert texts(figure) == set(map(str, read_scenario(bare).lanelets.ids.tolist()))
    done = call("check", bare, "--png", tmp_path / "map.png")
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")
    assert "map in " in done.stdout


def test_a_box_crops_the_map():
    scenario = read_scenario(scenario_file("t_junction"))
    whole, _ = draw_map(scenario)
    figure, _ = draw_map(scenario, (-20.0, -20.0, 20.0, 20.0))
    assert figure.axes[0].get_xlim() == (-20.0, 20.0)
    assert whole.axes[0].get_xlim()[0] < -20.0


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--png", "map.jpg"], "must end in .png"),
        (["--box", "0,0,1,1"], "add --png"),
        (["--png", "map.png", "--box", "0,0,1"], "write smallest x and y"),
        (["--png", "map.png", "--box", "5,0,1,9"], "write smallest x and y"),
        (["--png", "map.png", "--box", "0,0,nan,1"], "write smallest x and y"),
        (["--png", "map.png", "--box", "9000,9000,9001,9001"], "--box: no lanelet lies in the box"),
        (["lane_merge", "--png", "map.png"], "it is the picture of one file"),
    ],
)
def test_pictures_that_cannot_be_drawn_are_one_line(tmp_path, monkeypatch, more, words):
    monkeypatch.chdir(tmp_path)
    done = call("check", "t_junction", *more)
    assert done.exit_code == 2
    assert words in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "map.png").exists()
