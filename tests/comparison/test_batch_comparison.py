"""Planners compared: tables by category, paired differences with intervals, caveats; questions in SQL."""

import hashlib
import itertools
import math
import sys

import numpy as np
import pytest
from click.testing import CliRunner
from rich.console import Console

import interdrive as idr
from interdrive.batch_report.comparison import compared_of
from interdrive.batch_report.contents import batch_contents
from interdrive.batches import BatchFolder, query
from interdrive.batches.columns import AGENT_COLUMNS, COLUMNS
from interdrive.batches.dataset import encoded, joined
from interdrive.batches.job import Finished
from interdrive.cli import main
from interdrive.cli.batch_report import print_comparison
from interdrive.comparison import compare
from interdrive.comparison.caveats import is_certain
from interdrive.comparison.figure import draw_comparison
from interdrive.comparison.folder import save_comparison
from interdrive.comparison.intervals import widening
from interdrive.comparison.metrics import SHARES, weighted_medians
from interdrive.comparison.scores import batch_scores
from interdrive.comparison.tables import markdown, sheets_of
from interdrive.errors import ResultsError
from interdrive.plots.style import OUTCOME_MARKS
from interdrive.run import OUTCOMES
from interdrive.storage import arrow_table, labels

#: A file for each of so many runs takes long to write and to read.
MANY = 20


def invented(folder, runs):
    """A batch folder with invented runs.

    Args:
        folder: Where.
        runs: (scenario, planner, agents) each, or with what differs in the run as a fourth; agents is a status, or a
            mapping from ids to what differs from an agent that has reached its goal.
    """
    batch, tables = BatchFolder.create(folder), []
    for scenario, planner, agents, *other in runs:
        key = hashlib.sha256(f"{scenario} {planner} {other}".encode()).hexdigest()[:32]
        sha = hashlib.sha256(scenario.encode()).hexdigest()
        run = {
            "key": key, "scenario": scenario, "category": scenario.partition("/")[0], "planner": planner,
            "predictor": "lane_following", "settings": "", "traffic": "same", "agents": "all", "seed": 0,
            "status": "finished", "error": "", "attempts": 1, "digest": key, "dt": 0.1, "n_steps": 100,
            "read_seconds": 0.1, "run_seconds": 1.0, "kept": False, "path": f"/{scenario}.xml",
            "scenario_sha256": sha, "version": "0",
            **(other[0] if other else {}),
        }  # fmt: skip
        if isinstance(agents, str):
            rows = [{**run, "status": agents, **dict.fromkeys(column.name for column in AGENT_COLUMNS)}]
        else:
            usual = {
                column.name: 1.0 if column.kind == "number" else 0 if column.kind == "integer" else ""
                for column in AGENT_COLUMNS
            }
            usual |= {"under_test": True, "off_road": False, "outcome": "goal_reached", "agent_planner": planner}
            usual |= {"harm": None, "partner_id": None, "impact_area": None, "fault": False, "fault_nuplan": False}
            usual |= dict.fromkeys(column.name for column in AGENT_COLUMNS if column.name.startswith("preventable_"))
            usual |= {"in_time": True, "arrived": True, "forced": False}
            rows = [{**run, **usual, "agent_id": agent, **own} for agent, own in agents.items()]
        values = {column.name: [row[column.name] for row in rows] for column in COLUMNS}
        for column in COLUMNS:
            if column.kind == "label" and values[column.name][0] is not None:
                values[column.name] = labels(tuple(values[column.name]))
        tables.append(arrow_table(COLUMNS, values))
        if len(runs) < MANY:
            batch.store(key, Finished("finished", "", encoded(tables[-1])))
    if len(runs) >= MANY:  # merged, as a batch leaves them behind
        batch.results.write_bytes(encoded(joined(tables)))
    return folder


def crash(harm=0.5):
    return {"outcome": "collision", "harm": harm}


def test_collisions_that_a_careful_driver_avoids_are_counted_and_those_without_a_verdict_are_not(tmp_path):
    agents = {1: crash() | {"preventable_cc": True}, 2: crash() | {"preventable_cc": False}, 3: crash(), 4: {}}
    found = compare(invented(tmp_path / "batch", [("urban/x", "a", agents), ("urban/x", "b", {n: {} for n in agents})]))
    assert row(found, "all", "a")["preventable_cc"] == 25.0, "per 100 agents"
    assert row(found, "all", "b")["preventable_cc"] == 0.0


def row(found, category, variant):
    return next(r for r in found.table.to_pylist() if (r["category"], r["variant"]) == (category, variant))


def difference(found, metric, category="all"):
    rows = found.differences.to_pylist()
    return next(r for r in rows if (r["category"], r["metric"]) == (category, metric))


