"""What rollouts have in common: their settings, and processes that share them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from interdrive.batches.pool import Pool, Task
from interdrive.config.binding import bind
from interdrive.config.schema import SimulationSettings
from interdrive.errors import InterdriveError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from interdrive.config.binding import Setting
    from interdrive.config.schema import SettingsSpec
    from interdrive.scenario.known_goals import Information
    from interdrive.traffic_realism.windows import Window

#: What vehicles have in rollouts unless settings say otherwise.
_USUAL: Mapping[str, Setting] = {
    "agents.min_displacement": 2.0,
    "step.entry_wait": 5.0,
    "record.violations": False,
    "record.orders": False,
}


def rollout_settings(given: SettingsSpec | None, goals: Information) -> SimulationSettings:
    """Settings of rollouts whose vehicles know so much of their recording."""
    if isinstance(given, SimulationSettings):
        usual = {name: value for name, value in _USUAL.items() if name.startswith("record.")}
        return bind(given, {**usual, "goal.information": goals})
    return bind(SimulationSettings(), {**_USUAL, **(given or {}), "goal.information": goals})


def planning_from(settings: SimulationSettings, window: Window) -> SimulationSettings:
    """The same for a window: vehicles plan from its start on."""
    return replace(settings, agents=replace(settings.agents, plan_from=window.start * window.scenario.dt))


def done(
    function: Callable[[Any, int], Any],
    jobs: Sequence[Any],
    workers: int,
    on_step: Callable[[str, int, int], None] | None,
    what: str,
) -> Iterator[Any]:
    """What a function returns for each job, in order."""
    if min(workers, len(jobs)) <= 1:
        for i, job in enumerate(jobs):
            if on_step is not None:
                on_step(what, i, len(jobs))
            yield _raised(function(job, 0))
        return
    waiting = iter([Task((i, function, job)) for i, job in enumerate(jobs)])
    found: dict[int, Any] = {}
    next_one = 0
    with Pool(min(workers, len(jobs))) as pool:
        for end in pool.run(_called, lambda _group: next(waiting, None)):
            found[end.task.payload[0]] = InterdriveError("realism", end.why) if end.lost else end.value
            if on_step is not None:
                on_step(what, len(found) + next_one, len(jobs))
            while next_one in found:
                yield _raised(found.pop(next_one))
                next_one += 1


def _called(payload: tuple[int, Callable[[Any, int], Any], Any], attempt: int) -> Any:  # noqa: ANN401 - any answer
    return payload[1](payload[2], attempt)


def _raised(answer: Any) -> Any:  # noqa: ANN401 - any answer
    if isinstance(answer, InterdriveError):
        raise answer
    return answer
