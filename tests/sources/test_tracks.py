"""Tables of tracks become obstacles at time steps: resampled, gaps closed or split, missing values derived."""

import foreign_files as ff
import numpy as np
import pytest

import interdrive as idr


@pytest.fixture
def recorded(tmp_path):
    """Reads rows of neutral tracks on the small map."""

    def read(rows, *columns, **options):
        path = tmp_path / "tracks.csv"
        path.write_text(ff.tracks(rows, *columns))
        return idr.read_source(path, map=ff.neutral_map(tmp_path), **options)

    return read


def of(scenario, number):
    """Table of one obstacle: time steps, and columns x, y, heading, speed at them."""
    row = scenario.obstacles.ids.tolist().index(number)
    steps = np.flatnonzero(scenario.obstacles.valid[row])
    names = ("x", "y", "orientation", "velocity")
    return steps, np.column_stack([getattr(scenario.obstacles, name)[row, steps] for name in names])


def test_rows_at_the_time_steps_are_kept_as_they_are_in_any_order(recorded):
    rows = ff.car()
    scenario = recorded(rows[::-1])
    steps, table = of(scenario, 7)
    assert steps.tolist() == list(range(41))
    np.testing.assert_array_equal(table[:, 0], [row[2] for row in rows])
    assert scenario.obstacles.shapes[0].length == 4.5
    assert scenario.notes == ()
    assert scenario.source.keys == ("east", "on", "west")


def test_other_rates_are_interpolated_and_never_extrapolated(recorded):
    steps, table = of(recorded(ff.car(dt=0.04, n=102)), 7)
    assert steps.tolist() == list(range(41)), "the last row is at 4.04 s"
    np.testing.assert_allclose(table[:, 0], 5.0 + np.arange(41), atol=1e-9)
    steps, _ = of(recorded(ff.car(dt=0.04, n=102), dt=0.04), 7)
    assert len(steps) == 102


def test_a_part_is_chosen_by_its_time_in_the_source(recorded):
    steps, table = of(recorded(ff.car(), start=1.0, duration=2.0), 7)
    assert steps.tolist() == list(range(21))
    assert table[0, 0] == pytest.approx(15.0)


def test_headings_turn_the_short_way_between_rows(recorded):
    rows = [("1", 0.0, 10.0, 1.75, 3.1, 0.0, 4, 2, "car"), ("1", 0.2, 10.0, 1.75, -3.1, 0.0, 4, 2, "car")]
    _, table = of(recorded(rows), 10001)
    assert abs(table[1, 2]) == pytest.approx(np.pi)


def test_gaps_of_half_a_second_are_closed_and_longer_ones_split_the_track(recorded):
    closed = [row for k, row in enumerate(ff.car()) if not 15 <= k < 19]
    scenario = recorded(closed)
    steps, table = of(scenario, 7)
    assert steps.tolist() == list(range(41))
    np.testing.assert_allclose(table[:, 0], 5.0 + np.arange(41), atol=1e-9)
    assert scenario.notes == ("gaps up to 0.5 s closed: 1",)
    split = recorded([row for k, row in enumerate(ff.car()) if not 11 <= k < 25])
    assert of(split, 7)[0].tolist() == list(range(11))
    assert of(split, 8)[0].tolist() == list(range(25, 41))
    assert split.notes == ("tracks split at gaps longer than 0.5 s, the rest has a new id: 1",)


def test_a_recording_with_a_row_a_second_is_not_torn_apart(recorded):
    scenario = recorded(ff.car(dt=1.0, n=5))
    assert of(scenario, 7)[0].tolist() == list(range(41))


def test_a_track_of_one_step_is_left_out(recorded):
    scenario = recorded([*ff.car(), ("9", 1.0, 30.0, 1.75, 0.0, 0.0, 4.0, 2.0, "car")])
    assert scenario.obstacles.ids.tolist() == [7]
    assert scenario.notes == ("left out: 1 with fewer than two time steps tracks",)