@pytest.fixture
def two(tmp_path):
    """Planner a reaches 3 of 4 goals and crashes once; planner b reaches 1 of 4."""
    late, limit = {"outcome": "goal_reached_late"}, {"outcome": "time_limit", "ttc_min": math.inf}
    return invented(
        tmp_path / "batch",
        [
            ("urban/x", "a", {1: {"ttc_min": 2.0}, 2: crash()}),
            ("urban/x", "b", {1: late, 2: limit}),
            ("highway/y", "a", {1: {"ttc_min": 4.0}, 2: {"ttc_min": 6.0}}),
            ("highway/y", "b", {1: {}, 2: limit}),
        ],
    )


def test_the_table_counts_agents_by_category(two):
    found = compare(two)
    a, b = row(found, "all", "a"), row(found, "all", "b")
    assert (a["runs"], a["n_agents"], a["goal_reached"], a["collisions"]) == (2, 4, 75.0, 25.0)
    assert a["harm"] == pytest.approx(100 * 0.5 / 4)
    assert (b["goal_reached"], b["goal_reached_late"], b["time_limit"], b["collisions"]) == (25.0, 25.0, 50.0, 0.0)
    assert row(found, "urban", "a")["goal_reached"] == 50.0
    assert row(found, "highway", "a")["ttc_min"] == 4.0
    assert [r["category"] for r in found.table.to_pylist()] == ["all", "all", "highway", "highway", "urban", "urban"]


def test_rules_that_somebody_broke_have_a_table_and_no_differences(tmp_path):
    runs = [("urban/x", "a", {1: {"n_red_light": 2, "violations": 2}, 2: {}}), ("urban/x", "b", {1: {}, 2: {}})]
    found = compare(invented(tmp_path / "batch", runs))
    sheets = {sheet.title: sheet for sheet in sheets_of(found, found.sets[0])}
    rules = sheets["Rules of the road that they broke, per 100 agents"]
    assert rules.head == ("category", "planner", "red light")
    assert [[cell.text for cell in line] for line in rules.rows[:2]] == [["all", "a", "100.0"], ["", "b", "0.0"]]
    assert "n_red_light" not in found.differences["metric"].to_pylist()


def test_the_median_of_the_smallest_ttc_counts_agents_without_a_conflict(two):
    # b: 1.0 (late), inf, 1.0, inf: the lower median is 1.0; in urban, of 1.0 and inf, too.
    assert row(compare(two), "all", "b")["ttc_min"] == 1.0


def test_a_difference_is_between_the_same_agents(tmp_path):
    folder = invented(
        tmp_path / "batch",
        [
            ("s/x", "a", {1: {}, 2: {}, 3: crash()}),  # agent 3 was not driven by b
            ("s/x", "b", {1: {}, 2: {"outcome": "time_limit"}}),
            ("s/y", "a", {1: {}}),
            ("s/y", "b", "timeout"),
        ],
    )
    found = difference(compare(folder), "goal_reached")
    assert (found["difference"], found["n_agents"], found["n_scenarios"]) == (50.0, 2, 1)
    assert difference(compare(folder), "collisions")["difference"] == 0.0


def test_a_planner_that_lacks_scenarios_is_compared_over_those_that_it_has(tmp_path):
    folder = invented(
        tmp_path / "batch",
        [
            ("urban/x", "a", {1: {}, 2: crash()}),
            ("urban/x", "b", {1: {}, 2: {}}),
            ("urban/x", "slow", {1: crash(), 2: {}}),
            ("urban/y", "a", {1: crash()}),
            ("urban/y", "b", {1: {}}),
        ],
    )
    found = compare(folder)
    assert [row(found, "all", name)["collisions"] for name in ("a", "b", "slow")] == [50.0, 0.0, 50.0]
    assert {r["n_agents"] for r in found.table.to_pylist()} == {2}
    assert found.sets[0].left_out == {"a": 1, "b": 1, "slow": 0}
    assert found.sets[0].size == "2 agents in 1 scenario, driven by all 3 planners; not counted: a 1, b 1"
    assert "Only agents that all planners drove are compared" in " ".join(found.caveats)
    whole = compare(folder, planners=["a", "b"])
    assert (row(whole, "all", "a")["n_agents"], whole.sets[0].size) == (3, "3 agents in 2 scenarios")
    assert "Only agents that" not in " ".join(whole.caveats)
    with pytest.raises(idr.InputError, match="planner c: no run of this batch has it; there are a, b, slow"):
        compare(folder, planners=["c"])


def test_runs_with_other_settings_or_of_another_version_are_other_planners(tmp_path):
    far = {"settings": "view.radius=90"}
    runs = [("s/x", "a", {1: {}}), ("s/x", "a", {1: crash()}, far), ("s/x", "a", {1: {}}, {"version": "1"})]
    found = compare(invented(tmp_path / "batch", runs))
    assert found.sets[0].variants == ("a, version 0", "a, version 1", "a, view.radius=90, version 0")
    assert row(found, "all", "a, view.radius=90, version 0")["collisions"] == 100.0


def test_runs_that_nothing_tells_apart_are_not_compared(tmp_path):
    runs = [("s/x", "own:Planner", {1: {}}), ("s/x", "own:Planner", {1: crash()}, {"n_steps": 3})]
    told = r"own:Planner drove agent 1 of s/x in several runs.*module, a library that it needs, or a file"
    with pytest.raises(idr.ResultsError, match=told):
        compare(invented(tmp_path / "batch", runs))


