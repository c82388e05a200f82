"""Scores against a panel: what drivers of interdrive reach in the place of an agent, and what others lose by it.

found = interdrive.score(run, [305])
found.score                 # from 0 to 1, shape (agents,)
found.why(305)              # "pace 0.62: 14.8 s for 61 m, where lawful took 8.0 and idm 9.2 s"

Definitions, sources and limits: docs/reference/scoring.md.
"""

from interdrive.panel.counterfactual import counterfactual
from interdrive.panel.scores import DEFAULT, NONE, PANEL, chosen_panel, panel_drives, score, why_driven_anew
from interdrive.panel.stored import PanelFolder
from interdrive.panel.worlds import World

__all__ = [
    "DEFAULT",
    "NONE",
    "PANEL",
    "PanelFolder",
    "World",
    "chosen_panel",
    "counterfactual",
    "panel_drives",
    "score",
    "why_driven_anew",
]
