"""Reference versions of the vectorised code, in loops."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from modt.segmentation.grids import SECTORS
from modt.segmentation.ground_rays import POSITIONS
from modt.segmentation.groups import HEADINGS
from modt.segmentation.tuning import SegmentationTuning


def within_distance(plane, radius):
    """(n,) component of each point of a plane: points within the radius on both axes are connected."""
    pairs = cKDTree(plane).query_pairs(radius, p=np.inf, output_type="ndarray")
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(plane), len(plane)))
    return connected_components(graph, directed=False)[1]


def flood_fill(cells, beam_m):
    """(C,) component of each cell, filled from seed to seed; (C,) beam_m is the vertical distance of beams."""
    row, column, low, high = cells.row, cells.column, cells.low, cells.high
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
                    if (
                        gap
                        < SegmentationTuning().cells.max_gap_m
                        + SegmentationTuning().cells.max_gap_beams * beam_m[first]
                    ):
                        todo.append(j)
    return component


def trace(lowest, top, estimator, height_m, max_slope_deg):
    """(rings, SECTORS) ground cells, cells on and beside a ramp, and cells in which something stands.

    Then the (rings, SECTORS) height of each cell if it is ground, and (SECTORS,) slope of the ramp at a ray's end.
    """
    ground = SegmentationTuning().ground
    max_slope, hill_slope, ramp_slope = np.tan(np.deg2rad([v * max_slope_deg for v in (1.0, 2.0, ground.ramp_share)]))
    position = (lowest.view(np.int32) & (POSITIONS - 1)) / POSITIONS
    range_m = ((np.arange(len(lowest))[:, None] + position) * estimator.grid.ring_step) ** 2
    is_ground, steep, ramp, stands = np.zeros((4, *lowest.shape), bool)
    height_m_of_cell = lowest.astype(float)
    last = [(-height_m, 0.0, 0.0)] * SECTORS
    for ring in range(len(range_m)):
        may_join, hidden, may_be_reached, reached = [], [], [], []
        sure = is_ground[ring].copy()
        for ray in np.flatnonzero(np.isfinite(lowest[ring])).tolist():
            height, at, slope = last[ray]
            gap = range_m[ring, ray] - at
            off = lowest[ring, ray] - height - slope * min(gap, ground.max_gap_m)
            near = ground.max_gap_m if ring and ramp[ring - 1, ray] else ground.near_m
            flat_m = estimator.flat_m[ring] + max(slope, 0.0) * estimator.depth_m[ring]
            here, behind = top[ring : ring + 2, ray][[0, -1]] - lowest[ring, ray]
            flat = here <= flat_m
            further = lowest[ring + 1 : min(ring + 1 + ground.rings_behind, estimator.near_rings), ray]
            further = further[np.isfinite(further)]
            stays_up = len(further) > 0 and further.min() > lowest[ring, ray] - np.float32(ground.noise_m)
            may_rise = flat and (at > 0 or (behind <= flat_m and stays_up))
            may_fall = off > -gap * max_slope - ground.noise_m
            is_ground[ring, ray] = (
                may_fall and off < (min(gap, near) * max_slope if may_rise else 0.0) + ground.noise_m
            )
            stands[ring, ray] = may_fall and not flat
            sure[ray] = is_ground[ring, ray] and (flat or off >= -ground.noise_m)
            if stands[ring, ray] and off < -ground.noise_m and gap > ground.near_m:
                hidden.append(ray)
            if flat and off < gap * hill_slope:
                may_join.append(ray)
                may_be_reached += [ray] if stays_up else []
            if sure[ray] and (at > 0 or off < ground.noise_m):
                reached.append(ray)
        max_rise_m = 2 * np.pi / SECTORS * range_m[ring] * max_slope
        for ray in reached:  # which grows
            for beside in (ray - 1) % SECTORS, (ray + 1) % SECTORS:
                step_m = np.abs(lowest[ring, beside] - lowest[ring, ray])
                if beside in may_be_reached and step_m < max_rise_m[beside] + ground.noise_m:
                    may_be_reached.remove(beside)
                    reached.append(beside)
                    sure[beside] = is_ground[ring, beside] = True
        for ray in may_join + hidden:
            around = [beside for beside in (ray - 1, (ray + 1) % SECTORS) if sure[beside]]
            continues = (np.abs(lowest[ring, around] - lowest[ring, ray]) < max_rise_m[ray]).any()
            if continues and ray in may_join:
                is_ground[ring, ray] = True
            elif not continues and ray in hidden:
                height_m_of_cell[ring, ray] -= ground.hidden_m
        for ray in range(SECTORS):
            height, at, slope = last[ray]
            if is_ground[ring, ray]:
                here, gap = height_m_of_cell[ring, ray], range_m[ring, ray] - at
                slope += (here - height - slope * gap) / (gap + ground.slope_length_m)
                slope = float(np.clip(slope, -hill_slope, hill_slope))
                last[ray] = here, range_m[ring, ray], slope
            steep[ring, ray] = abs(slope) > ramp_slope
        for ray in range(SECTORS):
            ramp[ring, ray] = steep[ring, [(ray + k * ground.flank_sectors) % SECTORS for k in (-1, 0, 1)]].any()
    slope = np.array([of[2] for of in last])
    return is_ground, ramp, stands, height_m_of_cell, np.where(np.abs(slope) > ramp_slope, slope, 0.0)


def closeness(x, y, noise_m):
    """(18,) closeness of one cluster at each heading."""
    best = []
    for angle in HEADINGS:
        along, across = x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle)
        sides = [along - along.min(), along.max() - along, across - across.min(), across.max() - across]
        best.append(np.sum(1 / np.maximum(np.min(sides, axis=0), noise_m)))
    return np.array(best)


def same_partition(one, other):
    """Whether two labellings are equal up to a permutation of labels."""
    pairs = len(np.unique(np.stack([one, other]), axis=1).T)
    return pairs == len(np.unique(one)) == len(np.unique(other))


def refines(fine, coarse):
    """Whether each group of the first is inside one of the second."""
    return len(np.unique(np.stack([fine, coarse]), axis=1).T) == len(np.unique(fine))


def car_targets(bounds, beam, limits):
    """(G,) first of the clusters that make one car with each, pair by pair."""
    n = len(bounds)
    (right, near, low, down), (left, far, top, up) = bounds.min, bounds.max

    def width(own):
        return (left[own].max() - right[own].min()) * bounds.scale_m[own[0]]

    def small(own):
        size = np.hypot(far[own].max() - near[own].min(), width(own))
        return size < limits.max_diagonal_m and width(own) < limits.max_width_m and top[own].max() < limits.max_top_m

    def fits(one, size):
        narrow = width([one]) < size.max_extent_m and size.min_top_m < top[one] < size.max_top_m
        return narrow and top[one] - low[one] > size.min_height_m

    def person(one):
        return fits(one, limits.person)

    connected = [[] for _ in range(n)]
    for front in range(n):
        for back in range(n):
            pair = [front, back]
            if near[front] >= near[back] or person(front) or person(back) or not small(pair):
                continue
            meets = max(right[front], right[back]) <= min(left[front], left[back])
            beams = (down[back] - up[front]) / beam
            apart = near[back] < limits.max_hidden_range_m and fits(back, limits.hidden_person)
            follows = near[back] - far[front] < limits.max_gap_m
            follows = follows and limits.min_gap_beams < beams < limits.max_gap_beams
            like = width(pair) > limits.min_width_m and top[pair].max() > limits.min_top_m
            if meets and follows and like and not apart and low[pair].min() < limits.max_bottom_m:
                connected[front].append(back)
                connected[back].append(front)
    first = np.arange(n)
    for one in range(n):
        reached, todo = {one}, [one]
        while todo:
            todo += [other for other in connected[todo.pop()] if not (other in reached or reached.add(other))]
        if small(sorted(reached)):
            first[one] = min(reached)
    return first
