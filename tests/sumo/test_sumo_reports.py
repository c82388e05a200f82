"""Runs among vehicles of SUMO on pages: everybody is there, named, and told from agents."""

from __future__ import annotations

import numpy as np
import pytest
from click.testing import CliRunner

import interdrive as idr
from interdrive.cli import main
from interdrive.report.contents import run_contents


@pytest.fixture
def run(crossing):
    return idr.simulate(crossing, planner="idm", threads=1)


def test_a_page_holds_vehicles_of_sumo_by_their_names(run, tmp_path):
    header = run_contents(run.save(tmp_path / "run")).header
    names = dict(zip(run.sumo.participant_id.tolist(), run.sumo.name, strict=True))
    assert len(names) > 3
    by_id = {one["id"]: one for one in header["participants"]}
    assert set(names) < set(by_id)
    assert {by_id[number]["agent"] for number in names} == {-1}
    assert {number: by_id[number]["name"] for number in names} == names
    agents = [one for one in header["participants"] if one["agent"] >= 0]
    assert len(agents) == len(run.agents) == len(by_id) - len(names)
    assert not any("name" in one for one in agents)


def test_a_page_shows_them_for_as_long_as_they_are_there(run, tmp_path):
    contents = run_contents(run.save(tmp_path / "run"))
    rows = np.searchsorted(run.states.participant_id, run.sumo.participant_id)
    there = run.states.valid[rows].sum(axis=1)
    assert there.min() < run.states.n_steps, "some come or go"
    assert contents.header["n_steps"] == run.states.n_steps
    assert "flows" not in contents.header, "SUMO makes this traffic"


def test_the_command_line_makes_the_page(crossing, tmp_path):
    folder = tmp_path / "run"
    done = CliRunner().invoke(
        main, ["run", str(crossing), "--planner", "idm", "--out", str(folder), "--report", "--threads", "1"]
    )
    assert done.exit_code == 0, done.output
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert '"name": "' in page or '"name":"' in page
    assert len(page) > 100_000


def test_the_command_line_drives_without_agents(crossing, tmp_path):
    folder = tmp_path / "run"
    words = ["run", str(crossing), "--agents", "0", "--set", "step.duration=2", "--out", str(folder), "--report"]
    done = CliRunner().invoke(main, words)
    assert done.exit_code == 0, done.output
    assert "crossing, no agents" in done.output
    assert CliRunner().invoke(main, ["verify", str(folder)]).exit_code == 0
