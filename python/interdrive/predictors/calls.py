"""Calls of predictors: native ones through the world, others by their method, with one clear line if one fails."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

from interdrive._core import Predictions
from interdrive.errors import PredictorError
from interdrive.foreign import failure, same_folder, undisturbed
from interdrive.plugins import Choice, read_choice
from interdrive.predictors import Predictor, PredictorSettings, native, native_name, resolve

if TYPE_CHECKING:
    from interdrive import _core


def name_of(choice: object) -> str:
    """Name of a predictor for tables and messages, with the settings that it was chosen with."""
    choice = read_choice(choice, "predictor")
    settings = "".join(f",{name}={value}" for name, value in choice.settings.items())
    chosen: Any = choice.chosen
    if isinstance(chosen, str):
        return chosen + settings
    known = native_name(chosen)
    if known is not None:
        return known + settings
    named = chosen if isinstance(chosen, type) or hasattr(chosen, "__qualname__") else type(chosen)
    return f"{named.__module__}:{named.__qualname__}{settings}"


@dataclass(frozen=True)
class Called:
    """A predictor that can be asked in one world.

    Attributes:
        name: For messages.
        predictor: The record, or the object with `predict`.
        native: The core's predictor behind the record; None for one written in Python.
    """

    name: str
    predictor: object
    native: _core.Predictor | None

    def predict(self, world: _core.World, scene: _core.Scene, n_steps: int) -> Predictions:
        """Expectations for the participants of a scene.

        Args:
            world: Where the scene comes from.
            scene: Now.
            n_steps: Length of the prediction; a predictor written in Python chooses its own.

        Raises:
            PredictorError: It raised, or returned something else than predictions for this time step.
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
            raise PredictorError(f"{where}: {failure(error, 'scene')}") from error
        if not isinstance(answer, Predictions):
            raise PredictorError(f"{where}: it returned {type(answer).__name__}, interdrive.Predictions expected")
        if answer.time_step != scene.time_step:
            raise PredictorError(f"{where}: it returned predictions of time step {answer.time_step}")
        return answer


def called(choice: Choice | object, settings: PredictorSettings, recorded: _core.Scenario) -> Called:
    """A predictor of one's own for one world.

    Args:
        choice: As `interdrive.predictors.resolve` takes it.
        settings: What native predictors have where the choice says nothing else.
        recorded: The world's scenario.

    Raises:
        InputError: Unknown name or setting, or something that is no predictor.
    """
    predictor = resolve(choice, settings)
    return Called(name_of(choice), predictor, native(predictor, settings, recorded))
