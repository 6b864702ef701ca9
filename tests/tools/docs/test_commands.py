"""The generated page of the commands."""

from modt_desk.cli.completion import commands
from tools.docs.commands import DOCUMENT, document, page


def test_the_page_is_up_to_date():
    assert document() == DOCUMENT.read_text(encoding="utf-8")


def test_every_option_of_every_command_is_listed():
    shared, *lists = page().split("\n## ")
    rows = [line for line in shared.splitlines() if line.startswith("| `")]
    parsers = [command.parser for command in commands() if not command.names]
    for parser, own in zip(parsers, lists, strict=True):
        name = parser.prog.split()[-1]
        known = own + "\n".join(line for line in rows if name in line.split("|")[-2])
        for action in parser._actions:
            assert action.dest == "help" or (action.option_strings or [str(action.metavar)])[0] in known
