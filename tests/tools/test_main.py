"""The table of commands, and each command's options."""

import importlib
import sys

import pytest

from modt.errors import MisuseError
from tools.__main__ import commands, main

COMMANDS = dict(commands())


def test_the_table_has_a_summary_of_each_command(capsys):
    main()
    assert "tools.train.build_models" in COMMANDS
    assert "tools.train.labelled_scans" not in COMMANDS
    assert [line.split(maxsplit=3)[2:] for line in capsys.readouterr().out.splitlines()] == [
        [*item] for item in COMMANDS.items()
    ]


@pytest.mark.parametrize("module", COMMANDS)
def test_a_command_has_help(module, monkeypatch, capsys):
    try:
        command = importlib.import_module(module)
    except (ModuleNotFoundError, MisuseError) as missing:
        pytest.skip(str(missing))
    monkeypatch.setattr(sys, "argv", [module, "--help"])
    with pytest.raises(SystemExit, match="0"):
        command.main()
    assert COMMANDS[module] in capsys.readouterr().out
