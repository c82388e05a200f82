"""The scenarios that come with the package: sound roads, plausible traffic, no contacts."""

import os
import subprocess
import sys
import zlib
from collections import Counter
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from interdrive.errors import InputError
from interdrive.files import read_scenario, scenario_file, scenario_folders, shipped_scenario, shipped_scenarios
from interdrive.scenario.inspection import candidates, lanelets_at

ROOT = Path(__file__).resolve().parents[2]
NAMES = ("highway", "intersection", "lane_merge", "signals", "t_junction", "town")
#: Those in which vehicles were recorded; the town has a thousand planning problems instead.
RECORDED = NAMES[:-1]
#: Vehicles and duration [s] that each has at least.
LEAST = {
    "highway": (30, 10.0),
    "intersection": (24, 12.0),
    "lane_merge": (5, 12.0),
    "signals": (25, 18.0),
    "t_junction": (6, 12.0),
}


@pytest.fixture(scope="module", params=NAMES)
def any_scenario(request):
    return read_scenario(shipped_scenario(request.param))


@pytest.fixture(scope="module", params=RECORDED)
def scenario(request):
    return read_scenario(shipped_scenario(request.param))


@pytest.fixture(scope="module")
def town():
    return read_scenario(shipped_scenario("town"))


def test_nothing_about_them_is_worth_a_note(any_scenario):
    assert any_scenario.notes == ()


def test_their_names_are_listed():
    assert shipped_scenarios() == NAMES


