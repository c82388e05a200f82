"""The score among vehicles that react owes nothing to the recording of the agent: a planning problem gets the same."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

import interdrive as idr
from interdrive.files import read_scenario
from interdrive.scenario import PlanningProblem
from interdrive.simulation import Simulation

#: A planning problem drives a vehicle of this type, whether it has a recording or not.
SETTINGS = {"agents.vehicle_type": 2}
AGENTS = [
    *(("t_junction", number) for number in (1001, 1002, 1003, 1004, 1005, 1006, 1007)),
    *(("lane_merge", number) for number in (1001, 1002, 1003, 1004, 1005, 1006)),
]


def without_rows(obstacles, number):
    """The recordings but for one vehicle."""
    kept = np.flatnonzero(obstacles.ids != number)
    values = {}
    for item in fields(obstacles):
        value = getattr(obstacles, item.name)
        if len(value) != len(obstacles.ids):
            continue
        values[item.name] = value[kept] if isinstance(value, np.ndarray) else tuple(value[k] for k in kept.tolist())
    return replace(obstacles, **values)


def scored(scenario, number):
    others = [one.id for one in Simulation(scenario, agents="all", settings=SETTINGS, threads=1).agents]
    run = idr.simulate(
        scenario,
        agents=[number, *(other for other in others if other != number)],
        planner={number: "idm", "default": "idm"},
        predictor="constant_velocity",
        settings=SETTINGS,
        threads=1,
    )
    return idr.score(run, [number], panel=("lawful", "idm")), run


@pytest.mark.long
@pytest.mark.parametrize(("name", "number"), AGENTS)
def test_a_planning_problem_gets_what_a_recorded_vehicle_gets(name, number):
    recorded = read_scenario(idr.shipped_scenario(name))
    agent = next(one for one in Simulation(recorded, agents=[number], threads=1).agents if one.id == number)
    problems = (PlanningProblem(number, agent.initial_state, agent.goal),)
    twin = replace(recorded, planning_problems=problems)
    alone = replace(twin, obstacles=without_rows(recorded.obstacles, number))
    (with_it, driven), (without, again) = scored(twin, number), scored(alone, number)
    assert driven.digest == again.digest, "the recording decides nothing"
    assert with_it.score.tobytes() == without.score.tobytes()
    differ = {key for key in with_it.terms if with_it.terms[key].tobytes() != without.terms[key].tobytes()}
    assert not differ
    assert with_it.reasons == without.reasons
