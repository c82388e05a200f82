"""Folders of results: who may write one, and that no finished result is lost when two want the same."""

from __future__ import annotations

import errno
import fcntl
import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace

import pytest
from invented_run import invented_run

from interdrive import ResultsError
from interdrive.results import RUN_FOLDER, read_results, save
from interdrive.storage import FolderKind, claimed, claimed_new, whole_folder

KIND = FolderKind("heap", "mark", lambda entry: entry.name in ("mark", "who"))


@pytest.fixture(scope="module")
def run():
    return invented_run()


@pytest.fixture
def without_locks(monkeypatch):
    """A file system that has no locks, as some network file systems."""

    def refuse(*_):
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(fcntl, "lockf", refuse)


def write(folder, who, *, overwrite=False):
    with whole_folder(folder, KIND, overwrite=overwrite) as partial:
        for name in ("mark", "who"):
            (partial / name).write_text(who)


def contents(folder):
    return sorted(entry.name for entry in folder.iterdir())


#: A process that claims a folder, says so, and waits.
CLAIMING = """
import sys, time
from interdrive.storage import FolderKind, claimed
with claimed(sys.argv[1], FolderKind("heap", "mark", lambda entry: True)):
    print("claimed", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def other_process(tmp_path):
    """Another process that has claimed the folder `made`."""
    with subprocess.Popen(
        [sys.executable, "-c", CLAIMING, str(tmp_path / "made")], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout.readline() == "claimed\n"
        yield process
        process.kill()


@pytest.mark.parametrize("overwrite", [False, True])
def test_a_folder_that_another_process_writes_is_refused_before_the_work(tmp_path, other_process, overwrite):
    with (
        pytest.raises(ResultsError, match=r"made: another process is writing a heap there; wait for it, or choose"),
        claimed(tmp_path / "made", KIND, overwrite=overwrite),
    ):
        raise AssertionError


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_the_claim_of_a_process_ends_with_it_however_it_ends(tmp_path, other_process, end):
    other_process.send_signal(end)
    other_process.wait()
    write(tmp_path / "made", "next")
    assert contents(tmp_path) == ["made"]


def test_a_claim_by_another_spelling_of_the_folder_is_the_same_claim(tmp_path, other_process, monkeypatch):
    (tmp_path / "link").symlink_to(tmp_path)
    monkeypatch.chdir(tmp_path)
    for spelling in ("made", "./made", "link/made", "link/./made/"):
        with pytest.raises(ResultsError, match="another process is writing"):
            write(spelling, "second")


def test_threads_of_one_process_claim_against_each_other(tmp_path):
    refused = []

    def second():
        try:
            write(tmp_path / "made", "second")
        except ResultsError as error:
            refused.append(str(error))

    with claimed(tmp_path / "made", KIND):
        thread = threading.Thread(target=second)
        thread.start()
        thread.join()
        write(tmp_path / "made", "first")
    assert len(refused) == 1
    assert (tmp_path / "made" / "who").read_text() == "first"
    assert contents(tmp_path) == ["made"]


def test_a_forked_child_has_no_claim_and_ends_none(tmp_path):
    with claimed(tmp_path / "made", KIND):
        child = os.fork()
        if not child:
            try:
                write(tmp_path / "made", "child")
            except ResultsError:
                os._exit(3)
            os._exit(0)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 3
        write(tmp_path / "made", "parent")
    assert (tmp_path / "made" / "who").read_text() == "parent"


def test_a_folder_whose_parents_are_missing_is_claimed_and_leaves_none_behind(tmp_path):
    with pytest.raises(KeyboardInterrupt), claimed(tmp_path / "a" / "b" / "made", KIND) as folder:
        assert folder.parent.is_dir()
        raise KeyboardInterrupt
    assert contents(tmp_path) == []


def test_what_appears_at_the_name_meanwhile_stays_and_the_result_is_beside_it(tmp_path):
    with pytest.raises(ResultsError, match=r"made: something else appeared .*; the heap is in .*made-2$"):  # noqa: SIM117
        with claimed(tmp_path / "made", KIND):
            (tmp_path / "made").mkdir()
            (tmp_path / "made" / "thesis.tex").write_text("precious")
            write(tmp_path / "made", "mine")
    assert (tmp_path / "made" / "thesis.tex").read_text() == "precious"
    assert (tmp_path / "made-2" / "who").read_text() == "mine"
    assert contents(tmp_path) == ["made", "made-2"]


@pytest.mark.parametrize("overwrite", [False, True])
@pytest.mark.parametrize("kind", ["file", "link", "dangling link", "folder"])
def test_no_kind_of_thing_at_the_name_is_replaced_by_a_finished_result(tmp_path, kind, overwrite):
    made = tmp_path / "made"
    (tmp_path / "made-2").mkdir()
    with pytest.raises(ResultsError, match=r"made-3$"), claimed(made, KIND, overwrite=overwrite):
        if kind == "file":
            made.write_text("precious")
        elif kind == "folder":
            made.mkdir()
            (made / "notes").write_text("precious")
        else:
            made.symlink_to(tmp_path / ("made-2" if kind == "link" else "nowhere"))
        write(made, "mine", overwrite=overwrite)
    assert (tmp_path / "made-3" / "who").read_text() == "mine"
    assert contents(tmp_path) == ["made", "made-2", "made-3"]


def test_a_run_that_is_ready_is_kept_when_its_folder_has_appeared(run, tmp_path):
    with pytest.raises(ResultsError, match=r"the run is in .*c-2$"), claimed(tmp_path / "c", RUN_FOLDER):
        (tmp_path / "c").mkdir()
        (tmp_path / "c" / "run.json").write_text("{}")
        save(run, tmp_path / "c")
    assert read_results(tmp_path / "c-2").info["digest"] == run.digest


@pytest.mark.usefixtures("without_locks")
def test_without_locks_every_finished_result_is_kept(tmp_path):
    with pytest.raises(ResultsError, match=r"made-2$"), claimed(tmp_path / "made", KIND):
        thread = threading.Thread(target=write, args=(tmp_path / "made", "quick"))
        thread.start()
        thread.join()
        write(tmp_path / "made", "slow")
    assert [(tmp_path / name / "who").read_text() for name in ("made", "made-2")] == ["quick", "slow"]
    assert contents(tmp_path) == ["made", "made-2"]


@pytest.mark.usefixtures("without_locks")
def test_overwriting_at_the_same_time_without_locks_leaves_whole_results_only(tmp_path):
    failed = []

    def again(who):
        for _ in range(20):
            try:
                write(tmp_path / "made", who, overwrite=True)
            except ResultsError as error:
                failed.append(str(error))

    threads = [threading.Thread(target=again, args=(who,)) for who in "abcd"]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    kept = [line.rpartition("/")[2] for line in failed if "the heap is in" in line]
    assert contents(tmp_path) == sorted(["made", *kept])
    for name in ("made", *kept):
        assert (tmp_path / name / "who").read_text() == (tmp_path / name / "mark").read_text()


def test_new_folders_of_one_name_are_numbered_while_they_are_claimed(tmp_path):
    with claimed_new(tmp_path / "out", KIND) as first:
        names = []

        def second():
            with claimed_new(tmp_path / "out", KIND) as folder:
                names.append(folder.name)

        thread = threading.Thread(target=second)
        thread.start()
        thread.join()
    assert (first.name, names) == ("out", ["out-2"])


def test_a_name_as_long_as_the_file_system_takes_is_claimed_and_written(tmp_path):
    made = tmp_path / ("ä" * 127)
    write(made, "mine")
    write(made, "again", overwrite=True)
    assert contents(tmp_path) == [made.name]


def test_a_run_is_not_written_over_the_scenario_that_it_was_made_from(run, tmp_path):
    folder = save(run, tmp_path / "a")
    made_from = replace(run, scenario=replace(run.scenario, path=folder / "scenario.xml"))
    before = (folder / "scenario.xml").read_bytes()
    with pytest.raises(ResultsError, match=r"a: this would replace .*scenario.xml, which is read; choose another path"):
        save(made_from, folder, overwrite=True)
    assert (folder / "scenario.xml").read_bytes() == before


SHORT = ("--agents", "1", "--planner", "idm", "--set", "step.max_steps=3", "--threads", "1", "--quiet")


def start(folder, *arguments):
    return subprocess.Popen(
        [sys.executable, "-m", "interdrive", *arguments],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.long
@pytest.mark.parametrize("overwrite", [(), ("--overwrite",)])
def test_of_commands_with_the_same_folder_each_has_its_result_there_or_says_that_it_has_none(tmp_path, overwrite):
    running = [
        start(tmp_path, "run", "t_junction", *SHORT, "--seed", str(seed), "--out", "c", "--png", *overwrite)
        for seed in (1, 2, 3)
    ]
    ended = [(process.communicate()[1], process.returncode) for process in running]
    done = [seed for seed, (_, code) in enumerate(ended, start=1) if code == 0]
    assert done
    if not overwrite:
        assert len(done) == 1
    for text, code in ended:
        assert code in (0, 2)
        assert (text.count("\n") == 1 and text.startswith("error: c: ")) if code else not text
    assert read_results(tmp_path / "c").info["seed"] in done
    assert contents(tmp_path) == ["c"]


#: A planner that is not done before the test is.
ASLEEP = """
import time

class Asleep:
    def plan(self, view, predictions):
        time.sleep(120)
"""


def test_a_run_that_is_simulating_keeps_its_folder(tmp_path):
    (tmp_path / "asleep.py").write_text(ASLEEP)
    slow = start(tmp_path, "run", "t_junction", *SHORT, "--planner", "asleep:Asleep", "--out", "new/d")
    end = time.monotonic() + 30
    while not (tmp_path / "new" / ".d.claim").exists() and time.monotonic() < end:
        time.sleep(0.02)
    quick = start(tmp_path, "run", "t_junction", *SHORT, "--out", "new/d")
    assert "another process is writing a run there" in quick.communicate()[1]
    assert quick.returncode == 2
    slow.send_signal(signal.SIGINT)
    slow.communicate()
    assert slow.returncode == 130
    assert not list(tmp_path.rglob(".*"))
