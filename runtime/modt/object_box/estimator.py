"""Boxes of whole objects, from what their proposals show (docs/object-boxes.md).

A frame shows one or two faces of an object. The box of a track is an estimate of the whole. Its heading follows the
motion, or the rectangle fitted to the points where the object stands. Its size is the usual one of the class,
corrected by the sides that were seen whole. Its centre lies beyond the visible faces, as seen from the sensor.

Headings are unit vectors, so no angle is wrapped, and compiled code gives the same bytes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from modt.class_sizes import IS_PERSON, IS_VEHICLE, IS_WALKER, MAX_SIZE_M, USUAL_SIZE_M, USUAL_SPREAD_M
from modt.geometry.kernels import NUMPY_GEOMETRY, GeometryKernels
from modt.object_box.tuning import ObjectBoxTuning
from modt.placement import Placement
from modt.types import Bool, Decisions, Float32, Float64, Int, Motion, MotionState, ObjectBoxes, Proposals

_HEADINGS_RAD = np.deg2rad(np.arange(0, 90, 5.0))
HEADINGS: Float64 = np.stack([np.cos(_HEADINGS_RAD), np.sin(_HEADINGS_RAD)], axis=1)
"""(H, 2) unit vectors of the headings at which rectangles are fitted; the compiled pass has room for 32."""
SIDES: Float32 = np.concatenate([HEADINGS.T, [-HEADINGS[:, 1], HEADINGS[:, 0]]], axis=1).astype(np.float32)
"""(2, 2 H) x and y of the headings, then of what lies to the left of them."""
COS_45 = math.sqrt(0.5)
MIN_RANGE_M2 = 1e-6
"""Square of the least distance of a centroid from the sensor [m2]."""
UNKNOWN_RAD2 = 1e6
"""Variance of a heading of which nothing is known [rad2]."""


class SeenBoxes:
    """Takes the box last seen for that of the whole object, as in the paper."""

    def estimate(
        self, own: ObjectBoxes, motion: Motion, decisions: Decisions, proposals: Proposals, placement: Placement
    ) -> None:
        """Write the box of every track."""
        own.whole_box[:] = motion.box


@dataclass(frozen=True)
class Seen:
    """Visible parts of the R objects in a frame.

    Attributes:
        rows: (R,) rows of the track table.
        object_class: (R,) reported classes.
        proposal: (R,) proposals.
        box: (R, 7) boxes of the frame [world].
        long_side: (R, 2) unit vectors along the longer sides of the fitted rectangles [world].
        sides_m: (2, R) longer and shorter sides of these rectangles [m].
        neighbour: (R, 2) headings by which the axes of cars are guessed (`WholeBoxes._neighbours`) [world].
        moving: (R,) objects that move.
        forward: (2,) unit vector of the sensor's x axis in the ground plane [world].
    """

    rows: Int
    object_class: Int
    proposal: Int
    box: Float64
    long_side: Float64
    sides_m: Float64
    neighbour: Float64
    moving: Bool
    forward: tuple[float, float]


class WholeBoxes(SeenBoxes):
    """Estimates the boxes of tracks that are reported as objects; the others have the box last seen.

    Args:
        kernels: passes over points.
        tuning: everything that is chosen in the stage.
    """

    def __init__(
        self, kernels: GeometryKernels = NUMPY_GEOMETRY, tuning: ObjectBoxTuning = ObjectBoxTuning()
    ) -> None:
        self._kernels = kernels
        self.tuning = tuning

    def estimate(
        self, own: ObjectBoxes, motion: Motion, decisions: Decisions, proposals: Proposals, placement: Placement
    ) -> None:
        """Write the box of every track.

        Args:
            own: written.
            motion: the tracks as the tracker leaves them.
            decisions: reported classes.
            proposals: proposals of the frame.
            placement: pose of the sensor.
        """
        rows = ((decisions.object_class > 0) & motion.observed).nonzero()[0]
        neighbour = self._neighbours(own, motion, decisions.object_class)
        self._estimate(own, motion, decisions.object_class, neighbour, proposals, placement.T_world_sensor, rows)
        heading = own.heading.take(rows, axis=0)
        own.whole_box[rows, 6] = np.arctan2(heading[:, 1], heading[:, 0])

    def _estimate(
        self,
        own: ObjectBoxes,
        motion: Motion,
        object_class: Int,
        neighbour: Float64,
        proposals: Proposals,
        T_world_sensor: Float64,
        rows: Int,
    ) -> None:
        """Write the columns of all tracks, but the yaw of the objects in view, whose rows (R,) are given.

        The other arrays are of all tracks: their classes (M,) and the headings of their neighbours (M, 2).
        """
        others = (object_class == 0).nonzero()[0]
        own.whole_box[others] = motion.box.take(others, axis=0)
        lost = ((object_class > 0) & ~motion.observed & own.estimated).nonzero()[0]
        own.whole_box[lost, :2] = motion.x[lost, :2] + own.centre_offset[lost]
        if not len(rows):
            return
        state = own.renewed(rows, 0)
        of_rows = motion.proposal[rows]
        forward = forward_of(T_world_sensor)
        long_side, sides_m = self._fit(proposals, of_rows, forward)
        seen = Seen(
            rows,
            object_class[rows],
            of_rows,
            motion.box.take(rows, axis=0),
            long_side,
            sides_m,
            neighbour[rows],
            self._moving(motion, rows),
            forward,
        )
        self._turn(state, motion, seen)
        middle, extent_m = self._visible(state, seen, proposals, T_world_sensor)
        bottom, extent_m[:, 2] = _bottom_and_height(seen, proposals, T_world_sensor)
        size_m = self._size(state, seen, extent_m)
        centre = self._centre(state, motion, seen, proposals, T_world_sensor, middle, extent_m, size_m)
        state.centre_offset[:] = centre - motion.x[rows, :2]
        state.estimated[:] = True
        state.whole_box[:, :6] = np.column_stack([centre, bottom + size_m[:, 2] / 2, size_m])
        for name, column in state.columns().items():
            getattr(own, name)[rows] = column

    def _neighbours(self, own: ObjectBoxes, motion: Motion, object_class: Int) -> Float64:
        """(M, 2) heading of the nearest car in line whose length was seen, for cars whose length was not, else 0.

        Cars stand in rows and drive in lanes. So a car near the axis of another one mostly has the same axis.
        """
        tuning = self.tuning.heading
        heading = np.zeros((len(own), 2))
        is_car = IS_VEHICLE[object_class]
        is_long = own.estimated & (own.known_m[:, 0] > MAX_SIZE_M[object_class, 1])
        unknown = (is_car & ~is_long).nonzero()[0]
        known = (is_car & is_long).nonzero()[0]
        if not len(known):
            return heading
        step = motion.x[unknown, None, :2] - motion.x[known, :2]  # (unknown, known, 2)
        ahead = own.heading[known]
        along_m = np.abs(step[:, :, 0] * ahead[:, 0] + step[:, :, 1] * ahead[:, 1])
        across_m = np.abs(step[:, :, 1] * ahead[:, 0] - step[:, :, 0] * ahead[:, 1])
        distance_m = np.where(across_m < tuning.beside_m, along_m + across_m, np.inf)
        in_line = distance_m.min(axis=1) < tuning.neighbour_m
        nearest = distance_m[in_line].argmin(axis=1)
        heading[unknown[in_line]] = ahead[nearest]
        return heading

    def _moving(self, motion: Motion, rows: Int) -> Bool:
        """(R,) rows that move, or may move and went far enough."""
        tuning = self.tuning.heading
        state = motion.motion[rows]
        fast = _dot(motion.velocity[rows], motion.velocity[rows]) > tuning.min_speed_mps * tuning.min_speed_mps
        went = (motion.moved_m[rows] > tuning.min_moved_m) & (state == MotionState.UNKNOWN)
        moving: Bool = fast & (went | (state == MotionState.MOVING))
        return moving

    def _fit(self, proposals: Proposals, of_rows: Int, forward: tuple[float, float]) -> tuple[Float64, Float64]:
        """Rectangles whose sides the points of proposals (R,) are closest to, at one of HEADINGS.

        As in the segmentation, but by points in place of cells, and by more of them.

        Returns:
            long_side: (R, 2) unit vectors along the longer sides [world].
            sides_m: (2, R) longer and shorter sides [m].
        """
        tuning = self.tuning.heading
        first = proposals.offsets[of_rows]
        # Every stride-th point of a proposal; divisions are rounded up.
        stride = -(-(proposals.offsets[of_rows + 1] - first) // tuning.max_fit_points)
        count = -(-(proposals.offsets[of_rows + 1] - first) // stride)
        starts = count.cumsum() - count
        rank = np.arange(count.sum()) - starts.repeat(count)
        points = first.repeat(count) + rank * stride.repeat(count)
        c, s = SIDES[:, :, None]
        along = c * proposals.coordinates[0, points] + s * proposals.coordinates[1, points]
        low, high = (of.reduceat(along, starts, axis=1).repeat(count, axis=1) for of in (np.minimum, np.maximum))
        inward = np.minimum(along - low, high - along)
        nearest = np.minimum(inward[: len(HEADINGS)], inward[len(HEADINGS) :])
        closeness = 1 / np.maximum(nearest, np.float32(tuning.side_noise_m))
        best = np.add.reduceat(closeness, starts, axis=1, dtype=np.float64).argmax(axis=0)
        heading = HEADINGS[best]
        low, high = self._extent(proposals, of_rows, heading)
        sides_m = high - low
        across = sides_m[0] < sides_m[1]
        side = np.where(across[:, None], _left_of(heading), heading)
        x, y = forward
        long_side = np.stack([side[:, 0] * x - side[:, 1] * y, side[:, 0] * y + side[:, 1] * x], axis=1)
        return long_side, np.stack([sides_m.max(axis=0), sides_m.min(axis=0)])

    def _extent(self, proposals: Proposals, of_rows: Int, heading: Float64) -> tuple[Float64, Float64]:
        """(2, R) least, and greatest coordinates of proposals (R,) along headings (R, 2), and to the left of them."""
        runs = np.stack([proposals.offsets[of_rows], proposals.offsets[of_rows + 1]])
        count = runs[1] - runs[0]
        _, (x, y, _) = self._kernels.copy_runs(proposals.members, proposals.coordinates, runs)
        c, s = heading.astype(np.float32).repeat(count, axis=0).T
        starts = count.cumsum() - count
        along = np.stack([x * c + y * s, y * c - x * s])
        least, greatest = (of.reduceat(along, starts, axis=1).astype(np.float64) for of in (np.minimum, np.maximum))
        return least, greatest

    def _turn(self, state: ObjectBoxes, motion: Motion, seen: Seen) -> None:
        """Turn the headings to the fitted rectangles, then to the motion of those that move."""
        tuning = self.tuning.heading
        # The fit comes before the motion, which overrules it. What stands then turns by 90 degrees where its evidence
        # speaks against the axis; length and width change places with it.
        evidence = self._axis_evidence(seen) + self._evidence_of_neighbours(seen)
        new = ~state.estimated
        first = np.where(evidence[:, None] >= 0, seen.long_side, _left_of(seen.long_side))
        state.heading[new] = first[new]
        state.heading_variance[new] = tuning.initial_sigma_rad * tuning.initial_sigma_rad
        self._turn_to_fit(state, seen, evidence)
        self._turn_to_motion(state, motion, seen)
        wrong = ((state.axis_evidence < -tuning.turning_evidence) & ~seen.moving).nonzero()[0]
        state.heading[wrong] = _left_of(state.heading[wrong])
        state.axis_evidence[wrong] *= -1.0
        state.heading_known[wrong] = False
        state.known_m[wrong, :2] = state.known_m[wrong, 1::-1]

    def _axis_evidence(self, seen: Seen) -> Float64:
        """(R,) log-likelihood ratio of a heading along the longer visible side over one across it.

        A side is seen whole, or a part of it. So a short one says little, one as long as usual speaks for itself, and
        a longer one speaks against itself.
        """
        tuning = self.tuning.heading
        length_m, width_m = seen.sides_m
        usual_m = USUAL_SIZE_M.take(seen.object_class, axis=0)
        variance = (
            np.square(USUAL_SPREAD_M.take(seen.object_class, axis=0)) + tuning.axis_spread_m * tuning.axis_spread_m
        )

        def likelihood(side_m: Float64, axis: int) -> Float64:
            off = side_m - usual_m[:, axis]
            square = off * off / variance[:, axis]
            part = 1 + square / 3  # a heavy tail: a shorter side may be a part of any longer one
            fitting: Float64 = tuning.whole_side_evidence / (part * part)
            return np.where(off > 0, tuning.whole_side_evidence - square / 2, fitting)

        ratio = likelihood(length_m, 0) + likelihood(width_m, 1) - likelihood(width_m, 0) - likelihood(length_m, 1)
        shoulders = -tuning.across_evidence * (length_m > tuning.shoulder_ratio * width_m)
        most = tuning.max_frame_evidence
        return np.where(IS_WALKER[seen.object_class], shoulders, np.clip(ratio, -most, most))

    def _evidence_of_neighbours(self, seen: Seen) -> Float64:
        """(R,) evidence of the neighbours for a heading along the longer visible side.

        Positive where the neighbour stands along that side, negative where it stands across it, and 0 without one.
        """
        along = _dot(seen.neighbour, seen.long_side)
        return self.tuning.heading.neighbour_evidence * (2 * along * along - _dot(seen.neighbour, seen.neighbour))

    def _turn_to_fit(self, state: ObjectBoxes, seen: Seen, evidence: Float64) -> None:
        """Turn the headings to the nearest of the four directions of each rectangle, and count its evidence."""
        tuning = self.tuning.heading
        side = seen.long_side
        facing = _dot(state.heading, side)
        beside = _dot(state.heading, _left_of(side))
        is_long = np.abs(facing) >= np.abs(beside)
        sign = np.where(np.where(is_long, facing, beside) < 0, -1.0, 1.0)
        nearest = sign[:, None] * np.where(is_long[:, None], side, _left_of(side))
        counted = tuning.evidence_memory * state.axis_evidence + np.where(is_long, evidence, -evidence)
        state.axis_evidence[:] = np.clip(counted, -tuning.max_evidence, tuning.max_evidence)
        variance = state.heading_variance + tuning.drift_sigma_rad * tuning.drift_sigma_rad
        measured = self._fit_variance(seen)
        state.heading[:], state.heading_variance[:] = _turned(state.heading, variance, nearest, measured)

    def _fit_variance(self, seen: Seen) -> Float64:
        """(R,) variances of the directions of the fitted rectangles [rad2].

        Long sides are fitted well, and rectangles wider than the class badly.
        """
        tuning = self.tuning.heading
        length_m = (seen.sides_m[0] - tuning.min_side_m) / tuning.full_side_m
        weight = np.clip(length_m, tuning.least_fit_weight, 1.0)
        weight *= np.where(IS_PERSON[seen.object_class], tuning.person_fit_weight, 1.0)
        weight[IS_WALKER[seen.object_class]] = tuning.pedestrian_fit_weight
        excess_m = np.maximum(seen.sides_m[1] - USUAL_SIZE_M[seen.object_class, 1], 0.0)
        excess = excess_m / USUAL_SPREAD_M[seen.object_class, 1]
        variance: Float64 = tuning.fit_sigma_rad * tuning.fit_sigma_rad * (1 + excess * excess) / weight
        return variance

    def _turn_to_motion(self, state: ObjectBoxes, motion: Motion, seen: Seen) -> None:
        """Turn what moves to the direction of its motion, at once where that is more than 45 degrees away."""
        tuning = self.tuning.heading
        moving = seen.moving.nonzero()[0]
        velocity = motion.velocity[seen.rows[moving]]
        square = _dot(velocity, velocity)
        direction = velocity / np.sqrt(square)[:, None]
        x, y = direction.T
        covariance = motion.velocity_covariance[seen.rows[moving]]
        across = y * y * covariance[:, 0, 0] - 2 * x * y * covariance[:, 0, 1] + x * x * covariance[:, 1, 1]
        heading = state.heading[moving]
        backward = (_dot(heading, direction) < 0) & ~state.heading_known[moving]
        heading[backward] *= -1.0
        turned_away = _dot(heading, direction) < COS_45
        variance = np.where(turned_away, UNKNOWN_RAD2, state.heading_variance[moving])
        measured = tuning.motion_sigma_rad * tuning.motion_sigma_rad + across / square
        state.heading[moving], state.heading_variance[moving] = _turned(heading, variance, direction, measured)
        state.axis_evidence[moving] = tuning.moving_evidence
        state.heading_known[moving] = True

    def _visible(
        self, state: ObjectBoxes, seen: Seen, proposals: Proposals, T_world_sensor: Float64
    ) -> tuple[Float64, Float64]:
        """Rectangles about the proposals at the headings.

        Returns:
            middle: (R, 2) middle of each [m, world].
            extent_m: (R, 3) extent along the heading, across it, and 0 [m].
        """
        c, s = _in_sensor(state.heading, seen.forward)
        low, high = self._extent(proposals, seen.proposal, np.stack([c, s], axis=1))
        u, v = (low + high) / 2
        length_m, width_m = high - low
        middle = np.stack([u * c - v * s, u * s + v * c], axis=1)
        extent_m = np.stack([length_m, width_m, np.zeros(len(u))], axis=1)
        return _in_world(seen, proposals, middle, T_world_sensor), extent_m

    def _size(self, state: ObjectBoxes, seen: Seen, extent_m: Float64) -> Float64:
        """(R, 3) length, width and height, given the extents (R, 3) that the frame shows [m].

        The known size follows a larger extent fast and a smaller one slowly; what is larger than the class allows is
        taken for merged objects, and changes nothing. A side is seen whole, or an unknown part of it. The nearer its
        known length is to the usual one, the likelier it is whole. The estimate of a whole side lies between both
        lengths, by their uncertainties. That of a part is the usual length, or the known one if it is longer.
        """
        tuning = self.tuning.size
        class_ = seen.object_class
        change_m = extent_m - state.known_m
        share = np.where(change_m > 0, tuning.growth, tuning.shrinkage)
        share[(extent_m[:, :2] > MAX_SIZE_M.take(class_, axis=0)).any(axis=1)] = 0.0
        share[~state.estimated] = 1.0
        state.known_m[:] += share * change_m
        usual_m = USUAL_SIZE_M.take(class_, axis=0)
        usual_m[:, 0] += tuning.stride_m * (seen.moving & IS_WALKER[class_])
        spread_m = USUAL_SPREAD_M.take(class_, axis=0)
        more_m = state.known_m - usual_m
        missing = np.maximum(-more_m, 0.0) / spread_m
        part = 1 + missing * missing
        whole = 1 / (1 + tuning.doubt * (part * part))
        noise_m = np.array([tuning.length_noise_m, tuning.width_noise_m, tuning.height_noise_m])
        # Weight of what is seen against the usual length, by their variances.
        trust = spread_m * spread_m / (spread_m * spread_m + noise_m * noise_m)
        at_least_m = np.maximum(more_m, 0.0)
        size_m: Float64 = usual_m + (at_least_m + whole * (trust * more_m - at_least_m))
        return size_m

    def _centre(
        self,
        state: ObjectBoxes,
        motion: Motion,
        seen: Seen,
        proposals: Proposals,
        T_world_sensor: Float64,
        middle: Float64,
        extent_m: Float64,
        size_m: Float64,
    ) -> Float64:
        """(R, 2) centres of the boxes [m, world].

        Along each axis the unseen part of a car lies beyond the visible one, as seen from the sensor. Where the
        sensor is abreast of the visible part, it lies on both sides. The axis of a person's body lies beyond the
        centroid, which arms and legs move little. The centre follows gradually, and the box keeps holding the
        visible part.

        Args:
            state: headings and former centres.
            motion: the tracks as the tracker leaves them.
            seen: what the frame shows.
            proposals: proposals of the frame.
            T_world_sensor: (4, 4) pose of the sensor.
            middle: (R, 2) middles of the visible parts [m, world].
            extent_m: (R, 3) their extents [m].
            size_m: (R, 3) sizes of the objects [m].
        """
        tuning = self.tuning.centre
        unseen_m = np.maximum(size_m[:, :2] - extent_m[:, :2], 0.0) / 2
        reach_m = np.maximum(size_m[:, :2] / 2, tuning.min_reach_m)
        ray = _along(state.heading, middle - T_world_sensor[:2, 3])
        beyond = np.clip(ray / reach_m, -1.0, 1.0) * unseen_m
        body = _along(state.heading, self._body(seen, proposals, T_world_sensor) - middle)
        wanted = np.where(IS_PERSON[seen.object_class][:, None], body, beyond)
        former = _along(state.heading, motion.x[seen.rows, :2] + state.centre_offset - middle)
        followed = np.where(state.estimated[:, None], former + tuning.gain * (wanted - former), wanted)
        room_m = unseen_m + tuning.slack_m
        u, v = np.clip(followed, -room_m, room_m).T
        c, s = state.heading.T
        centre: Float64 = middle + np.stack([c * u - s * v, s * u + c * v], axis=1)
        return centre

    def _body(self, seen: Seen, proposals: Proposals, T_world_sensor: Float64) -> Float64:
        """(R, 2) points beyond the centroids, where the axes of people's bodies are [m, world]."""
        tuning = self.tuning.centre
        centroid = proposals.centroid.take(seen.proposal, axis=0)[:, :2]
        depth_m = np.where(IS_WALKER[seen.object_class], tuning.pedestrian_depth_m, tuning.cyclist_depth_m)
        share = 1 + depth_m / np.sqrt(np.maximum(_dot(centroid, centroid), MIN_RANGE_M2))
        return _in_world(seen, proposals, share[:, None] * centroid, T_world_sensor)


