"""Batches whose workers die, hang or grow, that are interrupted, or that share a folder. All of it happens for real."""

import multiprocessing
import os
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

import interdrive as idr
from interdrive.batches import BatchFolder
from interdrive.batches import pool as pool_module
from interdrive.batches import run as conduct
from interdrive.batches.job import Job, agents_of, execute
from interdrive.batches.plan import planned
from interdrive.batches.pool import _LATE, End, Pool, Task, _Worker
from interdrive.config.schema import SimulationSettings
from interdrive.files import shipped_scenario
from interdrive.planners.workers import uninterrupted

pytestmark = pytest.mark.long

SUPPORT = Path(__file__).parents[1] / "support"
#: How well the others are predicted does not matter to the fate of processes.
QUICK = "constant_velocity"


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A folder with the planners that break things, found by this process and its workers."""
    shutil.copy(SUPPORT / "batch_planners.py", tmp_path / "batch_planners.py")
    monkeypatch.syspath_prepend(tmp_path)
    return tmp_path


def started(place, *arguments):
    """A batch as a process of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "interdrive", "batch", *map(str, arguments), "--predictor", QUICK, "--out", "out"],
        cwd=place,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def until(condition, seconds=60.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it did not happen in time"
        time.sleep(0.02)


def children(pid):
    """Process ids of the direct children, the helper of multiprocessing left out."""
    found = []
    for text in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
        try:
            command = Path(f"/proc/{text}/cmdline").read_bytes()
        except OSError:
            continue
        if b"resource_tracker" not in command:
            found.append(int(text))
    return found


def stored(place):
    """Files of runs that were stored but not merged."""
    return list((place / "out" / "runs").glob("[!.]*.parquet"))


def digests(table):
    return dict(zip(table["key"].to_pylist(), table["digest"].to_pylist(), strict=True))


def check_whole(place, n):
    """The folder holds n runs, each once, and nothing half-written."""
    folder = BatchFolder.open(place / "out")
    rows = folder.table()
    assert len(set(rows["key"].to_pylist())) == n
    agents = list(zip(rows["key"].to_pylist(), rows["agent_id"].to_pylist(), strict=True))
    assert len(set(agents)) == len(agents)
    assert not folder.unmerged()
    assert not list((place / "out").rglob("*partial*"))
    return rows


def row_of(summary, planner):
    return next(row for row in summary.table.to_pylist() if row["planner"] == planner)


def test_a_run_that_kills_its_process_twice_is_a_row_and_the_others_go_on(place):
    bad = "batch_planners:Kills"
    done = idr.batch(
        ["t_junction"], place / "out", planner=[bad, "idm", "idm_mobil"], workers=1, agents=1, predictor=QUICK
    )
    row = row_of(done, bad)
    assert (row["status"], row["attempts"]) == ("crashed", 2)
    assert row["error"] == "its process was killed (SIGKILL; out of memory?), twice"
    assert done.status == {"crashed": 1, "finished": 2}


def test_a_parallel_planner_that_kills_its_process_costs_its_own_agent_only(place):
    bad = "batch_planners:KillsItsOwn"
    done = idr.batch("t_junction", place / "out", planner=bad, workers=1, agents=1, predictor=QUICK)
    row = row_of(done, bad)
    assert (row["status"], row["attempts"], row["outcome"]) == ("finished", 1, "planner_error")


def test_a_run_whose_process_is_killed_once_is_done_again(place):
    bad = f"batch_planners:KillsOnce,flag={place / 'flag'}"
    done = idr.batch("t_junction", place / "out", planner=[bad], workers=1, agents=1, predictor=QUICK)
    row = row_of(done, bad)
    assert (row["status"], row["attempts"]) == ("finished", 2)


def test_a_run_that_hangs_is_ended_after_its_time_twice_and_recorded(place):
    bad = "batch_planners:Hangs"
    begin = time.monotonic()
    done = idr.batch("t_junction", place / "out", planner=bad, workers=2, agents=1, run_timeout=1.5, predictor=QUICK)
    row = row_of(done, bad)
    assert (row["status"], row["attempts"]) == ("timeout", 2)
    assert row["error"] == "it took longer than 1.5 s (--run-timeout), twice"
    assert time.monotonic() - begin < 60
    assert idr.batch("t_junction", place / "out", planner="idm", workers=1, agents=1, predictor=QUICK).status == {
        "finished": 1
    }


def test_a_run_that_takes_too_much_memory_is_ended_and_recorded(place):
    bad = "batch_planners:Grows"
    done = idr.batch(["t_junction"], place / "out", planner=[bad, "idm"], workers=1, agents=1, memory=500 * 2**20)
    row = row_of(done, bad)
    assert (row["status"], row["attempts"]) == ("memory", 2)
    assert "exceeded 500 MiB" in row["error"]
    assert row_of(done, "idm")["status"] == "finished"


def test_a_planner_that_cannot_be_made_is_refused_before_anything_is_simulated(place):
    with pytest.raises(idr.InputError, match="no fuel"):
        idr.batch("t_junction", place / "out", planner="batch_planners:ExplodingPlan")
    assert not (place / "out").exists()


def test_runs_that_did_not_finish_are_done_again_only_when_asked(place):
    bad = f"batch_planners:KillsOnce,flag={place / 'absent' / 'flag'}"  # cannot be written: an error every time
    first = idr.batch("t_junction", place / "out", planner="batch_planners:Kills", workers=1, agents=1, predictor=QUICK)
    again = idr.batch("t_junction", place / "out", planner="batch_planners:Kills", workers=1, agents=1, predictor=QUICK)
    assert (first.found, again.found) == (0, 1)
    retried = idr.batch("t_junction", place / "out", planner="batch_planners:Kills", workers=1, agents=1, retry=True)
    assert retried.found == 0
    assert retried.table.num_rows == 1
    broken = idr.batch("t_junction", place / "out", planner=[bad], workers=1, agents=1, predictor=QUICK)
    assert row_of(broken, bad)["outcome"] == "planner_error"


class SlowToAnswer(Pool):
    """Never finds the agents of a scenario in time."""

    def run(self, function, take):
        if function is not agents_of:
            yield from super().run(function, take)
            return
        while (task := take("")) is not None:
            yield End(task, None, "timeout", "it took longer than 9 s (--run-timeout)", 2)


def test_agents_that_could_not_be_found_out_are_a_row_until_they_are_known(place, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(conduct, "Pool", SlowToAnswer)
        lost = idr.batch("lane_merge", place / "out", planner="idm", workers=1, agents=1, alone=True)
    (row,) = lost.table.to_pylist()
    assert (lost.status, row["status"], row["agents"]) == ({"timeout": 1}, "timeout", "alone")
    assert row["error"] == "its agents could not be determined: it took longer than 9 s (--run-timeout), twice"
    known = idr.batch("lane_merge", place / "out", planner="idm", workers=1, agents=1, alone=True)
    assert known.status == {"finished": 1}
    assert idr.batch("lane_merge", place / "out", planner="idm", workers=1, agents=1, predictor=QUICK).found == 0
    assert set(idr.read_batch(place / "out")["status"].to_pylist()) == {"finished"}


def test_a_scenario_that_changes_during_a_batch_is_a_failure_and_no_property_of_its_content(place):
    scenario = place / "merge.xml"
    scenario.write_bytes(shipped_scenario("lane_merge").read_bytes())
    whole = {"agents": "all", "traffic": None, "alone": False, "seeds": 1, "settings": SimulationSettings()}
    job = Job(planned([scenario], planner="idm", predictor="neural", **whole).specs[0], "none")
    scenario.write_bytes(shipped_scenario("t_junction").read_bytes())
    assert execute(job, 1).status == "failed"
    scenario.unlink()
    assert (execute(job, 1).status, agents_of(job, 1).status) == ("failed", "failed")


def test_workers_that_never_get_ready_are_replaced_and_end_the_batch_when_none_does(monkeypatch):
    monkeypatch.setattr(pool_module, "_START_MAX", 0.0)
    begun = []
    start = Pool._fill
    monkeypatch.setattr(Pool, "_fill", lambda pool: (begun.append(len(pool._workers)), start(pool)))
    with Pool(1) as pool, pytest.raises(idr.InterdriveError, match="worker processes are not ready within 0 s"):
        list(pool.run(execute, lambda _group: None))
    assert begun.count(0) == 3


def test_ctrl_c_while_a_worker_starts_is_told_afterwards_and_not_blocked_for_good():
    told = False
    with pytest.raises(KeyboardInterrupt), uninterrupted():
        signal.raise_signal(signal.SIGINT)
        told = True
    assert told
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, [])


def test_a_worker_that_hangs_while_it_answers_is_ended_after_its_time(place):
    import batch_planners

    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=batch_planners.begins_to_answer, args=(theirs,), daemon=True)
    process.start()
    theirs.close()
    until(ours.poll)
    pool = Pool(1, timeout_s=0.5)
    assert pool._received(_Worker(process, ours, is_ready=True, task=Task("a run"))) is _LATE
    process.join(10.0)
    assert process.exitcode == -signal.SIGKILL


