"""V2X on the page of a run: how old the plans are that agents have received, and where they hold for others."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from interdrive.run import SERVICES

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from interdrive.array_types import Floats, Ints
    from interdrive.report.packing import Packer
    from interdrive.run import Messages, RunRecord

#: Resolutions: positions [m], headings [rad].
_METRE, _RADIAN = 0.01, 0.001

#: Ages are counted in time steps; older ones do not fit into a byte.
AGE_MAX = 255


def pack_cooperation(packer: Packer, run: RunRecord, origin: Floats, age_max: float) -> None:
    """Links and bars, as far as they were recorded.

    Adds `link_rows`, shape (links, 2): rows of receiver and sender; `link_age` and `link_lost`, shape (links, steps);
    `bar_rows`, shape (bars, 2): rows of the agent that holds and of that for which it holds (-1: its way is blocked);
    `bar_steps`, shape (bars, 2); `bar_xy`, shape (bars, 2), and `bar_heading`.

    Args:
        packer: Takes the arrays.
        run: The run.
        origin: Positions are relative to it [m].
        age_max: Older messages are forgotten [s].
    """
    if run.messages is not None:
        rows, age, lost = links(run.messages, run, age_max)
        if len(rows):
            packer.add("link_rows", rows)
            packer.add("link_age", age)
            packer.add("link_lost", lost)
    found = run.agreements
    if found is not None and len(found.holding_id):
        first = run.states.first_time_step
        packer.add("bar_rows", np.stack([_rows(run, found.holding_id), _rows(run, found.going_id)], axis=1))
        packer.add("bar_steps", np.stack([found.first_time_step, found.last_time_step], axis=1) - first)
        packer.add("bar_xy", np.stack([found.bar_x, found.bar_y], axis=1) - origin, unit=_METRE)
        packer.add("bar_heading", found.bar_heading, unit=_RADIAN)


def links(messages: Messages, run: RunRecord, age_max: float) -> tuple[Ints, Ints, NDArray[np.bool_]]:
    """Plans that agents have received.

    Args:
        messages: Of the run, with the rows of receivers.
        run: The run.
        age_max: Older messages are forgotten [s].

    Returns:
        Rows of receiver and sender, shape (links, 2), sorted; the age of the newest plan that has arrived, in time
        steps, shape (links, steps), 0 without one; and whether the newest plan sent before does not arrive.
    """
    first, n = run.states.first_time_step, run.states.n_steps
    is_link = (messages.service == SERVICES.index("mcm")) & (messages.receiver_id >= 0)
    receiver, sender = _rows(run, messages.receiver_id[is_link]), _rows(run, messages.sender_id[is_link])
    sent, arrived = messages.time_step[is_link] - first, messages.arrived[is_link]
    pairs, which = np.unique(np.stack([receiver, sender], axis=1), axis=0, return_inverse=True)
    newest = np.full((len(pairs), n), -1, dtype=np.int64)
    has_come = arrived >= 0
    then = arrived[has_come] - first
    inside = then < n
    np.maximum.at(newest, (which.ravel()[has_come][inside], then[inside]), sent[has_come][inside])
    newest = np.maximum.accumulate(newest, axis=1)
    step = np.arange(n)
    age = np.where(newest >= 0, step - newest, 0)
    age[age * run.scenario.dt > age_max + 1e-9] = 0
    # A message takes at least one time step.
    after = np.minimum(sent + 1, n - 1)
    latest = np.zeros((len(pairs), n), dtype=np.int64)
    # Positive: sent and arrives; negative: sent and lost; the later one decides.
    mark = (sent + 1) * np.where(has_come, 1, -1)
    order = np.argsort(sent, kind="stable")
    latest[which.ravel()[order], after[order]] = mark[order]
    place = np.maximum.accumulate(np.where(latest != 0, step, 0), axis=1)
    lost = np.take_along_axis(latest, place, axis=1) < 0
    return pairs, np.minimum(age, AGE_MAX), lost


def _rows(run: RunRecord, ids: Ints) -> Ints:
    """Rows of the states; -1 for no participant."""
    rows: Ints = np.where(ids >= 0, np.searchsorted(run.states.participant_id, ids), -1)
    return rows
