"""List the commands under tools/."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parent


def commands() -> Iterator[tuple[str, str]]:
    """Module and first docstring line of each module with a `main`. None is imported."""
    for path in sorted([*ROOT.glob("[!_]*.py"), *ROOT.glob("*/*.py")]):
        if path.parent.name.startswith("modt_"):
            continue  # packages by themselves
        tree = ast.parse(path.read_text(encoding="utf-8"))
        if any(isinstance(node, ast.FunctionDef) and node.name == "main" for node in tree.body):
            module = ".".join(path.relative_to(ROOT.parent).with_suffix("").parts)
            yield module, (ast.get_docstring(tree) or "").partition("\n")[0]


def main() -> None:
    table = list(commands())
    width = max(len(module) for module, _ in table)
    for module, summary in table:
        print(f"python -m {module:<{width}}  {summary}")


if __name__ == "__main__":
    main()
