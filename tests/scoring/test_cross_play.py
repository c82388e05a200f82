"""Columns of a benchmark: who drives the others; passages through joined recordings; classes with weights."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import replace

import pytest

import interdrive as idr
from interdrive.batches.store import BatchFolder
from interdrive.benchmarks import read_benchmark, read_set, run
from interdrive.benchmarks.fitted import fitted_notes
from interdrive.benchmarks.passages import located
from interdrive.benchmarks.ranking_tables import COLUMNS_MAX
from interdrive.benchmarks.sets import BenchmarkSet, Passage, Recording, SetFile
from interdrive.comparison.variants import rows_of
from interdrive.files import write_scenario
from interdrive.scenario import Scenario
from interdrive.testing import Car, straight_road, world

ABOUT = {"category": "highway", "place": "road", "traffic": "recorded", "split": "dev"}


@pytest.fixture
def windows(tmp_path):
    """Two windows of 4 s of one recording in which vehicle 7 drives all the time and 8 comes later."""
    paths = []
    for number, first in enumerate((0, 40)):
        cars = [Car(7, 10.0 + first, velocity=10.0)]
        cars += [Car(8, 5.0, velocity=10.0, first=20)] if first == 0 else [Car(8, 25.0, velocity=10.0)]
        part: Scenario = world(straight_road(200.0), cars=cars, steps=39, name=f"ZAM_Road-1_{number + 1}_T-1")
        paths.append(tmp_path / "scenarios" / f"{part.name}.xml")
        paths[-1].parent.mkdir(exist_ok=True)
        write_scenario(part, paths[-1])
    return paths


def a_set(windows, *passages, **more):
    parts = tuple(
        SetFile(path.stem, hashlib.sha256(path.read_bytes()).hexdigest(), ("a/b", path.name, "1"), **ABOUT, agents=())
        for path in windows
    )
    files = tuple(
        SetFile(f"long_{agent}", "", (), **ABOUT, agents=(agent,), road_class="motorway",
                passage=Passage("long", first, end))
        for agent, first, end in passages
    )  # fmt: skip
    return BenchmarkSet("tiny-1", "A tiny set.", files, "0" * 64, recordings={"long": Recording("long", parts)}, **more)


def test_a_passage_begins_where_the_vehicle_enters_and_has_the_others_where_they_are_then(tmp_path, windows):
    chosen = a_set(windows, (8, 20, 90))
    there, found, missing = located(chosen, chosen.files, windows[0].parent, tmp_path / "passages")
    assert not missing
    part = idr.read_scenario(found[there[0].sha256])
    ids = part.obstacles.ids.tolist()
    assert ids == [7, 8]
    assert part.obstacles.x[ids.index(8), 0] == pytest.approx(5.0)
    assert part.obstacles.x[ids.index(7), 0] == pytest.approx(30.0), "m: 2 s at 10 m/s from 10 m"
    assert part.obstacles.valid.shape[1] == 60, "steps 20 to 79"


def test_passages_are_made_once_and_from_other_windows_anew(tmp_path, windows):
    chosen, made = a_set(windows, (7, 0, 80), (8, 20, 80)), []
    for _ in range(2):
        there, found, _ = located(chosen, chosen.files, windows[0].parent, tmp_path / "passages", made.append)
        assert len(there) == len(found) == 2
    assert made == ["long"]


def test_a_recording_with_a_missing_window_is_missing(tmp_path, windows):
    chosen = a_set(windows, (7, 0, 80))
    windows[1].unlink()
    there, found, missing = located(chosen, chosen.files, windows[0].parent, tmp_path / "passages")
    assert not there and not found
    assert missing == [
        "long, 1 passages: 1 of 2 windows are missing: ZAM_Road-1_2_T-1: not found (a/b ZAM_Road-1_2_T-1.xml 1)"
    ]


def test_a_benchmark_of_passages_has_a_column_for_each_kind_of_traffic(tmp_path, windows, monkeypatch):
    chosen = a_set(windows, (8, 20, 90), weights={"motorway": 1.0}, traffic=("recorded", "idm"), counted=("idm",))
    monkeypatch.setattr(run, "read_set", lambda _: chosen)
    found = idr.benchmark(
        "idm,recorded", scenarios=windows[0].parent, predictor="constant_velocity", out=tmp_path / "out", workers=1,
        panel="none",
    )  # fmt: skip
    idm, human = found.table
    assert set(idm.columns) == {"recorded", "idm"} and not math.isnan(idm.number)
    assert idm.number == idm.columns["idm"] == found.score
    assert math.isnan(human.number) and math.isnan(human.columns["idm"]) and human.columns["recorded"] > 0.0
    stored = json.loads((tmp_path / "out" / "benchmark.json").read_text())
    assert [row["number"] for row in stored["rows"]] == [idm.number, None]
    assert stored["ranking"]["ranks"][0]["planner"] == "idm"
    text = (tmp_path / "out" / "ranking.md").read_text(encoding="utf-8")
    assert "replay" in text and f"{idm.columns['idm']:.1f}*" in text, "among its own copies"
    assert max(line.count("|") for line in text.splitlines()) <= COLUMNS_MAX + 1
    assert (tmp_path / "out" / "ranking.tex").read_text(encoding="utf-8").count("\\begin{table}") == text.count("| ---")
    monkeypatch.setattr("interdrive.benchmarks.run.read_set", lambda _: chosen)
    again = {row.planner: row for row in read_benchmark(tmp_path / "out")}
    assert again["idm"].number == idm.number and again["idm"].columns == idm.columns


@pytest.mark.long
def test_a_table_for_a_paper_has_the_weighted_number_beside_the_score(tmp_path, windows, monkeypatch):
    chosen = a_set(windows, (8, 20, 90), weights={"motorway": 1.0}, traffic=("recorded", "velocity_adjusting", "idm"),
                   counted=("velocity_adjusting", "idm"))  # fmt: skip
    monkeypatch.setattr(run, "read_set", lambda _: chosen)
    found = idr.benchmark(
        "idm", scenarios=windows[0].parent, predictor="constant_velocity", out=tmp_path / "out", workers=1, panel="none"
    )
    head, _, row, *_, caption = (tmp_path / "out" / "paper.md").read_text(encoding="utf-8").splitlines()
    cells = dict(zip(*([cell.strip() for cell in line.split("|")] for line in (head, row)), strict=True))
    assert cells["number"] == f"{found.score:.1f}"
    assert cells["score"] == f"{found.table[0].score:.1f}"
    assert "Number: with the weights of classes, mean over the traffic that counts; other columns: among" in caption


def test_traffic_may_be_any_native_planner(tmp_path):
    idr.batch(
        ["t_junction"], tmp_path / "out", planner="idm", predictor="constant_velocity", traffic="lawful", agents=1,
        workers=1,
    )  # fmt: skip
    rows = rows_of(BatchFolder.open(tmp_path / "out").table())
    assert set(rows["traffic"]) == {"lawful"}
    drivers = zip(rows["under_test"].tolist(), rows["agent_planner"], strict=True)
    assert {(bool(tested), name) for tested, name in drivers} == {(True, "idm"), (False, "lawful")}


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"columns": "replay,walking"}, "columns: expected one of replay, recorded, velocity_adjusting, rollout"),
        ({"columns": "same"}, "name planners"),
        ({"columns": ["policy"]}, "columns: expected one of"),
        ({"power": 0.0}, "must be above 0 and at most 100 points"),
    ],
)
def test_bad_columns_are_one_line(tmp_path, options, said):
    with pytest.raises(idr.InputError, match=said) as error:
        idr.benchmark("idm", out=tmp_path / "out", **options)
    assert "\n" not in str(error.value)


def test_without_all_traffic_that_counts_there_is_no_number(tmp_path, monkeypatch):
    whole = read_set("shipped-2")
    junction = next(file for file in whole.files if file.name == "t_junction")
    monkeypatch.setattr(run, "read_set", lambda _: replace(whole, files=(replace(junction, agents=(1002,)),)))
    found = idr.benchmark(
        "idm", columns="replay", predictor="constant_velocity", out=tmp_path / "out", workers=1, panel="none"
    )
    assert math.isnan(found.score) and found.table[0].columns["recorded"] > 0.0
    assert found.ranking is not None and [one.rank for one in found.ranking.ranks] == [0]
    assert found.command.endswith("--panel none --columns recorded")


def test_drivers_that_were_fitted_on_a_place_of_the_set_are_told():
    """`calibrated` drivers of idm were fitted on MONA East and US 101, usual ones on nothing."""
    files = read_set("public-2").files
    (told,) = fitted_notes(["idm", "idm,drivers=house", "idm,drivers=calibrated"], files)
    own = [file for file in files if file.place in ("MONA-East", "US 101, Los Angeles")]
    assert told == (
        f"idm,drivers=calibrated was fitted on MONA-East, US 101, Los Angeles ({len(own)} of {len(files)} files): "
        "scores there are no test of it"
    )
    elsewhere = [file for file in files if file not in own]
    assert fitted_notes("idm,drivers=calibrated", elsewhere) == ()
