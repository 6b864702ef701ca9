"""CPU time of the classifier per proposal, compared with the textbook PointNet on 400 resampled points.

    python -m tools.bench.classification DRIVE [--frames N] [--rounds N]

Both run alternately in one thread with the same weights on the same proposals. The textbook graph applies bias and
ReLU to every point, and the fastest of its batch sizes is taken.
"""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import onnx
from onnx import numpy_helper

from modt import profile
from modt.classification.crops import canonical, gather, ground_z_m
from modt.classification.pointnet import PointNet
from modt.config import ClassificationConfig, SensorConfig
from modt.geometry import FieldOfView
from modt.segmentation.segmenter import Segmenter
from modt.sources.recognise import open_stream
from modt.types import Float32, Float64, Proposals
from tools.options import parser
from tools.train.export_pointnet import N_SHARED, Layer, graph

TEXTBOOK_POINTS = 400
TEXTBOOK_BATCHES = (1, 8, 64)


def layers_of(model: Path) -> list[Layer]:
    """Layers of an exported model."""
    network = onnx.load(model).graph
    table = {t.name: numpy_helper.to_array(t) for t in network.initializer}
    layers = [(table[f"weight{i}"], table[f"bias{i}"]) for i in range(sum(k.startswith("weight") for k in table))]
    shared = N_SHARED if network.node[0].op_type == "Transpose" else 0  # layers of points in columns
    return [(weight.T.copy(), bias.ravel()) for weight, bias in layers[:shared]] + layers[shared:]


def textbook(net: PointNet, points: Float32, proposals: Proposals, batch: int, sensor: SensorConfig) -> Float64:
    """(P, 4) probabilities of proposals resampled to 400 points each, in batches."""
    which = np.arange(len(proposals))
    crops = canonical(gather(points, proposals, which, TEXTBOOK_POINTS), ground_z_m(proposals, which, sensor))
    step = np.arange(TEXTBOOK_POINTS) % crops.count[:, None]
    full = crops.xyz[crops.offsets[:-1, None] + step]
    parts = [net.infer(full[i : i + batch]) for i in range(0, len(full), batch)]
    return np.concatenate(parts).astype(np.float64)


def bare(net: PointNet, sensor: SensorConfig, *, pool_first: bool) -> PointNet:
    """The network without its metadata, in the textbook order or with pooling first."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bare.onnx"
        path.write_bytes(graph(layers_of(net.path), pool_first=pool_first).SerializeToString())
        return PointNet(ClassificationConfig(model=str(path)), sensor)


def cpu_ms(work: Callable[[], object]) -> float:
    """CPU time of a call [ms]."""
    before = time.thread_time_ns()
    work()
    return (time.thread_time_ns() - before) / 1e6


def main() -> None:
    options = parser(__doc__)
    options.add_argument("drive", type=Path)
    options.add_argument("--frames", type=int, default=40, help="number of frames, equally spaced over the drive")
    options.add_argument("--rounds", type=int, default=5)
    args = options.parse_args()
    config = profile.load()
    stream = open_stream(args.drive)
    fov = FieldOfView.of_camera(stream.info.camera) if stream.info.camera else FieldOfView()
    segmenter = Segmenter(config.segmentation, config.sensor, fov)
    sweeps = [frame.points for frame in stream]
    sweeps = sweeps[:: max(1, len(sweeps) // args.frames)]
    scenes = [(points, segmenter.segment(points)) for points in sweeps]
    network = PointNet(config.classification, config.sensor)
    naive = bare(network, config.sensor, pool_first=False)

    def run(name: str, points: Float32, proposals: Proposals) -> Float64:
        if name == "modt":
            return network.classify(points, proposals, np.arange(len(proposals)))
        return textbook(naive, points, proposals, variants[name], config.sensor)

    variants = {"modt": 0} | {f"textbook, batch {size}": size for size in TEXTBOOK_BATCHES}
    times_ms: dict[str, list[float]] = {name: [] for name in variants}
    for _ in range(args.rounds):
        for name, times in times_ms.items():
            times.append(sum(cpu_ms(partial(run, name, *scene)) for scene in scenes))
    n = sum(len(proposals) for _, proposals in scenes)
    cost = {name: min(times) / n for name, times in times_ms.items()}
    best = min(value for name, value in cost.items() if name != "modt")
    counts = np.concatenate([proposals.count for _, proposals in scenes])
    print(
        json.dumps(
            {
                "proposals": n,
                "points_per_proposal": {"mean": round(float(counts.mean()), 1), "median": float(np.median(counts))},
                "cpu_ms_per_proposal": {name: round(value, 4) for name, value in cost.items()},
                "modt_to_textbook": round(cost["modt"] / best, 3),
            },
            indent=1,
        )
    )


if __name__ == "__main__":
    main()
