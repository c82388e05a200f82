"""What a comparison claims: intervals over places, when a difference is sure, what the numbers do not prove."""

import itertools
import math

import numpy as np
import pytest
from compared_batches import crash, difference, invented, row

import interdrive as idr
from interdrive.batch_report.comparison import compared_of
from interdrive.comparison import compare
from interdrive.comparison.caveats import is_certain
from interdrive.comparison.figure import draw_comparison
from interdrive.comparison.intervals import widening
from interdrive.comparison.tables import markdown, sheets_of


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


@pytest.mark.parametrize(("apart", "text"), [(-0.004, "0.00 [0.00, 0.00]"), (-0.006, "-0.01 [-0.01, -0.01]")])
def test_what_rounds_to_zero_has_no_sign_and_is_not_sure(tmp_path, apart, text):
    runs = scattered(30, values=(apart - 1e-4, apart + 1e-4))
    found = compare(invented(tmp_path / "batch", runs))
    row = difference(found, "jerk_rms")
    assert row["low"] < row["high"] < 0.0
    assert is_certain(row) is text.startswith("-")
    assert f"| jerk [m/s³] | {f'**{text}**' if is_certain(row) else text} |" in markdown(found)


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


def test_equal_seeds_give_equal_intervals_and_one_scenario_gives_none(two, tmp_path):
    assert compare(two, seed=3).differences.equals(compare(two, seed=3).differences)
    one = invented(tmp_path / "one", [("s/x", "a", {1: {}}), ("s/x", "b", {1: crash()})])
    found = difference(compare(one), "collisions")
    assert (found["difference"], found["low"], found["high"]) == (-100.0, None, None)


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
