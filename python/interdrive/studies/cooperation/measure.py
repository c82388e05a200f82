"""Runs of the study of cooperation, and the row of its table that becomes of each."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.config.binding import bind, flatten
from interdrive.config.plugins import DEFAULT_PLANNER
from interdrive.config.specs import read_planner, read_predictor
from interdrive.criticality import evaluate
from interdrive.files import open_scenario
from interdrive.run import PLAN_STATUS
from interdrive.simulation import simulate
from interdrive.storage import Column, arrow_table
from interdrive.studies.cooperation.deadlock import STANDING_SPEED, deadlocks

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from interdrive.config.binding import Setting
    from interdrive.config.schema import SimulationSettings
    from interdrive.runs import Run
    from interdrive.storage import ArrowTable
    from interdrive.studies.cooperation.variants import Variant

COLUMNS = (
    Column("scenario", "label", "name of the scenario"),
    Column("variant", "label", "name of the variant"),
    Column("penetration", "number", "share of equipped agents", "1"),
    Column("negotiate", "truth", "agents agree which goes first"),
    Column("delay", "number", "delay of messages", "s"),
    Column("loss", "number", "probability that a message is lost", "1"),
    Column("occlusion", "truth", "agents do not see what vehicles hide"),
    Column("services", "label", "what is sent"),
    Column("seed", "integer", "seed of the run"),
    Column("agents", "integer", "number of agents"),
    Column("equipped", "integer", "number of agents with V2X"),
    Column("reached", "integer", "agents that reached their goal in time"),
    Column("late", "integer", "agents that reached it late"),
    Column("time_limit", "integer", "agents whose time was over"),
    Column("missed", "integer", "agents that missed their goal"),
    Column("collisions", "integer", "agents that collided with a participant or left the road"),
    Column("time", "number", "mean time of an agent until its outcome", "s"),
    Column("min_ttc", "number", "least time to collision along lanes of all agents", "s", null="no agent has V2X"),
    Column("ttc_share", "number", "share of the time of all agents with a TTC of less than 1.5 s", "1"),
    Column("emergency_steps", "integer", "plans that are emergency braking"),
    Column("longest_wait", "number", "longest time that an agent stood", "s"),
    Column("deadlocks", "integer", "circles of agents that stand for 10 s because of each other"),
    Column("messages", "number", "messages per second", "1"),
    Column("load", "number", "largest load of a receiver, as a share of 6 Mbit/s", "1", null="no agent has V2X"),
    Column("received_share", "number", "share of messages received", "1", null="no agent has V2X"),
    Column("plan_age", "number", "mean age of the plans that were used", "s", null="no agent has V2X"),
    Column(
        "used_share", "number", "share of known participants planned with a received plan", "1", null="no agent has V2X"
    ),
)

#: A TTC below this is critical [s].
_CRITICAL = 1.5


@dataclass(frozen=True)
class CooperationStudy:
    """Runs of the study.

    Attributes:
        table: One row per run, columns `COLUMNS`.
        planner: Planner of all agents.
        predictor: Predictor of all agents.
        settings: Settings of all runs besides those of the variants.
        notes: What the user should know.
        inputs: SHA-256 of the scenarios, by name.
    """

    table: ArrowTable
    planner: str
    predictor: str
    settings: Mapping[str, Any]
    notes: tuple[str, ...]
    inputs: Mapping[str, str] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"<CooperationStudy: {self.table.num_rows} runs, planner {self.planner}>"


def cooperation_study(
    files: Sequence[Path],
    variants: Sequence[Variant],
    *,
    seeds: int = 2,
    planner: str = DEFAULT_PLANNER,
    predictor: str = "neural",
    settings: SimulationSettings,
    threads: int | None = None,
    notes: Sequence[str] = (),
    on_run: Callable[[str, int, int], None] | None = None,
) -> CooperationStudy:
    """Drives every scenario in every variant, with all agents; several seeds where the seed matters.

    Args:
        files: CommonRoad files.
        variants: What to compare.
        seeds: Number of seeds.
        planner: Planner of all agents.
        predictor: Predictor of all agents.
        settings: Settings of all runs.
        threads: Threads that plan; results do not depend on them.
        notes: What the user should know.
        on_run: Called after every run with its scenario, its number and that of all runs.

    Raises:
        InputError: A file or setting cannot be used.
    """
    planned = [(variant, seed) for variant in variants for seed in range(seeds if variant.is_drawn else 1)]
    driver, expected = read_planner(planner, settings.planner), read_predictor(predictor, settings.predictor)
    rows: list[dict[str, Any]] = []
    inputs: dict[str, str] = {}
    for file in files:
        scenario = open_scenario(file, raw=settings.recording.raw, start=settings.recording.start)
        inputs[scenario.name] = scenario.sha256
        for variant, seed in planned:
            values: dict[str, Setting] = {**variant.settings, "record.violations": False}
            run = simulate(
                scenario,
                planner=driver,
                predictor=expected,
                settings=bind(settings, values),
                seed=seed,
                threads=threads,
            )
            rows.append(_row(run, variant, seed, threads))
            if on_run is not None:
                on_run(scenario.name, len(rows), len(files) * len(planned))
    table = arrow_table(COLUMNS, {column.name: [row[column.name] for row in rows] for column in COLUMNS})
    return CooperationStudy(table, planner, predictor, flatten(settings), tuple(notes), inputs)


def _row(run: Run, variant: Variant, seed: int, threads: int | None) -> dict[str, Any]:
    ended = run.outcomes
    count = {kind: ended.outcome.count(kind) for kind in set(ended.outcome)}
    dt = run.scenario.dt
    start = np.array([agent.start_time_step for agent in run.agents])
    told = run.cooperation or {}
    messages: Any = told.get("messages", {})
    ttc = evaluate(run, threads=threads).series["ttc"].value
    return {
        "scenario": run.scenario.name,
        "variant": variant.name,
        "penetration": variant.penetration,
        "negotiate": variant.negotiate,
        "delay": variant.delay,
        "loss": variant.loss,
        "occlusion": variant.occlusion,
        "services": variant.services if variant.penetration > 0 else "",
        "seed": seed,
        "agents": len(ended.outcome),
        "equipped": len(told.get("equipped", ())),  # type: ignore[arg-type]
        "reached": count.get("goal_reached", 0),
        "late": count.get("goal_reached_late", 0),
        "time_limit": count.get("time_limit", 0),
        "missed": count.get("goal_missed", 0),
        "collisions": count.get("collision", 0),
        "time": float(np.mean(ended.time_step - start) * dt) if len(start) else 0.0,
        "min_ttc": float(np.nanmin(ttc)) if np.isfinite(ttc).any() else None,
        "ttc_share": float(np.sum(ttc < _CRITICAL) / max(1, np.sum(~np.isnan(ttc)))),
        "emergency_steps": int(np.sum(run.plans.status == PLAN_STATUS.index("emergency_braking"))),
        "longest_wait": _longest_wait(run),
        "deadlocks": len(deadlocks(run)),
        "messages": sum(messages.values()) / max(dt, run.states.n_steps * dt) if messages else 0.0,
        "load": told.get("peak_load"),
        "received_share": told.get("received_share"),
        "plan_age": told.get("plan_age_mean"),
        "used_share": told.get("planned_with_plan"),
    }


def _longest_wait(run: Run) -> float:
    """Longest time that an agent stood [s]."""
    longest = 0
    for row in np.flatnonzero(run.states.is_agent):
        stands = run.states.valid[row] & (abs(run.states.velocity[row]) < STANDING_SPEED)
        change = np.flatnonzero(np.diff(np.concatenate([[False], stands, [False]]).astype(int)))
        longest = max(longest, *(change[1::2] - change[::2]).tolist(), 0)
    return longest * run.scenario.dt
