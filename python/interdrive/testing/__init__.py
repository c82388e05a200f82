"""Small worlds, and checks for authors of plug-ins: `check_planner(Mine)`, `check_predictor(Mine)`."""

from interdrive.testing.planner_contract import PlannerContractError, check_planner
from interdrive.testing.predictor_contract import PredictorContractError, check_predictor
from interdrive.testing.worlds import CAR, Car, bend, crossing, problem, straight_road, world

__all__ = [
    "CAR",
    "Car",
    "PlannerContractError",
    "PredictorContractError",
    "bend",
    "check_planner",
    "check_predictor",
    "crossing",
    "problem",
    "straight_road",
    "world",
]
