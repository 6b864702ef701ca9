"""Frames made of boxes full of points, for the tracker's tests."""

import numpy as np

from modt.config import OdometryConfig, TrackingConfig
from modt.odometry.odometry import Odometry
from modt.tracking.states import EFFICIENT
from modt.tracking.tracker import Tracker
from modt.types import Frame, Proposals


class Follower:
    """Odometry and tracker in a row, with what the last frame gave."""

    def __init__(self, config=None, machine=EFFICIENT, **parts):
        self.odometry = Odometry(OdometryConfig())
        self.tracker = Tracker(config or TrackingConfig(), machine, **parts)
        self.proposals = self.wants_class = self.T_world_sensor = None

    @property
    def tracks(self):
        return self.tracker.tracks

    def follow(self, frame, proposals):
        located = self.odometry.locate(frame, proposals, self.tracker.static_tracks)
        self.T_world_sensor = located.placement.T_world_sensor
        tracked = self.tracker.follow(frame.stamp_s, proposals, located)
        self.proposals, self.wants_class = tracked.proposals, tracked.wants_class
        return tracked.tracks

    def conclude(self, rows, certain):
        return self.tracker.conclude(np.asarray(rows), np.asarray(certain))


def frame_of(boxes, index=0, T_world_sensor=None, points=60, seed=0, period_s=0.1):
    """A frame whose proposals are boxes (P, 7) filled with points; points may be a number for each."""
    boxes = np.asarray(boxes, np.float64).reshape(-1, 7)
    rng = np.random.default_rng([seed, index])
    counts = np.broadcast_to(points, len(boxes))
    clouds = [cloud(b, n, rng) for b, n in zip(boxes, counts, strict=True)]
    xyz = np.concatenate([np.zeros((0, 3)), *clouds])
    offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    points = np.concatenate([xyz, np.zeros((len(xyz), 1))], axis=1).astype(np.float32)
    frame = Frame(index, index * period_s, points, T_world_sensor)
    flags = np.zeros(len(boxes), np.bool_)
    centroid = np.array([c.mean(axis=0) for c in clouds]).reshape(-1, 3)
    return frame, Proposals(np.arange(len(xyz)), offsets, points[:, :3].T.copy(), centroid, boxes, flags)


def cloud(box, n, rng):
    """(n, 3) points that reach every side of the box."""
    u = rng.uniform(-0.5, 0.5, (n, 3))
    for k in range(3):
        u[2 * k, k], u[2 * k + 1, k] = -0.5, 0.5
    local = u * box[3:6]
    c, s = np.cos(box[6]), np.sin(box[6])
    return local @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + box[:3]


def box(x, y, l=4.0, w=1.8, h=1.5, yaw=0.0, z=-1.0):  # noqa: E741
    return [x, y, z, l, w, h, yaw]
