"""Accuracy and CPU time of an int8 model (static, per channel, QDQ) against float32, on real crops.

    python -m tools.study.int8 MODEL.onnx CROPS.npz [--points N]

Prints one JSON object. Every other crop is for the calibration, the rest for the comparison.
"""

from __future__ import annotations

import json
import os
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

os.environ["ORT_DISABLE_TELEMETRY"] = "1"  # read at the import, as in modt.classification.pointnet
from onnxruntime.quantization import CalibrationDataReader, QuantFormat, QuantType, quantize_static

from modt.classes import N_CLASSES
from modt.classification.crops import Crops, canonical
from modt.classification.pointnet import PointNet
from modt.config import ClassificationConfig, SensorConfig
from modt.types import Float32, Float64, Int
from modt_desk.evaluation.class_score import average_precision
from tools.options import parser
from tools.train.dataset import SHIPPED, Dataset, load

BATCH = 8


def batches(data: Dataset, rows: Int, max_points: int) -> Iterator[tuple[Int, Float32]]:
    """Batches of crops of similar size, as in the classifier."""
    crops = canonical(subsample_evenly(data.take(rows), max_points), data.sensors.take(rows).ground_z_m)
    order = np.argsort(crops.count, kind="stable")
    for first in range(0, len(order), BATCH):
        chosen = order[first : first + BATCH]
        yield chosen, crops.padded(chosen)


def subsample_evenly(crops: Crops, limit: int) -> Crops:
    """Subsample each crop at equal steps to at most `limit` points."""
    kept = np.minimum(crops.count, limit)
    offsets = np.append(0, np.cumsum(kept))
    step = np.arange(offsets[-1]) - np.repeat(offsets[:-1], kept)
    inside = step * np.repeat(crops.count, kept) // np.repeat(kept, kept)
    return Crops(crops.xyz[np.repeat(crops.offsets[:-1], kept) + inside], offsets)


class Reader(CalibrationDataReader):
    """Batches for the calibration of the quantisation."""

    def __init__(self, data: Dataset, rows: Int, max_points: int) -> None:
        self._batches = batches(data, rows, max_points)

    def get_next(self) -> dict[str, Float32] | None:
        """The next batch, None after the last."""
        following = next(self._batches, None)
        return None if following is None else {"points": following[1]}


def run(net: PointNet, data: Dataset, rows: Int, max_points: int) -> tuple[Float64, float]:
    """(R, 4) probabilities, and CPU time per crop [ms]."""
    out = np.zeros((len(rows), N_CLASSES))
    prepared = list(batches(data, rows, max_points))
    times = []
    for _ in range(3):
        before = time.thread_time_ns()
        for chosen, batch in prepared:
            out[chosen] = net.infer(batch)
        times.append((time.thread_time_ns() - before) / 1e6 / len(rows))
    return out, min(times)


def main() -> None:
    options = parser(__doc__)
    options.add_argument("model", type=Path)
    options.add_argument("crops", type=Path)
    options.add_argument("--points", type=int, default=ClassificationConfig().max_points)
    args = options.parse_args()
    data = load(args.crops)
    shipped = np.flatnonzero((data.variant == SHIPPED) & data.trainable)
    report: dict[str, object] = {}
    with tempfile.TemporaryDirectory() as folder:
        small = Path(folder) / "int8.onnx"
        quantize_static(
            args.model,
            small,
            Reader(data, shipped[::2], args.points),
            quant_format=QuantFormat.QDQ,
            per_channel=True,
            activation_type=QuantType.QUInt8,
            weight_type=QuantType.QInt8,
        )
        outputs = {}
        for name, path in {"float32": args.model, "int8": small}.items():
            net = PointNet(ClassificationConfig(model=str(path)), SensorConfig())
            rows = shipped[1::2]
            outputs[name], cost = run(net, data, rows, args.points)
            label = data.label[rows]
            report[name] = {
                "cpu_ms_a_crop": round(cost, 4),
                "bytes": path.stat().st_size,
                "average_precision": average_precision(outputs[name], label, np.bincount(label, minlength=N_CLASSES)),
            }
        same = outputs["float32"].argmax(axis=1) == outputs["int8"].argmax(axis=1)
        report["same_class"] = round(float(same.mean()), 4)
        report["largest_difference"] = round(float(np.abs(outputs["float32"] - outputs["int8"]).max()), 3)
    print(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
