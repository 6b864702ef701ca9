"""The same things done slowly and obviously."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from modt.segmentation.boxes import HEADINGS, NEAREST_M
from modt.segmentation.clusters import GAP_BEAMS, GAP_M
from modt.segmentation.grids import SECTORS
from modt.segmentation.ground import BEND, BRIDGE_M, GAIN, NOISE_M


def within_distance(plane, radius):
    """(n,) component of each point of a plane: those no farther apart than the radius on either axis are linked."""
    pairs = cKDTree(plane).query_pairs(radius, p=np.inf, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(plane), len(plane)))
    return connected_components(graph, directed=False)[1]


def flood(row, column, low, high, root, beam_rad):
    """(C,) component of each cell, filled from seed to seed."""
    at = {(r, c): i for i, (r, c) in enumerate(zip(row.tolist(), column.tolist(), strict=True))}
    component = np.full(len(row), -1)
    for seed in range(len(row)):
        todo = [seed] if component[seed] < 0 else []
        while todo:
            i = todo.pop()
            component[i] = seed
            for step in [(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1)]:
                j = at.get((row[i] + step[0], column[i] + step[1]))
                if j is not None and component[j] < 0:
                    first = min(i, j, key=lambda k: (row[k], column[k]))
                    gap = max(low[i], low[j]) - min(high[i], high[j])
                    if gap < GAP_M + GAP_BEAMS * beam_rad * root[first] ** 2:
                        todo.append(j)
    return component


def supported(lowest, range_m, height_m, max_slope):
    """(rings, SECTORS) cells whose lowest return is ground, ray by ray and ring by ring."""
    found = np.zeros(lowest.shape, bool)
    for ray in range(SECTORS):
        height, at, slope, bend = -height_m, 0.0, 0.0, max_slope
        for ring in range(len(range_m)):
            here = lowest[ring, ray]
            if not np.isfinite(here):
                continue
            gap = range_m[ring] - at
            reach = min(gap, BRIDGE_M)
            if abs(here - height - slope * reach) < reach * bend + NOISE_M:
                found[ring, ray] = True
                slope = float(np.clip(slope + GAIN * ((here - height) / gap - slope), -max_slope, max_slope))
                height, at, bend = here, range_m[ring], BEND
    return found


def heading(x, y):
    """Heading of one cluster by closeness."""
    best = []
    for angle in HEADINGS:
        along, across = x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle)
        sides = [along - along.min(), along.max() - along, across - across.min(), across.max() - across]
        best.append(np.sum(1 / np.maximum(np.min(sides, axis=0), NEAREST_M)))
    return np.array(best)


def same_partition(one, other):
    """Whether two labellings say the same of which rows belong together."""
    pairs = len(np.unique(np.stack([one, other]), axis=1).T)
    return pairs == len(np.unique(one)) == len(np.unique(other))


def refines(fine, coarse):
    """Whether every group of the first lies within one of the second."""
    return len(np.unique(np.stack([fine, coarse]), axis=1).T) == len(np.unique(fine))
