"""Docstrings begin with a noun or a verb that stands by itself."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DEPENDENT = re.compile(r"(Of|That of|By which|What)\b")
"""Beginnings that need a sentence before them."""
DESCRIPTION = re.compile(r"^ +\w[\w, ]*: (?:\([^)]*\) )?(?=of |that of |what )", re.MULTILINE)
"""An argument, attribute or value, whose description begins so."""


def docstrings(source: str):
    """Line and text of the docstrings in a source, those of constants and attributes included."""
    blocks = [ast.parse(source)]
    for block in blocks:
        for statement in block.body:
            if isinstance(getattr(statement, "body", None), list):
                blocks.append(statement)
            value = getattr(statement, "value", None) if isinstance(statement, ast.Expr) else None
            if isinstance(value, ast.Constant) and isinstance(value.value, str):
                yield statement.lineno, value.value.strip()


def test_no_docstring_begins_in_the_middle_of_a_sentence():
    files = [path for folder in ("runtime", "tools", "tests") for path in sorted((ROOT / folder).rglob("*.py"))]
    assert len(files) > 300
    found = [
        f"{path.relative_to(ROOT)}:{line}: {text.splitlines()[0]}"
        for path in files
        for line, text in docstrings(path.read_text(encoding="utf-8"))
        if DEPENDENT.match(text) or DESCRIPTION.search(text)
    ]
    assert found == []
