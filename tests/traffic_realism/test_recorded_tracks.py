"""What is measured on tracks: leaders on bends, time gaps, lane changes, smooth motions; headways that persist."""

import numpy as np
import pytest

from interdrive.native_settings import RoadSettings
from interdrive.scenario.native import core_road
from interdrive.testing import straight_road, world
from interdrive.traffic_realism.persistence import persistence, thirds
from interdrive.traffic_realism.tracks import GRID, Tracks, kinematics, leaders

N = 41


def _tracks(*vehicles):
    """Vehicles with ids from 1 on: x, y [m], heading [rad], speed [m/s], each a number or one per point."""
    tables = [np.stack([np.broadcast_to(np.asarray(v[i], dtype=float), N) for v in vehicles]) for i in range(4)]
    n = len(vehicles)
    return Tracks(np.arange(1, n + 1), np.full(n, 4.5), np.full(n, 1.8), *tables)


def test_a_vehicle_ahead_on_a_bend_leads_and_one_in_the_next_lane_does_not():
    angle = 40.0 / 200.0
    ahead = (200.0 * np.sin(angle), 200.0 * (1.0 - np.cos(angle)), angle, 8.0)
    beside = (196.5 * np.sin(angle), 200.0 - 196.5 * np.cos(angle), angle, 8.0)
    gap, closing = leaders(_tracks((0.0, 0.0, 0.0, 10.0), ahead), np.array([0]))
    assert gap[0, 0] == pytest.approx(ahead[0] - 4.5)
    assert closing[0, 0] == 2.0
    assert np.isnan(leaders(_tracks((0.0, 0.0, 0.0, 10.0), beside), np.array([0]))[0]).all()


def test_a_headway_is_the_time_to_the_place_of_the_leader_and_at_most_five_seconds():
    road = core_road(world(straight_road(400.0, 2)), RoadSettings())
    x = 10.0 * GRID * np.arange(N)
    tracks = _tracks((x, 0.0, 0.0, 10.0), (x + 24.5, 0.0, 0.0, 10.0), (x + 94.5, 0.0, 0.0, 10.0))
    found = kinematics(tracks, np.array([1, 2, 3]), road)
    assert found.headway[0] == pytest.approx(2.0)
    assert found.headway[1] == pytest.approx(5.0)
    assert np.isnan(found.headway[2]).all()


def test_a_lane_change_counts_once_and_offsets_go_on_across_it():
    road = core_road(world(straight_road(400.0, 2)), RoadSettings())
    x, y = 10.0 * GRID * np.arange(N), np.linspace(0.0, 3.5, N)
    found = kinematics(_tracks((x, y, 0.0, 10.0)), np.array([1]), road)
    assert found.changes.sum() == 1
    assert found.lateral_speed[0, 3:-3] == pytest.approx(3.5 / (GRID * (N - 1)))
    assert found.offset[0, 0] == pytest.approx(0.0)
    assert found.offset[0, -1] == pytest.approx(0.0)


def test_the_lag_gap_at_a_lane_change_is_that_of_the_vehicle_behind_in_the_new_lane():
    road = core_road(world(straight_road(400.0, 2)), RoadSettings())
    x = 100.0 + 10.0 * GRID * np.arange(N)
    changing = (x, np.linspace(0.0, 3.5, N), 0.0, 10.0)
    # Behind it in the old lane by 10 m, in the new one by 20 and 60 m; one is ahead there.
    others = [(x - 10.0, 0.0, 0.0, 10.0), *((x + d, 3.5, 0.0, 10.0) for d in (-20.0, -60.0, 15.0))]
    found = kinematics(_tracks(changing, *others), np.array([1]), road)
    assert found.lag[0, found.changes[0]] == pytest.approx(20.0 - 4.5)
    assert np.isnan(found.lag[0, ~found.changes[0]]).all()
    alone = kinematics(_tracks(changing, others[0]), np.array([1]), road)
    assert np.isnan(alone.lag).all()


def test_acceleration_and_jerk_follow_the_way():
    road = core_road(world(straight_road(400.0, 1)), RoadSettings())
    time = GRID * np.arange(N)
    x = 10.0 * time + 0.1 * time**3
    found = kinematics(_tracks((x, 0.0, 0.0, 10.0)), np.array([1]), road)
    assert found.jerk[0, 20] == pytest.approx(0.6)
    assert found.acceleration[0, 20] == pytest.approx(0.6 * time[20])


def test_drivers_that_keep_different_headways_are_spread_and_persistent():
    n, points = 12, 201
    # One vehicle behind the other in pairs that are far apart.
    x = 12.0 * GRID * np.arange(points)
    headway = np.linspace(0.8, 2.5, n)
    ids = np.arange(1, 2 * n + 1)
    tables = {"x": np.empty((2 * n, points)), "y": np.empty((2 * n, points))}
    for i in range(n):
        tables["y"][[i, n + i]] = 20.0 * i
        tables["x"][i], tables["x"][n + i] = x, x + 4.5 + 12.0 * headway[i]
    flat = np.zeros((2 * n, points))
    tracks = Tracks(
        ids, np.full(2 * n, 4.5), np.full(2 * n, 1.8), tables["x"], tables["y"], flat, np.full((2 * n, points), 12.0)
    )
    found = persistence([thirds(tracks, ids, 0)])
    assert found.n_vehicles == n
    assert found.persistence == pytest.approx(1.0)
    assert found.spread == pytest.approx(np.log(headway).std(ddof=1))
    assert np.isnan(persistence([]).spread)
