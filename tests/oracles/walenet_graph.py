"""The graph of WALENET from standard operators of ONNX. `python tests/oracles/walenet_graph.py` writes the shipped one.

The file holds no weights: they are one external tensor, the numbers of the published checkpoint in their order, and the
graph cuts them into pieces.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper
from published_network import PLACES, SIZE

from interdrive.predictors.walenet import GRAPH, N_ANSWER, N_CELLS, N_HISTORY, SIDE


class _Graph:
    """Nodes and constants that are being collected."""

    def __init__(self) -> None:
        weights = TensorProto(name="weights", data_type=TensorProto.FLOAT, dims=[SIZE])
        weights.data_location = TensorProto.EXTERNAL
        weights.external_data.add(key="location", value="given by interdrive")
        self.nodes, self.constants = [], [weights]

    def integers(self, *values: int) -> str:
        name = f"constant_{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(np.array(values, np.int64), name))
        return name

    def add(self, operator: str, *inputs: str, n_outputs: int = 1, **attributes):
        outputs = [f"{operator}_{len(self.nodes)}_{i}" for i in range(n_outputs)]
        self.nodes.append(helper.make_node(operator, inputs, outputs, **attributes))
        return outputs[0] if n_outputs == 1 else outputs

    def reshaped(self, x: str, *shape: int) -> str:
        return self.add("Reshape", x, self.integers(*shape))

    def leaky(self, x: str) -> str:
        return self.add("LeakyRelu", x, alpha=0.1)

    def weight(self, name: str) -> str:
        start, end, shape = PLACES[name]
        return self.reshaped(self.add("Slice", "weights", self.integers(start), self.integers(end)), *shape)

    def linear(self, x: str, name: str) -> str:
        product = self.add("MatMul", x, self.add("Transpose", self.weight(f"{name}.weight"), perm=[1, 0]))
        return self.add("Add", product, self.weight(f"{name}.bias"))

    def gru(self, x: str, name: str, size: int) -> list[str]:
        """All states and the last one; torch has the gates in order r, z, n, ONNX z, r, n."""

        def gates(part: str) -> str:
            r, z, n = self.add("Split", self.weight(f"{name}.{part}_l0"), n_outputs=3, axis=0)
            return self.add("Concat", z, r, n, axis=0)

        bias = self.add("Concat", gates("bias_ih"), gates("bias_hh"), axis=0)
        parts = [self.add("Unsqueeze", w, self.integers(0)) for w in (gates("weight_ih"), gates("weight_hh"), bias)]
        return self.add("GRU", x, *parts, n_outputs=2, hidden_size=size, linear_before_reset=1)

    def convolution(self, x: str, name: str, pad: int = 0) -> str:
        return self.add("Conv", x, self.weight(f"{name}.weight"), self.weight(f"{name}.bias"), pads=[pad] * 4)


def model() -> onnx.ModelProto:
    """Inputs and output are described at `interdrive.predictors.walenet.network`."""
    g = _Graph()
    states = g.gru(g.leaky(g.linear("tracks", "ip_emb")), "enc_lstm", 32)[1]
    states = g.add("Gather", g.reshaped(states, -1, 32), "cells")
    own, social = g.add("Split", states, g.integers(1, N_CELLS), n_outputs=2, axis=1)
    dynamics = g.leaky(g.linear(g.reshaped(own, -1, 32), "dyn_emb"))
    social = g.add("Transpose", g.reshaped(social, -1, 3, 13, 32), perm=[0, 3, 2, 1])
    social = g.leaky(g.convolution(g.leaky(g.convolution(social, "soc_conv")), "conv_3x1"))
    social = g.add("MaxPool", social, kernel_shape=[2, 1], strides=[2, 1], pads=[1, 0, 1, 0])
    image = g.reshaped(g.add("Cast", "pictures", to=TensorProto.FLOAT), -1, 1, SIDE, SIDE)
    for layer in range(1, 9):
        image = g.add("MaxPool", g.convolution(image, f"sc_conv{layer}", 1), kernel_shape=[2, 2], strides=[2, 2])
    context = g.add("Concat", g.reshaped(social, -1, 40), dynamics, g.reshaped(image, -1, 32), axis=1)
    context = g.add("Tile", g.reshaped(context, 1, -1, 88), g.integers(N_ANSWER, 1, 1))
    answers = g.linear(g.reshaped(g.gru(context, "dec_lstm", 64)[0], N_ANSWER, -1, 64), "op")
    mean, inverse, correlation = g.add("Split", answers, g.integers(2, 2, 1), n_outputs=3, axis=2)
    answers = g.add("Concat", mean, g.add("Exp", inverse), g.add("Tanh", correlation), axis=2)
    g.nodes.append(helper.make_node("Transpose", [answers], ["answers"], perm=[1, 0, 2]))
    value = helper.make_tensor_value_info
    inputs = [
        value("tracks", TensorProto.FLOAT, (N_HISTORY, "m", 2)),
        value("cells", TensorProto.INT64, ("n", 1 + N_CELLS)),
        value("pictures", TensorProto.UINT8, ("n", SIDE, SIDE)),
    ]
    outputs = [value("answers", TensorProto.FLOAT, ("n", N_ANSWER, 5))]
    graph = helper.make_graph(g.nodes, "walenet", inputs, outputs, g.constants)
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 14)], ir_version=8)


if __name__ == "__main__":
    Path(GRAPH).write_bytes(model().SerializeToString())
