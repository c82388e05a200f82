"""A disk that is full and a folder that cannot be written to, for real: nothing is lost, and one line says what failed.

Every command works in a folder `small`, a file system of its own that has a few kilobytes left, or is read-only.
"""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import pytest
from invented_run import invented_run
from small_disk import SmallDisk, is_possible

import interdrive as idr
from interdrive.batches import read_batch

pytestmark = pytest.mark.long

RUN, CASE = ("lane_merge", "--agents", "2"), ("lane_merge", "--agent", "1001", "--other", "1002")
EVALUATION = ("lane_merge", "--every", "30", "--predictors", "constant_velocity")
BATCH = ("t_junction", "lane_merge", "--planner", "idm", "--agents", "1", "--workers", "1")


@pytest.fixture(scope="module")
def disk(tmp_path_factory):
    """A small disk with a run, and a batch of one run whose folder was kept."""
    if not is_possible():
        pytest.skip("no file system of our own can be made here (unshare -rm)")
    made = SmallDisk(tmp_path_factory.mktemp("faults"))
    idr.save(invented_run(), made.filled / "run")
    idr.batch("lane_merge", made.filled / "batch", planner="idm", agents=1, workers=1, keep="all")
    yield made
    made.close()


def contents(folder):
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def complaint(done):
    """The one line with which a command ends that could not write."""
    assert (done.returncode, done.stdout) == (2, ""), done.stderr
    assert done.stderr.count("\n") == 1, done.stderr
    assert done.stderr.startswith("error: ")
    assert ".partial" not in done.stderr, "the reader does not know names that are only there for a moment"
    return done.stderr.removeprefix("error: ").strip()


FULL, READ_ONLY = "cannot be written: No space left on device", "cannot be written: Read-only file system"


@pytest.mark.parametrize(
    ("room", "arguments", "named"),
    [
        (100, ("run", *RUN, "--out", "small/new"), "small/new"),
        (100, ("run", *RUN, "--out", "small/run", "--overwrite"), "small/run"),
        (24, ("criticality", "small/run"), "small/run/criticality_extremes.parquet"),
        (4, ("criticality", "lane_merge", "--out", "small/new"), "small/new/criticality.parquet"),
        (56, ("criticality", "lane_merge", "--out", "small/new"), "small/new/criticality_extremes.parquet"),
        (64, ("report", "small/run"), "small/run/report.html"),
        (64, ("report", "small/run", "--out", "small/page.html"), "small/page.html"),
        (8, ("plot", "small/run", "--kind", "velocity", "--out", "small/v.pdf"), "small/v.pdf"),
        (4, ("plot", "small/run", "--kind", "trajectories", "--out", "small/t.pdf"), "small/t.pdf"),
        (8, ("plot", "small/run", "--kind", "trajectories", "--out", "small/t.svg"), "small/t.svg"),
        (8, ("plot", "small/run", "--kind", "criticality", "--out", "small/c.png"), "small/c.png"),
        (8, ("predict-eval", *EVALUATION, "--out", "small/new"), "small/new"),
        (44, ("predict-eval", *EVALUATION, "--out", "small/new"), "small/new"),
        (100, ("study", *CASE, "--out", "small/new"), "small/new/"),
    ],
)
def test_a_full_disk_leaves_the_folder_as_it_was(disk, room, arguments, named):
    done = disk.run(room, *arguments, "--quiet")
    line = complaint(done)
    assert line.startswith(f"{disk.folder}/{named}")
    assert line.endswith(FULL)
    assert contents(done.left) == contents(disk.filled)


@pytest.mark.parametrize(
    ("room", "pictures", "failing"),
    [(800, ("--png", "--gif"), "run.gif"), (620, ("--mp4",), "run.mp4"), (1150, ("--report",), "report.html")],
)
def test_a_disk_that_is_full_when_a_run_is_drawn_keeps_the_run(disk, ffmpeg, room, pictures, failing):
    done = disk.run(room, "run", *RUN, *pictures, "--out", "small/new", "--quiet", path=os.environ["PATH"])
    line = complaint(done)
    assert line.startswith(f"{disk.folder}/small/new/{failing}: cannot be written: ")
    assert line.endswith("No space left on device; the run is in small/new")
    assert len(idr.load(done.left / "new").agents) == 2
    assert not [
        path.name for path in (done.left / "new").iterdir() if path.name.startswith(".") or failing in path.name
    ]


def test_a_disk_that_is_full_when_measures_are_drawn_keeps_the_tables(disk):
    done = disk.run(100, "criticality", "lane_merge", "--png", "--out", "small/new", "--quiet")
    assert complaint(done) == f"{disk.folder}/small/new/criticality.png: {FULL}"
    assert {path.name for path in (done.left / "new").iterdir()} == {
        "criticality.parquet",
        "criticality_extremes.parquet",
    }


@pytest.mark.parametrize("room", [0, 16, 28])
def test_a_batch_on_a_full_disk_keeps_what_was_done_and_goes_on_where_there_is_room(disk, room):
    ended = disk.run(room, "batch", *BATCH, "--out", "small/batch", "--quiet")
    line = complaint(ended)
    assert line.startswith(f"{disk.folder}/small/batch/")
    assert "No space left on device" in line
    left = ended.left / "batch"
    assert not list(left.rglob("*partial*"))
    before = read_batch(left, ["digest"])["digest"].to_pylist()
    assert before[:1] == read_batch(disk.filled / "batch", ["digest"])["digest"].to_pylist()
    done = idr.batch(["t_junction", "lane_merge"], left, planner="idm", agents=1, workers=1)
    assert done.status == {"finished": 2}
    assert done.found == len(before)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("run", *RUN, "--out", "small/new"), "no permission to write in "),
        (("run", *RUN, "--out", "small/run", "--overwrite"), "no permission to write in "),
        (("study", *CASE, "--out", "small/new"), "no permission to write in "),
        (("predict-eval", *EVALUATION, "--out", "small/new"), "no permission to write in "),
        (("criticality", "small/run"), READ_ONLY),
        (("criticality", "lane_merge", "--out", "small/new"), READ_ONLY),
        (("report", "small/run"), READ_ONLY),
        (("report", "small/batch"), READ_ONLY),
        (("plot", "small/run", "--kind", "velocity", "--out", "small/v.pdf"), READ_ONLY),
        (("batch", *BATCH, "--out", "small/new"), "no permission to write in "),
        (("batch", *BATCH, "--out", "small/batch"), "small/batch/.locks: Read-only file system"),
        (("compare", "small/batch"), "no permission to write in "),
    ],
)
def test_a_read_only_folder_is_one_line(disk, arguments, words):
    quiet = () if arguments[0] == "compare" else ("--quiet",)
    done = disk.run("ro", *arguments, *quiet)
    line = complaint(done)
    assert "small/" in line.split(":")[0]
    assert words in line
    assert contents(done.left) == contents(disk.filled)


def test_what_only_reads_works_in_a_read_only_folder(disk):
    done = disk.run("ro", "batch", "lane_merge", *BATCH[2:], "--out", "small/batch", "--keep", "all")
    assert (done.returncode, done.stderr) == (0, "")
    assert "1 already existed" in done.stdout
    assert disk.run("ro", "report", "small/run", "--out", "page.html", "--quiet").returncode == 0
    assert (disk.folder / "page.html").stat().st_size > 100_000


def test_output_that_cannot_be_written_is_one_line():
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "interdrive", "settings"],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert (done.returncode, done.stderr) == (2, "error: No space left on device\n")
