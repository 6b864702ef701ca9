"""Gathering and canonical frame of crops."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from modt.classification.crops import canonical, gather
from tests.classification.scenes import blobs

COUNTS = st.lists(st.integers(1, 60), min_size=1, max_size=6)


def canonical_one(xyz, ground_z_m):
    """Slow reference: one crop, step by step."""
    x, y = xyz[:, :2].mean(axis=0)
    bearing = np.arctan2(y, x)
    turn = np.array([[np.cos(bearing), np.sin(bearing)], [-np.sin(bearing), np.cos(bearing)]])
    local = xyz[:, :2] @ turn.T
    local -= (local.min(axis=0) + local.max(axis=0)) / 2
    slack = 0.1 + 0.005 * np.hypot(x, y)
    ground = min(max(xyz[:, 2].min() - 0.3, ground_z_m - slack), ground_z_m + slack)
    return np.c_[local, xyz[:, 2] - ground]


@given(counts=COUNTS, seed=st.integers(0, 1000))
def test_canonical_agrees_with_the_reference(counts, seed):
    points, proposals = blobs(counts, seed)
    ground_z_m = np.linspace(-2.0, -1.0, len(counts))
    crops = canonical(gather(proposals, np.arange(len(counts)), 1000), ground_z_m)
    for i in range(len(counts)):
        members = proposals.members[proposals.offsets[i] : proposals.offsets[i + 1]]
        expected = canonical_one(points[members, :3].astype(np.float64), ground_z_m[i])
        np.testing.assert_allclose(crops.xyz[crops.offsets[i] : crops.offsets[i + 1]], expected, atol=2e-4)


@given(count=st.integers(1, 500), most=st.integers(1, 100))
def test_a_large_proposal_is_subsampled_evenly(count, most):
    points, proposals = blobs([count], count)
    crops = gather(proposals, np.array([0]), most)
    kept = [int(np.flatnonzero((points[proposals.members, :3] == p).all(axis=1))[0]) for p in crops.xyz]
    assert len(kept) == min(count, most)
    assert len(set(kept)) == len(kept)
    steps = np.diff(kept)
    assert len(steps) == 0 or steps.max() - steps.min() <= 1


@given(counts=COUNTS)
def test_padding_repeats_own_points(counts):
    _, proposals = blobs(counts, 1)
    crops = gather(proposals, np.arange(len(counts)), 100)
    batch = crops.padded(np.arange(len(counts)))
    assert batch.shape == (len(counts), max(counts), 3)
    for i, padded in enumerate(batch):
        expected = crops.xyz[crops.offsets[i] : crops.offsets[i + 1]]
        assert {tuple(p) for p in padded} == {tuple(p) for p in expected}
