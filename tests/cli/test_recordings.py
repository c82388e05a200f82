"""`interdrive join`, and `--raw` of all commands that read scenario files."""

import json

import commonroad_documents as cr
import numpy as np
import pytest
from click.testing import CliRunner

from interdrive import join, read_batch, read_scenario
from interdrive.cli import main


def invoke(*words):
    return CliRunner().invoke(main, [str(word) for word in words])


def recorded(first, last, offset=0.0, places=((30, 0.0), (31, 3.5), (32, 7.0))):
    """Cars at 10.5 m/s along x from step `first` to step `last`, whose headings are off by an angle [degrees]."""
    heading = -np.radians(offset)

    def at(step, y, **more):
        return {"x": 5.0 + 1.05 * step, "y": y, "orientation": heading, "velocity": 10.5, **more}

    cars = "".join(
        cr.car(
            number,
            cr.state(0, **at(first, y, acceleration=0.0, yawRate=0.0), tag="initialState"),
            [cr.state(step - first, **at(step, y)) for step in range(first + 1, last + 1)],
        )
        for number, y in places
    )
    return cr.document(cars, lanelets=cr.lanelet(1, left=((0, 10), (300, 10)), right=((0, -2), (300, -2))))


@pytest.fixture
def windows(tmp_path, monkeypatch):
    """Two windows of one recording."""
    monkeypatch.chdir(tmp_path)
    return [
        cr.saved(tmp_path, recorded(first, last, offset=2.0), f"road_{first}_T-{last}.xml")
        for first, last in ((0, 59), (60, 119))
    ]


@pytest.fixture
def turned(tmp_path, monkeypatch):
    """A file whose headings are off by 2 degrees."""
    monkeypatch.chdir(tmp_path)
    return cr.saved(tmp_path, recorded(0, 100, offset=2.0), "turned.xml")


def headings(path, **more):
    return np.degrees(read_scenario(path, **more).obstacles.orientation)


def test_join_writes_one_file_and_says_what_it_found(windows, tmp_path):
    done = invoke("join", *reversed(windows), "--out", "whole.xml")
    assert done.exit_code == 0, done.output
    assert "2 recordings joined: 3 participants, 3 continue in the next" in done.output
    assert "headings turned by 2.00 degrees" in done.output
    found = read_scenario(tmp_path / "whole.xml")
    assert found.obstacles.n_steps == 120
    assert np.diff(found.obstacles.x[0]) == pytest.approx(1.05)
    assert headings(tmp_path / "whole.xml", raw=True) == pytest.approx(0.0, abs=1e-9)


def test_join_leaves_headings_alone_if_asked_and_prints_nothing(windows, tmp_path):
    done = invoke("join", *windows, "--out", "whole.xml", "--raw", "--quiet")
    assert (done.exit_code, done.output) == (0, "")
    assert headings(tmp_path / "whole.xml", raw=True) == pytest.approx(-2.0)


def test_join_writes_the_part_of_the_whole_that_is_asked_for(windows, tmp_path):
    done = invoke("join", *windows, "--out", "part.xml", "--first", 50, "--last", 69)
    assert done.exit_code == 0, done.output
    said = " ".join(done.output.split())
    assert "time steps 50 to 69 of the whole, which has 0 to 119: they are 0 to 19 here" in said
    assert "road_50_T-69: 3 participants" in said
    found = read_scenario(tmp_path / "part.xml")
    assert found.obstacles.n_steps == 20
    assert found.obstacles.x[0, [0, -1]] == pytest.approx([5.0 + 1.05 * 50, 5.0 + 1.05 * 69])


def test_only_who_overlaps_in_a_part_is_told(tmp_path):
    windows = [
        cr.saved(tmp_path, recorded(first, last, places=places), f"road_{first}_T-{last}.xml")
        for first, last, places in ((0, 59, ((30, 0.0), (31, 1.0))), (60, 119, ((30, 0.0),)))
    ]
    whole, part = join(windows), join(windows, first=60, last=119)
    assert whole.overlaps == ((30, 31),)
    assert part.overlaps == ()
    assert [any("overlap" in note for note in one.notes) for one in (whole, part)] == [True, False]


