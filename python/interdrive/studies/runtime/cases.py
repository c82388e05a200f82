"""What the runtime study drives: scenarios and numbers of agents."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from interdrive.files import FOLDER_VARIABLE, recorded_scenario, scenario_folders, shipped_scenario

#: Numbers of agents in the four scenarios; all of them come on top.
COUNTS = (1, 2, 4, 8, 16, 24)
#: In the town, whose first vehicles live in a proportional part of it.
TOWN_COUNTS = (24, 100, 300, 1000)
TOWN = "town"
HIGHWAY = "USA_US101-23_1_T-1"


@dataclass(frozen=True)
class RuntimeCase:
    """A scenario to drive with several numbers of agents.

    Attributes:
        kind: What it shows, for people.
        path: CommonRoad file.
        counts: Numbers of agents, ascending; None stands for all of them.
        predictor: Name of the predictor.
    """

    kind: str
    path: Path
    counts: tuple[int | None, ...]
    predictor: str = "lane_following"


#: Kind, file below the folder of recorded scenarios, and the shipped scenario that stands in for it.
_FOUR = (
    ("six-lane highway", f"highway/{HIGHWAY}.xml", "highway"),
    ("large intersection", "intersection/USA_Lanker-2_8_T-1.xml", "intersection"),
    ("residential area", "urban/DEU_Muc-12_1_T-1.xml", None),
    ("urban arterial", "urban/CHN_Sha-3_1_T-1.xml", None),
)


def runtime_cases(
    counts: tuple[int, ...] = COUNTS, town_counts: tuple[int, ...] = TOWN_COUNTS, *, to_all: bool = True
) -> tuple[tuple[RuntimeCase, ...], tuple[str, ...]]:
    """The four scenarios, the highway once more with `neural`, and the town; and what the user should know about them.

    Recorded scenarios are looked for below the folders that the environment variable INTERDRIVE_SCENARIOS names;
    shipped ones stand in for missing ones.

    Args:
        counts: Numbers of agents in the four scenarios.
        town_counts: Numbers of agents in the town; none: it is left out.
        to_all: Go on to all agents of the four scenarios.
    """
    folders = os.pathsep.join(map(str, scenario_folders()))
    ends: tuple[int | None, ...] = (None,) if to_all else ()
    cases, notes = [], []
    for kind, file, shipped in _FOUR:
        path = recorded_scenario(file)
        if path is None:
            stands_in = f"shipped {shipped} instead" if shipped else "left out"
            why = f"it is not in {folders}" if folders else f"{FOLDER_VARIABLE} names no folder"
            notes.append(f"{Path(file).stem}: {why}; {stands_in}")
            path = shipped_scenario(shipped) if shipped else None
        if path is not None:
            cases.append(RuntimeCase(kind, path, (*counts, *ends)))
    with_neural = tuple(n for n in counts if n == 24)
    if with_neural:
        cases.append(RuntimeCase(cases[0].kind, cases[0].path, with_neural, "neural"))
    if town_counts:
        cases.append(RuntimeCase("town", shipped_scenario(TOWN), town_counts))
    return tuple(cases), tuple(notes)
