"""Export trained weights to ONNX, with a card (extra [train]).

    python -m tools.train.export_pointnet TRAINED_DIR models/NAME.onnx --data TEXT --licence TEXT

TRAINED_DIR is what train_pointnet, train_boxes and, where there is any, train_reflectance wrote. What boxes and
 reflectance say goes into the metadata.

Two identities make the exported graph cheap without changing a digit that matters: the maximum commutes with adding a
bias and with ReLU, so both come after it, on one row instead of one a point; and it is idempotent, so that the point
axis may be as long as a proposal has points. Batch and point axes are dynamic.
"""

from __future__ import annotations

import argparse
import hashlib
import json
from pathlib import Path
from typing import Any

import onnx
from onnx import TensorProto, helper, numpy_helper

from modt.classes import CLASS_NAMES
from modt.classification import box_classifier, reflectance_classifier
from tools.train.weights import Layer, load_layers

N_SHARED = 3
OPSET, IR = 17, 8


def graph(layers: list[Layer], *, pool_first: bool = True) -> onnx.ModelProto:
    """The network; with pool_first False the textbook order, bias and ReLU on every point."""
    nodes, value = [], "points"
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
    """What a user must know of a model."""
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
        f"- training: tools/train/train_pointnet.py, seed {report['seed']}, {report['epochs']} epochs, "
        f"{report['teachers']} teachers, torch {report['torch']}, {report['cpu_s']} s on one core",
        f"- calibration: temperature {report['calibration']['temperature']}, "
        f"class offsets {report['calibration']['offset']}",
        "",
    ]
    if "cross_validation" in report:
        lines += ["## Out of fold (drives never split)", "", *_scores(report["cross_validation"])]
    if "reflectance" in report:
        lines += ["## With box and reflectance, out of fold", "", *_reflected(report["reflectance"])]
    lines += ["## The box alone, out of fold", "", *_ruled_out(report["boxes"])]
    return "\n".join(lines)


def _tally(made: dict[str, Any]) -> str:
    """Background, car, pedestrian, cyclist of each variant, and how many nobody labelled."""
    tally = [f"{'/'.join(map(str, n))} {name}" for name, n in made["crops"].items() if sum(n)]
    return ", ".join([*tally, f"{made['unlabelled']} unlabelled"] if made["unlabelled"] else tally)


def _scores(scores: dict[str, Any]) -> list[str]:
    precision, objects = scores["average_precision"], scores["objects"]
    rows = [f"| {c} | {objects[c]} | {100 * precision[c]:.1f} % |" for c in CLASS_NAMES[1:]]
    return [
        "Average precision over proposals; an object that the segmentation missed is a false negative.",
        "",
        "| class | objects | AP |",
        "|---|---|---|",
        *rows,
        "",
        f"Expected calibration error {scores['ece']} (before calibration {scores['ece_uncalibrated']}).",
        "",
        *_confused(scores["confusion"]),
    ]


def _confused(confusion: list[list[int]]) -> list[str]:
    called = [f"| {c} | " + " | ".join(map(str, row)) + " |" for c, row in zip(CLASS_NAMES, confusion, strict=True)]
    return ["| true, called | " + " | ".join(CLASS_NAMES) + " |", "|---|" + "---|" * len(CLASS_NAMES), *called, ""]


def _listed(precision: dict[str, float]) -> str:
    return ", ".join(f"{name} {100 * value:.1f} %" for name, value in precision.items())


def _reflected(told: dict[str, Any]) -> list[str]:
    shape = told["network"]
    return [
        f"What the returns' reflectance says (modt.classification.reflectance_classifier), in the metadata, on the "
        f"scale of an {told['sensor']}; not looked at elsewhere.",
        "",
        f"- the network to the power of {1 - told['share']:.2f}, the box to that of {told['share']} and the "
        f"reflectance to that of {told['weight']}: average precision {_listed(shape['average_precision'])}, "
        f"calibration error {shape['ece']}, log loss {shape['log_loss']} ({shape['log_loss_without']} by shape)",
        f"- without reflectance the network to the power of {1 - told['share_without']:.2f} and the box to that of "
        f"{told['share_without']}",
        f"- the box and all of it: average precision {_listed(told['box']['average_precision'])}",
        "",
        *_confused(shape["confusion"]),
        "By box and reflectance an object with less than the probability in the first column:",
        "",
        *_thresholds(told["box"]["ruled_out"]),
    ]


def _ruled_out(boxes: dict[str, Any]) -> list[str]:
    return [
        f"What a box says (modt.classification.box_classifier), in the metadata; average precision "
        f"{_listed(boxes['average_precision'])}.",
        "By its box an object with less than the probability in the first column:",
        "",
        *_thresholds(boxes["ruled_out"]),
    ]


def _thresholds(ruled_out: list[dict[str, Any]]) -> list[str]:
    rows = [
        f"| {row['likely']} | " + " | ".join(f"{100 * row['share'][c]:.1f} %" for c in CLASS_NAMES) + " |"
        for row in ruled_out
    ]
    return [f"| | {' | '.join(CLASS_NAMES)} |", "|---|" + "---|" * len(CLASS_NAMES), *rows, ""]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("trained", type=Path, help="folder that tools/train/train_pointnet.py wrote")
    parser.add_argument("out", type=Path, help="model to write (.onnx); its card goes beside it (.md)")
    parser.add_argument("--data", required=True, help="what it was trained on, for the card")
    parser.add_argument("--licence", required=True)
    args = parser.parse_args()
    network = graph(load_layers(args.trained / "weights.npz"))
    report = json.loads((args.trained / "report.json").read_text(encoding="utf-8"))
    report["boxes"] = json.loads((args.trained / "boxes.json").read_text(encoding="utf-8"))
    held, share = {}, 0.0
    if (args.trained / "reflectance.json").exists():
        told = json.loads((args.trained / "reflectance.json").read_text(encoding="utf-8"))
        report["reflectance"] = told
        layers = load_layers(args.trained / "reflectance.npz")
        held[reflectance_classifier.METADATA_KEY] = reflectance_classifier.to_metadata(
            layers, told["share"], told["weight"], told["sensor"]
        )
        share = told["share_without"]
    held[box_classifier.METADATA_KEY] = box_classifier.to_metadata(load_layers(args.trained / "boxes.npz"), share)
    helper.set_model_props(network, held)
    model = network.SerializeToString(deterministic=True)
    args.out.write_bytes(model)
    text = card(args.out.stem, hashlib.sha256(model).hexdigest(), report, args.data, args.licence)
    args.out.with_suffix(".md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
