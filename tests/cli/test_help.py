"""The help of the commands, by itself or with --help."""

from __future__ import annotations

import argparse
import re
import shlex
from importlib import import_module

import pytest

from modt.cli import main, profile
from modt.schemes import SENSORS


def help_of(program, *arguments, capsys):
    """What --help prints."""
    with pytest.raises(SystemExit) as ended:
        program([*arguments, "--help"])
    assert ended.value.code == 0
    return capsys.readouterr().out


@pytest.mark.parametrize(
    ("program", "words"), [(main.main, []), (profile.main, []), (main.main, ["profile"])], ids=str
)
def test_a_bare_command_prints_its_help_and_fails(program, words, capsys):
    assert program(words) == 2
    bare = capsys.readouterr()
    assert (bare.out, bare.err) == (help_of(program, *words, capsys=capsys), "")


def test_the_bare_help_names_every_command(capsys):
    main.main([])
    assert set(re.findall(r"^    (\w+) ", capsys.readouterr().out, re.MULTILINE)) == set(main.COMMANDS)


def test_run_shows_an_address_of_every_sensor_and_a_recording(capsys):
    shown = help_of(main.main, "run", capsys=capsys)
    for scheme in SENSORS:
        assert re.search(rf"modt run '?{scheme}://", shown)
    assert "modt run 'DRIVE?loop=yes'" in shown


@pytest.mark.parametrize("command", ["replay", "run", "evaluate", "view"])
def test_examples_are_lines_that_the_parser_takes(command, capsys):
    lines = help_of(main.main, command, capsys=capsys).partition("examples:\n")[2].splitlines()
    assert len(lines) >= 3
    choice = argparse.ArgumentParser().add_subparsers()
    import_module(main.COMMANDS[command]).add_parser(choice)
    for line in lines:
        example, meaning = re.fullmatch(r"  (.*?) {2,}(\S.*)", line).groups()
        assert meaning
        prog, name, *words = shlex.split(example)
        assert (prog, name) == ("modt", command)
        assert vars(choice.choices[command].parse_args(words))


def test_the_two_commands_of_similar_name_point_to_each_other(capsys):
    assert "modt-profile" in help_of(main.main, "profile", capsys=capsys)
    assert "modt profile" in " ".join(help_of(profile.main, capsys=capsys).split())
