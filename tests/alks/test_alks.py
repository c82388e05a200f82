"""`interdrive alks`: grids of cut-ins, cut-outs and followings, verdicts, boundaries, the command."""

import csv
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

from interdrive import InputError
from interdrive.alks import Grid, boundary, case_figures, driven, grid, reference, table_of, verdicts, worlds
from interdrive.cli import main
from interdrive.storage import origin_of

GRID = """
[cut_in]
velocity_kmh = [20, 90]
other_velocity_kmh = [30]
gap = {from = 5, to = 85, step = 20}
sideways = [1.0]
[cut_out]
velocity = 20.0
front_distance = [10]
sideways = [1.0]
[following]
velocity = 20.0
deceleration = [3.0]
"""


def invoked(*arguments):
    result = CliRunner().invoke(main, ["alks", *map(str, arguments)])
    return result.exit_code, result.output


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "grid.toml"
    path.write_text(GRID)
    return path


def test_the_grids_of_jrc_have_as_many_cases_as_its_comparison():
    named = [("cut_in", "jrc_high"), ("cut_in", "jrc_low"), ("cut_in", "jrc"), ("cut_out", "jrc"), ("following", "jrc")]
    counts = [len(grid(kind, name)) for kind, name in named]
    assert counts == [14040, 15930, 29970, 5850, 1121]


def test_a_file_says_the_cases_and_those_with_a_faster_other_are_left_out(file):
    cases = grid("cut_in", str(file))
    assert (len(cases), cases.skipped) == (5, 5)
    assert cases.case(0) == pytest.approx({"velocity": 25.0, "other_velocity": 30 / 3.6, "gap": 5.0, "sideways": 1.0})
    assert cases.cases["gap"].tolist() == [5.0, 25.0, 45.0, 65.0, 85.0]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[cut_in]\nvelocity = [-1]\nother_velocity = 1\ngap = 1\nsideways = 1", "velocity must not be negative"),
        ("[cut_in]\nvelocity = {from = 1, to = 2, step = 0}", "the step of velocity must be positive, is 0"),
        ("[cut_in]\nvelocity = {from = 1, to = 2, step = -0.5}", "the step of velocity must be positive, is -0.5"),
        ("[cut_in]\nvelocity = {from = 2, to = 1, step = 1}", "velocity from 2 to 1 in steps of 1 is no range"),
        ("[cut_in]\nvelocity = {from = 1, to = inf, step = 1}", "velocity from 1 to inf in steps of 1 is no range"),
        (
            "[following]\nvelocity = {from = 1, to = 9, step = 1e-3}\ndeceleration = {from = 1, to = 9, step = 1e-3}",
            "64,016,001 cases are more than 10,000,000, the most of a grid",
        ),
        ("[cut_in]\nvelocity = {from = 1}", "velocity must be numbers, or from, to and step"),
        ("[cut_in]\nvelocity = 3", "other_velocity is missing"),
        ("velocity = 3", "there is no table [cut_in]"),
        ("[", "not a TOML file"),
    ],
)
def test_a_file_that_says_no_grid_is_refused_in_one_line(tmp_path, text, words):
    path = tmp_path / "grid.toml"
    path.write_text(text)
    with pytest.raises(InputError) as refused:
        grid("following" if "following" in text else "cut_in", str(path))
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


def hits(kind, driver, **case):
    return bool(reference(Grid(kind, {name: np.array([value]) for name, value in case.items()}), driver).crash[0])


def test_the_boundary_is_the_least_gap_from_which_on_nothing_is_hit(file):
    (row,) = boundary(reference(grid("cut_in", str(file)), "cc"))
    case = {name: row[name] for name in ("velocity", "other_velocity", "sideways")}
    assert 45.0 < row["gap"] < 85.0, "m"
    assert not hits("cut_in", "cc", **case, gap=row["gap"])
    assert hits("cut_in", "cc", **case, gap=row["gap"] - 0.2)


