"""What a proposal costs: our network against 400 resampled points through the textbook graph.

    python -m tools.bench.classification DRIVE [--frames N] [--rounds N]

Same process, same thread, same weights, same proposals, turn by turn; CPU time of the thread. The textbook graph adds
bias and applies ReLU on every point, and takes proposals in the batches that suit it best of those tried.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import onnx
from onnx import numpy_helper

from modt import profile
from modt.classification.crops import canonical, gather, sensor_height_m
from modt.classification.pointnet import PointNet
from modt.config import ClassificationConfig, SensorConfig
from modt.geometry import FieldOfView
from modt.segmentation.segmenter import Segmenter
from modt.sources.recognise import open_stream
from modt.types import Float32, Float64, Proposals
from tools.train.export_pointnet import graph
from tools.train.weights import Layer

TEXTBOOK_POINTS = 400
TEXTBOOK_BATCHES = (1, 8, 64)


def layers_of(model: Path) -> list[Layer]:
    """Weights and biases of an exported model."""
    table = {t.name: numpy_helper.to_array(t) for t in onnx.load(model).graph.initializer}
    return [(table[f"weight{i}"], table[f"bias{i}"]) for i in range(sum(k.startswith("weight") for k in table))]


def textbook(net: PointNet, points: Float32, proposals: Proposals, batch: int, sensor: SensorConfig) -> Float64:
    """Each proposal resampled to 400 points, in batches."""
    crops = gather(points, proposals, np.arange(len(proposals)), TEXTBOOK_POINTS)
    crops = canonical(crops, sensor_height_m(proposals, sensor))
    step = np.arange(TEXTBOOK_POINTS) % crops.count[:, None]
    full = crops.xyz[crops.offsets[:-1, None] + step]
    parts = [net.infer(full[i : i + batch]) for i in range(0, len(full), batch)]
    return np.concatenate(parts).astype(np.float64)


def bare(net: PointNet, sensor: SensorConfig, *, pool_first: bool) -> PointNet:
    """The network by itself, in the textbook's order or in ours."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bare.onnx"
        path.write_bytes(graph(layers_of(net.path), pool_first=pool_first).SerializeToString())
        return PointNet(ClassificationConfig(model=str(path)), sensor)


def cpu_ms(work: Callable[[], object]) -> float:
    before = time.thread_time_ns()
    work()
    return (time.thread_time_ns() - before) / 1e6


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("drive", type=Path)
    parser.add_argument("--frames", type=int, default=40, help="spread over the drive")
    parser.add_argument("--rounds", type=int, default=5)
    args = parser.parse_args()
    config = profile.load()
    stream = open_stream(args.drive)
    fov = FieldOfView.of_camera(stream.info.camera) if stream.info.camera else FieldOfView()
    segmenter = Segmenter(config.segmentation, config.sensor, fov)
    sweeps = [frame.points for frame in stream]
    sweeps = sweeps[:: max(1, len(sweeps) // args.frames)]
    scenes = [(points, segmenter.segment(points)) for points in sweeps]
    ours = PointNet(config.classification, config.sensor)
    naive, alone = (bare(ours, config.sensor, pool_first=first) for first in (False, True))
    ways: dict[str, Callable[[Float32, Proposals], Float64]] = {
        "ours": lambda points, proposals: ours.classify(points, proposals, np.arange(len(proposals)))
    }
    for size in TEXTBOOK_BATCHES:
        ways[f"textbook, batch {size}"] = lambda points, proposals, size=size: textbook(
            naive, points, proposals, size, config.sensor
        )
    spent: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(args.rounds):
        for name, way in ways.items():
            spent[name].append(sum(cpu_ms(lambda way=way, scene=scene: way(*scene)) for scene in scenes))
    n = sum(len(proposals) for _, proposals in scenes)
    cost = {name: min(values) / n for name, values in spent.items()}
    best = min(value for name, value in cost.items() if name != "ours")
    apart = max(
        float(
            np.abs(
                alone.classify(*s, np.arange(len(s[1]))) - ways[f"textbook, batch {TEXTBOOK_BATCHES[1]}"](*s)
            ).max()
        )
        for s in scenes
        if len(s[1])
    )
    counts = np.concatenate([proposals.count for _, proposals in scenes])
    print(
        json.dumps(
            {
                "proposals": n,
                "points_a_proposal": {"mean": round(float(counts.mean()), 1), "median": float(np.median(counts))},
                "cpu_ms_a_proposal": {name: round(value, 4) for name, value in cost.items()},
                "ours_to_textbook": round(cost["ours"] / best, 3),
                "largest_difference": float(f"{apart:.2g}"),
            },
            indent=1,
        )
    )


if __name__ == "__main__":
    main()
