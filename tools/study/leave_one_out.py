"""Leave-one-out: each mechanism switched off by itself, on simulated drives with truth.

    python -m tools.study.leave_one_out [--scene street crossing] [--sensors vlp-16 hdl-64e ...] [--seeds 300:306]
                         [--seconds 12] [--mode accurate] [--no-poses] [--only NAME ...] [--kitti DRIVE]

Drive k of a scene and seed has sensor k of --sensors, in turn. Every figure is that without the mechanism less that
with it: the mean over drives with its 95 % bootstrap interval, bold where the interval excludes zero. A labelled
recording (--kitti) is judged apart, without interval.

recall, said, precision, AP, life [%]: found; found and of the class said; right of what is called; average precision;
frames followed a track, of the ideal. breaks: in 1000 frames of an object. calls: a frame. error [cm]: rms of the
position of a track, where poses are given. CPU [ms]: a frame; the baseline is run again before every fifth mechanism.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path

import numpy as np

from modt.app import assembly
from modt.cli.options import frames as number_range
from modt.config import ProfileConfig
from modt.geometry import FieldOfView
from modt.profile import DEFAULT, load
from modt.sources.recognise import open_stream
from modt.types import Float64, Frame
from modt_desk.evaluation.evaluation import ALL, Evaluation, score
from modt_desk.evaluation.frame import JudgedFrame
from modt_desk.evaluation.rules import CUBOID_RULES, Rules
from modt_desk.evaluation.truth import KITTI_TYPES, FrameTruth, Role
from modt_desk.evaluation.truth_files import open_truth
from modt_desk.simulation import simulator
from modt_desk.simulation.kinds import TRUCK
from modt_desk.simulation.synthetic_stream import SyntheticStream
from tools.options import parser
from tools.study import filter_consistency
from tools.study.mechanisms import MECHANISMS, Switch

FIGURES = ("recall", "said", "precision", "AP", "life", "breaks", "calls", "error", "CPU")
MIN_OBJECTS = 20
"""Least number of objects, over the frames of a drive, of a class with an average precision."""
TYPES = {**KITTI_TYPES, TRUCK.name: (KITTI_TYPES["Car"][0], Role.NEUTRAL)}
RESAMPLES, EVERY = 10_000, 5
SENSORS = ("vlp-16", "hdl-64e", "os1-32", "os1-64", "hdl-32e", "os1-128")


@dataclass(frozen=True, slots=True)
class Drive:
    """Frames with their labels; stream and bodies: where it is simulated."""

    name: str
    profile: ProfileConfig
    frames: Sequence[tuple[Frame, FrameTruth]]
    rules: Rules = CUBOID_RULES
    fov: FieldOfView = field(default_factory=FieldOfView)
    stream: SyntheticStream | None = None
    bodies: Sequence[simulator.Truth] = ()


def simulated(scene: str, sensor: str, seconds: float, seed: int, poses: bool = True) -> Drive:
    """A simulated drive, labelled all round."""
    stream = SyntheticStream(scene, sensor, seconds, seed)
    frames, bodies = zip(*stream.sweeps(), strict=True)
    labels = [FrameTruth.of(TYPES, t.bodies.tolist(), [k.name for k in t.kinds], t.boxes) for t in bodies]
    if not poses:
        frames = tuple(replace(frame, T_world_sensor=None) for frame in frames)
    pairs = list(zip(frames, labels, strict=True))
    return Drive(stream.info.name, load(sensor), pairs, stream=stream, bodies=bodies)


def labelled(path: Path) -> Drive:
    """A labelled recording, its scans in `scans/` if there is such a folder; in the camera's view if it has one."""
    scans = path / "scans"
    stream, truth = open_stream(scans if scans.is_dir() else path), open_truth(path)
    fov = FieldOfView() if stream.info.camera is None else FieldOfView.of_camera(stream.info.camera)
    frames = [(frame, truth.frames[frame.index]) for frame in stream if frame.index in truth.frames]
    return Drive(path.name, load(DEFAULT), frames, truth.rules, fov)


def run(drive: Drive, mode_name: str, switch: Switch | None = None) -> Float64:
    """FIGURES of a drive in a mode of the method, with one mechanism switched off; NaN for what it cannot show."""
    profile, mode = drive.profile if switch is None else switch(drive.profile), assembly.MODES[mode_name]
    pipeline, budget = assembly.pipeline(mode, profile, drive.fov), mode.budget(profile)
    results, cpu_ns = [], 0
    gc.collect()
    for frame, _ in drive.frames:
        begin = time.thread_time_ns()
        results.append(pipeline.step(frame, budget))
        cpu_ns += time.thread_time_ns() - begin
    judged = (
        JudgedFrame.of_result(result, truth, drive.fov)
        for result, (_, truth) in zip(results, drive.frames, strict=True)
    )
    evaluation = score(judged, drive.rules)
    error = np.nan
    if drive.stream is not None and drive.frames[0][0].T_world_sensor is not None:  # else the worlds differ
        seen = (
            filter_consistency.JudgedFrame(r, t, *filter_consistency.majority_bodies(r.proposals, t.instance))
            for r, t in zip(results, drive.bodies, strict=True)
        )
        offsets = [filter_consistency.errors(life)[0] for life in filter_consistency.lives(drive.stream, seen)]
        error = 100 * np.sqrt((np.concatenate(offsets) ** 2).sum(axis=1).mean()) if offsets else np.nan
    calls = sum(len(result.classified) for result in results) / len(results)
    return np.array([*quality(evaluation), calls, error, cpu_ns / 1e6 / len(results)])


