"""The classifier: a PointNet run by ONNX Runtime on the calling thread (section III-B, sizes of section V-A)."""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

os.environ["ORT_DISABLE_TELEMETRY"] = "1"  # read at its import; else it writes into ~/.cache and looks up a host
import onnxruntime as ort
from onnxruntime.capi import onnxruntime_pybind11_state as ort_errors

from modt import assets
from modt.classes import N_CLASSES
from modt.classification import box_classifier, reflectance_classifier
from modt.classification.crops import batches, canonical, gather, ground_z_m
from modt.classification.pool import log_pool, softmax
from modt.classification.prior import BoxScores
from modt.config import ClassificationConfig, SensorConfig
from modt.errors import MisuseError, refuse_pipe
from modt.types import Float32, Float64, Int, Proposals

MAX_BYTES = 64 << 20
REMEDY = "use a model of tools/train/export_pointnet.py"
_MODEL, _GRAPH, _NODE, _ATTRIBUTE, _TENSOR, _SPARSE = range(6)
_PARTS = {
    _MODEL: {7: _GRAPH},
    _GRAPH: {1: _NODE, 5: _TENSOR, 15: _SPARSE},
    _NODE: {5: _ATTRIBUTE},
    _ATTRIBUTE: {5: _TENSOR, 10: _TENSOR, 22: _SPARSE, 23: _SPARSE},
    _SPARSE: {1: _TENSOR, 2: _TENSOR},
    _TENSOR: {},
}
"""Fields of onnx.proto3 that hold messages, by the message that they are in."""
_REFUSED = {
    _MODEL: {20: "training", 25: "functions"},
    _ATTRIBUTE: {6: "a graph within a node", 9: "text", 11: "a graph within a node"},
    _TENSOR: {6: "text", 13: "numbers in another file"},
}
_SIZES = {(_TENSOR, 1), (_SPARSE, 3)}
"""Fields with the dimensions of a tensor."""
_STRING = 8
"""Type of tensors of text, of which few bytes stand for much memory."""
_VARINT, _EIGHT_BYTES, _BYTES, _FOUR_BYTES = 0, 1, 2, 5


def read_model(path: Path) -> tuple[bytes, str]:
    """Bytes of a model and their SHA-256, equal to that in its card (the file beside it that ends in .md), if any.

    An ONNX model may name other files to load its numbers from, and may hold loops and functions that stand for more
    work than its size tells: such a model is refused before ONNX Runtime sees it.

    Raises:
        MisuseError: unreadable, too large, not the model of its card, or not a plain ONNX model.
    """
    card = path.with_suffix(".md")
    refuse_pipe(path, REMEDY)
    try:
        with path.open("rb") as file:
            raw = file.read(MAX_BYTES + 1)
        named = re.search(r"sha256\W+([0-9a-f]{64})", card.read_text(encoding="utf-8")) if card.is_file() else None
    except (OSError, UnicodeDecodeError) as error:
        raise MisuseError(path, f"cannot be read ({error})", "make model and card readable") from None
    if len(raw) > MAX_BYTES:
        raise MisuseError(path, f"larger than {MAX_BYTES >> 20} MiB", REMEDY)
    sha256 = hashlib.sha256(raw).hexdigest()
    if named and named[1] != sha256:
        raise MisuseError(path, f"is not the model of {card.name} (sha256 {sha256})", "restore the model or its card")
    try:
        flaw = next(_flaws(memoryview(raw)), None)
    except (IndexError, ValueError):
        flaw = "no protocol buffer"
    if flaw:
        raise MisuseError(path, f"not an ONNX model that is run here ({flaw})", REMEDY)
    return raw, sha256


def _flaws(raw: memoryview) -> Iterator[str]:
    """Parts of a model that are refused."""
    waiting = [(_MODEL, raw)]
    while waiting:
        kind, message = waiting.pop()
        numbers, last = 1, dict[int, memoryview | int | None]()
        for number, value in _fields(message):
            last[number] = value & 0xFFFFFFFF if isinstance(value, int) else value
            if number in _REFUSED.get(kind, {}):
                yield _REFUSED[kind][number]
            if (kind, number) in _SIZES and value is not None:
                numbers *= value if isinstance(value, int) else math.prod(_varints(value))
            inner = _PARTS[kind].get(number)
            if inner is not None and isinstance(value, memoryview):
                waiting.append((inner, value))
        label = last.get(1)
        name = bytes(label) if kind == _ATTRIBUTE and isinstance(label, memoryview) else b""
        made = last.get(2) if kind == _TENSOR else last.get(3) if name == b"to" else None
        if made == _STRING or name == b"value_string":
            yield "text"
        if numbers > 2 * len(raw):
            yield "a tensor of more numbers than the file holds"


def _varints(packed: memoryview) -> Iterator[int]:
    """The numbers in a packed field."""
    at = 0
    while at < len(packed):
        number, at = _varint(packed, at)
        yield number


