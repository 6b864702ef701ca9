"""Inputs of a running robot: sweeps with any values, and requests for its page."""

import ctypes
from io import BytesIO
from types import SimpleNamespace

import numpy as np
import pytest

from modt.config import SegmentationConfig, SensorConfig
from modt.geometry import FieldOfView
from modt.native import build
from modt.segmentation.kernels import NUMPY
from modt.segmentation.native_kernels import NativeKernels
from modt.segmentation.segmenter import Segmenter
from modt.viewer.live_server import _Handler
from tests.fuzz.target import target
from tests.segmentation.test_native_kernels import HOSTILE, same, street


@target()
def sweeps(folder):
    """Sweeps of x, y, z and reflectance in single precision, by the checked compiled kernels and by NumPy's."""
    library = folder / "kernels.so"
    try:
        build.compile_library(library, build.BASELINE, flags=build.CHECKED)
    except build.NoCompilerError as error:
        pytest.skip(str(error))
    kernels = NUMPY, NativeKernels(ctypes.CDLL(str(library)), build.BASELINE)
    numpy, native = (Segmenter(SegmentationConfig(), SensorConfig(), FieldOfView(), each) for each in kernels)

    def call(raw):
        points = np.frombuffer(raw[: len(raw) // 16 * 16], np.float32).reshape(-1, 4)
        assert same(numpy.segment(points.copy()), native.segment(points.copy())), "the kernels differ"

    plain = street(1, 200)
    plain[:60, :3] = np.random.default_rng(2).normal((8, 3, -1), 0.4, (60, 3))
    hostile = plain.copy()
    hostile[: len(HOSTILE), 0] = hostile[60 : 60 + len(HOSTILE), 2] = HOSTILE
    return [plain.tobytes(), hostile.tobytes()], call


class Connection:
    """A socket of a client that has sent something and takes anything."""

    def __init__(self, sent):
        self._sent = sent

    def makefile(self, *_):
        return BytesIO(self._sent)

    def settimeout(self, _): ...

    def sendall(self, _): ...


@target()
def requests(_):
    """Requests to the live page."""
    events = {"enter": lambda: 0, "event_after": lambda number: None, "leave": lambda: None}
    server = SimpleNamespace(page=b"<p>", names={"localhost", "127.0.0.1"}, **events)
    heads = ("GET / HTTP/1.1", "GET /events HTTP/1.0", "GET /favicon.ico HTTP/1.1", "POST /x HTTP/1.1", "GET /")
    seeds = [f"{head}\r\nHost: localhost:8766\r\nConnection: keep-alive\r\n\r\n".encode() for head in heads]
    return seeds, lambda raw: _Handler(Connection(raw), ("127.0.0.1", 9), server)
