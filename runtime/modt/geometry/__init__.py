"""Transforms, boxes, k-DOPs and the field of view."""

from modt.geometry.bearings import pseudo_angle
from modt.geometry.boxes import (
    corners,
    inverse,
    quaternion_of,
    rotation_of,
    rotation_zyx,
    se3,
    transform,
    transform_boxes,
    turn_between,
    upright_boxes,
    wrap,
    yaw_of,
)
from modt.geometry.field_of_view import Camera, FieldOfView

__all__ = [
    "Camera",
    "FieldOfView",
    "corners",
    "inverse",
    "pseudo_angle",
    "quaternion_of",
    "rotation_of",
    "rotation_zyx",
    "se3",
    "transform",
    "transform_boxes",
    "turn_between",
    "upright_boxes",
    "wrap",
    "yaw_of",
]
