"""Export trained weights to ONNX, with a card (extra [train]).

    python -m tools.train.export_pointnet TRAINED_DIR models/NAME.onnx --data TEXT --licence TEXT

TRAINED_DIR holds the output of train_pointnet, train_box_classifier and, optionally, train_reflectance_classifier.
The layers of the box and the reflectance classifier are stored in the model's metadata.

The maximum over points commutes with adding a bias and with ReLU, so the exported graph applies both after it, to one
row instead of one for each point. Batch and point axes are dynamic.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import onnx
from onnx import TensorProto, helper, numpy_helper

from modt.classes import CLASS_NAMES
from modt.classification import box_classifier, reflectance_classifier
from tools.options import parser
from tools.train.weights import Layer, load_layers

N_SHARED = 3
OPSET, IR = 17, 8


def graph(layers: list[Layer], *, pool_first: bool = True) -> onnx.ModelProto:
    """The ONNX graph; without `pool_first` in the textbook order, bias and ReLU applied to every point."""
    value = "points"
    nodes: list[onnx.NodeProto] = []
    initial: list[TensorProto] = []

    def add(op: str, *extra: str, **attributes: Any) -> None:
        nonlocal value
        result = f"v{len(nodes)}"
        nodes.append(helper.make_node(op, [value, *extra], [result], **attributes))
        value = result

    for i, (weight, bias) in enumerate(layers):
        initial.append(numpy_helper.from_array(weight, f"weight{i}"))
        initial.append(numpy_helper.from_array(bias, f"bias{i}"))
        last_shared = i == N_SHARED - 1
        add("MatMul", f"weight{i}")
        if last_shared and pool_first:
            add("ReduceMax", axes=[1], keepdims=0)
        add("Add", f"bias{i}")
        add("Softmax", axis=-1) if i == len(layers) - 1 else add("Relu")
        if last_shared and not pool_first:
            add("ReduceMax", axes=[1], keepdims=0)
    nodes[-1].output[0] = "probability"
    ends = (
        [helper.make_tensor_value_info("points", TensorProto.FLOAT, ["batch", "points", 3])],
        [helper.make_tensor_value_info("probability", TensorProto.FLOAT, ["batch", len(CLASS_NAMES)])],
    )
    model = helper.make_model(
        helper.make_graph(nodes, "pointnet", *ends, initial),
        opset_imports=[helper.make_opsetid("", OPSET)],
        ir_version=IR,
        producer_name="modt",
    )
    onnx.checker.check_model(model, full_check=True)
    return model


def card(name: str, sha256: str, report: dict[str, Any], data: str, licence: str) -> str:
    """Model card in Markdown."""
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
            f"- crops: {made['scans']} scans, {_tally(made)}; sha256 {digest}"
            for made, digest in zip(report["provenance"], report["crops_sha256"], strict=True)
        ),
        f"- training: tools.train.train_pointnet, seed {report['seed']}, {report['epochs']} epochs, "
        f"{report['teachers']} teachers, torch {report['torch']}, {report['cpu_s']} s on one core",
        f"- calibration: temperature {report['calibration']['temperature']}, "
        f"class offsets {report['calibration']['offset']}",
        "",
    ]
    if "cross_validation" in report:
        lines += ["## Out of fold (drives never split)", "", *_scores(report["cross_validation"])]
    if "reflectance" in report:
        lines += ["## With box and reflectance, out of fold", "", *_reflectance_section(report["reflectance"])]
    lines += ["## The box alone, out of fold", "", *_box_section(report["boxes"])]
    return "\n".join(lines)


def _tally(made: dict[str, Any]) -> str:
    """Crops by class (background/car/pedestrian/cyclist) and variant, and unlabelled crops."""
    tally = [f"{'/'.join(map(str, n))} {name}" for name, n in made["crops"].items() if sum(n)]
    return ", ".join([*tally, f"{made['unlabelled']} unlabelled"] if made["unlabelled"] else tally)


def _scores(scores: dict[str, Any]) -> list[str]:
    precision, objects = scores["average_precision"], scores["objects"]
    rows = [f"| {c} | {objects[c]} | {100 * precision[c]:.1f} % |" for c in CLASS_NAMES[1:]]
    return [
        "Average precision over proposals; objects missed by the segmentation count as false negatives.",
        "",
        "| class | objects | AP |",
        "|---|---|---|",
        *rows,
        "",
        f"Expected calibration error {scores['ece']} (before calibration {scores['ece_uncalibrated']}).",
        "",
        *_confusion_table(scores["confusion"]),
    ]


def _confusion_table(confusion: list[list[int]]) -> list[str]:
    rows = [f"| {c} | " + " | ".join(map(str, row)) + " |" for c, row in zip(CLASS_NAMES, confusion, strict=True)]
    return ["| true, predicted | " + " | ".join(CLASS_NAMES) + " |", "|---|" + "---|" * len(CLASS_NAMES), *rows, ""]


def _listed(precision: dict[str, float]) -> str:
    return ", ".join(f"{name} {100 * value:.1f} %" for name, value in precision.items())


def _reflectance_section(report: dict[str, Any]) -> list[str]:
    pool = report["network"]
    return [
        f"Reflectance classifier (modt.classification.reflectance_classifier) in the metadata, for the sensor "
        f"{report['sensor']}; not applied to other sensors.",
        "",
        f"- log-linear pool, network to the power {1 - report['share']:.2f}, box {report['share']}, reflectance "
        f"{report['weight']}: average precision {_listed(pool['average_precision'])}, calibration error "
        f"{pool['ece']}, log loss {pool['log_loss']} ({pool['log_loss_without']} for the network alone)",
        f"- pool without reflectance: network to the power {1 - report['share_without']:.2f}, box "
        f"{report['share_without']}",
        f"- box and reflectance: average precision {_listed(report['box']['average_precision'])}",
        "",
        *_confusion_table(pool["confusion"]),
        "Share of each class whose object probability from box and reflectance is below the first column:",
        "",
        *_threshold_table(report["box"]["ruled_out"]),
    ]


def _box_section(boxes: dict[str, Any]) -> list[str]:
    return [
        f"Box classifier (modt.classification.box_classifier) in the metadata; average precision "
        f"{_listed(boxes['average_precision'])}.",
        "Share of each class whose object probability from the box is below the first column:",
        "",
        *_threshold_table(boxes["ruled_out"]),
    ]


def _threshold_table(ruled_out: list[dict[str, Any]]) -> list[str]:
    rows = [
        f"| {row['likely']} | " + " | ".join(f"{100 * row['share'][c]:.1f} %" for c in CLASS_NAMES) + " |"
        for row in ruled_out
    ]
    return [f"| | {' | '.join(CLASS_NAMES)} |", "|---|" + "---|" * len(CLASS_NAMES), *rows, ""]


def main() -> None:
    options = parser(__doc__)
    options.add_argument("trained", type=Path, help="folder written by tools.train.train_pointnet")
    options.add_argument("out", type=Path, help="model to write (.onnx), with its card beside it (.md)")
    options.add_argument("--data", required=True, help="description of the training data, for the card")
    options.add_argument("--licence", required=True)
    args = options.parse_args()
    network = graph(load_layers(args.trained / "weights.npz"))
    report = json.loads((args.trained / "report.json").read_text(encoding="utf-8"))
    report["boxes"] = json.loads((args.trained / "boxes.json").read_text(encoding="utf-8"))
    metadata, share = {}, 0.0
    if (args.trained / "reflectance.json").exists():
        fused = json.loads((args.trained / "reflectance.json").read_text(encoding="utf-8"))
        report["reflectance"] = fused
        layers = load_layers(args.trained / "reflectance.npz")
        metadata[reflectance_classifier.METADATA_KEY] = reflectance_classifier.to_metadata(
            layers, fused["share"], fused["weight"], fused["sensor"]
        )
        share = fused["share_without"]
    metadata[box_classifier.METADATA_KEY] = box_classifier.to_metadata(load_layers(args.trained / "boxes.npz"), share)
    helper.set_model_props(network, metadata)
    model = network.SerializeToString(deterministic=True)
    args.out.write_bytes(model)
    text = card(args.out.stem, hashlib.sha256(model).hexdigest(), report, args.data, args.licence)
    args.out.with_suffix(".md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
