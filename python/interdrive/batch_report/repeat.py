"""The command that repeats one run of a batch for inspection."""

from __future__ import annotations

import importlib.metadata
import re
import shlex
from functools import cache
from typing import TYPE_CHECKING, Any

from interdrive.batches.plan import ALONE
from interdrive.config.binding import bind, flatten
from interdrive.config.plugins import read_choice
from interdrive.config.schema import SimulationSettings
from interdrive.errors import InputError
from interdrive.planners import NATIVE as PLANNERS
from interdrive.predictors import NATIVE as PREDICTORS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

_NATIVE = {"planner": PLANNERS, "predictor": PREDICTORS}


def command(run: Mapping[str, Any], tested: Sequence[int], others: Sequence[int]) -> str | None:
    """What to type to do a finished run of a batch again, with a page.

    Args:
        run: Columns of the run in the data set.
        tested: Ids of the agents under test.
        others: Ids of the other agents.

    Returns:
        The command, quoted for a shell; None if `interdrive run` cannot repeat the run.
    """
    settings = _assignments(str(run["settings"]))
    if settings is None or not tested or not all(_is_named(run[what], what) for what in _NATIVE):
        return None
    adjusting = run["traffic"] == "velocity_adjusting"
    ids = sorted([*tested, *others])
    parts = ["interdrive", "run", run["path"], "--planner", run["traffic"] if adjusting else run["planner"]]
    if adjusting:
        parts += [part for number in tested for part in ("--agent", f"{number}={run['planner']}")]
    parts += ["--predictor", run["predictor"]]
    # One id needs the comma: a number alone says how many.
    parts += ["--agents", "all" if run["agents"] == "all" else ",".join(map(str, ids)) + "," * (len(ids) == 1)]
    if run["agents"] not in ("all", ALONE):
        parts += ["--seed", str(run["seed"])]
    parts += [part for assignment in settings for part in ("--set", assignment)]
    return shlex.join([*map(str, parts), "--report"])


def _assignments(label: str) -> list[str] | None:
    """Settings that are not the defaults, as `--set` takes them; None if the label does not tell."""
    if not label:
        return []
    found = [tuple(item.split("=", 1)) for item in re.split(r" (?=[a-z_.0-9]+=)", label)]
    try:
        values = flatten(bind(SimulationSettings(), dict(found)))
    except (InputError, ValueError):
        return None
    if any(str(values[name]) != value for name, value in found):
        return None
    return [f"{name}={value}" for name, value in found]


def _is_named(label: str, what: str) -> bool:
    """The command line can choose it: a name, or an object of a module."""
    try:
        chosen = read_choice(label, what).chosen
    except InputError:
        return False
    if not isinstance(chosen, str):
        return False
    return re.fullmatch(r"[\w.]+:[\w.]+", chosen) is not None or chosen in _names(what)


@cache
def _names(what: str) -> frozenset[str]:
    return frozenset(_NATIVE[what]) | importlib.metadata.entry_points(group=f"interdrive.{what}s").names
