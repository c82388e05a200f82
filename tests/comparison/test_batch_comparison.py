"""Planners compared: tables by category, paired differences, figures; questions in SQL."""

import itertools
import math
import sys

import numpy as np
import pytest
from click.testing import CliRunner
from compared_batches import crash, difference, invented, row
from rich.console import Console

import interdrive as idr
from interdrive.batch_report.comparison import compared_of
from interdrive.batch_report.contents import batch_contents
from interdrive.batches import BatchFolder, query
from interdrive.cli import main
from interdrive.cli.batch_report import print_comparison
from interdrive.comparison import compare
from interdrive.comparison.caveats import is_certain
from interdrive.comparison.figure import draw_comparison
from interdrive.comparison.folder import save_comparison
from interdrive.comparison.metrics import SHARES, weighted_medians
from interdrive.comparison.scores import batch_scores
from interdrive.comparison.tables import markdown, sheets_of
from interdrive.errors import ResultsError
from interdrive.plots.style import OUTCOME_MARKS
from interdrive.run import OUTCOMES


def test_collisions_that_a_careful_driver_avoids_are_counted_and_those_without_a_verdict_are_not(tmp_path):
    agents = {1: crash() | {"preventable_cc": True}, 2: crash() | {"preventable_cc": False}, 3: crash(), 4: {}}
    found = compare(invented(tmp_path / "batch", [("urban/x", "a", agents), ("urban/x", "b", {n: {} for n in agents})]))
    assert row(found, "all", "a")["preventable_cc"] == 25.0, "per 100 agents"
    assert row(found, "all", "b")["preventable_cc"] == 0.0


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


@pytest.mark.long
def test_traffic_and_agents_are_compared_apart(tmp_path):
    done = idr.batch("lane_merge", tmp_path, planner="idm,idm_mobil", workers=2)
    idr.batch("lane_merge", tmp_path, planner="idm,idm_mobil", agents=2, workers=2)
    found = compare(done.folder)
    assert {(r["traffic"], r["agents"]) for r in found.table.to_pylist()} == {("same", "all"), ("recorded", "2")}
    assert {r["n_agents"] for r in found.table.to_pylist()} == {7, 2}


@pytest.mark.long
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


@pytest.mark.long
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