def test_the_boundary_of_followings_is_the_hardest_braking_that_is_coped_with():
    cases = Grid("following", {"velocity": np.full(10, 35.0), "deceleration": np.linspace(1.0, 9.8, 10)})
    (row,) = boundary(reference(cases, "rss"))
    assert 6.0 < row["deceleration"] < 9.8, "m/s²"
    assert not hits("following", "rss", velocity=35.0, deceleration=row["deceleration"])
    assert hits("following", "rss", velocity=35.0, deceleration=row["deceleration"] + 0.2)
    assert boundary(reference(cases, "cc")) == [{"velocity": 35.0, "deceleration": np.inf}], "all are avoided"


def test_the_boundary_of_a_planner_drives_only_what_lies_between_cases(file, monkeypatch):
    found = driven(grid("cut_in", str(file)), "idm", predictor="constant_velocity", workers=1)
    assert found.crash.any()
    assert not found.crash.all()
    again, drive = [], verdicts.driven
    monkeypatch.setattr(
        verdicts, "driven", lambda cases, *rest, **more: again.append(cases) or drive(cases, *rest, **more)
    )
    (row,) = boundary(found, workers=1)
    gaps = [float(cases.cases["gap"][0]) for cases in again]
    assert not set(gaps) & set(found.grid.cases["gap"].tolist())
    assert len(gaps) == 8, "20 m are halved until 0.1 m is left"
    largest = found.grid.cases["gap"][found.crash].max()
    assert largest < row["gap"] <= largest + 20.0


def test_a_planner_is_driven_through_every_case_with_any_number_of_workers(file):
    cases = grid("cut_in", str(file))
    done = []
    found = driven(cases, "idm", predictor="constant_velocity", workers=1, on_cases=done.append)
    assert done == [5]
    assert found.driver == "idm"
    assert np.isfinite(found.impact_speed).tolist() == found.crash.tolist()
    table = table_of([found, reference(cases, "r157")]).to_pydict()
    assert table["driver"] == ["idm"] * 5 + ["r157"] * 5
    assert table["preventable_cc"][:5] == (~reference(cases, "cc").crash).tolist()
    assert table["deceleration"] == [None] * 10
    (name, figure), *others = case_figures(found)
    assert (name, others) == ("cut_in_90_30", [])
    assert figure.axes[0].get_ylabel() == "gap [m]"


def test_a_case_that_no_vehicle_can_drive_is_refused_before_a_planner_drives():
    cases = Grid("following", {"velocity": np.array([20.0]), "deceleration": np.array([0.0])})
    with pytest.raises(InputError, match="case 0: the deceleration must be positive, is 0"):
        driven(cases, "idm", predictor="constant_velocity", workers=1)


def test_no_reference_driver_as_planner_hits_what_it_would_have_avoided(file):
    for kind in ("cut_out", "following"):
        found = driven(grid(kind, str(file)), "cc", predictor="constant_velocity", workers=1)
        assert found.driver == "cc in worlds"
        assert not (found.crash & ~reference(found.grid, "cc").crash).any()


def test_only_turned_footprints_make_cc_in_worlds_another_driver_than_in_one_dimension(tmp_path, monkeypatch):
    path = tmp_path / "grid.toml"
    path.write_text(
        "[cut_in]\nvelocity_kmh = [50, 90]\nother_velocity_kmh = 20\n"
        "gap = {from = 3, to = 31, step = 4}\nsideways = [0.7, 1.5]"
    )
    cases = grid("cut_in", str(path))
    expected = reference(cases, "cc").crash
    assert (driven(cases, "cc", predictor="constant_velocity", workers=1).crash != expected).sum() > 3
    made = worlds.scenario

    def with_straight_vehicles(*arguments):
        scenario = made(*arguments)
        straight = replace(scenario.obstacles, orientation=np.zeros_like(scenario.obstacles.orientation))
        return replace(scenario, obstacles=straight)

    monkeypatch.setattr(worlds, "scenario", with_straight_vehicles)
    assert (driven(cases, "cc", predictor="constant_velocity", workers=1).crash == expected).all()


