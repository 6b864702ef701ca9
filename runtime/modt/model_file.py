"""Files of models: content and hash, and the model that may lie beside one."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from pathlib import Path

from modt import assets
from modt.errors import MisuseError, refuse_pipe

MAX_BYTES = 64 << 20
"""Size of a model file at most."""
REMEDY = "use a model of modt, or of modt train"


@dataclass(frozen=True)
class ModelFile:
    """A model as it was read from its file.

    Attributes:
        path: the file.
        content: its bytes.
        sha256: its hash, equal to that in its card (the file beside it that ends in .md) if there is one.
    """

    path: Path
    content: bytes
    sha256: str

    @classmethod
    def find(cls, name: str) -> ModelFile:
        """Read a model by its name in models/, or by its path.

        Raises:
            MisuseError: no such model, or as `read`.
        """
        return cls.read(assets.find("models", name, ".onnx"))

    @classmethod
    def read(cls, path: Path) -> ModelFile:
        """Read a model.

        Raises:
            MisuseError: the file cannot be read, is too large, or is not the model of its card.
        """
        card = path.with_suffix(".md")
        refuse_pipe(path, REMEDY)
        try:
            with path.open("rb") as file:
                content = file.read(MAX_BYTES + 1)
            text = card.read_text(encoding="utf-8") if card.is_file() else ""
        except (OSError, UnicodeDecodeError) as error:
            raise MisuseError(path, f"cannot be read ({error})", "make model and card readable") from None
        if len(content) > MAX_BYTES:
            raise MisuseError(path, f"larger than {MAX_BYTES >> 20} MiB", REMEDY)
        sha256 = hashlib.sha256(content).hexdigest()
        named = re.search(r"sha256\W+([0-9a-f]{64})", text)
        if named and named[1] != sha256:
            cause = f"is not the model of {card.name} (sha256 {sha256})"
            raise MisuseError(path, cause, "restore the model or its card")
        return cls(path, content, sha256)

    def beside(self, suffix: str) -> ModelFile | None:
        """Read the model of the same name with a suffix, None if there is none.

        Raises:
            MisuseError: as `read`.
        """
        path = self.path.with_stem(f"{self.path.stem}{suffix}")
        return self.read(path) if path.is_file() else None
