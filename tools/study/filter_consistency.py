"""Consistency of the tracking filter: normalised estimation error squared (NEES) on simulated drives.

    python -m tools.study.filter_consistency [--scene street crossing] [--seeds 0:4] [--seconds 10]
                                              [--sensor hdl-64e]

The reference point of a track on its body is unknown; it is taken as the mean position of the track in the body
frame. The position error is relative to that point (2 degrees of freedom), the motion error is that of the velocity
(2) by its published covariance, for moving bodies. Errors of one track are correlated, so the bounds assume as many
independent samples as tracks.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
from scipy.stats import chi2

from modt.classes import CLASS_NAMES
from modt.cli.options import frames as number_range
from modt.profile import load
from modt.types import NONE, Float64, Int, Proposals
from modt_simulation.synthetic_stream import SyntheticStream
from modt_simulation.world import MOVING_MPS
from tools.options import parser
from tools.study.drives import steps_of

MIN_HITS = 6
"""Minimum number of proposals of a track before its errors count."""
MIN_SHARE = 0.8
"""Minimum share of a proposal's points on one body."""
MIN_FRAMES = 10
"""Minimum length of a track."""
DEGREES = 2
CONFIDENCE = 0.95


@dataclass(frozen=True)
class BodyTrack:
    """States of a track on one body, and the true poses, over n frames.

    Attributes:
        kind: class and motion, as in "car, moving".
        x, P: (n, 4) x, y [m] and their velocities [m/s], world frame, and (n, 4, 4) covariance as published.
        pose: (n, 4) true x, y [m], heading [rad] and speed [m/s], world frame.
    """

    kind: str
    x: Float64
    P: Float64
    pose: Float64


def body_tracks(stream: SyntheticStream, profile_name: str) -> list[BodyTrack]:
    """Tracks that were on one body for at least MIN_FRAMES frames, in mode `efficient`."""
    world = stream.simulator.world
    step = steps_of("efficient", load(profile_name))
    records: dict[tuple[int, int, bool], list[tuple[Float64, Float64, Float64]]] = defaultdict(list)
    for frame, truth in stream.sweeps():
        result = step(frame)
        body, share = majority_bodies(result.proposals, truth.instance)
        tracks = result.tracks
        poses = world.poses(frame.stamp_s)
        for row in np.flatnonzero((tracks.proposal >= 0) & (tracks.hits >= MIN_HITS)):
            k = int(body[tracks.proposal[row]])
            if k >= 0 and share[tracks.proposal[row]] >= MIN_SHARE:
                key = (int(tracks.id[row]), k, bool(poses[k, 4] > MOVING_MPS))
                P = np.zeros((4, 4))
                P[:2, :2] = tracks.P[row, :2, :2]
                P[2:, 2:] = tracks.velocity_covariance[row]
                x = np.concatenate([tracks.x[row, :2], tracks.velocity[row]])
                records[key].append((x, P, poses[k, [0, 1, 3, 4]]))
    out = []
    for (_, k, moving), states in records.items():
        if len(states) >= MIN_FRAMES:
            name = CLASS_NAMES[world.bodies[k].kind.object_class]
            x, P, pose = (np.array(column) for column in zip(*states, strict=True))
            out.append(BodyTrack(f"{name}, {'moving' if moving else 'standing'}", x, P, pose))
    return out


def majority_bodies(proposals: Proposals, instance: Int) -> tuple[Int, Float64]:
    """(P,) body with most points of each proposal, NONE for the ground, and (P,) its share of the points."""
    n = len(proposals)
    if not n:
        return np.zeros(0, np.int64), np.zeros(0)
    bodies, number = np.unique(instance[proposals.members], return_inverse=True)
    of = np.repeat(np.arange(n), proposals.count)
    counts = np.bincount(of * len(bodies) + number, minlength=n * len(bodies)).reshape(n, len(bodies))
    best = counts.argmax(axis=1)
    return np.where(bodies[best] < 0, NONE, bodies[best]), counts.max(axis=1) / proposals.count


