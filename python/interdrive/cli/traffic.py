"""`interdrive traffic`: generated traffic as a scenario file."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import click

from interdrive.cli.arguments import assigned, shown, source_option
from interdrive.cli.terminal import say
from interdrive.errors import InputError

if TYPE_CHECKING:
    from interdrive.runs import Run
    from interdrive.scenario import GoalState

#: Planning problems have as much time as their vehicle took, and this share more, or at least this time more [s].
_RESERVE_SHARE, _RESERVE = 0.15, 2.0


@click.command()
@click.argument("map_file", metavar="MAP")
@click.option("--rate", metavar="N", help="Vehicles per hour that want to enter by every lane (traffic.rate).")
@click.option("--density", metavar="N", help="Vehicles per km and lane at the beginning (traffic.density).")
@click.option("--duration", metavar="S", help="Length of the file [s] (60).")
@click.option("--planner", metavar="PLANNER[:SHARE+...]", help="Who drives them: a planner or a mix (rollout).")
@click.option("--egos", metavar="N", type=click.IntRange(min=0), default=0, help="Vehicles left out as problems (0).")
@click.option("--seed", metavar="N", type=click.IntRange(min=0), default=0, help="Seed of the traffic (0).")
@click.option(
    "--set", "assignments", metavar="NAME=VALUE", multiple=True, help="A setting; `interdrive settings` lists them."
)
@source_option
@click.option("--threads", metavar="N", type=click.IntRange(min=1), help="Number of planning threads (all cores).")
@click.option("--out", metavar="FILE.xml", required=True, help="The CommonRoad file to write.")
@click.option("--overwrite", is_flag=True, help="Replace a file that exists.")
@click.option("--quiet", is_flag=True, help="Print only errors.")
def traffic(
    map_file: str,
    rate: str | None,
    density: str | None,
    duration: str | None,
    planner: str | None,
    egos: int,
    seed: int,
    assignments: tuple[str, ...],
    source: tuple[str, ...],
    threads: int | None,
    out: str,
    overwrite: bool,
    quiet: bool,
) -> None:
    """Fill a map with generated traffic, and write it as a scenario with recorded vehicles.

    MAP is a CommonRoad file, the name of a shipped scenario, or a map of another tool; its own vehicles and planning
    problems are left out. With --egos N, vehicles that cross the map are planning problems instead: they start where
    and when these entered, and have to leave by the same lane, in the time that these took and 15 % (at least 2 s).
    """
    from interdrive.cli.report import progress  # noqa: PLC0415 - rich
    from interdrive.cli.traffic_report import print_flows  # noqa: PLC0415
    from interdrive.config.binding import bind  # noqa: PLC0415
    from interdrive.config.schema import settings_of  # noqa: PLC0415
    from interdrive.files import run_document, scenario_file  # noqa: PLC0415
    from interdrive.run.flows import lane_flows  # noqa: PLC0415
    from interdrive.simulation import Simulation  # noqa: PLC0415
    from interdrive.storage import keep_inputs, replacing, resolved  # noqa: PLC0415

    target = resolved(out)
    if target.suffix.lower() != ".xml" or target.is_dir():
        raise InputError(f"--out {out}: name a file that ends in .xml")
    if target.exists() and not overwrite:
        raise InputError(f"--out {out}: exists already; name another file, or add --overwrite")
    path = scenario_file(map_file)
    keep_inputs(target, (path,))
    given = {"rate": rate, "density": density, "duration": duration, "planner": planner}
    values = {f"traffic.{name}": value for name, value in given.items() if value is not None}
    settings = bind(settings_of(assigned(assignments, source=source)), values)
    if not settings.traffic.is_on:
        raise InputError("traffic: there is none; give --rate or --density")
    with progress(quiet=quiet) as report:
        report.say(f"reading {map_file}")
        simulation = Simulation(
            map_file, agents=0, settings=settings, seed=seed, threads=threads, on_setup=report.setup
        )
        last = round(settings.traffic.duration / simulation.scenario.dt)
        while not simulation.is_done and simulation.time_step < last:
            simulation.step()
            report.step(simulation.time_step, len(simulation.driving), len(simulation.agents), last)
        run = simulation.record()
        left_out = _as_problems(run, egos)
        document = run_document(left_out)
        report.say("writing")
        with replacing(target) as partial:
            partial.write_bytes(document)
    if quiet:
        return
    print_flows(lane_flows(run))
    ids = [problem.id for problem in left_out.scenario.planning_problems]
    if ids:
        say(f"planning problems: {', '.join(map(str, ids))}")
    say(f"{shown(target)}: interdrive run {shown(target)}{' --agents problems' if ids else ''}")


def _as_problems(run: Run, n: int) -> Run:
    """The run with planning problems in the place of vehicles that have crossed the map, spread over its time."""
    from interdrive.scenario import InitialState, PlanningProblem  # noqa: PLC0415

    if not n or run.demand is None:
        return run
    demand = run.demand
    able = [i for i, due in enumerate(demand.due.tolist()) if due == due and demand.left[i] == demand.left[i]]  # noqa: PLR0124 - nan
    if len(able) < n:
        raise InputError(f"--egos {n}: only {len(able)} vehicles have entered and left within traffic.duration")
    states, valid, problems = run.states, run.states.valid.copy(), []
    agents = {agent.id: agent for agent in run.agents}
    for place in range(n):
        number = int(demand.agent_id[able[place * len(able) // n]])
        row = int(states.participant_id.searchsorted(number))
        column = int(valid[row].argmax())
        at = (
            getattr(states, name)[row, column]
            for name in ("x", "y", "orientation", "velocity", "acceleration", "yaw_rate")
        )
        start = InitialState(states.first_time_step + column, *map(float, at))
        left = float(demand.left[able[place * len(able) // n]])
        goal = tuple(_in_time(state, start.time_step, left, run.scenario.dt) for state in agents[number].goal)
        problems.append(PlanningProblem(id=number, initial_state=start, goal=goal))
        valid[row] = False
    scenario = replace(run.scenario, planning_problems=tuple(problems))
    return replace(run, scenario=scenario, states=replace(states, valid=valid))


def _in_time(goal: GoalState, first: int, left: float, dt: float) -> GoalState:
    """The goal with a window from the start on that ends shortly after the vehicle itself was there.

    Planners that drive no faster than their goal asks for would crawl in the window of generated vehicles, which only
    says when they have got stuck.
    """
    drive = left - first * dt
    last = first + math.ceil((drive + max(_RESERVE, _RESERVE_SHARE * drive)) / dt)
    return replace(goal, time_step=(first + 1, max(first + 1, last)))
