"""`interdrive problem`: planning problems on a map, from lane to lane."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import TYPE_CHECKING

import click

from interdrive.cli.arguments import assigned, shown, source_option
from interdrive.cli.terminal import say
from interdrive.errors import InputError

if TYPE_CHECKING:
    from interdrive.scenario import Scenario

#: Largest speed [m/s], and largest time [s] and way [m].
_FASTEST, _LONGEST = 100.0, 1e5


@click.command()
@click.argument("map_file", metavar="MAP")
@click.option(
    "--from",
    "starts",
    metavar="LANE[,S]",
    multiple=True,
    required=True,
    help="Where it starts: a lanelet id, or the source's name; S metres into it.",
)
@click.option("--to", "goals", metavar="LANE", multiple=True, required=True, help="The lane that it is to reach.")
@click.option("--velocity", metavar="V", help="Speed at the start [m/s] (the limit of the lane, or 13.9).")
@click.option("--time", "seconds", metavar="S", help="Time to reach the goal [s] (twice that at the limit, and 20 s).")
@source_option
@click.option("--out", metavar="FILE.xml", required=True, help="The CommonRoad file to write.")
@click.option("--overwrite", is_flag=True, help="Replace a file that exists.")
@click.option("--quiet", is_flag=True, help="Print only errors.")
def problem(
    map_file: str,
    starts: tuple[str, ...],
    goals: tuple[str, ...],
    velocity: str | None,
    seconds: str | None,
    source: tuple[str, ...],
    out: str,
    overwrite: bool,
    quiet: bool,
) -> None:
    """Put planning problems on a map, so that it can be run.

    MAP is a CommonRoad file or a map of another tool. The first --from and the first --to make one vehicle, and so on:
    it starts on the middle of its lane, along it, and its goal is a lane. A lane is a lanelet id, or the name that the
    source has for it (`interdrive convert --names`); id=12 and name=12 say which. `interdrive check MAP --png FILE`
    draws the ids.
    """
    from interdrive.config.schema import settings_of  # noqa: PLC0415
    from interdrive.files import open_scenario, scenario_document, scenario_file  # noqa: PLC0415 - numpy
    from interdrive.scenario.problems import Trip, with_problems  # noqa: PLC0415
    from interdrive.storage import keep_inputs, replacing, resolved  # noqa: PLC0415 - pyarrow

    if len(starts) != len(goals):
        raise InputError(f"problem: {len(starts)} --from and {len(goals)} --to; give one --to for each --from")
    target = resolved(out)
    if target.suffix.lower() != ".xml":
        raise InputError(f"--out {out}: name a file that ends in .xml")
    if target.is_dir():
        raise InputError(f"--out {out}: is a folder; name a file in it")
    if target.exists() and not overwrite:
        raise InputError(f"--out {out}: exists already; name another file, or add --overwrite")
    speed, limit = _number("--velocity", velocity, 0.0, _FASTEST), _number("--time", seconds, 0.1, _LONGEST)
    settings = settings_of(assigned((), raw=True, source=source))
    path = scenario_file(map_file)
    keep_inputs(target, (path,))
    scenario = open_scenario(path, raw=True, source=settings.source)
    names = set(scenario.source.keys) if scenario.source is not None else set()
    trips = []
    for start, goal in zip(starts, goals, strict=True):
        lane, s = _place(start, names)
        trips.append(Trip(lane, goal, s))
    made, lengths = with_problems(
        scenario,
        trips,
        road_settings=settings.road,
        first_id=_free_id(path, scenario),
        velocity=speed,
        seconds=limit,
    )
    document = scenario_document(made)
    with replacing(target) as partial:
        partial.write_bytes(document)
    if quiet:
        return
    new = made.planning_problems[-len(trips) :]
    for one, trip, length in zip(new, trips, lengths, strict=True):
        last = one.goal[0].time_step[1] * made.dt
        say(
            f"problem {one.id}: from {trip.start} to {trip.goal}, {length:.1f} m, "
            f"at {one.initial_state.velocity:.1f} m/s, within {last:.1f} s"
        )
    say(f"{shown(target)}: interdrive run {shown(target)} --agents problems")


def _number(option: str, text: str | None, least: float, most: float) -> float | None:
    if text is None:
        return None
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not least <= value <= most:
        raise InputError(f"{option} {text}: write a number from {least:g} to {most:g}")
    return value


def _place(text: str, names: set[str]) -> tuple[str, float | None]:
    """Lane and arc length of "LANE,S"; a name of the source may have commas itself."""
    lane, comma, s = text.rpartition(",")
    if not comma or text in names or text.removeprefix("name=") in names:
        return text, None
    value = _number(f"--from {lane}, S", s, 0.0, _LONGEST)
    return lane, value


def _free_id(path: Path, scenario: Scenario) -> int:
    """An id that nothing in the file has, also what interdrive does not read."""
    stated = [int(number) for number in re.findall(rb'\bid="(\d{1,15})"', path.read_bytes())] if path.is_file() else []
    known = [*scenario.lanelets.ids.tolist(), *scenario.obstacles.ids.tolist()]
    known += [problem.id for problem in scenario.planning_problems]
    known += [light.id for light in scenario.traffic_lights]
    known += [incoming.id for incoming in scenario.incomings]
    return int(max([0, *stated, *known])) + 1
