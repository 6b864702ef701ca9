"""The directory of a run."""

from __future__ import annotations

import itertools
import json
from pathlib import Path
from typing import Any

from modt.errors import MisuseError
from modt.sinks.output import LineFile, replace_file, writing
from modt.sinks.records import line
from modt.sinks.tracks import frame_line
from modt.types import FrameResult

RUN, TRACKS, LEDGER, SUMMARY = "run.yaml", "tracks.jsonl", "ledger.jsonl", "summary.json"


class RunDirectory:
    """Creates DIR; an earlier run at that path is renamed.

    Attributes:
        path: the directory.
        kept: new path of the earlier run, None if there was none.

    Raises:
        MisuseError: the path is a file, or a directory that is no run.
        ModtError: it cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.kept: Path | None = None
        if path.exists() and not path.is_dir():
            raise MisuseError(path, "is a file", "give a directory as --out")
        with writing(path):
            if (path / TRACKS).exists():
                names = (path.with_name(f"{path.name}~{n}") for n in itertools.count(1))
                self.kept = next(name for name in names if not name.exists())
                path.rename(self.kept)
            elif path.is_dir() and any(path.iterdir()):
                raise MisuseError(path, "holds files but no run", "give an empty or a new directory")
            path.mkdir(parents=True, exist_ok=True)

    def describe(self, text: str) -> None:
        """Write run.yaml, the configuration of the run."""
        replace_file(self.path / RUN, text)

    def tracks(self) -> LineFile[FrameResult]:
        """A new tracks.jsonl."""
        return LineFile(self.path / TRACKS, frame_line)

    def ledger(self) -> LineFile[dict[str, Any]]:
        """A new ledger.jsonl."""
        return LineFile(self.path / LEDGER, line)

    def summarise(self, summary: dict[str, Any]) -> None:
        """Write summary.json."""
        replace_file(self.path / SUMMARY, json.dumps(summary, indent=2) + "\n")
