"""Generate the options in docs/commands.md from the argument parsers."""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator
from importlib import import_module
from itertools import chain
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
        for module in commands.values():
            import_module(module).add_parser(choice)
        yield from leaves(choice)


Choice = argparse._SubParsersAction  # action that holds the commands; it has no public name


def leaves(choice: Choice[argparse.ArgumentParser]) -> Iterator[tuple[str, argparse.ArgumentParser]]:
    """Summary and parser of the commands of a choice and of its groups."""
    summaries = {action.dest: action.help or "" for action in choice._choices_actions}
    for name, parser in choice.choices.items():
        groups = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
        for group in groups:
            yield from leaves(group)
        if not groups:
            yield summaries[name], parser


def cells(parser: argparse.ArgumentParser, action: argparse.Action) -> tuple[str, str]:
    """Name and meaning of an option or argument of a command."""
    words = "|".join(map(str, action.choices)) if action.choices else action.metavar or ""
    name = " ".join(filter(None, [*action.option_strings, "" if action.nargs == 0 else str(words)]))
    return f"`{name}`", parser._get_formatter()._expand_help(action)


def page() -> str:
    """A table of the options that commands share, and a list a command of its own."""
    rows = {p.prog: [cells(p, action) for action in p._actions if action.dest != "help"] for _, p in parsers()}
    number = Counter(chain.from_iterable(rows.values()))
    lines = ["## Shared options", "", "| option | | of |", "|---|---|---|"]
    for option in (option for option, n in number.items() if n > 1):
        name, text = (cell.replace("|", r"\|") for cell in option)
        users = ", ".join(prog.split()[-1] for prog, own in rows.items() if option in own)
        lines.append(f"| {name} | {text} | {users} |")
    for summary, parser in parsers():
        lines += ["", f"## {parser.prog}", "", f"{summary[0].upper()}{summary[1:]}.", ""]
        lines += [f"- {name}: {text}" for name, text in rows[parser.prog] if number[name, text] == 1]
    return "\n".join(lines).replace("\n\n\n", "\n\n").rstrip()


def document() -> str:
    """The page with its section up to date."""
    return replace_section(DOCUMENT.read_text(encoding="utf-8"), MARK, page())


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    DOCUMENT.write_text(document(), encoding="utf-8")


if __name__ == "__main__":
    main()
