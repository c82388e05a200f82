"""The search: runs are allocated, driven by one or several processes, and judged in their order; failures are kept."""

from __future__ import annotations

import json
import math
import multiprocessing
import time
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from interdrive import _core
from interdrive.config.schema import settings_of
from interdrive.errors import InputError, InterdriveError
from interdrive.failure_search.allocation import KEPT_MAX, METHODS, Allocation
from interdrive.failure_search.backends import backend_of, spare
from interdrive.failure_search.evaluation import Drivers, require_text
from interdrive.failure_search.failures import Failure, failures
from interdrive.failure_search.keeping import work
from interdrive.failure_search.pairs import pairs_of, paths_of
from interdrive.failure_search.rates import Yield, is_lost, yields
from interdrive.failure_search.record import Record
from interdrive.failure_search.rounds import Limits, Round, task_of, value_of
from interdrive.failure_search.search_folder import SearchFolder
from interdrive.failure_search.spaces import CHOICES, Space, with_drivers
from interdrive.failure_search.trials import Driven, Setup, Trial

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from interdrive.failure_search.allocation import Method
    from interdrive.failure_search.backends import Backend
    from interdrive.failure_search.disturbances import Pair


@dataclass(frozen=True)
class Found:
    """What a search found.

    Attributes:
        failures: Failures, in the order in which they were found.
        runs: Runs of the search.
        lost_runs: Of these, runs whose process ended or took too long, so that it is unknown whether they fail.
        uniform_runs: Of these, drawn uniformly, and driven.
        uniform_failures: Failures among them.
        rate: Share of uniform runs that fail, with its 95 % interval (Clopper and Pearson), whose upper end counts lost
            uniform runs as failures.
        yields: What the runs brought by where their points come from, beside the uniform ones.
        undisturbed: Agents that fail without any disturbance, as "scenario agent".
        left_out: Files and agents that were left out, each with the reason.
    """

    failures: tuple[Failure, ...]
    runs: int
    lost_runs: int
    uniform_runs: int
    uniform_failures: int
    rate: tuple[float, float, float]
    yields: tuple[Yield, ...]
    undisturbed: tuple[str, ...]
    left_out: tuple[str, ...]


def search(
    paths: str | Path | Sequence[str | Path],
    planner: str,
    *,
    runs: int | None = None,
    minutes: float = math.inf,
    stop_after: int | None = None,
    seed: int = 0,
    out: str | Path,
    agent_id: int | None = None,
    traffic: str = "idm",
    predictor: str = "lane_following",
    settings: Mapping[str, str] | None = None,
    space: Space | None = None,
    method: Method = "levels",
    keep: int = KEPT_MAX,
    shrink: bool = True,
    workers: int = 1,
    ray: str | None = None,
    run_timeout: float = math.inf,
    on_run: Callable[[int, int], None] | None = None,
) -> Found:
    """Searches disturbances of recordings under which a planner fails by its own fault.

    Results depend on the arguments that say what is searched alone, not on workers or interruptions. An interrupted
    search goes on where it was when it is called with the same ones; what it found until then is in the folder.

    Args:
        paths: CommonRoad files, folders of them, or names of shipped scenarios.
        planner: The planner under test, as on the command line.
        runs: Number of runs, with those that the folder has; None: 300, or as many as `minutes` allow.
        minutes: No run begins after this time, and failures are not made smaller [min].
        stop_after: Ends with this many failures.
        seed: Chooses the points.
        out: Folder of the search.
        agent_id: Only this agent.
        traffic: Planner of all other vehicles, or "recorded". With `drivers=NAME`, what `space.driver` names is drawn
            from that population.
        predictor: Predictor of all agents.
        settings: Settings of all runs by dotted name, as on the command line; with `v2x.penetration` messages may be
            lost, too.
        space: What may change; the defaults otherwise.
        method: "levels" drives pairs and points near those that came near to a failure, "uniform" draws all alike.
        keep: So many failures of one kind (scenario, agent, kind, partner, lanelets) are made small and kept.
        shrink: Make failures small; False: they are kept as they are found, and made small by a later call without it.
        workers: Processes that drive. With more than one, scripts need `if __name__ == "__main__":`.
        ray: Address of a Ray cluster that drives instead ("auto": the cluster of this machine), whose nodes see the
            files under the same paths.
        run_timeout: A run that takes longer is lost [s]: its process is ended, and its row says so. A failure that
            takes longer to be made small is kept as it is. inf: they may take as long as they like.
        on_run: Called with the number of runs and of failures until now.

    Raises:
        InputError: An argument cannot be used, no agent has a vehicle near, or the folder holds another search.
        ResultsError: The folder is damaged or cannot be written, or another process is searching there.
        MissingExtraError: Ray is not installed.
    """
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        raise SystemExit(1)  # a worker reads a script that calls this without a guard; the pool says so
    text = require_text(planner)
    limits = Limits.of(runs, minutes, stop_after, shrink=shrink)
    if method not in METHODS:
        raise InputError(f"method: must be one of {', '.join(METHODS)}, not {method!r}")
    for name, value in (("keep", keep), ("workers", workers), ("run_timeout", run_timeout)):
        if not value > 0:
            raise InputError(f"{name}: must be positive, is {value}")
    traffic, chosen = with_drivers(traffic, space or Space())
    own = _checked(settings or {})
    chosen = chosen.with_traffic(traffic).with_v2x(is_on=settings_of(own).v2x.penetration > 0.0)
    found, files, left_out = pairs_of(paths_of(paths), chosen.others, agent_id)
    setup = Setup(Drivers(text, traffic, predictor, tuple(own.items())), chosen, seed)
    what = {
        "files": files,
        "planner": text,
        "agent_id": agent_id,
        "seed": seed,
        "traffic": traffic,
        "predictor": predictor,
        "settings": own,
        "method": method,
        "keep": keep,
        "space": json.loads(json.dumps(asdict(chosen))),
        "coordinates": list(chosen.coordinates),
        "version": _core.__version__,
    }
    with (
        closing(SearchFolder(Path(out), what, goes_back=shrink)) as folder,
        closing(backend_of(workers, ray, run_timeout)) as backend,
    ):
        under_way = _Search(folder, found, setup, (method, keep), backend, run_timeout)
        under_way.run(limits, on_run)
    return under_way.found(left_out)


