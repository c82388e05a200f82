"""The benchmark of driving: what its figures mean, on shipped scenarios and invented numbers."""

import csv
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from interdrive import shipped_scenario

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks" / "driving"
if not FOLDER.is_dir():
    pytest.skip("benchmarks/ is part of the repository, not of the package", allow_module_level=True)


def benchmark(*arguments):
    return subprocess.run(
        [sys.executable, str(FOLDER), *map(str, arguments), "--workers", "1"],
        env=os.environ,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


def test_every_agent_has_a_row_and_a_second_run_differs_in_none(tmp_path):
    (tmp_path / "junction").mkdir()
    shutil.copy(shipped_scenario("t_junction"), tmp_path / "junction")
    files = [tmp_path / "one.csv", tmp_path / "other.csv"]
    cache = ("--reachable", tmp_path / "reachable.json")
    first = benchmark(tmp_path, "--csv", files[0], *cache)
    assert first.returncode == 0, first.stderr
    second = benchmark(tmp_path, "--csv", files[1], "--against", files[0], *cache)
    assert files[0].read_text() == files[1].read_text()
    with files[0].open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) > 1
    assert all(row["category"] == "junction" for row in rows)
    assert second.stdout.split("cause now |")[1].split("## Failures")[0].strip() == "|---|--:|---|---|---|---|"
    measured = second.stdout.split("| measure |")[1].split("| events")[0].splitlines()[2:]
    assert measured
    assert all(line.endswith("| 0 | 0 |") for line in measured)


