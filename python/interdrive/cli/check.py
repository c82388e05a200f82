"""`interdrive check`: contents of scenario files."""

from __future__ import annotations

import click

from interdrive.cli.arguments import assigned, raw_option, source_option
from interdrive.cli.terminal import say
from interdrive.errors import InputError, InterdriveError


@click.command()
@click.argument("files", nargs=-1, required=True, metavar="FILE...")
@raw_option
@source_option
def check(files: tuple[str, ...], raw: bool, source: tuple[str, ...]) -> int:
    """Inspect scenario files: size, traffic, possible agents, and why other vehicles cannot be agents.

    If `run` would refuse a FILE, one line on stderr gives the reason; the other files are still printed.
    """
    from interdrive.cli.report import print_inspection  # noqa: PLC0415
    from interdrive.config.schema import settings_of  # noqa: PLC0415
    from interdrive.files import open_scenario, scenario_file  # noqa: PLC0415
    from interdrive.scenario.agents import possible_agents  # noqa: PLC0415
    from interdrive.scenario.inspection import inspect, junctions  # noqa: PLC0415
    from interdrive.scenario.native import core_road, core_scenario  # noqa: PLC0415

    refused = False
    settings = settings_of(assigned((), raw=raw, source=source))
    for name in files:
        try:
            path = scenario_file(name)
            scenario = open_scenario(path, raw=raw, source=settings.source)
            road = core_road(scenario, settings.road)
            handle = core_scenario(scenario, road)
            able, refused_by_id = possible_agents(
                scenario,
                road,
                agent_settings=settings.agents,
                goal_settings=settings.goal,
                max_steps=settings.step.steps_at_most(scenario),
            )
            print_inspection(inspect(scenario), junctions(handle.junctions()), refused_by_id)
            if not scenario.planning_problems and scenario.obstacles.is_static.all():
                say(f"no traffic: {path} holds a map alone; it can be run once it has vehicles or planning problems")
            elif not able:
                raise InputError(f"{path}: no vehicle can become an agent, so there is nothing to run")
        except InterdriveError as error:
            say(f"error: {' '.join(str(error).split())}", err=True)
            refused = True
    return 2 if refused else 0
