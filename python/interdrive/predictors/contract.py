"""The contract of predictors: one method from a scene to predictions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, runtime_checkable

if TYPE_CHECKING:
    from interdrive._core import Predictions, Scene


@runtime_checkable
class Predictor(Protocol):
    """Contract of a predictor.

    `predict` gets a scene (all present participants with their past) and returns `Predictions` for the same time step:
    any number of modes with probabilities, means and 2x2 covariances of the centre per step (step `k` is `(k + 1) * dt`
    from now), and a validity mask. Participants that are left out are assumed to go straight on.
    """

    def predict(self, scene: Scene) -> Predictions:
        """Predictions for the participants of the scene."""
        ...
