"""Generated sections of a document, between marks."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from tools.options import parser

DOCS = Path(__file__).resolve().parents[2] / "docs"


def replace_section(text: str, mark: str, section: str) -> str:
    """The document with a new text between `<!-- mark -->` and `<!-- end of mark -->`.

    Raises:
        ValueError: one of the marks is missing.
    """
    begin = f"<!-- {mark} -->"
    end = f"<!-- end of {mark} -->"
    before, rest = text.split(begin)
    _, after = rest.split(end)
    return f"{before}{begin}\n{section}\n{end}{after}"


def update(page: Path, mark: str, section: str) -> None:
    """Write a new text between the marks of a page."""
    page.write_text(replace_section(page.read_text(encoding="utf-8"), mark, section), encoding="utf-8")


def write(about: str | None, page: Path, document: Callable[[], str]) -> None:
    """Run a command without options that brings a page up to date."""
    parser(about).parse_args()
    page.write_text(document(), encoding="utf-8")
