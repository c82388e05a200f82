"""What is aimed at next to what the runtime study measured, in the tables of docs/research/performance.md."""

from __future__ import annotations

from dataclasses import replace

import pyarrow as pa
import pytest
from benchmarks.runtime import document, measured_targets, peak_memory, read_study, target_rows
from benchmarks.runtime_figures import growth_figure, runtime_figure

from interdrive.storage import arrow_table
from interdrive.studies.runtime import RuntimeStudy, save_runtime
from interdrive.studies.runtime.measure import STEP_COLUMNS


def invented(seconds, *, kind="town", scenario="town", predictor="lane_following", load=0.1):
    """A study with given times of steps by (agents, threads), for two threads."""
    rows = []
    for (agents, threads), times in seconds.items():
        for index, time in enumerate(times):
            rows.append(
                (kind, scenario, predictor, agents, agents, threads, 0, index, agents, time, *6 * (0.1 * time,))
            )
    columns = {column.name: [row[k] for row in rows] for k, column in enumerate(STEP_COLUMNS)}
    machine = {"processor": "P", "cores": 2, "system": "S", "python": "3", "load": load}
    settings = {"steps": 3, "repetitions": 1, "planner": "frenet"}
    return RuntimeStudy(arrow_table(STEP_COLUMNS, columns), 2, machine, settings, ())


def test_targets_are_compared_with_what_is_measured_and_the_others_name_their_command():
    name = "USA_US101-23_1_T-1"
    study = invented({(24, 1): [0.0038], (24, 2): [0.0019]}, kind="six-lane highway", scenario=name)
    found = measured_targets(study) | {"memory": 3e9}
    assert found == pytest.approx({"step_highway": 0.0019, "python_share": 0.1, "second_thread": 2.0, "memory": 3e9})
    rows = {row[0]: row[1:] for row in target_rows(found)}
    assert rows["step, 24 agents, six-lane highway"] == ("≤ 0.8 ms", "1.9 ms", "missed by 137 %")
    assert rows["second thread, 24 agents, USA_US101-23_1_T-1"] == ("≥ 1.85 times", "2 times", "reached")
    assert rows["peak memory, 1000 agents, 300 steps"] == ("≤ 0.4 GB", "3 GB", "missed by 650 %")
    assert rows["agent-steps per second of T1"][:1] == ("≥ 1e+06 /s",)
    assert rows["step against highway-env"][1:] == ("–", "measured by benchmarks/peers/rule_based.py")


def test_slow_steps_are_those_of_the_slowest_of_four_scenarios():
    kinds = ["six-lane highway", "large intersection", "residential area", "urban arterial"]
    studies = [invented({(24, 2): [0.001 * (i + 1)]}, kind=kind, scenario=kind) for i, kind in enumerate(kinds)]
    four = replace(studies[0], steps=pa.concat_tables([study.steps for study in studies]))
    assert measured_targets(four)["step_slow"] == 0.004
    three = replace(four, steps=pa.concat_tables([study.steps for study in studies[1:]]))
    assert "step_slow" not in measured_targets(three)


def test_the_growth_target_needs_24_and_1000_agents():
    small = invented({(24, 2): [0.001], (100, 2): [0.005]})
    assert "growth" not in measured_targets(small)
    large = invented({(24, 2): [0.001], (1000, 2): [0.05]})
    assert measured_targets(large)["growth"] == pytest.approx(1.2)
    assert measured_targets(large)["step_1000"] == 0.05


def test_the_document_says_that_the_machine_was_busy():
    quiet = document(invented({(24, 2): [0.001], (1000, 2): [0.05]}))
    assert "| 2 | 42 at 24, 50 at 1000 | 1.049 | 1.20 |" in quiet
    assert "busy" not in quiet
    alone = document(invented({(24, 1): [0.002], (100, 1): [0.01], (100, 2): [0.005]}))
    assert "| town | 100 | 1,000 |" in alone, "100 agents, 0.1 s each, in 10 ms of one core"
    assert "**The machine was busy** (load 3.0 before)" in document(invented({(24, 2): [0.001]}, load=3.0))


def test_peak_memory_is_that_of_a_process_of_its_own():
    assert 2e7 < peak_memory(2, 2) < 1e9


def test_a_study_is_read_from_its_folder(tmp_path):
    study = invented({(2, 1): [0.001], (5, 1): [0.002], (2, 2): [0.001], (5, 2): [0.002]})
    again = read_study(save_runtime(study, tmp_path / "study"))
    assert again.steps.to_pylist() == study.steps.to_pylist()
    assert "| town | 5 |" in document(again)


def test_growth_is_drawn_if_the_town_was_driven_with_two_numbers_of_agents():
    grown = invented({(2, 1): [0.001], (5, 1): [0.002], (2, 2): [0.001], (5, 2): [0.002]})
    assert growth_figure(grown).axes[0].get_xlabel() == "agents"
    assert growth_figure(invented({(2, 1): [0.001], (2, 2): [0.001]})) is None
    (panel,) = runtime_figure(grown).axes
    assert [text.get_text() for text in panel.get_xticklabels()] == ["2", "5"]