def _checked(settings: Mapping[str, str]) -> dict[str, str]:
    """Settings of runs, in the order of their names.

    Raises:
        InputError: There is no such setting, or it says how files are read or who drives, which a search decides.
    """
    for name in settings:
        table = name.partition(".")[0]
        if table in ("agents", "recording", "source", "traffic"):
            raise InputError(name, f"settings of {table} cannot be chosen for a search")
    return {name: str(settings[name]) for name in sorted(settings)}


#: Before the reason why an agent cannot be driven at all.
_UNFIT = "!"


class _Search:
    """A search under way."""

    def __init__(
        self,
        folder: SearchFolder,
        pairs: Sequence[Pair],
        setup: Setup,
        how: tuple[Method, int],
        backend: Backend,
        run_timeout: float,
    ) -> None:
        self.folder, self.setup, self.backend, self._run_timeout = folder, setup, backend, run_timeout
        method, keep = how
        if folder.undisturbed is None:
            folder.describe(self._undisturbed(pairs))
        self._ended = folder.undisturbed or []
        fit = [pair for pair, (*_, ended) in zip(pairs, self._ended, strict=True) if ended[:1] != _UNFIT]
        choices = tuple(name in CHOICES for name in setup.space.coordinates)
        self._allocation = Allocation(len(fit), choices, setup.seed, method)
        self.record = Record(folder, setup, fit, keep)

    def _undisturbed(self, pairs: Sequence[Pair]) -> list[tuple[str, int, str]]:
        """Scenario and id of every agent with the kind of its failure in the recording as it is; "" without one.

        Raises:
            InputError: The planner, the traffic or the predictor cannot be used, or no agent has a route.
        """
        trials = iter([(place, Trial(self.setup, pair)) for place, pair in enumerate(pairs)])
        found: dict[int, Driven | InterdriveError] = {}
        for end in self.backend.run(work, lambda _: task_of(next(trials, None))):
            found[end.task.payload[0]] = value_of(end, pairs[end.task.payload[0]])
        refused = [one for one in found.values() if isinstance(one, InterdriveError)]
        if len(refused) == len(found):
            raise refused[0]
        ended = []
        for place, pair in enumerate(pairs):
            one = found[place]
            how = f"{_UNFIT}{one}" if isinstance(one, InterdriveError) else one.judged.failure if one.judged else ""
            ended.append((pair.scenario, pair.agent_id, how))
        return ended

    def run(self, limits: Limits, on_run: Callable[[int, int], None] | None) -> None:
        """Drives until a limit is reached; each run is in the log when a later one is added."""
        rows = self.folder.rows
        n_kept = sum(bool(row["folder"]) for row in rows)
        try:
            while len(rows) < limits.runs and n_kept < limits.failures and time.time() < limits.deadline:
                proposals = self._allocation.proposals(len(rows), rows)
                wanted = int(min(len(proposals), limits.runs - len(rows)))
                part = Round(self.record, self.backend, proposals[:wanted], limits)
                try:
                    for row in part.rows():
                        self.folder.add(row)
                        n_kept += bool(row["folder"])
                        if on_run is not None:
                            on_run(len(rows), n_kept)
                        if n_kept >= limits.failures:
                            return
                except KeyboardInterrupt:
                    with spare(self.backend, self._run_timeout) as other:
                        for row in part.left(other):
                            self.folder.add(row)
                    raise
        finally:
            self.folder.write_table()

    def found(self, left_out: Sequence[str]) -> Found:
        """What is found until now."""
        by_source = yields(self.folder.rows)
        ended = [(f"{scenario} {agent}", how) for scenario, agent, how in self._ended if how]
        return Found(
            tuple(failures(self.folder.path)),
            len(self.folder.rows),
            sum(is_lost(row) for row in self.folder.rows),
            by_source[0].runs,
            by_source[0].failures,
            by_source[0].rate,
            by_source,
            tuple(name for name, how in ended if how[:1] != _UNFIT),
            (*left_out, *(f"{name}: {how[1:]}" for name, how in ended if how[:1] == _UNFIT)),
        )
