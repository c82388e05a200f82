"""WALENET once more, in numpy and double precision, written from its description alone: slow, for comparisons."""

from __future__ import annotations

import math

import numpy as np

#: Tensors in the order of the published checkpoint; in front of each group stands its size, an int64.
STORED = (
    {"sc_conv1.weight": (32, 1, 3, 3)},
    {"sc_conv7.bias": (32,)},
    {"sc_conv8.weight": (32, 32, 3, 3)},
    {"op.weight": (5, 64)},
    {"conv_3x1.weight": (8, 32, 3, 1)},
    {"sc_conv1.bias": (32,)},
    {"ip_emb.bias": (16,)},
    {"sc_conv4.weight": (32, 32, 3, 3)},
    {"dyn_emb.bias": (16,)},
    {"sc_conv3.bias": (32,)},
    {"conv_3x1.bias": (8,)},
    {"op.bias": (5,)},
    {"sc_conv2.weight": (32, 32, 3, 3)},
    {
        "dec_lstm.weight_ih_l0": (192, 88),
        "dec_lstm.weight_hh_l0": (192, 64),
        "dec_lstm.bias_ih_l0": (192,),
        "dec_lstm.bias_hh_l0": (192,),
    },
    {"sc_conv5.weight": (32, 32, 3, 3)},
    {"soc_conv.bias": (32,)},
    {"sc_conv8.bias": (32,)},
    {"sc_conv2.bias": (32,)},
    {
        "enc_lstm.weight_ih_l0": (96, 16),
        "enc_lstm.weight_hh_l0": (96, 32),
        "enc_lstm.bias_ih_l0": (96,),
        "enc_lstm.bias_hh_l0": (96,),
    },
    {"sc_conv3.weight": (32, 32, 3, 3)},
    {"sc_conv4.bias": (32,)},
    {"ip_emb.weight": (16, 2)},
    {"sc_conv6.weight": (32, 32, 3, 3)},
    {"sc_conv6.bias": (32,)},
    {"sc_conv7.weight": (32, 32, 3, 3)},
    {"dyn_emb.weight": (16, 32)},
    {"soc_conv.weight": (32, 32, 3, 3)},
    {"sc_conv5.bias": (32,)},
)


def _places():
    found, end = {}, 0
    for group in STORED:
        end += 2
        for name, shape in group.items():
            start, end = end, end + math.prod(shape)
            found[name] = (start, end, shape)
    return found, end


#: First number, the one behind the last, and shape of each tensor; number of numbers.
PLACES, SIZE = _places()


def tensors(numbers):
    """Tensors by name, as views into the numbers of a checkpoint."""
    return {name: numbers[start:end].reshape(shape) for name, (start, end, shape) in PLACES.items()}


def invented(seed=3):
    """Numbers of a checkpoint, random and about as large as those of a trained network."""
    random, numbers = np.random.default_rng(seed), np.zeros(SIZE, np.float32)
    found = tensors(numbers)
    for values in found.values():
        size = values[0].size if values.ndim > 1 else 4
        values[:] = random.normal(0.0, 1.0 / math.sqrt(size), values.shape)
    found["sc_conv1.weight"] /= 100  # the picture has values up to 255
    found["op.weight"][:2] *= 10  # means are metres
    return numbers


STEPS, OUTPUTS, SIDE = 30, 40, 256


def leaky(x):
    return np.where(x > 0, x, 0.1 * x)


def sigmoid(x):
    return 1 / (1 + np.exp(-x))


def gru(w, name, inputs):
    """All states for inputs (steps, n, features)."""
    wx, wh = w[f"{name}.weight_ih_l0"], w[f"{name}.weight_hh_l0"]
    bx, bh = w[f"{name}.bias_ih_l0"], w[f"{name}.bias_hh_l0"]
    h, states = np.zeros((inputs.shape[1], wh.shape[1])), []
    for x in inputs:
        (xr, xz, xn), (hr, hz, hn) = np.split(x @ wx.T + bx, 3, 1), np.split(h @ wh.T + bh, 3, 1)
        r, z = sigmoid(xr + hr), sigmoid(xz + hz)
        h = (1 - z) * np.tanh(xn + r * hn) + z * h
        states.append(h)
    return np.array(states)


