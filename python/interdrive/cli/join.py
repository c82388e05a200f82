"""`interdrive join`: recordings that follow each other as one file."""

from __future__ import annotations

from pathlib import Path

import click

from interdrive.cli.arguments import raw_option, shown
from interdrive.cli.terminal import say
from interdrive.errors import InputError


@click.command()
@click.argument("files", nargs=-1, required=True, metavar="FILE...")
@raw_option
@click.option("--first", type=click.IntRange(min=0), metavar="STEP", help="First time step of the part that is wanted.")
@click.option("--last", type=click.IntRange(min=0), metavar="STEP", help="Last time step of that part.")
@click.option("--out", metavar="FILE.xml", required=True, help="The file to write.")
@click.option("--overwrite", is_flag=True, help="Replace that file.")
@click.option("--quiet", is_flag=True, help="Print only errors.")
def join(
    files: tuple[str, ...], raw: bool, first: int | None, last: int | None, out: str, overwrite: bool, quiet: bool
) -> None:
    """Join consecutive recordings, such as windows of one long recording, into one CommonRoad file.

    The order follows from the time steps in the names (NAME_80_T-159), a running number in them, or participants that
    occur in both files. Roads, signs and lights come from the first file. Planning problems are left out. With --first
    or --last a part of the whole is written, such as the passage of one vehicle; its time steps begin at 0.
    """
    from interdrive.files import join as joined  # noqa: PLC0415 - numpy
    from interdrive.files import scenario_document  # noqa: PLC0415
    from interdrive.storage import replacing, resolved  # noqa: PLC0415 - pyarrow

    target = resolved(out)
    if target.suffix != ".xml":
        raise InputError(f"--out {out}: name a file that ends in .xml")
    if target.resolve() in {Path(file).resolve() for file in files}:
        raise InputError(f"--out {out}: is one of the files to join; choose another name")
    if target.is_dir():
        raise InputError(f"--out {out}: is a folder; name a file in it")
    if target.exists() and not overwrite:
        raise InputError(f"--out {out}: exists already; name another file, or add --overwrite")
    whole = joined(files, raw=raw, first=first, last=last)
    document = scenario_document(whole, Path(files[0]))
    with replacing(target) as partial:
        partial.write_bytes(document)
    if not quiet:
        for note in whole.notes:
            say(f"note: {note}")
        say(f"{whole.name}: {len(whole.obstacles.ids)} participants in {shown(target)}")
