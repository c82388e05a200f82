"""Rows of benchmarks where planners can drive different agents: each on its own, and all on those in common."""

from __future__ import annotations

import hashlib
import json
import math
import re
from pathlib import Path

import pytest
from tests.comparison.test_batch_comparison import UNABLE, crash, invented

from interdrive.batches.store import BatchFolder
from interdrive.benchmarks import Benchmark, SetFile, read_benchmark, read_set, run
from interdrive.benchmarks.reference import reference_rows
from interdrive.benchmarks.rows import from_plain, plain, planner_rows, scenario_scores
from interdrive.cli.score_report import print_batch_scores, print_benchmark
from interdrive.comparison import compare
from interdrive.comparison.scores import batch_scores
from interdrive.comparison.variants import left_out_humans, rows_of
from interdrive.errors import ResultsError

TRAFFIC = ("recorded", "velocity_adjusting")
FAILED = crash() | {"score": 0.0}
LEFT_OUT = "left out: agents that a planner cannot drive, or whose recordings overlap those of others"
#: An agent that is not scored, as its recording overlaps that of another one.
OVERLAPS = {"score": None, "score_1": None}


def file(name, agents=(1, 2, 3), category="s"):
    sha256 = hashlib.sha256(f"{category}/{name}".encode()).hexdigest()
    return SetFile(name, sha256, (), category, name, "recorded", "dev", agents)


def alone(planner, agents, name="x", category="s", among=TRAFFIC):
    """Runs of single agents by id: what differs from an agent that has reached its goal, or the status of its run."""
    return [
        (
            f"{category}/{name}",
            planner,
            how if isinstance(how, str) else {number: how},
            {"traffic": traffic, "agents": "alone", "n_steps": number},
        )
        for traffic in among
        for number, how in agents.items()
    ]


def rows(folder, runs, *files):
    """Rows of a benchmark with these runs, by planner and category."""
    table = rows_of(BatchFolder.open(invented(folder, runs)).table())
    table["variant"] = table["planner"]
    labels = list(dict.fromkeys(planner for _, planner, _, _ in runs))
    return {(row.planner, row.category): row for row in planner_rows(table, labels, files or (file("x"),))}


def driven(planner):
    return {"agent_planner": planner}


#: No human drove vehicle 3: in place of `recorded` a batch drives it with `frenet`; idm crashes with it.
WITHOUT_RECORDING = [
    *alone("idm", {1: {}, 2: {}, 3: FAILED}),
    *alone("recorded", {1: driven("recorded"), 2: driven("recorded"), 3: UNABLE | FAILED}),
]


def test_what_a_planner_cannot_drive_has_no_row_and_is_no_zero(tmp_path):
    found = rows(tmp_path / "out", WITHOUT_RECORDING)
    human, idm = found["recorded", "all"], found["idm", "all"]
    assert (human.n_agents, human.n_left_out, human.non_reactive, human.zeros) == (2, 1, 100.0, {})
    assert (idm.n_agents, idm.n_left_out, idm.score) == (3, 0, pytest.approx(200 / 3))


def test_all_planners_are_shown_on_the_agents_in_common_too(tmp_path):
    found = rows(tmp_path / "out", WITHOUT_RECORDING)
    human, idm = found["recorded", "all"], found["idm", "all"]
    assert (human.n_common, human.common_non_reactive) == (2, 100.0)
    assert (idm.n_common, idm.common, idm.common_non_reactive) == (2, 100.0, 100.0)
    assert math.isnan(human.score) and math.isnan(human.common), "replayed humans do not react"


def test_a_planner_that_adjusts_speed_on_recordings_is_left_out_alike(tmp_path):
    runs = [
        *alone("idm", {1: {}, 2: {}, 3: {}}),
        *alone("velocity_adjusting", {1: driven("velocity_adjusting"), 2: FAILED | driven("velocity_adjusting")}),
        *alone("velocity_adjusting", {3: UNABLE | FAILED}),
    ]
    row = rows(tmp_path / "out", runs)["velocity_adjusting", "all"]
    assert (row.n_agents, row.n_left_out, row.score, row.common) == (2, 1, 50.0, 50.0)


def test_a_refused_agent_is_left_out_and_a_lost_one_is_0_among_those_in_common(tmp_path):
    runs = [*alone("idm", {1: {}, 2: {}, 3: {}}), *alone("other", {1: {}, 2: "crashed", 3: "refused"})]
    found = rows(tmp_path / "out", runs)
    other, idm = found["other", "all"], found["idm", "all"]
    assert (other.n_agents, other.n_left_out, other.score, other.zeros) == (2, 1, 50.0, {"lost": 1})
    assert (other.n_common, other.common, idm.common) == (2, 50.0, 100.0)


