"""Criticality of the agents of a run, from its own tables or evaluated."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.criticality import MEASURES, evaluate
from interdrive.criticality.tables import criticality_extremes_table, criticality_table, stored_criticality
from interdrive.storage import is_of
from interdrive.storage.arrow_arrays import values_of

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from interdrive.array_types import Floats, Ints
    from interdrive.run import RunRecord
    from interdrive.storage import ArrowTable

_PLACES = {measure.name: place for place, measure in enumerate(MEASURES)}


@dataclass(frozen=True)
class Measured:
    """All measures of the agents over time; rows of partners are those of the run's states, -1 for none.

    Attributes:
        value: Shape (measures, agents, time_steps); inf: no conflict, nan: absent or cannot be computed.
        partner: Row of the decisive participant, same shape.
        extreme: Most critical value of each agent, shape (measures, agents).
        extreme_step: Column of the states at which it is. extreme_partner: The other participant.
    """

    value: Floats
    partner: Ints
    extreme: Floats
    extreme_step: Ints
    extreme_partner: Ints


def measured_of(folder: Path, run: RunRecord) -> Measured | None:
    """From the run's own tables if it has them, evaluated with default settings otherwise; None without agents.

    Raises:
        ResultsError: if the tables are damaged.
        InputError: if the run cannot be evaluated.
    """
    if not run.agents:
        return None
    tables = stored_criticality(folder)
    if tables is None or not is_of(tables[0], run.digest):
        found = evaluate(run)
        tables = criticality_table(found), criticality_extremes_table(found)
    shape = len(MEASURES), len(run.outcomes.agent_id)
    series, extremes = (_placed(run, table) for table in tables)
    value, partner = np.full((*shape, run.states.n_steps), np.nan), np.full((*shape, run.states.n_steps), -1)
    at = series.measure, series.agent, series.step
    value[at], partner[at] = series.value, series.partner
    extreme, extreme_partner, extreme_step = np.full(shape, np.nan), np.full(shape, -1), np.zeros(shape, dtype=np.int64)
    at_most = extremes.measure, extremes.agent
    extreme[at_most], extreme_partner[at_most] = extremes.value, extremes.partner
    extreme_step[at_most] = np.clip(extremes.step, 0, run.states.n_steps - 1)
    return Measured(value, partner, extreme, extreme_step, extreme_partner)


@dataclass(frozen=True)
class _Entries:
    """Rows of a table of criticality as places in arrays."""

    measure: Ints
    agent: Ints
    step: Ints
    value: Floats
    partner: Ints


def _placed(run: RunRecord, table: ArrowTable) -> _Entries:
    """The rows that are about agents of the run."""
    column = columns_of(table, ("participant_id", "time_step", "measure", "value"))
    agents = run.outcomes.agent_id
    known = np.isin(column["participant_id"], agents)
    return _Entries(
        measure=np.array([_PLACES[name] for name in column["measure"][known].tolist()], dtype=np.int64),
        agent=np.searchsorted(agents, column["participant_id"][known]),
        step=column["time_step"][known] - run.states.first_time_step,
        value=column["value"][known],
        partner=rows_of(run, values_of(table["partner_id"], -1)[known]),
    )


def rows_of(run: RunRecord, ids: Ints) -> Ints:
    """Rows of the states for participant ids; -1 for ids without a row."""
    known = run.states.participant_id
    at = np.searchsorted(known, ids).clip(max=max(0, len(known) - 1))
    found: Ints = np.where(known[at] == ids, at, -1) if len(known) else np.full_like(ids, -1)
    return found


def columns_of(table: ArrowTable, names: Sequence[str]) -> dict[str, Any]:
    """Columns of an Arrow table as numpy arrays."""
    return {name: values_of(table[name]) for name in names}
