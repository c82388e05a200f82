"""Pictures: what they show, that they are written whole, and quickly. That they look good was judged by eye."""

from __future__ import annotations

import os
import re
import stat
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from invented_run import invented_run
from matplotlib.colors import to_hex
from PIL import Image
from work import calls_in

from interdrive.errors import InputError, MissingExtraError, ResultsError
from interdrive.plots import animate_run, check_animation, draw_run, save_figure
from interdrive.plots.frames import Stage
from interdrive.plots.road import road_artists
from interdrive.plots.style import OUTCOME_MARKS, STATIC, TRAFFIC
from interdrive.plots.vehicles import outlines
from interdrive.plots.view import View, view_of
from interdrive.run import OUTCOMES
from interdrive.run.assemble import recorded_traffic
from interdrive.scenario import Shape
from interdrive.testing import Car, straight_road, world


@pytest.fixture(scope="module")
def run():
    return invented_run()


def without_agents(run):
    no_agents = run.outcomes.where(np.zeros(len(run.agents), dtype=bool))
    states = replace(run.states, is_agent=np.zeros(len(run.states.participant_id), dtype=bool))
    return replace(run, agents=(), outcomes=no_agents, states=states, candidates=None, predictions=None)


def turned(run, angle):
    """The same run with the whole world turned."""
    rotation = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    states = run.states
    x, y = np.moveaxis(np.stack([states.x, states.y], axis=-1) @ rotation, -1, 0)
    return replace(run, states=replace(states, x=x, y=y, orientation=states.orientation + angle))


def colors_of(image):
    return {color for _, color in image.getcolors(1 << 24)}


@pytest.mark.parametrize("ending", ["png", "pdf", "svg"])
def test_a_still_is_written_in_the_format_of_its_ending_and_the_same_each_time(run, tmp_path, ending):
    for name in ("a", "b"):
        save_figure(draw_run(run), tmp_path / f"{name}.{ending}")
    assert (tmp_path / f"a.{ending}").read_bytes() == (tmp_path / f"b.{ending}").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"a.{ending}", f"b.{ending}"]


