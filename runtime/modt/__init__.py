"""modt: detects and tracks what moves around a robot, on one CPU core, and accounts for the energy that takes.

Names are imported when they are first used: the command line pins the process to its core before NumPy loads.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from modt.classes import CLASS_NAMES
    from modt.library import MOTION_NAMES, Pipeline, PointKind, TrackedObjects, open

__version__ = "0.1.0"
__all__ = ["CLASS_NAMES", "MOTION_NAMES", "Pipeline", "PointKind", "TrackedObjects", "__version__", "open"]


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'modt' has no attribute {name!r}")
    from modt import classes, library

    return getattr(library, name, None) or getattr(classes, name)