def test_agents_whose_recordings_overlap_those_of_others_are_left_out_for_every_planner(tmp_path):
    """They drive, but have no score; it is no 0, also where another planner crashes with one of them."""
    runs = [*alone("idm", {1: {}, 2: FAILED, 3: OVERLAPS}), *alone("other", {1: {}, 2: {}, 3: "crashed"})]
    found = rows(tmp_path / "out", runs)
    other, idm = found["other", "all"], found["idm", "all"]
    assert (idm.n_agents, idm.n_left_out, idm.score, idm.non_reactive) == (2, 1, 50.0, 50.0)
    assert (idm.zeros, idm.n_common) == ({"terms": 1}, 2)
    assert (other.n_left_out, other.n_common, other.common) == (1, 2, 100.0)
    table = rows_of(BatchFolder.open(tmp_path / "out").table())
    table["variant"] = table["planner"]
    assert scenario_scores(table, "idm", [file("x")]) == {"x": {"recorded": 50.0, "velocity_adjusting": 50.0}}


def test_scores_of_a_batch_leave_out_agents_whose_recordings_overlap_those_of_others(tmp_path):
    runs = alone("idm", {1: {}, 2: FAILED, 3: OVERLAPS}, among=("recorded",))
    one = batch_scores(invented(tmp_path / "out", runs))[0]
    assert (one.n_agents, one.n_left_out, one.score, one.reached) == (2, 1, 50.0, 50.0)
    assert (one.n_common, one.common) == (2, 50.0)


def test_agents_in_common_are_counted_by_category(tmp_path):
    runs = [
        *alone("idm", {1: {}, 2: FAILED}, "x", "town"),
        *alone("idm", {5: {}}, "y", "highway"),
        *alone("other", {1: {}, 2: "refused"}, "x", "town"),
        *alone("other", {5: FAILED}, "y", "highway"),
    ]
    found = rows(tmp_path / "out", runs, file("x", (1, 2), "town"), file("y", (5,), "highway"))
    counted = {key: (row.n_agents, row.n_left_out, row.n_common) for key, row in found.items()}
    assert counted["idm", "all"] == (3, 0, 2) and counted["other", "all"] == (2, 1, 2)
    assert counted["other", "town"] == (1, 1, 1) and counted["other", "highway"] == (1, 0, 1)
    assert (found["idm", "town"].score, found["idm", "town"].common) == (50.0, 100.0)


def test_planners_without_a_common_agent_have_no_number_for_it(tmp_path):
    runs = [*alone("idm", {1: {}, 2: "refused"}), *alone("other", {1: "refused", 2: {}})]
    found = rows(tmp_path / "out", runs, file("x", (1, 2)))
    assert {(row.n_left_out, row.n_common) for row in found.values()} == {(1, 0)}
    assert all(math.isnan(row.common) for row in found.values())
    assert plain(found["idm", "all"])["common"] is None


def test_one_planner_that_drives_all_agents_has_them_in_common_with_itself(tmp_path):
    row = rows(tmp_path / "out", alone("idm", {1: {}, 2: FAILED, 3: {}}))["idm", "all"]
    assert (row.n_left_out, row.n_common, row.common) == (0, 3, row.score)


def test_scenario_scores_have_no_zero_for_what_a_planner_cannot_drive(tmp_path):
    table = rows_of(BatchFolder.open(invented(tmp_path / "out", WITHOUT_RECORDING)).table())
    table["variant"] = table["planner"]
    assert scenario_scores(table, "recorded", [file("x")]) == {"x": {"recorded": 100.0}}


def printed(folder, runs, capsys, *, reference=()):
    made = tuple(rows(folder, runs).values())
    print_benchmark(Benchmark("tiny", "", "dev", made, {}, reference, (), "interdrive benchmark idm", Path("out")))
    return capsys.readouterr().out


def words_of(said):
    """Lines of a table whose words have one space between them."""
    return [" ".join(line.split()) for line in said.splitlines()]


def test_the_table_says_how_many_are_left_out_and_in_common(tmp_path, capsys):
    said = printed(tmp_path / "out", WITHOUT_RECORDING, capsys)
    words = " ".join(said.split())
    assert re.search(r"left\s.*out\s", said, re.DOTALL) and said.count("common") == 4, "3 headings, and the line below"
    human = " ".join(line for line in words_of(said) if line.startswith("recorded all"))
    assert human == "recorded all 100.0 1000.00 1 2 1 2 100.0", "NR, ms, scenarios, agents, left out, common"
    told = f"{LEFT_OUT}; common: agents that all planners of this command can drive"
    assert told in words
    assert "recorded has no row among reacting traffic: replayed humans do not react" in words


def test_known_planners_beside_one_that_drives_all_agents_have_a_number_left_out_only(tmp_path, capsys):
    known = tuple(reference_rows(read_set("public-1"), "test"))
    said = printed(tmp_path / "out", alone("idm", {1: {}, 2: {}, 3: {}}), capsys, reference=known)
    assert f"{LEFT_OUT}\n" in said and "common" not in said
    human = next(row for row in known if (row.planner, row.category) == ("recorded", "all"))
    counts = f"{human.n_scenarios} +{human.n_agents} +{human.n_left_out}"
    assert human.n_left_out > 0 and re.search(rf"recorded \(\S+\) .* {counts}", said)


