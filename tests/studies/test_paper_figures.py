"""Figures for papers: their widths, which agents they show, that texts stay texts, and what is refused."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from invented_run import invented_run
from matplotlib.colors import to_rgba

from interdrive.cli import main
from interdrive.errors import InputError
from interdrive.plots import (
    chosen_agents,
    draw_measures,
    draw_run,
    draw_scene,
    draw_trajectories,
    draw_velocity,
    save_figure,
)
from interdrive.plots.figures import KINDS
from interdrive.plots.style import agent_colors, pair_colors
from interdrive.results import read_results, save
from interdrive.results.reader import stored_plans
from interdrive.runs import reopen
from interdrive.simulation import simulate


@pytest.fixture(scope="module")
def run():
    return invented_run()


@pytest.fixture(scope="module")
def merge():
    return simulate("lane_merge", threads=1)


@pytest.fixture(scope="module")
def folder(merge, tmp_path_factory):
    return save(merge, tmp_path_factory.mktemp("paper") / "run")


def texts(figure, tmp_path) -> set[str]:
    save_figure(figure, tmp_path / "figure.svg")
    return set(re.findall(r"<text[^>]*>([^<]+)</text>", (tmp_path / "figure.svg").read_text(encoding="utf-8")))


@pytest.mark.parametrize(("columns", "width"), [(1, 88.0), (2, 180.0)])
def test_every_kind_is_as_wide_as_its_columns_and_fits_a_page(merge, columns, width):
    agents = [agent.id for agent in merge.agents][:3]
    figures = [
        draw_trajectories(merge, columns=columns),
        draw_velocity(merge, agents, columns=columns),
        draw_measures(merge.criticality(), agents, columns=columns),
        draw_scene(merge, merge.plans, 2.0, columns=columns),
    ]
    for figure in figures:
        wide, high = figure.get_size_inches() * 25.4
        assert wide == pytest.approx(width)
        assert high < 240.0


def test_texts_stay_texts_in_vector_files(run, tmp_path):
    assert {"velocity [m/s]", "time [s]", "1", "3"} <= texts(draw_velocity(run, [1, 3]), tmp_path)
    save_figure(draw_velocity(run, [1, 3]), tmp_path / "figure.pdf")
    assert b"/FontFile2" in (tmp_path / "figure.pdf").read_bytes(), "TrueType outlines, not pictures of letters"
    assert b"/Type3" not in (tmp_path / "figure.pdf").read_bytes()


def test_the_same_figure_has_the_same_bytes(run, tmp_path):
    for name in ("a.svg", "b.svg"):
        save_figure(draw_velocity(run, [1]), tmp_path / name)
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()


def test_velocities_are_those_of_the_run_and_end_with_the_outcome(run):
    line, mark = draw_velocity(run, [2]).axes[0].get_lines()[:2]
    np.testing.assert_array_equal(line.get_ydata(), run.states.velocity[1])
    assert mark.get_xdata()[0] == pytest.approx(4.7), "it collides at time step 47"
    assert mark.get_marker() == "X"


def test_an_agent_keeps_its_colour_in_every_figure(run, merge):
    color = agent_colors(run)[3]
    assert draw_velocity(run, [3]).axes[0].get_lines()[0].get_color() == color
    bodies = draw_scene(run, run.plans, 2.0, [3]).axes[0].collections
    assert to_rgba(color) in {tuple(one.get_facecolor()[0]) for one in bodies if len(one.get_facecolor())}
    other = merge.agents[1].id
    line = draw_measures(merge.criticality(), [other]).axes[0].get_lines()[0]
    assert line.get_color() == agent_colors(merge)[other]


def test_two_vehicles_of_a_scene_never_share_a_colour(run):
    alone = replace(run, agents=run.agents[:1])
    assert pair_colors([run], (3, 2)) == (agent_colors(run)[3], agent_colors(run)[2])
    assert pair_colors([alone, run], (3, 2)) == pair_colors([run], (3, 2))
    for pair in ((1, 20), (20, 1), (20, 21)):
        first, second = pair_colors([run], pair)
        assert first != second


def test_only_chosen_agents_are_named_and_the_others_are_other_vehicles(run, tmp_path):
    assert {"goal reached (1)", "other vehicles"} <= texts(draw_trajectories(run, [1]), tmp_path)
    assert "collision (1)" not in texts(draw_trajectories(run, [1]), tmp_path)
    all_texts = texts(draw_trajectories(run), tmp_path)
    assert {"collision (1)", "recorded traffic"} <= all_texts
    assert all_texts == texts(draw_run(run), tmp_path)


def test_measures_show_finite_values_up_to_where_they_matter(merge):
    found = merge.criticality()
    agents = [agent.id for agent in merge.agents][:2]
    panels = draw_measures(found, agents, ["ttc", "hw"]).axes
    drawn = panels[0].get_lines()[0].get_ydata()
    values = found["ttc"][found.row(agents[0])]
    np.testing.assert_array_equal(drawn, np.where(np.isfinite(values), values, np.nan))
    assert panels[0].get_ylim()[1] <= 10.5


def test_a_measure_is_drawn_once_and_long_names_take_two_lines_of_a_wider_margin(merge):
    found = merge.criticality()
    long = draw_measures(found, [merge.agents[0].id], ["psd", "ttc", "psd"]).axes
    assert [panel.get_ylabel() for panel in long] == [
        "proportion of stopping\ndistance",
        "time to collision\nalong lanes [s]",
    ]
    short = draw_measures(found, [merge.agents[0].id], ["thw"]).axes
    assert long[0].get_position().x0 * 88.0 == pytest.approx(short[0].get_position().x0 * 88.0 + 3.0)


def test_a_scene_shows_agents_where_they_are_with_their_plans(run):
    figure = draw_scene(run, run.plans, 2.0, [1])
    without = draw_scene(run, None, 2.0, [1])
    assert len(figure.axes[0].collections) == len(without.axes[0].collections) + 1
    assert [text.get_text() for text in figure.axes[0].texts if text.get_text() == "1"] == ["1"]


def test_plans_of_a_folder_are_those_of_the_run(merge, folder):
    plans = stored_plans(read_results(folder))
    for name in ("time_step", "agent_id", "status", "cost", "x", "velocity"):
        np.testing.assert_array_equal(getattr(plans, name), getattr(merge.plans, name))


def test_goals_of_a_run_survive_its_folder(merge, folder):
    again = reopen(folder)
    for agent, stored in zip(merge.agents, again.agents, strict=True):
        assert stored.goal_time_step == agent.goal_time_step
        assert stored.route_lanelet_ids == agent.route_lanelet_ids
        assert len(stored.goal_areas) == len(agent.goal_areas)
        for area, kept in zip(agent.goal_areas, stored.goal_areas, strict=True):
            np.testing.assert_array_equal(area.vertices, kept.vertices)


def test_unknown_agents_too_many_lines_and_empty_moments_are_refused(run):
    with pytest.raises(InputError, match="agent 9 is not in the run; its agents are 1, 2, 3, 4"):
        chosen_agents(run, [9])
    with pytest.raises(InputError, match="4 agents are too many for lines in one picture; name at most 3"):
        chosen_agents(run, None, 3)
    with pytest.raises(InputError, match="there is no agent to draw"):
        chosen_agents(replace(run, agents=()), None)
    with pytest.raises(InputError, match="none of these agents is there at 99 s"):
        draw_scene(run, None, 99.0)


def plot(*arguments):
    return CliRunner().invoke(main, ["plot", *map(str, arguments)])


def test_the_command_writes_the_figure_and_says_where(folder, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert plot(folder, "--kind", "scene@2", "--columns", "2").output == "figure in lane_merge_scene_2s.pdf\n"
    assert plot(folder, "--kind", "criticality", "--measures", "ttc", "--out", "c.svg").exit_code == 0
    assert sorted(path.name for path in Path().iterdir()) == ["c.svg", "lane_merge_scene_2s.pdf"]


def test_a_folder_without_plans_is_drawn_without_them(merge, tmp_path):
    bare = save(merge, tmp_path / "run")
    (bare / "plans.parquet").unlink()
    assert plot(bare, "--kind", "scene@2", "--out", tmp_path / "scene.png").exit_code == 0


def test_the_help_names_every_kind_of_figure():
    assert all(kind in plot("--help").output for kind in KINDS)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--kind", "speed"], "--kind speed: no such figure; the kinds are run, trajectories, velocity"),
        (["--kind", "scene"], "write the time in seconds, for instance scene@3.5"),
        (["--kind", "scene@soon"], "write the time in seconds"),
        (["--kind", "scene@nan"], "write the time in seconds"),
        (["--kind", "scene@99"], "none of these agents is there at 99 s"),
        (["--kind", "velocity", "--agents", "a"], "--agents a: write them as 12,34"),
        (["--kind", "velocity", "--agents", "7"], "agent 7 is not in the run"),
        (["--kind", "velocity", "--out", "v.jpg"], "figures end in .pdf, .png or .svg"),
        (["--kind", "criticality", "--measures", "tttc"], "there is no measure 'tttc'; did you mean ttc?"),
        (["--kind", "criticality", "--measures", ","], "--measures: name at least one"),
    ],
)
def test_what_cannot_be_drawn_is_one_line(folder, options, words):
    done = plot(folder, *options)
    assert done.exit_code == 2
    assert words in done.output
    assert len(done.output.strip().splitlines()) == 1
