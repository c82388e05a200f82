"""Benchmarks: versioned sets found by content, one number per planner."""

from __future__ import annotations

import hashlib
import json
import math
import shutil
from dataclasses import replace

import pytest
from click.testing import CliRunner

import interdrive as idr
from interdrive.batches.store import BatchFolder
from interdrive.benchmarks import read_set, run, set_names
from interdrive.benchmarks.sets import find_files
from interdrive.cli import main
from interdrive.files import shipped_scenario

pytestmark = pytest.mark.long


def test_released_sets_are_known_by_their_content():
    assert set_names() == ("public-1", "public-2", "shipped-2")
    public = read_set("public-1")
    assert (len(public.files), len(public.of_split("test"))) == (92, 34)
    assert sum(len(file.agents) for file in public.files) == 1125
    assert public.sha256 == "e712e5f06adb13cacfee40043843128cc85645c506a5d28657666d4dca74e6a9"
    assert {len(file.source) for file in public.files} == {3}


def test_public_2_has_passages_of_three_recordings_and_a_weight_for_each_class():
    found = read_set("public-2")
    assert found.sha256 == "3c95b1b3c4d8c3bf54d668dfcb6a971edeb3e9323e6a92a3c7fd0c620c95e197"
    assert {name: len(one.parts) for name, one in found.recordings.items()} == {
        "MONAEast": 30, "MONAMerge": 14, "AachenBendplatz": 12,
    }  # fmt: skip
    passages = [file for file in found.files if file.passage is not None]
    assert (len(passages), len(found.files)) == (164, 241)
    assert {file.road_class for file in found.files} == found.weights.keys()
    assert {*found.counted} < {*found.traffic} and sum(found.weights.values()) == pytest.approx(1.0)
    assert not any(file.category == "format_edge_cases" for file in found.files)
    assert max(len(file.agents) for file in found.files) == 5


@pytest.mark.parametrize("name", ["public-1", "public-2"])
def test_no_place_is_in_both_splits(name):
    parts = {}
    for file in read_set(name).files:
        parts.setdefault(file.place, set()).add(file.split)
    assert {len(part) for part in parts.values()} == {1}


def test_shipped_files_are_those_of_the_package():
    for file in read_set("shipped-2").files:
        content = shipped_scenario(file.name).read_bytes()
        assert hashlib.sha256(content).hexdigest() == file.sha256, "make a new version of the set"


def test_files_are_found_below_a_folder_and_other_content_is_told(tmp_path):
    wanted = tuple(replace(file, source=("a/b", "c.xml", "1")) for file in read_set("shipped-2").files[:2])
    first, second = (replace(file, name=f"copy_{file.name}") for file in wanted)
    (tmp_path / "below").mkdir()
    shutil.copy(shipped_scenario(wanted[0].name), tmp_path / "below" / f"{first.name}.xml")
    (tmp_path / f"{second.name}.xml").write_text("<other/>")
    other = replace(second, sha256="0" * 64)
    found, missing = find_files((first, other, replace(other, name="gone")), tmp_path)
    assert list(found) == [first.sha256]
    assert missing[0].endswith(f"{second.name}.xml has other contents")
    assert missing[1] == "gone: not found (a/b c.xml 1)"


