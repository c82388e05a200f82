"""Solutions against the official drivability checker, its cost functions, vehicle parameters and schema."""

from __future__ import annotations

import os
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from commonroad.common.file_reader import CommonRoadFileReader
from commonroad.common.solution import CommonRoadSolutionReader
from commonroad_dc.costs.evaluation import CostFunctionEvaluator, PartialCostFunction
from lxml import etree
from scipy.integrate import simpson
from vehiclemodels.parameters_vehicle1 import parameters_vehicle1
from vehiclemodels.parameters_vehicle2 import parameters_vehicle2
from vehiclemodels.parameters_vehicle3 import parameters_vehicle3
from vehiclemodels.parameters_vehicle4 import parameters_vehicle4

import interdrive as idr
from interdrive import _core
from interdrive.files.solution_check import check_solution
from interdrive.run import RunRecord

#: Solutions that a check refuses, with the name of the check: docs/research/scores.md explains every one.
REFUSED = dict.fromkeys(("DEU_Muc-12_1_T-1", "DEU_Muc-13_1_T-1", "DEU_Muc-28_1_T-1"), "road")

#: Files with few vehicles, on which other models and vehicle types are tried. Trucks (type 4) overlap the edge of their
#: lanelets in DEU_A9-1_1_T-1 and ZAM_Tjunction-1_27_T-1, as `road.judge=wheels` allows: docs/research/scores.md.
FEW = ("DEU_Moelln-10_2_T-1", "USA_US101-15_2_T-1", "ZAM_Tjunction-1_102_T-1", "ZAM_Tjunction-1_1_T-1")

PARAMETERS = (parameters_vehicle1, parameters_vehicle2, parameters_vehicle3, parameters_vehicle4)


@dataclass(frozen=True)
class Solved:
    path: Path
    run: RunRecord
    document: bytes


def solved(path, settings=None, **options):
    """How the default planner drives all problems of a file, if there are any and all are solved."""
    try:
        run = idr.simulate(path, agents="problems", settings=settings)
        return Solved(path, run, idr.write_solution(run, **options))
    except idr.InputError:
        return None


@pytest.fixture(scope="module")
def solutions(scenarios_folder):
    step = 1 if os.environ.get("INTERDRIVE_ORACLES") == "all" else 2
    found = [solved(path) for path in sorted(scenarios_folder.rglob("*.xml"))[::step]]
    return [one for one in found if one is not None]


def test_the_official_checks_admit_solved_problems(solutions, measured):
    assert find_spec("triangle"), "the check of the road needs the package triangle"
    found = {one.path.stem: check_solution(one.document, one.path) for one in solutions}
    refused = {
        name: next(check for check, why in one.checks.items() if why) for name, one in found.items() if not one.is_valid
    }
    wrong = [(name, check, found[name].checks[check]) for name, check in refused.items() if REFUSED.get(name) != check]
    wrong += [(name, "is valid now") for name in REFUSED.keys() & found.keys() - refused.keys()]
    assert len(refused) <= 0.06 * len(found)
    assert np.isfinite([one.costs for one in found.values()]).all()
    remark = f"refused: {', '.join(refused) or 'none'}"
    measured("solutions, seven official checks", len(found), len(wrong), 0, "files", remark, wrong)


def test_documents_follow_the_schema(solutions, measured):
    import commonroad.scenario_definition

    folder = Path(next(iter(commonroad.scenario_definition.__path__))) / "xml_definition_files"
    schema = etree.XMLSchema(etree.parse(folder / "CommonRoadSolution_schema.xsd"))
    documents = [one.document for one in solutions]
    for model, cost in (("ST", "SM1"), ("PM", "WX1")):
        documents += [idr.write_solution(one.run, model=model, cost=cost) for one in solutions[:3]]
    wrong = [str(schema.error_log) for document in documents if not schema.validate(etree.fromstring(document))]
    measured("documents that the schema refuses", len(documents), len(wrong), 0, "files", cases=wrong)


@pytest.mark.filterwarnings("ignore:The 'resolution' argument is deprecated:DeprecationWarning")  # in the checker
def test_official_costs_are_those_of_the_drives(solutions, measured):
    """Accelerations, steering angles and their rates from the states of the run, not from the document."""
    largest, n = 0.0, 0
    for one in solutions:
        scenario, problems = CommonRoadFileReader(str(one.path)).open()
        solution = CommonRoadSolutionReader.fromstring(one.document.decode())
        costs = CostFunctionEvaluator.init_from_solution(solution).evaluate_solution(scenario, problems, solution)
        for problem, agent in zip(one.run.scenario.planning_problems, one.run.agents, strict=True):
            official = costs.pp_results[problem.id].partial_costs
            for name, value in costs_of(one.run, agent, scenario.dt).items():
                n += 1
                largest = max(largest, abs(official[name] - value) / max(1.0, abs(value)))
    measured("official costs of acceleration and steering", n, largest, 1e-6, "")


def costs_of(run, agent, dt):
    states = run.states
    row = int(np.searchsorted(states.participant_id, agent.id))
    columns = np.flatnonzero(states.valid[row])
    velocity, yaw_rate = states.velocity[row, columns], states.yaw_rate[row, columns]
    found = {PartialCostFunction.A: simpson((np.diff(velocity) / dt) ** 2, dx=dt)}
    if (np.abs(velocity) > 0.1).all() and np.isfinite(yaw_rate).all():
        steering = np.arctan(yaw_rate * _core.Vehicle.of_type(2).wheelbase / velocity)
        found[PartialCostFunction.SA] = simpson(steering**2, dx=dt)
        found[PartialCostFunction.SR] = simpson((np.diff(steering) / dt) ** 2, dx=dt)
    return found


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_vehicle_types_have_the_published_parameters(number):
    ours, theirs = _core.Vehicle.of_type(number), PARAMETERS[number - 1]()
    assert (ours.length, ours.width) == (theirs.l, theirs.w)
    assert ours.wheelbase == pytest.approx(theirs.a + theirs.b, rel=1e-9)
    assert ours.rear_axle_to_center == pytest.approx(theirs.b, rel=1e-9)
    assert (ours.steering_angle_max, ours.steering_rate_max) == (theirs.steering.max, theirs.steering.v_max)
    limits = theirs.longitudinal
    assert (ours.velocity_max, ours.velocity_switch, ours.acceleration_max) == (
        limits.v_max,
        limits.v_switch,
        limits.a_max,
    )


@pytest.mark.parametrize("number", [1, 3, 4])
def test_drives_of_other_vehicle_types_are_feasible(scenarios_folder, number, measured):
    wrong, n = [], 0
    for name in FEW:
        one = solved(next(scenarios_folder.rglob(f"{name}.xml")), {"agents.vehicle_type": number})
        if one is None:
            continue
        n += 1
        checks = check_solution(one.document, one.path).checks
        wrong += [(name, check, why) for check, why in checks.items() if why]
    measured(f"solutions of vehicle type {number}, official checks", n, len(wrong), 0, "files", cases=wrong)


def test_point_masses_are_feasible(solutions, measured):
    few = [one for one in solutions if one.path.stem in FEW]
    found = {
        one.path.stem: check_solution(idr.write_solution(one.run, cost="WX1", model="PM"), one.path).checks
        for one in few
    }
    wrong = [(name, check, why) for name, checks in found.items() for check, why in checks.items() if why]
    measured("solutions as a point mass, official checks", len(found), len(wrong), 0, "files", cases=wrong)
