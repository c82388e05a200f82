"""Searches that end before their failures are small: time that is over, Ctrl-C, processes that are lost."""

import json
import math
import sys
import time
import types

import pyarrow.parquet as pq
import pytest
from braking_leader import AGENT, BRAKING, LEADER
from sigint import press_ctrl_c

import interdrive as idr
from interdrive import InputError
from interdrive.failure_search import Space, Summary, failures, keeping, rounds, search_folder
from interdrive.failure_search import search as search_function
from interdrive.failure_search.keeping import Kept
from interdrive.failure_search.rates import different, yields
from interdrive.failure_search.spaces import with_drivers
from interdrive.testing import Car, straight_road, world

#: The module, which the function hides.
SEARCH = sys.modules["interdrive.failure_search.search"]


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("scenario") / "leader.xml"
    cars = [Car(AGENT, 20.0, velocity=12.0), Car(LEADER, 50.0, velocity=12.0)]
    idr.write_scenario(world(straight_road(400.0), cars=cars, steps=80), path)
    return path


def searched(file, out, **more):
    options = {"agent_id": AGENT, "predictor": "constant_velocity", "space": BRAKING, "runs": 6, "keep": 1, **more}
    return search_function(file, options.pop("planner", "drivers:Straight"), out=out, **options)


@pytest.fixture(scope="module")
def done(file, tmp_path_factory):
    folder = tmp_path_factory.mktemp("search") / "done"
    searched(file, folder)
    return folder


def rows_of(folder):
    return pq.read_table(folder / "evaluations.parquet").to_pylist()


def the_same(folder, other):
    assert (folder / "evaluations.jsonl").read_bytes() == (other / "evaluations.jsonl").read_bytes()
    assert [one.disturbance for one in failures(folder)] == [one.disturbance for one in failures(other)]


def after(calls, then, monkeypatch):
    """Has something done instead of the call of that number which drives a world to make a failure small."""
    real, made = keeping.judged_in, []

    def counted(*world):
        made.append(1)
        if len(made) == calls:
            then()
        return real(*world)

    monkeypatch.setattr(keeping, "judged_in", counted)
    return made


@pytest.mark.long
def test_a_failure_is_not_made_smaller_when_the_time_is_over(file, done, tmp_path, monkeypatch):
    offset = [0.0]
    clock = types.SimpleNamespace(time=lambda: time.time() + offset[0])
    with monkeypatch.context() as patched:
        for module in (keeping, rounds, SEARCH):
            patched.setattr(module, "time", clock)
        made = after(2, lambda: offset.__setitem__(0, 3600.0), patched)
        found = searched(file, tmp_path / "out", minutes=30.0)
    assert len(made) == 2, "no world is driven after the deadline"
    assert [one.is_small for one in found.failures] == [False]
    assert "not made as small as it can be" in (found.failures[0].folder / "README.md").read_text()
    assert [row["shrunk"] for row in rows_of(tmp_path / "out") if row["folder"]] == ["ended"]
    searched(file, tmp_path / "out")
    the_same(tmp_path / "out", done)


@pytest.mark.long
def test_a_failure_that_is_being_made_small_at_ctrl_c_is_kept_as_it_is_and_made_small_later(
    file, done, tmp_path, monkeypatch
):
    def interrupt():
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        after(3, interrupt, patched)
        with pytest.raises(KeyboardInterrupt):
            searched(file, tmp_path / "out")
    rows = rows_of(tmp_path / "out")
    assert [(row["folder"], row["shrunk"]) for row in rows if row["failure"]] == [("001", "ended")]
    (one,) = Summary.of(tmp_path / "out").failures
    assert (one.is_small, one.digest) == (False, idr.failures(tmp_path / "out")[0].replay(trust=True).digest)
    searched(file, tmp_path / "out")
    the_same(tmp_path / "out", done)
    assert all(one.is_small for one in failures(tmp_path / "out"))


@pytest.mark.long
def test_failures_are_kept_as_they_are_found_and_made_small_when_one_asks_for_it(file, done, tmp_path):
    found = searched(file, tmp_path / "out", shrink=False)
    (one,) = found.failures
    (row,) = [row for row in rows_of(tmp_path / "out") if row["folder"]]
    assert (one.is_small, row["shrunk"], one.disturbance) == (False, "ended", row["disturbance"])
    assert searched(file, tmp_path / "out", shrink=False, runs=7).failures == found.failures, "nothing is driven again"
    (tmp_path / "more").mkdir()
    searched(file, tmp_path / "more" / "out", shrink=False)
    searched(file, tmp_path / "more" / "out")
    the_same(tmp_path / "more" / "out", done)


