"""All targets."""

from __future__ import annotations

from tests.fuzz import files, runs, streams

TARGETS = {target.name: target for target in (*files.TARGETS, *streams.TARGETS, *runs.TARGETS)}
