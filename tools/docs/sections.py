"""Generated sections of a document, between marks."""

from __future__ import annotations


def replace_section(text: str, mark: str, section: str) -> str:
    """The document with another text between `<!-- mark -->` and `<!-- end of mark -->`.

    Raises:
        ValueError: the document lacks one of them.
    """
    begin, end = f"<!-- {mark} -->", f"<!-- end of {mark} -->"
    before, rest = text.split(begin)
    _, after = rest.split(end)
    return f"{before}{begin}\n{section}\n{end}{after}"
