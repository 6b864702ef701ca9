"""How well segmentation finds what is labelled, and how long each of its stages takes.

    python -m tools.study.segment_report PATH [--profile NAME] [--fov camera|full] [--scans N] [--picture NAME FILE]

PATH is a folder of KITTI's object benchmark (velodyne/, label_2/, calib/), a folder of SemanticKITTI sequences
(*/velodyne, */labels), the name of a synthetic scene, or a .bin scan or a folder of them (times only).

An object counts as found when one proposal shares more than half of the union of their points (clear of the ground,
20 points or more); as split when no proposal holds half of it; as merged when the best one is less than half its own.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from modt import profile
from modt.config import ProfileConfig
from modt.geometry import FieldOfView, inverse, transform
from modt.segmentation.point_columns import PointColumns
from modt.segmentation.segmenter import Segmenter
from modt.simulation.scenes import SCENES
from modt.sources.synthetic_stream import SyntheticStream
from modt.types import NONE, Bool, Float32, Int
from tools.study.birdseye import draw
from tools.train.labelled_scans import object_camera

MIN_POINTS = 20
BAND_M = 15
GROUND = (40, 44, 48, 49, 60, 72)
"""SemanticKITTI: road, parking, sidewalk, other ground, lane marking, terrain."""
UNKNOWN = (0, 1)
GROUND_TOLERANCE_M = 0.15
"""What lies this near the estimated ground counts as ground here; objects begin at the profile's clearance_m."""


@dataclass(frozen=True)
class Scene:
    """A scan and what is known of it: objects (kind, range, points), and which points are ground, of those known."""

    name: str
    points: Float32
    fov: FieldOfView = field(default_factory=FieldOfView)
    objects: tuple[tuple[str, float, Int], ...] = ()
    ground: Bool | None = None
    known: Bool | None = None


def object_scenes(folder: Path) -> Iterator[Scene]:
    """KITTI's object benchmark; boxes as in its labels, points 0.25 m or more above their foot."""
    for path in sorted((folder / "velodyne").glob("*.bin")):
        points = np.fromfile(path, np.float32).reshape(-1, 4)
        camera = object_camera(folder / "calib" / f"{path.stem}.txt")
        objects = []
        for line in (folder / "label_2" / f"{path.stem}.txt").read_text(encoding="utf-8").splitlines():
            kind, *text = line.split()
            height, width, length, *centre, turn = (float(t) for t in text[7:14])
            foot = transform(inverse(camera.T_camera_sensor), np.array([centre]))[0]
            c, s = np.cos(-turn - np.pi / 2), np.sin(-turn - np.pi / 2)
            x, y, z = (points[:, i] - foot[i] for i in range(3))
            inside = (np.abs(c * x + s * y) < length / 2 + 0.15) & (np.abs(c * y - s * x) < width / 2 + 0.15)
            inside &= (z > 0.25) & (z < height + 0.15)
            if kind != "DontCare":
                objects.append((kind, float(np.hypot(*foot[:2])), np.flatnonzero(inside)))
        yield Scene(path.stem, points, FieldOfView.of_camera(camera), tuple(objects))


def semantic_scenes(folder: Path) -> Iterator[Scene]:
    """SemanticKITTI: ground by label."""
    for label in sorted(folder.glob("*/labels/*.label")):
        points = np.fromfile(label.parents[1] / "velodyne" / f"{label.stem}.bin", np.float32).reshape(-1, 4)
        kind = np.fromfile(label, np.uint32) & 0xFFFF
        name = f"{label.parents[1].name}/{label.stem}"
        yield Scene(name, points, ground=np.isin(kind, GROUND), known=~np.isin(kind, UNKNOWN))


def synthetic_scenes(scene: str, sensor: str, scans: int) -> Iterator[Scene]:
    """Sweeps of a synthetic world, a second apart: ground and objects by construction."""
    stream = SyntheticStream(scene, sensor, float(scans), 0)
    for index in range(0, scans * 10, 10):
        frame, truth = stream.simulator.sweep(index)
        seen = np.hypot(*frame.points[:, :2].T) > 0
        objects = []
        for kind, body, box in zip(truth.kinds, truth.bodies, truth.boxes, strict=True):
            clear = frame.points[:, 2] > box[2] - box[5] / 2 + 0.25
            own = np.flatnonzero((truth.instance == body) & clear & seen)
            objects.append((kind.object_class.name.capitalize(), float(np.hypot(*box[:2])), own))
        ground = truth.instance == NONE
        yield Scene(f"{scene}/{index}", frame.points, objects=tuple(objects), ground=ground, known=seen)


def bare_scenes(path: Path) -> Iterator[Scene]:
    """Scans without labels."""
    for scan in [path] if path.is_file() else sorted(path.glob("*.bin")):
        yield Scene(scan.stem, np.fromfile(scan, np.float32).reshape(-1, 4))


def scenes_at(path: str, sensor: str, scans: int) -> Iterator[Scene]:
    """The scans of a path, with the truth that lies beside them."""
    folder = Path(path)
    if path in SCENES:
        return synthetic_scenes(path, sensor, scans)
    if (folder / "label_2").is_dir():
        return object_scenes(folder)
    if any(folder.glob("*/labels")):
        return semantic_scenes(folder)
    return bare_scenes(folder)


