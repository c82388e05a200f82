"""Scores as a table, stored in the folder of their run."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from interdrive.run.arrays import COLLISION_TYPES
from interdrive.scoring.faults import FAULT_KINDS
from interdrive.scoring.preventability import PREVENTABLE
from interdrive.storage import (
    Column,
    absent_where,
    arrow_table,
    check_order,
    check_table,
    read_table,
    replacing,
    write_table,
)

if TYPE_CHECKING:
    from interdrive.scoring.evaluation import Score
    from interdrive.storage import ArrowTable

#: Columns of scores; batches have them, too.
SCORE_COLUMNS = absent_where(
    "it was not scored",
    (
        Column("score", "number", "from 0 to 1", "1"),
        Column("score_strict", "number", "the same without excuses for what the recording does itself", "1"),
        Column("progress", "number", "along the reference path, as a share of the recording's", "1"),
        Column("ttc_term", "number", "1 if the time to contact straight on stayed above its bound, else 0", "1"),
        Column("speed_term", "number", "1 without speeding, less with it", "1"),
        Column("comfort_term", "number", "1 if all bounds of comfort held, else 0", "1"),
        Column("direction", "number", "1, 1/2 or 0 by the metres driven against the lane", "1"),
        Column("fault", "truth", "a collision with another participant was its fault"),
        Column("fault_kind", "label", "why it was its fault; empty: it was not", labels=("", *FAULT_KINDS)),
        Column("fault_nuplan", "truth", "nuPlan's verdict on the collision"),
        Column("collision_type", "label", "nuPlan's type of the collision; empty: none", labels=("", *COLLISION_TYPES)),
        *absent_where("it did not collide with another participant", PREVENTABLE.values()),
        Column("room", "number", "distance left minus distance needed by the rule that decided", "m"),
        Column("straight_ttc_min", "number", "smallest time to contact straight on; inf: none", "s", infinite=True),
        Column("lane_keeping", "number", "share of time within 0.5 m of the reference path", "1"),
        Column("excused", "label", "factors and terms that count as 1 because the recording's are 0"),
        Column("why", "text", "what made the score less than 1, in words"),
    ),
)

COLUMNS = (Column("agent_id", "integer", "participant id of the agent"), *SCORE_COLUMNS)

_TABLE = "score.parquet"


def score_columns(found: Score) -> dict[str, Any]:
    """The columns of all agents as sequences, in the order of `found.ids`."""
    return {
        "score": found.score,
        "score_strict": found.score_strict,
        **found.terms,
        "fault": found.fault,
        "fault_kind": found.fault_kind,
        "fault_nuplan": found.fault_nuplan,
        "collision_type": found.collision_type,
        **{
            PREVENTABLE[name].name: [None if math.isnan(value) else bool(value) for value in values.tolist()]
            for name, values in found.preventable.items()
        },
        "excused": [", ".join(names) for names in found.excused],
        "why": ["; ".join(reasons) for reasons in found.reasons],
    }


def score_table(found: Score) -> ArrowTable:
    """The scores `found`, one row per agent, sorted by id, as an Arrow table."""
    return arrow_table(COLUMNS, {"agent_id": found.ids, **score_columns(found)})


def save_score(found: Score, folder: str | Path) -> Path:
    """Writes the scores `found` as score.parquet into a folder; an older one is replaced.

    Raises:
        ResultsError: The file cannot be written; one line with path and cause.
    """
    path = Path(folder) / _TABLE
    with replacing(path) as partial:
        write_table(score_table(found), partial, found.origin)
    return path


def stored_score(folder: str | Path) -> ArrowTable | None:
    """What `save_score` wrote into a `folder`; None if nothing was written.

    Raises:
        ResultsError: The file is damaged or has other columns.
    """
    path = Path(folder) / _TABLE
    if not path.exists():
        return None
    table = read_table(path, COLUMNS)
    check_order(check_table(table, path, COLUMNS), path, ("agent_id",))
    return table
