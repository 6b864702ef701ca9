"""A network run by ONNX Runtime on the calling thread."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import Future, TimeoutError
from contextlib import suppress
from functools import cache
from threading import Thread
from typing import Any

import numpy as np

os.environ["ORT_DISABLE_TELEMETRY"] = "1"  # read at its import; else it writes into ~/.cache and looks up a host
import onnxruntime as ort
from onnxruntime.capi import onnxruntime_pybind11_state as ort_errors

from modt.classes import CLASS_NAMES, N_CLASSES, VARIABLE
from modt.classification.onnx_check import find_flaw
from modt.errors import MisuseError
from modt.model_file import REMEDY, ModelFile
from modt.types import Float32

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
CLASSES_KEY = "classes"
"""Key in the metadata of a model with the names of its classes, separated by commas."""
MOST_S = 20.0
"""Longest run of the largest batch at the start [s]. The slowest boards take a tenth of a second."""
MEMORY_BYTES = 1 << 30
"""Limit of the memory for the numbers and the results of all models: no file can take more."""


class Network:
    """Points of proposals to class probabilities.

    Args:
        model: a plain ONNX model of (batch, points, 3) to (batch, C).

    Attributes:
        metadata: texts in the model by their keys.

    Raises:
        MisuseError: the model is none of that.
    """

    def __init__(self, model: ModelFile) -> None:
        flaw = find_flaw(model.content)
        if flaw:
            raise MisuseError(model.path, f"not an ONNX model that is run here ({flaw})", REMEDY)
        self._path = model.path
        _limit_memory()
        try:
            self._session = _session(model.content)
            ends = (*self._session.get_inputs(), *self._session.get_outputs())
            names = [end.name for end in ends]
            shapes = [tuple(end.shape) for end in ends]
            self.metadata: dict[str, str] = self._session.get_modelmeta().custom_metadata_map
        except _MODEL_ERRORS as error:
            raise MisuseError(self._path, f"not an ONNX model ({_first_line(error)})", REMEDY) from None
        table = ",".join(CLASS_NAMES)
        if self.metadata.get(CLASSES_KEY, table) != table:
            cause = f"its classes are {self.metadata[CLASSES_KEY]}, and those of the table {table}"
            raise MisuseError(self._path, cause, f"name the file of its classes in {VARIABLE}")
        if [_fixed(shape) for shape in shapes] != [(None, None, 3), (None, N_CLASSES)]:
            cause = f"inputs and outputs of shape {' and '.join(map(str, shapes))}"
            remedy = f"use a model of (batch, points, 3) to (batch, {N_CLASSES}), the classes {table}"
            raise MisuseError(self._path, cause, remedy)
        self._input = names[0]

    def infer(self, batch: Float32) -> Float32:
        """(b, C) probabilities of (b, n, 3) points in the canonical frame."""
        (output,) = self._session.run(None, {self._input: batch})
        probability: Float32 = output
        return probability

    def check_largest(self, batch: int, points: int) -> None:
        """Run the largest batch, so that the memory it takes is known before the first frame.

        Raises:
            MisuseError: it cannot be run.
        """
        # Points all over a cube: some models answer zeros alone.
        cube = np.linspace(-1.0, 1.0, batch * points * 3, dtype=np.float32).reshape(batch, points, 3)
        # In a thread, since no call of the library ends a node that takes for ever.
        run = Future[Float32]()
        Thread(target=lambda: _fulfil(run, lambda: self.infer(cube)), daemon=True).start()
        try:
            probability = run.result(MOST_S)
        except TimeoutError:
            cause = f"{batch} proposals of {points} points take longer than {MOST_S:g} s"
            raise MisuseError(self._path, cause, "use a smaller model") from None
        except _MODEL_ERRORS as error:
            cause = f"cannot run {batch} proposals of {points} points ({_first_line(error)})"
            raise MisuseError(self._path, cause, f"use a smaller model; it has {MEMORY_BYTES >> 20} MiB") from None
        if probability.shape != (batch, N_CLASSES):
            raise MisuseError(self._path, f"an output of shape {probability.shape}", REMEDY)
        if not ((probability >= 0) & (probability <= 1)).all():
            raise MisuseError(self._path, "its outputs are no probabilities", REMEDY)


def _fulfil(run: Future[Float32], call: Callable[[], Float32]) -> None:
    """Give the result of a call to whoever waits for it, or its error."""
    try:
        run.set_result(call())
    except Exception as error:
        run.set_exception(error)


def _first_line(error: Exception) -> str:
    """First line of an error's message."""
    return str(error).partition("\n")[0]


@cache
def _limit_memory() -> None:
    """Limit the memory that all sessions of this process share."""
    info = ort.OrtMemoryInfo("Cpu", ort.OrtAllocatorType.ORT_ARENA_ALLOCATOR, 0, ort.OrtMemType.DEFAULT)
    automatic = ("arena_extend_strategy", "initial_chunk_size_bytes", "max_dead_bytes_per_chunk")
    arena = ort.OrtArenaCfg({"max_mem": MEMORY_BYTES, **dict.fromkeys(automatic, -1)})
    with suppress(*_MODEL_ERRORS):  # a program that uses the library has registered its own
        ort.create_and_register_allocator(info, arena)


def _session(content: bytes) -> ort.InferenceSession:
    """Session on the calling thread alone: an idle thread pool would spin on the core between frames.

    Constants are not folded: before the first run, some versions do so outside the limit of the memory.
    """
    options = ort.SessionOptions()
    options.intra_op_num_threads = 1
    options.inter_op_num_threads = 1
    options.execution_mode = ort.ExecutionMode.ORT_SEQUENTIAL
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.add_session_config_entry("session.inter_op.allow_spinning", "0")
    options.add_session_config_entry("session.use_env_allocators", "1")
    options.log_severity_level = 4
    plainly: dict[str, Any] = {"disabled_optimizers": ["ConstantFolding"], "enable_fallback": 0}
    return ort.InferenceSession(content, options, providers=["CPUExecutionProvider"], **plainly)


def _fixed(shape: tuple[int | str | None, ...]) -> tuple[int | None, ...]:
    """The shape with None for its dynamic dimensions."""
    return tuple(n if isinstance(n, int) else None for n in shape)
