"""Streams that a request names."""

import pytest

from modt.app import inputs
from modt.errors import MisuseError


def test_without_a_recording_and_a_built_in_stream_the_remedy_is_named(monkeypatch):
    monkeypatch.setattr(inputs, "entry_points", lambda **_: ())
    with pytest.raises(MisuseError, match="none is built in here; give one"):
        inputs.stream(inputs.Request())
