"""Adversaries: what makes one rank as it should, and a trial in which they do."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import pytest
from click.testing import CliRunner

from interdrive import shipped_scenario
from interdrive.adversaries import ADVERSARIES, Drive, rank_adversaries
from interdrive.adversaries.ranking import HONEST_DRIVERS, ranked
from interdrive.adversaries.trial import Place
from interdrive.adversaries.trial import trial as drives_at
from interdrive.cli import main
from interdrive.errors import InputError

BY_NAME = {one.name: one for one in ADVERSARIES}


def rows(*, score=0.9, n=12, **others):
    """Drives of every driver in `n` places; `others`: score and whether the vice acts of single ones."""
    found = []
    for k in range(n):
        for name in (*HONEST_DRIVERS, *BY_NAME):
            own, acts = others.get(name, (score if name in HONEST_DRIVERS else 0.2, True))
            own = own if acts else score
            found.append(Drive(name, f"file{k}", f"road{k}", 1, own, name in HONEST_DRIVERS, acts, ""))
    return found


def verdict(name, **changes):
    return next(one for one in ranked(rows(**changes), ()).verdicts if one.driver == name)


def test_an_adversary_below_its_base_and_below_all_honest_drivers_ranks_as_it_should():
    found = verdict("Crawl")
    assert found.holds
    assert found.base == "Driver"
    assert (found.score, found.difference) == pytest.approx((20.0, -70.0))
    assert (found.n_vice, found.on_vice, found.least_honest) == pytest.approx((12, 20.0, 90.0))
    assert found.high < 0.0


def test_an_adversary_above_one_honest_driver_is_too_high():
    assert verdict("Crawl", Crawl=(0.6, True), idm=(0.5, True)).holds is False
    assert verdict("Crawl", Crawl=(0.95, True)).holds is False


def test_a_vice_that_never_acts_is_not_judged():
    found = ranked(rows(Bully=(0.2, False)), ())
    assert next(one for one in found.verdicts if one.driver == "Bully").holds is None
    assert len(found.judged) == len(ADVERSARIES) - 1
    # The control loses 70 points here.
    assert found.n_below == len(ADVERSARIES) - 2


def test_the_control_must_not_lose_more_than_three_points():
    assert verdict("Slow09", Slow09=(0.88, True)).holds
    assert verdict("Slow09", Slow09=(0.86, True)).holds is False


def test_an_interval_counts_only_with_enough_drives_and_places():
    few = rows(n=3, Crawl=(0.2, True))
    for row in few:
        if row.driver == "Crawl" and row.file == "file0":
            few[few.index(row)] = Drive("Crawl", "file0", "road0", 1, 0.95, False, True, "")
    found = next(one for one in ranked(few, ()).verdicts if one.driver == "Crawl")
    assert math.isnan(found.high), "three places have no interval"
    assert found.holds


def test_tasks_that_are_solved_by_standing_tell_nothing_apart():
    some = [replace(row, in_time=row.in_time or row.file == "file0") for row in rows()]
    found = ranked(some, ())
    assert (found.n_drives, found.n_files, found.n_trivial) == (11, 11, 1)
    with pytest.raises(InputError, match="solves all 12 tasks in time"):
        ranked([replace(row, in_time=True) for row in rows()], ())


@pytest.fixture(scope="module")
def trial(tmp_path_factory):
    """One agent of the T-junction, by the command."""
    out = tmp_path_factory.mktemp("adversaries")
    arguments = ["--split", "all", "--files", "1", "--agents", "1", "--workers", "1", "--out", str(out)]
    result = CliRunner().invoke(main, ["adversaries", *arguments])
    return result, json.loads((out / "adversaries.json").read_text())


@pytest.mark.long
def test_in_the_t_junction_the_score_tells_them_apart(trial):
    result, stored = trial
    assert result.exit_code == 0, result.output
    last = result.stdout.strip().splitlines()[-1]
    judged = [one for one in stored["adversaries"] if one["holds"] is not None]
    assert last == f"{len(judged)} of {len(judged)} below"
    assert len(judged) >= 12


def test_crude_ones_are_below_every_honest_driver_there(trial):
    _, stored = trial
    least = min(stored["honest"].values())
    crude = [one for one in stored["adversaries"] if BY_NAME[one["driver"]].is_crude and one["driver"] != "Slow09"]
    assert all(one["score"] < least for one in crude if one["n_vice"])
    reasons = {row["driver"]: row["why"] for row in stored["drives"]}
    assert "left the road" in reasons["LeaveRoad"]
    assert "an adversary that raises" in reasons["Error"]
    assert "speed limit" in reasons["Speeder"]
    assert "did not arrive" in reasons["GoStop"]


@pytest.mark.long
def test_who_passes_on_red_gets_nothing_where_honest_drivers_wait(monkeypatch):
    names = ("RedRunner", "Bully", "rollout_norules")
    monkeypatch.setattr("interdrive.adversaries.trial.ADVERSARIES", tuple(BY_NAME[name] for name in names))
    found = drives_at(Place(shipped_scenario("signals"), "signals", "signals", 1014))
    assert not isinstance(found, str), found
    at_light = {row.driver: row for row in found.drives}
    for name in names:
        assert at_light[name].acts, name
        assert at_light[name].score == 0.0, at_light[name].why
        assert "passed a red light" in at_light[name].why
    assert min(at_light[name].score for name in HONEST_DRIVERS) > 0.5


def test_bad_input_is_one_line():
    with pytest.raises(InputError, match="files: must be at least 1, is 0"):
        rank_adversaries(files=0)
    with pytest.raises(InputError, match="there is no such benchmark set"):
        rank_adversaries(set="public-9")
    result = CliRunner().invoke(main, ["adversaries", "--set", "public-1", "--scenarios", "/nowhere"])
    assert result.exit_code == 2
    assert len(result.stderr.strip().splitlines()) == 1