def _fields(message: memoryview) -> Iterator[tuple[int, memoryview | int | None]]:
    """Numbers of the fields of a message, and the bytes or the whole number of each.

    Raises:
        IndexError, ValueError: it is no message.
    """
    at = 0
    while at < len(message):
        key, at = _varint(message, at)
        number, kind = key >> 3, key & 7
        if key >> 32:  # other readers would drop the bits beyond
            raise ValueError("no such field")
        value: memoryview | int | None = None
        if kind == _VARINT:
            value, at = _varint(message, at)
        elif kind == _BYTES:
            length, at = _varint(message, at)
            value = message[at : at + length]
            at += length
        elif kind in (_FOUR_BYTES, _EIGHT_BYTES):
            at += 4 if kind == _FOUR_BYTES else 8
        else:
            raise ValueError("no such kind of field")
        if at > len(message):
            raise ValueError("a field beyond the end")
        yield number, value


def _varint(message: memoryview, at: int) -> tuple[int, int]:
    """A number at a place, and the place after it."""
    out = 0
    for shift in range(0, 70, 7):
        byte = message[at]
        at += 1
        out |= (byte & 0x7F) << shift
        if byte < 0x80:
            return out, at
    raise ValueError("a number without an end")


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

    What the view cuts where a person may go on is judged by the network beside it, NAME-near.onnx, if there is one.

    The cost of a proposal follows its number of points: crops of similar size share a batch, so that padding is
    small, and a batch is small enough for its features to stay in the cache.

    Args:
        config: model and batch size.
        sensor: for the height, where the proposals have none, and the scale of the reflectance.

    Attributes:
        path: model file.
        sha256: its hash, equal to that in its card (the file beside it that ends in .md).
        box_scores: classifiers of boxes, and of reflectance for this sensor.
        class_frequency: (4,) frequencies of the classes that the posteriors assume; a model that states none
            assumes that all are equal.

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
            near = self.path.with_stem(f"{self.path.stem}-near")  # what the view cuts is judged by it
            self._near = _session(near, read_model(near)[0]) if pooled and near.is_file() else None
            beside = self._near.get_modelmeta().custom_metadata_map if self._near else None
            boxes = box_classifier.from_metadata(pooled, beside)
            self.box_scores = BoxScores(boxes, reflectance_classifier.from_metadata(pooled, sensor), sensor)
            self.class_frequency = _class_frequency(metadata)
            self._log_frequency = np.log(self.class_frequency)
        except (ArithmeticError, LookupError, TypeError, ValueError, RecursionError) as error:
            cause = f"malformed box or reflectance classifier ({error})"
            raise MisuseError(self.path, cause, "export the model again") from None
        self._try(config.batch, config.max_points)

    def classify(self, points: Float32, proposals: Proposals, which: Int) -> Float64:
        """(R, 4) class probabilities of the given proposals, in their order.

        Args:
            points: (N, 4) points of the frame; the proposals hold the coordinates of theirs.
            proposals: proposals of the frame.
            which: (R,) proposals to classify.
        """
        crops = gather(proposals, which, self.config.max_points)
        crops = canonical(crops, ground_z_m(proposals, which, self._sensor))
        count, out = crops.count, np.empty((len(crops), N_CLASSES))
        by_size = count.argsort(kind="stable")
        near = self.box_scores.bound(proposals)[which[by_size]] if self._near else np.zeros(len(crops), np.bool_)
        for session, own in ((self._session, by_size[~near]), (self._near, by_size[near])):
            for batch in batches(count[own].tolist(), self.config.batch):
                rows = own[batch]
                out[rows] = self.infer(crops.padded(rows, self.config.min_points), session)
        return self._pooled(out, proposals, which)

    def _pooled(self, network: Float64, proposals: Proposals, which: Int) -> Float64:
        """(R, 4) P(class | points, box, reflectance)."""
        if not self.box_scores.informative:
            return network
        boxes, reflectance = (scores.take(which, axis=0) for scores in self.box_scores.of(proposals))
        weights = self.box_scores.weights
        return softmax(log_pool(network, boxes, reflectance, self._log_frequency, weights))

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

    def infer(self, batch: Float32, session: ort.InferenceSession | None = None) -> Float32:
        """(b, 4) output of a (b, n, 3) canonical batch, of the network or of that beside it."""
        (output,) = (session or self._session).run(None, {self._input: batch})
        probability: Float32 = output
        return probability


def _first_line(error: Exception) -> str:
    """First line of an error's message, or its type if it has no message."""
    return next(iter(str(error).splitlines()), type(error).__name__)


@cache
def _limit_memory() -> None:
    """Limit the memory that all sessions of this process share."""
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


def _class_frequency(metadata: Mapping[str, str]) -> Float64:
    text = metadata.get(CLASS_FREQUENCY_KEY)
    if text is None:
        return np.full(N_CLASSES, 1 / N_CLASSES)
    frequency = np.array([float(share) for share in json.loads(text)])
    if len(frequency) != N_CLASSES or not frequency.min() > 0 or not frequency[1:].sum() < 1:
        raise ValueError(f"class frequency {text}")
    return np.append(1.0 - frequency[1:].sum(), frequency[1:])


def _fits(shape: tuple[int | str | None, ...], wanted: tuple[int | None, ...]) -> bool:
    """Whether the fixed dimensions agree and the others (None) are dynamic."""
    return tuple(n if isinstance(n, int) else None for n in shape) == wanted
