"""`modt completion`: a script by which a shell completes commands, options and their values."""

from __future__ import annotations

import argparse
from importlib import import_module
from pathlib import Path

from modt import assets
from modt.cli import main as modt
from modt.cli import options
from modt.errors import MisuseError, install
from modt_commands import profile as modt_profile

SHELLS = ("bash", "zsh", "fish")


def add_parser(commands: options.Commands) -> None:
    """Declare the command and its options."""
    p = commands.add_parser(
        "completion", help="print a script by which a shell completes modt and modt-profile (extra completion)"
    )
    p.add_argument("shell", choices=SHELLS, metavar="|".join(SHELLS), help="shell")
    options.add_examples(
        p,
        'eval "$(modt completion bash)"                    in ~/.bashrc',
        'eval "$(modt completion zsh)"                     in ~/.zshrc, after compinit',
        "modt completion fish | source                      in config.fish",
    )
    p.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Print the script.

    Raises:
        MisuseError: shtab is not installed.
    """
    try:
        import shtab
    except ModuleNotFoundError as error:
        raise MisuseError("completion", f"needs {error.name}", install("completion")) from None
    for parser in parsers():
        _declare_values(parser)
        # The prefix that shtab would choose for modt-profile is the one that it gives to `modt profile`.
        prefix = parser.prog.replace("-", "")
        print(shtab.complete(parser, arguments.shell, root_prefix=prefix))
    return 0


def parsers() -> list[argparse.ArgumentParser]:
    """The parser of each program, with those of all its commands."""
    programs = []
    for name, modules in (("modt", modt.commands()), ("modt-profile", modt_profile.COMMANDS)):
        program = argparse.ArgumentParser(prog=name)
        commands = program.add_subparsers()
        for module in dict.fromkeys(modules.values()):
            import_module(module).add_parser(commands)
        programs.append(program)
    return programs


def _declare_values(parser: argparse.ArgumentParser) -> None:
    """State the values that the parsers leave open: files, and the names of the shipped profiles."""
    from shtab import FILE

    profiles = sorted(path.stem for path in assets.folder("profiles").glob("*.yaml"))
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                _declare_values(command)
        elif "--profile" in action.option_strings:
            action.choices = profiles
        elif action.type is Path:
            action.complete = FILE  # type: ignore[attr-defined]
