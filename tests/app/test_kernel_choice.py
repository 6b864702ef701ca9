"""Choice of the kernels of the segmentation, and how it is reported."""

from __future__ import annotations

import logging

import pytest

from modt.app import assembly, checks
from modt.errors import MisuseError
from modt.native.library import NotAvailableError
from modt.segmentation.kernels import NUMPY


@pytest.fixture
def none_compiled(monkeypatch):
    monkeypatch.delenv(assembly.VARIABLE, raising=False)

    def load():
        raise NotAvailableError("not compiled for riscv64; install modt again")

    monkeypatch.setattr(assembly, "load", load)


def test_numpy_takes_their_place_with_a_warning(none_compiled, caplog):
    with caplog.at_level(logging.WARNING):
        assert assembly.chosen_kernels("auto") is NUMPY
    assert "run on NumPy" in caplog.text
    assert "not compiled for riscv64" in caplog.text


def test_numpy_where_it_is_asked_for_is_no_reason_to_warn(none_compiled, caplog):
    assert assembly.chosen_kernels("numpy") is NUMPY
    assert not caplog.text


def test_compiled_ones_that_are_asked_for_and_missing_are_an_error(none_compiled):
    with pytest.raises(MisuseError, match="native: not compiled for riscv64"):
        assembly.chosen_kernels("native")


def test_the_environment_wins(none_compiled, monkeypatch, caplog):
    monkeypatch.setenv(assembly.VARIABLE, "numpy")
    assert assembly.chosen_kernels("native") is NUMPY
    monkeypatch.setenv(assembly.VARIABLE, "fast")
    with pytest.raises(MisuseError, match="MODT_KERNELS: no kernels 'fast'; use one of: auto, native, numpy"):
        assembly.chosen_kernels("numpy")


def test_the_check_fails_where_they_cannot_be_chosen(none_compiled):
    finding = checks.kernels(lambda: assembly.chosen_kernels("native").name)
    assert finding.level == checks.FAIL
    assert "segmentation.kernels" in str(finding)
