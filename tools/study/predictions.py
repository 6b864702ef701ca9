"""Blind predictions of gamma over regimes: calibrated on some streams, tested on others.

    python -m tools.study.predictions WORK_DIR [--kitti ROOT] [--regimes NAME ...] [--repeat K] [--core N|none]

By the commands of a user: `modt simulate`, `modt-profile compare` of the calibrations' streams, then `modt-profile
predict` of every test, and only then `modt-profile compare` of these. A test is predicted by the calibrations of all
regimes with its network and field of view. Files in WORK_DIR are not made again.
Prints Markdown: a row for each test and mode, gamma predicted with its interval at 95 %, measured, and the errors of
the prediction and of its rivals; then how often and how far it was off, and how far the reconciliation. Without
--kitti its streams are left out.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tools.options import parser

SECONDS, FRAMES = 5, "0:24"
"""Of simulated drives, and those that are used of every stream."""
RECORDED = {"kitti-0005": "raw/2011_09_26/2011_09_26_drive_0005_sync"}
RIVALS = ("gamma = N_go", "Equation 3 bare", "the calibration's ratio")
NEAR, BOUND = 0.06, 0.10
"""Errors that are told."""


@dataclass(frozen=True)
class Regime:
    """One way to run the method.

    Attributes:
        profile: names of profiles, and keys of its own as YAML.
        fov: field of view.
        calibrations: streams, SCENE-SENSOR-SEED of simulated ones or names of RECORDED.
        tests: streams.
        network: regimes of one network share their calibrations.
    """

    profile: tuple[str, str]
    fov: str
    calibrations: tuple[str, ...]
    tests: tuple[str, ...]
    network: str

    def shares_with(self, other: Regime) -> bool:
        """Whether the calibrations of one serve the other."""
        return (self.network, self.fov) == (other.network, other.fov)


def _network(name: str) -> str:
    points = "max_points: 400, likelihood: network"
    return f"classification: {{model: {name}, {points}}}\nscheduler: {{calls_per_frame: null}}\n"


def _range(metres: float) -> str:
    return f"sensor: {{max_range_m: {metres}}}\n"


PAPER, DEAR = _network("pointnet-paper-40"), _network("pointnet-dear")
HDL, VLP = (
    tuple(f"{scene}-{sensor}-{seed}" for seed, scene in enumerate(("street", "crossing") * 3, 1))
    for sensor in ("hdl-64e", "vlp-16")
)
REAL = "kitti-0005"
REGIMES = {
    "default": Regime(("hdl-64e", ""), "full", HDL[:2], (*HDL[2:], REAL), "default"),
    "default, camera": Regime(("hdl-64e", ""), "camera", HDL[:2], HDL[2:], "default"),
    "paper's network": Regime(("hdl-64e", PAPER), "full", HDL[:2], (*HDL[2:], REAL), "paper's"),
    "paper's network, 20 m": Regime(("hdl-64e", PAPER + _range(20.0)), "full", HDL[:2], HDL[2:], "paper's"),
    "paper": Regime(("paper", ""), "full", HDL[:2], HDL[2:], "paper's method"),
    "paper, camera": Regime(("paper", ""), "camera", HDL[:2], HDL[2:], "paper's method"),
    "dear network, camera": Regime(("hdl-64e", DEAR), "camera", HDL[:2], HDL[2:], "dear"),
    "dear network, 10 m": Regime(("hdl-64e", DEAR + _range(10.0)), "full", HDL[:2], HDL[2:], "dear"),
    "VLP-16": Regime(("vlp-16", ""), "full", VLP[:2], VLP[2:], "default"),
    "VLP-16, paper's network": Regime(("vlp-16", PAPER), "full", VLP[:2], VLP[2:], "paper's"),
    "VLP-16, dear network": Regime(("vlp-16", DEAR), "full", VLP[:2], VLP[2:], "dear"),
}


class Study:
    """The commands and files of a study."""

    def __init__(self, work: Path, kitti: Path | None, repeat: int, core: str) -> None:
        self._work, self._kitti = work, kitti
        self._repeat, self._core = repeat, core

    def has(self, stream: str) -> bool:
        """Whether a stream is there, or can be simulated."""
        return self._kitti is not None or stream not in RECORDED

    def calibrate(self, name: str, regime: Regime) -> None:
        """Run the modes on the streams of the calibration."""
        for stream in filter(self.has, regime.calibrations):
            self._made(self._calibration(name, stream), "compare", *self._run(name, regime, stream))

    def predict(self, name: str, regime: Regime, test: str, regimes: Mapping[str, Regime]) -> dict[str, Any]:
        """Predict a test, on which no mode has run yet, by the calibrations of these regimes."""
        given: list[str | Path] = []
        for other, calibrated in regimes.items():
            for stream in filter(self.has, calibrated.calibrations if regime.shares_with(calibrated) else ()):
                given += ["--calibration", self._calibration(other, stream)]
        out, stream_options = self._file("predictions", name, test), self._stream(name, regime, test)
        return self._made(out, "predict", *stream_options, *given, "--observe", "all", "--json")

    def measure(self, name: str, regime: Regime, test: str) -> dict[str, Any]:
        """Run the modes on a test."""
        return self._made(self._file("measured", name, test), "compare", *self._run(name, regime, test))

    def _run(self, name: str, regime: Regime, stream: str) -> tuple[str | Path, ...]:
        return (*self._stream(name, regime, stream), "--repeat", str(self._repeat), "--json")

    def _stream(self, name: str, regime: Regime, stream: str) -> tuple[str | Path, ...]:
        base, own = regime.profile
        profile = self._work / "profiles" / f"{_slug(name)}.yaml"
        profile.parent.mkdir(parents=True, exist_ok=True)
        profile.write_text(f"extends: {base}\n{own}", encoding="utf-8")
        shared = ("--frames", FRAMES, "--profile", profile, "--fov", regime.fov, "--core", self._core)
        if stream in RECORDED:
            assert self._kitti is not None
            return (self._kitti / RECORDED[stream], *shared)
        return (self._drive(stream), *shared)

    def _drive(self, stream: str) -> Path:
        """Of a simulated stream."""
        scene, sensor = stream.split("-", 1)
        sensor, seed = sensor.rsplit("-", 1)
        out = self._work / "drives" / stream
        if not out.exists():
            what = ("--scene", scene, "--sensor", sensor, "--seed", seed, "--seconds", str(SECONDS))
            _command("modt.cli.main", "simulate", *what, "--out", out)
        return next(out.glob("*/*_sync"))

    def _calibration(self, name: str, stream: str) -> Path:
        return self._file("calibrations", name, stream)

    def _file(self, kind: str, name: str, stream: str) -> Path:
        return self._work / kind / f"{_slug(name)}-{stream}.json"

    def _made(self, out: Path, *command: str | Path) -> dict[str, Any]:
        """What a command writes, or has written."""
        if not out.exists():
            print(f"{out.parent.name}: {out.stem}", file=sys.stderr, flush=True)
            text = _command("modt.cli.profile", *command)
            out.parent.mkdir(parents=True, exist_ok=True)
            out.write_text(text, encoding="utf-8")
        tree: dict[str, Any] = json.loads(out.read_text(encoding="utf-8"))
        return tree


@dataclass(frozen=True)
class Outcome:
    """Gamma of a mode on a test, and its prediction and rivals, by name; the first is the prediction."""

    regime: str
    test: str
    mode: str
    measured: float
    interval: tuple[float, float]
    said: dict[str, float]
    reconciled: float

    @property
    def error(self) -> float:
        """Relative, of the prediction."""
        return self.off("predicted")

    def off(self, name: str) -> float:
        """Relative error of what was said."""
        return self.said[name] / self.measured - 1.0

    @property
    def covered(self) -> bool:
        """Whether the interval holds what was measured."""
        return self.interval[0] <= self.measured <= self.interval[1]


def outcomes(regime: str, test: str, prediction: dict[str, Any], found: dict[str, Any]) -> Iterator[Outcome]:
    """Of each mode, by a prediction and the comparison that came after it."""
    for mode, saved in found["savings"].items():
        row = prediction["gamma"][mode]
        interval = row["predicted"]["low"], row["predicted"]["high"]
        said = {name: float(row[name]["value"]) for name in ("predicted", *RIVALS)}
        measured, reconciled = (float(saved[f"gamma_{k}"]["value"]) for k in ("measured_cpu", "reconciled"))
        yield Outcome(regime, test, mode, measured, interval, said, reconciled)


def table(found: Sequence[Outcome]) -> Iterator[str]:
    """Markdown, a row each."""
    yield f"| regime | test | mode | predicted | 95 % | measured | off | {' | '.join(RIVALS)} | reconciled |"
    yield "|" + "---|" * (8 + len(RIVALS))
    for o in found:
        rivals = " | ".join(f"{100 * o.off(name):+.0f} %" for name in RIVALS)
        low, high = o.interval
        cells = [o.regime, o.test, o.mode, f"{o.said['predicted']:.2f}", f"{low:.2f} to {high:.2f}"]
        off = f"{100 * o.error:+.1f} %{'' if o.covered else ' (outside)'}"
        closed = f"{100 * (o.reconciled / o.measured - 1):+.1f} %"
        yield f"| {' | '.join(cells)} | {o.measured:.2f} | {off} | {rivals} | {closed} |"


def summary(found: Sequence[Outcome]) -> Iterator[str]:
    """How often and how far the predictions are off."""
    errors = {name: np.abs([o.off(name) for o in found]) for name in ("predicted", *RIVALS)}
    mine, copied = errors["predicted"], errors["the calibration's ratio"]
    gamma, reconciled = (np.array([getattr(o, name) for o in found]) for name in ("measured", "reconciled"))
    tests = {(o.regime, o.test) for o in found}
    yield f"{len(tests)} tests, {len(found)} ratios, gamma {gamma.min():.2f} to {gamma.max():.2f}"
    yield f"within {100 * BOUND:.0f} %: {100 * (mine <= BOUND).mean():.0f} %"
    yield f"within {100 * NEAR:.0f} %: {100 * (mine <= NEAR).mean():.0f} %"
    yield f"covered by the interval at 95 %: {100 * np.mean([o.covered for o in found]):.0f} %"
    yield "median error: " + ", ".join(f"{name} {100 * np.median(error):.1f} %" for name, error in errors.items())
    yield f"median error over that of the copied ratio: {np.median(mine) / np.median(copied):.2f}"
    closed = np.abs(reconciled / gamma - 1)
    share = (closed <= 0.05).mean()
    yield f"reconciliation: median error {100 * np.median(closed):.1f} %, within 5 %: {100 * share:.0f} %"


def _slug(name: str) -> str:
    return "".join(c if c.isalnum() else "-" for c in name)


def _command(module: str, *arguments: str | Path) -> str:
    done = subprocess.run(
        [sys.executable, "-m", module, *map(str, arguments)], stdout=subprocess.PIPE, text=True, check=True
    )
    return done.stdout


def main() -> None:
    options = parser(__doc__)
    options.add_argument("work", type=Path, help="folder for drives, calibrations, predictions and measurements")
    options.add_argument("--kitti", type=Path, help="KITTI root, for the recorded streams")
    options.add_argument("--regimes", nargs="+", choices=REGIMES, default=list(REGIMES), metavar="NAME")
    options.add_argument("--repeat", type=int, default=3, help="repetitions (default: %(default)s)")
    options.add_argument("--core", default="last", metavar="N|none")
    args = options.parse_args()
    study = Study(args.work, args.kitti, args.repeat, args.core)
    regimes = {name: REGIMES[name] for name in args.regimes}
    for name, regime in regimes.items():
        study.calibrate(name, regime)
    pairs = [(name, regime, test) for name, regime in regimes.items() for test in filter(study.has, regime.tests)]
    predictions = [study.predict(*pair, regimes) for pair in pairs]
    found = [
        outcome
        for (name, regime, test), prediction in zip(pairs, predictions, strict=True)
        for outcome in outcomes(name, test, prediction, study.measure(name, regime, test))
    ]
    print("\n".join([*table(found), "", *summary(found)]))


if __name__ == "__main__":
    main()
