"""Models in ONNX, each with its card; the layers of the box and the reflectance classifiers are its metadata.

The maximum over points commutes with adding a bias and with ReLU, so the exported graph applies both after it, to one
row instead of one for each point. Up to there the points are columns: ONNX Runtime finds a maximum along rows five
times faster. Batch and point axes are dynamic.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from modt.classes import CLASS_NAMES
from modt.classification import box_classifier, reflectance_classifier
from modt.classification.box_classifier import Layers
from modt.classification.pointnet import CLASS_FREQUENCY_KEY
from modt.classification.pool import PoolWeights
from modt_training.scores import MIN_OBJECT_POINTS, PRECISIONS

Layer = tuple[NDArray[Any], NDArray[Any]]
"""(in, out) weight and (out,) bias."""
N_SHARED = 3
OPSET = 17
IR = 8


def to_lists(layers: Layers) -> list[list[Any]]:
    """Layers for JSON."""
    return [[weight.tolist(), bias.tolist()] for weight, bias in layers]


def classifier_entry(layers: Layers, weights: PoolWeights) -> dict[str, Any]:
    """A box or reflectance classifier, as a model's metadata holds it."""
    return {"weights": asdict(weights), "layers": to_lists(layers)}


class GraphWriter:
    """Nodes and weights of a graph, one after another.

    Args:
        half: store weights in half precision; they are used in single.
    """

    def __init__(self, *, half: bool) -> None:
        self.nodes: list[onnx.NodeProto] = []
        self.weights: list[TensorProto] = []
        self.half = half

    def add(self, operator: str, *inputs: str, **attributes: Any) -> str:
        """Add a node; returns the name of its output."""
        name = f"v{len(self.nodes)}"
        self.nodes.append(helper.make_node(operator, inputs, [name], **attributes))
        return name

    def constant(self, name: str, value: NDArray[Any]) -> str:
        """Add a constant; returns its name in single precision."""
        half = self.half and value.dtype.kind == "f"
        self.weights.append(numpy_helper.from_array(value.astype(np.float16) if half else value, name))
        return self.add("Cast", name, to=TensorProto.FLOAT) if half else name


