"""The guard of driving: which figures it refuses, and what an update writes."""

import dataclasses
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks" / "driving"
if not FOLDER.is_dir():
    pytest.skip("benchmarks/ is part of the repository, not of the package", allow_module_level=True)


@pytest.fixture
def guard(monkeypatch):
    monkeypatch.syspath_prepend(str(FOLDER))
    import guard

    yield guard
    for name in ("causes", "drives", "guard", "realism"):
        sys.modules.pop(name, None)


def figures(guard, in_time=100, reachable=100, hit=0, stands=()):
    """One scenario: the first `in_time` of the reachable agents are in time, the others late."""
    outcomes = {i: "goal_reached" if i < in_time else "goal_reached_late" for i in range(reachable)}
    return {"road.xml": guard.Figures("sha", tuple(range(reachable)), outcomes, hit, stands)}


def test_equal_figures_pass(guard):
    assert guard.failures(figures(guard), figures(guard)) == []


def test_the_share_in_time_may_fall_by_one_point_but_not_by_two(guard):
    assert guard.failures(figures(guard, 90), figures(guard, 89)) == []
    assert guard.failures(figures(guard, 90), figures(guard, 88)) == [
        "88.0 % of reachable agents are in time, 90.0 % were"
    ]


def test_only_reachable_agents_count_for_the_share(guard):
    now = figures(guard, 90)
    now["road.xml"].outcomes[1000] = "time_limit"
    assert guard.share(now) == 90.0


def test_more_collisions_between_agents_fail_and_fewer_pass(guard):
    assert guard.failures(figures(guard, hit=2), figures(guard, hit=0)) == []
    assert guard.failures(figures(guard, hit=0), figures(guard, hit=2)) == [
        "2 agents collide with each other, 0 did",
    ]


def test_an_agent_that_stands_fails_only_where_none_stood(guard):
    assert guard.failures(figures(guard, stands=(3,)), figures(guard, stands=(3, 4))) == []
    (line,) = guard.failures(figures(guard), figures(guard, stands=(3, 4)))
    assert line.startswith("road.xml: ") and line.endswith(": 3, 4")


def test_an_agent_that_changes_its_speed_faster_than_a_vehicle_can_fails(guard):
    now = figures(guard)
    now["road.xml"] = dataclasses.replace(now["road.xml"], jumps=(7,))
    (line,) = guard.failures(figures(guard), now)
    assert line == "road.xml: a vehicle changes its speed by more than 13 m/s²: 7"


def test_every_agent_that_ends_otherwise_is_listed(guard):
    assert guard.changes(figures(guard, 3, 3), figures(guard, 2, 3)) == [
        "road.xml: agent 2: goal_reached -> goal_reached_late"
    ]


def test_an_update_stores_the_figures_and_adds_a_line_to_the_page(guard, tmp_path, monkeypatch):
    stored, page = tmp_path / "guard.json", tmp_path / "driving.md"
    page.write_text(f"# Guard\n\n{guard.NOTES}\n|---|--:|--:|---|\n| 1 of 2 | 0 | 0 | first |\n\n## More\n\ntext\n")
    monkeypatch.setattr(guard, "STORED", stored)
    monkeypatch.setattr(guard, "PAGE", page)
    now = figures(guard, 9, 10, hit=2, stands=(4,))
    guard.store(now, "a | b")
    read = {name: guard.Figures.read(one) for name, one in guard.json.loads(stored.read_text()).items()}
    assert read == now
    lines = page.read_text().splitlines()
    assert lines[4:6] == ["| 1 of 2 | 0 | 0 | first |", "| 9 of 10 (90.0 %) | 2 | 1 | a / b |"]
    assert lines[6:] == ["", "## More", "", "text"]
