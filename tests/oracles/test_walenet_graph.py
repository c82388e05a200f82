"""WALENET in the core against its graph run by onnxruntime, with the published weights, in recorded traffic."""

from __future__ import annotations

import numpy as np
import pytest
import walenet_graph

from interdrive import _core
from interdrive.errors import InputError
from interdrive.predictors.models import WALENET
from interdrive.scenario.native import core_road

STEP = 30
VEHICLES_PER_SCENARIO = 4


@pytest.fixture(scope="module")
def weights():
    if not WALENET.is_installed():
        try:
            WALENET.install()
        except InputError as error:
            pytest.skip(str(error))
    return WALENET.weights().tensors


def seen(o, own):
    """Where everybody was in the last 3 s, in the frame of a vehicle at step 30, (vehicles, 30, 2); unknown: 0."""
    past = slice(STEP - 29, STEP + 1)
    dx, dy, psi = o.x[:, past] - o.x[own, STEP], o.y[:, past] - o.y[own, STEP], o.orientation[own, STEP]
    local = np.stack([dx * np.sin(psi) - dy * np.cos(psi), dx * np.cos(psi) + dy * np.sin(psi)], axis=2)
    return np.nan_to_num(local).astype(np.float32)


def situations(recorded):
    """(history, neighbours, picture) of some vehicles of every scenario."""
    found = []
    for scenario in recorded:
        o = scenario.obstacles
        if o.x.shape[1] <= STEP:
            continue
        moving = np.flatnonzero(o.valid[:, STEP] & ~o.is_static)
        road = core_road(scenario, 0.1, 120.0)
        for own in moving[:: max(1, len(moving) // VEHICLES_PER_SCENARIO)][:VEHICLES_PER_SCENARIO]:
            tracks = seen(o, own)
            neighbours = np.zeros((39, 30, 2), np.float32)
            for track in tracks[moving]:
                x, y = track[-1].astype(float)
                if abs(x) < 9 and abs(y) < 39:
                    neighbours[13 * int((x + 9) // 6) + int((39 - y) // 6)] = track
            pose = o.x[own, STEP], o.y[own, STEP], o.orientation[own, STEP]
            found.append((tracks[own], neighbours, _core.Walenet.picture(road, *pose)))
    return tuple(np.stack(parts) for parts in zip(*found, strict=True))


def scale(answers):
    """1, and for inverse standard deviations beyond 1/m their size: there single precision has fewer decimals."""
    found = np.ones_like(answers)
    found[..., 2:4] = np.maximum(answers[..., 2:4], 1.0)
    return found


def test_the_core_gives_what_the_published_graph_gives(weights, recorded, measured):
    history, neighbours, pictures = situations(recorded)
    n = len(history)
    ours = _core.Walenet(weights).answer(history, neighbours, pictures)
    session, largest = walenet_graph.session(weights), np.zeros(5)
    for start in range(0, n, 50):
        part = slice(start, start + 50)
        theirs = session.run(
            None,
            {
                "history": history[part].transpose(1, 0, 2),
                "neighbours": neighbours[part].reshape(-1, 30, 2).transpose(1, 0, 2),
                "pictures": pictures[part, None].astype(np.float32),
            },
        )[0].transpose(1, 0, 2)
        difference = np.abs(theirs - ours[part]) / scale(theirs)
        largest = np.maximum(largest, difference.max((0, 1)))
    assert (pictures.reshape(n, -1) > 0).any(1).mean() > 0.9, "there are roads"
    measured("WALENET: predicted mean, all steps (onnxruntime)", n, largest[:2].max(), 2e-4, "m")
    measured("WALENET: inverse standard deviation, over 1/m relative (onnxruntime)", n, largest[2:4].max(), 2e-5, "1/m")
    measured("WALENET: correlation (onnxruntime)", n, largest[4], 1e-5, "")
