"""Consistency of the tracking filter."""

import numpy as np
import pytest

from modt_desk.simulation.synthetic_stream import SyntheticStream
from tools.study.filter_consistency import BodyTrack, body_tracks, study


def random_track(rng, n, scale):
    """A track 0.3 m beside the centre of a walker, with random errors of `scale` times its covariance."""
    heading = np.full(n, 0.7)
    pose = np.c_[np.arange(n) * 0.1, np.zeros(n), heading, np.full(n, 1.2)]
    A = rng.normal(0, 0.2, (n, 4, 4))
    P = A @ A.transpose(0, 2, 1) + 0.01 * np.eye(4)
    error = scale * np.einsum("nij,nj->ni", np.linalg.cholesky(P), rng.normal(0, 1, (n, 4)))
    beside = 0.3 * np.array([-np.sin(0.7), np.cos(0.7)])
    x = pose + error
    x[:, :2] += beside
    return BodyTrack("pedestrian, moving", x, P, pose)


def test_errors_are_consistent_only_at_the_scale_of_their_covariance():
    rng = np.random.default_rng(0)
    for scale, fits in ((1.0, True), (1.6, False), (0.5, False)):
        found = study([random_track(rng, 60, scale) for _ in range(80)])["pedestrian, moving"]
        for part in found.values():
            assert (part.low < part.mean < part.high) is fits
            assert (abs(part.beyond - 0.05) < 0.02) is fits


@pytest.fixture(scope="module", name="consistencies")
def consistencies_on_crossings():
    streams = [SyntheticStream("crossing", "vlp-16", 3.0, seed) for seed in (1, 2)]
    return study([track for stream in streams for track in body_tracks(stream, "vlp-16")])


@pytest.mark.slow
def test_the_filter_is_nearly_consistent_for_walkers(consistencies):
    """A consistent filter has a mean of 2. Displacements from consecutive outlines alone give 5.5."""
    position, motion = consistencies["pedestrian, moving"]["position"], consistencies["pedestrian, moving"]["motion"]
    assert position.tracks >= 25
    assert position.mean < 1.2 * position.high
    assert position.beyond < 0.15
    assert position.rms < 0.15
    assert motion.mean < 2 * motion.high
    assert motion.beyond < 0.15


@pytest.mark.slow
def test_the_filter_is_nearly_consistent_for_standing_objects(consistencies):
    """The visible part of occluded background moves along the occluder, and the part that a single beam meets jumps
    from sweep to sweep. No filter models such errors.
    """
    for kind, tracks, mean in (("pedestrian, standing", 5, 2.0), ("background, standing", 40, 12.0)):
        position = consistencies[kind]["position"]
        assert position.tracks >= tracks
        assert position.mean < mean
        assert position.beyond < 0.1
