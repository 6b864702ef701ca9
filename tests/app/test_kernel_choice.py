"""Choice of `segmentation.kernels`."""

import logging

import pytest

from modt.app import assembly
from modt.errors import MisuseError
from modt.native.library import NotAvailableError
from modt.segmentation.kernels import NUMPY


@pytest.fixture
def none_compiled(monkeypatch):
    monkeypatch.delenv(assembly.VARIABLE, raising=False)

    def load():
        raise NotAvailableError("not compiled for riscv64; install modt again")

    monkeypatch.setattr(assembly, "load", load)


@pytest.mark.parametrize(("choice", "warned"), [("auto", True), ("numpy", False)])
def test_numpy_takes_their_place_with_a_warning_unless_it_is_asked_for(none_compiled, caplog, choice, warned):
    with caplog.at_level(logging.WARNING):
        assert assembly.chosen_kernels(choice) is NUMPY
    assert ("not compiled for riscv64" in caplog.text) is warned


def test_compiled_ones_that_are_asked_for_and_missing_are_an_error(none_compiled):
    with pytest.raises(MisuseError, match="native: not compiled for riscv64"):
        assembly.chosen_kernels("native")


def test_the_environment_wins(none_compiled, monkeypatch, caplog):
    monkeypatch.setenv(assembly.VARIABLE, "numpy")
    assert assembly.chosen_kernels("native") is NUMPY
    monkeypatch.setenv(assembly.VARIABLE, "fast")
    with pytest.raises(MisuseError, match=r"MODT_KERNELS: no kernels .fast.; use one of"):
        assembly.chosen_kernels("numpy")
