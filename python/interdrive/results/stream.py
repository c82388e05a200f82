"""The tables of a run that is under way: written part by part, so that what is written need not be held."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from interdrive.results.columns import COLUMNS
from interdrive.results.folder import write_information
from interdrive.results.information import origin_of_run
from interdrive.results.tables import (
    TABLES,
    outcome_table,
    table_of_plans,
    table_of_routes,
    table_of_states,
)
from interdrive.storage import TableWriter, write_parquet

if TYPE_CHECKING:
    from pathlib import Path

    from interdrive.criticality import AgentHarm
    from interdrive.run import Plans, RunRecord, States

#: The routes of so many agents are written at once.
_AGENTS = 50


class RunTables:
    """A run folder that grows."""

    def __init__(self, folder: Path, run: RunRecord) -> None:
        """Begins the tables of states and plans.

        Args:
            folder: Where.
            run: The run until now: settings and scenario are those of the whole.
        """
        self._folder, self._dt = folder, run.scenario.dt
        # The digest is known once all is written.
        origin = origin_of_run(run)
        origin = replace(origin, inputs={name: text for name, text in origin.inputs.items() if name != "run"})
        self._parts = {
            name: TableWriter(folder / f"{name}.parquet", COLUMNS[name], origin)
            for name in ("states", "plans", "routes")
        }

    def close(self) -> None:
        """Closes all files."""
        for writer in self._parts.values():
            writer.close()

    def write(self, states: States, plans: Plans) -> None:
        """Adds states and plans of the time steps that follow those before."""
        self._parts["states"].write(table_of_states(states, self._dt))
        self._parts["plans"].write(table_of_plans(plans))

    def finish(self, run: RunRecord, harm: AgentHarm) -> None:
        """Writes all else.

        Args:
            run: The whole run, without the states of what moves and without plans.
            harm: Of its agents.
        """
        for first in range(0, len(run.agents), _AGENTS):
            self._parts["routes"].write(table_of_routes(run.agents[first : first + _AGENTS]))
        self.close()
        rows = {name: writer.num_rows for name, writer in self._parts.items()}
        origin = origin_of_run(run)
        for name, made in TABLES.items():
            if name in self._parts:
                continue
            table = outcome_table(run, harm) if name == "outcomes" else made(run)
            if table is not None:
                write_parquet(table, self._folder / f"{name}.parquet", origin)
                rows[name] = table.num_rows
        lacks = ("the vehicles, which are in states.parquet: they were written while they drove",)
        write_information(run, self._folder, rows, lacks=lacks)