def test_runs_that_no_planner_could_do_are_no_set_of_their_own(tmp_path):
    away = {"traffic": "recorded", "agents": "alone"}
    runs = [("s/x", "a", {1: {}}), ("s/y", "a", "refused", away)]
    found = compare(invented(tmp_path / "batch", runs))
    assert [(one.traffic, one.agents) for one in found.sets] == [("same", "all")]
    assert "Not among them: 1 scenario in which no vehicle could be under test." in found.caveats


def test_an_interval_is_that_of_all_samples_that_can_be_drawn(tmp_path):
    """By hand: five files of 1, 2 or 4 agents with differences of -3 to 2 give 3125 samples of equal chance."""
    agents, apart = np.array([1, 2, 4, 2, 1]), np.array([-3.0, 0.0, 2.0, 1.0, -1.0])
    runs = [(f"s/{k}", "a", {i: {"jerk_rms": 5.0 + apart[k]} for i in range(agents[k])}) for k in range(5)]
    runs += [(f"s/{k}", "b", {i: {"jerk_rms": 5.0} for i in range(agents[k])}) for k in range(5)]
    drawn = np.array(list(itertools.product(range(5), repeat=5)))
    every = (agents * apart)[drawn].sum(axis=1) / agents[drawn].sum(axis=1)
    found = difference(compare(invented(tmp_path / "batch", runs), samples=20_000, level=0.8), "jerk_rms")
    assert found["difference"] == pytest.approx(0.6)
    for name, share in (("low", 0.1), ("high", 0.9)):
        end = 0.6 + widening(5, 0.8) * (np.quantile(every, share) - 0.6)
        assert found[name] == pytest.approx(end, abs=0.05)


def test_an_interval_spans_what_other_choices_of_scenarios_would_have_given(tmp_path):
    # In all six files 50 % of a and none of b reach their goal: the difference is 50 %, whatever is drawn.
    runs = [(f"s/{k}", "a", {1: {}, 2: crash() if k < 3 else {"outcome": "time_limit"}}) for k in range(6)]
    runs += [(f"s/{k}", "b", {agent: {"outcome": "time_limit"} for agent in (1, 2)}) for k in range(6)]
    found = compare(invented(tmp_path / "batch", runs))
    reached = difference(found, "goal_reached")
    assert (reached["difference"], reached["low"], reached["high"]) == (50.0, 50.0, 50.0)
    crashed = difference(found, "collisions")
    assert crashed["difference"] == 25.0
    assert crashed["low"] < 5.0 and crashed["high"] > 45.0


def test_with_fewer_than_five_places_there_is_no_interval(two):
    found = difference(compare(two), "collisions")
    assert (found["difference"], found["low"], found["high"], found["p"]) == (25.0, None, None, None)
    assert found["n_places"] == 2


def test_an_interval_of_many_scenarios_is_that_of_the_mean(tmp_path):
    """Against the normal approximation: 200 scenarios with one agent each, jerk differs by a known noise."""
    noise = np.random.default_rng(7).normal(0.3, 1.0, 200)
    runs = [(f"s/{k}", "a", {1: {"jerk_rms": 5.0 + noise[k]}}) for k in range(200)]
    runs += [(f"s/{k}", "b", {1: {"jerk_rms": 5.0}}) for k in range(200)]
    found = difference(compare(invented(tmp_path / "batch", runs), samples=4000), "jerk_rms")
    half = 1.96 * noise.std() / math.sqrt(200)
    assert found["difference"] == pytest.approx(noise.mean())
    assert found["low"] == pytest.approx(noise.mean() - half, abs=0.1 * half)
    assert found["high"] == pytest.approx(noise.mean() + half, abs=0.1 * half)


def scattered(n, values=(3.0, 5.0)):
    """Runs of n scenarios in which a has 100 more collisions per 100 than b, and another jerk by these values."""
    runs = [(f"s/{k}", "a", {1: {**crash(), "jerk_rms": values[k % len(values)]}}) for k in range(n)]
    return runs + [(f"s/{k}", "b", {1: {"jerk_rms": 0.0}}) for k in range(n)]


def test_nothing_is_claimed_about_fewer_than_10_places(tmp_path):
    for n, sure in ((9, False), (10, True)):
        found = compare(invented(tmp_path / str(n), scattered(n)))
        row = difference(found, "jerk_rms")
        assert row["low"] > 2.5  # the interval alone would say that it is sure
        assert is_certain(row) is sure
        assert ("**4." in markdown(found).partition("| metric |")[2]) is sure
        figure = draw_comparison(found)
        dot = figure.axes[4].lines[-1]
        assert (dot.get_markerfacecolor() == dot.get_markeredgecolor()) is sure
        assert any("too few for claims" in text.get_text() for text in figure.texts) is not sure


