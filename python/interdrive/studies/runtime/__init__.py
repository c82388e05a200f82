"""The runtime study: how long a step takes, over the number of agents, with one thread and with all of them.

Kaufeld, Trauth, Betz, "Investigating Driving Interactions", IV 2024, section V: four scenarios with at least 24
vehicles. Beyond it the town, with up to a thousand agents at constant density.
"""

from interdrive.studies.runtime.cases import COUNTS, TOWN_COUNTS, RuntimeCase, runtime_cases
from interdrive.studies.runtime.folder import RUNTIME_FOLDER, save_runtime
from interdrive.studies.runtime.measure import RuntimeStudy, runtime_study
from interdrive.studies.runtime.summary import Growth, growth, step_rows, summary_table

__all__ = [
    "COUNTS",
    "RUNTIME_FOLDER",
    "TOWN_COUNTS",
    "Growth",
    "RuntimeCase",
    "RuntimeStudy",
    "growth",
    "runtime_cases",
    "runtime_study",
    "save_runtime",
    "step_rows",
    "summary_table",
]
