"""The runtime study: what is measured, how it is summarized, what is written, and what is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

from interdrive.cli import main
from interdrive.errors import InputError, ResultsError
from interdrive.storage import arrow_table
from interdrive.studies import runtime
from interdrive.studies.runtime.measure import STEP_COLUMNS

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def study():
    """The town with few agents and steps; what the machine does meanwhile does not matter."""
    cases, _ = runtime.runtime_cases((), (2, 5), to_all=False)
    return runtime.runtime_study(cases[-1:], steps=3, repetitions=2, threads=2)


def invented(seconds, *, kind="town", scenario="town", predictor="lane_following"):
    """A study with given times of steps by (agents, threads), for two threads."""
    rows = []
    for (agents, threads), times in seconds.items():
        for index, time in enumerate(times):
            rows.append(
                (kind, scenario, predictor, agents, agents, threads, 0, index, agents, time, *6 * (0.1 * time,))
            )
    columns = {column.name: [row[k] for row in rows] for k, column in enumerate(STEP_COLUMNS)}
    machine = {"processor": "P", "cores": 2, "system": "S", "python": "3", "load": 0.1}
    settings = {"steps": 3, "repetitions": 1, "planner": "frenet"}
    return runtime.RuntimeStudy(arrow_table(STEP_COLUMNS, columns), 2, machine, settings, ())


def test_every_number_of_agents_is_driven_with_one_thread_and_with_all(study):
    steps = study.steps.to_pandas()
    assert sorted(set(zip(steps.agents, steps.threads, steps.repetition, strict=True))) == [
        (agents, threads, repetition) for agents in (2, 5) for threads in (1, 2) for repetition in (0, 1)
    ]
    # The first step is not counted.
    assert set(steps.time_step) == {1, 2, 3}
    assert (steps.driving == steps.agents).all()
    assert (steps.participants == steps.agents).all()


def test_the_parts_of_a_step_are_measured_and_no_longer_than_the_step(study):
    steps = study.steps.to_pandas()
    parts = steps[["observe", "predict", "plan", "collision", "update"]]
    assert (parts > 0.0).all(axis=None)
    assert (parts.sum(axis=1) < steps.step).all()
    assert ((steps.python > 0.0) & (steps.python < steps.step)).all()


def test_the_first_agents_of_the_town_are_near_each_other():
    from interdrive.simulation import Simulation

    states = Simulation("town", agents=25).record().states
    assert np.ptp(states.x[:, 0]) < 240.0
    assert np.ptp(states.y[:, 0]) < 240.0


def test_the_summary_has_quartiles_over_all_repetitions():
    table = runtime.summary_table(invented({(24, 1): [1.0, 2.0, 3.0, 4.0, 5.0]})).to_pylist()
    assert [(row["lower"], row["median"], row["upper"], row["mean"], row["steps"]) for row in table] == [
        (2.0, 3.0, 4.0, 3.0, 5)
    ]
    # 4 and 0.96 of the way to 5.
    assert table[0]["slow"] == pytest.approx(4.96)
    assert table[0]["python"] == pytest.approx(0.3)


def test_steps_in_which_many_have_arrived_already_do_not_count():
    study = invented({(10, 1): [1.0, 1.0, 9.0]})
    driving = study.steps.column_names.index("driving")
    thinned = study.steps.set_column(driving, study.steps.schema.field("driving"), [[10, 9, 8]])
    assert runtime.summary_table(replace(study, steps=thinned)).to_pylist()[0]["mean"] == 1.0


def test_growth_is_the_exponent_of_a_power_law():
    found = runtime.growth(invented({(n, 2): [1e-5 * n**1.25] for n in (24, 100, 300, 1000)}), 2)
    assert found.exponent == pytest.approx(1.25)
    assert found.factor == pytest.approx(1e-5)
    assert found.to_linear == pytest.approx((1000 / 24) ** 0.25)
    assert runtime.growth(invented({(24, 2): [1.0]}), 2) is None
    assert runtime.growth(invented({(24, 2): [1.0], (100, 2): [1.0]}, kind="highway"), 2) is None


def test_shipped_scenarios_stand_in_for_recorded_ones(monkeypatch, tmp_path):
    monkeypatch.delenv("INTERDRIVE_SCENARIOS", raising=False)
    cases, notes = runtime.runtime_cases()
    assert [case.path.stem for case in cases] == ["highway", "intersection", "highway", "town"]
    assert notes[0] == "USA_US101-23_1_T-1: INTERDRIVE_SCENARIOS names no folder; shipped highway instead"
    assert notes[2].endswith("left out")
    (tmp_path / "urban").mkdir()
    (tmp_path / "urban" / "CHN_Sha-3_1_T-1.xml").write_text("")
    monkeypatch.setenv("INTERDRIVE_SCENARIOS", str(tmp_path))
    cases, notes = runtime.runtime_cases()
    assert [case.path.stem for case in cases[:3]] == ["highway", "intersection", "CHN_Sha-3_1_T-1"]
    assert len(notes) == 3


def test_the_folder_has_tables(study, tmp_path):
    folder = runtime.save_runtime(study, tmp_path / "study")
    tables = {"runtime.json", "steps.parquet", "summary.csv", "summary.parquet"}
    assert {path.name for path in folder.iterdir()} == tables
    assert pq.read_table(folder / "steps.parquet").num_rows == 24
    told = json.loads((folder / "runtime.json").read_text())
    assert told["growth"]["2"]["agents"] == [2, 5]
    with pytest.raises(ResultsError, match="a runtime study already exists there"):
        runtime.save_runtime(study, folder)
    runtime.save_runtime(study, folder, overwrite=True)


def test_the_command_measures_prints_and_writes(tmp_path, monkeypatch):
    monkeypatch.delenv("INTERDRIVE_SCENARIOS", raising=False)
    options = ["--agents", "1,2", "--town", "2,3", "--steps", "2", "--repetitions", "1", "--threads", "2"]
    found = CliRunner().invoke(main, ["study", "runtime", *options, "--out", str(tmp_path / "out")])
    assert found.exit_code == 0, found.output
    assert "milliseconds per step" in found.output
    assert "shipped highway instead" in found.output
    rows = pq.read_table(tmp_path / "out" / "summary.parquet").to_pylist()
    assert {(row["kind"], row["agents"]) for row in rows} == {
        (kind, n)
        for kind, ns in (("six-lane highway", (1, 2)), ("large intersection", (1, 2)), ("town", (2, 3)))
        for n in ns
    }


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["runtime", "--agents", "many"], "--agents many: write numbers of agents, such as 1,8,24"),
        (["runtime", "--agents", "0"], "--agents 0: write numbers of agents"),
        (["runtime", "--agent", "3"], "study runtime: --agent belongs to an encounter"),
        (["merge", "--quick"], "study merge: --quick belongs to `interdrive study runtime`"),
        (["runtime", "--town", "5000", "--agents", "1", "--steps", "1", "--repetitions", "1"], "only 1000 vehicles"),
    ],
)
def test_what_cannot_be_measured_is_one_line(arguments, text, tmp_path, monkeypatch):
    monkeypatch.delenv("INTERDRIVE_SCENARIOS", raising=False)
    monkeypatch.chdir(tmp_path)
    found = CliRunner().invoke(main, ["study", *arguments])
    assert found.exit_code == 2
    assert text in found.output
    assert len(found.output.strip().splitlines()) == 1
    assert not Path("out").exists()


def test_numbers_must_be_positive():
    cases, _ = runtime.runtime_cases((), (2,), to_all=False)
    with pytest.raises(InputError, match="steps must be at least 1, not 0"):
        runtime.runtime_study(cases, steps=0)
