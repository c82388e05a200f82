"""Agents that are hit without their fault drive on, if the run says so; who hit them leaves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import interdrive as idr
from interdrive.results import save
from interdrive.testing import Car, problem, straight_road, world

DRIVES_ON = {"collision.not_at_fault": "hitter_leaves"}
#: Cars at 20 m/s that are where the agent stands after 2, 4 and 6 s.
FROM_BEHIND = [Car(7, 40.0, velocity=20.0), Car(8, 0.0, velocity=20.0), Car(9, -40.0, velocity=20.0)]


class Stand:
    """Stays where it is."""

    def plan(self, view, predictions):
        still = np.ones(31)
        ego = view.ego
        return idr.Trajectory(ego.x * still, ego.y * still, ego.orientation * still, 0.0 * still)


class Straight:
    """Keeps speed and heading."""

    def plan(self, view, predictions):
        way = view.ego.velocity * view.dt * np.arange(31)
        return idr.Trajectory(view.ego.x + way, np.full(31, view.ego.y), np.zeros(31), np.full(31, view.ego.velocity))


def road(*cars, x=84.0, velocity=0.0, others=(), static=False):
    """A road of 600 m along x from -100 m on with agent 100, which has its goal 150 m ahead."""
    lanelets = straight_road(600.0)
    shifted = {name: tuple(points - [100.0, 0.0] for points in getattr(lanelets, name)) for name in ("left", "right")}
    agent = problem(100, x, 0.0, velocity, goal=(x + 150.0, 0.0), time_step=(0, 100))
    scenario = world(replace(lanelets, **shifted), cars=cars, problems=[agent, *others], steps=170)
    if static:
        standing = np.ones(len(cars), dtype=bool)
        scenario = replace(scenario, obstacles=replace(scenario.obstacles, is_static=standing))
    return scenario


def drive(scenario, planner=Stand, settings=None, threads=1, agents="problems"):
    return idr.simulate(
        scenario,
        agents=agents,
        planner=planner,
        predictor="constant_velocity",
        threads=threads,
        settings=DRIVES_ON if settings is None else settings,
    )


def test_somebody_who_stands_is_hit_three_times_and_stays_where_it_is():
    hit, alone = drive(road(*FROM_BEHIND)), drive(road())
    assert hit.hits.agent_id.tolist() == [100, 100, 100]
    assert hit.hits.by_id.tolist() == [7, 8, 9]
    assert hit.hits.time_step.tolist() == pytest.approx([20, 40, 60], abs=1)
    assert hit.hits.impact_speed.tolist() == pytest.approx([20.0, 20.0, 20.0]), "m/s"
    assert hit.hits.collision_type == ("stopped_agent",) * 3
    assert hit.outcomes.outcome == alone.outcomes.outcome == ("time_limit",)
    assert hit.outcomes.time_step.tolist() == alone.outcomes.time_step.tolist()
    row = int(np.searchsorted(hit.states.participant_id, 100))
    n = alone.states.x.shape[1]
    assert np.array_equal(hit.states.x[row, :n], alone.states.x[0], equal_nan=True)


def test_who_hits_it_is_gone_from_the_next_step_on():
    run = drive(road(*FROM_BEHIND))
    for by, step in zip(run.hits.by_id.tolist(), run.hits.time_step.tolist(), strict=True):
        row = int(np.searchsorted(run.states.participant_id, by))
        assert np.flatnonzero(run.states.valid[row])[-1] == step


def test_being_hit_changes_no_bit_of_the_score():
    found = [idr.score(drive(road(*cars)), panel=("lawful", "idm", "idm_mobil")) for cars in ((), FROM_BEHIND)]
    assert found[0].score.tobytes() == found[1].score.tobytes()
    assert [one.hits.tolist() for one in found] == [[0], [3]]
    assert "hit by 7 while it stood at 2." in found[1].why(100)


def test_a_run_that_ended_by_a_hit_is_driven_on_if_its_planner_can_be_repeated():
    ended = drive(road(*FROM_BEHIND), settings={})
    assert ended.outcomes.outcome == ("collision",)
    assert ended.hits is None
    on, cut = idr.score(ended, panel=["lawful"], trust=True), idr.score(ended, panel=["lawful"])
    assert on.hits.tolist() == [3]
    assert on.score.tobytes() == idr.score(drive(road()), panel=["lawful"]).score.tobytes()
    assert cut.hits.tolist() == [1]
    assert cut.score[0] <= on.score[0], "a lower bound"


def test_a_collision_at_fault_ends_the_agent_as_ever():
    run = drive(road(Car(7, 140.0), velocity=12.0), Straight)
    assert run.outcomes.outcome == ("collision",)
    assert len(run.hits.agent_id) == 0


def test_of_two_agents_the_one_at_fault_ends():
    behind = problem(101, 40.0, 0.0, 20.0, goal=(300.0, 0.0), time_step=(0, 100))
    run = drive(road(others=[behind]), {100: Stand, 101: Straight})
    assert dict(zip(run.outcomes.agent_id.tolist(), run.outcomes.outcome, strict=True)) == {
        100: "time_limit",
        101: "collision",
    }
    assert run.hits.by_id.tolist() == [101]


def test_who_hits_an_agent_ends_even_if_it_is_hit_at_the_same_time():
    pushed = problem(101, 40.5, 0.0, 20.0, goal=(300.0, 0.0), time_step=(0, 100))
    ahead = problem(102, 84.0, 0.0, 0.0, goal=(300.0, 0.0), time_step=(0, 100))
    scenario = road(Car(7, -2.2, velocity=40.0), x=300.0, others=[pushed, ahead])
    run = drive(scenario, {100: Stand, 101: Straight, 102: Stand})
    partners = dict(zip(run.outcomes.agent_id.tolist(), run.outcomes.partner_id.tolist(), strict=True))
    assert partners[101] == 7, "the car at 40 m/s runs into it when it runs into 102"
    assert run.hits.agent_id.tolist() == [102, 102]
    assert run.hits.by_id.tolist() == [101, 7], "what hit 101, which is gone, comes next"
    assert dict(zip(run.outcomes.agent_id.tolist(), run.outcomes.outcome, strict=True)) == {
        100: "time_limit",
        101: "collision",
        102: "time_limit",
    }


@pytest.mark.parametrize("hitter", ["recorded", "agent"])
def test_all_whom_one_vehicle_hits_at_the_same_time_drive_on(hitter):
    beside = [
        problem(number, 84.0, y, 0.0, goal=(300.0, 0.0), time_step=(0, 100)) for number, y in ((101, 1), (102, -1))
    ]
    if hitter == "agent":
        beside.append(problem(103, 40.0, 0.0, 20.0, goal=(300.0, 0.0), time_step=(0, 100)))
    scenario = road(*[Car(7, 40.0, velocity=20.0)] * (hitter == "recorded"), x=300.0, others=beside)
    planners = {100: Stand, 101: Stand, 102: Stand, 103: Straight}
    run = drive(scenario, {one: planner for one, planner in planners.items() if one != 103 or hitter == "agent"})
    by = 103 if hitter == "agent" else 7
    assert run.hits.agent_id.tolist() == [101, 102]
    assert run.hits.by_id.tolist() == [by, by]
    assert run.outcomes.outcome[:3] == ("time_limit",) * 3
    assert run.outcomes.outcome[3:] == ("collision",) * (hitter == "agent")


@pytest.mark.parametrize("change", [{"threads": 4}, {"settings": {**DRIVES_ON, "record.violations": False}}])
def test_neither_threads_nor_what_is_recorded_changes_a_bit(change):
    scenario = road(*FROM_BEHIND)
    run, again = drive(scenario), drive(scenario, **change)
    assert run.digest == again.digest
    assert run.hits.time_step.tolist() == again.hits.time_step.tolist()


def test_a_saved_run_has_its_hits(tmp_path):
    run = drive(road(*FROM_BEHIND))
    again = idr.load(save(run, tmp_path / "run"))
    assert (tmp_path / "run" / "hits.parquet").exists()
    assert again.hits.by_id.tolist() == [7, 8, 9]
    assert idr.load(save(drive(road(), settings={}), tmp_path / "other")).hits is None


def test_only_an_agent_that_a_contact_has_just_ended_can_drive_on():
    simulation = idr.Simulation(
        road(*FROM_BEHIND), agents="problems", planner=Stand, predictor="constant_velocity", threads=1
    )
    simulation.step()
    with pytest.raises(idr.InterdriveError, match="agent 100 was not ended by a contact"):
        simulation.world.drive_on(100)
    with pytest.raises(idr.InterdriveError, match="there is no agent with id 5"):
        simulation.world.drive_on(5)
    run = simulation.run()
    assert run.outcomes.outcome == ("collision",)
