"""Assembly of the pipeline: `segmentation.kernels`, and a budget that buys something."""

import dataclasses
import itertools
import logging

import pytest

from modt import profile
from modt.app import assembly
from modt.errors import MisuseError
from modt.geometry import FieldOfView
from modt.native.library import NotAvailableError
from modt.segmentation.kernels import Kernels

BASE = profile.load("vlp-16")


def pipeline(mode="accurate", **scheduler):
    config = dataclasses.replace(BASE, scheduler=dataclasses.replace(BASE.scheduler, **scheduler))
    return assembly.pipeline(assembly.MODES[mode], config, FieldOfView())


@pytest.mark.parametrize(
    ("mode", "scheduler", "warned"),
    [
        ("accurate", {"cpu_ms_per_frame": 0.5}, True),
        ("efficient", {"energy_mJ_per_frame": 2.0}, True),
        ("accurate", {"cpu_ms_per_frame": 1.0}, False),
        ("conventional", {"cpu_ms_per_frame": 0.5}, False),
    ],
)
def test_a_budget_below_the_price_of_a_call_is_warned_of(mode, scheduler, warned, monkeypatch, caplog):
    """A call takes 0.4 ms by the clock of this test. The margin is half of that."""
    clock = type("Clock", (), {"thread_time_ns": itertools.count(0, 400_000).__next__})
    monkeypatch.setattr(assembly, "time", clock)
    with caplog.at_level(logging.WARNING):
        pipeline(mode, **scheduler)
    assert len(caplog.records) == warned
    assert ("raise" in caplog.text) is warned


def test_numpy_takes_the_place_of_missing_kernels_and_the_environment_wins(monkeypatch, caplog):
    def load():
        raise NotAvailableError("not compiled for riscv64; install modt again")

    monkeypatch.delenv(assembly.VARIABLE, raising=False)
    monkeypatch.setattr(assembly, "load", load)
    assert type(assembly.chosen_kernels("numpy")) is Kernels
    assert not caplog.records
    assert type(assembly.chosen_kernels("auto")) is Kernels
    assert "not compiled for riscv64" in caplog.text
    with pytest.raises(MisuseError, match="native: not compiled for riscv64"):
        assembly.chosen_kernels("native")
    monkeypatch.setenv(assembly.VARIABLE, "numpy")
    assert type(assembly.chosen_kernels("native")) is Kernels
    monkeypatch.setenv(assembly.VARIABLE, "fast")
    with pytest.raises(MisuseError, match=r"MODT_KERNELS: no kernels .fast.; use one of"):
        assembly.chosen_kernels("numpy")
