"""Scores as a table, stored in the folder of their run."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from interdrive.errors import ResultsError
from interdrive.run.arrays import COLLISION_TYPES
from interdrive.scoring.faults import FAULT_KINDS
from interdrive.scoring.preventability import PREVENTABLE
from interdrive.scoring.total import GATES
from interdrive.storage import (
    Column,
    absent_where,
    arrow_table,
    check_order,
    check_table,
    column_names,
    read_table,
    replacing,
    write_table,
)

if TYPE_CHECKING:
    from interdrive.scoring.evaluation import Score
    from interdrive.storage import ArrowTable

#: Columns of scores; batches have them, too.
SCORE_COLUMNS = absent_where(
    "it was not scored, or it cannot be told",
    (
        Column("score", "number", "from 0 to 1", "1"),
        Column("score_1", "number", "score of earlier releases, from 0 to 1; the next release will not have it", "1"),
        Column("panel", "label", "drivers that drove in its place; empty: none did, the score is absolute"),
        *(
            Column(f"gate_{name}", "number", f"gate {name}, after excuses; 1 where nothing happened", "1")
            for name in GATES
        ),
        Column("arrival", "number", "1/2 if it did not arrive where a driver of the panel did, else 1", "1"),
        Column("pace", "number", "time of the yardstick as a share of its own, 1 if it was in time", "1"),
        Column("ttc_term", "number", "1 if the time to contact straight on stayed above its bound, else 0", "1"),
        Column("hindrance", "number", "1 if others lose no more than with the best of the panel", "1"),
        Column("comfort_term", "number", "1 if all bounds of comfort held, else 0", "1"),
        Column("in_time", "truth", "it reached its goal in time, also after it was hit"),
        Column("arrived", "truth", "it reached its goal, in time or later"),
        Column("duration", "number", "length of the drive", "s"),
        Column("way", "number", "distance on the reference path", "m"),
        Column("free_flow", "number", "time that this distance takes in free flow", "s"),
        Column(
            "yard", "number", "time of the second fastest driver of the panel; inf: not that far", "s", infinite=True
        ),
        Column("lost", "number", "time that others lose by it, in vehicle seconds", "s"),
        Column("forced", "truth", "another vehicle has to brake hard for it"),
        Column("hits", "integer", "how often others hit it without its fault"),
        Column("cls", "number", "score in nuPlan's form", "1"),
        Column("epdms", "number", "score in the form of NAVSIM's EPDMS", "1"),
        Column("fault", "truth", "a collision with another participant was its fault"),
        Column("fault_kind", "label", "why it was its fault; empty: it was not", labels=("", *FAULT_KINDS)),
        Column("fault_nuplan", "truth", "nuPlan's verdict on the collision"),
        Column("collision_type", "label", "nuPlan's type of the collision; empty: none", labels=("", *COLLISION_TYPES)),
        *absent_where("it did not collide with another participant", PREVENTABLE.values()),
        Column("room", "number", "distance left minus distance needed by the rule that decided", "m"),
        Column("straight_ttc_min", "number", "smallest time to contact straight on; inf: none", "s", infinite=True),
        Column("lane_keeping", "number", "share of time within 0.5 m of the reference path", "1"),
        Column("excused", "label", "gates and terms that count as 1 because no driver of the panel does better"),
        Column("why", "text", "what made the score less than 1, in words"),
    ),
)

#: Columns of scores of earlier releases that are gone; their `score` is `score_1` now.
FORMER_COLUMNS = ("score_strict", "progress", "ttc_term", "speed_term", "comfort_term", "direction")

COLUMNS = (Column("agent_id", "integer", "participant id of the agent"), *SCORE_COLUMNS)

_TABLE = "score.parquet"


def score_columns(found: Score) -> dict[str, Any]:
    """The columns of all agents as sequences, in the order of `found.ids`."""
    is_lost_known = np.isfinite(found.terms["lost"])
    return {
        "score": found.score,
        "score_1": found.score_1,
        "panel": [", ".join(found.panel)] * len(found.ids),
        **found.terms,
        "in_time": found.in_time,
        "arrived": found.arrived,
        "forced": [bool(one) if known else None for one, known in zip(found.forced, is_lost_known, strict=True)],
        "hits": found.hits,
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
    """What `save_score` wrote into a `folder`; None if nothing was written, or an earlier release did.

    Raises:
        ResultsError: The file is damaged or has other columns.
    """
    path = Path(folder) / _TABLE
    if not path.exists():
        return None
    try:
        table = read_table(path, COLUMNS)
    except ResultsError:
        if "score_strict" in column_names(path):
            return None
        raise
    check_order(check_table(table, path, COLUMNS), path, ("agent_id",))
    return table
