"""Rigid transforms, and upright boxes: x, y, z of the centre, length, width, height [m], yaw [rad]."""

from __future__ import annotations

import math

import numpy as np

from modt.types import Bool, Float32, Float64, Int


def wrap(angle: Float64) -> Float64:
    """Angle brought to [-pi, pi) [rad]."""
    wrapped: Float64 = (angle + np.pi) % (2 * np.pi) - np.pi
    return wrapped


def rotation_zyx(roll: float, pitch: float, yaw: float) -> Float64:
    """(3, 3) R = Rz(yaw) Ry(pitch) Rx(roll)."""
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (np.cos, np.sin))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def se3(rotation: Float64, translation: Float64) -> Float64:
    """(4, 4) rigid transform of a (3, 3) rotation and a (3,) translation."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation, translation
    return T


def inverse(T: Float64) -> Float64:
    """(4, 4) inverse of a rigid transform."""
    R = T[:3, :3]
    return se3(R.T, -R.T @ T[:3, 3])


def yaw_of(T: Float64) -> float:
    """Heading of a rigid transform in the ground plane [rad]."""
    return float(np.arctan2(T[1, 0], T[0, 0]))


def quaternion_of(T: Float64) -> Float64:
    """(4,) rotation of a rigid transform as a quaternion x, y, z, w."""
    R, diagonal = T[:3, :3], T.diagonal()[:3]
    trace = diagonal.sum()
    i = int(diagonal.argmax())
    j, k = (i + 1) % 3, (i + 2) % 3
    quaternion = np.empty(4)
    if diagonal[i] > trace:
        quaternion[[i, j, k]] = 1 - trace + 2 * R[i, i], R[j, i] + R[i, j], R[k, i] + R[i, k]
        quaternion[3] = R[k, j] - R[j, k]
    else:
        quaternion[:] = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], 1 + trace
    return quaternion / np.linalg.norm(quaternion)


def rotation_of(quaternion: Float64) -> Float64:
    """(3, 3) rotation by a quaternion x, y, z, w of any length."""
    x, y, z, w = (quaternion / np.linalg.norm(quaternion)).tolist()
    return np.array(
        [
            [x * x - y * y - z * z + w * w, 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), y * y - x * x - z * z + w * w, 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), z * z - x * x - y * y + w * w],
        ]
    )


def turn_between(a: Float64, b: Float64, share: float) -> Float64:
    """(3, 3) rotation of the (4, 4) transform a, turned on towards that of b by a share of the angle between them."""
    *axis, cosine = quaternion_of(inverse(a) @ b).tolist()
    sine = math.copysign(math.hypot(*axis), cosine)
    half_rad = math.atan2(abs(sine), abs(cosine))
    along = math.sin(share * half_rad) / sine if sine else 0.0
    turn = np.array([*(along * component for component in axis), math.cos(share * half_rad)])
    R: Float64 = a[:3, :3] @ rotation_of(turn)
    return R


def transform(T: Float64, xyz: Float64) -> Float64:
    """(n, 3) points taken by the (4, 4) transform."""
    moved: Float64 = xyz @ T[:3, :3].T + T[:3, 3]
    return moved


def transform_boxes(T: Float64, boxes: Float64) -> Float64:
    """(n, 7) boxes taken by the (4, 4) transform; they stay upright."""
    out = boxes.copy()
    out[:, :3] = transform(T, boxes[:, :3])
    out[:, 6] = wrap(boxes[:, 6] + yaw_of(T))
    return out


def upright_boxes(xyz: Float32, offsets: Int, yaw: Float64) -> Float64:
    """(G, 7) boxes at headings or across them, so that l >= w, about groups of points.

    Args:
        xyz: (3, K) points sorted by group [m].
        offsets: (G + 1,) group i owns the columns from offsets[i] to offsets[i + 1]; none is empty.
        yaw: (G,) headings [rad].
    """
    cosine, sine = np.cos(yaw), np.sin(yaw)
    count = offsets[1:] - offsets[:-1]
    c, s = (np.repeat(along.astype(np.float32), count) for along in (cosine, sine))
    x, y, z = xyz
    sides = (x * c + y * s, y * c - x * s, z)
    low, high = (
        np.stack([f.reduceat(side, offsets[:-1]) for side in sides]).astype(np.float64)
        for f in (np.minimum, np.maximum)
    )
    (u, v, w), (length, width, height) = (low + high) / 2, high - low
    turn = length < width
    longer, shorter = np.where(turn, width, length), np.where(turn, length, width)
    x, y = u * cosine - v * sine, u * sine + v * cosine
    return np.stack([x, y, w, longer, shorter, height, yaw - np.where(turn, np.pi / 2, 0.0)], axis=1)


def corners(boxes: Float64) -> Float64:
    """(n, 4, 2) bird's-eye corners of (n, 7) boxes, counter-clockwise."""
    signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) / 2
    local = signs * boxes[:, None, 3:5]
    c, s = np.cos(boxes[:, 6])[:, None], np.sin(boxes[:, 6])[:, None]
    x = c * local[..., 0] - s * local[..., 1] + boxes[:, None, 0]
    y = s * local[..., 0] + c * local[..., 1] + boxes[:, None, 1]
    return np.stack([x, y], axis=-1)


