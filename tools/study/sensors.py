"""Recall, precision and track length by sensor and mode, on simulated drives or a labelled recording.

    python -m tools.study.sensors [--sensors NAME ...] [--modes MODE ...] [--scene street crossing] [--seeds 450:453]
                                  [--seconds 6] [--camera] [--recording TRUTH --profile PROFILE]

The table has, for objects of 20 points or more within 60 m [%]: detected (point IoU over 1/2), recall (detected with
the right class), precision, average precision, and track length (share of the labelled frames that one track covers).
The calibration error is that of the class's posterior. The default seeds are those of README.md, and no choice of
this project is made on them.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from modt import profile
from modt.app import assembly
from modt.classes import CLASS_NAMES
from modt.cli.options import frames as number_range
from modt.config import ProfileConfig
from modt.geometry import FieldOfView
from modt_desk.evaluation.evaluation import ALL, DriveRows, Evaluation, collect, evaluation
from modt_desk.evaluation.frame import JudgedFrame
from modt_desk.simulation.sensors import SENSORS
from modt_desk.simulation.synthetic_stream import CAMERA
from tools.options import parser
from tools.study.drives import Drive, labelled, simulated

CLASSES = CLASS_NAMES[1:]


def run(drive: Drive, config: ProfileConfig, mode_name: str, fov: FieldOfView, number: int) -> DriveRows:
    """Run a drive in a mode and judge it."""
    mode = assembly.MODES[mode_name]
    pipeline, budget = assembly.pipeline(mode, config, fov), mode.budget(config)

    def judged() -> Iterator[JudgedFrame]:
        for frame, truth in drive.frames:
            yield JudgedFrame.of_result(pipeline.step(frame, budget), truth, fov)

    return collect(judged(), drive.rules, number)


def by_class(found: Evaluation) -> list[list[float | None]]:
    """Share detected, recall, precision and average precision of each class."""
    whole = found.ranges[ALL]
    scores = [whole.classification[c] for c in CLASSES]
    detected = [whole.segmentation[c].recall if c in whole.segmentation else None for c in CLASSES]
    return [
        detected,
        [s.recall for s in scores],
        [s.precision for s in scores],
        [s.average_precision for s in scores],
    ]


def row(name: str, mode: str, found: Evaluation) -> str:
    """Markdown."""
    scores = [found.ranges[ALL].classification[c] for c in CLASSES]
    columns = [[str(s.segmentable) for s in scores], *([percent(v) for v in values] for values in by_class(found))]
    columns.append(["-" if s.calibration_error is None else f"{s.calibration_error:.3f}" for s in scores])
    tracks = found.tracks.get(ALL)
    length = "-" if tracks is None else f"{percent(tracks.life.ratio)} | {tracks.discontinuities}"
    return f"| {name} | {mode} | {' | '.join(' / '.join(c) for c in columns)} | {length} | {percent(found.beta)} |"


def percent(share: float | None) -> str:
    """Whole percent, "-" for None."""
    return "-" if share is None else f"{100 * share:.0f}"


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--sensors", nargs="*", choices=SENSORS, default=["hdl-64e", "os1-64", "vlp-16"])
    options.add_argument("--modes", nargs="+", choices=assembly.MODES, default=["accurate", "efficient"])
    options.add_argument("--scene", nargs="+", default=["street", "crossing"])
    options.add_argument("--seeds", type=number_range, default=(450, 453), metavar="A:B")
    options.add_argument("--seconds", type=float, default=6.0)
    options.add_argument("--camera", action="store_true", help="a camera's view; else the full circle")
    options.add_argument("--recording", type=Path, metavar="TRUTH", help="in place of simulated drives")
    options.add_argument("--profile", default=profile.DEFAULT, help="of the recording")
    args = options.parse_args()
    print("| sensor | mode | objects | detected | recall | precision | AP | calibration | length | breaks | beta |")
    print("|" + "---|" * 11)
    if args.recording:
        drive = labelled(args.recording, args.profile)
        for mode in args.modes:
            rows = [run(drive, drive.profile, mode, drive.fov, 0)]
            print(row(drive.name, mode, evaluation(rows)), flush=True)
        return
    fov = FieldOfView.of_camera(CAMERA) if args.camera else FieldOfView()
    for sensor in args.sensors:
        drives = [simulated(scene, sensor, args.seconds, seed) for seed in range(*args.seeds) for scene in args.scene]
        for mode in args.modes:
            rows = [run(drive, drive.profile, mode, fov, number) for number, drive in enumerate(drives)]
            print(row(sensor, mode, evaluation(rows)), flush=True)


if __name__ == "__main__":
    main()
