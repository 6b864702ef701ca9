"""Tries random pairs of faults of the sweeps and of the poses over a run, and lists what ends it or is not reported.

    python -m tools.fault_pairs --pairs 100 --seed 1

The stages of a live run process a simulated drive frame by frame. The second fault begins while the first one lasts,
and ends after it. `ended` counts the pairs in which a frame raised an error, `silent` those in which a fault lasted
for longer than its limit while the trust was good, `stuck` those after which it was not good again within 5 s, `lost`
the frames without a result. The exit status is 0 if all are none. Faults of the packets, the disk and the machine are
tried by `tools.faults` and `tools.deploy.soak`.
"""

from __future__ import annotations

import argparse
import logging
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from modt.app.inputs import Request
from modt.app.stages import Stages
from modt.energy.ledger import Ledger
from modt.geometry import rotation_zyx, se3, yaw_of
from modt.types import Float32, Float64, Frame, TrustLevel
from modt_simulation.synthetic_stream import SyntheticStream
from tools.options import parser

SENSOR = "vlp-16"
SECONDS = 26.0
FIRST = 60
"""Number of the frame from which on the first fault begins."""
LASTING = (50, 70)
"""Least and greatest number of frames of a fault."""
SEEN_S = 2.0
KNOCKED_S = 5.0
"""Time after which a fault has to be reported [s]: one of the whole view, and others."""
BACK_S = 5.0
"""Time after the last fault after which the trust has to be good [s]."""
POSES = "poses"


@dataclass(frozen=True)
class Change:
    """A fault: what it does to the points of a sweep, or to the pose, and the time until it is reported [s]."""

    name: str
    limit_s: float
    points: Callable[[Float32], Float32] = lambda points: points
    pose: Callable[[Float64, Float64], Float64] = lambda T, T_begin: T
    freezes: bool = False


def turned(matrix: Float64, shift_m: float = 0.0) -> Callable[[Float32], Float32]:
    """Change of points by a matrix (3, 3) and a shift upwards."""

    def change(points: Float32) -> Float32:
        changed = points.copy()
        changed[:, :3] = points[:, :3] @ matrix.T.astype(np.float32) + np.array([0, 0, shift_m], np.float32)
        return changed

    return change


def knocked(roll_deg: float, pitch_deg: float, yaw_deg: float) -> Callable[[Float32], Float32]:
    """Change of points by a turn of the sensor."""
    return turned(rotation_zyx(*np.deg2rad([roll_deg, pitch_deg, yaw_deg]).tolist()))


def _bearing(points: Float32) -> Float32:
    return np.asarray(np.arctan2(points[:, 1], points[:, 0]))


def _rising(points: Float32) -> Float32:
    return np.asarray(points[:, 2] / np.hypot(points[:, 0], points[:, 1]))


def moved(T: Float64, T_begin: Float64, share: float) -> Float64:
    """Pose (4, 4) that moves by a share of the way since the fault began."""
    position = T_begin[:3, 3] + share * (T[:3, 3] - T_begin[:3, 3])
    return se3(T[:3, :3], position)


CHANGES = (
    Change("covered", SEEN_S, np.zeros_like),
    Change("empty", SEEN_S, lambda points: points[:0]),
    Change("frozen", SEEN_S, freezes=True),
    Change("front missing", SEEN_S, lambda points: points[points[:, 0] < 0]),
    Change("a quarter missing", KNOCKED_S, lambda points: points[np.abs(_bearing(points)) > np.pi / 4]),
    Change("upper beams dead", SEEN_S, lambda points: points[_rising(points) < -0.01]),
    Change("every second return lost", KNOCKED_S, lambda points: points[::2]),
    Change("in millimetres", SEEN_S, turned(1000 * np.eye(3))),
    Change("twice as far", KNOCKED_S, turned(2 * np.eye(3))),
    Change("half as far", KNOCKED_S, turned(0.5 * np.eye(3))),
    Change("a fifth farther", KNOCKED_S, turned(1.2 * np.eye(3))),
    Change("mirrored", SEEN_S, turned(np.diag([1.0, -1.0, 1.0]))),
    Change("upside down", SEEN_S, turned(np.diag([1.0, -1.0, -1.0]))),
    Change("turned by 90 deg", SEEN_S, knocked(0, 0, 90)),
    Change("rolled by 15 deg", KNOCKED_S, knocked(15, 0, 0)),
    Change("pitched by -8 deg", KNOCKED_S, knocked(0, -8, 0)),
    Change("sunk by 0.4 m", KNOCKED_S, turned(np.eye(3), 0.4)),
    Change(f"{POSES} frozen", KNOCKED_S, pose=lambda T, T_begin: T_begin),
    Change(f"{POSES} at half the speed", KNOCKED_S, pose=lambda T, T_begin: moved(T, T_begin, 0.5)),
    Change(f"{POSES} backwards", KNOCKED_S, pose=lambda T, T_begin: moved(T, T_begin, -1.0)),
    Change(
        f"{POSES} with degrees",
        KNOCKED_S,
        pose=lambda T, T_begin: se3(rotation_zyx(0, 0, float(np.rad2deg(yaw_of(T)))), T[:3, 3]),
    ),
)


