"""Compiles the C sources into a wheel; without a compiler the wheel has none, and modt runs on NumPy."""

from __future__ import annotations

import importlib.util
import os
import sysconfig
import tempfile
from pathlib import Path
from types import ModuleType
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

TARGET, OUT = "MODT_TARGET", "modt/native"
"""Environment variable: the machine a wheel is for, by `ziglang`; this one, by its own compiler, if unset."""


def build_module(root: Path) -> ModuleType:
    """modt.native.build, without modt."""
    spec = importlib.util.spec_from_file_location("modt_build", root / "runtime" / OUT / "build.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class KernelsHook(BuildHookInterface[Any]):
    """Adds the libraries to the wheel; an editable install has them in its checkout."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile."""
        build, target, root = build_module(Path(self.root)), os.environ.get(TARGET), Path(self.root)
        editable = version == "editable"
        self.folder = tempfile.TemporaryDirectory()
        folder = root / "runtime" / OUT if editable else Path(self.folder.name)
        try:
            libraries = build.compile_all(folder, target)
        except build.NoCompilerError as error:
            if target is not None:
                raise
            self.app.display_warning(f"modt is built without compiled kernels and runs on NumPy: {error}")
            return
        if editable:
            return
        build_data["pure_python"] = False
        build_data["force_include"].update({str(path): f"{OUT}/{path.name}" for path in libraries})
        system = sysconfig.get_platform().replace("-", "_").replace(".", "_")
        tag = system if target is None else f"manylinux2014_{target}.musllinux_1_1_{target}"
        build_data["tag"] = f"py3-none-{tag}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove the libraries, which are in the wheel now."""
        self.folder.cleanup()
