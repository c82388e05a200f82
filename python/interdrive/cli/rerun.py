"""`interdrive rerun`: the run of a folder once more, with this version, also where the folder is of an older one."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any

import click

from interdrive.cli.arguments import assigned, claimed_folder, shown
from interdrive.cli.terminal import say
from interdrive.cli.verify import ask_before_import
from interdrive.config.binding import bind, flatten
from interdrive.errors import InputError


@click.command()
@click.argument("folder", metavar="OLDFOLDER")
@click.option(
    "--scenario",
    metavar="FILE",
    help="Current path of the scenario file, if it was moved, or the name of one that is shipped.",
)
@click.option("--planner", metavar="PLANNER[,NAME=VALUE...]", help="Another planner for all agents.")
@click.option("--set", "assignments", metavar="NAME=VALUE", multiple=True, help="A setting that is to differ.")
@click.option("--threads", metavar="N", type=click.IntRange(min=1), help="Number of planning threads (all cores).")
@click.option("--trust", is_flag=True, help="Import planners and predictors that run.json names as module:object.")
@click.option("--out", metavar="DIR", help="Run folder (a new one under out/).")
@click.option("--overwrite", is_flag=True, help="Replace the run in that folder.")
@click.option("--quiet", is_flag=True, help="Print only errors.")
def rerun(
    folder: str,
    scenario: str | None,
    planner: str | None,
    assignments: tuple[str, ...],
    threads: int | None,
    trust: bool,
    out: str | None,
    overwrite: bool,
    quiet: bool,
) -> int:
    """Simulate the run of OLDFOLDER once more with this version, into a new folder.

    OLDFOLDER may be of an older version, whose folders no other command reads. Scenario, agents, planners, predictor,
    seed and settings are those of its run.json; settings that no longer exist are named and left out. The command says
    whether the states are equal to the last bit, and which agents end differently. OLDFOLDER is never changed.
    """
    from interdrive.cli.report import print_run, progress  # noqa: PLC0415 - rich
    from interdrive.config.agent_config import modules_named  # noqa: PLC0415
    from interdrive.config.schema import SimulationSettings  # noqa: PLC0415
    from interdrive.results import RUN_FOLDER, save  # noqa: PLC0415
    from interdrive.simulation import simulate  # noqa: PLC0415

    info = _information(Path(folder))
    wanted = _settings(folder, info)
    path = _scenario(folder, info, scenario)
    chosen = planner if planner is not None else wanted.get("planner", "rollout")
    predictor = wanted.get("predictor", "neural")
    if not trust:
        try:
            named = modules_named(chosen if planner is None else "rollout", predictor)
        except (KeyError, TypeError, ValueError, AttributeError) as cause:
            raise InputError(f"{folder}: run.json does not say how to repeat the run ({cause!r})") from None
        ask_before_import(folder, named)
    known = flatten(SimulationSettings())
    stored = {name: value for name, value in wanted.get("settings", {}).items() if name in known}
    notes = [
        f"{name} = {value}: this setting no longer exists and is left out"
        for name, value in wanted.get("settings", {}).items()
        if name not in known
    ]
    settings = bind(bind(SimulationSettings(), stored), assigned(assignments))
    with (
        claimed_folder(
            out, path.stem, RUN_FOLDER, overwrite=overwrite, inputs=[path, Path(folder) / "run.json"]
        ) as target,
        progress(quiet=quiet) as report,
    ):
        report.say(f"reading {path}")
        run = simulate(
            path,
            agents=wanted.get("agents", "all"),
            planner=chosen,
            predictor=predictor,
            views=wanted.get("views", {}),
            rules=wanted.get("rules", {}),
            v2x=wanted.get("v2x", {}),
            seed=wanted.get("seed") or 0,
            settings=settings,
            threads=threads,
            on_step=report.step,
        )
        if not run.finished:
            raise KeyboardInterrupt
        save(run, target, overwrite=overwrite)
    if not quiet:
        print_run(run, shown(target))
        now = dict(zip(run.outcomes.agent_id.tolist(), run.outcomes.outcome, strict=True))
        lines = [*notes, *_changes(info, run.scenario.sha256), *_compared(Path(folder), info, run.digest, now)]
        say("\n".join(lines))
    return 0


def _information(folder: Path) -> dict[str, Any]:
    """The run.json of any version.

    Raises:
        InputError: There is none, or it is not readable.
    """
    from interdrive.storage import one_line, read_json  # noqa: PLC0415 - numpy

    if (folder / "batch.json").is_file():
        raise InputError(f"{folder}: it is a batch; give its `interdrive batch` command again with another --out")
    try:
        info = read_json(folder / "run.json")
    except (FileNotFoundError, NotADirectoryError):
        raise InputError(f"{folder}: this is not a run folder, it has no run.json") from None
    except (OSError, ValueError) as cause:
        raise InputError(f"{folder / 'run.json'}: cannot be read: {one_line(cause)}") from None
    if not isinstance(info, dict):
        raise InputError(f"{folder / 'run.json'}: it is not that of a run")
    return info


def _settings(folder: str, info: dict[str, Any]) -> dict[str, Any]:
    """What run.json says about repeating the run."""
    wanted = info.get("settings")
    groups = ("settings", "views", "rules", "v2x")
    if not isinstance(wanted, dict) or not all(isinstance(wanted.get(name, {}), dict) for name in groups):
        raise InputError(f"{folder}: run.json does not say how to repeat the run: settings are missing")
    if not wanted.get("repeatable", True):
        raise InputError(f"{folder}: the run used Python objects that run.json cannot name; repeat it in Python")
    return wanted


def _scenario(folder: str, info: dict[str, Any], given: str | None) -> Path:
    from interdrive.files import shipped_scenario, shipped_scenarios  # noqa: PLC0415 - numpy

    stored = info.get("scenario")
    path = given or (stored.get("path") if isinstance(stored, dict) else None)
    if not isinstance(path, str):
        raise InputError(f"{folder}: the scenario came from memory, not from a file; give one with --scenario")
    if Path(path).is_file():
        return Path(path)
    # A scenario that interdrive ships has moved with it.
    name = given or Path(path).stem
    if name in shipped_scenarios():
        return shipped_scenario(name)
    if given:
        raise InputError(f"{path}: there is no such file, and no scenario of this name is shipped")
    raise InputError(f"{path}: the scenario of the run is gone; give its present path with --scenario")


def _changes(info: dict[str, Any], sha256: str | None) -> list[str]:
    then = info["scenario"].get("sha256") if isinstance(info.get("scenario"), dict) else None
    if then is None or sha256 is None or then == sha256:
        return []
    return ["the scenario file has changed since the run"]


def _compared(folder: Path, info: dict[str, Any], digest: str, now: dict[int, str]) -> list[str]:
    """Whether the states are the same, and which agents end differently."""
    if info.get("digest") == digest:
        return ["all states are equal to the last bit"]
    lines = ["the states differ from those of the old run"]
    with suppress(InputError, OSError, KeyError, ValueError):
        from interdrive.storage.foreign_tables import foreign_table  # noqa: PLC0415 - pyarrow

        name = folder / "outcomes.parquet"
        table = foreign_table(name.read_bytes(), str(name)).table
        then = dict(zip(table["agent_id"].to_pylist(), map(str, table["outcome"].to_pylist()), strict=True))
        lines += [
            f"agent {agent}: {then.get(agent, 'no agent')} before, {now.get(agent, 'no agent')} now"
            for agent in sorted({*then, *now})
            if then.get(agent) != now.get(agent)
        ]
        if len(lines) == 1:
            lines.append("every agent ends as before")
    return lines
