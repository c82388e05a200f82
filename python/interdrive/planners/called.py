"""The planners of a run that are written in Python, in this process and in others."""

from __future__ import annotations

from contextlib import nullcontext
from typing import TYPE_CHECKING

from interdrive.errors import InputError
from interdrive.foreign import same_folder
from interdrive.planners.calls import Failure, ask, planned
from interdrive.planners.workers import Wanted, Workers, can_be_sent

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from interdrive import _core
    from interdrive.planners.calls import Answer
    from interdrive.planners.contract import Planner
    from interdrive.run.logs import Logs


class CalledPlanners:
    """Plans for the agents for whom the core has no planner.

    Attributes:
        notes: Why planners that could have processes of their own have none, one line each.
        tracebacks: Of the exceptions that ended agents, by id.
    """

    def __init__(
        self,
        planners: Mapping[int, Planner],
        names: Mapping[int, str],
        timeout_s: float,
        drivers: Mapping[int, dict[str, float]] | None = None,
    ) -> None:
        """All planners begin in this process.

        Args:
            planners: By the id of their agent.
            names: Of all planners, for messages.
            timeout_s: Time limit of a call [s].
            drivers: What drivers have drawn, for the views of their agents.
        """
        self._drivers = drivers or {}
        self._here = dict(planners)
        self._names, self._timeout_s = names, timeout_s
        self._workers: Workers | None = None
        self.notes: list[str] = []
        self.tracebacks: dict[int, str] = {}

    @property
    def willing(self) -> list[int]:
        """Agents whose planner allows a process of its own: its class has `parallel = True`."""
        return [i for i, planner in self._here.items() if getattr(planner, "parallel", False)]

    def move(self, make: Mapping[int, Callable[[], Planner]], stage: Callable[[], _core.World], threads: int) -> None:
        """Moves planners to separate processes; those that cannot be pickled stay.

        Args:
            make: Makes the planner of each agent.
            stage: Makes a world with the participants of the run.
            threads: So many processes work at a time.

        Raises:
            InputError: A process does not start, or a planner cannot be made there.
        """
        fit = {i: factory for i, factory in make.items() if can_be_sent(factory)}
        unfit = [i for i in make if i not in fit]
        if unfit:
            name = self._names[unfit[0]]
            why = "is parallel, but cannot be pickled for another process: it runs in this one"
            self.notes.append(f"planner {name} {why}")
        if fit:
            self._workers = Workers(stage, fit, threads, self._timeout_s)
            for i in fit:
                del self._here[i]

    def close(self) -> None:
        """Ends the processes."""
        if self._workers is not None:
            self._workers.close()
        self._workers = None

    def plan(self, world: _core.World, step: _core.Step, logs: Logs) -> None:
        """Calls the planners of agents that have no plan yet; one that fails ends its agent."""
        views = self._views(world, step, logs)
        answers = self._answers_of_workers(step, views, logs)
        with same_folder() if self._here else nullcontext():
            for agent_id, view in views.items():
                planner = self._here.get(agent_id)
                if planner is not None:
                    seen = logs.timed(agent_id, "view", step.predictions.seen_by, view)
                    answers[agent_id] = logs.timed(agent_id, "call", ask, planner, view, seen, self._timeout_s)
        for agent_id, view in views.items():
            answer = answers[agent_id]
            try:
                if not isinstance(answer, Failure):
                    logs.timed(agent_id, "check", step.set, view, *answer)
                    continue
            except InputError as error:
                answer = Failure(str(error))
            # File names need not be text.
            line, trace = (text.encode("utf-8", "replace").decode() for text in (answer.line, answer.traceback))
            name, time_step = self._names[agent_id], step.scene.time_step
            step.fail(agent_id, f"agent {agent_id}, planner {name}, time step {time_step}: {line}")
            self.tracebacks[agent_id] = trace

    def plan_unguarded(self, world: _core.World, step: _core.Step, logs: Logs) -> None:
        """The same without a time limit; whatever a planner raises passes through, for a debugger."""
        for agent_id, view in self._views(world, step, logs).items():
            seen = logs.timed(agent_id, "view", step.predictions.seen_by, view)
            plan = logs.timed(agent_id, "call", planned, self._here[agent_id], view, seen)
            logs.timed(agent_id, "check", step.set, view, *plan)

    def _views(self, world: _core.World, step: _core.Step, logs: Logs) -> dict[int, _core.View]:
        known, driver = step.predictions.known, self._drivers.get
        return {
            i: logs.timed(i, "view", world.view, step.scene, i, known=known(i), driver=driver(i)) for i in step.missing
        }

    def _answers_of_workers(self, step: _core.Step, views: Mapping[int, _core.View], logs: Logs) -> dict[int, Answer]:
        if self._workers is None:
            return {}
        predictions = step.predictions
        away = {i: view for i, view in views.items() if i not in self._here}
        told = {i: predictions.known(i) for i in away}
        wanted = {
            i: Wanted(view.ego._progress, told[i], predictions.seen_by(view) if told[i] else None, self._drivers.get(i))
            for i, view in away.items()
        }
        answers = self._workers.ask(step.scene, predictions, wanted)
        for agent_id, spent in self._workers.seconds.items():
            for part, seconds in zip(("view", "call"), spent, strict=True):
                logs.add_time(agent_id, part, seconds)
        return answers
