"""Harm of collisions in runs and their tables."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from invented_run import invented_run, outcomes

from interdrive.criticality import agent_harm, collisions, participant_masses
from interdrive.results import outcome_table, read_results, save


def logistic(z):
    return 1.0 / (1.0 + np.exp(-z))


@pytest.fixture
def run():
    return invented_run()


def ended(run, *rows):
    """The run with other outcomes: (agent, outcome, time step, partner, off road, impact speed)."""
    agent, outcome, time_step, partner, off_road, speed = zip(*rows, strict=True)
    return replace(
        run,
        outcomes=outcomes(
            agent,
            outcome,
            planner=("frenet",) * len(rows),
            time_step=np.array(time_step),
            partner_id=np.array(partner),
            off_road=np.array(off_road),
            impact_speed=np.array(speed, dtype=float),
        ),
    )


def test_masses_follow_kind_and_footprint(run):
    masses = dict(zip(run.states.participant_id.tolist(), participant_masses(run).tolist(), strict=True))
    assert masses[1] == pytest.approx(-1333.5 + 526.9 * (4.5 * 1.8) ** 0.8)
    assert (masses[3], masses[4], masses[21], masses[24]) == (250.0, 13000.0, 25000.0, 75.0)
    assert participant_masses(run, {1: 900.0})[0] == 900.0
    length = np.where(run.states.participant_id == 1, 4.508, run.states.length)
    width = np.where(run.states.participant_id == 1, 1.610, run.states.width)
    type_2 = replace(run, states=replace(run.states, length=length, width=width))
    assert participant_masses(type_2)[0] == 1093.3


def test_a_collision_with_a_parked_car_harms_both(run):
    found = collisions(run)
    assert (found.agent_id.tolist(), found.partner_id.tolist(), found.time_step.tolist()) == ([2], [22], [47])
    speed = run.states.velocity[1, 47]
    assert found.relative_speed[0] == pytest.approx(speed)
    own, parked = found.mass[0], found.partner_mass[0]
    change, parked_change = parked / (own + parked) * speed, own / (own + parked) * speed
    assert found.harm[0] == pytest.approx(logistic(-4.457 + 0.177 * change))
    assert found.partner_harm[0] == pytest.approx(logistic(-4.457 + 0.177 * parked_change - 0.431))
    assert (found.impact_area, found.partner_impact_area) == (("front",), ("rear",))


def test_the_outcome_table_tells_harm_angle_and_area(run, tmp_path):
    found, rows = collisions(run), outcome_table(run).to_pylist()
    assert rows[1]["harm"] == pytest.approx(found.harm[0])
    assert rows[1]["partner_harm"] == pytest.approx(found.partner_harm[0])
    assert rows[1]["impact_angle"] == pytest.approx(found.impact_angle[0])
    assert rows[1]["impact_area"] == "front"
    for row in (0, 2, 3):
        assert [rows[row][name] for name in ("harm", "partner_harm", "impact_angle", "impact_area")] == [None] * 4
    folder = save(run, tmp_path / "run")
    assert read_results(folder).outcomes.equals(outcome_table(run))


def test_a_pair_of_agents_counts_once_and_an_agent_that_hits_several_has_the_larger_harm(run):
    hit = ended(
        run,
        (1, "collision", 30, 2, False, 3.0),
        (2, "collision", 30, 1, False, 3.0),
        (3, "collision", 30, 2, False, 14.0),
        (4, "running", 39, -1, False, np.nan),
    )
    found = collisions(hit)
    pairs = list(zip(found.agent_id.tolist(), found.partner_id.tolist(), strict=True))
    assert pairs == [(1, 2), (2, 3)]
    per_agent = agent_harm(hit)
    assert per_agent.harm[1] == max(found.partner_harm[0], found.harm[1])
    assert per_agent.partner_harm[:3].tolist() == [found.partner_harm[0], found.harm[0], found.harm[1]]
    assert np.isnan(per_agent.harm[3])
    # The motorcycle is not protected, the car is against it only by its weight.
    assert found.partner_harm[1] == pytest.approx(logistic(-3.164 + 0.288 * found.partner_speed_change[1]))
    assert found.harm[1] == pytest.approx(logistic(-4.591 + 0.185 * found.speed_change[1]))


def test_the_edge_of_the_road_harms_by_the_impact_speed(run):
    found = collisions(ended(run, (1, "collision", 20, -1, True, 15.0)))
    assert found.harm[0] == pytest.approx(0.139915, abs=1e-6)
    assert found.partner_id[0] == -1
    assert np.isnan(found.partner_harm[0])
    assert (found.speed_change[0], found.impact_area[0]) == (15.0, "")
    per_agent = agent_harm(ended(run, (1, "collision", 20, -1, True, 15.0)))
    assert per_agent.harm[0] == found.harm[0]
    assert per_agent.impact_area == ("",)


def test_structures_and_pedestrians_are_partners_too(run):
    found = collisions(
        ended(run, (1, "collision", 20, 24, False, 13.0), (4, "collision", 20, 23, False, 8.0)), masses={24: 60.0}
    )
    assert found.partner_id.tolist() == [24, 23]
    assert found.partner_mass.tolist() == [60.0, np.inf]
    assert found.partner_harm[0] == pytest.approx(logistic(-3.164 + 0.288 * found.partner_speed_change[0]))
    assert np.isnan(found.partner_harm[1])
    assert found.speed_change[1] == pytest.approx(found.relative_speed[1])


def test_a_collision_at_the_first_step_has_an_angle(run):
    found = collisions(ended(run, (1, "collision", 0, 24, False, 13.0)))
    assert np.isfinite(found.impact_angle[0])


def test_a_run_without_collisions_has_no_rows(run):
    found = collisions(ended(run, (1, "goal_reached", 20, -1, False, np.nan)))
    assert len(found.agent_id) == 0
    assert found.impact_area == ()
