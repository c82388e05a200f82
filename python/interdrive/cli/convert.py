"""`interdrive convert`: maps and recordings of other tools as CommonRoad files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from interdrive.cli.terminal import say
from interdrive.errors import InputError
from interdrive.scenario.signs import sign_with

if TYPE_CHECKING:
    from interdrive.scenario import Scenario


@click.command()
@click.argument("source", metavar="SOURCE")
@click.option("--out", metavar="FILE.xml", required=True, help="The CommonRoad file to write.")
@click.option("--map", "map", metavar="FILE", help="Map of a recording that has none, in any format.")
@click.option("--dt", metavar="S", help="Time between steps [s] (as recorded; 0.1 for maps).")
@click.option("--start", metavar="S", help="Time of the first step, in the times of the recording [s].")
@click.option("--duration", metavar="S", help="Length of the recording after that [s].")
@click.option("--case", metavar="N", help="Which of several recordings in a file.")
@click.option("--projection", metavar="tm|utm|local", help="From geographic coordinates to the plane.")
@click.option("--origin", metavar="LAT,LON", help="Origin of the plane (the first point).")
@click.option("--utm-origin", metavar="X,Y", help="What is subtracted from UTM coordinates [m].")
@click.option("--offset", metavar="none|add|subtract", help="Whether the offset of an OpenDRIVE header counts (none).")
@click.option("--shift", metavar="X,Y", help="Added to the positions of a recording [m].")
@click.option("--keep", metavar="KIND,...", help="Lanes to read besides those for cars: bike, bus, parking, shoulder.")
@click.option("--country", metavar="ABC", help="Where it is, which says on which side vehicles drive, such as GBR.")
@click.option("--names", metavar="FILE.csv", help="Also write what the source calls each lanelet.")
@click.option("--overwrite", is_flag=True, help="Replace files that exist.")
@click.option("--quiet", is_flag=True, help="Print only errors.")
def convert(
    source: str,
    out: str,
    names: str | None,
    overwrite: bool,
    quiet: bool,
    **options: str | None,
) -> None:
    """Convert a map or a recording of another tool to a CommonRoad file.

    SOURCE is recognised by its content: OpenDRIVE (.xodr), Lanelet2 (.osm), SUMO nets (.net.xml), also compressed by
    gzip; Argoverse 2 (its folder), scenes of the Waymo Open Motion Dataset (.json), OSI traces (.osi, .mcap), tables of
    tracks (.csv, .parquet; most need --map); or a CommonRoad file. `run`, `check` and `batch` read the same sources,
    with these options as --source NAME=VALUE. The last line says what was left out.
    """
    from interdrive.files import read_source, scenario_document  # noqa: PLC0415 - numpy
    from interdrive.storage import keep_inputs, replacing  # noqa: PLC0415 - pyarrow

    target = _target("--out", out, ".xml", overwrite=overwrite)
    table = None if names is None else _target("--names", names, ".csv", overwrite=overwrite)
    for path in (target, *(() if table is None else (table,))):
        keep_inputs(path, (Path(source), *(() if options["map"] is None else (Path(options["map"]),))))
    scenario = read_source(source, raw=True, **options)
    document = scenario_document(scenario)
    with replacing(target) as partial:
        partial.write_bytes(document)
    if table is not None:
        with replacing(table) as partial:
            partial.write_text(_names(scenario), encoding="utf-8", newline="\n")
    if not quiet:
        say(_summary(target.name, scenario))


def _target(option: str, text: str, ending: str, *, overwrite: bool) -> Path:
    from interdrive.storage import resolved  # noqa: PLC0415 - pyarrow

    target = resolved(text)
    if target.suffix.lower() != ending:
        raise InputError(f"{option} {text}: name a file that ends in {ending}")
    if target.is_dir():
        raise InputError(f"{option} {text}: is a folder; name a file in it")
    if target.exists() and not overwrite:
        raise InputError(f"{option} {text}: exists already; name another file, or add --overwrite")
    return target


def _names(scenario: Scenario) -> str:
    import csv  # noqa: PLC0415
    import io  # noqa: PLC0415

    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("lanelet_id", "key"))
    ids = scenario.lanelets.ids.tolist()
    writer.writerows(zip(ids, scenario.source.keys if scenario.source is not None else map(str, ids), strict=True))
    return text.getvalue()


def _summary(name: str, scenario: Scenario) -> str:
    """What was written, and what was left out, in one line."""
    import numpy as np  # noqa: PLC0415

    lanelets, crossed = scenario.lanelets, set(scenario.crosswalks)
    roads = [row for row, number in enumerate(lanelets.ids.tolist()) if number not in crossed]
    middles = [0.5 * (lanelets.left[row] + lanelets.right[row]) for row in roads]
    metres = sum(float(np.hypot(*np.diff(middle, axis=0).T).sum()) for middle in middles)
    counts: list[Any] = [
        _counted(len(roads), "lanelet"),
        f"{metres / 1000.0:.1f} km",
        _counted(sum(map(len, lanelets.successors)), "link"),
    ]
    signs = [sign.kind for _, ranks in scenario.priorities.ranks if (sign := sign_with(ranks))]
    for number, what in (
        (len(crossed), "crosswalk"),
        (len(scenario.traffic_lights), "traffic light"),
        (sum(line.has_stop_sign for line in scenario.stop_lines), "stop sign"),
        (signs.count("yield"), "yield sign"),
    ):
        if number:
            counts.append(_counted(number, what))
    if len(scenario.obstacles.ids):
        counts.append(_counted(len(scenario.obstacles.ids), "participant"))
    return "; ".join((f"{name}: {', '.join(counts)}", *scenario.notes))


def _counted(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"
