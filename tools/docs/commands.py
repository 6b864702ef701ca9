"""Generate the options in docs/commands.md from the argument parsers."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

from modt.cli import main as modt
from modt.cli import profile as modt_profile
from tools.docs.sections import replace_section

DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "commands.md"
MARK = "tools.docs.commands"


def parsers() -> Iterator[tuple[str, argparse.ArgumentParser]]:
    """Summary and parser of each command."""
    for prog, commands in (("modt", modt.COMMANDS), ("modt-profile", modt_profile.COMMANDS)):
        choice = argparse.ArgumentParser(prog=prog).add_subparsers()
        for command in commands:
            command.add_parser(choice)
        summaries = {action.dest: action.help or "" for action in choice._choices_actions}
        yield from ((summaries[name], parser) for name, parser in choice.choices.items())


def row(parser: argparse.ArgumentParser, action: argparse.Action) -> str:
    """One option or argument of a command."""
    words = "|".join(map(str, action.choices)) if action.choices else action.metavar or ""
    name = " ".join(filter(None, [*action.option_strings, "" if action.nargs == 0 else str(words)]))
    cells = (f"`{name}`", parser._get_formatter()._expand_help(action))
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"


def page() -> str:
    """A table a command."""
    lines: list[str] = []
    for summary, parser in parsers():
        lines += ["", f"## {parser.prog}", "", f"{summary[0].upper()}{summary[1:]}.", "", "| option | |", "|---|---|"]
        lines += [row(parser, action) for action in parser._actions if action.dest != "help"]
    return "\n".join(lines[1:])


def document() -> str:
    """The page with its section up to date."""
    return replace_section(DOCUMENT.read_text(encoding="utf-8"), MARK, page())


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    DOCUMENT.write_text(document(), encoding="utf-8")


if __name__ == "__main__":
    main()
