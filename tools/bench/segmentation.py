"""Cost of segmentation beside that of published packages: same scans, same thread, interleaved.

    python -m tools.bench.segmentation PATH [PATH ...] [--rounds N] [--slow]
    python -m tools.bench.segmentation --beams

Each PATH is a .bin scan or a folder of them. modt is the whole stage (ground, clusters, boxes) on the full circle,
Patchwork++ is ground only. With --slow, scikit-learn's and Open3D's DBSCAN and a cKDTree's pairs cluster the points
above modt's ground. Packages that are not installed (extra "bench") are left out.
--beams measures the cost by number of points, on simulated sweeps of 16 to 128 beams.
Times are CPU time of the thread; ratios are of medians and of minima in one run.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import json
import time
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from modt import host, profile
from modt.geometry import FieldOfView
from modt.segmentation.segmenter import Segmenter
from modt.types import Float32
from modt_desk.simulation.synthetic_stream import SyntheticStream

OURS, BASELINE = "modt: ground + clusters + boxes", "Patchwork++: ground"
RADIUS_M, MIN_POINTS = 0.5, 5
BEAMS = ("vlp-16", "os1-32", "hdl-32e", "os1-64", "hdl-64e", "os1-128")

Contender = Callable[[Float32], object]


def optional(name: str) -> ModuleType | None:
    """A module, if it is installed."""
    with contextlib.suppress(ImportError):
        return importlib.import_module(name)
    return None


def stages(stage: Segmenter) -> Iterator[tuple[str, Contender]]:
    """The stage and the baseline."""
    yield OURS, stage.segment
    patchwork = optional("pypatchworkpp")
    if patchwork is not None:
        parameters = patchwork.Parameters()
        parameters.verbose = False
        yield BASELINE, patchwork.patchworkpp(parameters).estimateGround


def clusterings(stage: Segmenter) -> Iterator[tuple[str, Contender]]:
    """Clusterings of the points above the estimated ground, whose estimation is not timed."""
    yield f"SciPy: cKDTree pairs + components, {RADIUS_M} m", tree_components
    sklearn, open3d = optional("sklearn.cluster"), optional("open3d")
    if sklearn is not None:
        yield f"scikit-learn: DBSCAN, {RADIUS_M} m", sklearn.DBSCAN(eps=RADIUS_M, min_samples=MIN_POINTS).fit
    if open3d is not None:

        def dbscan(xyz: Float32) -> object:
            cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(xyz.astype(np.float64)))
            return cloud.cluster_dbscan(RADIUS_M, MIN_POINTS)

        yield f"Open3D: DBSCAN, {RADIUS_M} m", dbscan


def tree_components(xyz: Float32) -> object:
    """Euclidean clusters by radius search."""
    pairs = cKDTree(xyz).query_pairs(RADIUS_M, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs), np.int8), pairs.T), shape=(len(xyz), len(xyz)))
    return connected_components(graph, directed=False)


def above_ground(stage: Segmenter, points: Float32) -> Float32:
    """(n, 3) points above ground that the stage clusters."""
    return points[stage.above_ground(points)[0], :3]


def cpu_ms(work: Contender, points: Float32) -> float:
    start = time.thread_time_ns()
    work(points)
    return (time.thread_time_ns() - start) / 1e6


def measure(contenders: dict[str, Contender], scans: list[Float32], rounds: int) -> dict[str, list[float]]:
    """CPU times of every contender, interleaved, after one round of warm-up."""
    times: dict[str, list[float]] = {name: [] for name in contenders}
    for round_ in range(rounds + 1):
        for scan in scans:
            for name, work in contenders.items():
                ms = cpu_ms(work, scan)
                if round_:
                    times[name].append(ms)
    return times


def peak_mb(stage: Segmenter, points: Float32) -> float:
    """Peak memory of one call."""
    stage.segment(points)
    tracemalloc.start()
    stage.segment(points)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / 1e6


def summary(times: dict[str, list[float]], base: list[float]) -> dict[str, dict[str, float]]:
    """Median and minimum of each [ms], and their ratios to those of the base, if any."""
    rows = {}
    for name, ms in times.items():
        rows[name] = {"median_ms": round(float(np.median(ms)), 2), "min_ms": round(min(ms), 2)}
        if base:
            rows[name]["ratio_median"] = round(float(np.median(ms) / np.median(base)), 3)
            rows[name]["ratio_min"] = round(min(ms) / min(base), 3)
    return rows


def beams(rounds: int) -> dict[str, dict[str, float]]:
    """The stage on simulated sweeps of one street, by sensor."""
    rows = {}
    for sensor in BEAMS:
        stream = SyntheticStream("street", sensor, 2.0, 0)
        scans = [stream.simulator.sweep(i)[0].points for i in (0, 10)]
        settings = profile.load(sensor)
        stage = Segmenter(settings.segmentation, settings.sensor, FieldOfView())
        ms = min(measure({OURS: stage.segment}, scans, rounds)[OURS])
        points = float(np.mean([len(scan) for scan in scans]))
        rows[sensor] = {
            "points": points,
            "min_ms": round(ms, 2),
            "us_per_1000_points": round(ms * 1e6 / points, 1),
            "proposals": float(np.mean([len(stage.segment(scan)) for scan in scans])),
            "peak_mb": round(max(peak_mb(stage, scan) for scan in scans), 1),
        }
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("paths", type=Path, nargs="*")
    parser.add_argument("--rounds", type=int, default=20)
    parser.add_argument("--slow", action="store_true", help="also the clusterings, which take seconds")
    parser.add_argument("--beams", action="store_true", help="cost by number of beams, on simulated sweeps")
    args = parser.parse_args()
    host.keep_freed_pages()
    found: dict[str, object] = {}
    if args.beams:
        found["beams"] = beams(args.rounds)
    files = [f for path in args.paths for f in ([path] if path.is_file() else sorted(path.rglob("*.bin")))]
    if files:
        scans = [np.fromfile(f, np.float32).reshape(-1, 4) for f in files]
        settings = profile.load()
        stage = Segmenter(settings.segmentation, settings.sensor, FieldOfView())
        found["scans"], found["peak_mb"] = len(scans), round(max(peak_mb(stage, scan) for scan in scans), 1)
        times = measure(dict(stages(stage)), scans, args.rounds)
        base = times.get(BASELINE, [])
        found["quick"] = summary(times, base)
        if args.slow:
            above = [above_ground(stage, scan) for scan in scans]
            found["slow"] = summary(measure(dict(clusterings(stage)), above, 1), base)
    if not found:
        parser.error("give scans, or --beams")
    print(json.dumps(found, indent=2))


if __name__ == "__main__":
    main()