def test_a_run_may_begin_at_a_later_time_step_and_is_repeated_from_there(windows, tmp_path):
    invoke("join", *windows, "--out", "whole.xml")
    invoke("join", *windows, "--out", "part.xml", "--first", 50)
    for file, extra in (("whole.xml", ("--start", 50)), ("part.xml", ())):
        done = invoke("run", file, *extra, "--planner", "idm", "--out", file.removesuffix(".xml"))
        assert done.exit_code == 0, done.output
    digests = [json.loads((tmp_path / name / "run.json").read_text())["digest"] for name in ("whole", "part")]
    assert digests[0] == digests[1]
    verified = invoke("verify", "whole")
    assert (verified.exit_code, "equal" in verified.output) == (0, True)
    assert invoke("run", "whole.xml", "--start", 119).output == (
        "error: recording.start: whole has time steps 0 to 119: none follows 119\n"
    )
    assert invoke("run", "whole.xml", "--start", "soon").output.startswith("error: --start: ")


@pytest.mark.parametrize("part", [("--first", 119), ("--last", 120), ("--last", 0), ("--first", 60, "--last", 50)])
def test_join_refuses_a_part_that_the_whole_does_not_have(windows, tmp_path, part):
    done = invoke("join", *windows, "--out", "part.xml", *part)
    assert done.exit_code == 2
    assert done.output.startswith("error: join: no part from time step")
    assert done.output.endswith("the whole has 0 to 119\n")
    assert not (tmp_path / "part.xml").exists()


@pytest.mark.parametrize(
    ("out", "words"),
    [
        ("road_0_T-59.xml", "is one of the files to join"),
        ("link.xml", "is one of the files to join"),
        ("there.xml", "exists already"),
        ("whole.json", "name a file that ends in .xml"),
        ("folder.xml", "is a folder"),
    ],
)
def test_join_never_replaces_its_input_or_what_is_there(windows, tmp_path, out, words):
    (tmp_path / "there.xml").write_text("mine")
    (tmp_path / "folder.xml").mkdir()
    (tmp_path / "link.xml").symlink_to(windows[0])
    before = windows[0].read_bytes()
    extra = ["--overwrite"] if "one of the files" in words else []
    done = invoke("join", *windows, "--out", out, *extra)
    assert done.exit_code == 2
    assert words in done.output
    assert done.output.count("\n") == 1
    assert windows[0].read_bytes() == before
    assert (tmp_path / "there.xml").read_text() == "mine"


def test_join_refuses_windows_that_do_not_belong_together_in_one_line(windows, tmp_path):
    other = cr.saved(tmp_path, cr.document(), "other_120_T-120.xml")
    done = invoke("join", *windows, other, "--out", "whole.xml")
    assert done.exit_code == 2
    assert "other_120_T-120.xml cannot be joined: their lanelets differ" in done.output
    assert not (tmp_path / "whole.xml").exists()
    assert invoke("join", windows[0], "--out", "whole.xml").output.startswith("error: join: give at least two")


def said_raw(folder):
    return json.loads((folder / "run.json").read_text())["settings"]["settings"]["recording.raw"]


def test_run_stores_how_it_read_and_verify_repeats_it(turned, tmp_path):
    digests = set()
    for flags, raw in (([], False), (["--raw"], True), (["--set", "recording.raw=true"], True)):
        out = tmp_path / f"run{len(digests)}{raw}"
        done = invoke("run", turned, "--agents", "30,", "--planner", "idm", "--out", out, "--overwrite", *flags)
        assert done.exit_code == 0, done.output
        assert said_raw(out) is raw
        assert ("headings turned" in done.output.replace("\n", " ")) is not raw
        assert invoke("verify", out).exit_code == 0
        digests.add(json.loads((out / "run.json").read_text())["digest"])
    assert len(digests) == 2


def test_check_and_criticality_read_raw_if_asked(turned):
    assert "headings turned by 2.00 degrees" in invoke("check", turned).output
    assert "headings turned" not in invoke("check", turned, "--raw").output
    done = invoke("criticality", turned, "--raw", "--out", "measures", "--quiet")
    assert done.exit_code == 0, done.output


@pytest.mark.long
def test_batches_and_evaluations_read_raw_if_asked(turned, tmp_path):
    for flags in ([], ["--raw"]):
        words = ["batch", turned, "--planner", "idm", "--agents", 1, "--out", "runs", "--keep", "all", "--workers", 1]
        done = invoke(*words, *flags)
        assert done.exit_code == 0, done.output
    table = read_batch(tmp_path / "runs").select(["settings"]).to_pydict()
    assert set(table["settings"]) == {"", "recording.raw=True"}
    done = invoke("predict-eval", turned, "--raw", "--predictors", "constant_velocity")
    assert done.exit_code == 0, done.output
