"""`interdrive check`: contents of scenario files."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import click

from interdrive.cli.arguments import assigned, raw_option, shown, source_option
from interdrive.cli.terminal import say
from interdrive.errors import InputError, InterdriveError

if TYPE_CHECKING:
    from interdrive.scenario import Scenario


@click.command()
@click.argument("files", nargs=-1, required=True, metavar="FILE...")
@click.option("--png", metavar="FILE", help="Also draw the map with the ids of its lanelets to this .png file.")
@click.option("--box", metavar="X1,Y1,X2,Y2", help="With --png: the part of the map to draw [m].")
@raw_option
@source_option
def check(files: tuple[str, ...], png: str | None, box: str | None, raw: bool, source: tuple[str, ...]) -> int:
    """Inspect scenario files: size, traffic, possible agents, and why other vehicles cannot be agents.

    With --png FILE the map is drawn with the ids of its lanelets and planning problems, x to the right; --box crops it.
    If `run` would refuse a FILE, one line on stderr gives the reason; the other files are still printed.
    """
    from interdrive.cli.report import print_inspection  # noqa: PLC0415
    from interdrive.config.schema import settings_of  # noqa: PLC0415
    from interdrive.files import open_scenario, scenario_file  # noqa: PLC0415
    from interdrive.scenario.agents import possible_agents  # noqa: PLC0415
    from interdrive.scenario.inspection import inspect, junctions  # noqa: PLC0415
    from interdrive.scenario.native import core_road, core_scenario  # noqa: PLC0415

    refused = False
    part = _box(box, png)
    if png is not None:
        _check_picture(png, files)
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
            if png is not None:
                _draw(scenario, path, png, part)
            print_inspection(inspect(scenario), junctions(handle.junctions()), refused_by_id)
            if not scenario.planning_problems and scenario.obstacles.is_static.all():
                say(f"no traffic: {path} holds a map alone; it can be run once it has vehicles or planning problems")
            elif not able:
                raise InputError(f"{path}: no vehicle can become an agent, so there is nothing to run")
        except InterdriveError as error:
            say(f"error: {' '.join(str(error).split())}", err=True)
            refused = True
    return 2 if refused else 0


def _check_picture(png: str, files: tuple[str, ...]) -> None:
    if len(files) > 1:
        raise InputError(f"--png {png}: it is the picture of one file; name one")
    if Path(png).suffix.lower() != ".png":
        raise InputError(f"--png {png}: the file must end in .png")


def _box(text: str | None, png: str | None) -> tuple[float, float, float, float] | None:
    if text is None:
        return None
    if png is None:
        raise InputError(f"--box {text}: it is the part that --png draws; add --png FILE")
    try:
        x0, y0, x1, y1 = (float(number) for number in text.split(","))
    except ValueError:
        x0, y0, x1, y1 = (math.nan,) * 4
    if not all(map(math.isfinite, (x0, y0, x1, y1))) or x0 >= x1 or y0 >= y1:
        raise InputError(f"--box {text}: write smallest x and y, largest x and y in metres, such as -50,-20,100,80")
    return x0, y0, x1, y1


def _draw(scenario: Scenario, path: Path, png: str, part: tuple[float, float, float, float] | None) -> None:
    """Draws the map with ids, and says how many had no room."""
    from interdrive.plots import save_figure  # noqa: PLC0415 - matplotlib
    from interdrive.plots.map import draw_map  # noqa: PLC0415
    from interdrive.storage import keep_inputs  # noqa: PLC0415 - pyarrow

    keep_inputs(png, (path,))
    try:
        figure, too_short = draw_map(scenario, part)
    except InputError as error:
        raise InputError(f"--box: {error}") from None
    save_figure(figure, png)
    hidden = f"; {too_short} lanelets are too short in it for their ids, draw a part with --box" if too_short else ""
    say(f"map in {shown(Path(png).resolve())}{hidden}")
