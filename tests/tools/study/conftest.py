"""Fixtures of the studies."""

import pytest

from modt.sources.synthetic_stream import SyntheticStream


@pytest.fixture(scope="module", name="crossing")
def small_crossing():
    """Pedestrians, cyclists and cars, with a 16-beam sensor."""
    return SyntheticStream("crossing", "vlp-16", 3.0, seed=1)
