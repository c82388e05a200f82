"""Caution before what a building hides: two one-way roads cross at the origin, with limits of 10 m/s.

Vehicles from the south go first, and a building stands in the corner between west and south.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import interdrive as idr
from interdrive.scenario import Shape
from interdrive.testing.worlds import Car, crossing, problem, world

HALF = 2.25
WALL, SIZE = 9, 60.0
#: Where the front of an agent stands that wants to see more, and where that of others waits at the latest [m].
PEEKING, MOUTH = -1.5, -1.4


def corner(away, *, cars=(), time=250):
    """Agent 1 comes from the west, 60 m away with 10 m/s; the building is `away` [m] from the middles of both roads."""
    lanelets = replace(crossing(), speed_limit=np.full(2, 10.0))
    hidden = Car(WALL, -away - 0.5 * SIZE, -away - 0.5 * SIZE)
    goal = problem(1, -60.0, goal=(60.0, 0.0), goal_size=(20.0, 3.5), time_step=(0, time))
    scenario = world(lanelets, cars=(hidden, *cars), problems=[goal], steps=time)
    is_wall = scenario.obstacles.ids == WALL
    obstacles = replace(
        scenario.obstacles,
        kinds=tuple("structure" if one else "car" for one in is_wall),
        shapes=tuple(Shape("rectangle", SIZE, SIZE) if one else Shape("rectangle", 4.5, 1.8) for one in is_wall),
        is_static=is_wall,
    )
    return replace(scenario, obstacles=obstacles)


def drive(scenario, planner="rollout", settings=None):
    settings = {"view.occlusion": True} | (settings or {})
    return idr.simulate(scenario, planner=planner, settings=settings, threads=1, agents=[1])


def motion(run):
    """Front [m] and speed [m/s] of agent 1 over time."""
    row = run.states.participant_id.tolist().index(1)
    valid = run.states.valid[row]
    return run.states.x[row, valid] + HALF, run.states.velocity[row, valid]


@pytest.mark.parametrize("planner", ["rollout", "frenet", "idm", "idm_mobil"])
def test_at_a_blind_corner_an_agent_creeps_to_the_mouth_and_then_goes(planner):
    run = drive(corner(3.0), planner)
    front, speed = motion(run)
    assert run.outcomes.outcome == ("goal_reached",)
    assert set(zip(run.orders.kind, run.orders.by_id.tolist(), strict=True)) == {("unseen", -1)}
    near = (front > PEEKING - 0.5) & (front < MOUTH + 0.1)
    assert speed[near].min() < 0.5, "it all but stands where it sees most"
    assert speed[(front > -4.0) & (front < PEEKING)].max() < 3.5, "it comes slowly"


@pytest.mark.parametrize("planner", ["rollout", "frenet", "idm", "idm_mobil"])
def test_the_farther_away_the_building_the_faster_it_passes(planner):
    least = [motion(drive(corner(away), planner))[1].min() for away in (3.0, 4.0, 6.0)]
    assert least[0] < least[1] < least[2]


@pytest.mark.parametrize(
    ("away", "settings"), [(30.0, {}), (3.0, {"view.occlusion": False}), (3.0, {"rules.unseen": False})]
)
def test_who_sees_enough_or_does_not_care_passes_as_on_a_free_road(away, settings):
    run = drive(corner(away), settings=settings)
    assert run.orders.kind == ()
    assert motion(run)[1].min() == pytest.approx(10.0, abs=0.1)


@pytest.mark.parametrize("away", [3.0, 4.0])
def test_none_is_hit_by_a_car_that_comes_out_of_the_hidden_road_at_the_limit(away):
    # Without the caution, 2 of these 40 hit (measured with either distance).
    for phase in range(40):
        run = drive(corner(away, cars=(Car(2, 0.0, -20.0 - 4.0 * phase, 10.0, np.pi / 2),)))
        assert run.outcomes.outcome == ("goal_reached",), phase


def test_a_car_that_stands_in_view_holds_what_is_behind_it():
    # From x = -20 m the agent sees the first 12 m of the other road, and a car that stands there.
    free, held = (drive(corner(8.0, cars=cars)) for cars in ((), (Car(2, 0.0, -8.5, 0.0, np.pi / 2),)))
    assert motion(held)[1].min() > motion(free)[1].min() + 1.0


def test_why_it_stood_is_told():
    run = drive(corner(3.0, time=95))
    assert "it could not see whether others came" in run.outcomes.reason[0]
