"""Generate the options in docs/commands.md from the argument parsers."""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator
from itertools import chain

from modt_commands.completion import parsers
from tools.docs.sections import DOCS, replace_section, write

DOCUMENT = DOCS / "commands.md"
MARK = "tools.docs.commands"


def commands(parser: argparse.ArgumentParser, summary: str = "") -> Iterator[tuple[str, argparse.ArgumentParser]]:
    """Summary and parser of each command of a program or a group."""
    groups = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    if not groups:
        yield summary, parser
    for group in groups:
        summaries = {action.dest: action.help or "" for action in group._choices_actions}
        for name, command in group.choices.items():
            yield from commands(command, summaries[name])


def cells(parser: argparse.ArgumentParser, action: argparse.Action) -> tuple[str, str]:
    """Name and meaning of an option or argument of a command."""
    words = "|".join(map(str, action.choices)) if action.choices else action.metavar or ""
    name = " ".join(filter(None, [*action.option_strings, "" if action.nargs == 0 else str(words)]))
    return f"`{name}`", parser._get_formatter()._expand_help(action)


def _is_shown(action: argparse.Action) -> bool:
    return action.dest != "help" and action.help != argparse.SUPPRESS


def page() -> str:
    """A table of the options that commands share, and a list of the other options of each command."""
    found = [command for program in parsers() for command in commands(program)]
    rows = {p.prog: [cells(p, action) for action in p._actions if _is_shown(action)] for _, p in found}
    number = Counter(chain.from_iterable(rows.values()))
    lines = ["## Shared options", "", "| option | | of |", "|---|---|---|"]
    for option in (option for option, n in number.items() if n > 1):
        name, text = (cell.replace("|", r"\|") for cell in option)
        users = ", ".join(prog.split()[-1] for prog, cells_of in rows.items() if option in cells_of)
        lines.append(f"| {name} | {text} | {users} |")
    for summary, parser in found:
        lines += ["", f"## {parser.prog}", "", f"{summary[0].upper()}{summary[1:]}.", ""]
        lines += [f"- {name}: {text}" for name, text in rows[parser.prog] if number[name, text] == 1]
    return "\n".join(lines).replace("\n\n\n", "\n\n").rstrip()


def document() -> str:
    """The page with its section up to date."""
    return replace_section(DOCUMENT.read_text(encoding="utf-8"), MARK, page())


def main() -> None:
    write(__doc__, DOCUMENT, document)


if __name__ == "__main__":
    main()