@pytest.mark.long
def test_a_search_that_goes_on_and_ends_early_keeps_all_that_it_had_found(file, tmp_path, monkeypatch):
    def interrupt():
        raise KeyboardInterrupt

    out = tmp_path / "out"
    before = searched(file, out, shrink=False, keep=3, runs=20)
    assert len(before.failures) == 3
    log = (out / "evaluations.jsonl").read_bytes()
    with monkeypatch.context() as patched:
        after(3, interrupt, patched)
        with pytest.raises(KeyboardInterrupt):
            searched(file, out, keep=3, runs=20)
    assert (out / "evaluations.jsonl").read_bytes() == log
    assert failures(out) == list(before.failures)
    assert len(rows_of(out)) == 20
    searched(file, out, keep=3, runs=1)
    assert (out / "evaluations.jsonl").read_bytes() == log
    searched(file, out, keep=3, runs=20)
    assert [one.is_small for one in failures(out)] == [True] * len(failures(out))
    assert not (out / ".before").exists()


@pytest.mark.parametrize(
    ("owner", "name", "call"),
    [(search_folder, "json_text", 4), (Kept, "unpack", 1)],
    ids=["the line of a run", "the folder of a failure"],
)
def test_ctrl_c_at_any_moment_leaves_a_search_that_goes_on(owner, name, call, file, done, tmp_path, monkeypatch):
    with monkeypatch.context() as patched:
        press_ctrl_c(patched, owner, name, call)
        with pytest.raises(KeyboardInterrupt):
            searched(file, tmp_path / "out")
    searched(file, tmp_path / "out")
    the_same(tmp_path / "out", done)


MORTAL = """
import os
from pathlib import Path
from drivers import Straight

class Mortal(Straight):
    def plan(self, view, predictions):
        if view.time_step == 0:
            count = Path(__file__).with_name("count")
            n = int(count.read_text()) + 1
            count.write_text(str(n))
            if FIRST < n <= FIRST + 2:
                os._exit(3)
        return super().plan(view, predictions)
"""


@pytest.mark.long
def test_a_failure_whose_process_is_lost_while_it_is_made_small_is_kept_as_it_is(file, done, tmp_path, monkeypatch):
    first = next(row["index"] for row in rows_of(done) if row["failure"])
    # One run undisturbed, and those up to the failure.
    (tmp_path / "mortal.py").write_text(MORTAL.replace("FIRST", str(first + 2)))
    (tmp_path / "count").write_text("0")
    monkeypatch.syspath_prepend(str(tmp_path))
    found = searched(file, tmp_path / "out", planner="mortal:Mortal", runs=first + 1, run_timeout=60.0)
    assert rows_of(tmp_path / "out")[first]["shrunk"] == "lost"
    assert [one.is_small for one in found.failures] == [False]
    assert found.lost_runs == 0
    assert found.uniform_failures == 1


def row(source="uniform", signature="", outcome="collision", draws=1):
    return {"source": source, "draws": draws, "outcome": outcome, "failure": signature[:1], "signature": signature}


def test_lost_runs_widen_the_interval_of_the_rate_to_both_sides_of_what_they_may_be():
    driven = [row(signature="a")] * 3 + [row()] * 17
    lost = [row(outcome=None, draws=0)] * 5
    nowhere = [row(outcome=None, draws=50)] * 5
    whole, with_lost = yields([*driven, *nowhere])[0], yields([*driven, *lost])[0]
    assert (whole.lost, with_lost.lost) == (0, 5)
    assert whole.rate[0] == with_lost.rate[0] == pytest.approx(0.15)
    none_fail, all_fail = (yields([*driven, *[row(signature=name)] * 5])[0].rate for name in ("", "b"))
    assert with_lost.rate[1:] == (none_fail[1], all_fail[2])
    assert with_lost.rate[1] < whole.rate[1] < whole.rate[2] < with_lost.rate[2]


def test_different_failures_are_compared_at_equal_numbers_of_runs():
    assert different({"a": 1, "b": 1}, 2, 1) == pytest.approx(1.0)
    assert different({"a": 2}, 4, 2) == pytest.approx(5.0 / 6.0), "all but one of six choices have one of both"
    rows = [row(signature="a")] * 4 + [row("levels", "a")] * 20 + [row("levels", "b")] * 20
    uniform, levels, directed = yields(rows)
    assert (levels.signatures, uniform.signatures) == (2, 1)
    assert directed.alike == levels.alike
    assert levels.alike == pytest.approx((2.0 - 2.0 * math.comb(20, 4) / math.comb(40, 4), 1.0))


def test_a_file_that_is_given_twice_counts_once(file, done, tmp_path):
    copy = tmp_path / "copy.xml"
    copy.write_bytes(file.read_bytes())
    found = searched([file, file.parent, copy], tmp_path / "out")
    assert found.left_out == (
        "leader: is given twice, and counts once",
        "copy: is the same as leader, and counts once",
    )
    the_same(tmp_path / "out", done)
    about = json.loads((tmp_path / "out" / "search.json").read_text())
    assert (len(about["files"]), len(about["undisturbed"])) == (1, 1)


def test_drivers_are_drawn_from_the_population_that_the_traffic_names():
    assert with_drivers("idm,drivers=calibrated,time_gap=1.5", Space()) == (
        "idm,time_gap=1.5",
        Space(drivers="calibrated"),
    )
    assert with_drivers("idm", Space()) == ("idm", Space())
    with pytest.raises(InputError, match="the space names calm, the traffic calibrated"):
        with_drivers("idm,drivers=calibrated", Space(drivers="calm"))
