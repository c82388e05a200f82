"""Batches on a Ray cluster give what they give without it, also when a node is lost on the way."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import interdrive as idr
from interdrive.batches import BatchFolder

SUPPORT = Path(__file__).parents[1] / "support"
SCENARIOS = ["t_junction", "lane_merge", "highway"]


@pytest.fixture
def place(tmp_path):
    shutil.copy(SUPPORT / "batch_planners.py", tmp_path / "batch_planners.py")
    return tmp_path


def batch(place, *arguments):
    return subprocess.Popen(
        [sys.executable, "-m", "interdrive", "batch", *map(str, arguments)],
        cwd=place,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def ended(process):
    """What a batch prints that has come to its end."""
    out, err = process.communicate(timeout=240)
    assert process.returncode in (0, 1), (process.returncode, out, err)
    assert out.splitlines()[-2:-1], (process.returncode, out, err)  # not even a table: it was ended
    return out


def stored(folder):
    """Everything about runs and agents but times."""
    table = BatchFolder.open(folder).table()
    times = [name for name in table.column_names if name in ("read_seconds", "run_seconds", "plan_seconds", "attempts")]
    return table.drop_columns(times).to_pylist()


def held(place):
    """Arguments for three runs that say when they begin, and go no further before they are let go."""
    (place / "marks").mkdir()
    (place / "hold").touch()
    return [*SCENARIOS, "--planner", f"batch_planners:Marks,folder={place / 'marks'}", "--agents", 1]


def let_go(place):
    """Lets held runs come to their ends."""
    (place / "hold").unlink()


def begun(group, place, process):
    """Processes of a node that are in the middle of a run, as soon as there are any."""
    until = time.monotonic() + 120
    while not (found := works_on(group, place / "marks")):
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < until, "no run was begun on the node"
        time.sleep(0.05)
    return found


def works_on(group, marks):
    """Processes of a node that are in the middle of a run."""
    found = []
    for mark in marks.iterdir():
        pid = int(mark.name.partition("-")[0])
        try:
            if os.getpgid(pid) == group:
                found.append(pid)
        except ProcessLookupError:
            continue
    return found


def await_end(processes):
    """Until processes are gone; the system may take a moment to clear away what was killed."""
    until = time.monotonic() + 30
    while any(Path(f"/proc/{pid}").exists() for pid in processes):
        assert time.monotonic() < until, "runs go on"
        time.sleep(0.05)


@pytest.mark.parametrize("address", ["auto", "127.0.0.1:1"])
def test_no_cluster_is_one_line(address, place):
    begin = time.monotonic()
    process = batch(place, "t_junction", "--planner", "idm", "--out", "ray", "--ray", address)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 2
    assert err.count("\n") == 1
    assert f"ray {address}: no cluster answers there" in err
    assert "ray start --head" in err
    assert time.monotonic() - begin < 30
    assert not (place / "ray").exists()


def test_a_node_that_is_killed_loses_no_run_and_makes_none_twice(mortal_cluster, place):
    wanted = held(place)
    process = batch(place, *wanted, "--out", "ray", "--ray", mortal_cluster.address)
    lost = begun(mortal_cluster.node.pid, place, process)
    mortal_cluster.lose_node()
    let_go(place)
    out = ended(process)
    rows = stored(place / "ray")
    assert {row["status"] for row in rows} == {"finished"}, out
    assert len({row["key"] for row in rows}) == len(rows) == 3
    assert len(list((place / "marks").iterdir())) >= 4  # of three runs one was begun again
    await_end(lost)
    ended(batch(place, *wanted, "--out", "alone", "--workers", 2))
    assert rows == stored(place / "alone")


def test_a_cluster_that_is_lost_is_one_line_and_the_batch_goes_on_without_it(mortal_cluster, place):
    wanted = held(place)
    process = batch(place, *wanted, "--out", "ray", "--ray", mortal_cluster.address)
    begun(mortal_cluster.head.pid, place, process)
    mortal_cluster.lose_head()
    let_go(place)
    out, err = process.communicate(timeout=120)
    assert process.returncode == 2, (out, err)
    assert out == ""
    assert err.startswith(f"error: ray {mortal_cluster.address}: the ")
    assert err.count("\n") == 1
    assert err.endswith("; finished runs are kept, repeat the command to do the missing ones\n")
    ended(batch(place, *wanted, "--out", "ray", "--workers", 2))
    rows = stored(place / "ray")
    assert {row["status"] for row in rows} == {"finished"}
    assert len({row["key"] for row in rows}) == len(rows) == 3


def test_an_interrupted_batch_leaves_nothing_at_work_on_the_cluster(cluster, place):
    process = batch(place, *held(place), "--out", "ray", "--ray", cluster.address)
    left = [*begun(cluster.node.pid, place, process), *works_on(cluster.head.pid, place / "marks")]
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=30)
    assert process.returncode == 130, (out, err)
    assert err == "interrupted; finished runs are in ray, repeat the command to do the missing ones\n"
    await_end(left)
    assert stored(place / "ray") == []


def test_the_same_runs_come_out_with_and_without_ray_and_run_folders_come_back(cluster, place):
    wanted = [*SCENARIOS[:2], "--planner", "idm,batch_planners:Brakes", "--agents", 2, "--keep", "all"]
    ended(batch(place, *wanted, "--out", "alone", "--workers", 1))
    out = ended(batch(place, *wanted, "--out", "ray", "--ray", cluster.address))
    assert out.splitlines()[-2].startswith("4 runs in")
    assert stored(place / "ray") == stored(place / "alone")
    for key in {row["key"] for row in stored(place / "ray")}:
        found = idr.load(BatchFolder.open(place / "ray").recording(key))
        assert found.scenario.path.exists()


def test_a_run_that_kills_its_process_or_hangs_is_a_row(cluster, place):
    wanted = ["t_junction", "--agents", 1, "--out", "ray", "--ray", cluster.address, "--planner"]
    ended(batch(place, *wanted, "batch_planners:Kills,idm"))
    ended(batch(place, *wanted, "batch_planners:Hangs", "--run-timeout", 3))
    status = {row["planner"]: row["status"] for row in stored(place / "ray")}
    assert status == {"batch_planners:Kills": "crashed", "batch_planners:Hangs": "timeout", "idm": "finished"}
