"""The runtime study next to its targets, as tables of docs/research/performance.md, and the memory of a large run."""

from __future__ import annotations

import json
import multiprocessing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from interdrive.studies.runtime import RuntimeStudy, growth, step_rows, summary_table
from interdrive.studies.runtime.cases import HIGHWAY, TOWN
from interdrive.studies.runtime.summary import QUIET, STEP_PARTS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

#: Of all scenarios of the study [s].
TIME_STEP = 0.1
#: Peak memory is told for a run of so many agents and steps.
MEMORY_AGENTS, MEMORY_STEPS = 1000, 300


@dataclass(frozen=True)
class Target:
    """A number to reach.

    Attributes:
        name: Key among measured numbers.
        what: For people.
        value: The number, in `unit` times `scale`.
        unit: Written behind it.
        scale: From the unit to SI.
        at_most: The measured number should not be larger; else not smaller.
        command: What measures it.
    """

    name: str
    what: str
    value: float
    unit: str
    scale: float = 1.0
    at_most: bool = True
    command: str = "interdrive study runtime"


_BENCH, _PEERS = "make bench", "benchmarks/peers/"
_COMMANDS, _LEARNING = "benchmarks/commands.py", "benchmarks/environments.py"
#: Key of the target of 24 agents, and kind of the study's scenario.
KINDS = {
    "step_highway": "six-lane highway",
    "step_intersection": "large intersection",
    "step_residential": "residential area",
    "step_arterial": "urban arterial",
}

TARGETS = (
    *(
        Target(name, f"step, 24 agents, {kind}", aim, "ms", 1e-3)
        for (name, kind), aim in zip(KINDS.items(), (0.8, 1.5, 1.5, 2.0), strict=True)
    ),
    Target("step_slow", "99 % of the steps of these four, the slowest of them", 6.0, "ms", 1e-3),
    Target("step_24_neural", f"24 agents, {HIGHWAY}, neural", 5.0, "ms", 1e-3),
    Target("step_1000", "1000 agents in the town", 25.0, "ms", 1e-3),
    Target("growth", "growth from 24 to 1000 agents, to linear", 1.1, "times"),
    Target("second_thread", f"second thread, 24 agents, {HIGHWAY}", 1.85, "times", 1.0, False),
    Target("python_share", f"share of Python, 24 agents, {HIGHWAY}", 5.0, "%", 1e-2),
    Target("run_highway", f"whole `interdrive run` of {HIGHWAY}, 24 agents, CPU", 0.6, "s", 1.0, True, _COMMANDS),
    Target("run_arterial", "whole `interdrive run` of CHN_Sha-3_1_T-1, 24 agents, CPU", 1.0, "s", 1.0, True, _COMMANDS),
    Target("start", f"command to first step, {HIGHWAY}, all agents", 0.25, "s", 1.0, True, "benchmarks/start.py"),
    Target("import", "`import interdrive`, Python itself included", 0.05, "s", 1.0, True, _COMMANDS),
    Target("help", "`interdrive --help`", 0.15, "s", 1.0, True, _COMMANDS),
    Target("development", "100 development files, all agents, one call", 8.0, "s", 1.0, True, _COMMANDS),
    Target("T1", "agent-steps per second of T1", 1e6, "/s", 1.0, False, _LEARNING),
    Target("T2", "the same of T2", 200_000.0, "/s", 1.0, False, _LEARNING),
    Target("T3", "the same of T3", 400_000.0, "/s", 1.0, False, _LEARNING),
    Target("T6", "the same of T6", 30_000.0, "/s", 1.0, False, _LEARNING),
    Target("memory", "peak memory, 1000 agents, 300 steps", 0.4, "GB", 1e9, True, "benchmarks/targets.py --memory"),
    Target("plan_ratio", "one plan of frenet against the frenetix 0.4 binary", 100.0, "times", 1.0, False, _BENCH),
    Target("peer_ratio", "step against the peer", 1000.0, "times", 1.0, False, _PEERS + "handler.py"),
    Target("highway_env_ratio", "step against highway-env", 1.0, "times", 1.0, False, _PEERS + "rule_based.py"),
)


def read_study(folder: Path) -> RuntimeStudy:
    """What `interdrive study runtime` wrote."""
    import pyarrow.parquet as pq

    told = json.loads((folder / "runtime.json").read_text(encoding="utf-8"))
    steps = pq.read_table(folder / "steps.parquet")
    return RuntimeStudy(steps, told["threads"], told["machine"], told["settings"], tuple(told["notes"]))


