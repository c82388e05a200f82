"""`interdrive export`: runs for other tools."""

from __future__ import annotations

from pathlib import Path

import click

from interdrive.cli.arguments import shown
from interdrive.cli.terminal import say
from interdrive.errors import InputError


@click.command()
@click.argument("folder", metavar="RUN")
@click.option("--osi", metavar="FILE.mcap", help="A trace of the Open Simulation Interface (.mcap or .osi).")
@click.option("--csv", metavar="FILE.csv", help="A table of tracks, one row for each participant and time.")
@click.option("--sumo", metavar="DIR", help="Files for SUMO: fcd.xml, and agents.rou.xml if SUMO drove traffic.")
@click.option("--overwrite", is_flag=True, help="Replace files that exist.")
def export(folder: str, osi: str | None, csv: str | None, sumo: str | None, overwrite: bool) -> None:
    """Write the traffic of RUN for other tools: as an OSI trace, as a table of tracks, or as files for SUMO.

    `interdrive convert` reads the first two back. OSI needs the extra: pip install 'interdrive[osi]'.
    """
    targets = [
        (option, Path(text), endings)
        for option, text, endings in (("--osi", osi, (".mcap", ".osi")), ("--csv", csv, (".csv",)))
        if text is not None
    ]
    if not targets and sumo is None:
        raise InputError("nothing to write: add --osi FILE.mcap, --csv FILE.csv or --sumo DIR")
    for option, path, endings in targets:
        if path.suffix.lower() not in endings:
            raise InputError(f"{option} {path}: name a file that ends in {' or '.join(endings)}")
        if path.exists() and not overwrite:
            raise InputError(f"{option} {path}: exists already; name another file, or add --overwrite")
    if sumo is not None and Path(sumo).exists() and not Path(sumo).is_dir():
        raise InputError(f"--sumo {sumo}: is a file; name a folder")
    from interdrive.results.folder import inputs_of  # noqa: PLC0415 - numpy
    from interdrive.runs import load  # noqa: PLC0415 - pyarrow
    from interdrive.storage import keep_inputs, replacing  # noqa: PLC0415

    run = load(folder)
    if sumo is not None:
        from interdrive.files import sumo_files  # noqa: PLC0415

        made = sumo_files(run)
        there = [name for name in made if (Path(sumo) / name).exists()]
        if there and not overwrite:
            raise InputError(f"--sumo {sumo}: has {there[0]} already; name another folder, or add --overwrite")
        Path(sumo).mkdir(parents=True, exist_ok=True)
        for name, content in made.items():
            keep_inputs(Path(sumo) / name, inputs_of(folder, run))
            with replacing(Path(sumo) / name) as partial:
                partial.write_bytes(content)
        say(f"{' and '.join(made)} in {shown(Path(sumo))}")
    for _, path, _ in targets:
        keep_inputs(path, inputs_of(folder, run))
        run.export(path, overwrite=overwrite)
        say(f"{len(run.states.participant_id)} participants over {run.states.n_steps} time steps in {shown(path)}")
