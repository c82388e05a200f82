"""How good predictions are, measured on recordings. Importing the figures loads matplotlib, importing this does not."""

from interdrive.prediction_evaluation.evaluation import PredictionEvaluation, evaluate_predictors

__all__ = ["PredictionEvaluation", "evaluate_predictors"]
