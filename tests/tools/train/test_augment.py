"""Augmentation of crops."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from modt.classification.crops import gather
from tests.classification.scenes import blobs
from tools.train.augment import Beams, augment, subsample


@given(counts=st.lists(st.integers(6, 300), min_size=1, max_size=8), seed=st.integers(0, 200))
def test_augmentation_keeps_every_crop_and_enough_points(counts: list[int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    points, proposals = blobs(counts, rng)
    crops = gather(points, proposals, np.arange(len(counts)), 1000)
    seen = subsample(augment(crops, Beams(), rng), 50, rng)
    assert len(seen) == len(counts)
    assert (seen.count >= 6).all()
    assert (seen.count <= np.minimum(counts, 50)).all()
    assert np.isfinite(seen.xyz).all()


def test_augmentation_is_reproducible() -> None:
    points, proposals = blobs([40, 200], np.random.default_rng(0))
    crops = gather(points, proposals, np.arange(2), 1000)
    once, again = (augment(crops, Beams(), np.random.default_rng(5)) for _ in range(2))
    assert once.xyz.tobytes() == again.xyz.tobytes()
