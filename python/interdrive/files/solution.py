"""CommonRoad solutions: drives of planning problems as a document for the official checker and site."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

from interdrive import _core
from interdrive.errors import InputError
from interdrive.files.content import content_of_file
from interdrive.files.document import parse

if TYPE_CHECKING:
    from datetime import datetime

    from interdrive.array_types import Floats
    from interdrive.run import AgentRecord, RunRecord
    from interdrive.scenario import PlanningProblem

#: Vehicle models, with the names of their trajectories and states.
MODELS = {"KS": ("ksTrajectory", "ksState"), "ST": ("stTrajectory", "stState"), "PM": ("pmTrajectory", "pmState")}

#: Cost functions of the benchmark site.
COSTS = ("JB1", "SA1", "WX1", "SM1", "SM2", "SM3", "MW1", "TR1")

#: Those that the site computes for a point mass.
_POINT_MASS_COSTS = ("JB1", "WX1", "MW1")

#: Footprints and starts that differ by less are the same [m].
_SAME = 1e-3

_BENCHMARK_ID = re.compile(r"(C-)?[A-Z]{3}_[A-Za-z0-9]+-\d+(_\d+)*(_[TSPI](-\d+)+)?")


#: Vehicle types by number; `Vehicle.of_type` of the core has their sizes and limits.
VEHICLES = {1: "Ford Escort", 2: "BMW 320i", 3: "VW Vanagon", 4: "truck"}


def write_solution(
    run: RunRecord,
    cost: str = "SM1",
    model: str = "KS",
    vehicle: int | None = None,
    *,
    date: datetime | None = None,
    processor: str | None = None,
) -> bytes:
    """The drives of all planning problems of a scenario as a CommonRoad solution.

    Every drive ends with the first state that meets its goal in its time. Positions are centres of footprints.

    Args:
        run: A run whose agents are all planning problems of its scenario (`agents="problems"`), all solved.
        cost: Cost function, one of `COSTS`.
        model: Vehicle model: "KS" (kinematic single-track), "ST" (single-track) or "PM" (point mass).
        vehicle: Vehicle type, 1 to 4; None: the driven type (setting `agents.vehicle_type`).
        date: Date of the computation, without fractions of seconds; None: left out.
        processor: Name of the processor of the computation; None: left out.

    Returns:
        The document. Equal runs give equal bytes.

    Raises:
        InputError: An unknown cost function, model or vehicle type; agents that are not planning problems or drove
            another vehicle; a problem without agent or not solved; a benchmark id that solutions cannot name; headings
            that were turned when the file was read; a run that begins later than its file.
    """
    if cost not in COSTS:
        raise InputError(f"cost {cost!r}: expected one of {', '.join(COSTS)}")
    if model not in MODELS:
        raise InputError(f"model {model!r}: expected one of {', '.join(MODELS)}")
    if model == "PM" and cost not in _POINT_MASS_COSTS:
        raise InputError(f"cost {cost}: a point mass can have {', '.join(_POINT_MASS_COSTS)}")
    if vehicle is not None and vehicle not in VEHICLES:
        raise InputError(f"vehicle {vehicle}: expected a number from 1 to 4")
    scenario = run.scenario
    if not _BENCHMARK_ID.fullmatch(scenario.benchmark_id):
        raise InputError(f"{scenario.name}: benchmark id {scenario.benchmark_id!r} is none that a solution can name")
    if scenario.start:
        raise InputError(
            f"{scenario.name}: the run begins at time step {scenario.start}, so its times are not those of the problems"
        )
    if scenario.turned:
        raise InputError(
            f"{scenario.name}: its headings were turned when it was read, so drives do not start as its problems say; "
            "run it with --raw (recording.raw)"
        )
    drives = _drives(run)
    driven = [_driven_type(run, agent, vehicle) for _, agent in drives]
    names = [f"{model}{number}" for number in driven], [cost] * len(drives)
    listed = [one[0] if len(one) == 1 else f"[{','.join(one)}]" for one in names]
    benchmark_id = ":".join((*listed, scenario.benchmark_id, _version(run)))
    seconds = float(
        np.sum([s for s, phase in zip(run.timings.seconds, run.timings.phase, strict=True) if "plan" in phase])
    )
    about = {"benchmark_id": benchmark_id, "computation_time": repr(seconds)}
    if date is not None:
        about["date"] = date.strftime("%Y-%m-%dT%H:%M:%S")
    if processor is not None:
        about["processor_name"] = processor
    from xml.sax.saxutils import quoteattr  # noqa: PLC0415 - loads what reads from the network

    lines = ["<?xml version='1.0' encoding='utf-8'?>"]
    lines.append(f"<CommonRoadSolution {' '.join(f'{name}={quoteattr(value)}' for name, value in about.items())}>")
    for (problem, agent), number in zip(drives, driven, strict=True):
        lines += _trajectory(run, problem, agent, model, _core.Vehicle.of_type(number))
    lines.append("</CommonRoadSolution>")
    return ("\n".join(lines) + "\n").encode()


def _drives(run: RunRecord) -> list[tuple[PlanningProblem, AgentRecord]]:
    """Every planning problem with its agent.

    Raises:
        InputError: One has none, or did not reach its goal, or there are other agents.
    """
    name = run.scenario.name
    others = [agent.id for agent in run.agents if agent.origin != "planning problem"]
    if others:
        raise InputError(
            f"{name}: agent {others[0]} is no planning problem; drive the problems alone: --agents problems"
        )
    found = []
    for problem in run.scenario.planning_problems:
        agent = next((agent for agent in run.agents if _starts_at(run, agent, problem)), None)
        if agent is None:
            raise InputError(f"{name}: planning problem {problem.id} was not driven; a solution needs all of them")
        place = int(np.searchsorted(run.outcomes.agent_id, agent.id))
        if run.outcomes.outcome[place] != "goal_reached":
            outcome, reason = run.outcomes.outcome[place], run.outcomes.reason[place]
            raise InputError(f"{name}: planning problem {problem.id} is not solved: {outcome}, {reason}")
        found.append((problem, agent))
    if not found:
        raise InputError(f"{name}: the scenario has no planning problem")
    return found


def _driven_type(run: RunRecord, agent: AgentRecord, wanted: int | None) -> int:
    """The vehicle type whose footprint an agent had.

    Raises:
        InputError: It is not a vehicle type, or not the requested one.
    """
    states = run.states
    row = int(np.searchsorted(states.participant_id, agent.id))
    size = float(states.length[row]), float(states.width[row])
    about = f"{run.scenario.name}: agent {agent.id} drove a vehicle of {size[0]:g} m by {size[1]:g} m"
    for number, name in VEHICLES.items():
        of_type = _core.Vehicle.of_type(number)
        if abs(size[0] - of_type.length) <= _SAME and abs(size[1] - of_type.width) <= _SAME:
            if wanted not in (None, number):
                raise InputError(f"{about}, type {number} ({name}), not type {wanted}")
            return number
    raise InputError(f"{about}, which is no vehicle type of CommonRoad; drive one: --set agents.vehicle_type=2")


def _starts_at(run: RunRecord, agent: AgentRecord, problem: PlanningProblem) -> bool:
    states, start = run.states, problem.initial_state
    row, column = int(np.searchsorted(states.participant_id, agent.id)), start.time_step - states.first_time_step
    if agent.start_time_step != start.time_step or not 0 <= column < states.n_steps:
        return False
    return bool(np.hypot(states.x[row, column] - start.x, states.y[row, column] - start.y) < _SAME)


def _version(run: RunRecord) -> str:
    """The version of the format of the scenario's file."""
    path = run.scenario.path
    if path is None or path.suffix != ".xml":
        return "2020a"
    found = re.search(rb"commonRoadVersion\s*=\s*[\"'](\w+)[\"']", content_of_file(path)[:4096])
    return found[1].decode() if found else "2020a"


