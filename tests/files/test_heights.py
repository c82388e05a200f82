"""Ways that cross one above the other do not meet: no contact, no sight, no order. Without heights they do."""

import commonroad_documents as cr
import numpy as np
import pytest
from drivers import Straight

import interdrive as idr
from interdrive import read_scenario

GROUND = cr.planning_problem(
    9, cr.goal(position=cr.rectangle_at(95, 0, length=10, width=4), time=(0, 120)), start=cr.initial(
        10.0, velocity=10.0, yawRate=0.0, slipAngle=0.0
    )
)  # fmt: skip


def road(number, z, *, upward=False, bounds=("left", "right")):
    """A road through (50, 0) along x, or along y; height by the distance from its start."""
    way = np.linspace(0.0, 100.0, 11)
    sides = {}
    for side, offset in (("left", 2.0), ("right", -2.0)):
        at = [(50.0 - offset, s - 50.0) if upward else (s, offset) for s in way]
        sides[side] = [(x, y, z(s)) if side in bounds else (x, y) for (x, y), s in zip(at, way, strict=True)]
    return cr.lanelet(number, **sides)


def crossing_car(velocity=10.0, y=-40.0):
    """A vehicle that drives up and is at the crossing when an agent that starts at x = 10 m at 10 m/s is."""
    first = cr.initial(50.0, y, orientation=np.pi / 2, velocity=velocity)
    states = [cr.state(k, 50.0, y + 0.1 * k * velocity, orientation=np.pi / 2, velocity=velocity) for k in range(1, 81)]
    return cr.car(7, first, states)


def driven(tmp_path, above, planner=Straight, traffic=None, **more):
    """The run of an agent at the ground, below, at or beside what the second road carries."""
    lanelets = road(1, lambda s: 0.0) + above
    text = cr.document((crossing_car() if traffic is None else traffic) + GROUND, lanelets=lanelets)
    return idr.simulate(read_scenario(cr.saved(tmp_path, text)), agents=[9], planner=planner, threads=1, **more)


@pytest.mark.parametrize("bounds", [("left", "right"), ("left",)])
@pytest.mark.parametrize(("height", "apart"), [(7.0, True), (-7.0, True), (3.01, True), (3.0, False), (0.0, False)])
def test_vehicles_one_above_the_other_do_not_touch(tmp_path, height, apart, bounds):
    run = driven(tmp_path, road(2, lambda s: height, upward=True, bounds=bounds))
    assert run.outcomes.outcome == ("goal_reached" if apart else "collision",)


def test_the_height_of_a_ramp_counts_where_it_crosses(tmp_path):
    assert driven(tmp_path, road(2, lambda s: 0.14 * s, upward=True)).outcomes.outcome == ("goal_reached",)
    assert driven(tmp_path, road(2, lambda s: 0.05 * s, upward=True)).outcomes.outcome == ("collision",)


def test_where_a_map_states_no_heights_ways_meet(tmp_path):
    flat = road(2, lambda s: 0.0, upward=True, bounds=())
    assert driven(tmp_path, flat).outcomes.outcome == ("collision",)


@pytest.mark.parametrize("planner", ["rollout", "frenet", "idm", "idm_mobil"])
def test_nobody_waits_for_what_crosses_above(tmp_path, planner):
    def speeds(traffic):
        run = driven(tmp_path, road(2, lambda s: 7.0, upward=True), planner, traffic)
        assert run.outcomes.outcome == ("goal_reached",)
        return run.states.velocity[run.states.participant_id.tolist().index(9)]

    alone, below = speeds(""), speeds(None)
    assert below[: len(alone)].tolist() == alone.tolist()


def test_what_is_above_is_not_seen_and_what_stands_below_a_bridge_is(tmp_path):
    seen = {}

    class Looking(Straight):
        def plan(self, view, predictions):
            seen[height] = view.ids.tolist()
            return super().plan(view, predictions)

    for height in (7.0, 0.0):
        driven(tmp_path, road(2, lambda s, z=height: z, upward=True), Looking, settings={"step.max_steps": 1})
    assert seen == {7.0: [], 0.0: [7]}
    height = "below"
    parked = cr.car(8, cr.initial(50.0, 0.0, velocity=0.0), [cr.state(1, 50.0, orientation=0.0, velocity=0.0)])
    driven(tmp_path, road(2, lambda s: 7.0, upward=True), Looking, traffic=parked, settings={"step.max_steps": 1})
    assert seen["below"] == [8]


def test_no_junction_is_where_ways_are_one_above_the_other(tmp_path):
    def orders(z):
        lanelets = road(1, lambda s: 0.0) + road(2, lambda s: z, upward=True)
        start = cr.initial(50.0, -40.0, orientation=np.pi / 2, velocity=10.0, yawRate=0.0, slipAngle=0.0)
        goal = cr.goal(position=cr.rectangle_at(50, 45, length=4, width=8), time=(0, 150))
        text = cr.document(GROUND + cr.planning_problem(11, goal, start=start), lanelets=lanelets)
        run = idr.simulate(read_scenario(cr.saved(tmp_path, text)), agents=[9, 11], threads=1)
        velocity = run.states.velocity
        return run.outcomes.outcome, float(np.nanmin(velocity))

    assert orders(7.0)[0] == ("goal_reached", "goal_reached")
    assert orders(7.0)[1] > 9.0 > orders(0.0)[1]


def test_heights_are_the_middle_of_both_bounds(tmp_path):
    text = cr.document(lanelets=road(1, lambda s: 0.1 * s) + road(2, lambda s: 7.0, upward=True, bounds=()))
    heights = read_scenario(cr.saved(tmp_path, text)).lanelets.heights
    assert heights[0] == pytest.approx(np.linspace(0.0, 10.0, 11))
    assert len(heights[1]) == 0


def test_a_way_without_heights_that_crosses_one_with_them_is_noted(tmp_path):
    lanelets = road(1, lambda s: 0.1 * s) + road(2, lambda s: 7.0, upward=True, bounds=())
    notes = read_scenario(cr.saved(tmp_path, cr.document(lanelets=lanelets))).notes
    assert "lanelets 1 and 2 cross, and 2 has no heights: vehicles on them meet" in notes
    whole = road(1, lambda s: 0.1 * s) + road(2, lambda s: 7.0, upward=True)
    assert not read_scenario(cr.saved(tmp_path, cr.document(lanelets=whole))).notes
