"""KITTI tracking results: foreground objects in the camera's coordinates."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from modt.classes import ObjectClass
from modt.geometry import Camera, corners, transform
from modt.sinks.output import LineFile, writing
from modt.types import NONE, FrameResult

NAMES = {ObjectClass.CAR: "Car", ObjectClass.PEDESTRIAN: "Pedestrian", ObjectClass.CYCLIST: "Cyclist"}

NOMINAL = Camera(
    P_image_sensor=np.zeros((3, 4)),
    T_camera_sensor=np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]),
    width_px=0.0,
    height_px=0.0,
)
"""Stands in where there is no camera: its axes at the sensor's place, no image."""


class KittiResults:
    """Writes kitti/NNNN.txt: frame, id, type, box in the image, size, place, heading, score.

    Args:
        path: of the file.
        camera: that the results refer to; without one the axes are a camera's at the place of the sensor, and the
            box in the image is -1 throughout.
    """

    def __init__(self, path: Path, camera: Camera | None) -> None:
        with writing(path):
            path.parent.mkdir(parents=True, exist_ok=True)
        self._lines = LineFile(path)
        self._camera = camera or NOMINAL

    def write(self, result: FrameResult) -> None:
        """Append the frame's objects: tracks of a foreground class that are seen.

        Raises:
            ModtError: the file cannot be written.
        """
        tracks = result.tracks
        class_ = tracks.object_class
        rows = np.flatnonzero((tracks.proposal != NONE) & (class_ != ObjectClass.BACKGROUND))
        if not len(rows):
            return
        boxes = result.proposals.box[tracks.proposal[rows]]
        cut = result.proposals.truncated[tracks.proposal[rows]]
        T = self._camera.T_camera_sensor
        foot = transform(T, boxes[:, :3] - np.array([0, 0, 0.5]) * boxes[:, 5:6])
        ahead = np.stack([np.cos(boxes[:, 6]), np.sin(boxes[:, 6]), np.zeros(len(boxes))], axis=1) @ T[:3, :3].T
        turn = np.arctan2(-ahead[:, 2], ahead[:, 0])
        alpha = turn - np.arctan2(foot[:, 0], foot[:, 2])
        alpha = (alpha + np.pi) % (2 * np.pi) - np.pi
        score = tracks.posterior[rows, class_[rows]]
        columns = (
            tracks.id[rows],
            class_[rows],
            cut,
            alpha,
            self._image_boxes(boxes),
            boxes[:, 3:6],
            foot,
            turn,
            score,
        )
        text = "".join(
            f"{result.frame.index} {id_} {NAMES[ObjectClass(kind)]} {int(cut_)} -1 {alpha_:.4f} "
            f"{i[0]:.2f} {i[1]:.2f} {i[2]:.2f} {i[3]:.2f} {lwh[2]:.3f} {lwh[1]:.3f} {lwh[0]:.3f} "
            f"{at[0]:.3f} {at[1]:.3f} {at[2]:.3f} {turn_:.4f} {score_:.6f}\n"
            for id_, kind, cut_, alpha_, i, lwh, at, turn_, score_ in zip(*(c.tolist() for c in columns), strict=True)
        )
        self._lines.write(text)

    def close(self) -> None:
        """No more will come."""
        self._lines.close()

    def _image_boxes(self, boxes: np.ndarray) -> np.ndarray:
        """(n, 4) left, top, right, bottom [pixel]; -1 for what lies behind the camera."""
        ground = corners(boxes)
        z = boxes[:, 2, None] + np.array([-0.5, 0.5]) * boxes[:, 5, None]
        eight = np.concatenate(
            [np.concatenate([ground, np.repeat(z[:, k, None, None], 4, axis=1)], axis=2) for k in (0, 1)], axis=1
        )
        P = self._camera.P_image_sensor
        uvw = eight @ P[:, :3].T + P[:, 3]
        out = np.full((len(boxes), 4), -1.0)
        ahead = (uvw[..., 2] > 0.1).all(axis=1)
        uv = uvw[ahead, :, :2] / uvw[ahead, :, 2:]
        limit = np.array([self._camera.width_px, self._camera.height_px]) - 1
        out[ahead, :2] = np.clip(uv.min(axis=1), 0, limit)
        out[ahead, 2:] = np.clip(uv.max(axis=1), 0, limit)
        return out