def _trajectory(
    run: RunRecord, problem: PlanningProblem, agent: AgentRecord, model: str, vehicle: _core.Vehicle
) -> list[str]:
    states = run.states
    row = int(np.searchsorted(states.participant_id, agent.id))
    columns = np.flatnonzero(states.valid[row])
    x, y, velocity, yaw_rate = (getattr(states, n)[row, columns] for n in ("x", "y", "velocity", "yaw_rate"))
    stated = stated_headings(run).get(problem.id, problem.initial_state.orientation)
    heading = np.unwrap(states.orientation[row, columns])
    heading = heading + 2.0 * np.pi * np.round((stated - heading[0]) / (2.0 * np.pi))
    time = columns + states.first_time_step
    steering = steering_angles(velocity, yaw_rate, vehicle.wheelbase)
    # The states of these models are those of the centre, which moves aside in a turn; ours are those of the rear axle.
    slip = np.arctan(vehicle.rear_axle_to_center * np.tan(steering) / vehicle.wheelbase)
    if model == "PM":
        speed, direction = velocity / np.cos(slip), heading + slip
        fields = {"xVelocity": speed * np.cos(direction), "yVelocity": speed * np.sin(direction)}
    else:
        fields = {"steeringAngle": steering, "velocity": velocity, "orientation": heading}
    if model == "ST":
        turning = velocity * np.tan(steering) / vehicle.wheelbase
        fields |= {"velocity": velocity / np.cos(slip), "yawRate": turning, "slipAngle": slip}
    outer, inner = MODELS[model]
    lines = [f'  <{outer} planningProblem="{problem.id}">']
    for k, step in enumerate(time.tolist()):
        lines.append(f"    <{inner}>")
        lines += [f"      <{n}>{float(v[k])!r}</{n}>" for n, v in {"x": x, "y": y, **fields}.items()]
        lines += [f"      <time>{step}</time>", f"    </{inner}>"]
    lines.append(f"  </{outer}>")
    return lines


def stated_headings(run: RunRecord) -> dict[int, float]:
    """Headings at the start as the file states them, by planning problem, where it is XML [rad].

    A scenario has them within half a turn; the official check compares numbers, whatever turns are in them.
    """
    path = run.scenario.path
    if path is None or path.suffix != ".xml":
        return {}
    found = {}
    for problem in parse(content_of_file(path), str(path)).iter("planningProblem"):
        exact = problem.find("initialState/orientation/exact")
        if exact is not None and exact.text is not None:
            found[int(problem.attrib["id"])] = float(exact.text)
    return found


def steering_angles(velocity: Floats, yaw_rate: Floats, wheelbase: float) -> Floats:
    """Steering angles of a kinematic single-track model [rad]; interpolated where it hardly moves.

    Args:
        velocity: Of the rear axle [m/s], shape (states,).
        yaw_rate: [rad/s]; nan where it is not known.
        wheelbase: [m].
    """
    known = (np.abs(velocity) > _core.CREEPING_SPEED) & np.isfinite(yaw_rate)
    if not known.any():
        return np.zeros(len(velocity))
    steps = np.arange(len(velocity))
    angles = np.arctan(yaw_rate[known] * wheelbase / velocity[known])
    found: Floats = np.interp(steps, steps[known], angles)
    return found
