"""Rows of known planners that come with benchmark sets: complete, of this set, and repeated on a part of it."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from pathlib import Path

import pytest

import interdrive as idr
from interdrive.benchmarks import read_set, run
from interdrive.benchmarks.reference import reference_rows, stored_reference

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[2]

#: Sets and splits with rows, and planners that they have.
SHIPPED = [
    (
        "shipped-2",
        "dev",
        ("fiss", "frenet", "frenetix", "idm", "idm_mobil", "lawful", "pdm", "reactive", "recorded", "rollout"),
    ),
    ("public-1", "test", ("frenet", "idm", "idm_mobil", "lawful", "pdm", "recorded", "rollout")),
]


@pytest.mark.parametrize(("name", "split", "planners"), SHIPPED)
def test_reference_rows_are_complete_and_of_this_set(name, split, planners):
    chosen, stored = read_set(name), stored_reference(name)
    files = chosen.of_split(split)
    rows = reference_rows(chosen, split)
    categories = {"all", *(file.category for file in files)}
    assert stored["set_sha256"] == chosen.sha256
    assert {(row.planner, row.category) for row in rows} == {(p, c) for p in planners for c in categories}
    n_agents = sum(len(file.agents) for file in files)
    for row in rows:
        assert row.version
        if row.category == "all":
            is_former = math.isnan(row.non_reactive)
            assert 0.0 <= (row.score_1_non_reactive if is_former else row.non_reactive) <= 100.0
            if row.planner == "recorded":
                assert math.isnan(row.score), "humans who are replayed do not react"
            elif is_former:
                assert 0.0 <= row.score_1 <= 100.0, "rows of the release before have score 1 alone"
            else:
                assert 0.0 <= row.score <= 100.0
                n_places = len({file.place for file in files})
                assert math.isnan(row.low) if n_places < 5 else row.low <= row.score <= row.high
            # Agents of planning problems have no recording; agents whose recordings overlap have no score.
            assert row.n_agents + row.n_left_out == n_agents
            assert row.n_scenarios == len(files) or row.planner == "recorded"
    scenarios = stored["splits"][split]["scenarios"]
    names = {file.name for file in files}
    assert all(set(scores) == names or planner == "recorded" for planner, scores in scenarios.items())
    assert set(scenarios) == set(planners)
    assert set(scenarios["recorded"]) <= names


@pytest.mark.parametrize(("name", "split", "planners"), SHIPPED)
def test_the_number_of_a_planner_is_the_mean_of_its_scenarios(name, split, planners):
    rows = {row.planner: row for row in reference_rows(read_set(name), split) if row.category == "all"}
    for planner in planners:
        traffic, number = ("recorded", "non_reactive") if planner == "recorded" else ("velocity_adjusting", "score")
        if math.isnan(rows[planner].non_reactive):
            number = "score_1_non_reactive" if planner == "recorded" else "score_1"
        scores = [one[traffic] for one in stored_reference(name)["splits"][split]["scenarios"][planner].values()]
        assert getattr(rows[planner], number) == pytest.approx(sum(scores) / len(scores))


@pytest.mark.parametrize(
    ("planner", "chosen", "split", "name"),
    [
        ("idm", "shipped-2", "dev", "t_junction"),
        ("frenet", "shipped-2", "dev", "lane_merge"),
    ],
)
def test_a_part_of_the_set_gives_the_stored_scores_again(
    planner, chosen, split, name, tmp_path, monkeypatch, scenarios_folder
):
    """If drives have changed on purpose: `benchmarks/reference.py` says how to make the rows anew."""
    whole = read_set(chosen)
    part = replace(whole, files=tuple(file for file in whole.files if file.name == name))
    monkeypatch.setattr(run, "read_set", lambda _: part)
    found = idr.benchmark(
        planner, set=chosen, split=split, scenarios=scenarios_folder, out=tmp_path / "out", workers=1
    ).scenarios[planner][name]
    assert found == pytest.approx(stored_reference(chosen)["splits"][split]["scenarios"][planner][name], abs=1e-9)


def test_the_documented_tables_are_the_stored_rows():
    sys.path.insert(0, str(ROOT / "benchmarks"))
    try:
        import reference
    finally:
        sys.path.remove(str(ROOT / "benchmarks"))
    page = (ROOT / "docs" / "research" / "scores.md").read_text(encoding="utf-8")
    assert "| `frenet` |" in page
    assert reference.documented(page) == page, "python benchmarks/reference.py writes them"