def test_the_agents_that_lose_most_are_drawn_one_per_queue(part, tmp_path):
    worst = part("worst")
    row = {"category": "junction", "scenario": "t_junction", "reachable": "True", "cause": "steering"}
    late = row | {"outcome": "goal_reached_late", "head_id": "1001"}
    rows = [late | {"agent_id": "1001", "lost": "2.5"}, late | {"agent_id": "2001", "lost": "1.5"}]
    rows += [row | {"agent_id": "1002", "lost": "9.0", "outcome": "goal_reached", "head_id": "1002"}]
    assert [one["agent_id"] for one in worst.chosen(rows, 10)] == ["1001"]
    (tmp_path / "junction").mkdir()
    shutil.copy(shipped_scenario("t_junction"), tmp_path / "junction")
    with (tmp_path / "agents.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    command = [sys.executable, FOLDER / "worst.py", tmp_path / "agents.csv", tmp_path / "worst.png"]
    done = subprocess.run(
        [*map(str, command), "--folder", str(tmp_path)], capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == "t_junction 1001: 2.5 s lost, steering (1001)\n"
    assert (tmp_path / "worst.png").stat().st_size > 5000


def test_two_planners_are_compared_on_the_same_agents_of_a_folder_of_files(tmp_path):
    shutil.copy(shipped_scenario("t_junction"), tmp_path)
    cache = ("--reachable", tmp_path / "reachable.json")
    first = benchmark(tmp_path, "--csv", tmp_path / "frenet.csv", *cache)
    assert first.returncode == 0, first.stderr
    second = benchmark(
        tmp_path, "--planner", "idm", "--csv", tmp_path / "idm.csv", "--against", tmp_path / "frenet.csv", *cache
    )
    assert second.returncode == 0, second.stderr
    paired = second.stdout.split("## Against")[1]
    assert "| collides | 8 |" in paired
    assert "| events with collisions | 8 |" in paired


def test_rows_of_an_older_benchmark_are_refused_before_driving(tmp_path):
    shutil.copy(shipped_scenario("t_junction"), tmp_path)
    (tmp_path / "old.csv").write_text("category,place,scenario\n")
    done = benchmark(tmp_path, "--against", tmp_path / "old.csv")
    assert done.returncode == 2
    assert done.stderr.endswith("has no column agent_id; an older benchmark wrote it\n")


def test_a_folder_without_scenarios_is_refused_in_one_line(tmp_path):
    done = benchmark(tmp_path)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1


def test_distance_of_distributions_is_how_far_one_must_be_moved(part):
    wasserstein = part("realism").wasserstein
    assert wasserstein(np.array([1.0, 2.0, 3.0]), np.array([4.0, 2.0, 3.0])) == pytest.approx(1.0)
    assert wasserstein(np.array([0.0]), np.array([0.0, 1.0])) == pytest.approx(0.5)
    assert np.isnan(wasserstein(np.array([]), np.array([1.0])))


def test_the_longest_stand_is_one_without_a_break(part):
    stands = np.array([1, 1, 0, 1, 1, 1, 0, 1], dtype=bool)
    assert part("drives").longest(stands, 0.5) == pytest.approx(1.5)
    assert part("drives").longest(np.zeros(0, dtype=bool), 0.5) == 0.0


def test_failing_agents_stand_beside_their_cause_with_the_head_of_their_queue(part, row):
    late = {"scenario": "S", "outcome": "goal_reached_late", "cause": "steering"}
    drives = [
        row(1, **late, late=1.0, head_id=1),
        row(2, **late, late=2.9, head_id=1),
        row(3, scenario="S", outcome="time_limit"),
        row(4, scenario="S"),
        row(5, **late, late=9.0, reachable=False),
    ]
    lines = part("tables").failing(drives).splitlines()[2:]
    assert lines == ["| steering | 1 | 1 | 0 | 0 | S 1, 2 (1) |", "| none found | 0 | 0 | 0 | 1 | S 3 |"]


def test_halves_count_reachable_agents_at_their_places(part, row):
    drives = [
        row(1, place="P", category="urban"),
        row(2, place="P", category="highway", outcome="time_limit"),
        row(3, place="P", reachable=False, violations=3),
        row(4, place="Q"),
        row(5, place="Q", reachable=False, outcome="collision"),
    ]
    lines = part("tables").halves(drives, {"P": "A", "Q": "B"}).splitlines()[2:]
    assert lines == ["| A | 2 | 1 | 50.0 % | 1 | 1 | 100.0 % | 0 | 3 |", "| B | 1 | 1 | 100.0 % | 0 | 0 |  | 1 | 0 |"]


def test_only_what_stands_between_the_markers_of_a_page_is_replaced(part):
    tables = part("tables")
    begin, end = tables.MARKERS
    page = f"before\n{begin}\nold\n{end}\nafter\n"
    once = tables.put_into(page, "new")
    assert once == f"before\n{begin}\n\nnew\n\n{end}\nafter\n"
    assert tables.put_into(once, "new") == once
    for broken in ("before", f"{end}\n{begin}", page + begin):
        with pytest.raises(ValueError, match="once each"):
            tables.put_into(broken, "new")


def test_a_page_without_markers_is_refused_before_driving(tmp_path):
    (tmp_path / "junction").mkdir()
    shutil.copy(shipped_scenario("t_junction"), tmp_path / "junction")
    (tmp_path / "page.md").write_text("no markers\n")
    done = benchmark(tmp_path, "--page", tmp_path / "page.md")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert not done.stdout


def test_variants_are_compared_over_agents_that_all_of_them_drove(part):
    alone = {("S", 1): ("urban", "goal_reached"), ("S", 2): ("urban", "collision"), ("T", 1): ("merge", "time_limit")}
    together = {**alone, ("S", 2): ("urban", "goal_reached"), ("S", 3): ("urban", "collision")}
    text = part("side_by_side").compared({"together": together, "alone": alone}, set(alone))
    assert text.splitlines() == [
        "| category | agents | together | alone |",
        "|---|--:|--:|--:|",
        "| merge | 1 | 0.0 %, 0.0 | 0.0 %, 0.0 |",
        "| urban | 2 | 100.0 %, 0.0 | 50.0 %, 50.0 |",
        "| all | 3 | 66.7 %, 0.0 | 33.3 %, 33.3 |",
    ]