def test_an_interval_without_width_is_never_sure(tmp_path):
    found = compare(invented(tmp_path / "batch", scattered(25)))
    row = difference(found, "collisions")
    assert (row["difference"], row["low"], row["high"]) == (100.0, 100.0, 100.0)
    assert not is_certain(row)
    assert "**100.00" not in markdown(found).partition("| metric |")[2]


def test_below_the_differences_stands_what_bold_means(tmp_path):
    few = compare(invented(tmp_path / "few", scattered(2)))
    note = list(sheets_of(few, few.sets[0]))[-1].note
    assert note.startswith("Nothing is in bold: over fewer than 10 places (there are 2) intervals are rough")
    assert note in markdown(few)
    runs = [(name, who, {1: {**one[1], **({"jerk_rms": None} if name in ("s/0", "s/1") else {})}})
            for name, who, one in scattered(11)]  # fmt: skip
    mixed = compare(invented(tmp_path / "mixed", runs))
    assert list(sheets_of(mixed, mixed.sets[0]))[-1].note == (
        "Bold: the interval does not contain zero. Never in bold, with fewer than 10 places: jerk [m/s³]."
    )


@pytest.mark.parametrize(("n_scenarios", "sure"), [(6, False), (25, True)])
def test_the_page_calls_a_planner_better_only_over_enough_scenarios(tmp_path, n_scenarios, sure):
    runs = scattered(n_scenarios, values=(-3.0, -2.0))
    [compared, *_] = compared_of(compare(invented(tmp_path / "batch", runs)))
    jerk = compared["headings"].index("jerk [m/s³]")
    assert [row["cells"][jerk]["strong"] for row in compared["rows"]] == [sure, False]
    # Their intervals have no width, so that nothing is claimed.
    collisions = compared["headings"].index("collisions per 100")
    assert not any(row["cells"][collisions]["strong"] for row in compared["rows"])
    one = next(one for one in compared["pairs"][0]["differences"] if one["metric"] == "jerk [m/s³]")
    assert (one["sure"], one["verdict"]) == (sure, "better" if sure else "")
    assert one["low"] <= one["value"] <= one["high"] < 0.0
    assert one["extent"] == max(abs(one["low"]), abs(one["high"]))


def test_few_scenarios_are_warned_of_when_no_interval_has_a_width(tmp_path):
    said = " ".join(compare(invented(tmp_path / "batch", scattered(2, values=(3.0,)))).caveats)
    assert "All differences are over fewer than 10 places" in said
    assert "Intervals (95 %)" in said
    assert "truly zero" not in said


def test_true_zeros_are_counted_among_differences_of_enough_scenarios(tmp_path):
    """10 files in one category, 5 in another one: of 3 intervals of the jerk 2 count."""
    runs = [(f"{'many' if int(name[2:]) < 10 else 'few'}/{name[2:]}", *rest) for name, *rest in scattered(15)]
    found = compare(invented(tmp_path / "batch", runs))
    rows = found.differences.to_pylist()
    assert sum(row["low"] is not None and row["low"] < row["high"] for row in rows) == 3
    said = " ".join(found.caveats)
    assert "2 differences have an interval over 10 or more places (1 over all categories, 1 within categories)" in said
    assert "if all were truly zero, about 0.1 intervals or more would" in said
    assert f"{len(rows) // 3} of {len(rows)} differences are over fewer than 10" in said


def test_agents_count_once_when_seeds_chose_the_same_ones(tmp_path):
    """Seeds 0 and 2 test agents 1 and 2, seed 1 tests 2 and 3; b lacks seed 0, whose runs seed 2 repeats."""
    chosen_by = {0: (1, 2), 1: (2, 3), 2: (1, 2)}
    other = {"traffic": "recorded", "agents": "2"}
    runs = [("s/x", "a", {i: crash() if i == 1 else {} for i in ids}, {**other, "seed": seed})
            for seed, ids in chosen_by.items()]  # fmt: skip
    runs += [("s/x", "b", {i: {} for i in chosen_by[seed]}, {**other, "seed": seed}) for seed in (1, 2)]
    found = compare(invented(tmp_path / "batch", runs))
    assert (found.sets[0].n_agents, found.sets[0].left_out) == (4, {"a": 0, "b": 0})
    assert found.sets[0].size.endswith("; 2 rows are not counted, as their seeds drew the same agents as earlier ones")
    assert (row(found, "all", "a")["n_agents"], row(found, "all", "a")["collisions"]) == (4, 25.0)
    apart = difference(found, "collisions")
    assert (apart["difference"], apart["n_agents"]) == (25.0, 4)


def test_alone_every_agent_counts_once_whatever_seeds_chose_it(tmp_path):
    alone = {"traffic": "recorded", "agents": "alone"}
    runs = [("s/x", who, {agent: crash() if agent == 1 else {}}, {**alone, "seed": seed, "n_steps": agent})
            for who in ("a", "b") for agent in (1, 2, 3) for seed in range(agent)]  # fmt: skip
    found = compare(invented(tmp_path / "batch", runs))
    assert row(found, "all", "a")["n_agents"] == 3
    assert row(found, "all", "a")["collisions"] == pytest.approx(100.0 / 3.0)


