"""Drives every case and takes the times of its steps."""

from __future__ import annotations

import os
import platform
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.config.plugins import DEFAULT_PLANNER
from interdrive.config.schema import settings_of
from interdrive.config.specs import read_planner
from interdrive.errors import InputError
from interdrive.files import open_scenario
from interdrive.run import PHASES
from interdrive.simulation import Simulation
from interdrive.storage import Column, arrow_table, changed_settings
from interdrive.studies.runtime.cases import RuntimeCase

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from interdrive.config.schema import SettingsSpec, SimulationSettings
    from interdrive.config.specs import AgentChoice, PlannerSpec
    from interdrive.scenario import Scenario
    from interdrive.storage import ArrowTable

#: Columns of the table of all steps.
STEP_COLUMNS = (
    Column("kind", "label", "what the scenario shows"),
    Column("scenario", "label", "name of the scenario"),
    Column("predictor", "label", "name of the predictor"),
    Column("agents", "integer", "number of agents"),
    Column("participants", "integer", "agents and recorded vehicles present"),
    Column("threads", "integer", "threads that plan"),
    Column("repetition", "integer", "counted from 0"),
    Column("time_step", "integer", "of the scenario"),
    Column("driving", "integer", "agents that drive"),
    Column("step", "number", "the whole step", "s"),
    Column("observe", "number", "making the scene", "s"),
    Column("predict", "number", "prediction", "s"),
    Column("plan", "number", "planning of all agents, on all threads: the slowest batch", "s"),
    Column("collision", "number", "search for contacts and road departures", "s"),
    Column("update", "number", "all move, goals are judged, states are recorded", "s"),
    Column("python", "number", "what is not spent in the core, part of the phases", "s"),
)

#: The first step starts threads and grows memory; times of it are not counted.
_WARM_UP = 1


@dataclass(frozen=True)
class RuntimeStudy:
    """Times of steps.

    Attributes:
        steps: One row per step, as an Arrow table with `STEP_COLUMNS`.
        threads: The larger number of threads.
        machine: Processor, cores, load before the study, and software.
        settings: What was asked for.
        notes: One line per thing the user should know.
        inputs: SHA-256 of the scenarios, by name.
    """

    steps: ArrowTable
    threads: int
    machine: dict[str, Any]
    settings: dict[str, Any]
    notes: tuple[str, ...]
    inputs: Mapping[str, str] = field(default_factory=dict)


def runtime_study(
    cases: Sequence[RuntimeCase],
    *,
    steps: int = 50,
    repetitions: int = 3,
    threads: int | None = None,
    planner: PlannerSpec = DEFAULT_PLANNER,
    settings: SettingsSpec | None = None,
    on_run: Callable[[str, int, int], None] | None = None,
    notes: tuple[str, ...] = (),
) -> RuntimeStudy:
    """Drives every case with every number of agents, with one thread and with several, and takes times.

    Runs with one thread and with several take turns, so that both meet the same state of the machine.

    Args:
        cases: What to drive; see `runtime_cases`.
        steps: Time steps per run that count, at most.
        repetitions: Runs of each kind.
        threads: The larger number of threads; the number of cores otherwise.
        planner: Of all agents.
        settings: Settings; the defaults otherwise.
        on_run: Called before every run with what it is, how many runs are done, and how many there are.
        notes: Kept.

    Returns:
        All times.

    Raises:
        InputError: A scenario cannot be used, or a number is not positive.
    """
    for name, value in (("steps", steps), ("repetitions", repetitions)):
        if value < 1:
            raise InputError(f"{name} must be at least 1, not {value}")
    several, where = threads or os.cpu_count() or 1, machine()
    counts = sorted({1, several})
    columns: dict[str, list[Any]] = {column.name: [] for column in STEP_COLUMNS}
    # What cannot be driven is refused before anything is.
    own = settings_of(settings)
    driver = read_planner(planner, own.planner)
    jobs = []
    for case in cases:
        scenario = open_scenario(case.path, raw=own.recording.raw, start=own.recording.start)
        jobs += [(case, scenario, wanted) for wanted in _numbers(case, scenario, driver, own)]
    total = len(jobs) * repetitions * len(counts)
    done = 0
    for case, scenario, wanted in jobs:
        simulations = [
            Simulation(scenario, agents=wanted, planner=driver, predictor=case.predictor, settings=own, threads=n)
            for n in counts
        ]
        for repetition in range(repetitions):
            for simulation in simulations:
                if on_run is not None:
                    what = f"{scenario.name}, {wanted} agents, {simulation.threads} threads, {case.predictor}"
                    on_run(what, done, total)
                done += 1
                simulation.reset()
                _drive(simulation, steps, (case, scenario.name, repetition), columns)
    return RuntimeStudy(
        steps=arrow_table(STEP_COLUMNS, columns),
        threads=several,
        machine=where,
        settings={"steps": steps, "repetitions": repetitions, "planner": str(planner), **changed_settings(own)},
        notes=notes,
        inputs={scenario.name: scenario.sha256 for _, scenario, _ in jobs},
    )


def _numbers(case: RuntimeCase, scenario: Scenario, planner: AgentChoice, settings: SimulationSettings) -> list[int]:
    """The numbers of agents that the scenario has, ascending."""
    wanted = [n for n in case.counts if n is not None]
    most = len(Simulation(scenario, planner=planner, predictor=case.predictor, settings=settings, threads=1).agents)
    if wanted and min(wanted) < 1:
        raise InputError(f"the number of agents must be at least 1, not {min(wanted)}")
    if wanted and min(wanted) > most:
        raise InputError(f"{scenario.name}: {min(wanted)} agents requested, but only {most} vehicles can be agents")
    return sorted({n for n in wanted if n <= most} | ({most} if None in case.counts else set()))


def _drive(
    simulation: Simulation, steps: int, what: tuple[RuntimeCase, str, int], columns: dict[str, list[Any]]
) -> None:
    """Steps, and appends a row per step that counts."""
    case, scenario, repetition = what
    clock, world = time.perf_counter, simulation.world
    rows = []
    for _ in range(steps + _WARM_UP):
        if simulation.is_done:
            break
        driving, native, begin = len(simulation.driving), world.native_seconds, clock()
        simulation.step()
        seconds = clock() - begin
        rows.append((driving, seconds, seconds - (world.native_seconds - native)))
    run = simulation.record()
    phases = run.timings.seconds.reshape(-1, len(PHASES))
    present = np.count_nonzero(run.states.valid, axis=0)
    for index, (driving, seconds, python) in enumerate(rows[_WARM_UP:], start=_WARM_UP):
        spent = dict(zip(PHASES, phases[index].tolist(), strict=True))
        values = {
            "kind": case.kind,
            "scenario": scenario,
            "predictor": case.predictor,
            "agents": len(simulation.agents),
            "participants": int(present[index]),
            "threads": simulation.threads,
            "repetition": repetition,
            "time_step": int(run.timings.time_step[index * len(PHASES)]),
            "driving": driving,
            "step": seconds,
            "observe": spent["observe"],
            "predict": spent["predict"],
            "plan": spent["plan"] + spent["plan_python"],
            "collision": spent["collision"],
            "update": spent["advance"],
            "python": max(0.0, python),
        }
        for name, value in values.items():
            columns[name].append(value)


def machine() -> dict[str, Any]:
    """Processor, cores, system, Python, and how many programs wanted to run just now."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "load": os.getloadavg()[0],
        "system": f"{platform.system()} {platform.release()}",
        "python": platform.python_version(),
    }


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:  # noqa: PTH123 - no file of ours
            return next(line.split(":", 1)[1].strip() for line in file if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()
