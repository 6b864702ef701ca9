"""KITTI's tracklet file: poses of the annotated bodies, frame by frame."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from modt.geometry import FieldOfView
from modt.simulation.simulator import Truth

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
        yield f"\t<count>{len(self._tracks)}</count>\n\t<item_version>1</item_version>\n"
        for track in self._tracks.values():
            poses = [(f, p) for f, p in sorted(track.poses.items()) if f <= track.last_seen]
            height, width, length = track.size
            yield f"\t<item>\n\t\t<objectType>{track.kind}</objectType>\n"
            yield f"\t\t<h>{height:.6f}</h>\n\t\t<w>{width:.6f}</w>\n\t\t<l>{length:.6f}</l>\n"
            yield f"\t\t<first_frame>{poses[0][0]}</first_frame>\n"
            yield f"\t\t<poses>\n\t\t\t<count>{len(poses)}</count>\n\t\t\t<item_version>2</item_version>\n"
            for _, (x, y, z, yaw, occlusion, truncation) in poses:
                yield f"\t\t\t<item>\n\t\t\t\t<tx>{x:.9f}</tx>\n\t\t\t\t<ty>{y:.9f}</ty>\n\t\t\t\t<tz>{z:.9f}</tz>\n"
                yield "\t\t\t\t<rx>0</rx>\n\t\t\t\t<ry>0</ry>\n"
                yield f"\t\t\t\t<rz>{yaw:.9f}</rz>\n\t\t\t\t<state>2</state>\n"
                yield f"\t\t\t\t<occlusion>{occlusion}</occlusion>\n\t\t\t\t<occlusion_kf>0</occlusion_kf>\n"
                yield f"\t\t\t\t<truncation>{truncation}</truncation>\n\t\t\t\t<amt_occlusion>-1</amt_occlusion>\n"
                yield "\t\t\t\t<amt_occlusion_kf>-1</amt_occlusion_kf>\n\t\t\t\t<amt_border_l>-1</amt_border_l>\n"
                yield "\t\t\t\t<amt_border_r>-1</amt_border_r>\n"
                yield "\t\t\t\t<amt_border_kf>-1</amt_border_kf>\n\t\t\t</item>\n"
            yield "\t\t</poses>\n\t\t<finished>1</finished>\n\t</item>\n"
        yield "</tracklets>\n</boost_serialization>\n"
