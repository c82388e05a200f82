"""What an agent chose from and planned against at a time step, from what the run recorded."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from interdrive.plots.view import Bools, Floats
    from interdrive.run import RunRecord


@dataclass(frozen=True)
class AgentView:
    """One agent at one time step.

    Attributes:
        candidates: Positions of candidates [m], shape (candidates, points, 2); nan beyond their ends.
        cost: Of each candidate; nan where it was not needed.
        rejected: Whether the candidate was rejected.
        means: Predicted positions of visible participants [m], shape (modes, 1 + points, 2), from the present one on.
        covariance: Of the predicted ones [m²], shape (modes, points, 2, 2).
        probability: Of each mode.
    """

    candidates: Floats
    cost: Floats
    rejected: Bools
    means: Floats
    covariance: Floats
    probability: Floats


class AgentViews:
    """What a run recorded about one agent; empty where `record.candidates` or `record.predictions` was not set."""

    def __init__(self, run: RunRecord, agent_id: int | None) -> None:
        """Of an agent of the run; of none, there is nothing."""
        self._run, self._agent_id = run, agent_id
        self.exist = agent_id is not None and (run.candidates is not None or run.predictions is not None)
        driven = run.plans.time_step[run.plans.agent_id == agent_id]
        #: Time steps at which the agent has a plan, ascending.
        self.time_steps: list[int] = driven.tolist() if self.exist else []
        kept = run.candidates
        self._kept_at = np.unique(kept.time_step[kept.agent_id == agent_id]) if kept is not None else driven[:0]

    def at(self, time_step: int) -> AgentView | None:
        """At a time step, with the candidates that were recorded last; none while the agent does not drive."""
        if time_step not in self.time_steps:
            return None
        run, states = self._run, self._run.states
        candidates, cost, rejected = np.empty((0, 0, 2)), np.empty(0), np.empty(0, dtype=np.bool_)
        before = self._kept_at[self._kept_at <= time_step]
        if run.candidates is not None and len(before):
            made = run.candidates
            rows = np.flatnonzero((made.agent_id == self._agent_id) & (made.time_step == before[-1]))
            candidates, cost = np.stack([made.x[rows], made.y[rows]], axis=-1), made.cost[rows]
            rejected = np.array([bool(made.rejection[row]) for row in rows.tolist()], dtype=np.bool_)
        if run.predictions is None:
            return AgentView(candidates, cost, rejected, np.empty((0, 1, 2)), np.empty((0, 0, 2, 2)), np.empty(0))
        told = run.predictions
        seen = told.participant_id != self._agent_id
        if run.views is not None and self._agent_id is not None:
            seen = np.isin(told.participant_id, run.views.seen_by(self._agent_id, time_step))
        # What was received is known to its receivers only.
        rows = np.flatnonzero((told.time_step == time_step) & (told.sender_id < 0) & seen)
        who, column = (
            np.searchsorted(states.participant_id, told.participant_id[rows]),
            time_step - states.first_time_step,
        )
        now = np.stack([states.x[who, column], states.y[who, column]], axis=-1)
        means = np.concatenate([now[:, None], np.stack([told.x[rows], told.y[rows]], axis=-1)], axis=1)
        return AgentView(candidates, cost, rejected, means, told.covariance[rows], told.probability[rows])
