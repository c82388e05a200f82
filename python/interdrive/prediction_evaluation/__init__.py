"""How good predictions are, measured on recordings."""

from interdrive.prediction_evaluation.evaluation import evaluate_predictors
from interdrive.prediction_evaluation.tables import PredictionEvaluation

__all__ = ["PredictionEvaluation", "evaluate_predictors"]
