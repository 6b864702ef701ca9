"""A profile as text, with the evidence of each value."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

from modt_desk.sensor_fit.findings import Finding

CHECK = "check this"
WIDTH = 116


def profile_text(title: str, findings: Sequence[Finding]) -> str:
    """YAML of the fitted values; a comment states how each was measured."""
    lines = [f"# {title}"]
    stage = ""
    for found in sorted(findings, key=lambda f: [g.stage for g in findings].index(f.stage)):
        if found.stage != stage:
            stage = found.stage
            lines.append(f"{stage}:")
        evidence = found.evidence if found.sure else f"{CHECK}: {found.evidence}"
        value = _plain(found.value)
        if len(value) > 20:
            lines += [f"  # {evidence}", *textwrap.wrap(f"{found.key}: {value}", WIDTH, **_INDENT)]
        else:
            lines.append(f"  {found.key}: {value} # {evidence}")
    return "\n".join(lines) + "\n"


_INDENT: dict[str, Any] = {"initial_indent": "  ", "subsequent_indent": "    "}


def _plain(value: Any) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(f'{number:g}' for number in value)}]"
    return "null" if value is None else f"{value:g}" if isinstance(value, float) else str(value)


def doubts(findings: Sequence[Finding]) -> list[str]:
    """A line for each uncertain value."""
    return [f"{f.stage}.{f.key}: {f.evidence}" for f in findings if not f.sure]
