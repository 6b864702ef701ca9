"""The directory of a run."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from modt.errors import MisuseError
from modt.sinks.output import writing
from modt.sinks.records import JsonLines
from modt.sinks.tracks import TrackLines

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
                self.kept = next(
                    p for n in range(1, 10_000) if not (p := path.with_name(f"{path.name}~{n}")).exists()
                )
                path.rename(self.kept)
            elif path.is_dir() and any(path.iterdir()):
                raise MisuseError(path, "holds files but no run", "give an empty or a new directory")
            path.mkdir(parents=True, exist_ok=True)

    def describe(self, text: str) -> None:
        """Write run.yaml, the configuration of the run."""
        self._write(RUN, text)

    def tracks(self) -> TrackLines:
        """A new tracks.jsonl."""
        return TrackLines(self.path / TRACKS)

    def ledger(self) -> JsonLines:
        """A new ledger.jsonl."""
        return JsonLines(self.path / LEDGER)

    def summarise(self, summary: dict[str, Any]) -> None:
        """Write summary.json."""
        self._write(SUMMARY, json.dumps(summary, indent=2) + "\n")

    def _write(self, name: str, text: str) -> None:
        """Write a file atomically."""
        path, partial = self.path / name, self.path / f".{name}.part"
        with writing(path):
            partial.write_text(text, encoding="utf-8")
            partial.replace(path)
