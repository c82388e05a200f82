"""Scores against a panel as a table."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from interdrive.scoring.total import GATES
from interdrive.storage import Column, absent_where, arrow_table

if TYPE_CHECKING:
    from interdrive.panel.judgement import PanelScore
    from interdrive.storage import ArrowTable

_GATES = tuple(Column(name, "number", f"gate {name}, after excuses; 1 where nothing happened", "1") for name in GATES)

#: Columns of scores against a panel.
PANEL_COLUMNS = (
    Column("agent_id", "integer", "participant id of the agent"),
    Column("planner", "label", "name of its planner"),
    *absent_where(
        "it cannot be told",
        (
            Column("score", "number", "from 0 to 1", "1"),
            *_GATES,
            Column("arrival", "number", "1/2 if it did not arrive where a driver of the panel did, else 1", "1"),
            Column("pace", "number", "time of the yardstick as a share of its own, 1 if it was in time", "1"),
            Column("ttc", "number", "1 if the time to contact straight on stayed above its bound, else 0", "1"),
            Column("hindrance", "number", "1 if others lose no more than with the best of the panel", "1"),
            Column("comfort", "number", "1 if all bounds of comfort held, else 0", "1"),
            Column("in_time", "truth", "it reached its goal in time"),
            Column("arrived", "truth", "it reached its goal, in time or later"),
            Column("duration", "number", "length of the drive", "s"),
            Column("distance", "number", "on the reference path", "m"),
            Column("free_flow", "number", "time that this distance takes in free flow", "s"),
            Column(
                "yard",
                "number",
                "time of the second fastest driver of the panel; inf: not that far",
                "s",
                infinite=True,
            ),
            Column("lost", "number", "time that others lose by it, in vehicle seconds", "s"),
            Column("forced", "truth", "another vehicle has to brake hard for it"),
            Column("hits", "integer", "how often others hit it without its fault"),
            Column("cls", "number", "score in nuPlan's form", "1"),
            Column("epdms", "number", "score in the form of NAVSIM's EPDMS", "1"),
            Column("excused", "label", "gates and terms that count as 1 because no driver of the panel does better"),
            Column("why", "text", "what made the score less than 1, in words"),
        ),
    ),
)


def panel_table(found: PanelScore) -> ArrowTable:
    """The scores `found`, one row per agent, sorted by id, as an Arrow table."""
    facts, totals = found.facts, found.totals
    return arrow_table(
        PANEL_COLUMNS,
        {
            "agent_id": found.ids,
            "planner": found.planners,
            **{
                name: [getattr(one, name) for one in totals]
                for name in ("score", "arrival", "pace", "ttc", "hindrance", "comfort", "yard", "cls", "epdms")
            },
            **{name: [one.gates[name] for one in totals] for name in GATES},
            **{
                name: [getattr(one, name) for one in facts]
                for name in ("in_time", "arrived", "duration", "free_flow", "lost")
            },
            "forced": [None if math.isnan(one.lost) else one.forced for one in facts],
            "hits": found.hits,
            "distance": [one.way for one in facts],
            "excused": [", ".join(one.excused) for one in totals],
            "why": ["; ".join(reasons) for reasons in found.reasons],
        },
    )
