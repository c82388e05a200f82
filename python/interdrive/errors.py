"""Every exception that interdrive raises on purpose; all descend from `InterdriveError`."""

from interdrive._core import InputError, InterdriveError, NoRouteError, StepOrderError


class PredictorError(InterdriveError):
    """A predictor raised or returned garbage; the text names the time step, the original is the cause."""


class ResultsError(InterdriveError):
    """A run folder cannot be written or read; the text names the path."""


class MissingExtraError(InterdriveError):
    """An optional part is not installed; the text says what to install."""


__all__ = [
    "InputError",
    "InterdriveError",
    "MissingExtraError",
    "NoRouteError",
    "PredictorError",
    "ResultsError",
    "StepOrderError",
]
