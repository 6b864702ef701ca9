"""Frames of boxes full of points, tables of tracks at boxes, and what follows them, for the tests of the tracker."""

from dataclasses import replace

import numpy as np

from modt.classes import N_CLASSES, ObjectClass
from modt.config import TrackingConfig
from modt.geometry import rotation_zyx, se3
from modt.geometry.kdop import DIRECTIONS
from modt.observations import observe
from modt.odometry.pose_estimator import PoseEstimator
from modt.placement import Placement
from modt.tracking.association import Associated, Matches
from modt.tracking.regrouping import Regrouping
from modt.tracking.states import EFFICIENT
from modt.tracking.track_table import TrackTable
from modt.tracking.tracker import Tracker
from modt.types import NONE, Frame, Proposals

EYE = np.eye(4)


class Follower:
    """Odometry and tracker in a row, with what the last frame gave."""

    def __init__(self, config=None, machine=EFFICIENT, **parts):
        self.frames = 0
        self.odometry = PoseEstimator()
        self.tracker = Tracker(config or TrackingConfig(), machine, **parts)
        self.proposals = self.wants_class = self.T_world_sensor = None

    @property
    def tracks(self):
        return self.tracker.tracks

    @property
    def states(self):
        return [self.tracker.state_names[s] for s in self.tracks.state]

    def follow(self, frame, proposals):
        located = self.odometry.locate(frame, proposals, self.tracker.static_tracks)
        self.T_world_sensor = located.placement.T_world_sensor
        self.tracked = self.tracker.track(frame.stamp_s, proposals, located, frame.points)
        self.proposals = self.tracked.proposals
        self.wants_class = self.tracked.wants_class
        self.frames += 1
        return self.tracks

    def confirm(self, rows, confirmed):
        return self.tracker.confirm(np.asarray(rows), np.asarray(confirmed))

    def set_class(self, row, object_class):
        write_class(self.tracked.own_evidence, self.tracked.decisions, row, object_class, self.tracks.points[row])

    def classify(self, *classes):
        """Give the tracks that want a class one each, in the order of their birth; the last for all further ones."""
        rows = self.wants_class.nonzero()[0]
        for row in rows:
            self.set_class(row, classes[min(row, len(classes) - 1)])
        return self.confirm(rows, np.ones(len(rows), np.bool_))

    def run(self, scenes, *classes, T=EYE, **options):
        """Follow frames of boxes, and classify, by default as background; how often a track wanted a class."""
        wanted = 0
        for boxes in scenes:
            self.follow(*frame_of(boxes, self.frames, T, **options))
            wanted += int(np.count_nonzero(self.wants_class))
            self.classify(*(classes or [ObjectClass.BACKGROUND]))
        return wanted


def write_class(evidence, decisions, row, object_class, points):
    """Write what fusion and decision write of a track that was classified by a view of so many points."""
    decisions.object_class[row] = object_class
    evidence.posterior[row] = np.eye(N_CLASSES)[object_class]
    evidence.key_points[row] = points


def driving(i):
    """Poses far from the origin of the world, of a sensor that turns."""
    position = np.array([458_000.0 + 0.3 * i, 5_430_000.0 + 0.2 * i, 120.0])
    return se3(rotation_zyx(0.01, -0.02, 0.7 + 0.02 * i), position)


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
    flags = np.zeros(len(boxes), np.int64)
    centroid = np.array([c.mean(axis=0) for c in clouds]).reshape(-1, 3)
    return frame, Proposals(np.arange(len(xyz)), offsets, points[:, :3].T.copy(), centroid, boxes, flags)


def cloud(box, n, rng):
    """(n, 3) points that reach every side of the box."""
    u = rng.uniform(-0.5, 0.5, (n, 3))
    for k in range(3):
        u[2 * k, k] = -0.5
        u[2 * k + 1, k] = 0.5
    local = u * box[3:6]
    c = np.cos(box[6])
    s = np.sin(box[6])
    return local @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + box[:3]


def box(x, y, l=4.0, w=1.8, h=1.5, yaw=0.0, z=-1.0):  # noqa: E741
    return [x, y, z, l, w, h, yaw]


def joined(proposals, groups):
    """Proposals that are unions of others, given by their numbers, with boxes along the axes."""
    rows = [np.concatenate([np.arange(*proposals.offsets[k : k + 2]) for k in group]) for group in groups]
    xyz = [proposals.coordinates[:, r].T.astype(np.float64) for r in rows]
    low, high = ([f(p, axis=0) for p in xyz] for f in (np.min, np.max))
    boxes = [[*(a + b) / 2, *(b - a), 0.0] for a, b in zip(low, high, strict=True)]
    return replace(
        proposals,
        members=proposals.members[np.concatenate(rows)],
        offsets=np.cumsum([0, *map(len, rows)]),
        coordinates=proposals.coordinates[:, np.concatenate(rows)],
        centroid=np.array([p.mean(axis=0) for p in xyz]),
        box=np.array(boxes),
        cut=np.zeros(len(rows), np.int64),
        reflectance=None if proposals.reflectance is None else proposals.reflectance[[g[0] for g in groups]],
    )


def tracks_at(boxes, *classes, points=60, **columns):
    """A table of tracks last observed at boxes (M, 7) of the world, classified as given, by default as background."""
    observations = observe(frame_of(boxes, points=2000)[1], EYE)  # dense: k-DOPs reach the corners
    n = len(observations)
    t = TrackTable.blank(n)
    t.id[:] = np.arange(n)
    t.age[:] = 10
    t.hits[:] = 10
    t.points[:] = points
    t.x[:, :2] = t.kdop_position[:] = t.rest_position[:] = observations.position
    t.P[:] = 0.01 * np.eye(4)
    t.box[:] = observations.box
    t.kdop[:] = observations.kdop.T
    t.bottom[:] = observations.bottom
    t.top[:] = observations.top
    t.envelope[:] = t.mean_kdop[:] = t.kdop - t.x[:, :2] @ DIRECTIONS
    t.final[:] = True
    for row in range(n):
        object_class = classes[row] if row < len(classes) else ObjectClass.BACKGROUND
        write_class(t, t, row, object_class, t.points[row])
    for column, value in columns.items():
        getattr(t, column)[:] = value
    return t


def associated(proposals, rows=(), matched=None):
    """A frame at the origin whose proposals, by default the first ones, are matched with these rows of a table."""
    observations = observe(proposals, EYE)
    rows = np.array(rows, np.int64)
    matched = np.arange(len(rows)) if matched is None else np.array(matched, np.int64)
    covariance = 0.01 * np.eye(2)[None].repeat(len(rows), axis=0)
    matches = Matches(rows, matched, observations.position[matched], covariance, np.zeros((len(rows), 4)))
    return Associated(proposals, observations, matches)


def regrouped(tracks, frame):
    """The frame in a better grouping."""
    return Regrouping().regroup(tracks, frame, Placement(EYE))


def owner_of_points(tracks, proposals, n_points):
    """(n_points,) id of the track of each point; every point must be in one proposal, and that in one track."""
    label = proposals.label(n_points)
    assert NONE not in label
    assert sorted(proposals.members) == list(range(n_points))
    return tracks.id[tracks.row_of_proposal(len(proposals))[label]]
