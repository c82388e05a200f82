"""`interdrive drivers`: populations of drivers, and who is drawn from them."""

from __future__ import annotations

import click


@click.command()
@click.argument("name", metavar="NAME|FILE", required=False)
@click.option("--draw", metavar="N", type=click.IntRange(min=1, max=1000), help="Show so many drivers.")
@click.option("--seed", metavar="N", type=click.IntRange(min=0), default=0, help="Of what they draw (0).")
def drivers(name: str | None, draw: int | None, seed: int) -> int:
    """List populations of drivers, or show one: its numbers, where they are from, and drivers of it."""
    from rich.markup import escape  # noqa: PLC0415

    from interdrive.cli.report import output, print_table, table_of  # noqa: PLC0415 - rich
    from interdrive.cli.terminal import say  # noqa: PLC0415
    from interdrive.config.drivers import POPULATIONS, read_drivers  # noqa: PLC0415 - numpy

    console = output()
    if name is None:
        table = table_of(("population", "planner", "fitted on"))
        for each in POPULATIONS.values():
            table.add_row(each.name, each.planner or "any", escape(", ".join(each.fitted_on) or "nothing"))
        print_table(console, table, names=1)
        return 0
    found = read_drivers(name)
    table = table_of(("number", "median", "sd", "transform", "bounds"), right=("median", "sd"))
    for key, one in found.parameters.items():
        table.add_row(key, f"{one.median:g}", f"{one.sd:g}", one.transform, f"{one.low:g} to {one.high:g}")
    for key, value in found.constants.items():
        table.add_row(key, f"{value:g}", "", "", "")
    print_table(console, table, names=1)
    for key, value in found.provenance.items():
        words = ", ".join(f"{one}: {what}" for one, what in value.items()) if isinstance(value, dict) else value
        say(f"{key}: {', '.join(map(str, words)) if isinstance(words, list) else words}")
    if draw:
        keys = tuple(found.parameters)
        table = table_of(("driver", *keys), right=keys)
        for agent in range(draw):
            own = found.drawn(seed, agent)
            table.add_row(str(agent), *(f"{own[key]:.3f}" for key in keys))
        print_table(console, table, names=1)
    return 0
