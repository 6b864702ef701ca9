"""The live source that a text names."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import parse_qsl

from modt.app import inputs
from modt.errors import MisuseError
from modt.schemes import open_sensor
from modt.sources.live.live_stream import LiveStream


def open_source(text: str, cores: frozenset[int] | None) -> LiveStream:
    """A sensor by its address, or a recording by its path, as if it were live; without one the synthetic one.

    `PATH?loop=yes` plays a recording for ever.

    Raises:
        MisuseError: no such sensor or recording.
    """
    if "://" in text:
        return open_sensor(text, cores)
    from modt.sources.live.played_reader import PlayedReader

    path, loop = _recording(text)
    stream = inputs.stream(inputs.Request(path=path))
    return LiveStream(stream.info, PlayedReader(stream, loop=loop), cores=cores)


def recorded_path(text: str) -> Path | None:
    """Where the frames of a source can be read again by their numbers; None where they cannot."""
    path, loop = (None, False) if "://" in text else _recording(text)
    return None if loop else path


def _recording(text: str) -> tuple[Path | None, bool]:
    """Path, None of the synthetic stream, and whether it is played for ever."""
    path, _, query = text.partition("?")
    options = dict(parse_qsl(query, keep_blank_values=True))
    loop = options.pop("loop", "no")
    if options or loop not in ("yes", "no"):
        raise MisuseError(text, f"option {query!r} is unknown", "write PATH or PATH?loop=yes")
    return Path(path) if path else None, loop == "yes"
