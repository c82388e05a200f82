"""Recordings of small worlds, a predictor whose answers are known, and what is measured of it."""

from __future__ import annotations

import numpy as np

import interdrive as idr
from interdrive.config.schema import SimulationSettings
from interdrive.config.specs import bound_predictor
from interdrive.prediction_evaluation.measures import joined, judged
from interdrive.prediction_evaluation.recordings import Recording
from interdrive.prediction_evaluation.samples import answered
from interdrive.testing import straight_road, world

SETTINGS = SimulationSettings()


def recording(cars, steps=60, dt=0.1, lanes=1):
    return Recording(world(straight_road(300.0, lanes=lanes), cars=cars, steps=steps, dt=dt), SETTINGS)


def measured(predictor, found, every=1):
    """All measures of a predictor in a recording, and the moments."""
    asked = bound_predictor(predictor, SETTINGS.predictor, found.core_scenario)
    moments, answers = [], []
    for moment in found.moments(every):
        moments.append(moment)
        answers.append(answered(asked, found, moment))
    truth = np.concatenate([m.truth for m in moments])
    now = np.concatenate([np.stack([m.scene.x[m.row, -1], m.scene.y[m.row, -1]], axis=1) for m in moments])
    return judged(joined(answers), truth, now, found.scenario.dt, found.road), moments


class Modes:
    """All participants are expected at (offset, 0) from a straight drive, one mode per offset."""

    offsets = (0.0,)
    probability = (1.0,)
    variance = 1.0
    steps = 30

    def predict(self, scene):
        n, m = len(scene.ids), len(self.offsets)
        time = np.arange(1, self.steps + 1) * scene.dt
        shape = (n, m, self.steps)
        x = scene.x[:, -1, None] + scene.velocity[:, -1, None] * time
        offset = np.array(self.offsets)[None, :, None]
        return idr.Predictions(
            scene.time_step,
            scene.ids,
            np.tile(np.array(self.probability, dtype=float), (n, 1)),
            x[:, None] + offset,
            np.broadcast_to(scene.y[:, -1, None, None], shape),
            np.broadcast_to(scene.orientation[:, -1, None, None], shape),
            np.broadcast_to(scene.velocity[:, -1, None, None], shape),
            np.broadcast_to(self.variance * np.eye(2), (*shape, 2, 2)),
            np.ones(shape, dtype=bool),
        )


def modes(offsets, probability, **more):
    return type("Modes", (Modes,), {"offsets": offsets, "probability": probability, **more})
