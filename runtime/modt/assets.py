"""Files of the package: models/, profiles/ and systemd/, and the models of modt_evaluation if it is installed.

They lie beside runtime/ in a checkout and an editable install, and inside the package in a wheel.
"""

from __future__ import annotations

from pathlib import Path

from modt.errors import MisuseError

_PACKAGE = Path(__file__).resolve().parent
_ROOTS = (_PACKAGE / "data", _PACKAGE.parents[1])
_EVALUATION = (_PACKAGE.parent / "modt_evaluation", _PACKAGE.parents[1] / "tools" / "modt_evaluation")


def folder(kind: str) -> Path:
    """Folder of a kind: "models", "profiles" or "systemd"."""
    for root in _ROOTS:
        if (root / kind).is_dir():
            return root / kind
    raise MisuseError(_PACKAGE, f"no {kind}/ in this installation", "install modt again")


def find(kind: str, name: str, suffix: str, beside: Path = Path()) -> Path:
    """A file by its path below a folder, or by its name in the package; a wrong name is answered with all names."""
    path = beside / name
    if path.suffix == suffix or len(Path(name).parts) > 1:
        if path.is_file():
            return path
        raise MisuseError(path, "no such file", f"give a {suffix} file, or a name: {_names(kind, suffix)}")
    inside = {path.stem: path for path in shipped(kind, suffix)}
    if name not in inside:
        raise MisuseError(name, f"not among the {kind}", f"use one of: {_names(kind, suffix)}")
    return inside[name]


def shipped(kind: str, suffix: str) -> list[Path]:
    """Files of a kind by name, with those of the evaluation."""
    folders = (folder(kind), *(root / kind for root in _EVALUATION))
    return sorted((path for place in folders for path in place.glob(f"*{suffix}")), key=lambda path: path.name)


def _names(kind: str, suffix: str) -> str:
    return ", ".join(path.stem for path in shipped(kind, suffix))
