"""Compilation and loading of the kernels."""

from __future__ import annotations

import platform

import pytest

from modt.native import build, library
from modt.native.build import BASELINE, X86_64_V3

MODERN = "processor : 0\nflags : sse2 avx avx2 bmi1 bmi2 f16c fma abm movbe\n"


def test_instructions_of_a_processor():
    assert library.instructions(MODERN) == X86_64_V3
    assert library.instructions(MODERN.replace("avx2 ", "")) == BASELINE
    assert library.instructions("") == BASELINE


def test_the_library_fits_the_processor_and_one_of_other_sources_is_refused(tmp_path, monkeypatch):
    compiled = build.FOLDER
    if not (compiled / build.library_name(BASELINE)).exists():
        pytest.skip("the checkout has no compiled kernels")
    if platform.machine() == "x86_64":  # one set of instructions elsewhere
        for text, kind in ((MODERN, X86_64_V3), ("flags : sse2\n", BASELINE)):
            (tmp_path / "cpuinfo").write_text(text)
            assert library.load(compiled, tmp_path / "cpuinfo")[1] == kind
    assert library.load(compiled, tmp_path / "missing")[1] == BASELINE
    monkeypatch.setattr(build, "source_hash", lambda: "of a later version")
    with pytest.raises(library.NotAvailableError, match="compiled from other sources; install modt again"):
        library.load(compiled)


def test_a_missing_and_a_broken_library_are_named(tmp_path):
    with pytest.raises(library.NotAvailableError, match=f"not compiled for {platform.machine()}"):
        library.load(tmp_path)
    for kind in (BASELINE, X86_64_V3):
        (tmp_path / build.library_name(kind)).write_bytes(b"no library")
    with pytest.raises(library.NotAvailableError, match="cannot be loaded"):
        library.load(tmp_path)


def test_no_compiler_is_named(monkeypatch, tmp_path):
    monkeypatch.setenv("CC", "no-such-compiler -O2")
    with pytest.raises(build.NoCompilerError, match=r"no C compiler \(no-such-compiler -O2\)"):
        build.compile_all(tmp_path)
    monkeypatch.setenv("CC", "false")
    with pytest.raises(build.NoCompilerError, match="false fails"):
        build.compile_all(tmp_path)
