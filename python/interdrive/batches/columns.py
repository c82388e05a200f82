"""The data set of a batch: its columns, and the rows of one run."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive import _core
from interdrive.batches.plan import TRAFFIC
from interdrive.criticality import MEASURES, AgentHarm, agent_harm
from interdrive.planners import NATIVE
from interdrive.run import OUTCOMES, PHASES, VIOLATIONS, Outcomes
from interdrive.run.flows import whole_flow
from interdrive.scoring import SCORE_COLUMNS, score_columns
from interdrive.storage import Column, absent_where, arrow_table, inserted, named, without

if TYPE_CHECKING:
    from collections.abc import Mapping, Set

    from interdrive.array_types import Floats
    from interdrive.batches.plan import RunSpec
    from interdrive.criticality import Criticality
    from interdrive.runs import Run
    from interdrive.scoring import Score
    from interdrive.storage import ArrowTable

#: How a run can end. Agents exist only in finished ones.
STATUS = ("finished", "refused", "failed", "crashed", "timeout", "memory")

#: A TTC under this is critical [s]; Vogel, "A comparison of headway and time to collision", 2003.
TTC_CRITICAL = 2.0

#: How a run that is worth a look ended for one of the agents under test.
NOT_ARRIVED = tuple(outcome for outcome in OUTCOMES if not outcome.startswith("goal_reached"))


def extreme(name: str, *, grows: bool) -> str:
    """Name of the column with the most critical value of a measure."""
    return f"{name}_{'max' if grows else 'min'}"


_UNFINISHED, _NOT_RECORDED, _TOO_FEW = "the run did not finish", "violations were not recorded", "too few states"


def _planned(name: str, text: str, unit: str) -> Column:
    """A column of numbers about planned states."""
    return Column(name, "number", text, unit, null=_TOO_FEW)


#: Columns that say which run it is and how it ended; the same in all rows of a run.
RUN_COLUMNS = (
    Column("key", "label", "id of the run: hash of scenario content, choices, settings and version"),
    Column("scenario", "label", "name of the scenario file"),
    Column("category", "label", "folder of the scenario file"),
    Column("planner", "label", "planner under test, as given"),
    Column("predictor", "label", "predictor, as given"),
    Column("settings", "label", "settings of the batch that are not the defaults, NAME=VALUE each; empty: none"),
    Column(
        "traffic", "label", "behaviour of vehicles not under test: recorded, same, or a native planner", labels=TRAFFIC
    ),
    Column("agents", "label", "agents under test: all, a number, or alone: one agent per run"),
    Column("seed", "integer", "chooses a number of agents; 0 where each is alone"),
    Column(
        "status", "label", "how the run ended: finished, refused, failed, crashed, timeout or memory", labels=STATUS
    ),
    Column("error", "text", "reason why it did not finish"),
    Column("attempts", "integer", "number of attempts"),
    Column("digest", "text", "SHA-256 of all states; empty if it did not finish"),
    Column("dt", "number", "length of a time step", "s", null=_UNFINISHED),
    Column("n_steps", "integer", "number of simulated time steps", null=_UNFINISHED),
    Column("read_seconds", "number", "wall time for reading the scenario, 0 if it was at hand", "s", null=_UNFINISHED),
    Column("run_seconds", "number", "wall time for simulation, criticality and scores", "s", null=_UNFINISHED),
    Column("kept", "truth", "whether its run folder is kept in recordings/"),
    Column("path", "label", "path of the scenario file"),
    Column("scenario_sha256", "label", "content of the scenario file"),
    Column("version", "label", "version of interdrive"),
)

#: Columns of the run's outcomes that the data set takes over, and those of the harm of collisions.
_ENDED = without(Outcomes.columns, ("agent_id", "planner", "outcome", "time_step", "time_s", "traceback"))
_HARM = named(AgentHarm.columns, ("impact_area", "harm", "partner_harm"))

_NO_TRAFFIC = "no generated traffic"

#: Columns about the generated traffic of a run; the same in all rows of a run.
TRAFFIC_COLUMNS = (
    Column("traffic_flow", "number", "generated vehicles that left the map per hour", "1/h", null=_NO_TRAFFIC),
    Column("traffic_speed", "number", "mean speed of generated vehicles on the map", "m/s", null=_NO_TRAFFIC),
    Column(
        "traffic_wait",
        "number",
        "mean time that they waited before the map, until the end if they had not entered by then",
        "s",
        null=_NO_TRAFFIC,
    ),
    Column("traffic_queue", "integer", "most of them that waited before one lane at once", null=_NO_TRAFFIC),
)

#: Columns about one agent; null in the one row of a run that did not finish.
AGENT_COLUMNS = absent_where(
    _UNFINISHED,
    (
        Column("agent_id", "integer", "participant id of the agent"),
        Column("under_test", "truth", "whether it is under test; otherwise it is traffic"),
        Column("agent_planner", "label", "name of its own planner"),
        Column("outcome", "label", "one of interdrive.run.OUTCOMES", labels=(*OUTCOMES, "running")),
        Column("seconds", "number", "from its start to its end, simulated", "s"),
        Column("distance", "number", "driven", "m"),
        *inserted(_ENDED, _HARM, before="message"),
        *(
            Column(
                extreme(measure.name, grows=measure.grows),
                "number",
                f"most critical {measure.title}; inf: no conflict",
                measure.unit or "1",
                null="it cannot be computed",
                infinite=True,
            )
            for measure in MEASURES
        ),
        Column("ttc_critical", "number", f"share of its time with a TTC under {TTC_CRITICAL:g} s", "1"),
        _planned("jerk_rms", "root mean square of the longitudinal jerk, behind its first planned state", "m/s³"),
        _planned("jerk_max", "largest absolute longitudinal jerk, behind its first planned state", "m/s³"),
        _planned("acceleration_rms", "root mean square of the longitudinal acceleration of planned states", "m/s²"),
        _planned("deceleration_max", "hardest braking of planned states", "m/s²"),
        _planned("lateral_acceleration_rms", "root mean square of speed times yaw rate of planned states", "m/s²"),
        _planned("lateral_acceleration_max", "largest absolute speed times yaw rate of planned states", "m/s²"),
        Column("emergencies", "integer", "time steps with emergency braking"),
        Column("violations", "integer", "violations of rules of the road by the agent", null=_NOT_RECORDED),
        *(Column(f"n_{rule}", "integer", f"those of the rule {rule}", null=_NOT_RECORDED) for rule in VIOLATIONS),
        Column("plan_seconds", "number", "wall time per plan, mean over its time steps", "s", null="no plans"),
        *TRAFFIC_COLUMNS,
        *SCORE_COLUMNS,
    ),
)

COLUMNS = (*RUN_COLUMNS, *AGENT_COLUMNS)


def finished_rows(
    spec: RunSpec,
    run: Run,
    criticality: Criticality,
    scores: Score,
    under_test: Set[int],
    *,
    attempts: int,
    read_seconds: float,
    run_seconds: float,
    kept: bool,
) -> ArrowTable:
    """One row per agent of a finished run.

    Args:
        spec: What was asked for.
        run: What came of it.
        criticality: Its measures for all its agents.
        scores: Of its agents under test.
        under_test: Ids of the agents that count.
        attempts: How often the run was started.
        read_seconds: Wall time for reading the scenario [s].
        run_seconds: Wall time for simulation, criticality and scores [s].
        kept: The run folder is kept.
    """
    ended, harm = run.outcomes, agent_harm(run)
    ids = ended.agent_id.tolist()
    about = {
        "status": "finished",
        "attempts": attempts,
        "digest": run.digest,
        "dt": run.scenario.dt,
        "n_steps": len(np.unique(run.timings.time_step)),
        "read_seconds": read_seconds,
        "run_seconds": run_seconds,
        "kept": kept,
    }
    judged = np.isin(ids, criticality.participant_id)  # agents that never entered the world were not evaluated
    rows = np.searchsorted(criticality.participant_id, ids)
    present = criticality.present.sum(axis=1)
    exposed = ((criticality["ttc"] < TTC_CRITICAL) & criticality.present).sum(axis=1)
    share = exposed / np.maximum(present, 1)

    def of_agents(values: Floats) -> Floats:
        return np.where(judged, np.append(values, np.nan)[np.where(judged, rows, -1)], np.nan)

    emergencies = [int((run.plans.status[run.plans.agent_id == number] == 2).sum()) for number in ids]
    values: dict[str, Any] = {
        "agent_id": ids,
        "under_test": [number in under_test for number in ids],
        "agent_planner": ended.planner,
        "outcome": ended.outcome,
        **{column.name: ended.arrays[column.name] for column in _ENDED},
        **{column.name: harm.arrays[column.name] for column in _HARM},
        "ttc_critical": of_agents(share),
        "emergencies": emergencies,
        **_violations(run, ids),
        "plan_seconds": _plan_seconds(run),
        **_traffic(run, len(ids)),
        **{
            extreme(measure.name, grows=measure.grows): of_agents(criticality.extremes[measure.name].value)
            for measure in MEASURES
        },
        **comfort(run),
        **_scores(scores, ids),
    }
    return arrow_table(COLUMNS, {**_of_run(spec, about, len(ids)), **values})


def _traffic(run: Run, n: int) -> dict[str, list[float | None]]:
    """Flow, speed and queue of generated traffic, for n agents alike; None without it."""
    found = whole_flow(run)
    return {
        column.name: [None if found is None else getattr(found, column.name.removeprefix("traffic_"))] * n
        for column in TRAFFIC_COLUMNS
    }


def _scores(scores: Score, ids: list[int]) -> dict[str, list[Any]]:
    """The columns of scores for all agents; None for agents without a score."""
    place = {number: row for row, number in enumerate(scores.ids.tolist())}
    return {
        name: [None if number not in place else values[place[number]] for number in ids]
        for name, values in score_columns(scores).items()
    }


def _violations(run: Run, ids: list[int]) -> dict[str, list[int | None]]:
    """Violations of rules of the road by each agent, together and by rule; None if they were not recorded."""
    found = run.violations
    counts = (
        Counter()
        if found is None
        else Counter(
            (number, rule)
            for number, rule, source in zip(found.participant_id.tolist(), found.rule, found.source, strict=True)
            if source == "agent"
        )
    )
    by_rule = {rule: [None if found is None else counts[number, rule] for number in ids] for rule in VIOLATIONS}
    together = [None if found is None else sum(counts[number, rule] for rule in VIOLATIONS) for number in ids]
    return {"violations": together, **{f"n_{rule}": values for rule, values in by_rule.items()}}


def failure_row(spec: RunSpec, status: str, error: str, attempts: int) -> ArrowTable:
    """The one row of a run that did not finish: its status and why."""
    about = {
        "status": status,
        "error": " ".join(error.split()),
        "attempts": attempts,
        **dict.fromkeys(("dt", "n_steps", "read_seconds", "run_seconds")),
    }
    nothing: dict[str, Any] = {column.name: [None] for column in AGENT_COLUMNS}
    return arrow_table(COLUMNS, {**_of_run(spec, about, 1), **nothing})


def _of_run(spec: RunSpec, about: Mapping[str, object], n: int) -> dict[str, Any]:
    one = {
        "key": spec.key,
        "scenario": spec.scenario,
        "category": spec.category,
        "planner": spec.planner_label,
        "predictor": spec.predictor_label,
        "settings": spec.settings_label,
        "traffic": spec.traffic,
        "agents": spec.agents_label,
        "seed": spec.seed,
        "error": "",
        "digest": "",
        "kept": False,
        "path": spec.path,
        "scenario_sha256": spec.sha256,
        "version": _core.__version__,
        **about,
    }
    return {name: [value] * n for name, value in one.items()}


def comfort(run: Run) -> dict[str, list[float]]:
    """Comfort metrics, and distance and time of every agent; nan where there are too few states.

    The initial state of an agent comes from the scenario, not from its planner: neither its acceleration and yaw rate
    nor the jump from them to the first planned state count.

    Returns:
        By name of the column one value per agent, in the order of `run.outcomes`.
    """
    states, dt = run.states, run.scenario.dt
    found: dict[str, list[float]] = {}
    for number in run.outcomes.agent_id.tolist():
        row = int(np.searchsorted(states.participant_id, number))
        there = states.valid[row]
        planned = np.flatnonzero(there)[1:]
        acceleration = states.acceleration[row, planned]
        lateral = states.velocity[row, planned] * states.yaw_rate[row, planned]
        jerk = np.diff(acceleration) / dt
        way = np.hypot(np.diff(states.x[row, there]), np.diff(states.y[row, there]))
        for name, value in (
            ("seconds", dt * max(int(there.sum()) - 1, 0)),
            ("distance", float(way.sum())),
            ("jerk_rms", _rms(jerk)),
            ("jerk_max", _largest(np.abs(jerk))),
            ("acceleration_rms", _rms(acceleration)),
            ("deceleration_max", _largest(np.maximum(-acceleration, 0.0))),
            ("lateral_acceleration_rms", _rms(lateral)),
            ("lateral_acceleration_max", _largest(np.abs(lateral))),
        ):
            found.setdefault(name, []).append(value)
    return found


def _rms(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else float("nan")


def _largest(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return float(known.max()) if len(known) else float("nan")


def _plan_seconds(run: Run) -> list[float]:
    """Wall time per plan: all native plans of a step share its phase `plan`, all others `plan_python`, equally."""
    plans, timings = run.plans, run.timings
    native = {number for number, name in zip(run.outcomes.agent_id.tolist(), run.outcomes.planner, strict=True)
              if name in NATIVE}  # fmt: skip
    steps = timings.time_step[:: len(PHASES)]
    seconds = {phase: timings.seconds[k :: len(PHASES)] for k, phase in enumerate(PHASES)}
    place = np.searchsorted(steps, plans.time_step)
    is_native = np.isin(plans.agent_id, sorted(native))
    each = np.full(len(plans.time_step), np.nan)
    for kind, phase in ((is_native, "plan"), (~is_native, "plan_python")):
        together = np.bincount(place[kind], minlength=len(steps))
        each[kind] = (seconds[phase] / np.maximum(together, 1))[place[kind]]
    return [
        float(np.mean(each[plans.agent_id == number])) if (plans.agent_id == number).any() else float("nan")
        for number in run.outcomes.agent_id.tolist()
    ]
