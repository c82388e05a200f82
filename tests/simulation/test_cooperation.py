"""Cooperation by V2X: reproducible, off when it is off, and told in the run folder."""

from __future__ import annotations

import numpy as np
import pytest
from click.testing import CliRunner
from drivers import Straight

from interdrive import load, save
from interdrive.cli import main
from interdrive.simulation import Simulation, simulate

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


def test_a_channel_that_loses_everything_changes_nothing():
    def digest(**v2x):
        settings = {**{f"v2x.{name}": value for name, value in v2x.items()}, "step.max_steps": 40}
        return simulate("t_junction", settings=settings, threads=1).digest

    assert digest(penetration=1.0, loss=1.0) == digest()
    assert digest(penetration=1.0) != digest()


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
        planner={2001: lambda: watching, "default": "frenet"},
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
        (["--v2x", "2"], "v2x.penetration: must be between 0 and 1, not 2.0"),
        (["--agents", "2001,", "--agent", "7=v2x=true"], "agent 7: a planner is given for it, but it is not an agent"),
    ],
)
def test_bad_choices_are_one_line(arguments, line, tmp_path):
    shown = CliRunner().invoke(main, ["run", "t_junction", *arguments, "--out", str(tmp_path / "out")])
    assert shown.exit_code == 2
    assert line in shown.output
