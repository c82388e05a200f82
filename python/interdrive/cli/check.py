"""`interdrive check`: what scenario files hold."""

from __future__ import annotations

import click

from interdrive.cli.terminal import say
from interdrive.errors import InterdriveError


@click.command()
@click.argument("files", nargs=-1, required=True, metavar="FILE...")
def check(files: tuple[str, ...]) -> int:
    """Print what scenario files hold: size, traffic, and who can become an agent or why not.

    A FILE that cannot be used gets one line on stderr; the others are printed all the same.
    """
    from interdrive.agents import AgentSettings, GoalSettings, refusals  # noqa: PLC0415
    from interdrive.check import inspect  # noqa: PLC0415
    from interdrive.cli.report import print_inspection  # noqa: PLC0415
    from interdrive.files import read_scenario, shipped_scenario, shipped_scenarios  # noqa: PLC0415
    from interdrive.handles import core_road  # noqa: PLC0415
    from interdrive.run_settings import RoadSettings  # noqa: PLC0415

    refused = False
    for name in files:
        try:
            path = shipped_scenario(name) if name in shipped_scenarios() else name
            scenario = read_scenario(path)
            road = core_road(scenario, RoadSettings().gap_tolerance, RoadSettings().open_end_length)
            refused_by_id = refusals(scenario, road, agent_settings=AgentSettings(), goal_settings=GoalSettings())
            print_inspection(inspect(scenario), refused_by_id)
        except InterdriveError as error:
            say(f"error: {' '.join(str(error).split())}", err=True)
            refused = True
    return 2 if refused else 0
