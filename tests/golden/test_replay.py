"""Behaviour against the golden replays."""

from functools import cache

import numpy as np
import pytest

from modt.app import assembly

from . import replay

each_case = pytest.mark.parametrize(("scene", "mode"), replay.CASES)


@cache
def results(scene, mode):
    return list(replay.replay(scene, mode))


@each_case
def test_behaviour_is_golden(scene, mode):
    expected = replay.read(scene, mode)
    found = [replay.summary(result) for result in results(scene, mode)]
    assert len(found) == len(expected)
    for got, want in zip(found, expected, strict=True):
        assert replay.differences(got, want) == [], f"frame {want['frame']}"


@each_case
def test_what_is_final_is_what_the_state_machine_says(scene, mode):
    machine = assembly.MODES[mode].machine
    for result in results(scene, mode):
        np.testing.assert_array_equal(result.tracks.final, machine.final[result.tracks.state])
        assert result.state_names == machine.names


def test_a_changed_number_is_noticed_and_a_millimetre_of_a_box_tolerated():
    frame = next(f for f in replay.read(*replay.CASES[-1]) if f["box"])
    counts = {key: value for key, value in frame.items() if key not in ("box", "box_sum")}
    for key, value in counts.items():
        other = value + 1 if isinstance(value, int) else value[::-1] + value[:1]
        assert replay.differences(frame | {key: other}, frame) == [key]
    (id_, (x, *rest)), *_ = frame["box"].items()
    for by, noticed in ((1, []), (2, [f"box of {id_}"]), (10**6, [f"box of {id_}"])):
        assert replay.differences(frame | {"box": frame["box"] | {id_: [x + by, *rest]}}, frame) == noticed
    assert replay.differences(frame | {"box": {}}, frame) == ["box"]
    *most, yaw = frame["box_sum"]
    assert replay.differences(frame | {"box_sum": [*most, yaw + frame["proposals"] + 1]}, frame) == ["box_sum"]
