"""The page of a batch: comparison, distributions, and a page for every run that was kept."""

from __future__ import annotations

import json
import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from packed import unpacked

from interdrive.batch_report import write_batch_report
from interdrive.batch_report.contents import batch_contents
from interdrive.batches import batch
from interdrive.batches.store import BatchFolder
from interdrive.cli import main
from interdrive.comparison import compare
from interdrive.comparison.tables import sheets_of
from interdrive.config.schema import SimulationSettings, StepSettings
from interdrive.errors import ResultsError
from interdrive.files import shipped_scenario
from interdrive.results import holds_run

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two planners on two scenarios and a file that is refused; every run folder is kept."""
    place = tmp_path_factory.mktemp("batch")
    (place / "broken.xml").write_text("<commonRoad/>")
    paths = ["t_junction", "lane_merge", place / "broken.xml"]
    batch(paths, place / "out", planner=["idm", "idm_mobil"], workers=1, keep="all")
    return place / "out"


@pytest.fixture
def copied(folder, tmp_path):
    return Path(shutil.copytree(folder, tmp_path / "copy"))


def header_of(page: Path) -> dict:
    found = re.search(r'<script type="application/json" id="header">(.*?)</script>', page.read_text(encoding="utf-8"))
    return json.loads(found[1])


def test_a_page_has_the_comparison_as_it_is_printed(folder):
    header = batch_contents(folder, {}).header
    found = compare(folder)
    printed = next(iter(sheets_of(found, found.sets[0])))
    texts = {(row[0].text or "all", row[1].text): [cell.text for cell in row[5:]] for row in printed.rows[:2]}
    compared = header["compared"][0]
    assert (compared["title"], compared["category"]) == (found.sets[0].title, "all")
    for row in compared["rows"]:
        cells = dict(zip(compared["headings"], row["cells"], strict=True))
        assert [cells[name]["text"] for name in printed.head[5:]] == texts["all", row["planner"]]
        assert sum(row["shares"].values()) == pytest.approx(100.0)
    # Two scenarios are too few for any claim.
    differences = [one for pair in compared["pairs"] for one in pair["differences"]]
    assert differences
    assert not any(one["sure"] or one["verdict"] for one in differences)
    assert not any(cell["strong"] for row in compared["rows"] for cell in row["cells"])
    assert "Nothing is in bold: over fewer than 10 places (there are 2)" in compared["note"]
    assert header["caveats"] == list(found.caveats)
    assert header["variants"] == ["idm", "idm_mobil"]


def test_distributions_have_one_value_per_agent_under_test(folder):
    contents = batch_contents(folder, {})
    found = unpacked(contents.header["arrays"], contents.arrays)
    assert len(found["ttc_min"]) == len(found["variant"]) == 2 * (8 + 7)
    assert np.bincount(found["variant"].astype(int)).tolist() == [15, 15]
    assert np.nanmin(found["jerk_rms"]) >= 0.0


def test_every_run_is_there_and_those_that_were_kept_have_pages(copied):
    page = write_batch_report(copied)
    assert page == copied / "report.html"
    runs = header_of(page)["runs"]
    assert sorted((run["scenario"], run["variant"], run["status"]) for run in runs) == [
        ("broken", "idm", "refused"),
        ("broken", "idm_mobil", "refused"),
        ("lane_merge", "idm", "finished"),
        ("lane_merge", "idm_mobil", "finished"),
        ("t_junction", "idm", "finished"),
        ("t_junction", "idm_mobil", "finished"),
    ]
    for run in runs:
        if run["status"] == "finished":
            assert (copied / run["page"]).is_file()
            assert holds_run((copied / run["page"]).parent)
            assert sum(run["outcomes"].values()) == run["n_agents"] > 0
        else:
            assert run["page"] is None
            assert run["error"]


def test_links_start_where_the_page_lies(copied, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    page = write_batch_report(copied, tmp_path / "elsewhere" / "page.html")
    pages = [run["page"] for run in header_of(page)["runs"] if run["page"]]
    assert len(pages) == 4
    assert all(link.startswith("../copy/recordings/") for link in pages)
    assert all((page.parent / link).is_file() for link in pages)


def test_pages_of_runs_that_are_there_are_left_alone(copied):
    write_batch_report(copied)
    page = next(iter(sorted(copied.glob("recordings/*/report.html"))))
    page.write_text("mine")
    write_batch_report(copied)
    assert page.read_text() == "mine"


def test_a_damaged_run_folder_costs_its_page_alone(copied):
    states = next(iter(sorted(copied.glob("recordings/*/states.parquet"))))
    states.write_bytes(states.read_bytes()[:100])
    header = header_of(write_batch_report(copied))
    [damaged] = [run for run in header["runs"] if run["damage"]]
    assert "states.parquet" in damaged["damage"]
    assert damaged["page"] is None
    assert sum(run["page"] is not None for run in header["runs"]) == 3
    assert [entry["what"] for entry in header["missing"]] == ["pages"]


@pytest.mark.parametrize(
    "choices",
    [
        {"planner": ["frenet,level=1"], "settings": SimulationSettings(step=StepSettings(replan_every=2))},
        {"planner": ["idm"], "agents": 2, "seeds": 2},
        {"planner": ["idm"], "agents": 1, "traffic": "velocity_adjusting"},
        {"planner": ["idm_mobil"], "agents": 1, "alone": True, "traffic": "same"},
    ],
)
def test_the_command_of_a_run_that_was_not_kept_does_it_again(tmp_path, choices):
    source = Path(shutil.copy(shipped_scenario("lane_merge"), tmp_path / "it's merging.xml"))
    batch([source], tmp_path / "out", workers=1, predictor="constant_velocity", **choices)
    runs = header_of(write_batch_report(tmp_path / "out"))["runs"]
    assert runs
    digests = set(BatchFolder.open(tmp_path / "out").table(["digest"])["digest"].to_pylist())
    again = set()
    for number, run in enumerate(runs):
        words = shlex.split(run["command"])
        assert words[0] == "interdrive"
        out = tmp_path / f"again-{number}"
        done = CliRunner().invoke(main, [*words[1:], "--out", str(out), "--quiet"])
        assert done.exit_code == 0, done.output
        again.add(json.loads((out / "run.json").read_text())["digest"])
    assert again == digests


def test_what_the_command_line_cannot_repeat_has_no_command(tmp_path):
    batch(["lane_merge"], tmp_path / "out", planner={"mine": "idm"}, workers=1, predictor="constant_velocity")
    assert [run["command"] for run in header_of(write_batch_report(tmp_path / "out"))["runs"]] == [None]


def test_of_runs_without_a_page_those_that_finished_have_a_command(copied):
    for folder in sorted((copied / "recordings").iterdir())[:2]:
        shutil.rmtree(folder)
    runs = header_of(write_batch_report(copied))["runs"]
    assert sorted((run["status"], run["page"] is not None, "command" in run) for run in runs) == [
        ("finished", False, True),
        ("finished", False, True),
        ("finished", True, False),
        ("finished", True, False),
        ("refused", False, False),
        ("refused", False, False),
    ]


def test_without_kept_runs_the_page_says_how_to_keep_them(copied):
    shutil.rmtree(copied / "recordings")
    header = header_of(write_batch_report(copied))
    assert [entry["what"] for entry in header["missing"]] == ["runs"]
    assert [run["page"] for run in header["runs"]] == [None] * 6


def test_without_a_finished_run_the_runs_are_listed_and_the_comparison_is_missing(tmp_path):
    (tmp_path / "broken.xml").write_text("<commonRoad/>")
    batch([tmp_path / "broken.xml"], tmp_path / "out", planner=["idm"], workers=1)
    header = header_of(write_batch_report(tmp_path / "out"))
    assert [entry["what"] for entry in header["missing"]] == ["comparison", "runs"]
    assert [run["status"] for run in header["runs"]] == ["refused"]
    assert [(one["rows"], one["size"]) for one in header["compared"]] == [([], "None of these runs has finished.")]


def test_the_command_takes_a_batch_as_it_takes_a_run(copied):
    done = CliRunner().invoke(main, ["report", str(copied)])
    assert done.exit_code == 0, done.output
    assert (copied / "report.html").is_file()
    assert "open it in a browser" in done.output


def test_a_batch_of_another_format_is_refused_in_one_line(copied):
    (copied / "batch.json").write_text('{"format": 0}')
    done = CliRunner().invoke(main, ["report", str(copied)])
    assert done.exit_code == 2
    assert "a batch of format 0" in done.output
    assert len(done.output.strip().splitlines()) == 1


def test_a_batch_without_any_run_is_refused(copied):
    (copied / "results.parquet").unlink()
    shutil.rmtree(copied / "runs", ignore_errors=True)
    with pytest.raises(ResultsError, match="this batch holds no run yet"):
        write_batch_report(copied)
