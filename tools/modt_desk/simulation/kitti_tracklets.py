"""KITTI's tracklet file: poses of the annotated bodies, frame by frame."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from modt.geometry import FieldOfView
from modt_desk.simulation.simulator import Truth

HEADER = """<?xml version="1.0" encoding="UTF-8" standalone="yes" ?>
<!DOCTYPE boost_serialization>
<boost_serialization signature="serialization::archive" version="9">
<tracklets class_id="0" tracking_level="0" version="0">
"""
VISIBLE, LARGELY_OCCLUDED = 0, 2
MIN_VISIBLE_POINTS = 20
"""Bodies of fewer points are annotated as largely occluded."""


@dataclass
class _Track:
    kind: str
    size: tuple[float, float, float]
    poses: dict[int, tuple[float, float, float, float, int, int]] = field(default_factory=dict)
    last_seen: int = 0


class Tracklets:
    """Tracklets of a drive; a tracklet runs from the first frame with points of the body in view to the last."""

    def __init__(self, fov: FieldOfView) -> None:
        self.fov = fov
        self._tracks: dict[int, _Track] = {}

    def add(self, frame: int, truth: Truth) -> None:
        """Add the truth of one frame."""
        inside = self.fov.depth(truth.boxes[:, :3])
        for row, (body, kind) in enumerate(zip(truth.bodies.tolist(), truth.kinds, strict=True)):
            x, y, z, length, width, height, yaw = truth.boxes[row].tolist()
            shown = inside[row] > 0 and truth.points[row] > 0
            if body not in self._tracks:
                if not shown:
                    continue
                self._tracks[body] = _Track(kind.name, (height, width, length))
            track = self._tracks[body]
            hidden = LARGELY_OCCLUDED if truth.points[row] < MIN_VISIBLE_POINTS else VISIBLE
            truncated = 1 if abs(inside[row]) < length / 2 else 0
            track.poses[frame] = (x, y, z - height / 2, yaw, hidden, truncated)
            if shown:
                track.last_seen = frame

    def write(self, path: Path) -> None:
        """Write tracklet_labels.xml."""
        path.write_text("".join(self._lines()), encoding="ascii")

    def _lines(self) -> Iterator[str]:
        yield HEADER
        yield _elements(1, count=len(self._tracks), item_version=1)
        for track in self._tracks.values():
            poses = [(f, p) for f, p in sorted(track.poses.items()) if f <= track.last_seen]
            height, width, length = track.size
            yield "\t<item>\n"
            yield _elements(2, objectType=track.kind, h=f"{height:.6f}", w=f"{width:.6f}", l=f"{length:.6f}")
            yield _elements(2, first_frame=poses[0][0]) + "\t\t<poses>\n"
            yield _elements(3, count=len(poses), item_version=2)
            for _, (x, y, z, yaw, occlusion, truncation) in poses:
                yield "\t\t\t<item>\n"
                yield _elements(4, tx=f"{x:.9f}", ty=f"{y:.9f}", tz=f"{z:.9f}", rx=0, ry=0, rz=f"{yaw:.9f}", state=2)
                yield _elements(4, occlusion=occlusion, occlusion_kf=0, truncation=truncation)
                yield _elements(4, amt_occlusion=-1, amt_occlusion_kf=-1)
                yield _elements(4, amt_border_l=-1, amt_border_r=-1, amt_border_kf=-1)
                yield "\t\t\t</item>\n"
            yield "\t\t</poses>\n\t\t<finished>1</finished>\n\t</item>\n"
        yield "</tracklets>\n</boost_serialization>\n"


def _elements(depth: int, **texts: object) -> str:
    """XML elements of a name and a text, indented."""
    return "".join("\t" * depth + f"<{name}>{text}</{name}>\n" for name, text in texts.items())