def _dot(a: Float64, b: Float64) -> Float64:
    """(R,) products of vectors (R, 2)."""
    product: Float64 = a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1]
    return product


def _left_of(heading: Float64) -> Float64:
    """(R, 2) headings a quarter turn to the left."""
    return np.stack([-heading[:, 1], heading[:, 0]], axis=1)


def _along(heading: Float64, vector: Float64) -> Float64:
    """(R, 2) components of vectors (R, 2) along headings (R, 2), and to the left of them."""
    return np.stack([_dot(heading, vector), _dot(_left_of(heading), vector)], axis=1)


def _turned(
    heading: Float64, variance: Float64, measured: Float64, measured_variance: Float64
) -> tuple[Float64, Float64]:
    """Headings (R, 2) and their variances (R,) after measured headings with theirs."""
    gain = variance / (variance + measured_variance)
    turned = heading + gain[:, None] * (measured - heading)
    return turned / np.sqrt(_dot(turned, turned))[:, None], (1 - gain) * variance


def forward_of(T_world_sensor: Float64) -> tuple[float, float]:
    """Unit vector of the sensor's x axis in the ground plane [world]."""
    x, y = T_world_sensor[:2, 0].tolist()
    length = math.sqrt(x * x + y * y)
    return x / length, y / length


def _in_sensor(heading: Float64, forward: tuple[float, float]) -> tuple[Float64, Float64]:
    """(R,) components of headings (R, 2) along the sensor's x and y axes."""
    c, s = forward
    return heading[:, 0] * c + heading[:, 1] * s, heading[:, 1] * c - heading[:, 0] * s


