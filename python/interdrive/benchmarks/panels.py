"""Panels of sets: drives in the place of every agent, stored once and read by scores, benchmarks and adversaries."""

from __future__ import annotations

import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from interdrive.batches.job import Job, read_scenario_of, simulated
from interdrive.batches.plan import planned, traffic_kind
from interdrive.benchmarks.passages import PASSAGES, located
from interdrive.benchmarks.sets import read_set
from interdrive.config.schema import SimulationSettings
from interdrive.errors import InputError
from interdrive.foreign import failure
from interdrive.panel import PANEL, PanelFolder, World, panel_drives
from interdrive.scoring import ScoringSettings

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from interdrive.batches.plan import RunSpec
    from interdrive.config.specs import PredictorSpecs

#: What drives in the agent's place to find out what the world is; it is part of the panel anyway.
_FIRST = "lawful"


@dataclass(frozen=True)
class StoredPanel:
    """What `store_panel` did.

    Attributes:
        folder: Where the drives are. n_places: Agents, once per kind of traffic.
        missing: Files that were not found, and agents that cannot be driven, one line each.
    """

    folder: Path
    n_places: int
    missing: tuple[str, ...]


def store_panel(
    *,
    set: str = "shipped-2",  # noqa: A002 - the word for it
    split: str = "dev",
    scenarios: str | Path | None = None,
    traffic: Sequence[str] | None = None,
    predictor: PredictorSpecs = "neural",
    out: str | Path = "out/panel",
    workers: int | None = None,
    on_place: Callable[[int, int], None] | None = None,
    on_recording: Callable[[str], None] | None = None,
) -> StoredPanel:
    """Drives the panel in the place of every agent of a set and stores it; what is stored already is not driven.

    Worker processes start new interpreters: a script that calls this needs `if __name__ == "__main__":`.

    Args:
        set: Name of a benchmark set.
        split: Part of it.
        scenarios: Folder that contains its files; None: `INTERDRIVE_SCENARIOS`.
        traffic: How the others drive: "replay" and native planners; None: the columns of the set.
        predictor: Of all agents.
        out: Folder of the panel.
        workers: Processes; all cores by default.
        on_place: Called after every agent with how many are done, and how many there are.
        on_recording: Called with the name of a recording before it is joined.

    Raises:
        InputError: An unknown set, split or traffic, none of its files was found, or another panel is in the folder.
        ResultsError: The folder cannot be used.
    """
    chosen = read_set(set)
    wanted = chosen.of_split(split)
    kinds = chosen.traffic if traffic is None else tuple(dict.fromkeys(str(traffic_kind(kind)) for kind in traffic))
    if "same" in kinds:
        raise InputError("traffic: a panel needs one planner for all others; name it instead of same")
    there, found, missing = located(chosen, wanted, scenarios, Path(out).parent / PASSAGES, on_recording)
    if not there:
        raise InputError(f"set {set}: none of its {len(wanted)} files was found; give their folder with --scenarios")
    about = f"{set} {chosen.sha256[:12]}, split {split}, traffic {' and '.join(kinds)}, predictor {predictor}"
    agents = {file.sha256: file.agents for file in there}
    tasks = [
        spec.of_agents([number])
        for kind in kinds
        for spec in planned(
            [found[file.sha256] for file in there],
            planner=_FIRST,
            predictor=predictor,
            agents="all",
            traffic=kind,
            alone=True,
            seeds=1,
            settings=SimulationSettings(),
        ).specs
        for number in agents[spec.sha256]
    ]
    folder = PanelFolder.create(out, PANEL, about)
    problems = list(missing)
    for done, problem in enumerate(_driven(tasks, folder, workers), start=1):
        problems += [problem] if problem else []
        if on_place is not None:
            on_place(done, len(tasks))
    return StoredPanel(folder.path, len(tasks), tuple(problems))


def _driven(tasks: Sequence[RunSpec], folder: PanelFolder, workers: int | None) -> Iterable[str]:
    stored = partial(_stored, folder=folder)
    if workers == 1 or len(tasks) == 1:
        yield from map(stored, tasks)
        return
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        yield from pool.map(stored, tasks)


def _stored(spec: RunSpec, folder: PanelFolder) -> str:
    """Stores the drives in the place of one agent; in one line why there are none, else ""."""
    assert isinstance(spec.agents, tuple)
    number = spec.agents[0]
    try:
        run, _ = simulated(spec, read_scenario_of(Job(spec, "none"))[0])
        if number not in run.scenario.overlapping:
            panel_drives(World.of(run, number), PANEL, ScoringSettings(), measures_hindrance=True, stored=folder)
    except Exception as error:  # noqa: BLE001 - one place that fails is told, the others are driven
        return f"{spec.scenario}, agent {number}, {spec.traffic}: {failure(error)}"
    return ""
