"""How to add another association cost (docs/extending.md): an object handed to the Tracker."""

from dataclasses import replace

import numpy as np
import pytest

from modt.app import assembly
from modt.geometry import FieldOfView, transform
from modt.geometry.kernels import assign
from modt.profile import load
from modt.tracking.association import Matches
from modt.tracking.states import ACCURATE
from modt.tracking.tracker import Tracker
from modt.types import NONE
from modt_simulation.synthetic_stream import SyntheticStream

GATE_M = 2.0
SIGMA_M = 0.3


class NearestCentroid:
    """Association of centroids within two metres, with their distance as cost."""

    def match(self, tracks, observations):
        distance = np.linalg.norm(tracks.x[:, None, :2] - observations.centroid[None], axis=2)
        rows, columns = np.nonzero(distance < GATE_M)
        kept = assign(rows, columns, distance[rows, columns], GATE_M)
        rows = rows[kept]
        columns = columns[kept]
        covariance = SIGMA_M**2 * np.eye(2)[None].repeat(len(rows), axis=0)
        return Matches(rows, columns, observations.centroid[columns], covariance, np.zeros((len(rows), 4)))

    def initial_position(self, observations):
        return observations.centroid


@pytest.mark.slow
def test_the_tracker_follows_by_the_association_it_is_given():
    profile = load("vlp-16")
    pipeline = assembly.pipeline(assembly.MODES["accurate"], profile, FieldOfView())
    config = replace(profile.tracking, extensions="none")  # every track keeps its proposal
    tracker = Tracker(config, ACCURATE, association=NearestCentroid())
    pipeline = replace(pipeline, tracker=tracker)
    for frame in SyntheticStream("street", "vlp-16", 1.0, seed=0):
        result = pipeline.step(frame)
    tracks = result.tracks
    assert (tracks.hits >= 9).sum() > 0.5 * len(result.proposals)
    seen = tracks.proposal != NONE
    measured = transform(frame.T_world_sensor, result.proposals.centroid[tracks.proposal[seen]])[:, :2]
    np.testing.assert_allclose(
        tracker.tracks.kdop_position[seen], measured, atol=1e-6
    )  # centroids, not centres of k-DOPs