def graph(layers: Sequence[Layer], *, pool_first: bool = True, half: bool = False) -> onnx.ModelProto:
    """The ONNX graph of a PointNet.

    Args:
        layers: first to last; the first N_SHARED are applied to every point.
        pool_first: False for the textbook order: a point a row, bias and ReLU on every one.
        half: store weights in half precision.
    """
    write = GraphWriter(half=half)
    value = write.add("Transpose", "points", perm=[0, 2, 1]) if pool_first else "points"
    for i, (weight, bias) in enumerate(layers):
        columns = pool_first and i < N_SHARED
        last_shared = i == N_SHARED - 1
        weights = write.constant(f"weight{i}", weight.T.copy() if columns else weight)
        value = write.add("MatMul", *((weights, value) if columns else (value, weights)))
        if columns and last_shared:
            value = write.add("ReduceMax", value, axes=[2], keepdims=0)
        biases = bias[:, None] if columns and not last_shared else bias
        value = write.add("Add", value, write.constant(f"bias{i}", biases))
        if i < len(layers) - 1:
            value = write.add("Relu", value)
        if last_shared and not pool_first:
            value = write.add("ReduceMax", value, axes=[1], keepdims=0)
    write.add("Softmax", value, axis=-1)
    write.nodes[-1].output[0] = "probability"
    ends = (
        [helper.make_tensor_value_info("points", TensorProto.FLOAT, ["batch", "points", 3])],
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


def card(name: str, sha256: str, report: dict[str, Any], data: str, licence: str) -> str:
    """Model card in Markdown."""
    calibration = report["calibration"]
    frequency = report["class_frequency"]
    lines = [
        f"# {name}",
        "",
        "PointNet of section V-A of the paper (n x 3; 32, 64, 512 shared; maximum; 256, 128, 4), ONNX, float32.",
        "",
        f"- sha256: {sha256}",
        f"- licence: {licence}",
        f"- classes: {', '.join(CLASS_NAMES)}",
        "- input: the proposal's own points, x along and y across the line of sight from the middle of their extent",
        "  [m], z above the ground [m] (modt.classification.crops)",
        "- output: probability of each class, softmax with the calibration folded in",
        f"- data: {data}",
        *(
            f"- crops: {made['scans']} scans ({', '.join(made['sensors'])}), {_tally(made)}; sha256 {digest}"
            for made, digest in zip(report["provenance"], report["crops_sha256"], strict=True)
        ),
        f"- training: tools.train.train_pointnet, seed {report['seed']}, {report['steps']} steps, "
        f"torch {report['torch']}, {report['cpu_s']} s on one core",
        f"- calibration: temperature {calibration['temperature']}, class offsets {calibration['offset']}; fitted "
        "with every sensor at equal weight",
        f"- class frequency that the posterior assumes: {_shares(frequency)}",
        "",
        *_by_sensor(report),
        "## What the box rules out",
        "",
        "Share of each class whose object probability from the box is below the first column, out of fold:",
        "",
        *_threshold_table(report["boxes"]["ruled_out"]),
    ]
    for facts in report["reflectance"]:
        lines += [f"From box and reflectance, {facts['sensor']}:", "", *_threshold_table(facts["ruled_out"])]
    return "\n".join(lines)


def _tally(made: dict[str, Any]) -> str:
    """Crops by class (background/car/pedestrian/cyclist) and variant."""
    return ", ".join(f"{'/'.join(map(str, n))} {name}" for name, n in made["crops"].items() if sum(n))


def _shares(values: list[float]) -> str:
    return ", ".join(f"{name} {100 * value:.1f} %" for name, value in zip(CLASS_NAMES, values, strict=True))


def _by_sensor(report: dict[str, Any]) -> list[str]:
    """Tables of the out-of-fold scores (modt_training.scores), method by method and sensor by sensor."""
    boxes = report["boxes"]
    methods = {
        "network": report["cross_validation"],
        "box": boxes["cross_validation"],
        _pool_name(boxes["weights"]): boxes["pool"],
    }
    for facts in report["reflectance"]:
        of_sensor = f", reflectance of the {facts['sensor']}"
        methods |= {
            f"box{of_sensor}": facts["cross_validation"],
            _pool_name(facts["weights"]) + of_sensor: facts["pool"],
        }
    return score_tables(methods)


def score_tables(methods: Mapping[str, dict[str, Any]]) -> list[str]:
    """Markdown tables of out-of-fold scores by sensor, for each method by its name."""
    lines = [
        "## Out of fold, by sensor (drives never split)",
        "",
        f"{' / '.join(CLASS_NAMES[1:]).capitalize()}. AP: average precision over proposals; objects that the",
        "segmentation missed are false negatives. Log loss, calibration error of the likeliest class, and",
        "temperature (what is left to divide the logits by): under the class frequency of the sensor's proposals.",
        f"Recall: of objects of {MIN_OBJECT_POINTS} points, found and called right at this precision; in brackets,",
        "of those that have a proposal of their own.",
        "",
    ]
    for method, scores in methods.items():
        lines += [f"### By {method}", "", f"| sensor | objects | AP | {' | '.join(_POSTERIOR)} | recall at "]
        lines[-1] += " | at ".join(str(p) for p in PRECISIONS) + " |"
        lines += ["|---|" + "---|" * (2 + len(_POSTERIOR) + len(PRECISIONS)), *map(_row, scores.items()), ""]
    return lines


def _pool_name(weights: dict[str, float]) -> str:
    return "pool of " + ", ".join(f"{name} {weight}" for name, weight in weights.items() if weight)


_POSTERIOR = ("log loss", "calibration error", "temperature")


def _row(item: tuple[str, dict[str, Any]]) -> str:
    sensor, of = item
    recalls = [of["recall"][str(precision)] for precision in PRECISIONS]
    cells = [
        " / ".join(str(recalls[0][c]["objects"]) if c in recalls[0] else "0" for c in CLASS_NAMES[1:]),
        " / ".join(f"{100 * of['average_precision'][c]:.0f}" for c in CLASS_NAMES[1:]),
        str(of["log_loss"]),
        str(of["calibration_error"]),
        str(of["temperature"]),
        *(" / ".join(_percent(recall.get(c)) for c in CLASS_NAMES[1:]) for recall in recalls),
    ]
    return f"| {sensor} | " + " | ".join(cells) + " |"


def _percent(recall: dict[str, float] | None) -> str:
    return "-" if recall is None else f"{100 * recall['of_all']:.0f} ({100 * recall['of_found']:.0f})"


def _threshold_table(ruled_out: list[dict[str, Any]]) -> list[str]:
    rows = [
        f"| {row['likely']} | " + " | ".join(f"{100 * row['share'][c]:.1f} %" for c in CLASS_NAMES) + " |"
        for row in ruled_out
    ]
    return [f"| | {' | '.join(CLASS_NAMES)} |", "|---|" + "---|" * len(CLASS_NAMES), *rows, ""]


def export(
    out: Path,
    layers: list[Layer],
    boxes: Layers,
    reflectance: list[Layers],
    report: dict[str, Any],
    data: str,
    licence: str,
) -> None:
    """Write a model (.onnx), and its card beside it (.md).

    Args:
        out: the model.
        layers: layers of the network.
        boxes: layers of the box classifier.
        reflectance: layers of the reflectance classifiers.
        report: facts of the training; those of the box and of each reflectance classifier under the names of both.
        data: description of the training data, for the card.
        licence: for the card.
    """
    network = graph(layers)
    metadata = {CLASS_FREQUENCY_KEY: json.dumps(report["class_frequency"])}
    if reflectance:
        metadata[reflectance_classifier.METADATA_KEY] = json.dumps(
            {
                facts["sensor"]: classifier_entry(layers_of_sensor, PoolWeights.from_dict(facts["weights"]))
                for layers_of_sensor, facts in zip(reflectance, report["reflectance"], strict=True)
            }
        )
    weights = PoolWeights.from_dict(report["boxes"]["weights"])
    metadata[box_classifier.METADATA_KEY] = json.dumps(classifier_entry(boxes, weights))
    helper.set_model_props(network, metadata)
    model = network.SerializeToString(deterministic=True)
    out.write_bytes(model)
    text = card(out.stem, hashlib.sha256(model).hexdigest(), report, data, licence)
    out.with_suffix(".md").write_text(text, encoding="utf-8")