@dataclass(frozen=True)
class Episode:
    """A fault from one frame up to another one.

    Attributes:
        turned: share of a turn after which it begins and ends within these frames. Sweeps begin behind, and a fault
            waits for none.
    """

    change: Change
    begin: int
    end: int
    turned: float

    def changes(self, k: int, frame: Frame, before: Frame) -> Frame:
        """Frame k with this fault; `before` is the frame before the fault."""
        if not self.begin <= k <= self.end:
            return frame
        whole = moved_by(self.change, frame, before)
        if self.begin < k < self.end:
            return whole
        late = (np.pi - _bearing(frame.points)) / (2 * np.pi) > self.turned
        faulty = late if k == self.begin else ~late
        parts = frame.points[~faulty], self.change.points(frame.points[faulty])
        return replace(whole if k == self.begin else frame, points=np.concatenate(parts))


def drawn(rng: np.random.Generator, changes: Sequence[Change] = CHANGES) -> tuple[Episode, Episode]:
    """Two faults; the second one begins while the first one lasts, and ends after it."""
    one, other = rng.choice(len(changes), 2, replace=False)
    first, second = overlapping(rng)
    turned = rng.random(2)
    return Episode(changes[one], *first, turned[0]), Episode(changes[other], *second, turned[1])


def overlapping(rng: np.random.Generator) -> tuple[tuple[int, int], tuple[int, int]]:
    """Begin and end of two faults; the second one begins while the first one lasts, and ends after it."""
    lengths = rng.integers(*LASTING, 2)
    begin = FIRST + int(rng.integers(1, lengths[0]))
    end = FIRST + int(lengths[0])
    return (FIRST, end), (begin, max(begin + int(lengths[1]), end))


def faulty(frames: Sequence[Frame], pair: Sequence[Episode]) -> Iterator[Frame]:
    """The frames of a drive with two faults. A frozen sensor repeats what it sent before."""
    points = frames[0].points
    for k, frame in enumerate(frames):
        given = frame
        for episode in pair:
            given = episode.changes(k, given, frames[episode.begin - 1])
        if any(e.change.freezes and e.begin <= k < e.end for e in pair):
            given = replace(given, points=points)
        points = given.points
        yield given


def levels_of(stream: SyntheticStream, frames: list[Frame], pair: tuple[Episode, Episode]) -> list[TrustLevel]:
    """The trust of each frame of a drive with two faults."""
    stages = Stages(Request(profile=[SENSOR], odometry="recording"), stream.info, Ledger(), live=True)
    stages.choose_profile(frames[0])
    levels = []
    for k, given in enumerate(faulty(frames, pair)):
        levels.append(stages.step(given, stages.budget, reduced=False).trust.level)
        stages.ledger.close_frame(k)
        stages.adapt(given)
        if stages.comparison is not None:
            stages.comparison.join()
    return levels


def moved_by(change: Change, frame: Frame, before: Frame) -> Frame:
    """A frame with a fault that began after a frame before it."""
    assert frame.T_world_sensor is not None
    assert before.T_world_sensor is not None
    T = change.pose(frame.T_world_sensor, before.T_world_sensor)
    return replace(frame, points=np.ascontiguousarray(change.points(frame.points)), T_world_sensor=T)


def silent(levels: list[TrustLevel], pair: tuple[Episode, Episode], period_s: float) -> list[str]:
    """Names of the faults during which the trust is good after their limit."""
    good = np.array(levels) == TrustLevel.GOOD
    late = [(e, good[seen_from(e, pair) + round(e.change.limit_s / period_s) : e.end]) for e in pair]
    return [f"{e.change.name}: good in {int(part.sum())} of {len(part)} frames" for e, part in late if part.any()]


def seen_from(episode: Episode, pair: Sequence[Episode]) -> int:
    """Frame from which on a fault can be seen: its first one or, if it begins during another one, the end of that."""
    ends = [other.end for other in pair if other is not episode and other.begin <= episode.begin]
    return max([episode.begin, *ends])


def stuck(levels: list[TrustLevel], pair: tuple[Episode, Episode], period_s: float) -> list[str]:
    """Report of a pair after which the trust does not return to good; empty if it does."""
    after = levels[max(e.end for e in pair) + round(BACK_S / period_s) :]
    late = sum(level != TrustLevel.GOOD for level in after)
    return [f"not good in {late} of {len(after)} frames after both"] if late else []


def pair_options(description: str | None) -> argparse.ArgumentParser:
    """Options of a tool that tries pairs."""
    options = parser(description)
    options.add_argument("--pairs", type=int, default=1000, help="number of pairs (default: %(default)s)")
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--scene", default="street", help="simulated scene (default: %(default)s)")
    return options


def main() -> None:
    given = pair_options(__doc__).parse_args()
    logging.disable(logging.CRITICAL)
    stream = SyntheticStream(given.scene, SENSOR, SECONDS, given.seed)
    frames = list(stream)
    rng = np.random.default_rng(given.seed)
    found = Counter[str](ended=0, silent=0, stuck=0, lost=0)
    for _ in range(given.pairs):
        pair = drawn(rng)
        names = " and ".join(f"{e.change.name} ({e.begin} to {e.end})" for e in pair)
        try:
            levels = levels_of(stream, frames, pair)
        except Exception as error:
            found["ended"] += 1
            print(f"{names}: {type(error).__name__}: {error}", flush=True)
            continue
        found["lost"] += len(frames) - len(levels)
        unreported = silent(levels, pair, stream.info.period_s)
        lasting = stuck(levels, pair, stream.info.period_s)
        found["silent"] += bool(unreported)
        found["stuck"] += bool(lasting)
        if unreported or lasting:
            print(f"{names}: {'; '.join([*unreported, *lasting])}", flush=True)
    print(f"{given.pairs} pairs: " + ", ".join(f"{number} {what}" for what, number in found.items()))
    sys.exit(bool(found.total()))


if __name__ == "__main__":
    main()