def measured_targets(study: RuntimeStudy) -> dict[str, float]:
    """Measured numbers by name of their target, in SI units; those that the study did not measure are missing."""
    rows = summary_table(study).to_pylist()
    by_run = {(row["scenario"], row["predictor"], row["agents"], row["threads"]): row for row in rows}
    found: dict[str, float] = {}
    name = "lane_following"
    slow = []
    for key, kind in KINDS.items():
        wanted = (kind, name, 24, study.threads)
        for row in rows:
            if (row["kind"], row["predictor"], row["agents"], row["threads"]) == wanted:
                found[key] = row["median"]
                slow.append(row["slow"])
    if len(slow) == len(KINDS):
        found["step_slow"] = max(slow)
    highway = by_run.get((HIGHWAY, name, 24, study.threads))
    if highway is not None:
        found["python_share"] = highway["python"] / highway["median"]
        alone = by_run.get((HIGHWAY, name, 24, 1))
        if alone is not None and study.threads == 2:
            found["second_thread"] = alone["median"] / highway["median"]
    neural = by_run.get((HIGHWAY, "neural", 24, study.threads))
    if neural is not None:
        found["step_24_neural"] = neural["median"]
    town = [row for row in rows if row["kind"] == TOWN and row["agents"] == 1000 and row["threads"] == study.threads]
    if town:
        found["step_1000"] = town[0]["median"]
        grown = growth(study, study.threads)
        if grown is not None and grown.agents[0] == 24:
            found["growth"] = grown.to_linear
    return found


def target_rows(found: Mapping[str, float]) -> list[tuple[str, str, str, str]]:
    """Per target: what, the target, what was measured, and whether it is reached (or the command that measures it)."""
    rows = []
    for target in TARGETS:
        sign = "≤" if target.at_most else "≥"
        aim = f"{sign} {target.value:g} {target.unit}"
        if target.name not in found:
            rows.append((target.what, aim, "–", f"measured by {target.command}"))
            continue
        value = found[target.name] / target.scale
        reached = value <= target.value if target.at_most else value >= target.value
        short = 100.0 * (max(value / target.value, target.value / value) - 1.0)
        verdict = "reached" if reached else f"missed by {short:.0f} %" if short >= 1.0 else f"missed by {short:.1g} %"
        rows.append((target.what, aim, f"{value:.4g} {target.unit}", verdict))
    return rows


def targets_markdown(found: Mapping[str, float]) -> str:
    """Targets next to what was measured."""
    return _table(("what", "target", "measured", ""), "lrrl", target_rows(found))


def steps_markdown(study: RuntimeStudy) -> str:
    """Milliseconds per step of every scenario and number of agents."""
    several = study.threads
    header = (
        *("scenario", "agents", "1 thread", f"{several} threads", "ratio", "99 %"),
        *STEP_PARTS,
        "Python",
    )
    return _table(header, "l" + (len(header) - 1) * "r", step_rows(study))


def growth_markdown(study: RuntimeStudy) -> str:
    """How the time of a step grows in the town."""
    rows = []
    for threads in sorted({1, study.threads}):
        found = growth(study, threads)
        if found is None:
            continue
        per_agent = ", ".join(f"{1e6 * s / n:.0f} at {n}" for n, s in zip(found.agents, found.seconds, strict=True))
        rows.append((str(threads), per_agent, f"{found.exponent:.3f}", f"{found.to_linear:.2f}"))
    return _table(("threads", "µs per agent and step", "exponent", "growth to linear"), "rlrr", rows)


def planned_per_core_second(study: RuntimeStudy) -> str:
    """Seconds of agents that plan at every step, by those that one core needs for them; most agents of each kind."""
    rows = [row for row in summary_table(study).to_pylist() if row["threads"] == 1]
    most = {(row["kind"], row["predictor"]): row for row in sorted(rows, key=lambda row: row["agents"])}
    cells = [
        (kind if predictor == "lane_following" else f"{kind}, {predictor}", str(row["agents"]), f"{agent_seconds:,.0f}")
        for (kind, predictor), row in most.items()
        for agent_seconds in [row["agents"] * TIME_STEP / row["median"]]
    ]
    return _table(("one core", "agents", "planned agent-seconds per core-second"), "lrr", cells)


def document(study: RuntimeStudy) -> str:
    """All of it."""
    what = study.machine
    settings = study.settings
    where = f"{what['processor']}, {what['cores']} cores, {what['system']}, Python {what['python']}"
    busy = what["load"] > QUIET * what["cores"]
    parts = [
        f"{where}; up to {settings['steps']} steps per run, {settings['repetitions']} runs of each kind.",
        *([f"**The machine was busy** (load {what['load']:.1f} before): all times are too long."] if busy else []),
        "Milliseconds per step, median (quartiles); parts with all threads:",
        steps_markdown(study),
    ]
    if growth(study, study.threads) is not None:
        parts.append(growth_markdown(study))
    parts.append(planned_per_core_second(study))
    parts += [f"- {note}" for note in study.notes]
    return "\n\n".join(parts) + "\n"


def _table(header: Sequence[str], sides: str, rows: Sequence[Sequence[str]]) -> str:
    rule = "|".join("--:" if side == "r" else "---" for side in sides)
    lines = [" | ".join(cells) for cells in (header, *rows)]
    return "\n".join([f"| {lines[0]} |", f"|{rule}|", *(f"| {line} |" for line in lines[1:])])


def peak_memory(agents: int = MEMORY_AGENTS, steps: int = MEMORY_STEPS) -> float:
    """Peak memory of a process that drives the town and records it [bytes]."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return float(pool.apply(_recorded, (agents, steps)))


def _recorded(agents: int, steps: int) -> float:
    import resource

    from interdrive.simulation import simulate

    simulate(TOWN, agents=agents, predictor="lane_following", settings={"step.max_steps": steps})
    return 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