def convolution(x, weight, bias):
    """Without padding; x (channels, rows, columns)."""
    windows = np.lib.stride_tricks.sliding_window_view(x, weight.shape[2:], axis=(1, 2))
    return np.einsum("cyxuv,ocuv->oyx", windows, weight, optimize=True) + bias[:, None, None]


def image_vector(w, picture):
    x = picture[None].astype(float)
    for layer in range(1, 9):
        x = convolution(np.pad(x, ((0, 0), (1, 1), (1, 1))), w[f"sc_conv{layer}.weight"], w[f"sc_conv{layer}.bias"])
        x = x.reshape(32, x.shape[1] // 2, 2, x.shape[2] // 2, 2).max((2, 4))
    return x[:, 0, 0]


def social_vector(w, states):
    """From the states of 39 cells, (39, 32)."""
    tensor = states.reshape(3, 13, 32).transpose(2, 1, 0)
    x = leaky(convolution(tensor, w["soc_conv.weight"], w["soc_conv.bias"]))
    x = leaky(convolution(x, w["conv_3x1.weight"], w["conv_3x1.bias"]))[:, :, 0]
    padded = np.pad(x, ((0, 0), (1, 0)), constant_values=-np.inf)  # the row behind the last is never reached
    return padded.reshape(8, 5, 2).max(2).ravel()


def answer(numbers, history, neighbours, picture):
    """(40, 5) for one vehicle: history (30, 2), neighbours (39, 30, 2), picture (256, 256)."""
    w = {name: values.astype(float) for name, values in tensors(numbers).items()}
    points = np.concatenate([history[None], neighbours]).transpose(1, 0, 2).astype(float)
    states = gru(w, "enc_lstm", leaky(points @ w["ip_emb.weight"].T + w["ip_emb.bias"]))[-1]
    dynamics = leaky(states[0] @ w["dyn_emb.weight"].T + w["dyn_emb.bias"])
    context = np.concatenate([social_vector(w, states[1:]), dynamics, image_vector(w, picture)])
    decoded = gru(w, "dec_lstm", np.tile(context, (OUTPUTS, 1, 1)))[:, 0]
    raw = decoded @ w["op.weight"].T + w["op.bias"]
    return np.column_stack([raw[:, :2], np.exp(raw[:, 2:4]), np.tanh(raw[:, 4])])


def picture(left, right, left_is_edge, right_is_edge, x, y, orientation):
    """(256, 256) of 0, 127, 255: the borders of lanelets (lists of (vertices, 2)) around a pose."""
    found = np.zeros((SIDE, SIDE), np.uint8)
    phi = orientation - np.pi / 2
    turn = np.array([[np.cos(phi), np.sin(phi)], [-np.sin(phi), np.cos(phi)]])
    for borders in zip(zip(left, left_is_edge, strict=True), zip(right, right_is_edge, strict=True), strict=True):
        for vertices, is_edge in borders:
            local = (vertices - [x, y]) @ turn.T
            inside = np.pad(np.abs(local).max(1) <= 64, 1)
            local = local[inside[1:-1] | inside[:-2] | inside[2:]]
            if not len(local):
                continue
            lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(local, axis=0).T))])
            samples = np.arange(0.0, lengths[-1], 0.4)
            column, row = (
                np.floor(np.interp(samples, lengths, local[:, axis]) / 0.5).astype(int) + 128 for axis in (0, 1)
            )
            drawn = (row >= 0) & (row < SIDE) & (column >= 0) & (column < SIDE)
            found[row[drawn], column[drawn]] = 255 if is_edge else 127
    return found
