"""Predictors: one call per step predicts all participants, from present and past alone.

A predictor is any object with a method `predict(scene) -> Predictions`. Native predictors are plain records of
settings.
"""

from __future__ import annotations

from interdrive.native_settings import ConstantVelocity, LaneFollowing
from interdrive.predictors.contract import Predictor
from interdrive.predictors.native import (
    NATIVE,
    RECORDS,
    GroundTruth,
    NativePredictor,
    Neural,
    PredictorSettings,
    native_predictor,
)

__all__ = [
    "NATIVE",
    "RECORDS",
    "ConstantVelocity",
    "GroundTruth",
    "LaneFollowing",
    "NativePredictor",
    "Neural",
    "Predictor",
    "PredictorSettings",
    "native_predictor",
]
