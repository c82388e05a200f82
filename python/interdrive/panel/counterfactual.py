"""The same run, bit for bit, up to a moment, and then with a reference driver in the place of one agent."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from interdrive.config.agent_config import modules_named
from interdrive.config.binding import bind
from interdrive.config.schema import SimulationSettings
from interdrive.errors import InputError
from interdrive.reference_drivers import DRIVERS
from interdrive.run.goals import said_seconds
from interdrive.scoring import preventability
from interdrive.scoring.preventability import AFTERWARDS
from interdrive.simulation import Simulation

if TYPE_CHECKING:
    from collections.abc import Mapping

    from interdrive.runs import Run


def counterfactual(
    run: Run,
    agent_id: int,
    driver: str = "cc",
    *,
    at: int | None = None,
    until: int | None = None,
    trust: bool = False,
    threads: int | None = None,
) -> Run:
    """Repeats a run up to a time step, and goes on with a reference driver in the place of an agent.

    Unlike in `interdrive.scoring.preventability`, the driver sees danger by itself, and others react to what it does.

    Args:
        run: The run; its scenario is the simulated one.
        agent_id: The agent.
        driver: One of `interdrive.reference_drivers.DRIVERS`.
        at: Time step from which the driver plans; None: that at which the partner of the agent's collision came into
            its way.
        until: Time step at which it ends if agents still drive then; None: 3 s after the agent's collision, which is as
            long as `preventability` looks, or with `at` when all agents have ended.
        trust: Import planners and predictors that the run names as module:object.
        threads: Number of planning threads; None: the number of cores. Results do not depend on it.

    Returns:
        The new run; its records name the planner with which the agent began, a note says who took over when, and it is
        not repeatable (`verify`).

    Raises:
        InputError: There is no such agent or driver, it has no collision to start from, `at` is not a time step of the
            run or not before `until`, or the run does not say how to repeat it.
    """
    if driver not in DRIVERS:
        raise InputError(f"there is no reference driver {driver}; there are {', '.join(DRIVERS)}")
    start, end = _watched(run, agent_id) if at is None else (at, None)
    end = end if until is None else until
    if end is not None and end <= start:
        raise InputError(f"counterfactual: until must be after time step {start}, is {end}")
    if agent_id not in run.outcomes.agent_id.tolist():
        raise InputError(f"counterfactual: {agent_id} is not an agent of this run")
    wanted: Mapping[str, Any] = run.settings
    if not wanted.get("repeatable", True):
        raise InputError("counterfactual: the run had a Python object as planner, which nothing can repeat")
    code = modules_named(wanted["planner"], wanted["predictor"])
    if code and not trust:
        raise InputError(f"counterfactual: repeating this run imports code outside interdrive ({', '.join(code)})")
    simulation = Simulation(
        run.scenario,
        agents=wanted["agents"],
        planner=wanted["planner"],
        predictor=wanted["predictor"],
        views=wanted.get("views", {}),
        rules=wanted.get("rules", {}),
        v2x=wanted.get("v2x", {}),
        settings=bind(SimulationSettings(), wanted["settings"]),
        seed=wanted["seed"],
        threads=threads,
    )
    while simulation.time_step < start and not simulation.is_done:
        simulation.step()
    if simulation.time_step != start:
        raise InputError(f"counterfactual: time step {start} is not one of the run")
    simulation.world.replace_driver(agent_id, driver)
    while not simulation.is_done and (end is None or simulation.time_step < end):
        simulation.step()
    found, dt = simulation.record(), run.scenario.dt
    said = f"from {said_seconds(start, dt)} s on the reference driver {driver} drives agent {agent_id}"
    if not found.finished:
        said += f"; the run was watched until {said_seconds(simulation.time_step, dt)} s"
    # No settings name a driver that takes over, so nothing could repeat the run.
    return replace(found, notes=(said, *found.notes), settings={**found.settings, "repeatable": False})


def _watched(run: Run, agent_id: int) -> tuple[int, int]:
    """Time steps at which a driver takes over, and until which a contact counts as that of the agent's collision."""
    found = preventability(run, [agent_id])
    if "collision" not in found.kind:
        raise InputError(
            f"counterfactual: agent {agent_id} has no collision with another participant; give a time step"
        )
    row = found.kind.index("collision")
    return int(found.from_time_step[row]), int(found.time_step[row]) + math.ceil(AFTERWARDS / run.scenario.dt - 1e-9)
