"""The network WALENET: its published numbers, and a second implementation of it."""

from __future__ import annotations

import numpy as np
import published_network as plain
import pytest

from interdrive.predictors.walenet import network

NUMBERS = plain.invented()


@pytest.fixture(scope="module")
def invented():
    return network(NUMBERS)


def answers(session, history, neighbours, pictures):
    """(n, 40, 5) for history (n, 30, 2), neighbours (n, 39, 30, 2; zero: none), pictures (n, 256, 256)."""
    tracks = np.concatenate([history[:, None], neighbours], axis=1)
    cells = np.arange(len(history) * 40).reshape(-1, 40)
    tracks = np.ascontiguousarray(tracks.reshape(-1, 30, 2).swapaxes(0, 1))
    return session.run(None, {"tracks": tracks, "cells": cells, "pictures": pictures})[0]


def lines():
    picture = np.zeros((256, 256), np.uint8)
    picture[:, [124, 138]] = 255
    picture[:, 131] = 127
    return picture


def inputs(random, n):
    """Plausible histories, some occupied cells, and pictures with crooked lines and specks at the border."""
    history, neighbours = np.zeros((n, 30, 2), np.float32), np.zeros((n, 39, 30, 2), np.float32)
    pictures = np.zeros((n, 256, 256), np.uint8)
    time = 0.1 * np.arange(-29, 1)
    for i in range(n):
        history[i] = np.outer(time, random.normal([0.0, 10.0], [0.5, 4.0]))
        for cell in random.choice(39, random.integers(0, 8), replace=False):
            place = [6 * (cell // 13) - 6, 36 - 6 * (cell % 13)]
            neighbours[i, cell] = place + np.outer(time, random.normal([0.0, 8.0], [0.5, 4.0]))
        s = np.arange(0.0, 256.0, 0.3)
        for value in (255, 127, 127, 255):
            line = random.uniform(0, 256) + random.normal(0, 0.4) * s + random.normal(0, 5) * np.sin(s / 40)
            row, column = s.astype(int), np.clip(line, 0, 255).astype(int)
            pictures[i, row, column] = value
        pictures[i, [0, 0, 255, 255], [0, 255, 0, 255]] = 255
    return history, neighbours, pictures


def test_it_computes_what_its_description_says(invented):
    history, neighbours, pictures = inputs(np.random.default_rng(8), 6)
    pictures[0] = 0
    found = answers(invented, history, neighbours, pictures)
    for i in range(len(found)):
        expected = plain.answer(NUMBERS, history[i], neighbours[i], pictures[i])
        assert found[i] == pytest.approx(expected, abs=2e-4, rel=1e-5), f"input {i}"
    assert np.abs(np.diff(found[:, -1, :2], axis=0)).min() > 1e-3, "inputs matter"


def test_an_answer_does_not_depend_on_the_others_in_the_batch(invented):
    history, neighbours, pictures = inputs(np.random.default_rng(9), 3)
    together = answers(invented, history, neighbours, pictures)
    for i in range(3):
        alone = answers(invented, history[i : i + 1], neighbours[i : i + 1], pictures[i : i + 1])
        assert (alone[0] == together[i]).all()


# Steps 1, 10, 30 and 40 of the published network run by onnxruntime.
GOLDEN = {
    "everything zero": """
        0.254765 0.466070 2.194479 1.336364 0.022049 | 0.143792 3.159121 4.893899 0.832116 -0.094561
        | -0.091838 13.302794 1.428408 0.256226 -0.190119 | -0.541299 19.681370 0.581174 0.160408 -0.223890""",
    "10 m/s between lines": """
        0.015100 1.415517 3.309396 1.395820 -0.004320 | 0.144737 11.025991 3.692327 0.679734 -0.075232
        | -0.262589 32.254208 1.045889 0.201771 -0.113768 | -0.977830 46.615740 0.495541 0.111651 0.096931""",
    "behind a vehicle at 5 m/s": """
        0.013620 1.231190 3.601439 1.437835 -0.002406 | 0.236756 9.787759 4.541147 0.751542 -0.040348
        | 0.032080 28.230238 1.623275 0.265955 -0.096775 | -0.274825 38.082886 1.113914 0.192492 -0.026302""",
    "standing between lines": """
        -0.099226 0.781980 3.539383 1.534291 0.020335 | -0.218516 10.841003 3.014884 0.547457 -0.087598
        | -0.517455 37.135353 0.480734 0.099370 -0.044045 | 0.147826 48.278366 0.219518 0.057080 0.204581""",
}


@pytest.mark.parametrize("case", GOLDEN)
def test_the_published_weights_give_the_published_numbers(published_walenet, case):
    time = 0.1 * np.arange(-29, 1)
    history, neighbours = np.zeros((1, 30, 2), np.float32), np.zeros((1, 39, 30, 2), np.float32)
    pictures = np.zeros((1, 256, 256), np.uint8)
    if case != "everything zero":
        pictures[0] = lines()
    if "m/s" in case:
        history[0, :, 1] = 10 * time
    if "behind" in case:
        neighbours[0, 19] = history[0]
        neighbours[0, 17, :, 1] = 15 + 5 * time
    found = answers(published_walenet, history, neighbours, pictures)[0, [0, 9, 29, 39]]
    expected = np.array([[float(x) for x in step.split()] for step in GOLDEN[case].split("|")])
    assert found[:, :2] == pytest.approx(expected[:, :2], abs=2e-4)
    assert found[:, 2:] == pytest.approx(expected[:, 2:], abs=1e-5)
