"""Checks the contract of predictors: `check_predictor(MyPredictor)`."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

from interdrive.config.schema import SimulationSettings
from interdrive.config.specs import bound_predictor
from interdrive.errors import PredictorError
from interdrive.prediction_evaluation.recordings import Recording
from interdrive.predictors import PredictorSettings
from interdrive.scenario import STATE_FIELDS
from interdrive.testing.worlds import Car, crossing, straight_road, world

if TYPE_CHECKING:
    from interdrive._core import Predictions, Scene
    from interdrive.config.specs import PredictorSpec
    from interdrive.predictors.calls import BoundPredictor
    from interdrive.scenario import Scenario

#: Time steps at which a predictor is called: all cars have one state, two, a short past, a full one.
_ASKED = (0, 1, 4, 35)
#: Tolerance of the first position [m], plus twice the distance that the present speed covers in a step.
_FIRST_MAX = 1.0
#: Up to this number of participants the time limit holds unchanged; a thousand cannot be predicted as fast as one.
_FEW = 100
_ARRAYS = ("probability", "x", "y", "orientation", "velocity", "covariance", "valid")
_SEEN = ("ids", *STATE_FIELDS, "valid", "length", "width", "kinds")


class PredictorContractError(AssertionError):
    """A predictor breaks the contract; the text names the broken part, the world and the time step."""


def _worlds() -> dict[str, Scenario]:
    road, wide = straight_road(300.0, lanes=2), straight_road(1000.0, lanes=20)
    thousand = [Car(i + 1, 5.0 + 19.0 * (i // 20), 3.5 * (i % 20), 5.0 + 0.5 * (i % 20)) for i in range(1000)]
    return {
        "a straight road": world(road, cars=[Car(1, 20.0, velocity=12.0), Car(2, 5.0, 3.2, 15.0)]),
        "a crossing": world(crossing(), cars=[Car(1, 0.0, -50.0, 10.0, np.pi / 2), Car(2, -40.0, 0.0, 8.0)]),
        "a standing car": world(road, cars=[Car(1, 50.0), Car(2, 10.0, velocity=10.0)]),
        "cars off the road and against it": world(
            road, cars=[Car(1, 50.0, 40.0, 5.0, 1.0), Car(2, 200.0, 0.0, 10.0, np.pi)]
        ),
        "cars that come and leave": world(
            road,
            cars=[Car(1, 20.0, velocity=10.0, last=20), Car(2, 30.0, velocity=10.0, first=4), Car(3, 5.0, first=35)],
        ),
        "no participants": world(road),
        "time steps of 0.2 s": world(road, cars=[Car(1, 20.0, velocity=12.0), Car(2, 50.0)], dt=0.2),
        "a thousand cars": world(wide, cars=thousand, steps=40),
    }


def check_predictor(factory: PredictorSpec, *, horizon: float = 3.0, seconds_max: float = 1.0) -> dict[str, float]:
    """Calls a predictor in small worlds and checks the contract.

    The checks cover the time step of predictions; that they are only for present participants, long enough, and have
    valid shapes, numbers, probabilities and covariances; a first position near the present one; the same predictions
    from two objects for the same scene; an unchanged scene; and the time per call. The worlds have single states
    without a past, standing cars, cars off the road and in the wrong direction, cars that come and leave, no
    participants, time steps of 0.2 s, and a thousand cars.

    Args:
        factory: Makes a predictor; called without arguments, more than once per world. Names and records of native
            predictors are accepted, too.
        horizon: Time that it must predict [s]: the setting predictor.horizon.
        seconds_max: Time limit of a call [s] for up to 100 participants; proportionally longer for more.

    Returns:
        The longest call in each world [s].

    Raises:
        PredictorContractError: A part of the contract is broken; the text names it with world and time step.
        InputError: The object is not a predictor, or cannot be made.
    """
    longest = {}
    for name, scenario in _worlds().items():
        recording = Recording(scenario, SimulationSettings())
        first, second = (
            bound_predictor(factory, PredictorSettings(horizon=horizon), recording.core_scenario) for _ in range(2)
        )
        longest[name] = 0.0
        for time_step in _ASKED:
            scene = recording.at(time_step).scene
            try:
                seconds = _check(recording, scene, (first, second), horizon)
            except (PredictorError, PredictorContractError) as error:
                text = error.message if isinstance(error, PredictorError) else str(error)
                raise PredictorContractError(f"{name}, time step {time_step}: {text}") from error
            longest[name] = max(longest[name], seconds)
            allowed = seconds_max * max(1.0, len(scene.ids) / _FEW)
            if seconds > allowed:
                raise PredictorContractError(
                    f"{name}, time step {time_step}: predict took {seconds:.3f} s for {len(scene.ids)} participants, "
                    f"at most {allowed:g} s are allowed"
                )
    return longest


def _check(
    recording: Recording, scene: Scene, predictors: tuple[BoundPredictor, BoundPredictor], horizon: float
) -> float:
    """Checks one call and returns its time [s]."""
    n_steps = max(1, round(horizon / scene.dt))
    before = [np.array(getattr(scene, name)) for name in _SEEN]
    start = time.perf_counter()
    found = predictors[0].predict(recording.world, scene, n_steps)
    seconds = time.perf_counter() - start
    if not all(
        np.array_equal(old, getattr(scene, name), equal_nan=True) for old, name in zip(before, _SEEN, strict=True)
    ):
        raise PredictorContractError("predict changed its scene")
    strangers = np.setdiff1d(found.ids, scene.ids)
    if len(strangers):
        raise PredictorContractError(f"it predicts participant {strangers[0]}, which is not present")
    if len(found.ids) and found.x.shape[2] < n_steps:
        raise PredictorContractError(f"it predicts {found.x.shape[2]} steps of {scene.dt} s, {n_steps} are needed")
    _check_start(found, scene)
    again = predictors[1].predict(recording.world, scene, n_steps)
    if not np.array_equal(found.ids, again.ids) or not all(_same(found, again, name) for name in _ARRAYS):
        raise PredictorContractError(
            "two predictors made different predictions for the same scene (randomness without a seed?)"
        )
    return seconds


def _same(found: Predictions, again: Predictions, name: str) -> bool:
    return np.array_equal(getattr(found, name), getattr(again, name), equal_nan=name != "valid")


def _check_start(found: Predictions, scene: Scene) -> None:
    """Checks that every mode begins near the present position."""
    if not len(found.ids):
        return
    row = np.searchsorted(scene.ids, found.ids)
    x, y, speed = scene.x[row, -1], scene.y[row, -1], np.abs(scene.velocity[row, -1])
    distance = np.hypot(found.x[:, :, 0] - x[:, None], found.y[:, :, 0] - y[:, None])
    allowed = _FIRST_MAX + 2.0 * speed * scene.dt
    far = found.valid[:, :, 0] & (found.probability > 0) & ~(distance <= allowed[:, None])
    if far.any():
        i, mode = np.argwhere(far)[0]
        raise PredictorContractError(
            f"participant {found.ids[i]}, mode {mode}: "
            f"the first position is {distance[i, mode]:.1f} m away from the present one"
        )