def test_a_still_is_180_mm_wide_and_the_map_keeps_its_proportions(run):
    figure = draw_run(run)
    assert figure.get_figwidth() * 25.4 == pytest.approx(180.0)
    figure.canvas.draw()
    axes = figure.axes[0]
    (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
    box = axes.get_window_extent()
    assert box.width / (x1 - x0) == pytest.approx(box.height / (y1 - y0), rel=0.02)


def test_a_still_names_every_agent_and_every_outcome_that_occurred(run):
    figure = draw_run(run)
    texts = [text.get_text() for text in figure.axes[0].texts]
    assert {"1", "2", "3", "4"} <= set(texts)
    assert texts.count("2") == 2  # a crashed one at its end, too
    legend = [text.get_text() for text in figure.legends[0].get_texts()]
    for entry in (
        "goal reached (1)",
        "goal reached late (1)",
        "collision (1)",
        "planner error (1)",
        "recorded traffic",
    ):
        assert entry in legend


def test_every_outcome_has_its_own_marker_and_colour():
    assert set(OUTCOME_MARKS) == {*OUTCOMES, "running"}
    looks = [(mark.marker, mark.color) for mark in OUTCOME_MARKS.values()]
    assert len(set(looks)) == len(looks)


def test_a_still_without_agents_shows_the_recorded_traffic(run):
    figure = draw_run(without_agents(run))
    assert "recorded traffic" in [text.get_text() for text in figure.legends[0].get_texts()]


@pytest.mark.parametrize("standing", [(False, False), (False, True), (True, True)])
def test_a_legend_tells_what_moves_from_what_never_does(standing):
    recorded = recorded_traffic(world(straight_road(200.0, 1), cars=[Car(1, 20.0), Car(2, 60.0)], steps=10))
    figure = draw_run(replace(recorded, states=replace(recorded.states, is_static=np.array(standing))))
    found = [(one.get_label(), to_hex(one.get_facecolor())) for one in figure.legends[0].legend_handles]
    moving = [("recorded traffic", TRAFFIC)] * (not all(standing))
    assert found == moving + [("static obstacles", STATIC)] * any(standing)


def test_a_still_that_cannot_be_written_is_refused_in_one_line(run, tmp_path):
    with pytest.raises(ResultsError, match=r"pictures end in .png, .pdf or .svg"):
        save_figure(draw_run(run), tmp_path / "run.docx")
    (tmp_path / "file").write_text("")
    with pytest.raises(ResultsError, match="cannot be written"):
        save_figure(draw_run(run), tmp_path / "file" / "run.png")


def test_the_view_holds_all_agents_and_not_the_whole_map(run):
    view = view_of(run)
    for row in np.flatnonzero(run.states.is_agent):
        valid = run.states.valid[row]
        x, y = view.picture_from_world(np.stack([run.states.x[row], run.states.y[row]], axis=1)[valid]).T
        assert view.x_limits[0] < x.min()
        assert x.max() < view.x_limits[1]
        assert view.y_limits[0] < y.min()
        assert y.max() < view.y_limits[1]
    assert view.width < 120.0  # the road is 160 m long


@pytest.mark.parametrize("angle", np.radians([50.0, 90.0, 140.0, 230.0]))
def test_a_long_diagonal_or_upright_road_lies_flat_in_the_picture_and_traffic_drives_right(run, angle):
    straight = replace(run, states=replace(run.states, is_agent=run.states.participant_id == 2))
    view = view_of(turned(straight, angle))
    assert view.width > 2.0 * view.height
    forward = view.picture_from_world(np.array([np.cos(angle), np.sin(angle)]))
    assert forward[0] > 0.9


def test_a_compact_scene_is_not_turned(run):
    assert view_of(run).angle == 0.0


def test_a_view_grows_to_the_shape_of_the_paper_around_its_centre():
    view = View(0.0, (5.0, 6.0), 100.0, 10.0).shaped(0.2, 0.8)
    assert (view.width, view.height, view.center) == (100.0, 20.0, (5.0, 6.0))
    assert View(0.0, (0.0, 0.0), 10.0, 40.0).shaped(0.2, 0.8).width == 50.0


def test_lines_between_lanes_are_markings_and_the_outer_ones_edges(run):
    view = View(0.0, (40.0, 0.0), 200.0, 200.0)
    _, _, dashed, solid, edges = road_artists(run.scenario.lanelets, view)
    assert {round(float(y), 2) for line in dashed.get_segments() for x, y in line if x < 70} == {1.75}
    assert {round(float(y), 2) for line in solid.get_segments() for x, y in line if x < 70} == {5.25}
    at_40 = {round(float(y), 2) for line in edges.get_segments() for x, y in line if 38 < x < 42}
    assert at_40 == {-1.75, 8.75}


def test_there_is_no_edge_across_the_mouth_of_a_side_road(run):
    lanelets = run.scenario.lanelets
    longer = [np.concatenate([bound, [[bound[0, 0], 1.0]]]) for bound in (lanelets.left[3], lanelets.right[3])]
    joined = replace(lanelets, left=(*lanelets.left[:3], longer[0]), right=(*lanelets.right[:3], longer[1]))
    edges = road_artists(joined, View(0.0, (60.0, 0.0), 20.0, 20.0))[-1].get_segments()
    across = [line for line in edges if (np.abs(line[:, 1] + 1.75) < 0.01).all()]
    # Pieces are 2 m long: a mouth of 3.5 m stays free but for less than a piece.
    free = [line for line in across if (line[:, 0].min() < 59.5) and (line[:, 0].max() > 60.0)]
    assert not free


@pytest.mark.parametrize(
    ("shape", "extent"),
    [
        (Shape("rectangle", length=4.0, width=2.0), (4.0, 2.0)),
        (Shape("rectangle", length=4.0, width=2.0, orientation=np.pi / 2), (2.0, 4.0)),
        (Shape("circle", radius=0.5, center=(3.0, 0.0)), (1.0, 1.0)),
        (Shape("polygon", vertices=np.array([(0.0, 0.0), (3.0, 0.0), (0.0, 1.0)])), (3.0, 1.0)),
    ],
)
def test_outlines_of_shapes_have_their_size(shape, extent):
    assert np.ptp(outlines(shape)[0], axis=0) == pytest.approx(extent)
    assert len(outlines(Shape("group", members=(shape, shape)))) == 2


def test_a_film_has_a_frame_per_time_step_in_real_time_and_holds_the_end(run, tmp_path):
    frames = []
    animate_run(run, tmp_path / "run.gif", on_frame=lambda done, total: frames.append((done, total)))
    assert frames == [(k, 60) for k in range(1, 61)]
    durations = []
    with Image.open(tmp_path / "run.gif") as film:
        for index in range(film.n_frames):
            film.seek(index)
            durations.append(film.info["duration"])
    assert sum(durations) == 59 * 100 + 2000
    assert [path.name for path in tmp_path.iterdir()] == ["run.gif"]


def test_fewer_frames_per_second_take_the_same_time(run, tmp_path):
    animate_run(run, tmp_path / "run.gif", fps=4)
    with Image.open(tmp_path / "run.gif") as film:
        assert film.n_frames <= 25
        film.seek(1)
        assert film.info["duration"] == 250


def test_a_frame_shows_agents_in_colour_and_recorded_vehicles_in_grey(run):
    stage = Stage(run)
    colors = colors_of(stage.frame(30))
    assert (0x00, 0x72, 0xB2) in colors  # agent 1
    assert (0x6F, 0x6F, 0x6F) in colors  # the parked car
    assert (0xCC, 0x79, 0xA7) in colors  # agent 4, a bus


@pytest.mark.parametrize(("turn", "sides"), [(1.0, {1.0}), (-1.0, {-1.0}), (0.0, set()), (np.nan, set())])
def test_a_frame_shows_two_blinkers_on_the_side_that_an_agent_shows(run, turn, sides):
    own = (run.plans.agent_id == 1) & (run.plans.time_step == 30)
    stage = Stage(replace(run, plans=replace(run.plans, turn=np.where(own, turn, np.nan))))
    stage.frame(30)
    row = int(np.flatnonzero(run.states.participant_id == 1)[0])
    x, y, orientation = stage.footprints.pose(row, 30)
    ahead = np.array([np.cos(orientation), np.sin(orientation)])
    center, front = (stage.view.picture_from_world(np.array([x, y]) + way * ahead) for way in (0.0, 1.0))
    marks = [path.vertices.mean(axis=0) - center for path in stage.layers.blinkers.get_paths()]
    along = front - center
    assert {float(np.sign(along[0] * mark[1] - along[1] * mark[0])) for mark in marks} == sides
    assert len(marks) == 2 * len(sides)
    stage.frame(31)
    assert not stage.layers.blinkers.get_paths(), "a step later it shows nothing"


def test_a_crashed_agent_stays_marked_from_the_moment_of_the_collision(run):
    stage = Stage(run)
    wreck = lambda column: (stage.frame(column), len(stage.layers.wrecks.get_paths()))[1]  # noqa: E731
    assert [wreck(46), wreck(47), wreck(59)] == [0, 1, 1]


def test_a_film_of_a_run_without_agents_shows_recorded_traffic_that_moves(run, tmp_path):
    animate_run(without_agents(run), tmp_path / "run.gif", fps=1)
    with Image.open(tmp_path / "run.gif") as film:
        frames = []
        for index in range(film.n_frames):
            film.seek(index)
            frames.append(np.asarray(film.convert("RGB"), dtype=int))
    assert len(frames) == 7  # 5.9 s, both ends included
    recorded = [(np.abs(frame - (0x6F, 0x6F, 0x6F)).max(axis=-1) <= 8) for frame in frames]
    assert min(mask.sum() for mask in recorded) > 100
    assert (recorded[0] != recorded[5]).sum() > 100
    agents = [(0x00, 0x72, 0xB2), (0xCC, 0x79, 0xA7)]
    assert not any((frame == color).all(axis=-1).any() for frame in frames for color in agents)


@pytest.mark.parametrize(
    ("name", "arguments", "error", "message"),
    [
        ("run.avi", {}, ResultsError, r"films end in .gif or .mp4"),
        ("run.gif", {"fps": 0}, InputError, "fps must be positive"),
    ],
)
def test_a_film_that_cannot_be_made_is_refused_in_one_line(run, tmp_path, name, arguments, error, message):
    with pytest.raises(error, match=message):
        animate_run(run, tmp_path / name, **arguments)
    assert not list(tmp_path.iterdir())


@pytest.mark.long
def test_mp4_holds_every_frame_in_real_time_and_the_end_for_two_seconds(run, tmp_path, ffmpeg):
    animate_run(run, tmp_path / "run.mp4", fps=2)
    stage = Stage(run)
    width, height = stage.size
    words = [ffmpeg, "-hide_banner", "-i", tmp_path / "run.mp4", "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    read = subprocess.run(words, capture_output=True, check=True)
    about = read.stderr.decode()
    assert "Duration: 00:00:08.50" in about  # 13 frames, and 4 held at the end
    assert re.search(rf"Video: h264 .*yuv420p.*, {width}x{height}\b.*, 2 fps", about)
    frames = np.frombuffer(read.stdout, dtype=np.uint8).reshape(17, height, width, 3).astype(float)
    drawn = [np.asarray(stage.frame(column), dtype=float) for column in (*range(0, 60, 5), 59)]
    for index, frame in enumerate(frames):
        apart = [np.abs(frame - one).mean() for one in drawn]
        assert apart[min(index, 12)] < 2.0, "colours are less exact in a film"
        assert int(np.argmin(apart)) == min(index, 12)


def fake_ffmpeg(folder, script, monkeypatch):
    program = folder / "bin" / "ffmpeg"
    program.parent.mkdir()
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{program.parent}{os.pathsep}{os.environ['PATH']}")


def test_mp4_says_in_one_line_what_ffmpeg_or_its_absence_says(run, tmp_path, monkeypatch):
    fake_ffmpeg(tmp_path, "echo Unknown encoder >&2; exit 1", monkeypatch)
    with pytest.raises(ResultsError, match="ffmpeg failed: Unknown encoder"):
        animate_run(run, tmp_path / "run.mp4", fps=2)
    monkeypatch.setenv("PATH", "")
    with pytest.raises(MissingExtraError, match="MP4 needs ffmpeg"):
        check_animation(tmp_path / "run.mp4")
    assert [path.name for path in tmp_path.iterdir()] == ["bin"]


def test_an_interrupted_film_leaves_nothing_behind(run, tmp_path):
    def stop(done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        animate_run(run, tmp_path / "run.gif", on_frame=stop)
    assert not list(tmp_path.iterdir())


def test_a_film_of_60_frames_is_less_work_than_10_pictures(run, tmp_path):
    picture = calls_in(lambda: save_figure(draw_run(run), tmp_path / "run.png"))
    film = calls_in(lambda: animate_run(run, tmp_path / "run.gif"))
    assert Image.open(tmp_path / "run.gif").n_frames == 60
    assert film < 10 * picture
