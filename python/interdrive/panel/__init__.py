"""Scores against a panel: what drivers of interdrive reach in the place of an agent, and what others lose by it.

found = interdrive.panel.panel_score(run)
found.score                 # from 0 to 1, shape (agents,)
found.why(305)              # "pace 0.62: 14.8 s for 61 m, where lawful took 8.0 and idm 9.2 s"

Definitions, sources and limits: docs/reference/panel_score.md.
"""

from interdrive.panel.counterfactual import counterfactual
from interdrive.panel.judgement import PANEL, PanelScore, panel_drives, panel_score
from interdrive.panel.stored import PanelFolder
from interdrive.panel.tables import PANEL_COLUMNS, panel_table
from interdrive.panel.worlds import World

__all__ = [
    "PANEL",
    "PANEL_COLUMNS",
    "PanelFolder",
    "PanelScore",
    "World",
    "counterfactual",
    "panel_drives",
    "panel_score",
    "panel_table",
]
