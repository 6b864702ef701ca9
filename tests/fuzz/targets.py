"""All targets."""

from __future__ import annotations

from tests.fuzz import files, live, results, runs, streams

_GROUPS = (files, streams, runs, results, live)
TARGETS = {target.name: target for group in _GROUPS for target in group.TARGETS}
