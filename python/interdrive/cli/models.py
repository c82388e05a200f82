"""`interdrive models`: weights of predictors that are not shipped."""

from __future__ import annotations

from pathlib import Path

import click


@click.group(invoke_without_command=True)
@click.pass_context
def models(context: click.Context) -> None:
    """List or install published weights of predictors that are not shipped."""
    if context.invoked_subcommand is None:
        context.invoke(list_models)


@models.command("list")
def list_models() -> None:
    """List the available weights, and the paths of installed ones."""
    from interdrive.cli.report import print_text  # noqa: PLC0415 - rich
    from interdrive.predictors.models import COMMAND, REQUIREMENT, is_installed, weights_file  # noqa: PLC0415

    here = f"installed, {weights_file()}" if is_installed() else f"not installed: run '{COMMAND}'"
    print_text(f"walenet  {REQUIREMENT.replace('==', ' ')} from PyPI (MIT)  {here}")


@models.command("install")
@click.argument("name", type=click.Choice(["walenet"]))
@click.option(
    "--from",
    "wheel",
    metavar="WHEEL",
    type=click.Path(path_type=Path),
    help="Use this wheel instead of a download by pip.",
)
def install_model(name: str, wheel: Path | None) -> None:
    """Install the weights of the predictor NAME into your cache.

    pip downloads one wheel from PyPI without its dependencies; the weights in it must have the published SHA-256. No
    code of the wheel is installed or run. The cache is INTERDRIVE_CACHE, or the folder interdrive in XDG_CACHE_HOME.
    """
    from interdrive.cli.report import print_text  # noqa: PLC0415 - rich
    from interdrive.predictors.models import install, is_installed, weights_file  # noqa: PLC0415

    if wheel is None and is_installed():
        print_text(f"{name} is already installed: {weights_file()}")
        return
    path = install(wheel)
    print_text(f"{name} is installed: {path} ({path.stat().st_size / 1000:.0f} kB)")
