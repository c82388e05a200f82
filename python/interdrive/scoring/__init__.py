"""Scores: one number per agent, its terms, whose fault collisions are, and why.

found = interdrive.score(run)  # against a panel, which lies above; `score` here needs the run alone
found.score                 # from 0 to 1, shape (agents,)
found.terms["pace"]         # one of the parts
found.why(305)              # "at fault: cut off 12 at 3.2 s with 6.8 m left, 6.9 m needed"

Definitions, sources and limits: docs/reference/scoring.md.
"""

from interdrive.run.arrays import COLLISION_TYPES
from interdrive.scoring.evaluation import Score, has_recording, score
from interdrive.scoring.faults import FAULT_KINDS
from interdrive.scoring.preventability import (
    DRIVE_COLUMNS,
    ENTRIES,
    PREVENTABILITY_COLUMNS,
    UNDEFINED,
    Preventability,
    Witness,
    preventability,
)
from interdrive.scoring.settings import ComfortBounds, PanelWeights, ReactionSettings, ScoreWeights, ScoringSettings
from interdrive.scoring.tables import (
    FORMER_COLUMNS,
    SCORE_COLUMNS,
    save_score,
    score_columns,
    score_table,
    stored_score,
)

__all__ = [
    "COLLISION_TYPES",
    "DRIVE_COLUMNS",
    "ENTRIES",
    "FAULT_KINDS",
    "FORMER_COLUMNS",
    "PREVENTABILITY_COLUMNS",
    "SCORE_COLUMNS",
    "UNDEFINED",
    "ComfortBounds",
    "PanelWeights",
    "Preventability",
    "ReactionSettings",
    "Score",
    "ScoreWeights",
    "ScoringSettings",
    "Witness",
    "has_recording",
    "preventability",
    "save_score",
    "score",
    "score_columns",
    "score_table",
    "stored_score",
]
