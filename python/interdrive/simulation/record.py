"""What a run leaves: its record until now, as arrays."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from interdrive.run import Plans, Views
from interdrive.run.assemble import (
    agent_records,
    digest,
    first_states,
    hits_of,
    named_by_sumo,
    outcomes_of,
    states_of,
    timings_of,
)
from interdrive.run.cooperation import agreements_of, cooperation_notes, messages_of
from interdrive.run.flows import demand_of
from interdrive.run.orders import orders_of
from interdrive.run.reasons import ended_early, reasons
from interdrive.run.violations import violations
from interdrive.runs import Run

if TYPE_CHECKING:
    from collections.abc import Mapping

    from interdrive.run import Demand, Orders, Outcomes, States
    from interdrive.run.assemble import FirstState
    from interdrive.simulation.preparation import Preparation
    from interdrive.simulation.progress import Progress


def outcomes_until_now(progress: Progress) -> Outcomes:
    """How agents have ended, without reasons."""
    return outcomes_of(progress.world.outcomes(), progress.made.planner_names, progress.called.tracebacks)


def orders_until_now(progress: Progress) -> Orders | None:
    """What agents were told; None if none enters junctions by order and none has waited."""
    orders = orders_of(progress.world.waits())
    return orders if progress.world.obeying or len(orders.agent_id) else None


def explained_run(progress: Progress, plans: Plans, *, with_violations: bool) -> Run:
    """The run until now with reasons of outcomes, and perhaps violations."""
    run = unexplained_run(progress, plans)
    made, world = progress.made, progress.world
    broken = violations(run, made.road, made.areas, world.obeying, world.entries()) if with_violations else None
    return replace(run, outcomes=replace(run.outcomes, reason=reasons(run, made.road)), violations=broken)


def unexplained_run(progress: Progress, plans: Plans) -> Run:
    """The run until now without reasons and violations."""
    states = states_of(progress.world.states())
    firsts = first_states(states, progress.made.waiting)
    return assembled_run(progress, states=states, plans=plans, firsts=firsts, digest=digest(states))


def assembled_run(
    progress: Progress,
    *,
    states: States,
    plans: Plans,
    firsts: Mapping[int, FirstState],
    digest: str,
) -> Run:
    """The run until now without reasons and violations, for one whose states and plans need not all be in the world.

    Args:
        progress: Of the run.
        states: Its states.
        plans: Its plans.
        firsts: When and how each generated vehicle was there for the first time.
        digest: Of all its states.
    """
    made = progress.made
    settings, dt = made.settings, made.scenario.dt
    world, logs, sumo, now = progress.world, progress.logs, progress.sumo, progress.world.time_step
    outcomes = outcomes_until_now(progress)
    negotiates = settings.v2x.negotiate and bool(world.equipped)
    return Run(
        scenario=made.scenario,
        settings=made.repeatable_settings(progress.threads),
        agents=agent_records(made.as_entered(firsts), made.planner_names),
        outcomes=outcomes,
        states=states,
        plans=plans,
        timings=timings_of(logs.times),
        notes=(
            *ended_early(outcomes, now, dt),
            *made.notes,
            *(() if sumo is None else sumo.notes()),
            *progress.called.notes,
            *cooperation_notes(settings.v2x, world.equipped, plans, dt),
            *(
                f"{a} and {b} overlap when they enter: their contact counts only after they have separated"
                for a, b in progress.touching
            ),
        ),
        digest=digest,
        finished=world.is_done,
        views=Views(**world.sightings()) if settings.record.views else None,
        orders=orders_until_now(progress) if settings.record.orders else None,
        messages=messages_of(world.messages()) if settings.record.messages != "none" else None,
        agreements=agreements_of(world.agreements()) if negotiates else None,
        hits=hits_of(progress.hits) if settings.collision.not_at_fault == "hitter_leaves" else None,
        cooperation=logs.cooperation(world),
        demand=_demand(made, firsts, outcomes),
        sumo=None if sumo is None else named_by_sumo(sumo.names),
        profile=logs.profile(now),
        predictions=logs.predictions(now),
        candidates=logs.candidates(now),
    )


def _demand(made: Preparation, firsts: Mapping[int, FirstState], outcomes: Outcomes) -> Demand | None:
    traffic = made.traffic
    if not made.settings.traffic.is_on:
        return None
    lanes = traffic.lane_ids, traffic.due, traffic.exit_ids, traffic.lengths
    entered = {number: first.time_step for number, first in firsts.items()}
    return demand_of(traffic.agents, lanes, entered, outcomes, made.scenario.dt)
