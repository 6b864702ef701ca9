"""Stamps of a sensor on the host's clock."""

import pytest

from modt.sources.packets.device_clock import DeviceClock


def host_s(clock, device_s, received_s):
    time_s = clock.unwrapped(device_s, received_s)
    return time_s + clock.offset_s


def test_a_late_reception_moves_no_stamp():
    clock = DeviceClock()
    assert host_s(clock, 5.0, 1005.0) == 1005.0
    assert host_s(clock, 5.1, 1005.1 + 0.05) == pytest.approx(1005.1, abs=1e-4)
    assert host_s(clock, 5.2, 1005.2 - 0.01) == pytest.approx(1005.19)  # an earlier one: the delay was shorter


def test_a_drifting_clock_is_followed():
    clock = DeviceClock()
    worst_s = 0.0
    for k in range(36_000):  # an hour of a sensor that is 50 ppm slow
        true_s = 0.1 * k
        worst_s = max(worst_s, abs(host_s(clock, true_s * (1 - 50e-6), true_s) - true_s))
    assert worst_s < 1e-3


def test_a_clock_of_the_host_that_is_set_forward_is_followed():
    clock = DeviceClock()
    for k in range(300):
        time_s = host_s(clock, 0.1 * k, 0.1 * k + 0.5 * (k >= 50))
    assert time_s == pytest.approx(29.9 + 0.5, abs=1e-3)


def test_stamps_that_begin_again_continue():
    clock = DeviceClock(wrap_s=3600.0)
    before = host_s(clock, 3599.95, 50.0)
    assert host_s(clock, 0.05, 50.1) - before == pytest.approx(0.1, abs=1e-4)
    assert host_s(clock, 3599.99, 50.1) - before == pytest.approx(0.04, abs=1e-4)  # one that was overtaken
