"""Readers of live sensors, for tests."""

from types import SimpleNamespace

from modt.sources.stream import Reception


def scripted(*batches, **counts):
    """A reader that hands over batches of sweeps, one a call, and raises those that are errors.

    `counts` are those of its Reception.
    """
    waiting = list(batches)

    def read(timeout_s):
        batch = waiting.pop(0) if waiting else []
        if isinstance(batch, Exception):
            raise batch
        return batch

    return SimpleNamespace(profile=None, reception=Reception(**counts), read=read, close=lambda: None)