def test_a_scenario_has_one_category_for_all_planners(tmp_path):
    """Planner a was given the files, planner b the folder above theirs."""
    runs = [(f"vul/{k}", who, {1: {}}, {"category": category})
            for who, category in (("a", "vul"), ("b", "top/vul")) for k in range(3)]  # fmt: skip
    runs += [("urban/x", who, {1: {}}) for who in ("a", "b")]
    folder = invented(tmp_path / "batch", runs)
    found = compare(folder)
    rows = [(row["category"], row["variant"], row["n_agents"]) for row in found.table.to_pylist()]
    assert rows[2:] == [("urban", "a", 1), ("urban", "b", 1), ("vul", "a", 3), ("vul", "b", 3)]
    assert difference(found, "collisions", "vul")["n_agents"] == 3
    assert row(compare(folder, planners=["b"]), "vul", "b")["n_agents"] == 3
    header = batch_contents(folder, {}).header
    assert (
        {part["category"] for part in header["parts"]}
        == {run["category"] for run in header["runs"]}
        == {"urban", "vul"}
    )


@pytest.mark.parametrize(("apart", "text"), [(-0.004, "0.00 [0.00, 0.00]"), (-0.006, "-0.01 [-0.01, -0.01]")])
def test_what_rounds_to_zero_has_no_sign_and_is_not_sure(tmp_path, apart, text):
    runs = scattered(30, values=(apart - 1e-4, apart + 1e-4))
    found = compare(invented(tmp_path / "batch", runs))
    row = difference(found, "jerk_rms")
    assert row["low"] < row["high"] < 0.0
    assert is_certain(row) is text.startswith("-")
    assert f"| jerk [m/s³] | {f'**{text}**' if is_certain(row) else text} |" in markdown(found)


@pytest.fixture
def ended_in_every_way(tmp_path):
    """Planner a ends in every way, thrice on and once off the lanelets at its goal; b reaches all goals, c none."""
    on, off = {"off_lanelets": 0.0}, {"off_lanelets": 0.5}
    ways = [on, on, on, off, *({"outcome": outcome} for outcome in OUTCOMES[1:])]
    return invented(
        tmp_path / "batch",
        [
            ("s/x", "a", dict(enumerate(ways))),
            ("s/x", "b", dict.fromkeys(range(len(ways)), on)),
            ("s/x", "c", {agent: {"outcome": "goal_missed"} for agent in range(len(ways))}),
        ],
    )


def test_bars_of_the_figure_end_at_100_percent_and_their_parts_are_those_of_the_table(ended_in_every_way):
    found = compare(ended_in_every_way)
    shares = draw_comparison(found).axes[0]
    bars = {bar.get_label(): bar for bar in shares.containers}
    assert len(bars) == len(shares.containers) == len(OUTCOMES)
    for k, planner in enumerate("abc"):
        parts = {label: bar[k].get_width() for label, bar in bars.items()}
        assert sum(parts.values()) == pytest.approx(100.0)
        assert max(bar[k].get_x() + bar[k].get_width() for bar in shares.containers) == pytest.approx(100.0)
        assert parts[OUTCOME_MARKS["goal_reached"].text] == pytest.approx(row(found, "all", planner)["goal_reached"])
    assert row(found, "all", "a")["goal_reached"] == pytest.approx(40.0)
    assert row(found, "all", "a")["goal_reached_on_lanelets"] == pytest.approx(30.0)


def test_bars_of_the_page_of_a_batch_are_the_shares_of_the_table(ended_in_every_way):
    found = compare(ended_in_every_way)
    [compared, *_] = compared_of(found)
    for drawn in compared["rows"]:
        assert sum(drawn["shares"].values()) == pytest.approx(100.0)
        said = row(found, "all", drawn["planner"])
        assert drawn["shares"] == {
            outcome: share
            for outcome in OUTCOMES
            if (share := said["collisions" if outcome == "collision" else outcome])
        }


def test_every_outcome_is_counted_by_exactly_one_stacked_metric():
    assert sorted(metric.column for metric in SHARES) == sorted(OUTCOMES)


#: How a batch calls the only vehicle of scenario x that no human drove.
UNABLE = {"agent_planner": "frenet"}


@pytest.fixture
def one_without_recording(tmp_path):
    """Vehicle 3 has no recording: `frenet` drove it in the runs of the planners that follow recordings."""
    mine = {"agent_planner": "recorded"}
    return invented(
        tmp_path / "batch",
        [
            ("s/x", "idm", {1: {}, 2: {}, 3: crash() | {"score": 0.0}}),
            ("s/x", "recorded", {1: mine, 2: mine, 3: UNABLE | crash() | {"score": 0.0}}),
        ],
    )


def test_a_planner_has_no_row_for_an_agent_that_it_cannot_drive(one_without_recording):
    found = compare(one_without_recording)
    [one] = found.sets
    assert (one.n_agents, one.left_out) == (2, {"idm": 1, "recorded": 0})
    assert (row(found, "all", "idm")["n_agents"], row(found, "all", "idm")["n_left_out"]) == (2, 1)
    own = {r["variant"]: (r["n_agents"], r["collisions"]) for r in found.own.to_pylist()}
    assert own == {"idm": (3, pytest.approx(100 / 3)), "recorded": (2, 0.0)}
    assert "Each planner on its own agents" in markdown(found)
    assert "left out" in markdown(found)


