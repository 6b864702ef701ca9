"""Behaviour against the golden replays."""

import json

import pytest

from . import replay

TOLERANCE = 2
"""Counts that may differ where another processor rounds another way; births and classes follow from proposals."""


@pytest.mark.parametrize(("scene", "mode"), replay.CASES)
def test_behaviour_is_golden(scene, mode):
    expected = [json.loads(line) for line in replay.path(scene, mode).read_text().splitlines()]
    found = replay.behaviour(scene, mode)
    assert len(found) == len(expected)
    for got, want in zip(found, expected, strict=True):
        assert got["frame"] == want["frame"]
        for key in ("proposals", "classifications", "deferred", "born", "lost", "final"):
            assert abs(got[key] - want[key]) <= TOLERANCE, f"frame {want['frame']}: {key} {got[key]}, was {want[key]}"
        assert got["classes"].keys() == want["classes"].keys()
        for name, count in want["classes"].items():
            assert abs(got["classes"][name] - count) <= TOLERANCE, f"frame {want['frame']}: {name}"
