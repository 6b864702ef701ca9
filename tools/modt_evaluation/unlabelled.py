"""Tracks that move like road users and have no label: objects that the labels of a drive may leave out."""

from __future__ import annotations

import csv
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from modt.classes import CLASSES, ObjectClass
from modt.geometry import corners, inverse, se3, transform_boxes, yaw_of
from modt.sinks.output import writing
from modt.sinks.records import BROKEN
from modt.sinks.tracks import BOX_KEYS
from modt.types import Bool, Float64, Int
from modt_evaluation.further_objects import COLUMNS
from modt_evaluation.matching import most_in_sector
from modt_evaluation.overlap import FOOT_M, Overlap
from modt_evaluation.recorded_result import recorded_pose
from modt_evaluation.run_record import RunRecord, broken
from modt_evaluation.truth import Truth

WINDOW_S = 2.0
"""Time within which a motion is judged; a shorter track is judged as a whole."""
MIN_SIGHTINGS = 5
"""Least number of frames in a window for a judgement of its motion."""
MIN_GONE_M = 1.2
"""Least distance that a moving track covers in a window [m]: a slow walker does, the drift of poses does not."""
MAX_SPEED_MPS = 30.0
"""Greatest speed of a road user. A faster track jumps between objects."""
ENDS_SHARE = 0.9
"""Least speed of either end of a road user, relative to its centre. Where the visible part of a wall changes, one end
stays behind."""
STEADINESS = 15.0
"""Least ratio of the distance to the scatter about an even motion. A wall's centre jumps, a road user's does not."""
MIN_SCATTER_M = 0.05
"""Least scatter of an outline."""
STEP_S = 0.5
"""Time step of the path whose straightness is computed."""
CAR_LENGTH_M = 2.6
"""A longer mover is taken for a car [m]."""
CAR_WIDTH_M = 1.3
"""A wider mover is taken for a car [m]."""
RIDING_MPS = 2.5
"""A faster mover of the others is taken for a cyclist [m/s]."""


class Sighting(NamedTuple):
    """A frame of a track that has no label there."""

    frame: int
    stamp_s: float
    box: list[float]  # (7,) level frame
    T_world_sensor: Float64  # (4, 4)
    reported: str  # class


@dataclass(frozen=True)
class Mover:
    """A track that moves like a road user and has no label, over n frames."""

    track: int
    type_: str  # KITTI's type that its size and speed suggest
    reported: str  # class that the run reported most often
    frame: Int  # (n,)
    box: Float64  # (n, 7) sensor frame, along the motion, all of one size
    gone_m: float  # from its first place to its last
    straightness: float  # gone_m over the length of its path
    speed_mps: float  # length of its path over time


def unlabelled(run: RunRecord, truth: Truth) -> list[Mover]:
    """The movers among the tracks of a run, those that went farthest first.

    Raises:
        MisuseError: the run cannot be used, or is not of the recording of the truth.
    """
    R = run.mount.R_level_sensor
    T_sensor_level = np.eye(4) if R is None else inverse(se3(R, np.zeros(3)))
    found = (_mover(track, seen, T_sensor_level) for track, seen in _sightings(run, truth).items())
    return sorted((mover for mover in found if mover is not None), key=lambda mover: -mover.gone_m)


