"""Turns that are as narrow as those of maps made for traffic simulation: which vehicles fit, which leave the road."""

from dataclasses import replace

import numpy as np
import pytest

from interdrive import SimulationSettings, simulate
from interdrive.config.binding import bind
from interdrive.scenario import Shape
from interdrive.testing import Car, straight_road, world

LENGTH, WIDTH = 5.0, 1.8
#: A car that fits arrives after 110 steps; one that does not waits as long as it may, which takes time to compute.
STEPS = 150
#: Of road before and after the turn [m].
STRAIGHT = 8.0


def turn_left(radius, spacing=0.5, straight=STRAIGHT):
    """Points and headings of a centre line: straight on, a quarter of a circle, straight on."""
    arc = 0.5 * np.pi * radius
    s = np.arange(0.0, 2.0 * straight + arc, spacing)
    heading = np.clip((s - straight) / radius, 0.0, 0.5 * np.pi)
    before, beyond = np.minimum(s - straight, 0.0), np.maximum(s - straight - arc, 0.0)
    x = straight + before + radius * np.sin(heading)
    y = radius * (1.0 - np.cos(heading)) + beyond
    return x, y, heading


def bend(lane_width, radius, structure=None, speed=1.5):
    """A lane that turns left, and a car of 5.0 m by 1.8 m whose recording follows its middle at 1.5 m/s."""
    x, y, heading = turn_left(radius)
    normal = np.column_stack([-np.sin(heading), np.cos(heading)])
    middle = np.column_stack([x, y])
    lanes = replace(
        straight_road(),
        left=(middle + 0.5 * lane_width * normal,),
        right=(middle - 0.5 * lane_width * normal,),
    )
    x, y, heading = (values[10:-10] for values in turn_left(radius, spacing=0.1 * speed))
    made = world(lanes, cars=[Car(1, 0.0)] + ([structure] if structure else []), steps=len(x) - 1)
    driven = made.obstacles
    values = {"x": x, "y": y, "orientation": heading, "velocity": np.full(len(x), speed)}
    tables = {name: np.vstack([first, getattr(driven, name)[1:]]) for name, first in values.items()}
    shapes = (Shape("rectangle", LENGTH, WIDTH), *driven.shapes[1:])
    return replace(made, obstacles=replace(driven, shapes=shapes, **tables))


def cutting_the_corner(inside, heading, speed):
    """A lane of 5 m that turns left with a radius of 5 m, and a car before its end, partly over the inner edge.

    It is beside the middle by `inside` [m] and heads further into the turn than the lane by an angle [rad].
    """
    x, y, along = turn_left(5.0, straight=20.0)
    normal = np.column_stack([-np.sin(along), np.cos(along)])
    middle = np.column_stack([x, y])
    lanes = replace(straight_road(), left=(middle + 2.5 * normal,), right=(middle - 2.5 * normal,))
    start, goal, steps = middle[54] + inside * normal[54], middle[-12], 120
    made = world(lanes, cars=[Car(1, 0.0)], steps=steps)
    driven = made.obstacles
    turned = np.full(steps + 1, along[-12])
    turned[0] = along[54] + heading
    x, y = np.linspace(start, goal, steps + 1).T
    values = {"x": x, "y": y, "orientation": turned, "velocity": np.full(steps + 1, speed)}
    tables = {name: np.vstack([first, getattr(driven, name)[1:]]) for name, first in values.items()}
    return replace(made, obstacles=replace(driven, shapes=(Shape("rectangle", 4.5, 2.0),), **tables))


def drive(scenario, **settings):
    chosen = bind(SimulationSettings(), {name.replace("__", "."): value for name, value in settings.items()})
    run = simulate(scenario, agents=[1], settings=chosen, threads=1)
    return run.outcomes.outcome[0], float(run.outcomes.off_lanelets[0]), run


def test_a_car_fits_through_a_narrow_turn_on_its_wheels():
    outcome, overhang, run = drive(bend(2.5, 5.0), step__max_steps=STEPS)
    assert outcome == "goal_reached"
    assert 0.4 < overhang < 0.8
    assert run.outcomes.off_lanelets_s[0] > 0.5
    assert run.violations.rule == ()


def test_it_does_not_fit_with_its_whole_body():
    outcome, overhang, _ = drive(bend(2.5, 5.0), road__judge="body", step__max_steps=STEPS)
    assert outcome == "time_limit"
    assert overhang <= 0.15


@pytest.mark.parametrize("judge", ["wheels", "body"])
def test_in_a_wide_turn_no_vehicle_leaves_the_lanelets(judge):
    outcome, overhang, run = drive(bend(3.5, 10.0), road__judge=judge)
    assert outcome == "goal_reached"
    assert overhang <= 0.1
    assert run.outcomes.off_lanelets_s[0] == 0.0
    assert run.violations.rule == ()


def test_a_body_may_not_reach_further_beyond_the_lanelets_than_stated():
    outcome, overhang, _ = drive(bend(2.5, 5.0), road__overhang_max=0.2, step__max_steps=STEPS)
    assert outcome == "time_limit"
    assert overhang <= 0.2


def test_a_car_beside_a_turn_is_not_touched_however_far_bodies_may_swing():
    # Outside the lane, abreast of the end of the turn: 1.5 m between the edge and the middle of its 1.8 m.
    parked = Car(7, STRAIGHT + 5.0 + 1.25 + 1.5, 4.0, orientation=0.5 * np.pi)
    _, _, run = drive(bend(2.5, 5.0, parked))
    assert run.outcomes.outcome[0].startswith("goal_reached")
    assert run.violations.rule == ()


@pytest.mark.parametrize(
    ("structure", "judge", "why"),
    [
        # Abreast of the end of the turn, its side 0.3 m beside the lane: the front of the car swings out by 0.5 m.
        (Car(7, STRAIGHT + 5.0 + 1.25 + 1.2, 4.0, orientation=0.5 * np.pi), "wheels", "collision with 7"),
        (None, "body", "off the road"),
    ],
)
def test_a_car_that_stands_before_a_turn_says_what_it_would_touch_on_its_way(structure, judge, why):
    outcome, _, run = drive(bend(2.5, 5.0, structure), road__judge=judge, step__max_steps=STEPS)
    assert outcome == "time_limit"
    assert f"without a vehicle ahead, as quicker plans were rejected: {why}" in run.outcomes.reason[0]


@pytest.mark.parametrize(
    ("inside", "heading", "speed"), [(1.6, 0.6, 7.0), (1.55, 0.65, 7.0), (1.5, 0.65, 7.0), (1.5, 0.6, 8.0)]
)
def test_a_car_that_starts_over_the_inner_edge_does_not_leave_the_road_once_it_is_on_it(inside, heading, speed):
    outcome, _, run = drive(cutting_the_corner(inside, heading, speed))
    assert outcome != "collision"
    assert not run.outcomes.off_road[0]