def test_a_worker_that_is_killed_from_outside_is_replaced_and_no_run_is_lost(place):
    slow = "batch_planners:Slow"
    process = started(place, "t_junction", "lane_merge", "--planner", slow, "--workers", 2, "--agents", 1, "--seeds", 2)
    until(lambda: len(children(process.pid)) == 2)
    time.sleep(1.5)
    os.kill(children(process.pid)[0], signal.SIGKILL)
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0, out + err
    rows = check_whole(place, 4)
    assert set(rows["status"].to_pylist()) == {"finished"}


def test_scenarios_that_are_deleted_midway_cost_runs_that_had_not_begun_alone(place):
    for name in ("t_junction", "lane_merge"):
        shutil.copy(shipped_scenario(name), place / f"{name}.xml")
    (place / "marks").mkdir()
    (place / "hold").touch()
    marking = f"batch_planners:Marks,folder={place / 'marks'}"
    wanted = ["t_junction.xml", "lane_merge.xml", "--planner", marking, "--agents", 1, "--workers", 1]
    process = started(place, *wanted)
    until(lambda: any((place / "marks").iterdir()))
    for path in place.glob("*.xml"):
        path.rename(path.with_suffix(".gone"))
    (place / "hold").unlink()
    out, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (1, ""), out
    lost, kept = sorted(check_whole(place, 2).to_pylist(), key=lambda row: row["status"] == "finished")
    assert (lost["status"], kept["status"]) == ("failed", "finished")
    assert lost["error"] == f"{place / lost['scenario']}.xml: cannot be read: No such file or directory"
    for path in place.glob("*.gone"):
        path.rename(path.with_suffix(".xml"))
    again = started(place, *wanted, "--retry")
    out, err = again.communicate(timeout=60)
    assert (again.returncode, err) == (0, ""), out
    assert set(check_whole(place, 2)["status"].to_pylist()) == {"finished"}


