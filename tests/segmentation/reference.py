"""The same things done slowly and obviously."""

from itertools import pairwise

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from modt.segmentation import car_merging, person_splitting
from modt.segmentation.box_fitting import HEADINGS, NEAREST_M
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
    """(rings, SECTORS) cells whose lowest return is ground, ray by ray and ring by ring; (1, SECTORS) last slopes."""
    found, slopes = np.zeros(lowest.shape, bool), np.zeros((1, SECTORS))
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
        slopes[0, ray] = slope
    return found, slopes


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


def people_cuts(x, y, height, step_rad, beam_rad, least_points):
    """(K,) column of each point of one group, and the columns at which it is cut: column by column, run by run."""
    mx, my = x.mean(), y.mean()
    away = np.hypot(mx, my)
    c, s = np.float32(mx / away), np.float32(my / away)
    step = max(step_rad, person_splitting.COLUMN_M / away)
    depth = x * c + y * s
    column = np.floor((y * c - x * s) / (np.maximum(depth, person_splitting.NEAR_M) * np.float32(step))).astype(int)
    expected = person_splitting.UPRIGHT_M / (away * beam_rad) * step / step_rad
    runs = []
    for here in range(column.min(), column.max() + 1):
        own = np.flatnonzero(column == here)
        if len(own) < max(person_splitting.FILLED * expected, 1.0):
            continue
        beside = runs and runs[-1][-1][0] == here - 1
        if beside and abs(runs[-1][-1][1] - depth[own].mean(dtype=float)) <= person_splitting.STEP_M:
            runs[-1].append((here, depth[own].mean(dtype=float), own))
        else:
            runs.append([(here, depth[own].mean(dtype=float), own)])
    parts = []
    for run in runs:
        own = np.concatenate([c[2] for c in run])
        near = np.array([depth[c[2]].min() for c in run])
        breadth, head = len(run) * step * away, height[own].max()
        if breadth <= person_splitting.BREADTH_M[0] or len(own) < least_points:
            continue
        person = (
            breadth < person_splitting.BREADTH_M[1] and person_splitting.HEAD_M[0] < head < person_splitting.HEAD_M[1]
        )
        person = person and near.max() - near.min() < person_splitting.DEPTH_M
        person = person and depth[own].mean(dtype=float) - near.min() < person_splitting.HOLLOW_M
        parts.append((run[0][0], run[-1][0], near.mean(dtype=float), person))
    cuts = []
    for right, left in pairwise(parts):
        apart = left[0] - right[1] > person_splitting.GAP or abs(left[2] - right[2]) > person_splitting.STEP_M
        if apart and (right[3] or left[3]):
            cuts.append((right[1] + left[0] + 1) // 2)
    return column, cuts


def whole(bounds, beam):
    """(G,) first of the groups that make a car with each: pair by pair, then from one to the next."""
    n = len(bounds.turn_m)
    (right, near, low, down), (left, far, top, up) = bounds.least, bounds.most

    def breadth(own):
        return (left[own].max() - right[own].min()) * bounds.turn_m[own[0]]

    def small(own):
        size = np.hypot(far[own].max() - near[own].min(), breadth(own))
        return (
            size < car_merging.DIAGONAL_M
            and breadth(own) < car_merging.BREADTH_M[1]
            and top[own].max() < car_merging.TOP_M[1]
        )

    def person(one):
        narrow = breadth([one]) < car_merging.UPRIGHT_M[0] and top[one] > car_merging.UPRIGHT_M[1]
        return narrow and top[one] - low[one] > car_merging.UPRIGHT_M[2]

    linked = [[] for _ in range(n)]
    for front in range(n):
        for back in range(n):
            pair = [front, back]
            if near[front] >= near[back] or person(front) or person(back) or not small(pair):
                continue
            meets = max(right[front], right[back]) <= min(left[front], left[back])
            beams = (down[back] - up[front]) / beam
            follows = (
                near[back] - far[front] < car_merging.BEHIND_M and car_merging.BEAMS[0] < beams < car_merging.BEAMS[1]
            )
            like = breadth(pair) > car_merging.BREADTH_M[0] and top[pair].max() > car_merging.TOP_M[0]
            if meets and follows and like and low[pair].min() < car_merging.BOTTOM_M:
                linked[front].append(back)
                linked[back].append(front)
    first = np.arange(n)
    for one in range(n):
        reached, todo = {one}, [one]
        while todo:
            todo += [other for other in linked[todo.pop()] if not (other in reached or reached.add(other))]
        if small(sorted(reached)):
            first[one] = min(reached)
    return first