def test_missing_headings_follow_the_motion_and_are_held_by_what_stands(recorded):
    moves = [("7", round(0.1 * k, 6), 10.0, 1.75 + 0.2 * min(k, 20)) for k in range(41)]
    steps, table = of(recorded(moves, "track_id,time_s,x,y"), 7)
    np.testing.assert_allclose(table[:, 2], np.pi / 2)
    assert table[5, 3] == pytest.approx(2.0)
    assert table[-1, 3] == 0.0
    assert len(steps) == 41


def test_noise_of_a_standing_vehicle_tells_no_heading(recorded):
    noise = [0.03 if k % 2 else -0.03 for k in range(41)]
    rows = [("7", round(0.1 * k, 6), 10.0 + 0.3 * min(k, 10), 1.75 + (noise[k] if k > 10 else 0)) for k in range(41)]
    _, table = of(recorded(rows, "track_id,time_s,x,y"), 7)
    assert np.abs(table[:, 2]).max() < 0.25


def test_kinds_are_read_without_case_and_unknown_ones_are_counted(recorded):
    rows = [*ff.car("1", kind="Van"), *ff.car("2", y=5.25, kind="Hovercraft"), *ff.car("3", y=8.0, kind="PEDESTRIAN")]
    scenario = recorded([(*row[:6], "", "", row[8]) for row in rows])
    obstacles = scenario.obstacles
    assert obstacles.kinds == ("car", "unknown", "pedestrian")
    assert [(shape.kind, shape.length, shape.radius) for shape in obstacles.shapes] == [
        ("rectangle", 4.6, 0.0), ("rectangle", 4.6, 0.0), ("circle", 0.0, 0.3),
    ]  # fmt: skip
    assert scenario.notes[0] == "kinds of tracks that are not known, taken as unknown: 1 hovercraft"


def test_ids_are_the_sources_own_unless_a_lanelet_has_them_or_one_is_zero(recorded):
    assert recorded([*ff.car("7"), *ff.car("4", y=5.25)]).obstacles.ids.tolist() == [4, 7]
    assert recorded([*ff.car("7"), *ff.car("2", y=5.25)]).obstacles.ids.tolist() == [10001, 10002]
    assert recorded([*ff.car("a"), *ff.car("b", y=5.25)]).obstacles.ids.tolist() == [10001, 10002]
    assert recorded([*ff.car("0"), *ff.car("9", y=5.25)]).obstacles.ids.tolist() == [10001, 10002], "files have no id 0"


def test_tracks_are_shifted_and_those_far_from_the_map_are_noted_or_refused(recorded):
    assert of(recorded(ff.car(), shift="1,-0.5"), 7)[1][0, :2].tolist() == [6.0, 1.25]
    far = recorded([*ff.car(), *ff.car("9", y=900.0)])
    assert far.notes[0].startswith("1 of 2 tracks are more than 100 m from ")
    assert far.notes[0].endswith("lanes.csv (nearest 893 m); --shift moves tracks, --origin maps")
    with pytest.raises(
        idr.InputError, match=r"1 of 1 tracks are .* \(nearest 1,000 km\): check --projection, --origin"
    ):
        recorded(ff.car(), shift="1000000,0")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("frame,id,x,y\n1,1,2,3\n", r"has no column track_id \(found: frame, id, x, y\)"),
        ("track_id,x,y\n1,2,3\n", r"has no column time_s \(found: track_id, x, y\)"),
        (ff.tracks([*ff.car(), ff.car()[12]]), "track 7 has time 1.2 twice"),
        ("track_id,time_s,x,y\n1,0,a,3\n", "the column x has a value that is no number; correct it"),
        ("track_id,time_s,x,y\n1,0,1\n", "is no whole CSV table"),
        ("track_id,time_s,x,y\n1,0,1,1\n1,1e300,1,1\n", "ends 1e.300 s after the first one, more than 100000 steps"),
        ("PAR1 and nothing more", "is no whole Parquet table"),
        ("track_id,track_id,time_s,x,y\n1,1,0,1,1\n", "has more than one column track_id"),
    ],
)
def test_tables_that_cannot_be_read_are_refused_in_one_line(tmp_path, text, words):
    path = tmp_path / "tracks.csv"
    path.write_text(text)
    with pytest.raises(idr.InputError, match=f"^{path}: .*{words}") as refused:
        idr.read_source(path, map=ff.neutral_map(tmp_path))
    assert "\n" not in str(refused.value)