def test_a_score_counts_what_a_planner_cannot_drive_as_left_out_and_not_as_0(one_without_recording):
    scores = {one.variant: one for one in batch_scores(one_without_recording)}
    human, idm = scores["recorded"], scores["idm"]
    assert (human.score, human.n_agents, human.n_left_out, human.zeros) == (100.0, 2, 1, {})
    assert (idm.score, idm.n_agents, idm.n_left_out) == (pytest.approx(200 / 3), 3, 0)
    assert (human.common, idm.common, human.n_common) == (100.0, 100.0, 2)


@pytest.mark.parametrize("traffic", ["recorded", "velocity_adjusting"])
def test_a_refused_agent_is_left_out_and_a_lost_one_is_0(tmp_path, traffic):
    alone = [{"traffic": traffic, "agents": "alone", "n_steps": k} for k in range(3)]
    runs = [("s/x", "idm", {k: {}}, alone[k]) for k in range(3)]
    runs += [
        ("s/x", "other", {0: {}}, alone[0]),
        ("s/x", "other", "refused", alone[1]),
        ("s/x", "other", "crashed", alone[2]),
    ]
    other = next(one for one in batch_scores(invented(tmp_path / "batch", runs)) if one.variant == "other")
    assert (other.n_agents, other.n_left_out, other.score, other.zeros) == (2, 1, 50.0, {"lost": 1})


def test_replayed_humans_are_judged_among_replayed_traffic_only(tmp_path):
    alone = {"agents": "alone"}
    runs = [
        ("s/x", who, {1: {}}, {**alone, "traffic": traffic})
        for who in ("idm", "recorded")
        for traffic in ("recorded", "velocity_adjusting")
    ]
    folder = invented(tmp_path / "batch", runs)
    there = {("recorded", "idm"), ("recorded", "recorded"), ("velocity_adjusting", "idm")}
    assert {(r["traffic"], r["variant"]) for r in compare(folder).table.to_pylist()} == there
    assert {(one.traffic, one.variant) for one in batch_scores(folder)} == there
    only = invented(tmp_path / "only", runs[-1:])
    for judge in (compare, batch_scores):
        with pytest.raises(ResultsError, match="replayed humans do not react"):
            judge(only)


@pytest.mark.parametrize("width", [60, 80, 120])
def test_no_number_is_cut_and_names_stay_apart_in_a_narrow_terminal(tmp_path, monkeypatch, capsys, width):
    long = ["company.planners.cooperative:CautiousPlanner", "company.planners.cooperative:CuriousPlanner"]
    found = compare(invented(tmp_path / "batch", [("s/x", who, {1: {"jerk_rms": 123456.78}}) for who in long]))
    monkeypatch.setattr(
        "interdrive.cli.batch_report.output", lambda: Console(width=width, force_terminal=True, color_system=None)
    )
    print_comparison(found, tmp_path)
    said = capsys.readouterr().out
    assert "123456.78" in said
    assert "…" not in said
    assert {"Cautious", "Curious"} <= {word for word in ("Cautious", "Curious") if word in "".join(said.split())}


@pytest.mark.parametrize("apart", [0.0, 0.003, -0.03, 0.7, -4.1, -12.0, 345.0])
def test_tick_labels_of_the_figure_do_not_overlap(tmp_path, apart):
    runs = [("s/x", "a", {1: {"jerk_rms": 500.0 + apart}}), ("s/x", "b", {1: {"jerk_rms": 500.0}})]
    figure = draw_comparison(compare(invented(tmp_path / "batch", runs)))
    figure.draw_without_rendering()
    boxes = []
    for panel in figure.axes[1:]:
        low, high = panel.get_xlim()
        shown = [label for label in panel.get_xticklabels() if low <= label.get_position()[0] <= high]
        boxes += [label.get_window_extent() for label in shown]
        assert len(shown) >= 2
        assert low < 0.0 < high
    assert all(one.x1 < other.x0 for one, other in itertools.pairwise(boxes))


def test_headings_of_the_figure_fit_its_width(tmp_path):
    longest = {"traffic": "velocity_adjusting", "agents": "10"}
    runs = [(f"s/{k}", who, {1: {}}, longest) for who in ("a", "b") for k in range(3)]
    figure = draw_comparison(compare(invented(tmp_path / "batch", runs)))
    figure.draw_without_rendering()
    assert len(figure.texts) == 2
    assert all(text.get_window_extent().x1 < figure.bbox.x1 for text in figure.texts)


def test_few_collisions_are_told_of_each_set_by_name(tmp_path):
    runs = [("s/x", "a", {1: {}}, {"traffic": "recorded", "agents": agents}) for agents in ("2", "alone")]
    said = [line for line in compare(invented(tmp_path / "batch", runs)).caveats if "Few collisions" in line]
    assert [line.partition(" (")[0] for line in said] == [
        "Few collisions with traffic recorded, agents 2",
        "Few collisions with traffic recorded, agents alone",
    ]


