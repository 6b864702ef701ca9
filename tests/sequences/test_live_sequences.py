"""The promises of the live inputs, under a few sequences; `python -m tools.sequences --live` makes many."""

from __future__ import annotations

import pytest
from hypothesis import Phase, settings

pytest.importorskip("velodyne_decoder", reason="needs the extra [velodyne]")
from tests.sequences.live_machine import LiveSequences

TestLiveSequences = pytest.mark.slow(LiveSequences.TestCase)
TestLiveSequences.settings = settings(
    max_examples=15, stateful_step_count=12, phases=(Phase.generate,), derandomize=True
)