def test_a_vehicle_without_sideways_speed_never_cuts_in(tmp_path):
    path = tmp_path / "grid.toml"
    path.write_text("[cut_in]\nvelocity = 20\nother_velocity = 10\ngap = [1, 20]\nsideways = 0")
    cases = grid("cut_in", str(path))
    assert not reference(cases, "cc").crash.any()
    assert not driven(cases, "idm", predictor="constant_velocity", workers=1).crash.any()


def test_the_command_writes_tables_and_figures_and_one_line_per_driver(file, tmp_path):
    out = tmp_path / "out"
    code, text = invoked("all", "--grid", file, "--driver-only", "--boundary", "--out", out)
    assert code == 0
    assert "left out 5 cut-ins in which the other is not slower" in text
    assert "r157 crashes in" in text
    assert "of them a careful and competent driver would not" in text
    assert pq.read_table(out / "alks.parquet").num_rows == 5 * 4 + 3 + 3
    with (out / "boundary.csv").open(newline="") as table:
        assert len(list(csv.DictReader(table))) == 4 + 3 + 3
    for name in ("cut_in_90_30_cc", "cut_out_72_fsm", "following_rss"):
        assert (out / f"{name}.png").exists()
    origin = origin_of(pq.read_table(out / "alks.parquet"))
    assert origin.settings["grid"] == str(file)
    assert list(origin.inputs) == [str(file)]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--grid", "nothing.toml"), "--grid nothing.toml: no such file; named grids are jrc, jrc_high, jrc_low"),
        (
            ("cut_out", "--driver", "r157"),
            "--driver r157: it is defined for cut-ins (UN R157, 5.2.5.2), not for cut_out",
        ),
        (("--driver", "me"), "--driver me: there is no such reference driver"),
        (("--driver-only", "--planner", "idm"), "--driver-only: no planner drives"),
        (("--driver-only", "--boundary"), "--boundary: say with --out DIR where boundary.csv goes"),
    ],
)
def test_what_cannot_be_driven_is_refused(arguments, words):
    code, text = invoked(*arguments)
    assert code == 2
    assert words in " ".join(text.split())


def test_more_than_a_million_cases_need_a_yes(tmp_path):
    path = tmp_path / "large.toml"
    axis = "{from = 1, to = 110, step = 0.1}"
    path.write_text(f"[following]\nvelocity = {axis}\ndeceleration = {axis}")
    code, text = invoked("following", "--grid", path)
    assert code == 2
    assert "cases are more than 1,000,000; --yes drives them" in " ".join(text.split())


def test_a_planner_that_fails_avoids_nothing(tmp_path, monkeypatch, file):
    (tmp_path / "bad.py").write_text(
        "class Bad:\n    def plan(self, view, predictions):\n        raise ValueError('no')\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    found = driven(grid("cut_in", file), "bad:Bad", workers=1)
    assert found.failed.all()
    assert not found.crash.any()
    assert table_of([found]).column("failed").to_pylist() == [True] * len(found.grid)


def test_a_gap_that_stands_twice_in_a_grid_does_not_move_the_boundary(file):
    cases = grid("cut_in", file)
    twice = Grid(cases.manoeuvre, {name: np.concatenate([values, values]) for name, values in cases.cases.items()})
    assert boundary(reference(twice, "cc")) == boundary(reference(cases, "cc"))


def test_where_a_planner_fails_nothing_is_avoided_in_boundaries_and_figures(file):
    avoided = reference(grid("cut_in", file), "fsm")
    failing = replace(avoided, crash=np.zeros(5, dtype=bool), failed=np.ones(5, dtype=bool))
    assert [row["gap"] for row in boundary(failing)] == [np.inf]
    ((_, figure),) = case_figures(failing)
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels[0] == "fsm fails"


def test_planners_are_compared_only_with_drivers_that_begin_where_they_do(file):
    cases = grid("following", file)
    found = driven(cases, "idm", predictor="constant_velocity", workers=1)
    table = table_of([found, reference(cases, "rss")]).to_pydict()
    assert table["preventable_rss"] == [None] * len(cases) + [True] * len(cases)
    assert table["preventable_cc"] == [True] * 2 * len(cases)
    ((name, figure),) = case_figures(found)
    assert (name, len(figure.axes[0].get_lines())) == ("following", 0)
