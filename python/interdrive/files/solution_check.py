"""The official checks of a CommonRoad solution, and its costs."""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from interdrive.errors import InputError, MissingExtraError
from interdrive.files.read import quiet

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path


@dataclass(frozen=True)
class SolutionCheck:
    """What the drivability checker says about a solution.

    Attributes:
        checks: By name of the check "" if it passes, otherwise why not.
        costs: Total costs of all problems; nan if they cannot be computed.
    """

    checks: Mapping[str, str]
    costs: float

    @property
    def is_valid(self) -> bool:
        """All checks pass."""
        return not any(self.checks.values())


def check_solution(document: bytes, scenario_file: Path) -> SolutionCheck:
    """Runs the seven checks of commonroad-drivability-checker one by one, then its cost function.

    Raises:
        MissingExtraError: It is not installed.
        InputError: It cannot read the scenario or the solution.
    """
    if importlib.util.find_spec("commonroad_dc") is None:
        raise MissingExtraError('--check needs the checker of CommonRoad: pip install "interdrive[checker]"')
    from commonroad.common.file_reader import CommonRoadFileReader  # noqa: PLC0415 - optional
    from commonroad.common.solution import CommonRoadSolutionReader  # noqa: PLC0415
    from commonroad_dc.feasibility import solution_checker as official  # noqa: PLC0415

    with quiet(str(scenario_file)):
        try:
            scenario, problems = CommonRoadFileReader(str(scenario_file)).open()
            solution = CommonRoadSolutionReader.fromstring(document.decode())
        except Exception as cause:
            raise InputError(f"{scenario_file}: the checker cannot read it: {cause}") from cause
        checks = {
            "solved": lambda: official.solved_all_problems(problems, solution),
            "goal": lambda: official.goal_reached(scenario, problems, solution),
            "start": lambda: official.starts_at_correct_state(solution, problems),
            "obstacles": lambda: not official.obstacle_collision(scenario, problems, solution),
            "road": lambda: not official.boundary_collision(scenario, problems, solution),
            "each other": lambda: not official.ego_collision(scenario, problems, solution),
            "feasible": lambda: all(
                one[0] for one in official.solution_feasible(solution, scenario.dt, problems).values()
            ),
        }
        found = {name: _failure(check) for name, check in checks.items()}
        return SolutionCheck(found, _costs(scenario, problems, solution))


def _failure(check: Any) -> str:  # noqa: ANN401 - a call of the library
    try:
        return "" if check() else "failed"
    except Exception as cause:  # noqa: BLE001 - it raises for every kind of failure
        return " ".join(str(cause).split()) or type(cause).__name__


def _costs(scenario: Any, problems: Any, solution: Any) -> float:  # noqa: ANN401 - objects of the library
    from commonroad_dc.costs.evaluation import CostFunctionEvaluator  # noqa: PLC0415 - optional

    try:
        evaluator = CostFunctionEvaluator.init_from_solution(solution)
        return float(evaluator.evaluate_solution(scenario, problems, solution).total_costs)
    except Exception:  # noqa: BLE001 - some functions lack parts
        return float("nan")
