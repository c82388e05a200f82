"""The shipped graph of WALENET is the one that its description makes."""

import onnx
import walenet_graph

from interdrive.predictors.walenet import GRAPH


def test_the_shipped_graph_is_made_of_standard_operators_as_described():
    made, shipped = walenet_graph.model(), onnx.ModelProto.FromString(GRAPH.read_bytes())
    assert shipped == made
