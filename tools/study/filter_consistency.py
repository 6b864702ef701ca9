"""Whether the filter is as wrong as it says: normalised estimation error squared (NEES) on synthetic drives.

    python -m tools.study.filter_consistency [--scene street crossing] [--seeds 0:4] [--seconds 10]
                         [--sensor hdl-64e] [--fov full]

A track follows some point of its body, which the filter does not say; it is taken for the one that it was at on
average, fixed on the body. The error of the place is how far it is from there (2 degrees of freedom), that of the
motion the difference of heading and speed (2 more), while the body moves. Errors of one track hang together, so the
bounds are those of as many independent samples as there are tracks.
"""

from __future__ import annotations

import argparse
import json
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from modt.classes import CLASS_NAMES
from modt.geometry import wrap
from modt.simulation.world import MOVING_MPS
from modt.sources.synthetic_stream import SyntheticStream
from modt.types import Float64
from tools.study.truth_replay import Seen, add_drives, replay

SETTLED = 6
"""Proposals that a track has had before it is judged."""
PURE = 0.8
"""Share of a proposal's points that must be of the body."""
SHORTEST = 10
"""Frames of a track that is judged."""
DEGREES = 2
CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class Life:
    """What a track said of one body, and what was so; n frames.

    Attributes:
        kind: class and whether it moved, as in "car, moving".
        x, P: (n, 4), (n, 4, 4) of the filter.
        pose: (n, 4) x, y [m], heading [rad] and speed [m/s] of the body, world frame.
    """

    kind: str
    x: Float64
    P: Float64
    pose: Float64


def lives(stream: SyntheticStream, seen: Iterator[Seen]) -> list[Life]:
    """Every track of a drive that was of one body for long enough."""
    world = stream.simulator.world
    records = defaultdict(list)
    for s in seen:
        tracks, poses = s.result.tracks, world.poses(s.result.frame.stamp_s)
        rows = np.flatnonzero((tracks.proposal >= 0) & (tracks.hits >= SETTLED))
        for row in rows:
            proposal = tracks.proposal[row]
            if s.body[proposal] >= 0 and s.share[proposal] >= PURE:
                body = int(s.body[proposal])
                moving = bool(poses[body, 4] > MOVING_MPS)
                key = (int(tracks.id[row]), body, moving)
                records[key].append((tracks.x[row], tracks.P[row], poses[body, [0, 1, 3, 4]]))
    out = []
    for (_, body, moving), rows in records.items():
        if len(rows) >= SHORTEST:
            name = CLASS_NAMES[world.bodies[body].kind.object_class]
            x, P, pose = (np.array(column) for column in zip(*rows, strict=True))
            out.append(Life(f"{name}, {'moving' if moving else 'standing'}", x, P, pose))
    return out


def errors(life: Life) -> tuple[Float64, Float64]:
    """(n, 2) errors of the place [m], and (n, 2) of heading and speed [rad, m/s]."""
    c, s = np.cos(life.pose[:, 2]), np.sin(life.pose[:, 2])
    R = np.stack([np.stack([c, -s], axis=1), np.stack([s, c], axis=1)], axis=1)
    off = life.x[:, :2] - life.pose[:, :2]
    point = np.einsum("nji,nj->ni", R, off).mean(axis=0)
    motion = life.x[:, 2:] - life.pose[:, 2:]
    motion[:, 0] = wrap(motion[:, 0])
    return off - R @ point, motion


def normalised(error: Float64, P: Float64) -> Float64:
    """(n,) e' P^-1 e of errors (n, k) and covariances (n, k, k)."""
    out: Float64 = np.einsum("ni,ni->n", error, np.linalg.solve(P, error[:, :, None])[:, :, 0])
    return out


@dataclass(frozen=True, slots=True)
class Consistency:
    """NEES of one kind of track and one part of the state.

    Attributes:
        tracks, samples: how many.
        mean: of the tracks' own means; consistent if it is about the degrees of freedom.
        median: of all samples.
        low, high: within which it lies with CONFIDENCE, for as many independent samples as tracks.
        beyond: share of samples above the chi-square quantile of CONFIDENCE; 1 - CONFIDENCE if consistent.
        rms: of the error's length.
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
    """Of the errors (n, 2) and covariances (n, 2, 2) of each track."""
    each = [normalised(e, p) for e, p in zip(error, P, strict=True)]
    n, all_ = len(each), np.concatenate(each)
    low, high = chi2(DEGREES * n).ppf([(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2]) / n
    beyond = float((all_ > chi2(DEGREES).ppf(CONFIDENCE)).mean())
    rms = float(np.sqrt((np.concatenate(error) ** 2).sum(axis=1).mean()))
    mean, median = float(np.mean([e.mean() for e in each])), float(np.median(all_))
    return Consistency(n, len(all_), mean, median, float(low), float(high), beyond, rms)


def study(all_lives: Sequence[Life]) -> dict[str, dict[str, Consistency]]:
    """By kind: of the place, and of the motion of what moves."""
    out: dict[str, dict[str, Consistency]] = {}
    for kind in sorted({life.kind for life in all_lives}):
        chosen = [life for life in all_lives if life.kind == kind]
        place, motion = zip(*(errors(life) for life in chosen), strict=True)
        out[kind] = {"place": consistency(place, [life.P[:, :2, :2] for life in chosen])}
        if kind.endswith("moving"):
            out[kind]["motion"] = consistency(motion, [life.P[:, 2:, 2:] for life in chosen])
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_drives(parser)
    arguments = parser.parse_args()
    found: list[Life] = []
    for seed in range(*arguments.seeds):
        for scene in arguments.scene:
            stream = SyntheticStream(scene, arguments.sensor, arguments.seconds, seed)
            found += lives(stream, replay(stream, arguments.sensor, camera=arguments.fov == "camera"))
    for kind, parts in study(found).items():
        for part, c in parts.items():
            line = {"tracks": c.tracks, "samples": c.samples, "nees": c.mean, "bounds": [c.low, c.high]}
            line |= {"median": c.median, "beyond": c.beyond, "rms": c.rms}
            rounded = {k: [round(b, 2) for b in v] if isinstance(v, list) else round(v, 3) for k, v in line.items()}
            print(f"{kind:<22}{part:<8}", json.dumps(rounded))


if __name__ == "__main__":
    main()