def _in_world(seen: Seen, proposals: Proposals, position: Float64, T_world_sensor: Float64) -> Float64:
    """(R, 2) places in the world of positions (R, 2) in the sensor frame, one a proposal [m].

    They keep their distance from the box of the proposal, whose place in the world is known.
    """
    step = position - proposals.box.take(seen.proposal, axis=0)[:, :2]
    (xx, xy), (yx, yy) = T_world_sensor[:2, :2].tolist()
    x, y = step.T
    world: Float64 = seen.box[:, :2] + np.stack([xx * x + xy * y, yx * x + yy * y], axis=1)
    return world


def _bottom_and_height(seen: Seen, proposals: Proposals, T_world_sensor: Float64) -> tuple[Float64, Float64]:
    """(R,) bottoms of objects that stand on the ground [m, world], and (R,) their seen heights above it [m]."""
    half_m = seen.box[:, 5] / 2
    bottom = seen.box[:, 2] - half_m
    if proposals.ground_z_m is not None:
        xz, yz, zz, z = T_world_sensor[2].tolist()
        x, y, _ = proposals.centroid.take(seen.proposal, axis=0).T
        bottom = np.minimum(bottom, xz * x + yz * y + zz * proposals.ground_z_m[seen.proposal] + z)
    return bottom, seen.box[:, 2] + half_m - bottom