def test_an_interrupted_batch_goes_on_where_it_was(place):
    wanted = ["t_junction", "lane_merge", "--planner", "batch_planners:Slow,idm", "--workers", "1", "--agents", "1"]
    process = started(place, *wanted)
    until(lambda: len(stored(place)) >= 1)
    workers = children(process.pid)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130, out + err
    assert err == "interrupted; finished runs are in out, repeat the command to do the missing ones\n"
    assert not any(Path(f"/proc/{pid}").exists() for pid in workers)
    before = digests(idr.read_batch(place / "out"))
    assert 1 <= len(before) < 4
    again = started(place, *wanted)
    out, err = again.communicate(timeout=120)
    assert again.returncode == 0, out + err
    assert f"{4 - len(before)} run" in out
    assert f"{len(before)} already existed" in out
    after = digests(check_whole(place, 4))
    assert before.items() <= after.items()
    whole = idr.batch(
        ["t_junction", "lane_merge"],
        place / "whole",
        planner="batch_planners:Slow,idm",
        workers=1,
        agents=1,
        predictor=QUICK,
    )
    assert digests(whole.table) == after


def test_a_batch_that_is_killed_leaves_a_folder_that_can_be_read_and_continued(place):
    wanted = ["t_junction", "lane_merge", "--planner", "batch_planners:Slow,idm", "--workers", "2", "--agents", "1"]
    process = started(place, *wanted, "--keep", "all")
    until(lambda: len(stored(place)) >= 1)
    workers = children(process.pid)
    process.kill()
    process.communicate(timeout=60)
    assert 1 <= len(digests(idr.read_batch(place / "out"))) < 4
    until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in workers), 30)
    again = started(place, *wanted, "--keep", "all")
    out, err = again.communicate(timeout=120)
    assert again.returncode == 0, out + err
    for key in set(check_whole(place, 4)["key"].to_pylist()):
        assert idr.load(BatchFolder.open(place / "out").recording(key)).digest


def test_no_worker_outlives_a_batch_that_is_killed_even_if_it_hangs(place):
    process = started(place, "t_junction", "--planner", "batch_planners:Hangs", "--agents", 1)
    until(lambda: children(process.pid))
    # The first child may be one that ends at once; by then the worker hangs.
    time.sleep(1.5)
    found: list[list[int]] = []
    until(lambda: found.append(children(process.pid)) or bool(found[-1]))
    process.kill()
    process.communicate(timeout=60)
    until(lambda: not any(Path(f"/proc/{worker}").exists() for worker in found[-1]), 20)


