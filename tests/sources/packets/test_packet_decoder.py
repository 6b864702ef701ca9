"""What a decoder needs that is not installed."""

import sys

import pytest

from modt.errors import MisuseError
from modt.sources.packets.ouster import OusterDecoder
from modt.sources.packets.velodyne import VelodyneDecoder


def test_a_missing_extra_is_named(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "velodyne_decoder", None)
    monkeypatch.setitem(sys.modules, "ouster.sdk.core", None)
    with pytest.raises(MisuseError, match=r"pip install '\.\[velodyne\]'"):
        VelodyneDecoder("sensor")
    with pytest.raises(MisuseError, match=r"pip install '\.\[ouster\]'"):
        OusterDecoder("sensor", tmp_path / "metadata.json")
