"""Measures pair no vehicle with what drives above or below: three storeys, ramps, slopes, heights that are missing."""

from dataclasses import replace

import numpy as np
import pytest
from recorded_drives import recorded
from storeys import EAST, NORTH, crossed, drive, line, ramp, road

from interdrive.criticality import CriticalitySettings, evaluate
from interdrive.recordings import overlapping
from interdrive.recordings.repair import with_overlaps
from interdrive.scenario.native import storeys as storeys_of
from interdrive.scoring import score
from interdrive.simulation import simulate
from interdrive.testing import problem

CROSSING = CriticalitySettings(conflict_areas="crossing")
PAIRED = ("hw", "thw", "ttc", "dce", "et", "pet", "btn", "stn", "psd")


def met(found):
    """Names of the measures that pair vehicles."""
    return {name for name in PAIRED if (found.series[name].partner_id >= 0).any()}


@pytest.mark.parametrize(("height", "apart"), [(7.0, True), (-7.0, True), (3.01, True), (3.0, False), (0.0, False)])
def test_vehicles_that_cross_more_than_3_m_apart_in_height_are_not_paired(height, apart):
    found = evaluate(crossed(height, below=0.0), settings=CROSSING)
    assert (met(found) == set()) == apart
    assert (found.most_critical_moment() is None) == apart


def test_of_three_storeys_only_those_on_one_meet():
    ways = [line(EAST), line(NORTH), line((EAST + NORTH) / np.sqrt(2.0))]
    lanes = road((ways[0], 0.0), (ways[1], 7.0), (ways[2], 14.0))
    drives = {number: drive(way, 60.0) for number, way in enumerate(ways, 1)}
    assert met(evaluate(recorded(lanes, drives), settings=CROSSING)) == set()
    drives[4] = drive(ways[1], 40.0)
    found = evaluate(recorded(lanes, drives))
    assert set(found.series["dce"].partner_id.ravel()) == {-1, 2, 4}
    assert found["hw"][3, 0] == pytest.approx(20.0 - 4.5)


def test_where_one_way_has_no_heights_vehicles_meet():
    ways = line(EAST), line(NORTH)
    far = line(EAST) + 500.0 * NORTH
    lanes = road((ways[0], 0.0), (ways[1], None), (far, 10.0))
    found = evaluate(recorded(lanes, {7: drive(ways[0], 60.0), 8: drive(ways[1], 60.0)}))
    assert np.nanmin(found["dce"]) == 0.0
    assert found.overlapping == ()


def test_decks_one_above_the_other_in_opposite_directions_do_not_meet():
    lanes = road((line(EAST), 0.0), (line(-EAST), 7.0))
    found = evaluate(recorded(lanes, {7: drive(line(EAST), 60.0), 8: drive(line(-EAST), 60.0)}), settings=CROSSING)
    assert met(found) == set()


@pytest.mark.parametrize("upper_first", [False, True])
def test_on_decks_in_one_direction_the_track_tells_who_is_on_which(upper_first):
    deck = line(EAST)
    ways = {7.0: np.linspace([-180.0, 60.0], deck[0], 50), 0.0: np.linspace([-180.0, -60.0], deck[0], 50)}
    heights = (7.0, 0.0) if upper_first else (0.0, 7.0)
    parts = [(deck, z) for z in heights] + [(ways[z], z) for z in heights]
    lanes = road(*parts, after={3: (1,), 4: (2,)})
    upper, lower = (np.vstack([ways[z], deck[1:]]) for z in (7.0, 0.0))
    found = evaluate(recorded(lanes, {7: drive(lower, 70.0), 8: drive(upper, 72.0), 9: drive(upper, 40.0)}))
    assert set(found.series["dce"].partner_id[0]) == {-1}
    assert set(found.series["hw"].partner_id[2]) == {8}


def test_who_comes_down_a_ramp_meets_the_ground_there_and_not_below_the_bridge():
    lanes, ground, down = ramp()
    over = {7: drive(ground, 60.0, steps=60), 8: drive(down, 60.0, steps=60)}
    assert met(evaluate(recorded(lanes, over))) == set()
    # Both at the end of the ramp, 240 m along the ground, at the same time.
    length = np.hypot(*np.diff(down, axis=0).T).sum() - 160.0
    later = {7: drive(ground, 200.0, steps=60), 8: drive(down, length - 40.0, steps=60)}
    found = evaluate(recorded(lanes, later))
    assert np.nanmin(found["dce"]) == 0.0
    assert found.most_critical("dce").time_step == pytest.approx(33, abs=8)  # they touch before the ways are one


def test_a_leader_further_up_a_slope_is_not_above():
    way = line(EAST, 0.0, 300.0)
    lanes = road((way, 0.1 * way[:, 0]))
    found = evaluate(recorded(lanes, {7: drive(way, 20.0, 12.0, 20), 8: drive(way, 80.0, 10.0, 20)}))
    assert found["hw"][0, 0] == pytest.approx(60.0 - 4.5)
    assert found["dce"][0, 0] == pytest.approx(60.0 - 4.5 - 2.0 * 2.0)


def test_a_leader_on_the_next_lanelet_of_a_slope_is_not_above():
    first, second = line(EAST, 0.0, 60.0), line(EAST, 60.0, 300.0)
    lanes = road((first, 0.1 * first[:, 0]), (second, 0.1 * second[:, 0]), after={1: (2,)})
    way = np.vstack([first, second[1:]])
    found = evaluate(recorded(lanes, {7: drive(way, 20.0, 12.0, 20), 8: drive(way, 80.0, 10.0, 20)}))
    assert np.isfinite(found["dce"]).all()


def test_recordings_one_above_the_other_do_not_overlap():
    assert with_overlaps(crossed(7.0)).overlaps == ()
    assert with_overlaps(crossed(2.0)).overlaps == ((7, 8),)
    above = crossed(7.0)
    assert overlapping(above.obstacles, above.dt) == ((7, 8),)
    assert overlapping(above.obstacles, above.dt, storeys_of(above)) == ()
    start = {7: drive(line(EAST), 100.0, steps=5), 8: drive(line(NORTH), 100.0, steps=5)}
    for height, pairs in ((7.0, ()), (2.0, ((7, 8),))):
        lanes = road((line(EAST), 0.0), (line(NORTH), height))
        assert evaluate(recorded(lanes, start)).overlapping == pairs


def scored(height):
    """An agent on the ground whose way a recorded vehicle crosses straight ahead of it."""
    ways = line(EAST), line(NORTH)
    scenario = recorded(road((ways[0], 0.0), (ways[1], height)), {8: drive(ways[1], 60.0)})
    agent = problem(9, -38.0, velocity=10.0, goal=(60.0, 0.0), time_step=(0, 150))
    return simulate(
        replace(scenario, planning_problems=(agent,)), agents=[9], planner="idm", settings={"rules.enabled": False}
    )


def test_neither_scores_nor_stories_know_what_crosses_above():
    below, alone = scored(7.0), scored(70.0)
    assert below.outcomes.outcome == ("goal_reached",)
    assert [score(run).terms["straight_ttc_min"].tolist() for run in (below, alone)] == [[np.inf], [np.inf]]
    assert met(below.criticality()) == set()
    assert (below.states.velocity[-1] == alone.states.velocity[-1]).all()