def test_a_name_means_a_file_then_a_shipped_scenario_then_one_of_the_folder_of_scenarios(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("INTERDRIVE_SCENARIOS", str(tmp_path / "mine"))
    for name in ("merge/zip.xml", "urban/zip.xml", "merge/town.xml", "merge/gap.xml"):
        (tmp_path / "mine" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "mine" / name).write_text("")
    (tmp_path / "highway").write_text("")
    (tmp_path / "signals").mkdir()
    mine = tmp_path / "mine" / "merge"
    assert scenario_file("highway") == Path("highway")
    assert scenario_file("signals") == shipped_scenario("signals"), "a folder does not hide it"
    assert scenario_file("town") == shipped_scenario("town")
    assert [scenario_file(name) for name in ("merge/gap.xml", "gap.xml", "gap")] == [mine / "gap.xml"] * 3
    with pytest.raises(InputError, match=r"^zip: several files below .* have this name: merge/zip.xml, urban/zip.xml$"):
        scenario_file("zip")
    with pytest.raises(InputError, match=r"^hihgway: no such file, did you mean the shipped scenario highway"):
        scenario_file("hihgway")


def test_several_folders_of_scenarios_are_searched_in_their_order(tmp_path, monkeypatch):
    mine, yours = tmp_path / "mine", tmp_path / "yours"
    monkeypatch.setenv("INTERDRIVE_SCENARIOS", os.pathsep.join(["", str(mine), str(yours)]))
    for path in (mine / "merge" / "zip.xml", yours / "merge" / "zip.xml", yours / "gap.xml"):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("")
    assert scenario_folders() == (mine, yours)
    assert scenario_file("gap") == yours / "gap.xml"
    assert scenario_file("merge/zip.xml") == mine / "merge" / "zip.xml", "a path from a folder on means the first"
    with pytest.raises(InputError, match=rf"^zip: several files below {mine} and {yours} have this name: {mine}/merge"):
        scenario_file("zip")
    monkeypatch.setenv("INTERDRIVE_SCENARIOS", "")
    assert scenario_folders() == ()


def test_another_name_is_refused_with_the_list():
    with pytest.raises(InputError, match="no shipped scenario 'roundabout'; there are highway, intersection"):
        shipped_scenario("roundabout")


@pytest.mark.long
def test_the_files_are_what_the_script_makes():
    found = subprocess.run(
        [sys.executable, "scenarios/make.py", "--check"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert (found.returncode, found.stdout) == (0, "")


def test_they_are_small_and_valid_by_the_schema_of_commonroad_io(any_scenario):
    from commonroad.common.file_writer import CommonRoadFileWriter

    data = any_scenario.path.read_bytes()
    assert len(data) < 1_200_000
    assert len(zlib.compress(data)) < 200_000
    assert CommonRoadFileWriter.check_validity_of_commonroad_file(data)


def test_they_have_enough_traffic_all_of_which_can_become_agents(scenario):
    vehicles, duration = LEAST[scenario.name]
    assert len(scenario.obstacles.ids) >= vehicles
    assert (scenario.obstacles.n_steps - 1) * scenario.dt >= duration
    assert candidates(scenario).accepted.all()


def test_lanelets_begin_exactly_where_their_predecessors_end(any_scenario):
    lanelets = any_scenario.lanelets
    row = {number: index for index, number in enumerate(lanelets.ids.tolist())}
    relations = [(row[number], row[after]) for number in row for after in lanelets.successors[row[number]]]
    assert relations
    for first, second in relations:
        assert lanelets.ids[first] in lanelets.predecessors[second]
        np.testing.assert_array_equal(lanelets.left[first][-1], lanelets.left[second][0])
        np.testing.assert_array_equal(lanelets.right[first][-1], lanelets.right[second][0])


def test_neighbours_share_their_bound_exactly_and_know_each_other(any_scenario):
    lanelets = any_scenario.lanelets
    row = {number: index for index, number in enumerate(lanelets.ids.tolist())}
    n_shared = 0
    for here, number in enumerate(lanelets.ids.tolist()):
        if lanelets.adjacent_left[here] < 0:
            continue
        there = row[lanelets.adjacent_left[here]]
        n_shared += 1
        if lanelets.adjacent_left_same_direction[here]:
            assert lanelets.adjacent_right[there] == number
            np.testing.assert_array_equal(lanelets.left[here], lanelets.right[there])
        else:
            assert lanelets.adjacent_left[there] == number
            np.testing.assert_array_equal(lanelets.left[here], lanelets.left[there][::-1])
    assert n_shared > 0


def test_recorded_speeds_and_headings_are_those_of_the_motion(scenario):
    """Between two states: distance over time against the mean speed (1 %, and what rounding to 0.1 mm makes of it)."""
    obstacles = scenario.obstacles
    dx, dy = np.diff(obstacles.x, axis=1), np.diff(obstacles.y, axis=1)
    both = obstacles.valid[:, 1:]
    moved = np.hypot(dx, dy)[both] / scenario.dt
    speed = 0.5 * (obstacles.velocity[:, 1:] + obstacles.velocity[:, :-1])[both]
    np.testing.assert_allclose(moved, speed, rtol=0.01, atol=0.003)
    headings = np.unwrap(np.where(obstacles.valid, obstacles.orientation, 0.0), axis=1)
    middle = 0.5 * (headings[:, 1:] + headings[:, :-1])[both]
    aside = np.abs(-dx[both] * np.sin(middle) + dy[both] * np.cos(middle))
    assert aside.max() < 0.005


def test_recorded_vehicles_drive_as_vehicles_can(scenario):
    obstacles = scenario.obstacles
    speed, yaw_rate = obstacles.velocity[obstacles.valid], obstacles.yaw_rate[obstacles.valid]
    assert speed.min() >= 0.0
    assert np.abs(obstacles.acceleration[obstacles.valid]).max() < 3.0
    assert np.abs(speed * yaw_rate).max() < 3.5
    assert np.abs(yaw_rate[speed > 1.0] / speed[speed > 1.0]).max() < 1.0 / 6.0


def corners(obstacles, row, margin=0.0):
    """Of a vehicle's footprint at its valid steps, shape (steps, 4, 2)."""
    shape, valid = obstacles.shapes[row], obstacles.valid[row]
    cos, sin = np.cos(obstacles.orientation[row, valid]), np.sin(obstacles.orientation[row, valid])
    forward = np.column_stack((cos, sin)) * (0.5 * shape.length + margin)
    left = np.column_stack((-sin, cos)) * (0.5 * shape.width + margin)
    middle = np.column_stack((obstacles.x[row, valid], obstacles.y[row, valid]))
    return np.stack([middle + a * forward + b * left for a, b in ((1, 1), (1, -1), (-1, -1), (-1, 1))], axis=1)


def overlap(first, second, headings):
    """At which steps two rectangles overlap (no separating axis), corners of shape (steps, 4, 2)."""
    apart = np.zeros(len(first), dtype=bool)
    for angle in (*headings, *(heading + 0.5 * np.pi for heading in headings)):
        axis = np.column_stack((np.cos(angle), np.sin(angle)))[:, None, :]
        one, other = (first * axis).sum(axis=-1), (second * axis).sum(axis=-1)
        apart |= (one.max(axis=1) < other.min(axis=1)) | (other.max(axis=1) < one.min(axis=1))
    return ~apart


def test_recorded_vehicles_never_come_closer_than_twenty_centimetres(scenario):
    obstacles = scenario.obstacles
    outlines = [corners(obstacles, row, margin=0.1) for row in range(len(obstacles.ids))]
    for one, other in combinations(range(len(obstacles.ids)), 2):
        n = min(len(outlines[one]), len(outlines[other]))
        headings = [obstacles.orientation[row, :n] for row in (one, other)]
        touching = overlap(outlines[one][:n], outlines[other][:n], headings)
        assert not touching.any(), (obstacles.ids[one], obstacles.ids[other], np.flatnonzero(touching))


def test_recorded_vehicles_stay_on_the_road(scenario):
    obstacles = scenario.obstacles
    for row, number in enumerate(obstacles.ids.tolist()):
        points = corners(obstacles, row).reshape(-1, 2)
        assert lanelets_at(scenario.lanelets, *points.T).any(axis=1).all(), number


def test_the_planning_problem_starts_on_a_lane_away_from_others_and_its_goal_opens_in_time(scenario):
    (problem,) = scenario.planning_problems
    start, obstacles = problem.initial_state, scenario.obstacles
    assert lanelets_at(scenario.lanelets, np.array([start.x]), np.array([start.y])).any()
    assert np.hypot(obstacles.x[:, 0] - start.x, obstacles.y[:, 0] - start.y).min() > 7.0
    (goal,) = problem.goal
    assert goal.areas
    assert 0 < goal.time_step[0] < min(goal.time_step[1], obstacles.n_steps - 1)


def test_the_town_has_a_thousand_planning_problems_and_room_between_them(town):
    starts = np.array([(p.initial_state.x, p.initial_state.y) for p in town.planning_problems])
    assert len(starts) == 1000
    apart = np.hypot(*(starts[:, None] - starts[None]).T) + 1e9 * np.eye(1000)
    # Beside each other in neighbouring lanes; on one lane the next one is farther away than a time gap of one second.
    assert apart.min() > 3.4
    heading = np.array([p.initial_state.orientation for p in town.planning_problems])
    delta = starts[None] - starts[:, None]
    along = delta[..., 0] * np.cos(heading)[:, None] + delta[..., 1] * np.sin(heading)[:, None]
    aside = -delta[..., 0] * np.sin(heading)[:, None] + delta[..., 1] * np.cos(heading)[:, None]
    same_lane = (np.abs(aside) < 1.0) & ~np.eye(1000, dtype=bool)
    assert np.abs(along[same_lane]).min() > 12.0


def test_the_first_vehicles_of_the_town_live_in_a_proportional_part_of_it(town):
    """Cells are squares of 240 m around the crossings, whose coordinates are multiples of that."""
    cells = [
        (round(p.initial_state.x / 240.0), round(p.initial_state.y / 240.0))
        for p in sorted(town.planning_problems, key=lambda p: p.id)
    ]
    for n, n_cells in ((25, 1), (100, 4), (300, 12), (1000, 40)):
        assert set(Counter(cells[:n]).values()) == {25}
        assert len(set(cells[:n])) == n_cells


def test_the_agents_of_the_town_reach_their_goals_without_touching_each_other(town):
    from interdrive.simulation import simulate

    agents = sorted(p.id for p in town.planning_problems)[:50]
    run = simulate(town, agents=agents, predictor="lane_following")
    assert set(run.outcomes.outcome) == {"goal_reached"}
    # All of them drive for most of the time, so density stays as it is.
    assert np.count_nonzero(run.states.valid[:, 180]) >= 45


def test_no_vehicle_breaks_a_rule_of_the_road_in_the_recordings_of_the_t_junction():
    from interdrive.simulation import simulate

    run = simulate("t_junction", agents="all", planner={"default": "recorded", 2001: "frenet"})
    assert run.violations.rule == ()
