"""The case studies of the paper by name, each with the encounters it consists of."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from interdrive.errors import InputError
from interdrive.files import FOLDER_VARIABLE, recorded_scenario, scenario_folders, shipped_scenario


@dataclass(frozen=True)
class Case:
    """An encounter to study.

    Attributes:
        scenario: File, in `STUDIES` below the folder of recorded scenarios, or name of a shipped scenario.
        agent: Id of the vehicle that always plans.
        other: Id of the vehicle whose behaviour is varied.
    """

    scenario: str
    agent: int
    other: int

    @property
    def is_shipped(self) -> bool:
        """The scenario comes with the package."""
        return not self.scenario.endswith(".xml")


#: Merging: vehicle 1 has to leave the lane that ends, vehicle 2 comes from behind on the other one; the same with the
#: roles of the scenario's own planning problem; and the planning problem of the shipped scenario with the car that
#: was recorded behind it. T-junction: both vehicles turn left and cross; in the shipped scenario the planning problem
#: turns left across the way of the first car from the left.
STUDIES = {
    "merge": (
        Case("merge/ZAM_Zip-1_56_T-1.xml", 1, 2),
        Case("merge/ZAM_Zip-1_56_T-1.xml", 29, 2),
        Case("lane_merge", 2001, 1004),
    ),
    "t_junction": (Case("t_junction/ZAM_Tjunction-1_42_T-1.xml", 60000, 5), Case("t_junction", 2001, 1001)),
}


def known_cases(name: str) -> tuple[tuple[Case, ...], tuple[str, ...]]:
    """The cases of the study `name` with the paths of their files, and notes for the user.

    Recorded scenarios are looked for below the folders that the environment variable INTERDRIVE_SCENARIOS names; if it
    is not set, the study consists of the shipped scenario alone.

    Raises:
        InputError: No such study, or no folder holds the scenario.
    """
    if name not in STUDIES:
        raise InputError(f"no study '{name}'; there are {', '.join(STUDIES)}")
    folders = scenario_folders()
    cases = []
    left_out: dict[str, None] = {}
    for case in STUDIES[name]:
        if case.is_shipped:
            path: Path | None = shipped_scenario(case.scenario)
        elif folders:
            path = recorded_scenario(case.scenario)
            if path is None:
                wanted = folders[-1] / case.scenario
                raise InputError(
                    f"{wanted}: no such file; {FOLDER_VARIABLE} must name the folder of recorded scenarios"
                )
        else:
            left_out[case.scenario] = None
            continue
        cases.append(Case(str(path), case.agent, case.other))
    notes = tuple(f"{scenario} is left out: {FOLDER_VARIABLE} does not name its folder" for scenario in left_out)
    return tuple(cases), notes
