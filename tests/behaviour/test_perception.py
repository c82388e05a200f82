"""Agents that do not look for a while, or perceive others late, elsewhere, at another speed, or not always.

Agent 1 follows car 2 at 12 m/s, 30 m behind it, on a straight road; car 2 brakes.
"""

from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest

import interdrive as idr
from interdrive import Trajectory
from interdrive.testing import Car, straight_road, world

STEPS, DT = 80, 0.1


def leader_brakes(at=2.0, braking=6.0):
    """Car 2 brakes so long after the beginning [s], so hard [m/s²], down to 2 m/s."""
    scenario = world(straight_road(400.0), cars=[Car(1, 20.0, velocity=12.0), Car(2, 50.0, velocity=12.0)], steps=STEPS)
    obstacles = scenario.obstacles
    x, velocity, acceleration = obstacles.x.copy(), obstacles.velocity.copy(), obstacles.acceleration.copy()
    time = np.arange(x.shape[1]) * DT
    velocity[1] = speed = np.maximum(12.0 - braking * np.maximum(time - at, 0.0), 2.0)
    x[1, 1:] = 50.0 + np.cumsum(0.5 * DT * (speed[1:] + speed[:-1]))
    acceleration[1] = np.gradient(speed, DT)
    return replace(scenario, obstacles=replace(obstacles, x=x, velocity=velocity, acceleration=acceleration))


def drive(view=(), planner="idm", **more):
    settings = {f"view.{name}": value for name, value in dict(view).items()}
    return idr.simulate(leader_brakes(), agents=[1], planner=planner, settings=settings, threads=1, **more)


def speed(run):
    return run.states.velocity[run.states.participant_id.tolist().index(1)]


@pytest.mark.parametrize("planner", ["idm", "rollout"])
def test_who_does_not_look_goes_on_with_its_plan_and_then_brakes_the_harder(planner):
    attentive, lapse = (speed(drive(view, planner)) for view in ({}, {"inattentive_from": 1.5, "inattentive_for": 2.0}))
    assert np.array_equal(lapse[:15], attentive[:15])
    assert lapse[34] > attentive[34] + 1.0, "m/s, after 1.4 s of braking that it did not see"
    braking = [-np.nanmin(np.diff(one)) / DT for one in (attentive, lapse)]
    assert braking[1] > braking[0] + 0.5, "m/s²"


class Noting:
    """Keeps speed and notes what it perceives of car 2, and what is expected of it."""

    #: Of all objects, since every run has its own.
    seen: ClassVar[list[list[float]]] = []

    def plan(self, view, predictions):
        ego, time = view.ego, np.arange(31) * view.dt
        row = view.ids.tolist().index(2) if 2 in view.ids else None
        expected = predictions.x[predictions.ids.tolist().index(2), 0, 0] if row is not None else np.nan
        history = np.full(4, np.nan) if row is None else view.x[row, -4:]
        self.seen.append([ego.x, *history, view.velocity[row, -1] if row is not None else np.nan, expected])
        same = np.ones_like(time)
        return Trajectory(ego.x + ego.velocity * time, ego.y * same, 0.0 * same, ego.velocity * same)


def noted(view):
    Noting.seen.clear()
    run = drive(view, Noting)
    return np.array(Noting.seen), run


def test_who_is_late_perceives_where_others_were_and_expects_them_from_there():
    exact, run = noted({})
    late, _ = noted({"delay": 0.3})
    x = run.states.x[run.states.participant_id.tolist().index(2)]
    assert np.array_equal(exact[:, 4], x[: len(exact)])
    assert np.array_equal(late[:, 0], exact[:, 0]), "it knows where it is itself"
    assert np.array_equal(late[3:, 4], x[: len(late) - 3])
    assert np.array_equal(late[6:, 1], x[: len(late) - 6]), "in the past, too"
    assert late[:3, 4] == pytest.approx(x[0] - np.array([3.6, 2.4, 1.2])), "m: as if it had come before, at 12 m/s"
    assert late[10, 6] == pytest.approx(x[7] + 1.2), "m: 0.1 s on at 12 m/s"


def test_who_is_late_does_not_take_a_recorded_car_at_its_begin_for_a_standing_one():
    cars = [Car(1, 20.0, velocity=12.0), Car(2, 45.0, velocity=12.0)]
    scenario = world(straight_road(400.0), cars=cars, steps=STEPS)
    run = idr.simulate(scenario, agents=[1], planner="idm", settings={"view.delay": 0.3}, threads=1)
    row = run.states.participant_id.tolist().index(1)
    assert np.nanmin(run.states.acceleration[row, :20]) > -1.0, "m/s²"