class Tally:
    """What became of the labelled objects, by kind and range."""

    def __init__(self) -> None:
        self.seen: Counter[tuple[str, int]] = Counter()
        self.found: Counter[tuple[str, int]] = Counter()
        self.split: Counter[str] = Counter()
        self.merged: Counter[str] = Counter()

    def count(self, label: Int, objects: tuple[tuple[str, float, Int], ...]) -> None:
        """Add a scan's objects, given the proposal of each point."""
        size = np.bincount(label + 1)
        for kind, range_m, own in objects:
            if len(own) < MIN_POINTS:
                continue
            shared = np.bincount(label[own] + 1, minlength=1)
            shared[0] = 0
            best = int(shared.argmax())
            key = (kind, int(range_m // BAND_M) * BAND_M)
            self.seen[key] += 1
            self.found[key] += bool(shared[best] > 0.5 * (size[best] + len(own) - shared[best]))
            self.split[kind] += bool(shared[best] < 0.5 * len(own))
            self.merged[kind] += bool(0 < shared[best] < 0.5 * size[best])

    def table(self) -> dict[str, dict[str, object]]:
        """Recall of each kind, over all and by range; objects that were split and merged."""
        rows: dict[str, dict[str, object]] = {}
        for kind in sorted({kind for kind, _ in self.seen}):
            bands = sorted(band for k, band in self.seen if k == kind)
            total = sum(self.seen[kind, b] for b in bands)
            rows[kind] = {
                "objects": total,
                "recall": round(sum(self.found[kind, b] for b in bands) / total, 4),
                "split": self.split[kind],
                "merged": self.merged[kind],
                "by_range_m": {f"{b}-{b + BAND_M}": f"{self.found[kind, b]}/{self.seen[kind, b]}" for b in bands},
            }
        return rows


def cpu_ms(work: Callable[[], object]) -> float:
    """CPU time of a call on this thread."""
    start = time.thread_time_ns()
    work()
    return (time.thread_time_ns() - start) / 1e6


def stage_times(stage: Segmenter, points: Float32) -> dict[str, float]:
    """CPU time of each part of the stage on a whole sweep [ms]."""
    sweep = PointColumns.from_array(points)
    above = stage.sensor_height.height_m(sweep)
    height = stage.ground.height_above(sweep, above)
    rows = np.flatnonzero(stage.above_ground(sweep, height))
    raised, tall = sweep.take(rows), height[rows]
    whole = {"all": cpu_ms(lambda: stage.segment(points)), "columns": cpu_ms(lambda: PointColumns.from_array(points))}
    whole["ground"] = cpu_ms(lambda: stage.ground.height_above(sweep, above))
    whole["clusters"] = cpu_ms(lambda: stage.clusterer.cluster(raised, tall)) if len(rows) else 0.0
    whole["boxes"] = max(0.0, whole["all"] - whole["columns"] - whole["ground"] - whole["clusters"])
    return whole


def report(scenes: Iterator[Scene], settings: ProfileConfig, whole: bool, picture: tuple[str, Path] | None) -> dict:
    """Segment every scene and sum up."""
    tally, ground, times, proposals = Tally(), Counter[str](), defaultdict[str, list[float]](list), []
    around = Segmenter(settings.segmentation, settings.sensor, FieldOfView())
    for scene in scenes:
        stage = around if whole else Segmenter(settings.segmentation, settings.sensor, scene.fov)
        found = stage.segment(scene.points)
        proposals.append(len(found))
        tally.count(found.label(len(scene.points)), scene.objects)
        sweep = PointColumns.from_array(scene.points)
        height = around.ground.height_above(sweep, around.sensor_height.height_m(sweep))
        if scene.ground is not None and scene.known is not None:
            low = (height < GROUND_TOLERANCE_M) & scene.known
            ground["both"] += int((low & scene.ground).sum())
            ground["said"] += int(low.sum())
            ground["true"] += int((scene.ground & scene.known).sum())
        for name, ms in stage_times(around, scene.points).items():
            times[name].append(ms)
        if picture is not None and scene.name == picture[0]:
            draw(scene.points, height, settings.segmentation.clearance_m, found, picture[1])
    out: dict[str, object] = {"scans": len(proposals), "proposals": float(np.mean(proposals))}
    out["objects"] = tally.table()
    if ground["true"]:
        precision, recall = ground["both"] / ground["said"], ground["both"] / ground["true"]
        f1 = 2 * precision * recall / (precision + recall)
        out["ground"] = {"precision": round(precision, 4), "recall": round(recall, 4), "f1": round(f1, 4)}
    out["cpu_ms"] = {name: round(float(np.median(ms)), 2) for name, ms in times.items()}
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("path")
    parser.add_argument("--profile", default=profile.DEFAULT)
    parser.add_argument("--sensor", default="hdl-64e", help="model of a synthetic scene")
    parser.add_argument(
        "--fov", choices=("camera", "full"), default="camera", help="where objects are labelled, or all"
    )
    parser.add_argument("--scans", type=int, default=20, help="of a synthetic scene")
    parser.add_argument("--picture", nargs=2, metavar=("NAME", "FILE"), help="bird's-eye PNG of a scan")
    args = parser.parse_args()
    picture = (args.picture[0], Path(args.picture[1])) if args.picture else None
    scenes = scenes_at(args.path, args.sensor, args.scans)
    found = report(scenes, profile.load(args.profile), args.fov == "full", picture)
    if not found["scans"]:
        raise SystemExit(f"{args.path}: no scans; give a folder that holds some, or the name of a scene")
    print(json.dumps(found, indent=2))


if __name__ == "__main__":
    main()
