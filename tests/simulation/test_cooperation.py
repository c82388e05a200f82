"""Cooperation by V2X: reproducible, off when it is off, and told in the run folder."""

from __future__ import annotations

import numpy as np
import pytest
from click.testing import CliRunner
from drivers import Straight, Turning
from parallel_drivers import Alone, Remembering

from interdrive import Trajectory, load, save
from interdrive.cli import main
from interdrive.simulation import Simulation, simulate
from interdrive.testing import problem, straight_road, world

#: A channel on which everything is drawn.
NOISY = {"v2x.penetration": 1.0, "v2x.loss": 0.3, "v2x.jitter": 0.2, "record.messages": "links", "step.max_steps": 40}


def test_results_do_not_depend_on_threads_or_on_the_order_of_agents():
    ids = [2001, 1001, 1002, 1003]
    runs = [
        simulate("t_junction", agents=agents, settings=NOISY, threads=threads)
        for agents, threads in ((ids, 1), (ids[::-1], 2), (ids, 8))
    ]
    assert len({run.digest for run in runs}) == 1
    first, *others = (run.messages for run in runs)
    assert first is not None
    for other in others:
        assert other is not None
        for name in first.__dataclass_fields__:
            np.testing.assert_array_equal(getattr(first, name), getattr(other, name))


@pytest.mark.parametrize("rules", [{}, {"rules.precedence": True}], ids=["negotiation", "orders"])
def test_planners_in_processes_of_their_own_change_no_bit(rules):
    settings = {**NOISY, **rules, "v2x.negotiate": True, "record.orders": bool(rules)}
    runs = [
        simulate(
            "t_junction",
            agents=[2001, 1001, 1002, 1003],
            planner={2001: planner, 1002: planner, "default": "rollout"},
            predictor="lane_following",
            settings=settings,
            threads=threads,
        )
        for planner, threads in ((Alone, 1), (Remembering, 2))
    ]
    assert len({run.digest for run in runs}) == 1
    for part in ("messages", "agreements", "violations", *(["orders"] if rules else [])):
        first, second = (getattr(run, part) for run in runs)
        for name in first.__dataclass_fields__:
            np.testing.assert_array_equal(getattr(first, name), getattr(second, name), err_msg=f"{part}.{name}")


def test_a_channel_that_loses_everything_changes_nothing():
    def digest(**v2x):
        settings = {**{f"v2x.{name}": value for name, value in v2x.items()}, "step.max_steps": 40}
        return simulate("t_junction", settings=settings, threads=1).digest

    assert digest(penetration=1.0, loss=1.0) == digest()
    assert digest(penetration=1.0) != digest()


def test_plans_that_are_not_believed_if_the_sender_is_in_sight_change_nothing_here():
    # `step_messages` of benchmarks/instructions.py relies on it, to count what messages cost while agents drive alike.
    def run(**v2x):
        settings = {**{f"v2x.{name}": value for name, value in v2x.items()}, "step.max_steps": 20}
        return simulate("t_junction", predictor="lane_following", settings=settings, threads=1)

    told = run(penetration=1.0, deviation=1e-6)
    assert told.digest == run().digest
    assert told.cooperation is not None and told.cooperation["messages"]["mcm"] > 50
    assert 0.2 < told.cooperation["planned_with_plan"] < 0.8, "only of senders out of sight"


def test_the_run_folder_has_messages_and_totals(tmp_path):
    run = simulate("t_junction", agents=[2001, 1001], settings=NOISY, threads=1)
    again = load(save(run, tmp_path / "run"))
    messages, totals = again.messages, again.cooperation
    assert messages is not None and totals is not None and run.messages is not None
    np.testing.assert_array_equal(messages.arrived, run.messages.arrived)
    own = messages.receiver_id == -1
    assert totals["equipped"] == [1001, 2001]
    assert totals["messages"] == {"cam": int(np.sum(own & (messages.service == 0))), "mcm": 80, "cpm": 0}
    share = np.mean(messages.arrived[~own] >= 0)
    assert totals["received_share"] == pytest.approx(share)
    assert share == pytest.approx(0.7, abs=0.1)
    # At least one step under way, at most the jitter of 0.2 s.
    under_way = (messages.arrived - messages.time_step)[messages.arrived >= 0]
    assert set(under_way.tolist()) == {1, 2}


