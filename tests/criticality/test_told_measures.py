"""What is told of criticality: texts of values, the most critical moments, data frames, joint tables, figures."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

from interdrive import read_scenario
from interdrive.cli import main
from interdrive.comparison import METRICS
from interdrive.comparison.tables import shown
from interdrive.criticality import MEASURES, Criticality, evaluate, measure_named
from interdrive.criticality.tables import (
    criticality_extremes_table,
    criticality_table,
    save_joint_criticality,
)
from interdrive.files import run_document
from interdrive.report.contents import run_contents
from interdrive.results import save
from interdrive.runs import recorded_run
from interdrive.scenario import Shape
from interdrive.simulation import simulate
from interdrive.storage import origin_of
from interdrive.studies import MEASURES as STUDIED
from interdrive.testing import Car, problem, straight_road, world


def invoke(*arguments):
    return CliRunner().invoke(main, list(arguments))


def on_a_road(*cars, length=400.0, lanes=1, steps=20, **changes):
    return world(straight_road(length, lanes), cars=cars, steps=steps, **changes)


def write(scenario, path):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(run_document(recorded_run(scenario)))
    return path


# Values


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("ttc", 1.524, "1.52 s"),
        ("ttc", 60.0, "60.00 s"),
        ("ttc", 60.001, "> 60 s"),
        ("ttc", 1469952.0, "> 60 s"),
        ("ttc", math.inf, "-"),
        ("ttc", math.nan, "-"),
        ("ttc", None, "-"),
        ("thw", 75.0, "> 60 s"),
        ("pet", 0.0, "0.00 s"),
        ("hw", 999.0, "999.00 m"),
        ("hw", 4000.0, "> 1000 m"),
        ("a_long_req", -3.667, "-3.67 m/s²"),
        ("a_long_req", -103083328.399, "< -100 m/s²"),
        ("a_long_req", -0.001, "0.00 m/s²"),
        ("a_lat_req", 1e9, "> 100 m/s²"),
        ("btn", 22.25, "22.25"),
        ("btn", 1e7, "> 100"),
        ("psd", -math.inf, "-"),
    ],
)
def test_a_value_is_told_up_to_the_horizon_of_its_measure(name, value, text):
    assert measure_named(name).text(value) == text


def test_every_measure_that_can_grow_without_bound_has_a_horizon():
    assert {measure.name for measure in MEASURES if math.isinf(measure.horizon)} == {"tet"}  # a share of the time


def test_the_reference_states_the_horizons():
    reference = (Path(__file__).parents[2] / "docs" / "reference" / "criticality.md").read_text()
    rows = re.findall(r"^\| (`.*`) \| (\d+)(.*) \|$", reference, re.MULTILINE)
    stated = {name: (float(size), unit.strip()) for names, size, unit in rows for name in re.findall(r"`(\w+)`", names)}
    assert stated == {one.name: (one.horizon, one.unit) for one in MEASURES if one.name != "tet"}


def test_tables_without_a_column_of_units_tell_the_same_without_the_unit():
    assert measure_named("ttc").text(1469952.0, with_unit=False) == "> 60"
    (metric,) = [metric for metric in METRICS if metric.name == "ttc_min"]
    assert [shown(metric, value) for value in (2.25, 1e6, math.inf, math.nan, None)] == ["2.25", "> 60", "-", "-", "-"]
    assert {one.column.name: one.text(1e7) for one in STUDIED}["min_ttc"] == "> 60"
    assert {one.column.name: one.text(None) for one in STUDIED}["et"] == "-"


def digits_in_a_row(text):
    return max((len(found) for found in re.findall(r"\d+", text)), default=0)


@pytest.mark.parametrize(
    ("gap", "velocity", "ahead", "told"),
    [
        (30.0, 10.0, 9.99999, "> 60 s"),  # closes in after 3 million seconds
        (1e-6, 10.0, 0.0, "< -100 m/s²"),  # nothing could brake so hard
        (30.0, 0.001, 0.0, "> 60 s"),
    ],
)
def test_the_command_prints_no_number_that_says_nothing(tmp_path, gap, velocity, ahead, told):
    scenario = on_a_road(Car(1, 50.0, velocity=velocity), Car(2, 54.5 + gap, velocity=ahead), steps=3)
    result = invoke("criticality", str(write(scenario, tmp_path / "in.xml")), "--out", str(tmp_path / "tables"))
    assert result.exit_code == 0, result.output
    table = result.output.split("vehicles judged")[0]
    assert told in table
    assert digits_in_a_row(table) <= 4


def test_story_and_page_of_a_run_tell_the_same(tmp_path):
    problems = [problem(1, 10.0, velocity=10.0, goal=(150.0, 0.0), time_step=(0, 200))]
    scenario = on_a_road(Car(7, 60.0, velocity=9.9), problems=problems, steps=20)
    run = simulate(scenario, agents=[1], planner="idm", threads=1)
    folder = save(run, tmp_path / "run")
    (agent,) = [one for one in run_contents(folder).header["participants"] if one["id"] == 1]
    least = float(run.criticality([1]).extremes["ttc"].value[0])
    assert agent["ttc"] == measure_named("ttc").text(least, with_unit=False)
    result = invoke("explain", str(folder), "1")
    assert digits_in_a_row(result.output.split("least", 1)[-1]) <= 4


# The most critical moments


def test_what_overlaps_as_it_appears_is_counted_and_not_the_most_critical():
    found = evaluate(on_a_road(Car(1, 50.0, velocity=10.0), Car(2, 52.0, velocity=10.0), Car(3, 20.0, velocity=12.0)))
    assert found.overlapping == ((1, 2),)
    assert "1 pair of vehicles overlaps from the start and is not among the most critical ones: 1 and 2" in found.notes
    moment = found.most_critical("ttc")
    assert (moment.participant_id, moment.partner_id) == (3, 1)
    assert [{one.participant_id, one.partner_id} for one in found.most_critical_pairs("ttc", 9)] == [{1, 3}]
    assert found["ttc"][0, 0] == 0.0  # the tables hold what was recorded


def test_a_vehicle_that_enters_inside_another_is_left_out_too():
    cars = Car(1, 50.0, velocity=0.1), Car(2, 51.0, velocity=0.1, first=5), Car(3, 80.0, velocity=0.1)
    found = evaluate(on_a_road(*cars))
    assert found.overlapping == ((1, 2),)
    assert {2, 1} not in [{one.participant_id, one.partner_id} for one in found.most_critical_pairs("dce", 9)]


def test_vehicles_that_meet_later_are_not_left_out():
    found = evaluate(on_a_road(Car(1, 50.0, velocity=10.0), Car(2, 60.0, velocity=0.5)))
    assert found.overlapping == ()
    assert found.most_critical("ttc").value == 0.0


def test_footprints_overlap_where_they_are_not_where_their_boxes_are():
    scenario = on_a_road(Car(1, 50.0, velocity=5.0), Car(2, 53.2, y=1.4, velocity=5.0))
    round_ones = (Shape("circle", radius=1.7), Shape("circle", radius=1.7))
    assert evaluate(replace(scenario, obstacles=replace(scenario.obstacles, shapes=round_ones))).overlapping == ()
    assert evaluate(scenario).overlapping == ((1, 2),)


def test_many_overlaps_are_counted_and_the_first_named():
    cars = [Car(number, 50.0 + number, velocity=1.0) for number in range(1, 5)]
    (note,) = [note for note in evaluate(on_a_road(*cars)).notes if "overlap" in note]
    assert note.startswith("6 pairs of vehicles overlap from the start and are not among")
    assert note.endswith("1 and 2, 1 and 3, 1 and 4 and 3 more")


@pytest.fixture(scope="module")
def crossed(scenarios_folder):
    return evaluate(read_scenario(scenarios_folder / "t_junction" / "ZAM_Tjunction-1_42_T-1.xml"))


def test_the_time_of_encroachment_is_when_the_first_vehicle_has_left(crossed):
    pairs = crossed.most_critical_pairs("pet", 9)
    assert pairs[0] == crossed.most_critical("pet")
    for moment in pairs:
        row = crossed.row(moment.participant_id)
        assert moment.time_step > crossed.first_time_step
        column = moment.time_step - crossed.first_time_step
        series = crossed.series["pet"].value[row]
        assert series[column] == moment.value
        assert not (series[column + 1 :] == moment.value).any()


def test_the_moment_of_the_closest_encounter_is_the_encounter():
    found = evaluate(on_a_road(Car(1, 20.0, velocity=10.0), Car(2, 60.0, y=3.5, velocity=0.5), lanes=2, steps=80))
    (pair,) = found.most_critical_pairs("dce", 9)
    assert pair.time_step * found.dt == pytest.approx(40.0 / 9.5, abs=0.51)
    assert pair == found.most_critical("dce")


# Tables


def test_a_result_is_a_table_and_a_data_frame():
    found = evaluate(on_a_road(Car(1, 50.0, velocity=10.0), Car(2, 90.0, velocity=5.0), steps=3))
    table = found.to_arrow()
    assert table.equals(criticality_table(found))
    assert origin_of(table) == found.origin
    pandas = pytest.importorskip("pandas")
    frame = found.to_pandas()
    assert isinstance(frame, pandas.DataFrame)
    assert list(frame.columns) == table.column_names
    assert len(frame) == table.num_rows
    polars = pytest.importorskip("polars")
    assert isinstance(found.to_polars(), polars.DataFrame)


def test_several_files_have_one_joint_table(tmp_path):
    near = on_a_road(Car(11, 20.0, velocity=10.0), Car(12, 40.0, velocity=5.0))
    far = on_a_road(Car(13, 20.0, velocity=10.0), Car(14, 80.0, velocity=8.0))
    files = [write(near, tmp_path / "a" / "one.xml"), write(far, tmp_path / "b" / "one.xml")]
    result = invoke("criticality", *map(str, files), "--out", str(tmp_path / "tables"))
    assert result.exit_code == 0, result.output
    joint = pq.read_table(tmp_path / "tables" / "criticality_joint.parquet")
    assert joint.column_names[:3] == ["scenario", "participant_id", "time_step"]
    names = joint["scenario"].to_pylist()
    assert len(set(names)) == 2  # of the same name, but told apart
    assert joint["participant_id"].unique().to_pylist() == [11, 12, 13, 14]
    assert joint.num_rows == 4 * len(MEASURES)


def test_a_joint_table_says_whence_each_part_comes_and_may_be_empty(tmp_path):
    found: Criticality = evaluate(on_a_road(Car(1, 50.0, velocity=10.0)))
    path = save_joint_criticality({"one": found.origin.marked(criticality_extremes_table(found))}, tmp_path)
    origin = origin_of(pq.read_table(path))
    assert set(origin.inputs) == {"one: scenario"}
    assert pq.read_table(save_joint_criticality({}, tmp_path)).num_rows == 0


# Figures


def test_no_marker_lies_outside_its_panel():
    from interdrive.plots import draw_criticality

    found = evaluate(on_a_road(Car(1, 50.0, velocity=10.0), Car(2, 130.0, velocity=9.99999)))
    figure = draw_criticality(found, 1)
    for axes in figure.axes:
        low, high = axes.get_ylim()
        for line in axes.lines:
            if line.get_marker() == "o":
                assert low <= line.get_ydata()[0] <= high, axes.get_title(loc="left")


# Words

#: Where measures and terms of scores are told beside each other; within criticality only one time to collision is.
TOLD = ("batches", "benchmarks", "cli", "comparison", "plots", "report", "results", "scoring", "studies")


def test_the_time_along_lanes_and_the_time_straight_on_are_named_apart_wherever_both_are_told():
    root = Path(__file__).parents[2]
    files = [path for folder in TOLD for path in (root / "python" / "interdrive" / folder).rglob("*.py")]
    files += [*(root / "frontend" / "src").glob("*.ts"), *(root / "docs" / "tutorials").glob("*.md")]
    files += [root / "docs" / "concepts" / "outcomes.md", *(root / "docs" / "how_to").glob("*.md")]
    files += [root / "docs" / "reference" / f"{name}.md" for name in ("batches", "report", "scoring", "settings")]
    bare = re.compile(r"time to collision(?!\s+along\s+lanes)|time to contact(?!\s+straight\s+on)", re.IGNORECASE)
    # A title of a paper may have any words.
    said = {path: re.sub(r'"A comparison of headway and time to collision"', "", path.read_text()) for path in files}
    assert [path.name for path, text in said.items() if bare.search(text)] == []


def test_scores_do_not_call_their_time_a_ttc():
    from interdrive.cli.score_report import _PARTS
    from interdrive.scoring.tables import SCORE_COLUMNS

    assert _PARTS["ttc_term"] == "contact"
    assert not [one.name for one in SCORE_COLUMNS if "TTC" in one.text or "time to collision" in one.text]


def test_one_title_names_the_measure_in_stories_events_and_the_reference():
    reference = (Path(__file__).parents[2] / "docs" / "reference" / "criticality.md").read_text()
    assert f"### ttc: {measure_named('ttc').title} [s]" in reference