def write_table(path: Path, movers: Sequence[Mover]) -> None:
    """Write the movers as a table of further objects, whose numbers are those of the tracks.

    Raises:
        ModtError: it cannot be written.
    """
    with writing(path), path.open("w", encoding="utf-8", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(COLUMNS)
        for mover in movers:
            for frame, (x, y, z, length, width, height, yaw) in zip(mover.frame, mover.box.tolist(), strict=True):
                numbers = (x, y, z - height / 2, length, width, height, yaw)
                rows.writerow([frame, mover.track, mover.type_, *(round(number, 3) for number in numbers)])


def listing(movers: Sequence[Mover]) -> Iterator[str]:
    """A heading and a line for each mover."""
    yield "track   frames      gone m  straight  m/s  l x w x h m       looks like  reported"
    for m in movers:
        span = f"{m.frame[0]} to {m.frame[-1]}"
        size = " x ".join(f"{side:.1f}" for side in m.box[0, 3:6].tolist())
        motion = f"{m.gone_m:6.1f}  {m.straightness:8.2f}  {m.speed_mps:3.1f}"
        yield f"{m.track:5}   {span:11} {motion}  {size:16}  {m.type_:10}  {m.reported}"


def moving(stamp_s: Float64, world: Float64) -> Bool:
    """(n,) which sightings lie in a window in which both ends of a box move evenly.

    Args:
        stamp_s: (n,) ascending.
        world: (n, 7) boxes in the world.
    """
    out = np.zeros(len(stamp_s), np.bool_)
    last_window = int(np.searchsorted(stamp_s, stamp_s[-1] - WINDOW_S))
    ends = np.searchsorted(stamp_s, stamp_s[: last_window + 1] + WINDOW_S, side="right")
    for first, end in enumerate(ends.tolist()):
        if end - first >= MIN_SIGHTINGS and _evenly(stamp_s[first:end], world[first:end]):
            out[first:end] = True
    return out


def _evenly(stamp_s: Float64, world: Float64) -> bool:
    """Whether the boxes of a window move as a road user does."""
    if not np.ptp(stamp_s):
        return False
    t = stamp_s - stamp_s.mean()
    weight = t / (t @ t)
    xy = world[:, :2] - world[:, :2].mean(axis=0)
    velocity = weight @ xy
    speed = float(np.hypot(*velocity))
    if not 0 < speed < MAX_SPEED_MPS:
        return False
    along = corners(world) @ (velocity / speed)
    slower_mps = min(weight @ along.min(axis=1), weight @ along.max(axis=1))
    gone_m = slower_mps * np.ptp(stamp_s)
    scatter_m = np.sqrt(((xy - t[:, None] * velocity) ** 2).sum(axis=1).mean())
    steady = gone_m > STEADINESS * max(scatter_m, MIN_SCATTER_M)
    return bool(gone_m > MIN_GONE_M and slower_mps > ENDS_SHARE * speed and steady)


def _sightings(run: RunRecord, truth: Truth) -> dict[int, list[Sighting]]:
    """The sightings of each track in the judged sector that are not of a labelled object."""
    rows = defaultdict[int, list[Sighting]](list)
    for (place, record), frame in zip(run.records(), run.frames(truth), strict=True):
        overlap = Overlap.of(frame)
        labelled = ((overlap.held > 0.5 * overlap.size) | (overlap.shared > 0.5 * overlap.size)).any(axis=0)
        free = most_in_sector(frame, overlap.size, truth.rules) & ~labelled
        try:
            stamp_s = float(record["stamp_s"])
            pose = recorded_pose(record)
            for track in record["tracks"]:
                if track["proposal"] is not None and free[track["proposal"]]:
                    box = [float(track["seen"][key]) for key in BOX_KEYS]
                    rows[track["id"]].append(Sighting(frame.index, stamp_s, box, pose, track["class"]))
        except BROKEN as error:
            raise broken(place, error) from None
    return rows


def _mover(track: int, sightings: list[Sighting], T_sensor_level: Float64) -> Mover | None:
    """The track from where it starts to move to where it ends; None if it does not move."""
    stamp_s = np.array([sighting.stamp_s for sighting in sightings])
    world = np.array([transform_boxes(s.T_world_sensor, np.array([s.box]))[0] for s in sightings])
    rows = np.flatnonzero(moving(stamp_s, world))
    if not len(rows):
        return None
    part = slice(rows[0], rows[-1] + 1)
    stamp_s = stamp_s[part]
    world = world[part]
    frames, _, boxes, poses, classes = zip(*sightings[part], strict=True)
    gone_m = float(np.hypot(*(world[-1, :2] - world[0, :2])))
    path_m = _path_m(stamp_s, world)
    speed_mps = path_m / float(np.ptp(stamp_s))
    heading = _heading(stamp_s, world)
    length, width, height = _size_m(world, heading)
    box = np.array(boxes)
    box[:, 2] += (height - box[:, 5] - FOOT_M) / 2  # the lowest points stand FOOT_M above the foot
    box[:, 3:6] = length, width, height + FOOT_M
    box[:, 6] = heading - [yaw_of(T) for T in poses]
    return Mover(
        track=track,
        type_=_type(length, width, speed_mps),
        reported=Counter(classes).most_common(1)[0][0],
        frame=np.array(frames),
        box=transform_boxes(T_sensor_level, box),
        gone_m=gone_m,
        straightness=min(gone_m / path_m, 1.0),
        speed_mps=speed_mps,
    )


def _path_m(stamp_s: Float64, world: Float64) -> float:
    """Length of the path of (n, 7) boxes by their mean places in steps of STEP_S, so that noise adds nothing [m]."""
    step = ((stamp_s - stamp_s[0]) // STEP_S).astype(np.int64)
    means = np.array([world[step == k, :2].mean(axis=0) for k in np.unique(step)])
    path = [world[0, :2], *means[1:-1], world[-1, :2]]
    return float(np.hypot(*np.diff(path, axis=0).T).sum())


def _size_m(world: Float64, heading: Float64) -> list[float]:
    """Length along (n,) headings, width and height that (n, 7) boxes seldom exceed [m]."""
    axes = np.stack([np.cos(heading), np.sin(heading), -np.sin(heading), np.cos(heading)], axis=-1)
    extent = np.ptp(corners(world) @ axes.reshape(-1, 2, 2).swapaxes(1, 2), axis=1)
    sides: list[float] = np.quantile(np.column_stack([extent, world[:, 5]]), 0.9, axis=0).tolist()
    return sides


def _heading(stamp_s: Float64, world: Float64) -> Float64:
    """(n,) direction of the motion about each sighting, over a window [rad]."""
    first = np.searchsorted(stamp_s, stamp_s - WINDOW_S / 2)
    last = np.searchsorted(stamp_s, stamp_s + WINDOW_S / 2, side="right") - 1
    dx, dy = (world[last, :2] - world[first, :2]).T
    return np.asarray(np.arctan2(dy, dx))


def _type(length_m: float, width_m: float, speed_mps: float) -> str:
    """KITTI's type of a mover."""
    if length_m > CAR_LENGTH_M or width_m > CAR_WIDTH_M:
        return CLASSES[ObjectClass.CAR].kitti[0]
    return CLASSES[ObjectClass.CYCLIST if speed_mps > RIDING_MPS else ObjectClass.PEDESTRIAN].kitti[0]
