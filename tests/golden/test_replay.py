"""Behaviour of each mode against its golden replay."""

import json
from functools import cache

import numpy as np
import pytest

from modt.app import assembly

from . import replay

each_mode = pytest.mark.parametrize("mode", assembly.MODES)


@cache
def results(mode):
    return list(replay.replay(mode))


@each_mode
def test_behaviour_is_golden(mode):
    """Counts, states and classes are equal; boxes are equal to a millimetre and a milliradian."""
    expected = [json.loads(line) for line in replay.path(mode).read_text().splitlines()]
    found = [replay.summary(result) for result in results(mode)]
    assert len(found) == len(expected)
    for got, want in zip(found, expected, strict=True):
        boxes = want.pop("box")
        box_sum = want.pop("box_sum")
        assert got.pop("box") == {id_: pytest.approx(box, abs=1) for id_, box in boxes.items()}
        assert got.pop("box_sum") == pytest.approx(box_sum, abs=max(1, want["proposals"]))
        assert got == want


@each_mode
def test_what_is_final_is_what_the_state_machine_says(mode):
    machine = assembly.MODES[mode].machine
    for result in results(mode):
        np.testing.assert_array_equal(result.tracks.final, machine.final[result.tracks.state])
        assert result.state_names == machine.names
