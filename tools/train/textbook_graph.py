"""ONNX graph of a PointNet in the textbook order: bias and ReLU on every point, then the maximum over points.

It costs more than that of export_pointnet and says the same. Weights are stored in half precision, and run in single.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from modt.classes import CLASS_NAMES
from tools.train.export_pointnet import IR, OPSET, Layer


class GraphWriter:
    """Nodes and weights of a graph, one after another."""

    def __init__(self) -> None:
        self.nodes: list[onnx.NodeProto] = []
        self.weights: list[TensorProto] = []

    def add(self, operator: str, *inputs: str, **attributes: Any) -> str:
        """Name of what a node gives."""
        name = f"v{len(self.nodes)}"
        self.nodes.append(helper.make_node(operator, inputs, [name], **attributes))
        return name

    def constant(self, value: Any) -> str:
        """Name of a constant, floats in half precision."""
        array, name = np.asarray(value), f"w{len(self.weights)}"
        half = array.astype(np.float16) if array.dtype.kind == "f" else array
        self.weights.append(numpy_helper.from_array(half, name))
        return name if half is array else self.add("Cast", name, to=TensorProto.FLOAT)

    def pointnet(self, points: str, layers: Sequence[Layer], shared: int) -> str:
        """(batch, out) logits of (batch, n, 3) points; the first `shared` layers are applied to every point."""
        value = points
        for number, (weight, bias) in enumerate(layers, 1):
            value = self.add("MatMul", value, self.constant(weight))
            value = self.add("Add", value, self.constant(bias))
            if number < len(layers):
                value = self.add("Relu", value)
            if number == shared:
                value = self.add("ReduceMax", value, axes=[1], keepdims=0)
        return value


def textbook_graph(
    layers: Sequence[Layer], shared: int, transform: Sequence[Layer] = (), transform_shared: int = 3
) -> onnx.ModelProto:
    """A PointNet, after one that finds a matrix (3, 3) for the points where its layers are given."""
    write, points = GraphWriter(), "points"
    if transform:
        matrix = write.pointnet(points, transform, transform_shared)
        matrix = write.add("Reshape", matrix, write.constant(np.array([-1, 3, 3])))
        points = write.add("MatMul", points, matrix)
    write.add("Softmax", write.pointnet(points, layers, shared), axis=-1)
    write.nodes[-1].output[0] = "probability"
    ends = (
        [helper.make_tensor_value_info("points", TensorProto.FLOAT, ["batch", "n", 3])],
        [helper.make_tensor_value_info("probability", TensorProto.FLOAT, ["batch", len(CLASS_NAMES)])],
    )
    model = helper.make_model(
        helper.make_graph(write.nodes, "pointnet", *ends, write.weights),
        opset_imports=[helper.make_opsetid("", OPSET)],
        ir_version=IR,
        producer_name="modt",
    )
    onnx.checker.check_model(model, full_check=True)
    return model
