"""The classifier: a PointNet run by ONNX Runtime on the calling thread (section III-B, sizes of section V-A)."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

import numpy as np
import onnxruntime as ort
from onnxruntime.capi import onnxruntime_pybind11_state as ort_errors
from scipy.special import softmax

from modt import assets
from modt.classes import N_CLASSES
from modt.classification.box_classifier import N_FEATURES, Boxes, boxes_of, described
from modt.classification.crops import canonical, gather, height_of
from modt.classification.prior import share_of
from modt.classification.reflectance_classifier import Evidence, evidence_of
from modt.config import ClassificationConfig, SensorConfig
from modt.errors import MisuseError
from modt.types import Float32, Float64, Int, Proposals

_UNUSABLE = (
    ort_errors.Fail,
    ort_errors.InvalidArgument,
    ort_errors.InvalidGraph,
    ort_errors.InvalidProtobuf,
    ort_errors.ModelLoaded,
    ort_errors.NotImplemented,
    ort_errors.RuntimeException,
)


_LEAST_PROBABILITY = 1e-12


class PointNet:
    """P(class | points, box, reflectance) of proposals: a pool of the network and of what the model knows besides.

    A proposal costs what its own points cost: crops of like size share a call, so that little is padded, and a
    call is small enough for its features to stay in the cache.

    Args:
        config: the model and the sizes of a call.
        sensor: how high it stands, for proposals that do not say.

    Attributes:
        path: the model file.
        sha256: its hash, which its card (the file beside it that ends in .md) must name.
        boxes: what the model knows of boxes.
        evidence: what it makes of the returns' reflectance.

    Raises:
        MisuseError: no such model, not the one that its card describes, no ONNX, not (batch, points, 3) to
            (batch, 4), or with knowledge of boxes or reflectance that cannot be used.
    """

    def __init__(self, config: ClassificationConfig, sensor: SensorConfig) -> None:
        self.config = config
        self._sensor = sensor
        self.path = assets.find("models", config.model, ".onnx")
        self.sha256 = _checked_hash(self.path)
        self._session = _session(self.path)
        self._input = self._session.get_inputs()[0].name
        self.boxes, self.evidence = self._brought_along()

    def classify(self, points: Float32, proposals: Proposals, which: Int) -> Float64:
        """(R, 4) probability of each class for each of the proposals given, in their order.

        Args:
            points: (N, 4) of the frame.
            proposals: its segments.
            which: (R,) those to classify.
        """
        crops = gather(points, proposals, which, self.config.max_points)
        crops = canonical(crops, height_of(proposals, self._sensor))
        out = np.empty((len(crops), N_CLASSES))
        by_size = np.argsort(crops.count, kind="stable")
        for first in range(0, len(crops), self.config.batch):
            rows = by_size[first : first + self.config.batch]
            out[rows] = self.infer(crops.padded(rows))
        return self._pooled(out, proposals, which)

    def _pooled(self, said: Float64, proposals: Proposals, which: Int) -> Float64:
        """(R, 4) log-linear pool of what the network says of the shape, the box says, and the reflectance adds."""
        share, weight = share_of(self.boxes, self.evidence), self.evidence.weight
        if not share and not weight:
            return said
        feature = described(proposals, which, self._sensor)
        told = None if proposals.reflectance is None else proposals.reflectance[which]
        score = (1.0 - share) * np.log(np.maximum(said, _LEAST_PROBABILITY))
        score += share * self.boxes.of(feature) + weight * self.evidence.of(feature, told)
        probability: Float64 = softmax(score, axis=1)
        return probability

    def _brought_along(self) -> tuple[Boxes, Evidence]:
        metadata: dict[str, str] = self._session.get_modelmeta().custom_metadata_map
        try:
            return boxes_of(metadata), evidence_of(metadata, N_FEATURES, self._sensor)
        except (KeyError, TypeError, ValueError) as error:
            cause = f"what it knows of boxes and reflectance cannot be used ({error})"
            raise MisuseError(self.path, cause, "export the model again") from None

    def facts(self) -> dict[str, str]:
        """The model's file and hash, for the record of a run."""
        return {"file": self.path.name, "sha256": self.sha256}

    def infer(self, batch: Float32) -> Float32:
        """(b, 4) network output of a (b, n, 3) canonical batch."""
        (output,) = self._session.run(None, {self._input: batch})
        probability: Float32 = output
        return probability


def _session(path: Path) -> ort.InferenceSession:
    """A session that uses the calling thread alone: a waiting thread pool would burn the core between frames."""
    options = ort.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.execution_mode = ort.ExecutionMode.ORT_SEQUENTIAL
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.add_session_config_entry("session.inter_op.allow_spinning", "0")
    options.log_severity_level = 4
    try:
        session = ort.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except _UNUSABLE as error:
        cause = str(error).splitlines()[0]
        raise MisuseError(
            path, f"no ONNX model ({cause})", "give one made by tools/train/export_pointnet.py"
        ) from None
    shapes = [tuple(end.shape) for end in (*session.get_inputs(), *session.get_outputs())]
    if len(shapes) != 2 or not _fits(shapes[0], (None, None, 3)) or not _fits(shapes[1], (None, N_CLASSES)):
        raise MisuseError(
            path,
            f"takes and gives {' and '.join(map(str, shapes))}",
            f"give a model of (batch, points, 3) to (batch, {N_CLASSES})",
        )
    return session


def _fits(shape: tuple[int | str | None, ...], wanted: tuple[int | None, ...]) -> bool:
    return len(shape) == len(wanted) and all(
        a == b if b is not None else not isinstance(a, int) for a, b in zip(shape, wanted, strict=True)
    )


def _checked_hash(path: Path) -> str:
    try:
        sha256 = hashlib.sha256(path.read_bytes()).hexdigest()
        card = path.with_suffix(".md")
        named = re.search(r"sha256\W+([0-9a-f]{64})", card.read_text(encoding="utf-8")) if card.is_file() else None
    except (OSError, UnicodeDecodeError) as error:
        raise MisuseError(path, f"cannot be read ({error})", "make model and card readable") from None
    if named and named[1] != sha256:
        raise MisuseError(path, f"is not the model of {card.name} (sha256 {sha256})", "restore the model or its card")
    return sha256