def test_tracks_without_a_map_say_which_maps_there_are(tmp_path):
    path = tmp_path / "tracks.csv"
    path.write_text(ff.tracks(ff.car()))
    with pytest.raises(idr.InputError, match=r"tracks need --map \(a CommonRoad, OpenDRIVE, Lanelet2 or SUMO map, or"):
        idr.read_scenario(path)


def test_rows_without_a_position_are_absent(recorded):
    rows = [(*row[:2], "nan" if row[0] == "7" and k == 5 else row[2], *row[3:]) for k, row in enumerate(ff.car())]
    scenario = recorded(rows)
    assert len(of(scenario, 7)[0]) == 41
    assert scenario.notes[0] == "left out: 1 without time or position rows"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("east,left", "east,middle"), "the side 'middle' is neither left nor right"),
        (("east,left,0,0.0,3.5\n", ""), "lane east has 1 left and 2 right points"),
        (("0.0,3.5", "inf,3.5"), "a point, x or y is not a finite number"),
    ],
)
def test_lanes_that_cannot_be_read_are_refused(tmp_path, change, words):
    path = ff.neutral_map(tmp_path)
    path.write_text(path.read_text().replace(*change, 1))
    with pytest.raises(idr.InputError, match=words):
        idr.read_source(path)


@pytest.mark.parametrize(
    ("change", "words"), [((",on", ",off"), "has the lane off"), (("successor", "after"), "'after'")]
)
def test_links_that_cannot_be_read_are_refused(tmp_path, change, words):
    path = ff.neutral_map(tmp_path)
    path.with_name("links.csv").write_text(ff.LINKS.replace(*change, 1))
    with pytest.raises(idr.InputError, match=words):
        idr.read_source(path)


def test_a_commonroad_file_can_be_the_map_of_tracks(tmp_path):
    path = tmp_path / "tracks.csv"
    whole = idr.read_scenario(idr.shipped_scenario("t_junction"))
    x, y = (table[whole.obstacles.valid][0] for table in (whole.obstacles.x, whole.obstacles.y))
    path.write_text(ff.tracks([("5", t, x + t, y, 0, 1, 4, 2, "car") for t in (0.0, 0.5, 1.0)]))
    scenario = idr.read_source(path, map=whole.path)
    assert scenario.lanelets.ids.tolist() == whole.lanelets.ids.tolist()
    assert scenario.benchmark_id[:3] == whole.benchmark_id[:3]
    assert [name for name, _ in scenario.source.files] == ["tracks.csv", whole.path.name]
    idr.write_scenario(scenario, tmp_path / "written.xml")
    assert idr.read_scenario(tmp_path / "written.xml").obstacles.valid.sum() == 11


def test_the_toy_recording_is_read_as_expected(inputs_folder):
    folder = inputs_folder / "neutral_toy"
    scenario = idr.read_source(folder / "tracks.parquet", map=folder / "lanes.parquet")
    obstacles = scenario.obstacles
    assert (len(obstacles.ids), len(scenario.lanelets.ids), sum(map(len, scenario.lanelets.successors))) == (5, 3, 1)
    a, b, c, d, rest = (of(scenario, 10001 + row) for row in range(5))
    np.testing.assert_allclose(a[1][[0, 40], :2], [[10.0, 1.75], [50.0, 1.75]], atol=1e-9)
    np.testing.assert_allclose(b[1][16], [47.2, 5.25, np.pi, 8.0], atol=1e-6)
    np.testing.assert_allclose(c[1][10, :2], [30.0, -0.6], atol=1e-9)
    assert len(c[0]) == 41
    assert obstacles.shapes[2].radius == 0.3
    assert d[1][0, 0] == 100.0
    assert rest[0][0] == 25
