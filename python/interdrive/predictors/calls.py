"""Calls of predictors: native ones through the world, others by their method; a failure becomes one clear line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

from interdrive._core import Predictions
from interdrive.errors import PredictorError
from interdrive.foreign import failure, same_folder, undisturbed

if TYPE_CHECKING:
    from interdrive import _core
    from interdrive.predictors.contract import Predictor


@dataclass(frozen=True)
class BoundPredictor:
    """A predictor bound to one world.

    Attributes:
        name: Name for messages.
        predictor: The record, or the object with `predict`.
        native: The core's predictor behind the record; None for one written in Python.
    """

    name: str
    predictor: object
    native: _core.Predictor | None

    def predict(self, world: _core.World, scene: _core.Scene, n_steps: int) -> Predictions:
        """Predictions for the participants of a scene.

        Args:
            world: World of the scene.
            scene: The present scene.
            n_steps: Length of the prediction; a predictor written in Python chooses its own.

        Raises:
            PredictorError: It raised an exception, or did not return predictions for this time step.
        """
        if self.native is not None:
            return world.predict(self.native, scene, n_steps)
        where = f"predictor {self.name}, time step {scene.time_step}"
        try:
            with same_folder():
                answer = undisturbed(cast("Predictor", self.predictor).predict, scene)
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            raise PredictorError(where, failure(error, "scene", placed=True)) from error
        if not isinstance(answer, Predictions):
            raise PredictorError(where, f"it returned {type(answer).__name__}, interdrive.Predictions expected")
        if answer.time_step != scene.time_step:
            raise PredictorError(where, f"it returned predictions of time step {answer.time_step}")
        return answer