def test_recorded_predictions_have_the_received_plans_with_sender_and_age(tmp_path):
    settings = {"v2x.penetration": 1.0, "v2x.delay": 0.3, "record.predictions": True, "step.max_steps": 12}
    run = load(save(simulate("t_junction", agents=[2001, 1001], settings=settings, threads=1), tmp_path / "run"))
    found, plans = run.predictions, run.plans
    assert found is not None
    told = np.flatnonzero(found.sender_id >= 0)
    assert set(found.sender_id[told].tolist()) == {1001, 2001}
    np.testing.assert_array_equal(found.participant_id[told], found.sender_id[told])
    np.testing.assert_allclose(found.age[told], 0.3)
    assert np.isnan(found.age[found.sender_id < 0]).all() and (found.sender_id < 0).any(), "the predictor's rows"
    row = told[-1]
    plan = np.flatnonzero((plans.agent_id == found.sender_id[row]) & (plans.time_step == found.time_step[row] - 3))[0]
    # Two seconds from now are 2.3 s after the plan.
    ahead = found.point.tolist().index(20)
    assert np.hypot(found.x[row, ahead] - plans.x[plan, 23], found.y[row, ahead] - plans.y[plan, 23]) < 0.05


@pytest.mark.parametrize("seed", range(12))
def test_nothing_leaks_from_an_agent_that_is_neither_seen_nor_heard(seed):
    # 100 sees 40 m and hears 60 m far; 1 is farther away all the time, 50 is heard.
    rng = np.random.default_rng(seed)
    road = straight_road(600.0, lanes=2)
    lane = float(rng.choice([0.0, 3.5]))
    here, there = rng.uniform(5.0, 20.0), rng.uniform(180.0, 220.0)
    speeds = rng.uniform(6.0, 14.0, 3)

    def drives(goal_of_the_far_one, planner_of_the_far_one):
        limits = (0, 300)
        problems = [
            problem(100, here, velocity=speeds[0], goal=(280.0, 0.0), time_step=limits),
            problem(50, here + 45.0, 3.5, speeds[1], goal=(280.0, 3.5), time_step=limits),
            problem(1, there, lane, speeds[2], goal=(goal_of_the_far_one, lane), time_step=limits),
        ]
        settings = {
            "v2x.penetration": 1.0,
            "v2x.negotiate": True,
            "v2x.range": 60.0,
            "v2x.loss": 0.2,
            "view.sensor_radius": 40.0,
            "step.max_steps": 30,
        }
        run = simulate(
            world(road, problems=problems),
            planner={"default": "rollout", 1: planner_of_the_far_one},
            predictor="lane_following",
            settings=settings,
            seed=seed,
            threads=1,
        )
        row = run.states.participant_id.tolist().index(100)
        assert run.cooperation is None or run.cooperation["received_share"] > 0.0
        return [getattr(run.states, name)[row, :31].tobytes() for name in ("x", "y", "velocity", "orientation")]

    first = drives(320.0, "rollout")
    assert drives(500.0, "rollout") == first, "another goal"
    assert drives(320.0, Turning) == first, "another planner"


def test_every_participant_in_a_view_is_seen_or_has_been_told_of():
    told = []

    class Listening(Straight):
        def plan(self, view, predictions):
            near = np.hypot(view.x[:, -1] - view.ego.x, view.y[:, -1] - view.ego.y) <= 20.0
            told.append((view.time_step, view.ids.copy(), view.via.copy(), near))
            return super().plan(view, predictions)

    settings = {**NOISY, "view.sensor_radius": 20.0, "v2x.cpm": True, "step.max_steps": 30}
    run = simulate("t_junction", planner={2001: Listening, "default": "rollout"}, settings=settings, threads=1)
    messages = run.messages
    mine = (messages.receiver_id == 2001) & (messages.arrived >= 0)
    by_message = 0
    for time_step, ids, via, near in told:
        senders = set(messages.sender_id[mine & (messages.arrived <= time_step)].tolist())
        assert near[via == 0].all(), "what is seen is within the range of sensors"
        assert set(ids[via == 1].tolist()) <= senders, "an agent that speaks for itself has been heard"
        assert senders or not (via == 2).any(), "no agent reports before anything has arrived"
        by_message += int((via > 0).sum())
    assert by_message > 20


