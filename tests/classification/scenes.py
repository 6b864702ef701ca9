"""Synthetic proposals and tracks, and classifiers."""

from __future__ import annotations

import dataclasses

import numpy as np

from modt.app import assembly
from modt.config import ClassificationConfig, SensorConfig
from modt.types import Proposals, Tracks


def blobs(counts, rng=0):
    """Frame of blobs of the given numbers of points, 5 to 50 m away, among as many points outside any proposal.

    They are placed by a generator of random numbers, or by one with a seed.
    """
    rng = np.random.default_rng(rng)
    n = len(counts)
    bearing = rng.uniform(-3, 3, n)
    distance = rng.uniform(5, 50, n)
    centre = np.c_[distance * np.cos(bearing), distance * np.sin(bearing), np.full(n, -1.0)]
    total = sum(counts)
    xyz = rng.normal(0, 0.5, (total, 3)) + np.repeat(centre, counts, axis=0)
    points = np.zeros((2 * total, 4), np.float32)
    members = np.sort(rng.choice(2 * total, total, replace=False))
    points[members, :3] = xyz
    box = np.c_[centre, np.full((n, 3), 1.5), np.zeros(n)].reshape(n, 7)
    none = np.zeros(n, np.int64)
    offsets = np.append(0, np.cumsum(counts)).astype(np.int64)
    return points, Proposals(members, offsets, points[members, :3].T, centre, box, none)


SHIPPED = ClassificationConfig().model
SENSOR = SensorConfig()


def saved(folder, model):
    """Path of an ONNX model that is written into a folder."""
    path = folder / "net.onnx"
    path.write_bytes(model.SerializeToString())
    return path


def classifier(model=SHIPPED, sensor=SENSOR, **options):
    """The classifier with a model, by its name or path."""
    return assembly.network(ClassificationConfig(model=str(model), **options), sensor)


def new_tracks(proposals):
    """A new track for each proposal; the world frame is the sensor frame."""
    n = len(proposals)
    tracks = Tracks.blank(n)
    tracks.id[:] = tracks.proposal[:] = np.arange(n)
    tracks.points[:] = proposals.count
    tracks.box[:] = proposals.box
    tracks.size_m[:] = proposals.box[:, 3:6]
    tracks.age[:] = tracks.hits[:] = 1
    return tracks


def with_points(proposals, *counts):
    """The proposals with other numbers of points."""
    return dataclasses.replace(proposals, offsets=np.append(0, np.cumsum(counts)))


ROW = np.array([0])


class Fused:
    """Blobs of some numbers of points, their tracks, and what fuses their views."""

    def __init__(self, fusion, *counts, frames=1):
        _, self.proposals = blobs(list(counts), 3)
        self.fusion = fusion
        self.tracks = new_tracks(self.proposals)
        self.tracks.hits[:] = self.tracks.age[:] = frames

    def asks(self, wants_class=True):
        """The tracks that ask for a classification, where these or all of them want one."""
        wanted = np.zeros(len(self.tracks), np.bool_) | wants_class
        self.fusion.observe(self.tracks, self.tracks, self.proposals)
        return self.fusion.asks(self.tracks, self.tracks, self.proposals, wanted).tolist()

    def fuse(self, *view, rows=ROW):
        """Fuse a view, and tell the tracks whose class is confirmed, as the state machine does."""
        likelihood = np.tile(view, (len(rows), 1))
        self.tracks.final[rows] = confirmed = self.fusion.fuse(
            self.tracks, self.tracks, self.proposals, rows, likelihood
        )
        return confirmed
