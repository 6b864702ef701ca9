"""KITTI tracking results in camera coordinates, and point labels in SemanticKITTI's format."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from modt.classes import CLASSES, ObjectClass
from modt.geometry import Camera, corners, transform, wrap
from modt.placement import Mount
from modt.sinks.output import LineFile, Writer, without_links, writing
from modt.types import NONE, Cut, Float64, FrameResult

KITTI_TYPES = [spec.kitti[0] if spec.kitti else "" for spec in CLASSES]

NO_CAMERA = Camera(
    P_image_sensor=np.zeros((3, 4)),
    T_camera_sensor=np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]),
    width_px=0.0,
    height_px=0.0,
)
"""Camera axes at the origin of the sensor, without an image."""


class KittiResults(LineFile[FrameResult]):
    """Writes kitti/NNNN.txt: frame, id, type, image box, size, position, heading, score.

    Without a camera, coordinates are camera axes at the sensor's origin, and image boxes are -1.
    """

    def __init__(self, path: Path, camera: Camera | None) -> None:
        with writing(path):
            path.parent.mkdir(parents=True, exist_ok=True)
        super().__init__(path, self._rows)
        self._camera = camera or NO_CAMERA

    def _rows(self, result: FrameResult) -> str:
        """Rows of the frame's objects: tracks of a foreground class that have a proposal."""
        tracks = result.tracks
        class_ = tracks.object_class
        rows = np.flatnonzero((tracks.proposal != NONE) & (class_ != ObjectClass.BACKGROUND))
        if not len(rows):
            return ""
        boxes = result.proposals.box[tracks.proposal[rows]]
        truncated = ((result.proposals.cut[tracks.proposal[rows]] & Cut.SIDE) > 0).astype(np.int64)
        camera = Mount(result.frame.R_level_sensor).camera(self._camera)
        T = camera.T_camera_sensor
        bottom = transform(T, boxes[:, :3] - np.array([0, 0, 0.5]) * boxes[:, 5:6])
        ahead = np.stack([np.cos(boxes[:, 6]), np.sin(boxes[:, 6]), np.zeros(len(boxes))], axis=1) @ T[:3, :3].T
        ry = np.arctan2(-ahead[:, 2], ahead[:, 0])
        alpha = wrap(ry - np.arctan2(bottom[:, 0], bottom[:, 2]))
        score = tracks.posterior[rows, class_[rows]]
        image_box = _image_boxes(boxes, camera)
        columns = (
            *(tracks.id[rows], class_[rows], truncated, alpha),
            *(*image_box.T, *boxes[:, 3:6].T, *bottom.T),
            *(ry, score),
        )
        return "".join(
            f"{result.frame.index} {id_} {KITTI_TYPES[kind]} {cut} -1 {angle:.4f} "
            f"{left:.2f} {top:.2f} {right:.2f} {low:.2f} {height:.3f} {width:.3f} {length:.3f} "
            f"{x:.3f} {y:.3f} {z:.3f} {turned:.4f} {p:.6f}\n"
            for id_, kind, cut, angle, left, top, right, low, length, width, height, x, y, z, turned, p in zip(
                *(column.tolist() for column in columns), strict=True
            )
        )


def _image_boxes(boxes: Float64, camera: Camera) -> Float64:
    """(n, 4) left, top, right, bottom [pixel], or -1 for boxes behind the camera."""
    z = boxes[:, 2, None] + np.array([-0.5, 0.5]) * boxes[:, 5, None]
    xyz = np.dstack([corners(boxes).repeat(2, axis=1), np.tile(z, 4)])
    P = camera.P_image_sensor
    uvw = xyz @ P[:, :3].T + P[:, 3]
    out = np.full((len(boxes), 4), -1.0)
    ahead = (uvw[..., 2] > 0.1).all(axis=1)
    uv = uvw[ahead, :, :2] / uvw[ahead, :, 2:]
    limit = np.array([camera.width_px, camera.height_px]) - 1
    out[ahead, :2] = np.clip(uv.min(axis=1), 0, limit)
    out[ahead, 2:] = np.clip(uv.max(axis=1), 0, limit)
    return out


MAX_INSTANCE = 0xFFFF
"""Greatest number of a proposal in the upper half of a label."""


class PointLabels(Writer[FrameResult]):
    """Writes NNNNNN.label, one u32 per point in the order of the input scan.

    Upper 16 bits: index of the proposal in the frame plus one, 0 for none. Lower 16 bits: class of its track.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        with writing(folder):
            folder.mkdir(parents=True, exist_ok=True)

    def write(self, result: FrameResult, /) -> None:
        """Write one frame's file.

        Raises:
            ModtError: the file cannot be written.
        """
        path = self._folder / f"{result.frame.index:06d}.label"
        with writing(path), open(path, "wb", opener=without_links) as file:
            file.write(encode(result).tobytes())


def encode(result: FrameResult) -> np.ndarray[tuple[int], np.dtype[np.uint32]]:
    """(N,) label of each point of the frame."""
    row_of_proposal = result.tracks.row_of_proposal(len(result.proposals))
    tracked = row_of_proposal != NONE
    class_of_proposal = np.zeros(len(tracked), np.int64)
    class_of_proposal[tracked] = result.tracks.object_class[row_of_proposal[tracked]]
    instance = np.minimum(np.arange(len(tracked)) + 1, MAX_INSTANCE)
    label_of_proposal = (instance << 16) | class_of_proposal
    proposal_of_point = result.proposals.label(len(result.frame.points))
    inside = proposal_of_point != NONE
    labels = np.zeros(len(inside), np.uint32)
    labels[inside] = label_of_proposal[proposal_of_point[inside]]
    return labels