def test_one_agent_can_be_equipped_or_not():
    assert Simulation("t_junction", v2x={2001: True}, threads=1).world.equipped == [2001]
    some = Simulation("t_junction", settings={"v2x.penetration": 0.5}, planner={2001: "v2x=false"}, threads=1)
    assert len(some.world.equipped) in (3, 4) and 2001 not in some.world.equipped


class Watching(Straight):
    """Notes what its view says of others."""

    def __init__(self):
        self.seen = []

    def plan(self, view, predictions):
        assert predictions.ids.tolist() == sorted([*view.ids.tolist(), view.ego.id])
        self.seen.append((view.ids.tolist(), view.via.tolist(), view.age.tolist()))
        return super().plan(view, predictions)


def test_a_planner_in_python_gets_what_was_received():
    watching = Watching()
    settings = {"v2x.penetration": 1.0, "view.sensor_radius": 20.0, "step.max_steps": 3}
    simulate(
        "t_junction",
        agents=[2001, 1001, 1005],
        planner={2001: lambda: watching, "default": "rollout"},
        settings=settings,
    )
    assert set(watching.seen[0][1]) <= {0}, "nothing has arrived yet"
    ids, via, age = watching.seen[1]
    assert {1001, 1005} <= set(ids)
    assert all(one == 0.1 for one, how in zip(age, via, strict=True) if how == 1)
    assert 1 in via, "beyond the sensors, by radio"


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["--set", "v2x.loss=1.5"], "v2x.loss: must be between 0 and 1, not 1.5"),
        (["--set", "v2x.camm=true"], "v2x.camm: no such setting; did you mean v2x.cam?"),
        (["--set", "v2x.negotiate=true", "--set", "v2x.mcm=false"], "v2x.negotiate: needs v2x.mcm"),
        (
            ["--v2x", "1", "--set", "v2x.cam=false", "--set", "v2x.mcm=false"],
            "v2x.penetration: is above 0, but none of cam, mcm and cpm is sent",
        ),
        (["--v2x", "2"], "v2x.penetration: must be between 0 and 1, not 2.0"),
        (["--agents", "2001,", "--agent", "7=v2x=true"], "agent 7: a planner is given for it, but it is not an agent"),
    ],
)
def test_bad_choices_are_one_line(arguments, line, tmp_path):
    shown = CliRunner().invoke(main, ["run", "t_junction", *arguments, "--out", str(tmp_path / "out")])
    assert shown.exit_code == 2
    assert line in shown.output


class Hasty(Straight):
    """Plans half a second."""

    def plan(self, view, predictions):
        whole = super().plan(view, predictions)
        return Trajectory(whole.x[:6], whole.y[:6], whole.orientation[:6], whole.velocity[:6])


@pytest.mark.parametrize(
    ("settings", "planner", "note"),
    [
        (
            {"v2x.penetration": 1.0, "v2x.delay": 2.0},
            "rollout",
            (
                "v2x.delay: messages arrive after 2 s and are discarded after 1.5 s (v2x.age_max):"
                " no message can ever be used"
            ),
        ),
        ({"v2x.penetration": 0.1}, "rollout", "v2x.penetration: 0.1 of the agents rounds to none: no agent has V2X"),
        (
            {"v2x.penetration": 1.0},
            {2001: Hasty, "default": "rollout"},
            "agent 2001: its plans are shorter than 1 s, so others do not use them",
        ),
    ],
)
def test_a_note_says_why_messages_are_of_no_use(settings, planner, note):
    run = simulate(
        "t_junction",
        agents=[2001, 1001],
        planner=planner,
        predictor="lane_following",
        settings={**settings, "step.max_steps": 3},
        threads=1,
    )
    assert [line for line in run.notes if "v2x" in line or "its plans" in line] == [note]