def errors(track: BodyTrack) -> tuple[Float64, Float64]:
    """(n, 2) position errors [m], and (n, 2) errors of the velocity [m/s]."""
    c, s = np.cos(track.pose[:, 2]), np.sin(track.pose[:, 2])
    R = np.stack([np.stack([c, -s], axis=1), np.stack([s, c], axis=1)], axis=1)
    off = track.x[:, :2] - track.pose[:, :2]
    # The point of the body that the track refers to: the mean of its positions in the frame of the body.
    point = np.einsum("nji,nj->ni", R, off).mean(axis=0)
    velocity = track.pose[:, 3, None] * R[:, :, 0]
    return off - R @ point, track.x[:, 2:] - velocity


def normalised(error: Float64, P: Float64) -> Float64:
    """(n,) e' P^-1 e of errors (n, k) and covariances (n, k, k)."""
    out: Float64 = np.einsum("ni,ni->n", error, np.linalg.solve(P, error[:, :, None])[:, :, 0])
    return out


@dataclass(frozen=True)
class Consistency:
    """NEES of one kind of track and one part of the state.

    Attributes:
        tracks, samples: their numbers.
        mean: mean of the tracks' means; equal to the degrees of freedom if consistent.
        median: median of all samples.
        low, high: bounds of the mean at CONFIDENCE, for as many independent samples as tracks.
        beyond: share of samples above the chi-square quantile of CONFIDENCE; 1 - CONFIDENCE if consistent.
        rms: root mean square length of the error.
    """

    tracks: int
    samples: int
    mean: float
    median: float
    low: float
    high: float
    beyond: float
    rms: float


def consistency(error: Sequence[Float64], P: Sequence[Float64]) -> Consistency:
    """Summary of the errors (n, 2) and covariances (n, 2, 2) of the tracks."""
    each = [normalised(e, p) for e, p in zip(error, P, strict=True)]
    n = len(each)
    all_ = np.concatenate(each)
    low, high = chi2(DEGREES * n).ppf([(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2]) / n
    beyond = float((all_ > chi2(DEGREES).ppf(CONFIDENCE)).mean())
    rms = float(np.sqrt((np.concatenate(error) ** 2).sum(axis=1).mean()))
    mean = float(np.mean([e.mean() for e in each]))
    median = float(np.median(all_))
    return Consistency(n, len(all_), mean, median, float(low), float(high), beyond, rms)


def study(tracks: Sequence[BodyTrack]) -> dict[str, dict[str, Consistency]]:
    """Consistency of the position, and of the motion of moving bodies, by kind."""
    out: dict[str, dict[str, Consistency]] = {}
    for kind in sorted({track.kind for track in tracks}):
        chosen = [track for track in tracks if track.kind == kind]
        position, motion = zip(*(errors(track) for track in chosen), strict=True)
        out[kind] = {"position": consistency(position, [track.P[:, :2, :2] for track in chosen])}
        if kind.endswith("moving"):
            out[kind]["motion"] = consistency(motion, [track.P[:, 2:, 2:] for track in chosen])
    return out


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--scene", nargs="+", default=["street", "crossing"])
    options.add_argument("--sensor", default="hdl-64e", help="sensor with a profile of the same name")
    options.add_argument("--seconds", type=float, default=10.0)
    options.add_argument("--seeds", type=number_range, default=(0, 4), metavar="A:B")
    arguments = options.parse_args()
    found: list[BodyTrack] = []
    for seed in range(*arguments.seeds):
        for scene in arguments.scene:
            stream = SyntheticStream(scene, arguments.sensor, arguments.seconds, seed)
            found += body_tracks(stream, arguments.sensor)
    for kind, parts in study(found).items():
        for part, c in parts.items():
            print(f"{kind:<22}{part:<9}", json.dumps({name: round(value, 3) for name, value in asdict(c).items()}))


if __name__ == "__main__":
    main()