def quality(evaluation: Evaluation) -> list[float]:
    """The first six of FIGURES."""
    whole = evaluation.ranges[ALL]
    classes = whole.classification
    sizes = np.array([(s.segmentable, s.called) for s in classes.values()])
    found = [(whole.segmentation[n].recall or 0) if n in whole.segmentation else 0 for n in classes]
    said, right = ([getattr(s, key) or 0 for s in classes.values()] for key in ("recall", "precision"))
    shares = [
        100 * np.dot(share, n) / n.sum() if n.any() else np.nan
        for share, n in ((found, sizes[:, 0]), (said, sizes[:, 0]), (right, sizes[:, 1]))
    ]
    aps = [100 * (s.average_precision or 0) for s in classes.values() if s.objects >= MIN_OBJECTS]
    shares.append(float(np.mean(aps)) if aps else np.nan)
    tracks = evaluation.tracks.get(ALL)
    if tracks is None or not tracks.life.frames:
        return [*shares, np.nan, np.nan]
    return [*shares, 100 * (tracks.life.ratio or 0), 1000 * tracks.discontinuities / tracks.life.frames]


def study(drive: Drive, mode: str, names: Sequence[str]) -> Iterator[Float64]:
    """FIGURES of the drive without each mechanism less those with all of them."""
    for k, name in enumerate(names):
        if k % EVERY == 0:
            baseline = run(drive, mode)
        yield run(drive, mode, MECHANISMS[name][1]) - baseline


def interval(differences: Float64) -> tuple[float, float, float]:
    """Mean over drives (n,) that show it, and the 95 % interval of its bootstrap."""
    shown = differences[~np.isnan(differences)]
    if not len(shown):
        return np.nan, np.nan, np.nan
    picks = np.random.default_rng(0).integers(len(shown), size=(RESAMPLES, len(shown)))
    low, high = np.percentile(shown[picks].mean(axis=1), (2.5, 97.5))
    return float(shown.mean()), float(low), float(high)


def table(names: Sequence[str], differences: Float64, apart: Sequence[tuple[str, Float64]] = ()) -> str:
    """Markdown; differences (drives, names, FIGURES), and those of recordings judged apart (names, FIGURES)."""
    shown = FIGURES[:7]
    header = ["without", "what it is", *FIGURES, *(f"{name}: {', '.join(shown)}" for name, _ in apart)]
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    for k, name in enumerate(names):
        cells = [name, MECHANISMS[name][0]]
        for mean, low, high in (interval(column) for column in differences[:, k].T):
            text = "-" if np.isnan(mean) else f"{mean:+.2f} ({low:+.2f}, {high:+.2f})"
            cells.append(f"**{text}**" if low > 0 or high < 0 else text)
        cells += [" ".join(f"{v:+.1f}" for v in found[k, : len(shown)]) for _, found in apart]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--scene", nargs="+", default=["street", "crossing"])
    options.add_argument("--sensors", nargs="+", default=list(SENSORS), help="each with a profile of the same name")
    options.add_argument("--seeds", type=number_range, default=(300, 306), metavar="A:B")
    options.add_argument("--seconds", type=float, default=12.0)
    options.add_argument("--mode", choices=assembly.MODES, default="accurate")
    options.add_argument("--no-poses", action="store_true")
    options.add_argument("--only", nargs="+", choices=MECHANISMS, default=list(MECHANISMS), metavar="NAME")
    options.add_argument("--kitti", type=Path, action="append", default=[], metavar="DRIVE")
    args = options.parse_args()
    differences = []
    for k, (seed, scene) in enumerate(product(range(*args.seeds), args.scene)):
        drive = simulated(scene, args.sensors[k % len(args.sensors)], args.seconds, seed, not args.no_poses)
        differences.append(list(study(drive, args.mode, args.only)))
        print(f"{drive.name}: {len(args.only)} mechanisms", flush=True)
    apart = [(p.name, np.array(list(study(labelled(p), args.mode, args.only)))) for p in args.kitti]
    about = f"{len(differences)} drives of {args.seconds:g} s, seeds {args.seeds[0]} to {args.seeds[1] - 1}, "
    about += f"{', '.join(args.sensors)}; mode {args.mode}{', no poses' * args.no_poses}."
    print(f"{about}\n\n{table(args.only, np.array(differences), apart)}")


if __name__ == "__main__":
    main()