TINY = 1e-9


def birds_eye_intersection(a: Float64, b: Float64) -> Float64:
    """(n,) bird's-eye area that boxes a (n, 7) share with boxes b (n, 7), row by row [m2].

    The common polygon's vertices are the corners of one inside the other and the crossings of their edges; in the
    order of their bearing from their mean they give its area.
    """
    origin = a[:, None, :2]  # near the boxes: far from it, cross products cancel
    p, q = corners(a) - origin, corners(b) - origin
    crossing, crosses = _crossings(p, q)
    vertices = np.concatenate([p, q, crossing], axis=1)
    valid = np.concatenate([_inside(p, q), _inside(q, p), crosses], axis=1)
    n = np.maximum(valid.sum(axis=1), 1)
    mean = (vertices * valid[..., None]).sum(axis=1) / n[:, None]
    local = np.where(valid[..., None], vertices - mean[:, None], 0.0)
    bearing = np.where(valid, np.arctan2(local[..., 1], local[..., 0]), np.inf)
    order = np.argsort(bearing, axis=1)
    ring = np.take_along_axis(local, order[..., None], axis=1)
    placed = np.take_along_axis(valid, order, axis=1)
    ring = np.where(placed[..., None], ring, ring[:, :1])  # the unused repeat the first vertex and add no area
    after = np.roll(ring, -1, axis=1)
    area: Float64 = 0.5 * np.abs((ring[..., 0] * after[..., 1] - ring[..., 1] * after[..., 0]).sum(axis=1))
    return area


def iou_3d(a: Float64, b: Float64) -> Float64:
    """(n,) intersection over union of the boxes' volumes, row by row."""
    top = np.minimum(a[:, 2] + a[:, 5] / 2, b[:, 2] + b[:, 5] / 2)
    foot = np.maximum(a[:, 2] - a[:, 5] / 2, b[:, 2] - b[:, 5] / 2)
    shared = birds_eye_intersection(a, b) * np.maximum(top - foot, 0.0)
    union = np.prod(a[:, 3:6], axis=1) + np.prod(b[:, 3:6], axis=1) - shared
    iou: Float64 = shared / np.maximum(union, TINY)
    return iou


def _inside(points: Float64, polygon: Float64) -> Bool:
    """(n, k) whether points (n, k, 2) lie in counter-clockwise rectangles (n, 4, 2), edges included."""
    edge = np.roll(polygon, -1, axis=1) - polygon
    offset = points[:, :, None] - polygon[:, None]
    cross = edge[:, None, :, 0] * offset[..., 1] - edge[:, None, :, 1] * offset[..., 0]
    inside: Bool = np.logical_and.reduce(cross >= -TINY, axis=2)
    return inside


def _crossings(p: Float64, q: Float64) -> tuple[Float64, Bool]:
    """(n, 16, 2) where the edges of p meet those of q, and whether they do so within both."""
    d, e = np.roll(p, -1, axis=1) - p, np.roll(q, -1, axis=1) - q
    offset = q[:, None] - p[:, :, None]
    d, e = d[:, :, None], e[:, None]
    denominator = d[..., 0] * e[..., 1] - d[..., 1] * e[..., 0]
    parallel = np.less(np.abs(denominator), TINY)
    denominator = np.where(parallel, 1.0, denominator)
    t = (offset[..., 0] * e[..., 1] - offset[..., 1] * e[..., 0]) / denominator
    u = (offset[..., 0] * d[..., 1] - offset[..., 1] * d[..., 0]) / denominator
    meets = ~parallel & (t >= 0) & (t <= 1) & (u >= 0) & (u <= 1)
    point = p[:, :, None] + t[..., None] * d
    return point.reshape(len(p), 16, 2), meets.reshape(len(p), 16)