def test_progress_shows_rate_and_time_left_on_a_terminal(place):
    """A terminal of 120 columns, whose output is read as it would be shown."""
    import fcntl
    import pty
    import struct
    import termios

    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 40, 120, 0, 0))
    process = subprocess.Popen(
        [sys.executable, "-m", "interdrive", "batch", "t_junction", "lane_merge", "--planner", "idm,idm_mobil",
         "--agents", "1", "--predictor", QUICK, "--workers", "1", "--out", "out"],
        cwd=place,
        stdout=subprocess.DEVNULL,
        stderr=theirs,
        env={**os.environ, "TERM": "xterm-256color"},
    )  # fmt: skip
    os.close(theirs)
    shown = b""
    try:
        while part := os.read(ours, 65536):
            shown += part
    except OSError:  # the other end is closed
        pass
    assert process.wait(60) == 0
    text = shown.decode()
    assert "4/4" in text
    assert "runs/s" in text
    assert "0:00:0" in text
    assert "finished" in text


def test_two_batches_on_one_folder_share_the_work_and_lose_nothing(place):
    wanted = ["t_junction", "lane_merge", "--planner", "batch_planners:Slow,idm", "--workers", "1", "--agents", "1"]
    both = [started(place, *wanted), started(place, *wanted)]
    said = [process.communicate(timeout=180) for process in both]
    assert [process.returncode for process in both] == [0, 0], said
    rows = check_whole(place, 4)
    assert set(rows["status"].to_pylist()) == {"finished"}


def test_two_threads_on_one_folder_share_the_work_as_well(place):
    def batch(_):
        return idr.batch(
            ["t_junction", "lane_merge"],
            place / "out",
            planner="idm,idm_mobil",
            predictor=QUICK,
            workers=1,
            on_progress=lambda reached: said.append(reached.text),
        )

    said = []
    with ThreadPoolExecutor(2) as threads:
        both = list(threads.map(batch, range(2)))
    assert [done.status for done in both] == [{"finished": 4}] * 2
    assert sum(text.endswith(": finished") for text in said) == 4
    check_whole(place, 4)


def test_a_script_without_a_guard_is_told_so(place):
    (place / "script.py").write_text(
        "import interdrive\ninterdrive.batch('t_junction', 'out', planner='idm', workers=1)\n"
    )
    done = subprocess.run(
        [sys.executable, "script.py"], cwd=place, capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 1
    assert "does the script guard its calls by `if __name__ == '__main__':`?" in done.stderr.splitlines()[-1]
    assert done.stderr.count("Traceback") == 1


def test_what_a_killed_batch_left_half_written_is_removed_when_it_is_old(place):
    done = idr.batch("t_junction", place / "out", planner="idm", workers=1)
    old, young = (done.folder / "runs" / f".{name}.parquet.1.partial.parquet" for name in ("old", "young"))
    (done.folder / "recordings" / ".key.1.partial").mkdir(parents=True)
    for path in (old, young):
        path.write_bytes(b"half")
    hours_ago = time.time() - 10_000
    for path in (old, done.folder / "recordings" / ".key.1.partial"):
        os.utime(path, (hours_ago, hours_ago))
    idr.batch("t_junction", place / "out", planner="idm", workers=1)
    assert young.exists()
    assert not old.exists()
    assert not list((done.folder / "recordings").iterdir())


def test_a_merge_that_was_cut_short_counts_no_run_twice(place):
    done = idr.batch(["t_junction", "lane_merge"], place / "out", planner="idm", workers=1)
    folder = BatchFolder.open(place / "out")
    before = folder.table()
    # What a process leaves behind that dies between the merging and the removal of what was merged.
    one = before.filter([key == done.keys[0] for key in before["key"].to_pylist()])
    from interdrive.batches.dataset import encoded

    (folder.path / "runs").mkdir(exist_ok=True)
    (folder.path / "runs" / f"{done.keys[0]}.parquet").write_bytes(encoded(one))
    assert folder.table().num_rows == before.num_rows
    folder.tidy(now=True)
    assert check_whole(place, 2).num_rows == before.num_rows


def test_memory_of_merging_does_not_depend_on_the_number_of_rows(place):
    """A file of 300 000 rows grows by one run; more than its row groups is never held."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    from interdrive.batches.dataset import encoded, merge

    done = idr.batch("lane_merge", place / "out", planner="idm", workers=1)
    rows, path = done.table, place / "large.parquet"
    other = rows.set_column(
        0, rows.schema.field("key"), pa.array(["0" * 32] * rows.num_rows, rows.schema.field("key").type)
    )
    portion = pa.concat_tables([other] * 1500).combine_chunks()
    with pq.ParquetWriter(path, rows.schema) as writer:
        for _ in range(30):
            writer.write_table(portion)
    part = place / f"{done.keys[0]}.parquet"
    part.write_bytes(encoded(rows))
    whole, before = 30 * portion.nbytes, pa.total_allocated_bytes()
    merge(path, [part])
    assert pq.read_metadata(path).num_rows == 30 * portion.num_rows + rows.num_rows
    assert pa.default_memory_pool().max_memory() - before < whole / 2