def test_all_agents_of_a_scenario_go_together(tmp_path):
    """Ten equal agents in each of six files are six observations, not sixty."""
    runs = [(f"s/{n}", "a", {k: crash() if n < 3 else {} for k in range(10)}) for n in range(6)]
    runs += [(f"s/{n}", "b", {k: {} for k in range(10)}) for n in range(6)]
    folder = invented(tmp_path / "batch", runs)
    found, alone = (difference(compare(folder, group=group), "collisions") for group in ("place", "agent"))
    assert (found["difference"], alone["difference"]) == (50.0, 50.0)
    assert (found["n_places"], alone["n_places"]) == (6, 60)
    assert found["high"] - found["low"] > 2.0 * (alone["high"] - alone["low"])


def test_files_of_one_map_are_one_place(tmp_path):
    names = [f"DEU_Muc-{number}_{window}_T-1" for number in range(1, 7) for window in (1, 2)]
    names += ["USA_US101-1_1_T-1", "USA_US101-22_1_T-1", "mine"]
    runs = [(name, who, {1: crash() if who == "a" and k % 2 else {}}) for k, name in enumerate(names) for who in "ab"]
    folder = invented(tmp_path / "batch", runs)
    places, files = (difference(compare(folder, group=group), "collisions") for group in ("place", "file"))
    assert (places["n_places"], files["n_places"]) == (8, 15), "six maps, one site cut twice, a file without a place"
    said = " ".join(compare(folder, group="file").caveats)
    assert "Of 7 places there are several files, so intervals over files are too narrow" in said
    with pytest.raises(idr.InputError, match="group 'road': expected one of place, file, agent"):
        compare(folder, group="road")


def test_one_place_with_most_of_the_agents_is_told(tmp_path):
    runs = [(f"s/{n}", who, {k: {} for k in range(9 if n == 0 else 1)}) for n in range(6) for who in "ab"]
    said = " ".join(compare(invented(tmp_path / "batch", runs)).caveats)
    assert "64 % of the compared agents are of one place (s/0), which decides the means" in said


def test_scores_are_those_of_the_command_score_and_pairs_are_adjusted_for_each_other(tmp_path):
    """File 0 has 3 agents, the others 1: the mean of files is not that of agents."""
    worth = {"a": 0.9, "b": 0.6, "c": 0.6}
    runs = [
        (
            f"s/{n}",
            who,
            {k: {"score": worth[who] - 0.01 * n - 0.1 * (n == 0 and who == "a")} for k in range(1 + 2 * (n == 0))},
        )
        for n in range(12)
        for who in "abc"
    ]
    folder = invented(tmp_path / "batch", runs)
    found = compare(folder)
    for one in batch_scores(folder):
        assert row(found, "all", one.variant)["score"] == pytest.approx(one.score)
    scores = [r for r in found.differences.to_pylist() if r["metric"] == "score"]
    assert [is_certain(r) for r in scores] == [True, True, False]
    assert scores[0]["p"] > 2.0 / 5001, "three pairs: the rarest p counts threefold"
    [paper] = found.paper
    assert [line[0] for line in paper.rows] == ["a", "b", "c"]
    assert [line[3] for line in paper.rows] == ["a", "b", "b"]
    assert "all 3 pairs, p adjusted after Holm, 0.05" in paper.caption


def test_equal_seeds_give_equal_intervals_and_one_scenario_gives_none(two, tmp_path):
    assert compare(two, seed=3).differences.equals(compare(two, seed=3).differences)
    one = invented(tmp_path / "one", [("s/x", "a", {1: {}}), ("s/x", "b", {1: crash()})])
    found = difference(compare(one), "collisions")
    assert (found["difference"], found["low"], found["high"]) == (-100.0, None, None)


@pytest.mark.parametrize(
    ("values", "weights", "median"),
    [
        ([3.0, 1.0, 2.0], [1, 1, 1], 2.0),
        ([3.0, 1.0, 2.0], [0, 1, 1], 1.0),
        ([3.0, 1.0, math.inf], [1, 0, 2], math.inf),
        ([3.0, 1.0, 2.0], [5, 1, 1], 3.0),
        ([3.0, 1.0], [0, 0], math.nan),
    ],
)
def test_weighted_medians(values, weights, median):
    found = weighted_medians(np.array(values), np.array([weights], dtype=float))
    np.testing.assert_equal(found, [median])


def test_traffic_and_agents_are_compared_apart(tmp_path):
    done = idr.batch("lane_merge", tmp_path, planner="idm,idm_mobil", workers=2)
    idr.batch("lane_merge", tmp_path, planner="idm,idm_mobil", agents=2, workers=2)
    found = compare(done.folder)
    assert {(r["traffic"], r["agents"]) for r in found.table.to_pylist()} == {("same", "all"), ("recorded", "2")}
    assert {r["n_agents"] for r in found.table.to_pylist()} == {7, 2}


