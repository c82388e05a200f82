"""Batches whose agents are scored against a panel, which drives once for all planners."""

from __future__ import annotations

import pytest

import interdrive as idr
from interdrive.comparison import compare
from interdrive.comparison.scores import batch_scores
from interdrive.panel import PANEL, PanelFolder
from interdrive.testing import Car, straight_road, world

OPTIONS = {"predictor": "constant_velocity", "traffic": "velocity_adjusting", "alone": True, "workers": 1}


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """Two cars behind each other on a straight road."""
    path = tmp_path_factory.mktemp("worlds") / "ZAM_Two-1_1_T-1.xml"
    cars = [Car(31, 20.0, velocity=10.0), Car(32, 60.0, velocity=9.0)]
    idr.write_scenario(world(straight_road(300.0), cars=cars, steps=60), path)
    return path


@pytest.fixture(scope="module")
def batch(file, tmp_path_factory):
    out = tmp_path_factory.mktemp("batches") / "out"
    idr.batch([file], out, planner="idm,lawful", panel="default", **OPTIONS)
    return out


def test_every_agent_is_scored_against_the_panel_which_drives_once(batch):
    rows = idr.read_batch(batch).to_pylist()
    tested = [row for row in rows if row["under_test"]]
    assert {(row["planner"], row["agent_id"]) for row in tested} == {
        (p, n) for p in ("idm", "lawful") for n in (31, 32)
    }
    assert {row["panel"] for row in tested} == {", ".join(PANEL)}
    assert len(list((batch / "panel").glob("*.npz"))) == 2, "one for each agent"
    assert all(row["hindrance"] is not None for row in tested), "the other car reacts"


def test_scores_are_those_of_the_run_itself(batch, file):
    run = idr.simulate(
        file,
        agents=[31, 32],
        planner={31: "idm", "default": "velocity_adjusting"},
        predictor="constant_velocity",
        threads=1,
    )
    found = idr.score(run, [31])
    row = next(
        r
        for r in idr.read_batch(batch).to_pylist()
        if (r["planner"], r["agent_id"], r["under_test"]) == ("idm", 31, True)
    )
    assert row["score"] == found.score[0]
    assert row["why"] == "; ".join(found.reasons[0])


def test_a_stored_panel_is_only_read(batch, file, tmp_path):
    again = tmp_path / "again"
    done = idr.batch([file], again, planner="idm", panel=batch / "panel", **OPTIONS)
    assert not (again / "panel").exists()
    assert done.panel_notes == ()
    scores = [
        {
            row["agent_id"]: row["score"]
            for row in idr.read_batch(folder).to_pylist()
            if row["planner"] == "idm" and row["under_test"]
        }
        for folder in (batch, again)
    ]
    assert scores[0] == scores[1]
    assert PanelFolder.open(batch / "panel").drivers == PANEL


def test_a_stored_panel_of_other_traffic_is_told_and_drives_anew(batch, file, tmp_path):
    among_idm = {**OPTIONS, "traffic": "idm"}
    done = idr.batch([file], tmp_path / "out", planner="idm", panel=batch / "panel", **among_idm)
    (note,) = done.panel_notes
    assert note.startswith(f"{batch / 'panel'} lacks what 2 of 2 runs need (traffic velocity_adjusting, here idm)")
    assert note in done.notes
    assert len(list((batch / "panel").glob("*.npz"))) == 2, "it is only read"
    run = idr.simulate(
        file, agents=[31, 32], planner={31: "idm", "default": "idm"}, predictor="constant_velocity", threads=1
    )
    (told,) = idr.score(run, [31], panel=batch / "panel").notes
    assert told.startswith(f"{batch / 'panel'} lacks the place of agent 31 as it is needed: traffic ")


def test_scores_and_comparisons_name_the_panel_and_tell_others_apart(batch, file, tmp_path):
    assert {one.panel for one in batch_scores(batch)} == {", ".join(PANEL)}
    assert not any("panel" in line for line in compare(batch).caveats)
    alone = tmp_path / "alone"
    idr.batch([file], alone, planner="idm", **OPTIONS)
    assert any(line.startswith("Scores are absolute") for line in compare(alone).caveats)
    idr.batch([file], alone, planner="lawful", panel=batch / "panel", **OPTIONS)
    assert any("against different panels (none and lawful, idm" in line for line in compare(alone).caveats)


def test_a_panel_of_agents_together_and_an_unknown_one_are_refused(file, tmp_path):
    with pytest.raises(idr.InputError, match="it drives in the place of one agent"):
        idr.batch([file], tmp_path / "out", planner="idm", panel="default", workers=1)
    with pytest.raises(idr.InputError, match="nowhere: not a stored panel"):
        idr.batch([file], tmp_path / "out", planner="idm", panel="nowhere", **OPTIONS)
