"""The classifier: a PointNet run by ONNX Runtime on the calling thread (section III-B, sizes of section V-A)."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import softmax

os.environ["ORT_DISABLE_TELEMETRY"] = "1"  # read at its import; else it writes into ~/.cache and looks up a host
import onnxruntime as ort
from onnxruntime.capi import onnxruntime_pybind11_state as ort_errors

from modt import assets
from modt.classes import N_CLASSES
from modt.classification import box_classifier, reflectance_classifier
from modt.classification.box_scores import BoxScores
from modt.classification.crops import canonical, gather, ground_z_m
from modt.classification.model_file import REMEDY, read_model
from modt.classification.pool import log_pool
from modt.classification.prior import with_background
from modt.config import ClassificationConfig, SensorConfig
from modt.errors import MisuseError
from modt.types import Float32, Float64, Int, Proposals

_MODEL_ERRORS = (
    ort_errors.Fail,
    ort_errors.InvalidArgument,
    ort_errors.InvalidGraph,
    ort_errors.InvalidProtobuf,
    ort_errors.ModelLoaded,
    ort_errors.NotImplemented,
    ort_errors.RuntimeException,
    UnicodeDecodeError,  # of its names
)
MEMORY_BYTES = 1 << 30
"""For the numbers and the results of a model: no file can take more."""
CLASS_FREQUENCY_KEY = "class_frequency"
"""Key of the class frequency in the metadata of a model: (4,), background first."""


class PointNet:
    """P(class | points, box, reflectance): log-linear pool of the network and the classifiers in its metadata.

    The cost of a proposal follows its number of points: crops of similar size share a batch, so that padding is
    small, and a batch is small enough for its features to stay in the cache.

    Args:
        config: model and batch size.
        sensor: for the height, where the proposals have none, and the scale of the reflectance.

    Attributes:
        path: model file.
        sha256: its hash, equal to that in its card (the file beside it that ends in .md).
        box_scores: of its box classifier, and of its reflectance classifier for this sensor.
        class_frequency: of the objects' classes among proposals, which the posteriors assume; None where not stated.

    Raises:
        MisuseError: no such model, a hash that differs from the card's, not plain ONNX, not (batch, points, 3) to
            (batch, 4), more memory than MEMORY_BYTES, or malformed metadata.
    """

    def __init__(self, config: ClassificationConfig, sensor: SensorConfig) -> None:
        self.config = config
        self._sensor = sensor
        self.path = assets.find("models", config.model, ".onnx")
        raw, self.sha256 = read_model(self.path)
        self._session = _session(self.path, raw)
        self._input = self._session.get_inputs()[0].name
        metadata: dict[str, str] = self._session.get_modelmeta().custom_metadata_map
        pooled = metadata if config.likelihood == "pooled" else {}
        try:
            boxes = box_classifier.from_metadata(pooled)
            self.box_scores = BoxScores(boxes, reflectance_classifier.from_metadata(pooled, sensor), sensor)
            self.class_frequency = _class_frequency(metadata)
            objects = self.class_frequency or (1 / N_CLASSES,) * (N_CLASSES - 1)
            self._log_frequency = np.log(with_background(objects))
        except (ArithmeticError, LookupError, TypeError, ValueError, RecursionError) as error:
            cause = f"malformed box or reflectance classifier ({error})"
            raise MisuseError(self.path, cause, "export the model again") from None
        self._try(config.batch, config.max_points)

    def classify(self, points: Float32, proposals: Proposals, which: Int) -> Float64:
        """(R, 4) class probabilities of the given proposals, in their order.

        Args:
            points: (N, 4) of the frame.
            proposals: of the frame.
            which: (R,) proposals to classify.
        """
        crops = gather(points, proposals, which, self.config.max_points)
        crops = canonical(crops, ground_z_m(proposals, which, self._sensor))
        out = np.empty((len(crops), N_CLASSES))
        by_size = crops.count.argsort(kind="stable")
        for first in range(0, len(crops), self.config.batch):
            rows = by_size[first : first + self.config.batch]
            out[rows] = self.infer(crops.padded(rows, self.config.min_points))
        return self._pooled(out, proposals, which)

    def _pooled(self, network: Float64, proposals: Proposals, which: Int) -> Float64:
        """(R, 4) P(class | points, box, reflectance)."""
        if not self.box_scores.informative:
            return network
        boxes, reflectance = self.box_scores.of(proposals).take(which, axis=1)
        weights = self.box_scores.weights
        probability: Float64 = softmax(log_pool(network, boxes, reflectance, self._log_frequency, weights), axis=1)
        return probability

    def facts(self) -> dict[str, str]:
        """File and hash of the model, for the record of a run."""
        return {"file": self.path.name, "sha256": self.sha256}

    def _try(self, batch: int, points: int) -> None:
        """Run the largest batch: what it takes is known before the first frame.

        Raises:
            MisuseError: it cannot be run.
        """
        try:
            shape = self.infer(np.zeros((batch, points, 3), np.float32)).shape
        except _MODEL_ERRORS as error:
            cause = f"cannot run {batch} proposals of {points} points ({_first_line(error)})"
            raise MisuseError(self.path, cause, f"use a smaller model; it has {MEMORY_BYTES >> 20} MiB") from None
        if shape != (batch, N_CLASSES):
            raise MisuseError(self.path, f"an output of shape {shape}", REMEDY)

    def infer(self, batch: Float32) -> Float32:
        """(b, 4) network output of a (b, n, 3) canonical batch."""
        (output,) = self._session.run(None, {self._input: batch})
        probability: Float32 = output
        return probability


def _first_line(error: Exception) -> str:
    """Of its message, or its kind where it has none."""
    return next(iter(str(error).splitlines()), type(error).__name__)


@cache
def _limit_memory() -> None:
    """Of all sessions of this process together."""
    info = ort.OrtMemoryInfo("Cpu", ort.OrtAllocatorType.ORT_ARENA_ALLOCATOR, 0, ort.OrtMemType.DEFAULT)
    automatic = ("arena_extend_strategy", "initial_chunk_size_bytes", "max_dead_bytes_per_chunk")
    arena = ort.OrtArenaCfg({"max_mem": MEMORY_BYTES, **dict.fromkeys(automatic, -1)})
    with suppress(*_MODEL_ERRORS):  # a program that uses the library has registered its own
        ort.create_and_register_allocator(info, arena)


def _session(path: Path, raw: bytes) -> ort.InferenceSession:
    """Session on the calling thread alone: an idle thread pool would spin on the core between frames.

    Constants are not folded: before the first run, some versions do so outside the limit of the memory.
    """
    _limit_memory()
    options = ort.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.execution_mode = ort.ExecutionMode.ORT_SEQUENTIAL
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.add_session_config_entry("session.inter_op.allow_spinning", "0")
    options.add_session_config_entry("session.use_env_allocators", "1")
    options.log_severity_level = 4
    plainly: dict[str, Any] = {"disabled_optimizers": ["ConstantFolding"], "enable_fallback": 0}
    try:
        session = ort.InferenceSession(raw, options, providers=["CPUExecutionProvider"], **plainly)
        ends = [(end.name, tuple(end.shape)) for end in (*session.get_inputs(), *session.get_outputs())]
        session.get_modelmeta()
    except _MODEL_ERRORS as error:
        cause = f"not an ONNX model ({_first_line(error)})"
        raise MisuseError(path, cause, REMEDY) from None
    shapes = [shape for _, shape in ends]
    if len(shapes) != 2 or not _fits(shapes[0], (None, None, 3)) or not _fits(shapes[1], (None, N_CLASSES)):
        cause = f"inputs and outputs of shape {' and '.join(map(str, shapes))}"
        raise MisuseError(path, cause, f"use a model of (batch, points, 3) to (batch, {N_CLASSES})")
    return session


def _class_frequency(metadata: Mapping[str, str]) -> tuple[float, ...] | None:
    text = metadata.get(CLASS_FREQUENCY_KEY)
    if text is None:
        return None
    frequency = tuple(float(share) for share in json.loads(text))
    if len(frequency) != N_CLASSES or min(frequency) <= 0 or not sum(frequency[1:]) < 1:  # nor NaN
        raise ValueError(f"class frequency {text}")
    return frequency[1:]


def _fits(shape: tuple[int | str | None, ...], wanted: tuple[int | None, ...]) -> bool:
    """Whether the fixed dimensions agree and the others (None) are dynamic."""
    return tuple(n if isinstance(n, int) else None for n in shape) == wanted