def test_it_says_what_the_numbers_do_not_prove(tmp_path, two):
    said = " ".join(compare(two).caveats)
    assert "fewer than 10 places" in said
    assert "Few collisions (a 1, b 0)" in said
    assert "planners meet different traffic" in said
    assert "did not finish" not in said
    lost = invented(
        tmp_path / "lost",
        [("s/x", "a", {1: {}}), ("s/x", "b", "crashed"), ("s/z", "a", "refused"), ("s/z", "b", "refused")],
    )
    found = compare(lost)
    assert "Runs that did not finish are not in the numbers (b 1)" in " ".join(found.caveats)
    assert (row(found, "all", "b")["runs_lost"], row(found, "all", "b")["n_agents"]) == (1, 0)


def test_a_comparison_is_a_folder_that_is_replaced_but_nothing_else(two, tmp_path):
    found = compare(two)
    target = save_comparison(found, tmp_path / "out")
    assert sorted(path.name for path in target.iterdir()) == [
        "caveats.txt", "comparison.md", "comparison.pdf", "comparison.png", "differences.csv", "differences.parquet",
        "paper.md", "paper.tex", "table.csv", "table.parquet",
    ]  # fmt: skip
    assert (target / "comparison.pdf").read_bytes().startswith(b"%PDF")
    text = (target / "comparison.md").read_text(encoding="utf-8")
    assert "| **all** | **a** | **2** | **0** | **4** | **75.0** |" in text
    assert "| collisions per 100 | 25.00 |" in text
    latex = (target / "paper.tex").read_text(encoding="utf-8")
    assert r"95 \% & in time \%" in latex and r"No intervals: there are fewer than 5 places." in latex
    assert (target / "paper.md").read_text(encoding="utf-8").startswith("| planner | score | 95 % |")
    save_comparison(found, target, overwrite=True)
    (target / "mine.txt").write_text("mine")
    with pytest.raises(idr.ResultsError, match=r"has other contents \(mine.txt\)"):
        save_comparison(found, target, overwrite=True)


def test_nothing_to_compare_is_one_line(tmp_path):
    with pytest.raises(idr.ResultsError, match="not a batch folder"):
        compare(tmp_path)
    BatchFolder.create(tmp_path / "empty")
    with pytest.raises(idr.ResultsError, match="no run of this batch has finished"):
        compare(tmp_path / "empty")
    with pytest.raises(idr.InputError, match="samples: expected at least 100"):
        compare(invented(tmp_path / "one", [("s/x", "a", {1: {}})]), samples=3)


def test_questions_in_sql_see_merged_runs_and_others_once(two):
    before = query(two, "select planner, count(*) from agents group by all order by all")
    assert before.columns == ("planner", "count_star()")
    assert before.rows == (("a", 4), ("b", 4))
    batch = BatchFolder.open(two)
    fresh = batch.unmerged()[0]
    content = fresh.read_bytes()
    batch.tidy(now=True)
    fresh.write_bytes(content)  # merged and not yet removed
    assert query(two, "select planner, count(*) from agents group by all order by all").rows == before.rows
    assert query(two, "select count(*) from runs").rows == ((4,),)


def test_questions_that_cannot_be_answered_are_one_line(two, tmp_path, monkeypatch):
    with pytest.raises(idr.InputError, match=r"^sql: .*speling"):
        query(two, "select speling from results")
    with pytest.raises(idr.ResultsError, match="not a batch folder"):
        query(tmp_path, "select 1")
    BatchFolder.create(tmp_path / "empty")
    with pytest.raises(idr.InputError, match="nothing to query"):
        query(tmp_path / "empty", "select 1")
    monkeypatch.setitem(sys.modules, "duckdb", None)
    with pytest.raises(idr.InterdriveError, match=r"pip install interdrive\[duckdb\]"):
        query(two, "select 1")


def test_the_commands_print_tables(two):
    def said(*arguments):
        done = CliRunner().invoke(main, list(map(str, arguments)))
        assert done.exit_code == 0, done.output
        return done.stdout.splitlines()

    lines = said("compare", two)
    assert lines[0] == "Every vehicle has the planner under test (traffic same, agents all)"
    assert lines[1] == "4 agents in 2 scenarios"
    assert any(line.split()[:6] == ["all", "a", "2", "0", "4", "75.0"] for line in lines)
    assert any(line.startswith("collisions per 100") and "25.00" in line for line in lines)
    assert "Caveats:" in lines
    assert (two / "comparison" / "comparison.png").exists()
    assert not any("b" in line.split()[:2] for line in said("compare", two, "--planner", "a"))
    assert said("compare", two, "--latex") == (two / "comparison" / "paper.tex").read_text("utf-8").splitlines()
    question = "select planner, outcome, count(*) as n from agents group by all order by all"
    assert said("sql", two, question)[1].split() == ["a", "collision", "1"]
    assert said("sql", two, question, "--csv")[:2] == ["planner,outcome,n", "a,collision,1"]
