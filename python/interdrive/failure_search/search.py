"""The search: runs are allocated, driven by one or several processes, and judged in their order; failures are kept."""

from __future__ import annotations

import json
import math
import multiprocessing
import time
from collections import Counter, deque
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from interdrive import _core
from interdrive.batches.pool import End, Pool, Task
from interdrive.errors import InputError, InterdriveError
from interdrive.failure_search.allocation import KEPT_MAX, METHODS, Allocation
from interdrive.failure_search.disturbed_worlds import disturbed
from interdrive.failure_search.evaluation import judged, require_text, witness
from interdrive.failure_search.failures import Failure, begin, failures, finish, give_up
from interdrive.failure_search.pairs import pairs_of, paths_of, scenario_at
from interdrive.failure_search.rates import Yield, yields
from interdrive.failure_search.search_folder import SearchFolder
from interdrive.failure_search.spaces import CHOICES, Space
from interdrive.failure_search.trials import Driven, Drivers, Setup, Trial, change_at, drive, drive_at, signature

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from interdrive.failure_search.allocation import Method, Proposal
    from interdrive.failure_search.spaces import Pair


@dataclass(frozen=True)
class Found:
    """What a search found.

    Attributes:
        failures: Failures, in the order in which they were found.
        runs: Runs of the search.
        uniform_runs: Of these, drawn uniformly, and driven.
        uniform_failures: Failures among them.
        rate: Share of uniform runs that fail, with its 95 % interval (Clopper and Pearson).
        yields: What the runs brought by where their points come from, beside the uniform ones.
        undisturbed: Agents that fail without any disturbance, as "scenario agent".
        left_out: Files and agents that were left out, each with the reason.
    """

    failures: tuple[Failure, ...]
    runs: int
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
    space: Space | None = None,
    method: Method = "levels",
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
        minutes: No run begins after this time [min].
        stop_after: Ends with this many failures.
        seed: Chooses the points.
        out: Folder of the search.
        agent_id: Only this agent.
        traffic: Planner of all other vehicles, or "recorded".
        predictor: Predictor of all agents.
        space: What may change; the defaults otherwise.
        method: "levels" drives pairs and points near those that came near to a failure, "uniform" draws all alike.
        workers: Processes that drive. With more than one, scripts need `if __name__ == "__main__":`.
        ray: Address of a Ray cluster that drives instead ("auto": the cluster of this machine), whose nodes see the
            files under the same paths.
        run_timeout: A run, or making a failure small, that takes longer is lost [s]: its process is ended, and its row
            says so. inf: they may take as long as they like.
        on_run: Called with the number of runs and of failures until now.

    Raises:
        InputError: An argument cannot be used, no agent has a vehicle near, or the folder holds another search.
        ResultsError: The folder is damaged or cannot be written, or another process is searching there.
        MissingExtraError: Ray is not installed.
    """
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        raise SystemExit(1)  # a worker reads a script that calls this without a guard; the pool says so
    text = require_text(planner)
    limits = _Limits.of(runs, minutes, stop_after)
    if method not in METHODS:
        raise InputError(f"method: must be one of {', '.join(METHODS)}, not {method!r}")
    for name, value in (("workers", workers), ("run_timeout", run_timeout)):
        if not value > 0:
            raise InputError(f"{name}: must be positive, is {value}")
    chosen = (space or Space()).with_traffic(traffic)
    found, files, left_out = pairs_of(paths_of(paths), chosen.others, agent_id)
    setup = Setup(Drivers(text, traffic, predictor), chosen, seed)
    what = {
        "files": files,
        "planner": text,
        "agent_id": agent_id,
        "seed": seed,
        "traffic": traffic,
        "predictor": predictor,
        "method": method,
        "space": json.loads(json.dumps(asdict(chosen))),
        "coordinates": list(chosen.coordinates),
        "version": _core.__version__,
    }
    with closing(SearchFolder(Path(out), what)) as folder, closing(_backend(workers, ray, run_timeout)) as backend:
        work = _Search(folder, found, setup, method, backend)
        work.run(limits, on_run)
    return work.found(left_out)


@dataclass(frozen=True)
class _Limits:
    """When a search ends."""

    runs: float
    deadline: float
    failures: float

    @classmethod
    def of(cls, runs: int | None, minutes: float, stop_after: int | None) -> _Limits:
        for name, value in (("runs", runs), ("minutes", minutes), ("stop_after", stop_after)):
            if value is not None and not value > 0:
                raise InputError(f"{name}: must be positive, is {value}")
        usual = 300 if math.isinf(minutes) else math.inf
        return cls(usual if runs is None else runs, time.monotonic() + 60.0 * minutes, stop_after or math.inf)


class Backend(Protocol):
    """Processes that do tasks; as in batches."""

    def run(self, function: Callable[[Any, int], Any], take: Callable[[str], Task[Any] | None]) -> Iterator[End[Any]]:
        """Does tasks until there are none and yields how they ended."""

    def close(self) -> None:
        """Ends what is still being done."""


class _Here:
    """This process."""

    def run(self, function: Callable[[Any, int], Any], take: Callable[[str], Task[Any] | None]) -> Iterator[End[Any]]:
        """Does tasks one after another."""
        while (task := take("")) is not None:
            yield End(task, function(task.payload, 1))

    def close(self) -> None:
        """Nothing is left."""


def _backend(workers: int, ray: str | None, run_timeout: float) -> Backend:
    if ray is not None:
        from interdrive.batches.ray import Cluster  # noqa: PLC0415 - optional

        return Cluster(ray, None, timeout_s=run_timeout)
    return _Here() if workers == 1 and math.isinf(run_timeout) else Pool(workers, timeout_s=run_timeout)


class _Search:
    """A search under way."""

    def __init__(
        self, folder: SearchFolder, pairs: Sequence[Pair], setup: Setup, method: Method, backend: Backend
    ) -> None:
        self.folder, self.setup, self.backend = folder, setup, backend
        if folder.undisturbed is None:
            folder.describe(self._undisturbed(pairs))
        self._ended = folder.undisturbed or []
        self.pairs = [pair for pair, (*_, how) in zip(pairs, self._ended, strict=True) if how[:1] != _UNFIT]
        choices = tuple(name in CHOICES for name in setup.space.coordinates)
        self._allocation = Allocation(len(self.pairs), choices, setup.seed, method)
        self._attempts: Counter[str] = Counter()
        self._digests: set[str] = set()
        for row in folder.rows:
            self.is_to_be_kept(row)

    def _undisturbed(self, pairs: Sequence[Pair]) -> list[tuple[str, int, str]]:
        """Scenario and id of every agent with the kind of its failure in the recording as it is; "" without one.

        Raises:
            InputError: The planner, the traffic or the predictor cannot be used, or no agent has a route.
        """
        trials = iter([(place, Trial(self.setup, pair)) for place, pair in enumerate(pairs)])
        found: dict[int, Driven | InterdriveError] = {}
        for end in self.backend.run(drive, lambda _: _task(next(trials, None))):
            found[end.task.payload[0]] = _value(end, pairs[end.task.payload[0]])
        refused = [one for one in found.values() if isinstance(one, InterdriveError)]
        if len(refused) == len(found):
            raise refused[0]
        ended = []
        for place, pair in enumerate(pairs):
            one = found[place]
            how = f"{_UNFIT}{one}" if isinstance(one, InterdriveError) else one.judged.failure if one.judged else ""
            ended.append((pair.scenario, pair.agent_id, how))
        return ended

    def run(self, limits: _Limits, on_run: Callable[[int, int], None] | None) -> None:
        """Drives until a limit is reached; each run is in the log when a later one is added."""
        rows = self.folder.rows
        n_kept = sum(bool(row["folder"]) for row in rows)
        try:
            while len(rows) < limits.runs and n_kept < limits.failures and time.monotonic() < limits.deadline:
                proposals = self._allocation.proposals(len(rows), rows)
                wanted = int(min(len(proposals), limits.runs - len(rows)))
                for row in _Round(self, proposals[:wanted], limits.deadline).rows():
                    self.folder.add(row)
                    n_kept += bool(row["folder"])
                    if on_run is not None:
                        on_run(len(rows), n_kept)
                    if n_kept >= limits.failures:
                        return
        finally:
            self.folder.write_table()

    def row(self, proposal: Proposal, driven: Driven | InterdriveError) -> dict[str, Any]:
        """The row of a run, not yet kept; of a run that is lost with the reason."""
        pair = self.pairs[proposal.pair]
        if isinstance(driven, InterdriveError):
            driven, said = Driven((), 0, None), str(driven)
        else:
            said = change_at(self.setup, pair, driven.point).words()
        found = driven.judged
        row: dict[str, Any] = {
            "index": proposal.index,
            "pair": proposal.pair,
            "scenario": pair.scenario,
            "agent_id": pair.agent_id,
            "source": proposal.source,
            "uniform": proposal.source == "uniform",
            "draws": driven.draws,
            "point": list(driven.point),
            "disturbance": said,
            **dict.fromkeys(("outcome", "criticality")),
            **dict.fromkeys(("failure", "signature", "folder", "witness", "digest"), ""),
            "partner_id": -1,
        }
        if found is None:
            return row
        return row | {
            "outcome": found.outcome,
            "criticality": found.criticality,
            "failure": found.failure,
            "partner_id": found.partner_id,
            "digest": found.digest,
            "signature": signature(pair, found),
        }

    def is_to_be_kept(self, row: Mapping[str, Any]) -> bool:
        """Whether a failure is new: few of its signature came before it, and none that is equal. Rows come in order."""
        name = row["signature"]
        if not name or self._attempts[name] >= KEPT_MAX or row["digest"] in self._digests:
            return False
        self._attempts[name] += 1
        self._digests.add(row["digest"])
        return True

    def kept(self, row: dict[str, Any], small: Sequence[float]) -> dict[str, Any]:
        """Stores a failure under its smallest disturbance.

        The row stays as it is if the file of that world does not fail, or if the same run is kept already.
        """
        pair = self.pairs[row["pair"]]
        change = change_at(self.setup, pair, small)
        name = f"{1 + sum(bool(one['folder']) for one in self.folder.rows):03d}"
        folder = self.folder.path / "failures" / name
        scenario = begin(folder, disturbed(scenario_at(pair.path), change))
        driven = drive_at(self.setup, pair, change, scenario)
        run = driven.run(scenario)
        verdict = judged(run, pair.agent_id)
        if not verdict.failure or any(one.digest == verdict.digest for one in failures(self.folder.path)):
            give_up(folder)
            return row
        avoided_by, avoided = witness(scenario, driven)
        failure = Failure(
            folder,
            driven,
            verdict.failure,
            verdict.words,
            change.words(),
            avoided_by,
            verdict.digest,
            row["signature"],
            _core.__version__,
        )
        finish(failure, run, avoided)
        return row | {"folder": name, "witness": avoided_by}

    def found(self, left_out: Sequence[str]) -> Found:
        """What is found until now."""
        by_source = yields(self.folder.rows)
        ended = [(f"{scenario} {agent}", how) for scenario, agent, how in self._ended if how]
        return Found(
            tuple(failures(self.folder.path)),
            len(self.folder.rows),
            by_source[0].runs,
            by_source[0].failures,
            by_source[0].rate,
            by_source,
            tuple(name for name, how in ended if how[:1] != _UNFIT),
            (*left_out, *(f"{name}: {how[1:]}" for name, how in ended if how[:1] == _UNFIT)),
        )


#: Before the reason why an agent cannot be driven at all.
_UNFIT = "!"


class _Round:
    """Runs whose points are chosen: which are driven next, and which failures are made small."""

    def __init__(self, search: _Search, proposals: Sequence[Proposal], deadline: float) -> None:
        self._search, self._proposals, self._deadline = search, proposals, deadline
        self._given = self._decided = 0
        self._rows: dict[int, dict[str, Any]] = {}  # by place in the round
        self._to_shrink: deque[int] = deque()
        self._small: dict[int, tuple[float, ...] | None] = {}  # None: nothing to keep

    def rows(self) -> Iterator[dict[str, Any]]:
        """The rows of the runs, in order, as they become known."""
        told = 0
        while self._to_shrink or self._has_more:
            for end in self._search.backend.run(drive, self._take):
                self._note(end)
                while told in self._small:
                    row, small = self._rows[told], self._small[told]
                    yield row if small is None else self._search.kept(row, small)
                    told += 1

    @property
    def _has_more(self) -> bool:
        return self._given < len(self._proposals) and time.monotonic() < self._deadline

    def _take(self, _group: str) -> Task[tuple[int, Trial]] | None:
        """The next task: failures are made small before others are looked for."""
        setup, pairs = self._search.setup, self._search.pairs
        if self._to_shrink:
            place = self._to_shrink.popleft()
            row = self._rows[place]
            trial = Trial(setup, pairs[row["pair"]], None, tuple(row["point"]), row["signature"])
            return _task((place, trial))
        if not self._has_more:
            return None
        place = self._given
        self._given += 1
        proposal = self._proposals[place]
        return _task((place, Trial(setup, pairs[proposal.pair], proposal)))

    def _note(self, end: End[tuple[int, Trial]]) -> None:
        """Notes how a task ended, and which failures are new."""
        place, trial = end.task.payload
        value = _value(end, trial.pair)
        if isinstance(value, InterdriveError) and not end.lost:
            raise value
        if trial.failing is not None:
            self._small[place] = None if isinstance(value, InterdriveError) else value.point
            return
        self._rows[place] = self._search.row(self._proposals[place], value)
        while self._decided in self._rows:
            if self._search.is_to_be_kept(self._rows[self._decided]):
                self._to_shrink.append(self._decided)
            else:
                self._small[self._decided] = None
            self._decided += 1


def _task(payload: tuple[int, Trial] | None) -> Task[tuple[int, Trial]] | None:
    return None if payload is None else Task(payload, payload[1].pair.path)


def _value(end: End[Any], pair: Pair) -> Driven | InterdriveError:
    """What a task returned, or why its process was lost."""
    if end.lost:
        return InterdriveError(f"{pair.scenario}, agent {pair.agent_id}: a run is lost: {end.why}")
    value: Driven | InterdriveError = end.value
    return value
