"""How good predictions are, measured on recordings. Importing the figures loads matplotlib, importing this does not."""

from interdrive.prediction_evaluation.evaluation import evaluate_predictors
from interdrive.prediction_evaluation.tables import PredictionEvaluation

__all__ = ["PredictionEvaluation", "evaluate_predictors"]
