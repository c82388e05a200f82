"""A source is run, verified and batched as the CommonRoad file is that `convert` makes of it."""

import json

import foreign_files as ff
import pytest
from click.testing import CliRunner

import interdrive as idr
from interdrive.cli import main


def call(*arguments):
    done = CliRunner().invoke(main, [str(one) for one in arguments])
    return done.exit_code, done.output


def neutral(folder):
    ff.neutral_map(folder)
    (folder / "tracks.csv").write_text(ff.tracks(ff.car(y=1.7)))
    return folder / "tracks.csv", {"map": str(folder / "lanes.csv")}


def womd(folder):
    (folder / "scene.json").write_text(json.dumps(ff.womd()))
    return folder / "scene.json", {}


def argoverse2(folder):
    return ff.argoverse2(folder / "av2"), {"dt": "0.1"}


def highd(folder):
    return ff.saved(folder / "highd", ff.HIGHD), {}


SOURCES = (neutral, womd, argoverse2, highd)


@pytest.mark.parametrize("made", SOURCES, ids=lambda one: one.__name__)
def test_a_run_of_a_source_has_the_digest_of_a_run_of_the_converted_file(tmp_path, monkeypatch, made):
    monkeypatch.chdir(tmp_path)
    source, options = made(tmp_path)
    named = [text for name, value in options.items() for text in ("--source", f"{name}={value}")]
    plain = ("--planner", "idm", "--predictor", "lane_following", "--quiet")
    code, said = call("run", source, "--out", "direct", *named, *plain)
    assert code == 0, said
    assert (
        call("convert", source, "--out", "new.xml", *(f"--{name}={value}" for name, value in options.items()))[0] == 0
    )
    assert call("run", "new.xml", "--out", "converted", *plain)[0] == 0
    direct, converted = (json.loads((tmp_path / name / "run.json").read_text()) for name in ("direct", "converted"))
    assert direct["digest"] == converted["digest"]
    assert len(direct["agents"]) >= 1
    assert set(direct["source"]["options"]) == set(options)
    assert converted["source"] is None
    assert call("verify", "direct")[0] == 0


def test_verify_sees_that_a_map_under_tracks_has_changed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    source, options = neutral(tmp_path)
    assert (
        call("run", source, "--source", f"map={options['map']}", "--planner", "idm", "--out", "run", "--quiet")[0] == 0
    )
    stored = json.loads((tmp_path / "run" / "run.json").read_text())
    assert [file["name"] for file in stored["source"]["files"]] == ["tracks.csv", "lanes.csv", "links.csv"]
    (tmp_path / "lanes.csv").write_text(ff.LANES.replace("120.0", "130.0"))
    code, said = call("verify", "run")
    assert code == 2
    assert "has changed since the run" in said


def test_a_batch_finds_sources_in_folders_by_their_content(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    inputs = tmp_path / "inputs"
    inputs.mkdir()
    womd(inputs)
    argoverse2(inputs)
    (inputs / "notes.json").write_text("{}")
    (inputs / "table.csv").write_text("a,b\n1,2\n")
    done = idr.batch([inputs], tmp_path / "out", planner="idm", predictor="lane_following", workers=1)
    table = done.select(["scenario", "status"])
    assert {*zip(*(table[name].to_pylist() for name in ("scenario", "status")), strict=True)} == {
        ("av2", "finished"),
        ("scene", "finished"),
    }
