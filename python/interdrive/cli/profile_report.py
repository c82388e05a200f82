"""What `interdrive run --profile` prints: the time of phases, planners and agents."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.markup import escape

from interdrive.cli.report import output, print_table, table_of
from interdrive.results.costs import agent_costs, phase_costs, planner_costs
from interdrive.run.goals import said_seconds
from interdrive.run.reasons import said_count

if TYPE_CHECKING:
    from interdrive.results.costs import Cost
    from interdrive.runs import Run

#: So many agents are listed; profile.parquet has all.
_AGENTS_MAX = 10

_NUMBERS = ("calls", "total [ms]", "share", "median [ms]", "95 % [ms]", "longest [ms]")


def print_costs(run: Run) -> None:
    """Prints what took how long, measured while the run was simulated."""
    console = output()
    phases = phase_costs(run)
    whole = sum(cost.total for cost in phases)
    steps = max((cost.calls for cost in phases), default=0)
    threads = said_count(int(run.settings["threads"]), "thread")
    table = table_of(("phase", *_NUMBERS), right=_NUMBERS, title=f"{said_count(steps, 'step')}, {1e3 * whole:.1f} ms")
    for cost in phases:
        table.add_row(_phase(run, cost), *_numbers(cost, whole))
    print_table(console, table, 1)
    if not (planners := planner_costs(run)):
        return
    planned = sum(cost.total for cost in planners)
    columns = ("agents", *_NUMBERS)
    title = f"\nplans, {1e3 * planned:.1f} ms of {threads} and processes together"
    table = table_of(("planner", "part", *columns, "longest at"), right=columns, title=title)
    for cost in planners:
        table.add_row(
            escape(cost.name),
            cost.part,
            str(cost.agents),
            *_numbers(cost, planned),
            f"{cost.most_at[0]}, {_at(run, cost)}",
        )
    print_table(console, table, 2)
    agents = agent_costs(run)
    shown = list(dict.fromkeys(cost.name for cost in agents))[:_AGENTS_MAX]
    title = f"\nthe {len(shown)} agents that took most of it" if len(run.agents) > len(shown) else "\nagents"
    table = table_of(("agent", "part", *_NUMBERS, "longest at"), right=("agent", *_NUMBERS), title=title)
    for cost in agents:
        if cost.name in shown:
            table.add_row(cost.name, cost.part, *_numbers(cost, planned), _at(run, cost))
    print_table(console, table, 2)
    console.print("every call is in profile.parquet, every phase in timing.parquet", style="dim")


def _phase(run: Run, cost: Cost) -> str:
    """The name of a phase, and whose it is."""
    if cost.name != "predict":
        return cost.name
    predictor = run.settings["predictor"]
    name = predictor.get("name", "") if isinstance(predictor, dict) else predictor
    return escape(f"predict ({name})")


def _numbers(cost: Cost, whole: float) -> tuple[str, ...]:
    share = 100.0 * cost.total / whole if whole > 0.0 else 0.0
    times = (f"{1e3 * seconds:.3f}" for seconds in (cost.median, cost.high, cost.most))
    return (str(cost.calls), f"{1e3 * cost.total:.1f}", f"{share:.1f} %", *times)


def _at(run: Run, cost: Cost) -> str:
    return f"{said_seconds(cost.most_at[1], run.scenario.dt)} s"