def test_a_message_makes_up_for_a_participant_that_is_missed():
    v2x = {"v2x.penetration": 1.0}
    for settings, is_known in (({}, False), (v2x, True)):
        Noting.seen.clear()
        cars = [Car(1, 20.0, velocity=12.0), Car(2, 50.0, velocity=12.0)]
        idr.simulate(
            world(straight_road(400.0), cars=cars, steps=STEPS),
            agents=[1, 2],
            planner={1: Noting, "default": "idm"},
            views={1: {"missed": 1.0}},
            settings=settings,
            threads=1,
        )
        assert (not np.isnan(np.array(Noting.seen)[10:, 4]).any()) == is_known


def test_errors_of_position_and_speed_have_their_spread_and_are_those_of_the_seed():
    exact, _ = noted({})
    wrong = {seed: noted({"position_error": 0.5, "speed_error": 0.1, "error_seed": seed})[0] for seed in (1, 2)}
    for seed in wrong:
        error, share = wrong[seed][:, 4] - exact[:, 4], wrong[seed][:, 5] / exact[:, 5] - 1.0
        assert 0.1 < error.std() < 1.0, "m"
        assert 0.02 < share.std() < 0.2
        assert abs(np.diff(error)).max() < 0.35, "m: they change slowly"
    assert not np.allclose(wrong[1][:, 4], wrong[2][:, 4])
    again, _ = noted({"position_error": 0.5, "speed_error": 0.1, "error_seed": 1})
    assert np.array_equal(again, wrong[1], equal_nan=True)


def test_a_participant_is_missed_in_a_share_of_the_time_steps():
    seen, _ = noted({"missed": 0.3, "error_seed": 4})
    assert 0.15 < np.isnan(seen[:, 4]).mean() < 0.45
    outcomes = [drive({"missed": share}).outcomes.outcome for share in (0.0, 1.0)]
    assert outcomes[0] != ("collision",)
    assert outcomes[1] == ("collision",), "it never sees the car ahead"


def test_planners_of_the_core_perceive_the_same_errors_and_repeat_their_runs():
    view = {"delay": 0.2, "position_error": 0.4, "speed_error": 0.1, "missed": 0.1, "error_seed": 5}
    for planner in ("idm", "rollout", "frenet"):
        digests = [drive(one, planner).digest for one in (view, view, {**view, "error_seed": 6}, {})]
        assert digests[0] == digests[1], planner
        assert len(set(digests)) == 3, planner


def test_errors_of_perception_follow_the_seed_of_the_run_too():
    view = {"position_error": 0.5, "missed": 0.1}
    digests = {seed: drive(view, seed=seed).digest for seed in (0, 1, 2)}
    assert len(set(digests.values())) == 3
    assert drive(view, seed=2).digest == digests[2]
    assert drive(seed=0).digest == drive(seed=1).digest, "without errors nothing is drawn"
    assert drive({"delay": 0.2}, seed=0).digest == drive({"delay": 0.2}, seed=1).digest, "nor for a delay"


@pytest.mark.parametrize("planner", ["idm", Noting])
def test_who_is_in_sight_does_not_depend_on_where_it_seems_to_be(planner):
    # Car 2 keeps 30 m away for 2 s; 30 m of error would bring it into sight.
    exact, wrong = (
        speed(drive({"sensor_radius": 20.0, "error_seed": 3, **view}, planner))
        for view in ({}, {"position_error": 30.0})
    )
    assert np.array_equal(exact[:20], wrong[:20])


def test_others_are_not_affected_by_what_one_agent_perceives():
    runs = [
        idr.simulate(leader_brakes(), agents=[1, 2], planner="idm", views=views, threads=1)
        for views in ({}, {1: {"position_error": 0.5}})
    ]
    for ahead, is_equal in ((1, True), (0, False)):
        first, second = (run.states.x[ahead, :40] for run in runs)
        assert np.array_equal(first, second) == is_equal


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("delay", -0.1, "between 0 and 10"),
        ("missed", 1.5, "between 0 and 1"),
        ("position_error", -1.0, "between 0 and 100"),
    ],
)
def test_errors_that_cannot_be_are_refused(name, value, words):
    with pytest.raises(idr.InputError, match=f"{name}.*{words}"):
        drive({name: value})


def test_a_delay_beyond_the_past_that_is_kept_is_refused():
    words = "view.delay of 1.1 s is longer than the past that is kept: 1 s, see step.history_steps"
    view = {"view.delay": 1.1, "step.history_steps": 10}
    with pytest.raises(idr.InputError, match=words):
        idr.simulate(leader_brakes(), agents=[1], planner="idm", settings=view, threads=1)
    idr.simulate(leader_brakes(), agents=[1], planner="idm", settings={**view, "view.delay": 1.0}, threads=1)
