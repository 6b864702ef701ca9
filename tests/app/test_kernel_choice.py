"""Choice of `segmentation.kernels`."""

import logging

import pytest

from modt.app import kernel_choice
from modt.errors import MisuseError
from modt.native.library import NotAvailableError
from modt.segmentation.kernels import NUMPY


@pytest.fixture
def none_compiled(monkeypatch):
    monkeypatch.delenv(kernel_choice.VARIABLE, raising=False)

    def load():
        raise NotAvailableError("not compiled for riscv64; install modt again")

    monkeypatch.setattr(kernel_choice, "load", load)


@pytest.mark.parametrize(("choice", "warned"), [("auto", True), ("numpy", False)])
def test_numpy_takes_their_place_with_a_warning_unless_it_is_asked_for(none_compiled, caplog, choice, warned):
    with caplog.at_level(logging.WARNING):
        assert kernel_choice.choose(choice) is NUMPY
    assert ("not compiled for riscv64" in caplog.text) is warned


def test_compiled_ones_that_are_asked_for_and_missing_are_an_error(none_compiled):
    with pytest.raises(MisuseError, match="native: not compiled for riscv64"):
        kernel_choice.choose("native")


def test_the_environment_wins(none_compiled, monkeypatch, caplog):
    monkeypatch.setenv(kernel_choice.VARIABLE, "numpy")
    assert kernel_choice.choose("native") is NUMPY
    monkeypatch.setenv(kernel_choice.VARIABLE, "fast")
    with pytest.raises(MisuseError, match=r"MODT_KERNELS: no kernels .fast.; use one of"):
        kernel_choice.choose("numpy")
