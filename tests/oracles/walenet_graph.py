"""The graph of WALENET from standard operators of ONNX, with the published weights in it."""

from __future__ import annotations

import numpy as np
import onnx
import onnxruntime
from onnx import TensorProto, helper, numpy_helper

STEPS, OUTPUTS, CELLS = 30, 40, 39


class _Graph:
    """Nodes and constants that are being collected."""

    def __init__(self, weights: dict[str, np.ndarray]) -> None:
        self.weights, self.nodes, self.constants = weights, [], {}

    def constant(self, name: str, values: np.ndarray) -> str:
        self.constants[name] = numpy_helper.from_array(np.ascontiguousarray(values), name)
        return name

    def add(self, operator: str, inputs: list[str], n_outputs: int = 1, **attributes):
        outputs = [f"{operator}_{len(self.nodes)}_{i}" for i in range(n_outputs)]
        self.nodes.append(helper.make_node(operator, inputs, outputs, **attributes))
        return outputs[0] if n_outputs == 1 else outputs

    def linear(self, x: str, name: str) -> str:
        weight = self.constant(f"{name}.transposed", self.weights[f"{name}.weight"].T)
        product = self.add("MatMul", [x, weight])
        return self.add("Add", [product, self.constant(f"{name}.bias", self.weights[f"{name}.bias"])])

    def gru(self, x: str, name: str) -> list[str]:
        """All states and the last one; torch has the gates in order r, z, n, ONNX z, r, n."""

        def gates(values: np.ndarray) -> np.ndarray:
            r, z, n = np.split(values, 3)
            return np.concatenate([z, r, n])

        w = {
            part: gates(self.weights[f"{name}.{part}_l0"]) for part in ("weight_ih", "weight_hh", "bias_ih", "bias_hh")
        }
        bias = np.concatenate([w["bias_ih"], w["bias_hh"]])
        constants = [
            self.constant(f"{name}.{part}", values[None])
            for part, values in (("w", w["weight_ih"]), ("r", w["weight_hh"]), ("b", bias))
        ]
        size = w["weight_hh"].shape[1]
        return self.add("GRU", [x, *constants], 2, hidden_size=size, linear_before_reset=1)

    def convolution(self, x: str, name: str, pad: int = 0) -> str:
        weight, bias = (self.constant(f"{name}.{part}", self.weights[f"{name}.{part}"]) for part in ("weight", "bias"))
        return self.add("Conv", [x, weight, bias], pads=[pad] * 4)

    def reshaped(self, x: str, *shape: int) -> str:
        return self.add("Reshape", [x, self.constant(f"shape_{len(self.nodes)}", np.array(shape, np.int64))])


def session(weights: dict[str, np.ndarray]) -> onnxruntime.InferenceSession:
    """Takes `history` (30, n, 2), `neighbours` (30, 39 n, 2) and `pictures` (n, 1, 256, 256), all float32."""
    g = _Graph(weights)
    leaky = {"alpha": 0.1}

    def encoded(points: str) -> str:
        return g.gru(g.add("LeakyRelu", [g.linear(points, "ip_emb")], **leaky), "enc_lstm")[1]

    own = g.reshaped(encoded("history"), -1, 32)
    dynamics = g.add("LeakyRelu", [g.linear(own, "dyn_emb")], **leaky)
    social = g.add("Transpose", [g.reshaped(encoded("neighbours"), -1, 3, 13, 32)], perm=[0, 3, 2, 1])
    social = g.add("LeakyRelu", [g.convolution(social, "soc_conv")], **leaky)
    social = g.add("LeakyRelu", [g.convolution(social, "conv_3x1")], **leaky)
    social = g.add("MaxPool", [social], kernel_shape=[2, 1], strides=[2, 1], pads=[1, 0, 1, 0])
    image = "pictures"
    for layer in range(1, 9):
        image = g.add("MaxPool", [g.convolution(image, f"sc_conv{layer}", 1)], kernel_shape=[2, 2], strides=[2, 2])
    context = g.add("Concat", [g.reshaped(social, -1, 40), dynamics, g.reshaped(image, -1, 32)], axis=1)
    repeats = g.constant("repeats", np.array([OUTPUTS, 1, 1], np.int64))
    states = g.gru(g.add("Tile", [g.reshaped(context, 1, -1, 88), repeats]), "dec_lstm")[0]
    answer = g.linear(g.reshaped(states, OUTPUTS, -1, 64), "op")
    mean, inverse, correlation = (f"part_{i}" for i in range(3))
    sizes = g.constant("sizes", np.array([2, 2, 1], np.int64))
    g.nodes.append(helper.make_node("Split", [answer, sizes], [mean, inverse, correlation], axis=2))
    parts = [mean, g.add("Exp", [inverse]), g.add("Tanh", [correlation])]
    g.nodes.append(helper.make_node("Concat", parts, ["answer"], axis=2))

    def floats(name: str, *shape: int | str) -> onnx.ValueInfoProto:
        return helper.make_tensor_value_info(name, TensorProto.FLOAT, shape)

    inputs = [
        floats("history", STEPS, "n", 2),
        floats("neighbours", STEPS, "m", 2),
        floats("pictures", "n", 1, 256, 256),
    ]
    graph = helper.make_graph(
        g.nodes, "walenet", inputs, [floats("answer", OUTPUTS, "n", 5)], list(g.constants.values())
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 14)], ir_version=8)
    onnx.checker.check_model(model)
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    return onnxruntime.InferenceSession(model.SerializeToString(), options, providers=["CPUExecutionProvider"])
