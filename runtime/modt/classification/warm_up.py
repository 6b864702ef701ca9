"""Classifications before the first frame, and what they cost."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np

from modt.classification.scheduler import LinearCost
from modt.types import Float32, Float64, Int, Proposals

_ROUNDS = 5
_FEW_POINTS = 8
_CACHE_BYTES = 4 << 20
"""Written before each call of the warm-up: between two frames other stages fill the caches."""


Classify = Callable[[Float32, Proposals, Int], Float64]
"""Likelihoods (R, 4) of the proposals of a frame that are named by index."""


def warm_up(classify: Classify, cost: LinearCost, max_points: int, batch: int, cpu_ns: Callable[[], int]) -> None:
    """Classify small and large frames, so that no frame pays for what a first call sets up; the cost model learns."""
    for n, points in product((1, batch, 2 * batch), (min(_FEW_POINTS, max_points), max_points)):
        cloud, proposals = _columns(n, points)
        times_ms = []
        for _ in range(_ROUNDS):
            np.ones(_CACHE_BYTES, np.uint8)
            start_ns = cpu_ns()
            classify(cloud, proposals, np.arange(n))
            times_ms.append((cpu_ns() - start_ns) / 1e6)
        cost.warmed_up(proposals.count, float(np.median(times_ms)))


def _columns(n: int, points: int) -> tuple[Float32, Proposals]:
    """A frame of n columns of so many points, a metre high and ten away, and its proposals."""
    xyz = np.zeros((n * points, 3), np.float32)
    xyz[:, 0], xyz[:, 2] = 10.0, np.tile(np.linspace(-1.0, 0.0, points), n)
    box = np.tile([10.0, 0.0, -0.5, 0.1, 0.1, 1.0, 0.0], (n, 1))
    return np.pad(xyz, ((0, 0), (0, 1))), Proposals(
        members=np.arange(len(xyz)),
        offsets=points * np.arange(n + 1),
        coordinates=xyz.T.copy(),
        centroid=box[:, :3],
        box=box,
        truncated=np.zeros(n, np.bool_),
        reflectance=np.zeros((n, 5)),
    )
