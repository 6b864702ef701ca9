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
@pytest.mark.parametrize(
    ("kind", "tracks", "mean", "beyond"),
    [
        ("pedestrian, moving", 25, 3.0, 0.15),
        ("pedestrian, standing", 5, 2.0, 0.1),
        (
            "background, standing",
            40,
            12.0,
            0.1,
        ),  # its visible part moves along what hides it, and no filter models that
    ],
)
def test_the_filter_is_nearly_consistent(kind, tracks, mean, beyond, consistencies):
    """A consistent filter has a mean of 2. Displacements from consecutive outlines alone give 5.5 for walkers."""
    for part, found in consistencies[kind].items():
        assert found.tracks >= tracks
        assert found.mean < (mean if part == "position" else 2 * found.high)
        assert found.beyond < beyond