def test_the_table_has_no_columns_about_agents_that_nobody_leaves_out(tmp_path, capsys):
    said = printed(tmp_path / "out", alone("idm", {1: {}, 2: {}, 3: {}}), capsys)
    assert "left out" not in said and "common" not in said and "replayed humans" not in said


@pytest.mark.parametrize(
    ("name", "split", "total", "overlap"), [("shipped-2", "dev", 72, 0), ("public-1", "test", 252, 6)]
)
def test_rows_of_known_planners_say_how_many_agents_they_leave_out(name, split, total, overlap):
    """Recordings that overlap are those of every planner; the rest has no recording to replay."""
    listed = sum(len(one.agents) for one in read_set(name).of_split(split))
    found = [row for row in reference_rows(read_set(name), split) if row.category == "all"]
    assert {row.n_agents + row.n_left_out for row in found} == {listed} == {total}
    assert {row.n_left_out for row in found if row.planner != "recorded"} == {overlap}
    assert {row.planner for row in found if row.n_left_out > overlap} == {"recorded"}


def test_raw_recordings_are_another_benchmark_than_that_of_known_planners(tmp_path, monkeypatch):
    given = []

    def batch(*_, **options):
        given.append(options["settings"])
        raise InterruptedError

    monkeypatch.setattr(run, "batch", batch)
    for raw in (False, True):
        with pytest.raises(InterruptedError):
            run.benchmark("idm", out=tmp_path, raw=raw)
    assert given == [None, {"recording.raw": True}]
    assert run._command(["idm"], "shipped-2", "dev", None, "default", raw=True).endswith(" --split dev --raw")
    assert run._command(["idm"], "shipped-2", "dev", None, "p", raw=False).endswith(" --split dev --panel p")


def test_comparisons_and_scores_say_that_replayed_humans_among_reacting_traffic_are_left_out(tmp_path, capsys):
    folder = invented(tmp_path / "both", WITHOUT_RECORDING)
    caveat = "Planner recorded among reacting traffic is not judged and has no row there: replayed humans do not react."
    assert caveat in compare(folder).caveats
    assert caveat not in compare(folder, planners=["idm"]).caveats
    print_batch_scores(batch_scores(folder), no_humans=left_out_humans(BatchFolder.open(folder).table()), as_csv=False)
    assert "recorded has no row among reacting traffic" in capsys.readouterr().out


def test_comparisons_among_replayed_traffic_do_not_speak_of_it(tmp_path):
    runs = [*alone("idm", {1: {}}, among=TRAFFIC), *alone("recorded", {1: driven("recorded")}, among=TRAFFIC[:1])]
    folder = invented(tmp_path / "replayed", runs)
    assert not left_out_humans(BatchFolder.open(folder).table())
    assert "not judged" not in " ".join(compare(folder).caveats)


def test_rows_have_a_number_and_columns_and_are_read_again(tmp_path):
    row = rows(tmp_path / "out", alone("idm", {1: {}, 2: FAILED, 3: {}}))["idm", "all"]
    told = plain(row)
    assert told["number"] == told["columns"]["velocity_adjusting"] == pytest.approx(200 / 3)
    assert told["columns"]["recorded"] == pytest.approx(200 / 3)
    again = from_plain(json.loads(json.dumps(told)), [file("x")])
    assert (again.number, again.columns, again.hindrance) == (row.number, row.columns, 1.0)


def test_a_benchmark_of_the_release_before_is_read_with_its_score_as_score_1(tmp_path):
    junction = next(one for one in read_set("shipped-2").files if one.name == "t_junction")
    old = {
        "planner": "mine", "category": "all", "score": 80.0, "low": 70.0, "high": 90.0, "non_reactive": 75.0,
        "reached": 50.0, "at_fault": 0.0, "ttc_critical": 1.0, "jerk": 2.0, "plan_ms": 0.1, "n_scenarios": 4,
        "n_agents": len(junction.agents), "zeros": {"progress": 1}, "version": "0.1.0", "n_left_out": 0,
        "n_common": 8, "common": 80.0, "common_non_reactive": 75.0,
    }  # fmt: skip
    content = {"format": 1, "set": "shipped-2", "split": "dev", "rows": [old]}
    (tmp_path / "benchmark.json").write_text(json.dumps(content))
    found = read_benchmark(tmp_path)[0]
    assert (found.planner, found.score_1, found.score_1_non_reactive, found.reached) == ("mine", 80.0, 75.0, 50.0)
    assert math.isnan(found.number) and math.isnan(found.low) and math.isnan(found.columns["recorded"])
    for damaged in ("{}", "not JSON", json.dumps(content | {"format": 3}), json.dumps(content | {"rows": [{}]})):
        (tmp_path / "benchmark.json").write_text(damaged)
        with pytest.raises(ResultsError, match=r"benchmark\.json"):
            read_benchmark(tmp_path)
