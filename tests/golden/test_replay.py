"""Behaviour against the golden replays."""

import copy
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


@pytest.mark.parametrize(
    ("change", "noticed"),
    [
        (lambda f: f.update(deferred=f["deferred"] + 1), ["deferred"]),
        (lambda f: f["id"].reverse(), ["id"]),
        (lambda f: f["points"].__setitem__(0, f["points"][0] + 1), ["points"]),
        (lambda f: f.update(state="9" + f["state"][1:]), ["state"]),
        (lambda f: f.update({"class": f["class"].swapcase()}), ["class"]),
        (lambda f: next(iter(f["box"].values())).__setitem__(0, 10**6), ["box of"]),
        (lambda f: next(iter(f["box"].values())).__setitem__(0, next(iter(f["box"].values()))[0] + 1), []),
        (lambda f: next(iter(f["box"].values())).__setitem__(0, next(iter(f["box"].values()))[0] + 2), ["box of"]),
        (lambda f: f["box"].pop(next(iter(f["box"]))), ["box"]),
        (lambda f: f["box_sum"].__setitem__(6, f["box_sum"][6] + f["proposals"] + 1), ["box_sum"]),
    ],
)
def test_a_changed_number_is_noticed(change, noticed):
    frame = next(f for f in replay.read(*replay.CASES[-1]) if f["box"])
    changed = copy.deepcopy(frame)
    change(changed)
    found = replay.differences(changed, frame)
    assert len(found) == len(noticed)
    assert all(f.startswith(n) for f, n in zip(found, noticed, strict=True))


def test_the_golden_files_stay_small():
    assert sum(replay.path(*case).stat().st_size for case in replay.CASES) < 150_000