def test_a_benchmark_has_a_number_an_interval_and_the_command_that_repeats_it(tmp_path, monkeypatch):
    whole = read_set("shipped-2")
    junction = next(file for file in whole.files if file.name == "t_junction")
    tiny = replace(whole, files=(replace(junction, agents=(1002, 1006)),))
    gone = replace(junction, name="gone", sha256="0" * 64, place="elsewhere", agents=(1,))
    monkeypatch.setattr(run, "read_set", lambda _: replace(tiny, files=(*tiny.files, gone)))
    found = idr.benchmark("recorded", predictor="constant_velocity", out=tmp_path / "out", workers=1)
    assert (math.isnan(found.score), found.table[0].score_1_non_reactive) == (True, pytest.approx(100.0))
    assert 0.0 < found.table[0].non_reactive < 100.0, "recordings are noisy, and the panel is comfortable"
    assert (found.table[0].n_agents, found.table[0].zeros, found.is_partial) == (2, {}, True)
    assert found.missing == ("gone: not found (shipped)",)
    stored = json.loads((tmp_path / "out" / "benchmark.json").read_text())
    assert (stored["partial"], stored["rows"][0]["planner"]) == (True, "recorded")
    assert stored["panel"] == "lawful, idm, idm_mobil, rollout"
    row = stored["rows"][0]
    assert (row["number"], row["columns"]) == (None, {"recorded": row["non_reactive"], "velocity_adjusting": None})
    assert list((tmp_path / "out" / "panel").glob("*.npz"))
    assert stored["command"] == "interdrive benchmark recorded --set shipped-2 --split dev"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "name a planner"),
        (["idm", "--set", "private-1"], "there are public-1, public-2, shipped-2"),
        (["idm", "--split", "train"], "expected one of test, dev, all"),
        (["idm", "--split", "test"], "shipped-2 has no scenarios; use all"),
        (["idm", "--set", "public-1", "--scenarios", "no/such/folder"], "no such folder"),
    ],
)
def test_bad_input_is_one_line(arguments, said):
    result = CliRunner().invoke(main, ["benchmark", *arguments])
    assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
    assert said in result.stderr


def test_a_planner_of_your_own_that_crawls_ranks_below_one_that_drives(tmp_path, monkeypatch):
    """It drives as `lawful` does, at a third of the speed, and waits for nobody."""
    (tmp_path / "mine.py").write_text(
        "from interdrive.adversaries.drivers import Driver\n\n\n"
        "class Steady(Driver):\n    pass\n\n\n"
        "class Crawl(Driver):\n    obeys_rules = False\n    speed_factor = 0.33\n",
        encoding="utf-8",
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    whole = read_set("shipped-2")
    junction = next(file for file in whole.files if file.name == "t_junction")
    monkeypatch.setattr(run, "read_set", lambda _: replace(whole, files=(replace(junction, agents=(1002, 1006)),)))
    found = idr.benchmark(
        "mine.py:Crawl,mine.py:Steady,lawful", predictor="constant_velocity", out=tmp_path / "out", workers=1
    )
    rows = BatchFolder.open(tmp_path / "out").table(["agent_id", "under_test"]).to_pylist()
    assert {row["agent_id"] for row in rows if row["under_test"]} == {1002, 1006}, "the set has no others of the file"
    crawl, steady, lawful = (row.score for row in found.table if row.category == "all")
    assert crawl < 60.0 < min(steady, lawful)
    paper = (tmp_path / "out" / "paper.md").read_text(encoding="utf-8").splitlines()
    assert paper[-1].startswith("Set shipped-2 (SHA-256 ") and "interdrive benchmark mine" in paper[-1]
    assert (tmp_path / "out" / "paper.tex").read_text(encoding="utf-8").startswith("\\begin{table}")


def test_a_population_of_drivers_is_a_row_of_its_own_and_the_same_each_time(tmp_path, monkeypatch):
    whole = read_set("shipped-2")
    junction = next(file for file in whole.files if file.name == "t_junction")
    monkeypatch.setattr(run, "read_set", lambda _: replace(whole, files=(replace(junction, agents=(1002, 1006)),)))
    scores = []
    for name in ("first", "second"):
        found = idr.benchmark(
            ["idm", "idm,drivers=calm"],
            predictor="constant_velocity",
            panel="none",
            out=tmp_path / name,
            workers=1,
        )
        stored = json.loads((tmp_path / name / "benchmark.json").read_text())
        assert [row["planner"] for row in stored["rows"]] == ["idm", "idm,drivers=calm"]
        scores.append([row.score for row in found.table if row.category == "all"])
    assert scores[0] == scores[1]
    assert scores[0][0] != scores[0][1], "calm drivers keep more room"
