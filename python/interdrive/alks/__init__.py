"""The manoeuvres of UN R157 over a grid of parameters: verdicts of reference drivers and of planners.

cases = interdrive.alks.grid("cut_in", "jrc_high")
found = interdrive.alks.driven(cases, "idm")
found.crash.sum()

Definitions and limits: docs/how_to/alks.md.
"""

from interdrive.alks.figures import case_figures
from interdrive.alks.grids import GRIDS, MANOEUVRES, Grid, grid
from interdrive.alks.verdicts import (
    ALKS_COLUMNS,
    Verdicts,
    boundary,
    driven,
    has_driver,
    is_comparable,
    reference,
    table_of,
)

__all__ = [
    "ALKS_COLUMNS",
    "GRIDS",
    "MANOEUVRES",
    "Grid",
    "Verdicts",
    "boundary",
    "case_figures",
    "driven",
    "grid",
    "has_driver",
    "is_comparable",
    "reference",
    "table_of",
]
