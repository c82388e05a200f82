"""Stored panels: nothing is driven where they are there, and scores have the same bits."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

import interdrive as idr
from interdrive.benchmarks import store_panel
from interdrive.cli import main
from interdrive.errors import InputError, ResultsError
from interdrive.panel import PANEL, PanelFolder, World
from interdrive.panel.stored import Asked
from interdrive.results import save
from interdrive.scoring import ScoringSettings, score_table
from interdrive.scoring.judgement import PanelDrives
from interdrive.scoring.settings import ComfortBounds, PanelWeights

AGENT, OTHERS = 2001, [1003, 1006]


def drive(planner="idm", traffic="velocity_adjusting"):
    chosen = {AGENT: planner, "default": traffic}
    return idr.simulate("t_junction", agents=[AGENT, *OTHERS], planner=chosen, threads=1)


@pytest.fixture(scope="module")
def run():
    return drive()


@pytest.fixture(scope="module")
def folder(run, tmp_path_factory):
    """A panel in the place of the agent."""
    path = tmp_path_factory.mktemp("panel") / "stored"
    idr.score(run, [AGENT], panel=PanelFolder.create(path, PANEL, "a test"))
    return path


def asked(run, drivers=PANEL, settings=None, *, measures_hindrance=True):
    return Asked.of(World.of(run, AGENT), drivers, settings or ScoringSettings(), measures_hindrance=measures_hindrance)


@pytest.fixture
def nothing_drives(monkeypatch):
    def refuse(*_arguments, **_options):
        raise AssertionError("it was simulated")

    monkeypatch.setattr("interdrive.panel.worlds.simulate", refuse)


def test_a_stored_panel_gives_the_same_bits_without_driving(run, folder, nothing_drives):
    stored = idr.score(run, [AGENT], panel=PanelFolder.open(folder, is_complete=True))
    with pytest.MonkeyPatch.context() as patched:
        patched.undo()
        patched.setattr("interdrive.panel.worlds.simulate", idr.simulate)
        driven = idr.score(run, [AGENT])
    assert score_table(stored).equals(score_table(driven))
    assert repr(stored.facts) == repr(driven.facts)
    assert stored.hindrances == driven.hindrances


def test_an_agent_takes_a_run_of_each_driver_and_one_without_it(run, monkeypatch):
    runs = []

    def counted(*arguments, **options):
        runs.append(options["agents"])
        return idr.simulate(*arguments, **options)

    monkeypatch.setattr("interdrive.panel.worlds.simulate", counted)
    idr.score(run, [AGENT], panel="default")
    assert len(runs) == len(PANEL) + 1
    assert sum(AGENT not in agents for agents in runs) == 1


def test_one_panel_serves_all_planners_in_the_same_place(folder, nothing_drives):
    for planner in ("rollout", "frenet,level=1"):
        found = idr.score(drive(planner), [AGENT], panel=PanelFolder.open(folder, is_complete=True))
        assert found.planners == (planner.partition(",")[0],)
        assert 0.0 <= found.score[0] <= 1.0


def test_what_is_not_stored_is_driven_unless_it_must_not_be(folder):
    other = drive(traffic="idm")
    found = idr.score(other, [AGENT], panel=PanelFolder.open(folder))
    assert score_table(found).equals(score_table(idr.score(other, [AGENT])))
    assert len(list(folder.glob("*.npz"))) == 1, "a panel that is only read does not grow"
    with pytest.raises(InputError, match=r"nothing in the place of agent 2001 of t_junction .* it has a test"):
        idr.score(other, [AGENT], panel=PanelFolder.open(folder, is_complete=True))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"predictor": "constant_velocity"}, "predictor neural, here constant_velocity"),
        ({"seed": 5}, "seed 0, here 5"),
        ({"step.grace_factor": 2.0}, "step.grace_factor 1.7, here 2.0"),
        ({"step.grace_factor": 2.0, "seed": 5}, "seed 0, here 5; step.grace_factor 1.7, here 2.0"),
    ],
)
def test_what_differs_from_a_stored_panel_is_told_by_name_and_value(run, folder, changes, words):
    known = {name: value for name, value in changes.items() if name in ("predictor", "seed")}
    settings = {**run.settings["settings"], **{name: value for name, value in changes.items() if name not in known}}
    other = replace(run, settings={**run.settings, **known, "settings": settings})
    assert PanelFolder.open(folder).why_not(asked(other)) == words


def test_other_traffic_bounds_and_recordings_are_told_too(run, folder):
    stored = PanelFolder.open(folder)
    assert stored.why_not(asked(drive(traffic="idm"))) == "traffic velocity_adjusting, here idm"
    bounds = ScoringSettings(comfort=ComfortBounds(jerk=6.0))
    assert stored.why_not(asked(run, settings=bounds)) == "scoring.comfort.jerk 8.37, here 6.0"
    moved = replace(run.scenario.obstacles, x=run.scenario.obstacles.x + 1.0)
    shifted = replace(run, scenario=replace(run.scenario, obstacles=moved))
    assert stored.why_not(asked(shifted)) == "the recording is read otherwise"
    elsewhere = replace(run, scenario=replace(run.scenario, sha256="0" * 64))
    assert stored.why_not(asked(elsewhere)) == "no such place"
    assert stored.why_not(Asked("", {})) == "it depends on code or files of yours"


def test_the_key_is_that_of_everything_that_decides(run):
    def key(run=run, drivers=PANEL, settings=None, hindrance=True):
        return asked(run, drivers, settings, measures_hindrance=hindrance).key

    assert key() == key(drive("rollout")), "the planner under test decides nothing"
    assert key() == key(settings=ScoringSettings(panel=PanelWeights(comfort=0.0))), "weights come later"
    others = [
        key(drive(traffic="idm")),
        key(drivers=PANEL[:3]),
        key(settings=ScoringSettings(comfort=ComfortBounds(jerk=6.0))),
        key(hindrance=False),
        key(replace(run, settings={**run.settings, "seed": 5})),
        key(replace(run, settings={**run.settings, "predictor": "constant_velocity"})),
    ]
    assert len({key(), *others}) == 7
    moved = replace(run.scenario.obstacles, x=run.scenario.obstacles.x + 1.0)
    assert key() != key(replace(run, scenario=replace(run.scenario, obstacles=moved))), "recordings decide, too"


def test_worlds_with_files_or_without_a_file_are_driven_every_time(run, tmp_path):
    weights = tmp_path / "weights.safetensors"
    weights.write_bytes(b"weights")
    named = replace(run, settings={**run.settings, "predictor": {"predictor": "neural", "weights": str(weights)}})
    from_memory = replace(run, scenario=replace(run.scenario, sha256=""))
    for one in (named, from_memory):
        assert asked(one).key == ""


@pytest.mark.long
def test_the_command_drives_a_set_that_other_commands_read(run, tmp_path, nothing_drives):
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("interdrive.panel.worlds.simulate", idr.simulate)
        patched.setattr("interdrive.benchmarks.panels.read_set", only_two_agents)
        done = []
        found = store_panel(
            set="shipped-2", traffic=("velocity_adjusting",), out=tmp_path / "panel", workers=1,
            on_place=lambda *counts: done.append(counts),
        )  # fmt: skip
    assert found.n_places == 2
    assert done == [(1, 2), (2, 2)]
    assert found.missing == ()
    others = [number for number in (1001, 1002, 1003, 1004, 1005, 1006, 1007) if number != AGENT]
    again = idr.simulate(
        "t_junction", agents=[AGENT, *others], planner={AGENT: "idm", "default": "velocity_adjusting"}, threads=1
    )
    saved = save(again, tmp_path / "run")
    result = CliRunner().invoke(
        main, ["score", str(saved), "--agents", str(AGENT), "--panel", str(tmp_path / "panel"), "--no-rerun"]
    )
    assert result.exit_code == 0, result.stderr
    assert "panel: lawful, idm, idm_mobil, rollout" in result.stdout


def test_a_place_that_fails_is_told_and_the_others_are_driven(tmp_path, monkeypatch):
    def failing(world, *arguments, **options):
        if world.agent_id == 1003:
            raise RuntimeError("the core failed: no state")
        return PanelDrives()

    monkeypatch.setattr("interdrive.benchmarks.panels.read_set", only_two_agents)
    monkeypatch.setattr("interdrive.benchmarks.panels.panel_drives", failing)
    found = store_panel(traffic=["replay"], predictor="constant_velocity", out=tmp_path / "panel", workers=1)
    assert found.n_places == 2
    assert found.missing == ("t_junction, agent 1003, recorded: RuntimeError: the core failed: no state",)


def only_two_agents(name):
    from interdrive.benchmarks.sets import read_set

    whole = read_set(name)
    first = replace(whole.files[0], agents=(1003, AGENT))
    return replace(whole, files=(first,))


def test_bad_folders_are_refused_in_one_line(folder, tmp_path, run):
    with pytest.raises(InputError, match="not a stored panel"):
        PanelFolder.open(tmp_path)
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(ResultsError, match="there is something else"):
        PanelFolder.create(tmp_path, PANEL)
    with pytest.raises(InputError, match="a panel of lawful, idm, idm_mobil, rollout, not of idm"):
        PanelFolder.create(folder, ("idm",))
    old = tmp_path / "old"
    old.mkdir()
    (old / "panel.json").write_text(json.dumps({"format": 1, "interdrive": "0.0.1", "drivers": ["idm"]}))
    with pytest.raises(InputError, match=r"a panel of interdrive 0\.0\.1, format 1; this is "):
        PanelFolder.open(old)
    (old / "panel.json").write_text("{}")
    with pytest.raises(InputError, match="a panel of interdrive None"):
        PanelFolder.open(old)
    damaged = tmp_path / "damaged"
    stored = PanelFolder.create(damaged, PANEL)
    key = asked(run).key
    (damaged / f"{key}.npz").write_bytes(b"PK not a zip")
    with pytest.raises(ResultsError, match="cannot be read"):
        idr.score(run, [AGENT], panel=stored)
    np.savez(damaged / f"{key}.npz", told=np.frombuffer(b'{"drives": {}}', dtype=np.uint8))
    with pytest.raises(ResultsError, match="cannot be read"):
        idr.score(run, [AGENT], panel=stored)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--no-rerun",), "--no-rerun: give the folder of a stored panel"),
        (("--panel", "default", "--no-rerun"), "--no-rerun: give the folder of a stored panel"),
        (("--panel", "nowhere"), "nowhere: not a stored panel"),
    ],
)
def test_bad_options_are_one_line(run, tmp_path, arguments, message):
    saved = save(run, tmp_path / "run")
    result = CliRunner().invoke(main, ["score", str(saved), *arguments])
    assert result.exit_code == 2
    assert message in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1


def test_bad_traffic_of_a_panel_is_one_line():
    for traffic, message in (
        ("same", "--traffic same: a panel needs one planner for all others"),
        ("replay,nobody", "--traffic replay,nobody: expected one of replay, recorded, "),
        ("", "--traffic : expected one of replay"),
    ):
        result = CliRunner().invoke(main, ["panel", "--traffic", traffic])
        assert result.exit_code == 2
        assert result.stderr.startswith(f"error: {message}")
        assert len(result.stderr.strip().splitlines()) == 1
